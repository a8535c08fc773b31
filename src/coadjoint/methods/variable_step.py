"""The symplectic-energy-momentum method: a step size chosen such that the discrete energy stays (mathematics: 8)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.difference_maps import DifferenceMap
from coadjoint.errors import ArgumentError
from coadjoint.groups.group import Element
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.method import Claims, Method, Start
from coadjoint.methods.simpson import Simpson
from coadjoint.methods.step import Step
from coadjoint.spaces.space import require_flat

BLUNT = 1e-10
"""The least |dE/dh|h along the solutions of the base rule, relative to |E| + |⟨μ, ξ⟩| + |⟨π, ν⟩|, that determines h.

Below it E_k = E₀ does not determine h, as at a relative equilibrium: round-off would choose.
"""


class Pace(NamedTuple):
    """The memory of a variable step: h/dt of this step, E₀, whether it is known, and how many steps were fixed.

    One number each.
    """

    ratio: Array
    energy: Array
    known: Array
    fixed: Array


@dataclass(frozen=True)
class Paced(Step):
    """The base rule over h = ratio·dt."""

    constrainable = False

    base: Step

    @property
    def difference_map(self) -> DifferenceMap:  # type: ignore[override]
        return self.base.difference_map

    def require_fit(self, system: System) -> None:
        acts = system.forces, system.internal
        if any(acts) or system.depends_on_time or system.takes("inputs") or system.takes("internal"):
            raise ArgumentError(
                "VariableStep holds the energy, which forces, explicit time, inputs and internal states change: use a "
                "fixed step, such as co.Midpoint(), for this system."
            )
        # Over chords of a curved Q the discrete energy of a rule crosses the true one, and no h holds it there.
        if not isinstance(self.base, Simpson):
            what = f"VariableStep over {type(self.base).__name__}"
            require_flat(system.additional, what, "leave out the base, which is then co.Simpson()")
        self.base.require_fit(system)

    def remember(self, system: System, state: State) -> State:
        zero = 0.0 * state.t
        return state.replace(memory=Pace(zero + 1.0, zero, zero, zero))

    def blocks(self, system: System) -> tuple[int, ...]:
        return self.base.blocks(system)

    def relative(self, system: System, record: State, h: Scalar) -> Element:
        return self.base.relative(system, record, h * record.memory.ratio)

    def guess(self, system: System, state: State, h: Scalar) -> Array:
        return self.base.guess(system, state, h * state.memory.ratio)

    def record(self, system: System, state: State, h: Scalar, z: Array) -> State:
        return self.base.record(system, state, h * state.memory.ratio, z)

    def equations(self, system: System, record: State, h: Scalar) -> Array:
        return self.base.equations(system, record, h * record.memory.ratio)

    def chart(self, system: System, record: State, h: Scalar) -> Array | float:
        return self.base.chart(system, record, h * record.memory.ratio)

    def advance(self, system: System, record: State, h: Scalar) -> State:
        """The base rule's; the first step, over dt itself, gives E₀."""
        pace = record.memory
        first = jnp.where(pace.known > 0, pace.energy, self.energy(system, record, h))
        after = self.base.advance(system, record, h * pace.ratio)
        return after.replace(memory=pace._replace(energy=first, known=jnp.ones_like(pace.known)))

    def size(self, record: State, h: Scalar) -> Array:
        return h * record.memory.ratio

    def energy(self, system: System, record: State, h: Scalar) -> Array:
        return self.base.energy(system, record, h * record.memory.ratio)

    def sources(self, system: System, record: State, h: Scalar) -> tuple[Array, Array]:
        return self.base.sources(system, record, h * record.memory.ratio)

    def balance(self, system: System, record: State, h: Scalar, after: State) -> Array:
        return self.base.balance(system, record, h * record.memory.ratio, after)

    def newton_residual(self, system: System, record: State, h: Scalar, after: State) -> Array:
        return self.base.newton_residual(system, record, h * record.memory.ratio, after)


@dataclass(frozen=True)
class _Predict(Paced):
    """The base rule over the last h, for the velocities that the search starts from.

    E depends on h by O(h²) alone: velocities with an error of O(h) would hide it.
    """

    tolerant = True

    def advance_if(self, system: System, record: State, h: Scalar, sound: Array) -> State:
        return record


