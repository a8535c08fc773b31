"""Steady motions: relative equilibria of a system, found by Newton's iteration from a guess."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from scipy.optimize import least_squares

from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.errors import ArgumentError
from coadjoint.kernels.trace.evaluate import tabulate
from coadjoint.mechanics.declared_constraints import require_free
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.portable import Remade
from coadjoint.spaces.named import Named
from coadjoint.stability.integrals import casimirs, require_conserved
from coadjoint.stability.reduced import IGNORABLE, Reduced

FOUND = 1e-9
"""Rates up to this fraction of their terms count as zero."""

GIVES_WAY = 0.01
"""The weight of a condition relative to that of an equation of motion, in natural sizes, where not all can be met."""

TRIPS = 40
"""Newton's iterations at most."""


@dataclass(frozen=True)
class SteadyMotion:
    """A motion whose velocities and advected parameters are constant, except for ignorable variables.

    `state`: one state of it, a start for co.simulate. `residual`: the largest remaining rate, relative to its terms.
    `free`: the values found for free quantities. `reduced`: the equations around it, whose `rates` are the speeds along
    the given symmetries.
    """

    system: System
    state: State
    residual: float
    free: dict[str, PyTree]
    reduced: Reduced


def steady_motion(
    system: System,
    guess: State,
    *,
    conditions: Callable[[State], object] | None = None,
    free: Sequence[str] | Mapping[str, float] = (),
    symmetries: Sequence[Callable[[State], PyTree]] = (),
) -> SteadyMotion:
    """The steady motion near a guess: Y(y) = 0 for the reduced equations ẏ = Y(y), modulo what they do not depend on.

    With y = (μ, n, π, a) and ξ, n, ν, a as unknowns, a on its orbit through the guess:
    ad*_ξμ + ∂_aℓ⋄a + ∂_nℓ⋄n + π⋄ν + T = 0, ∂_nℓ + L*_ξπ + f = 0, ξ·a = 0, and ν − ξ·n = 0 for what of n is not
    ignorable. Without forces these are the critical points of ℋ on a coadjoint orbit, and come in families: the one
    nearest to the guess is found, or the one that meets the conditions.

    system: without explicit time. guess: a state of the system, `system.state(…)`. conditions: a function of the state
    whose values must vanish, as `lambda s: s.nu[0] - 1.5`. free: names of constants that may change to meet them, of
    the internal state or the inputs, such as `("rudder",)`, or a dictionary of them with the sizes of change that count
    as one: where many motions do, the one of least change is found. symmetries: integrals C_i, functions of a state,
    whose flows may carry the motion, Y = Σ λ_i X_{C_i}: a critical point of ℋ − Σ λ_i C_i. With the axial momentum of a
    symmetric top, regular precession is steady. Raises ArgumentError if no steady motion is found, or if C_i is not an
    integral.
    """
    asked = None if conditions is None else lambda state, _: conditions(state)
    return Search(system, guess, asked, free, symmetries=symmetries).find(guess)