@dataclass(frozen=True)
class _Search(Paced):
    """E_k(ξ, ν, h) = E₀ together with the base rule's equations, for (ξ, y, h/dt)."""

    within: tuple[float, float] = (0.25, 4.0)
    tolerant = True

    def blocks(self, system: System) -> tuple[int, ...]:
        return (*self.base.blocks(system), 1)

    def guess(self, system: System, state: State, h: Scalar) -> Array:
        return jnp.concatenate([super().guess(system, state, h), state.memory.ratio[None]])

    def record(self, system: System, state: State, h: Scalar, z: Array) -> State:
        return super().record(system, self._over(state, z[-1]), h, z[:-1])

    def _over(self, state: State, ratio: Array) -> State:
        return state.replace(memory=state.memory._replace(ratio=ratio))

    def equations(self, system: System, record: State, h: Scalar) -> Array:
        pace = record.memory
        gap = self.energy(system, record, h) - pace.energy
        row = jnp.where(pace.known > 0, gap, pace.ratio - 1.0)
        return jnp.concatenate([super().equations(system, record, h), row[None]])

    def chart(self, system: System, record: State, h: Scalar) -> Array | float:
        """That of the base rule; 1 for a ratio out of bounds, and where E does not depend on it."""
        low, high = self.within
        ratio = record.memory.ratio
        usable = (ratio > low) & (ratio < high) & self._sharp(system, record, h)
        return jnp.where(usable, super().chart(system, record, h), 1.0)

    def _sharp(self, system: System, record: State, h: Scalar) -> Array:
        """Whether E changes with h along the solutions of the base rule by more than BLUNT; true for the first step.

        dE/dh = ∂_hE − ∂_zE (∂_zR)⁻¹ ∂_hR for its equations R(z, h) = 0.
        """
        pace, z = record.memory, self.base.guess(system, record, h * record.memory.ratio)

        def rows(z: Array, ratio: Array) -> tuple[Array, Array]:
            here = Paced.record(self, system, self._over(record, ratio), h, z)
            return Paced.equations(self, system, here, h), self.energy(system, here, h)

        of_z, along_z = jax.jacfwd(rows)(z, pace.ratio)
        of_ratio, along_ratio = jax.jacfwd(rows, argnums=1)(z, pace.ratio)
        slope = along_ratio - along_z @ jnp.linalg.solve(of_z, of_ratio)
        size = jnp.abs(pace.energy) + jnp.abs(record.mu @ record.xi) + jnp.abs(record.pi @ record.nu)
        return (jnp.abs(slope * pace.ratio) > BLUNT * size) | (pace.known == 0)

    def advance_if(self, system: System, record: State, h: Scalar, sound: Array) -> State:
        """The same state with h/dt of its step; without a solution h/dt is 1, and the step is counted as fixed."""
        pace = record.memory
        ratio = jnp.where(sound > 0, pace.ratio, 1.0)
        return record.replace(memory=pace._replace(ratio=ratio, fixed=pace.fixed + 1.0 - sound))


@dataclass(frozen=True, init=False)
class VariableStep(Method):
    """A symmetric rule over steps h_k with E_k(ξ_k, ν_k, h_k) = E₀, E_k = −∂_hΛ: keeps energy, momenta, symplecticity.

    The unknowns are (ξ, ν, h/dt). One ordinary step over dt gives E₀, which is held, so that round-off does not add up.
    h/dt stays inside `within`. If no such step exists, or if E does not depend on h (a relative equilibrium), the step
    has the fixed size dt; the certificate reports the share of these steps. The method keeps the *discrete* energy and
    the symplectic form of extended phase space, with (t, −E).
    E_k = ℋ + 3h²K + O(h³) with h²K the first term of the rule's modified Hamiltonian, so that h ∝ |K|^{−1/3}: no h
    exists where K changes its sign. The default `Simpson` has K = −⟨α, α⟩/24 − …, of one sign, with α the acceleration
    off the straight motion, if the kinetic energy is positive. With Cayley's map K < 0 also wherever a body turns; with
    the exponential h grows without bound where the motion is straight for a moment.
    `duration` is that of N steps over dt; the time at which a run of N steps ends follows from the motion.
    base: a symmetric rule of one stage. within: bounds of h/dt, around 1. start: the base's unless given.
    Raises ArgumentError for other bases and bounds, and for systems with changing energy.
    Source: Kane, Marsden, Ortiz 1999.
    """

    base: Method
    within: tuple[float, float]

    def __init__(
        self, base: Method | None = None, within: tuple[float, float] = (0.25, 4.0), start: Start | None = None
    ):
        base = Simpson() if base is None else base
        if not isinstance(base, Method) or not base.symmetric or not _plain(base):
            raise ArgumentError(
                "VariableStep needs a symmetric rule of one stage: co.Simpson(co.Cayley()), co.Midpoint() or "
                f"co.Trapezoidal(), but got {base!r}."
            )
        given = {
            "difference_map": base.difference_map,
            "start": start or base.start,
            "base": base,
            "within": _bounds(within),
        }
        for name, value in given.items():
            object.__setattr__(self, name, value)
        self.__post_init__()

    @property
    def order(self) -> int:
        return self.base.order

    @property
    def claims(self) -> Claims:
        """With the step from t_k to t_{k+1} that its memory decides, the map of phase space alone is not symplectic."""
        return Claims(self.order, symmetric=False, symplectic=False, energy="discrete")

    @property
    def variable(self) -> bool:
        return True

    def holds(self, records: State) -> Array:
        """Whether the claim holds: for the first step, which gives E₀, and for steps that are not fixed."""
        return (np.asarray(records.memory.known) == 0) | (np.asarray(records.memory.ratio) != 1.0)

    def over_fixed_steps(self, records: State, h: Scalar) -> tuple[State, Array]:
        """With E₀ unknown, a step has the requested size."""
        pace = records.memory
        one = np.ones_like(pace.ratio)
        return records.replace(memory=pace._replace(ratio=one, known=0.0 * one)), h * np.asarray(pace.ratio)

    @property
    def stages(self) -> tuple[tuple[Step, float], ...]:
        step = self.base.stages[0][0]
        return (_Predict(step), 1.0), (_Search(step, self.within), 1.0), (Paced(step), 1.0)

    @property
    def title(self) -> str:
        return f"VariableStep({self.base.title})"


def _plain(base: Method) -> bool:
    """Whether a method is one variational stage over the full step, without memory."""
    alone = len(base.stages) == 1 and type(base.stages[0][0]).remember is Step.remember
    return alone and base.claims.symplectic and not base.variable


def _bounds(within: PyTree) -> tuple[float, float]:
    """The bounds of h/dt; raises ArgumentError unless they are two numbers with 0 < low < 1 < high."""
    try:
        low, high = map(float, within)
    except (TypeError, ValueError):
        low = high = 0.0
    fits = 0 < low < 1 < high < float("inf")
    checks.expect(fits, within, "within", "two bounds of h/dt with 0 < low < 1 < high, as in (0.25, 4)")
    return low, high