class Search(Remade):
    """The search for steady motions of one kind, at many values: `find(guess, aim)` with conditions(state, aim) = 0.

    Its equations are traced once. aim: the first one, an array of any shape, by default 0. names: what the conditions
    are about. remedy: what to do where none is found. Other arguments and errors as in `steady_motion`.
    """

    def __init__(
        self,
        system: System,
        near: State,
        conditions: Callable[[State, PyTree], PyTree] | None = None,
        free: Sequence[str] | Mapping[str, float] = (),
        aim: Scalar = 0.0,
        names: Sequence[str] = (),
        symmetries: Sequence[Callable[[State], PyTree]] = (),
        remedy: str = "Give a nearer guess, other conditions, or free an actuator that can hold it.",
    ):
        require_free(system, "Steady motions")
        self.remedy = remedy
        self.reduced = Reduced(system, near, symmetries)
        require_conserved(self.reduced, self.reduced.symmetries)
        self.free, self.names = tuple(free), tuple(names)
        self.sizes = [int(np.size(_held(near, name)[1])) for name in self.free]
        self.scales = [float(free[name]) if isinstance(free, Mapping) else 1.0 for name in self.free]
        self.charts = self._charts()
        self.width = self.charts.shape[1]
        C, carried, scales = self.reduced.essential, len(self.reduced.symmetries), self.reduced.scales
        self.terms = GIVES_WAY * scales.rate * (np.abs(C) @ scales.y)
        conditions = conditions or self._on_the_orbit_of(near)

        def equations(w: Array, guess: State, aim: Array) -> Array:
            state = self._moved(guess, w)
            wanted = conditions(self.reduced.with_momenta(state), aim)
            rate = self.reduced.phase(state, w[len(w) - carried :])[1]
            return jnp.concatenate([C @ rate / self.terms, jnp.ravel(jnp.asarray(wanted, dtype=float))])

        def both(w: Array, guess: State, aim: Array) -> tuple[Array, Array]:
            return equations(w, guess, aim), jax.jacfwd(equations)(w, guess, aim)

        self._zero = np.zeros(self.width + sum(self.sizes) + carried)
        given = self._zero, near, np.asarray(aim, dtype=float)
        self._both, self._state = tabulate(both, *given), tabulate(self._with_momenta, *given[:2])

    def find(self, guess: State, aim: Scalar = 0.0) -> SteadyMotion:
        """The steady motion near the guess at this aim, an array of the shape of the first one."""

        def both(w: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            return self._both(w, guess, np.asarray(aim, dtype=float))

        w = _solve(both, self._zero)
        state = self._state(w, guess)
        relative = self._relative(state, *both(w))
        residual = float(np.max(relative, initial=0.0))
        if not residual <= FOUND:
            raise ArgumentError(
                f"No steady motion was found near the guess: {self._what(relative, both(w)[0])}. {self.remedy}"
            )
        found = {name: np.asarray(_held(state, name)[1]) for name in self.free}
        reduced = self.reduced
        if reduced.symmetries:
            reduced = Reduced(reduced.system, guess, reduced.symmetries, w[-len(reduced.symmetries) :])
        return SteadyMotion(reduced.system, state, residual, found, reduced)

    def _charts(self) -> np.ndarray:
        """z of w in natural sizes: all but ignorable changes of n, which nothing would hold."""
        dim, ambient, *_ = self.reduced.sizes
        unit = np.diag(self.reduced.scales.z)
        within = self.reduced.essential[:, dim : dim + ambient]
        held = np.linalg.svd(within)[2][: np.linalg.matrix_rank(within)] if ambient else np.zeros((0, 0))
        n = unit[:, dim : dim + ambient] @ held.T
        return np.concatenate([unit[:, :dim], n, unit[:, dim + ambient :]], axis=1)

    def idle(self, guess: State, aim: Scalar = 0.0) -> list[str]:
        """Those of `free` that change nothing where the guess has them, such as a propeller that stands.

        aim: an array of the shape of the first one.
        """
        slope = self._both(self._zero, guess, np.asarray(aim, dtype=float))[1]
        ends = self.width + np.cumsum([0, *self.sizes])
        columns = [slope[:, first:last] for first, last in pairwise(ends)]
        return [name for name, part in zip(self.free, columns, strict=True) if not np.any(part)]

    def _on_the_orbit_of(self, near: State) -> Callable[[State, PyTree], PyTree]:
        """Without forces: the Casimir functions are those of the guess. Without that, Newton halves all velocities."""
        functions = () if self.reduced.system.forces is not None else tuple(casimirs(self.reduced).values())
        functions = (*functions, *self.reduced.symmetries)
        if not functions:
            return lambda state, aim: jnp.zeros(0)
        both = tabulate(
            lambda s: _values_and_slopes(functions, self.reduced.with_momenta(s), self.reduced.scales.y), near
        )
        wanted, slopes = both(near)
        known = slopes > IGNORABLE * np.max([both(state)[1] for state in self.reduced.around], axis=0)
        weights = np.where(known, 1 / np.where(known, slopes, 1.0), 0.0)
        return lambda state, aim: weights * (jnp.stack([f(state) for f in functions]) - wanted)

    def _moved(self, guess: State, w: Array) -> State:
        state = self.reduced.moved(guess, self.charts @ w[: self.width])
        ends = self.width + np.cumsum([0, *self.sizes])
        parts = [w[first:last] for first, last in pairwise(ends)]
        for name, scale, change in zip(self.free, self.scales, parts, strict=True):
            field, value = _held(state, name)
            changed = jnp.asarray(value) + scale * change.reshape(np.shape(value))
            state = state.replace(**{field: _replaced(getattr(state, field), name, changed)})
        return state

    def _with_momenta(self, w: Array, guess: State) -> State:
        """The state with its momenta, as a start."""
        return self.reduced.with_momenta(self._moved(guess, w)).replace(from_velocities=True)

    def _relative(self, state: State, value: np.ndarray, slope: np.ndarray) -> np.ndarray:
        """Every equation relative to the sizes of its terms, J times the unknowns."""
        scale = self.reduced.scales.z
        moving = [state.xi, state.n, state.nu, scale[len(scale) - self.reduced.sizes[3] :]]
        unknowns = [np.linalg.pinv(self.charts / scale[:, None]) @ (np.concatenate(moving) / scale)]
        unknowns += [np.ravel(_held(state, name)[1]) / s for name, s in zip(self.free, self.scales, strict=True)]
        unknowns += [np.ones(len(self.reduced.symmetries))]
        sizes = np.abs(np.concatenate(unknowns))
        terms = np.abs(slope) @ np.maximum(sizes, 1e-3 * max(float(np.max(sizes, initial=0.0)), 1e-300))
        # An equation that vanishes with all of its terms is met as well as the others: its natural size is 1/GIVES_WAY.
        return np.abs(value) / np.maximum(terms, 1e-6 * max(float(np.max(terms, initial=0.0)), 1 / GIVES_WAY))

    def _what(self, relative: np.ndarray, value: np.ndarray) -> str:
        """The residual that is furthest from zero, in words."""
        worst, C = int(np.argmax(relative)), self.reduced.essential
        if worst >= len(C):
            k = worst - len(C)
            what = self.names[k] if k < len(self.names) else f"condition {k + 1}"
            return f"{what} is off by {value[worst]:.3g}"
        index = int(np.searchsorted(np.cumsum(self.reduced.sizes[:3]), np.argmax(np.abs(C[worst])), side="right"))
        kind = ("a torque", "a velocity of n", "a force", "a rate of an advected parameter")[index]
        return f"{kind} of {abs(value[worst] * self.terms[worst]):.3g} is left"


def _solve(both: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]], start: np.ndarray) -> np.ndarray:
    """The zero near the start: Newton's iteration of least change; where that fails, least squares in between."""
    w, solved = _newton(both, start)
    if solved:
        return w

    def slope(w: np.ndarray) -> Array:
        return _finite(both(w)[1])

    jacobian: Any = slope
    found = least_squares(lambda w: _finite(both(w)[0]), start, jac=jacobian, x_scale="jac", max_nfev=60)
    return _newton(both, found.x)[0]


def _newton(both: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]], w: np.ndarray) -> tuple[np.ndarray, bool]:
    """Newton's iteration with halved steps, until round-off; and whether it came there by quadratic convergence."""
    value, slope = map(_finite, both(w))
    size = float(np.linalg.norm(value))
    for _ in range(TRIPS):
        change = np.linalg.lstsq(slope, -value, rcond=1e-10)[0]
        for part in (1.0, 0.5, 0.25, 0.1, 0.01):
            better, along = map(_finite, both(w + part * change))
            if float(np.linalg.norm(better)) < (1 - 0.1 * part) * size:
                break
        else:
            return w, float(np.linalg.norm(change)) <= 1e-8 * (1 + float(np.linalg.norm(w)))
        w, value, slope, size = w + part * change, better, along, float(np.linalg.norm(better))
    return w, False


def _values_and_slopes(functions: Sequence[Callable], state: State, scale: np.ndarray) -> tuple[PyTree, PyTree]:
    """The functions at a state, and the sizes of their derivatives by (μ, π) in natural sizes of y."""

    def values(momenta: tuple[Array, Array]) -> Array:
        mu, pi = momenta
        return jnp.stack([f(state.replace(mu=mu, pi=pi)) for f in functions])

    dim, room = len(state.mu), len(state.pi)
    by_mu, by_pi = jax.jacrev(values)((state.mu, state.pi))
    sizes = jnp.abs(by_mu) @ scale[:dim] + jnp.abs(by_pi) @ scale[dim + room : dim + 2 * room]
    return values((state.mu, state.pi)), sizes


def _finite(value: np.ndarray) -> np.ndarray:
    return np.where(np.isfinite(value), value, 1e12)


def _held(state: State, path: str) -> tuple[str, PyTree]:
    """Whether a name, or a path such as `battery.position`, is one of the internal state or the inputs; its value."""
    for field in ("internal", "inputs"):
        value = getattr(state, field)
        for name in path.split("."):
            value = value.asdict().get(name) if isinstance(value, Named) else None
        if value is not None and not isinstance(value, Named):
            return field, value
    known = [key for held in (state.internal, state.inputs) if isinstance(held, Named) for key in held]
    raise ArgumentError(
        f"Argument `free` must name numbers of the internal state or the inputs of the guess, but has {path!r}; "
        f"there is: {', '.join(known) or 'nothing'}."
    )


def _replaced(values: PyTree, path: str, value: PyTree) -> PyTree:
    """The values with one of them replaced."""
    name, _, rest = path.partition(".")
    return values.replace(**{name: _replaced(getattr(values, name), rest, value) if rest else value})
