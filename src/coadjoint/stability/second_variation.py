"""The energy–Casimir test: whether conserved quantities have a strict extremum at a steady motion."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import scipy.linalg
from scipy.optimize import minimize

from coadjoint.arrays import PyTree
from coadjoint.kernels.trace.evaluate import evaluate, tabulate
from coadjoint.mechanics.state import State
from coadjoint.stability.integrals import casimirs, conserved
from coadjoint.stability.reduced import IGNORABLE, Reduced
from coadjoint.stability.spectrum import Linearisation
from coadjoint.stability.steady import SteadyMotion

CRITICAL = 1e-7
"""dE − Σ λ_i dC_i counts as zero up to this fraction of dE."""

DEFINITE = 1e-7
"""The smallest eigenvalue of a definite form, relative to the largest, when variables are of a size."""

CANCELLED = 1e-11
"""A form up to this fraction of those of E and λ_i C_i, whose difference it is, counts as zero."""

FARTHEST = 1e4
"""Up to how many times the size that makes terms alike λ is looked for."""


@dataclass(frozen=True)
class EnergyCasimir:
    """The second variation of E − Σ λ_i C_i on the kernel of all dC_i.

    `verdict`: "stable" where it is definite, else "undecided", and `reason` says why. `eigenvalues`: of the form in
    variables scaled by their inertia. `multipliers`: λ_i by the names of the integrals.

    eigenvalues: shape (directions,).
    """

    verdict: str
    reason: str
    eigenvalues: np.ndarray
    multipliers: dict[str, float]


def energy_casimir(motion: SteadyMotion, linear: Linearisation, integrals: Sequence[Callable] = ()) -> EnergyCasimir:
    """Arnold's test: with d(E − Σ λ_i C_i) = 0 and a definite second variation on ∩ ker dC_i the motion is stable.

    motion: of co.stability.steady_motion. linear: its linearisation. integrals: see C_i.
    C_i: the polynomial Casimir functions of the reduced bracket modulo ignorable variables (for a neutrally buoyant
    vehicle P·P and P·Γ), the conserved ones among the system's `quantities`, and `integrals`, functions of a state.
    Where dC_i depend on one another, λ is not unique and one that makes the form definite is looked for. Then
    E − Σ λ_i C_i + c Σ(C_i − C_i⁰)² has a strict extremum for some c: nonlinear stability in the reduced space, up to
    ignorable variables and to symmetries that carry the motion. Forces invalidate it, and the verdict is "undecided".
    Raises ArgumentError for `integrals` that are not conserved.
    Source: Holm, Marsden, Ratiu and Weinstein (1985); Leonard (1997).
    """
    reduced = motion.reduced
    if reduced.system.forces is not None:
        return _undecided("forces act")
    names, derivatives, units = _derivatives(reduced, (*reduced.symmetries, *integrals))
    first, second = derivatives(motion.state)
    if not _energy_is_reduced(reduced, motion.state, first[0]):
        return _undecided("the energy depends on ignorable variables")
    charts = linear.charts
    slopes = first @ charts / units[:, None]
    forms = np.einsum("kij,ia,jb->kab", second, charts, charts) / units[:, None, None]
    dE, dC = slopes[0], slopes[1:]
    # A slope that is round-off against the curvature is none.
    dC[np.linalg.norm(dC, axis=1) <= 1e-9 * np.max(np.abs(forms[1:]), axis=(1, 2), initial=0.0)] = 0.0
    scale = float(np.linalg.norm(dE)) + float(np.max(np.abs(forms[0])))
    kept = [i for i, row in enumerate(dC) if np.linalg.norm(row) + np.max(np.abs(forms[i + 1])) > 1e-9]
    names, dC, forms = [names[i] for i in kept], dC[kept], forms[[0, *(i + 1 for i in kept)]]
    multipliers = np.linalg.lstsq(dC.T, dE, rcond=1e-9)[0] if len(dC) else np.zeros(0)
    if np.linalg.norm(dE - dC.T @ multipliers) > CRITICAL * scale:
        return _undecided("the energy is not critical on the level of the known integrals")
    found = _definite(names, dC, forms, multipliers, _flows(reduced, motion.state, linear))
    per = dict(zip(names, units[0] / units[[i + 1 for i in kept]], strict=True))
    return replace(found, multipliers={name: per[name] * x for name, x in found.multipliers.items()})


def _definite(
    names: list[str], dC: np.ndarray, forms: np.ndarray, multipliers: np.ndarray, flows: np.ndarray
) -> EnergyCasimir:
    """Look for λ = multipliers + t, t with Σ t_i dC_i = 0, that makes the form definite on the kernel of dC.

    Along the flows of symmetries, columns, the form is zero: they are left out.
    """
    kernel, freedom = _kernel(dC, forms.shape[1]), _kernel(dC.T, len(dC))
    kernel = kernel @ _kernel((kernel.T @ flows).T, kernel.shape[1])
    forms = np.einsum("kij,ia,jb->kab", forms, kernel, kernel)
    base = forms[0] - np.tensordot(multipliers, forms[1:], 1)
    freedom = freedom @ _that_tell(np.tensordot(freedom.T, forms[1:], 1))
    changes = np.tensordot(freedom.T, forms[1:], 1)
    if not base.size:
        return EnergyCasimir(
            "stable",
            "the integrals leave no direction",
            np.zeros(0),
            dict(zip(names, map(float, multipliers), strict=True)),
        )

    t = _best(base, changes)
    best = np.linalg.eigvalsh(base - np.tensordot(t, changes, 1))
    found = multipliers + freedom @ t
    terms = np.max(np.abs(forms), axis=(1, 2)) @ np.abs([1.0, *found])
    sign, margin = _sign(best, terms), _margin(best, terms)
    reason = {1: "positive definite", -1: "negative definite", 0: "indefinite"}[sign]
    if not sign and np.min(np.abs(best)) <= margin:
        reason = "degenerate"
    verdict = "stable" if sign else "undecided"
    return EnergyCasimir(verdict, reason, best, dict(zip(names, map(float, found), strict=True)))


def _flows(reduced: Reduced, state: State, linear: Linearisation) -> np.ndarray:
    """The flows of symmetries at the motion, columns, in the coordinates of the linearisation, but for fixed points."""
    if not reduced.symmetries:
        return np.zeros((len(linear.matrix), 0))
    found = linear.rows @ evaluate(reduced.flows, state).T
    return found[:, np.linalg.norm(found, axis=0) > 1e-9 * np.max(np.abs(found), initial=1.0)]


def _that_tell(changes: np.ndarray) -> np.ndarray:
    """Combinations of t, as columns, whose forms do not depend on one another; all others change nothing."""
    U, singular, _ = np.linalg.svd(changes.reshape(len(changes), changes.shape[1] ** 2), full_matrices=False)
    return U[:, singular > 1e-9 * np.max(singular, initial=1e-300)]


def _best(base: np.ndarray, changes: np.ndarray) -> np.ndarray:
    """t for which base − Σ t_i changes_i is definite, or as near to it as was found."""

    def eigenvalues(t: np.ndarray | float) -> np.ndarray:
        return np.linalg.eigvalsh(base - np.tensordot(np.atleast_1d(t), changes, 1))

    def margin(t: np.ndarray | float) -> float:
        """The smallest eigenvalue of ±form relative to the largest."""
        values = eigenvalues(t)
        return float(max(values[0], -values[-1]) / max(np.max(np.abs(values)), 1e-300))

    zero = np.zeros(len(changes))
    if not len(zero) or margin(zero) > DEFINITE:
        return zero
    if len(zero) == 1:
        return np.atleast_1d(max(_between(base, changes[0]), key=margin))
    each = np.max(np.abs(changes), axis=(1, 2))
    sizes = float(np.max(np.abs(base))) / np.maximum(each, max(1e-9 * float(np.max(each)), 1e-300))
    simplex = np.vstack([zero, np.diag(sizes)])

    def lack(t: np.ndarray, sign: float) -> float:
        """The largest eigenvalue of −sign · form, which is convex; none farther than FARTHEST, or it might not end."""
        return float(np.max(-sign * eigenvalues(t))) if np.all(np.abs(t) <= FARTHEST * sizes) else np.inf

    # Each sign has its own search: the one that is nearer at first would hide the other.
    options = {"initial_simplex": simplex}
    found = (minimize(lack, zero, (sign,), method="Nelder-Mead", options=options).x for sign in (1.0, -1.0))
    return max(found, key=margin)


def _between(base: np.ndarray, change: np.ndarray) -> list[float]:
    """Many t, one at least in each interval on which base − t change keeps its signature.

    These lie between its generalised eigenvalues, of which round-off makes some huge ones where `change` is singular.
    """
    with np.errstate(all="ignore"):
        found: Any = scipy.linalg.eigvals(base, change)
    real = np.isfinite(found) & (np.abs(found.imag) <= 1e-9 * np.abs(found))
    roots = np.sort(found[real].real)
    size = float(np.max(np.abs(base))) / max(float(np.max(np.abs(change))), 1e-300)
    spread = size * np.geomspace(1e-4, FARTHEST, 25)
    return [0.0, *spread, *-spread, *(0.5 * (roots[1:] + roots[:-1]))]


def _undecided(reason: str) -> EnergyCasimir:
    return EnergyCasimir("undecided", reason, np.zeros(0), {})


def _margin(eigenvalues: np.ndarray, terms: float) -> float:
    """Up to where an eigenvalue of a form counts as zero."""
    return max(DEFINITE * float(np.max(np.abs(eigenvalues))), CANCELLED * terms)


def _sign(eigenvalues: np.ndarray, terms: float) -> int:
    """1 or −1 for a definite form, else 0."""
    margin = _margin(eigenvalues, terms)
    return int(np.min(eigenvalues) > margin) - int(np.max(eigenvalues) < -margin)


def _kernel(rows: np.ndarray, size: int) -> np.ndarray:
    """An orthonormal basis of the vectors that the rows send to zero; as columns."""
    if not len(rows) or not size:
        return np.eye(size)
    _, singular, Vt = np.linalg.svd(rows)
    return Vt[int(np.sum(singular > 1e-9 * max(singular[0], 1e-300))) :].T


@lru_cache(maxsize=16)
def _derivatives(reduced: Reduced, integrals: tuple[Callable, ...]) -> tuple[tuple[str, ...], Callable, np.ndarray]:
    """The names of C_i, a function of a state — first and second derivatives of E and C_i by z, a row each — and sizes.

    The size of E is that of `scales`; that of C_i is |dC_i| in natural sizes at motions around, by all of a, so that
    a·a has one although it stays on every orbit.
    """
    functions = {**casimirs(reduced), **conserved(reduced, integrals)}

    def values(state: State) -> PyTree:
        moved = reduced.with_momenta(state)
        return jnp.stack([reduced.energy(moved), *(f(moved) for f in functions.values())])

    def both(state: State) -> PyTree:
        zero = jnp.zeros(sum(reduced.sizes))
        return tuple(d(lambda z: values(reduced.moved(state, z)))(zero) for d in (jax.jacfwd, jax.hessian))

    def ambient(state: State) -> PyTree:
        at = (state.xi, state.n, state.nu, state.a)
        parts = jax.jacfwd(lambda at: values(state.replace(xi=at[0], n=at[1], nu=at[2], a=at[3])))(at)
        return jnp.concatenate(parts, axis=1)

    slope = tabulate(ambient, reduced.near)
    scales, room = reduced.scales, len(reduced.near.a)
    unit = np.concatenate([scales.z[: sum(reduced.sizes[:3])], scales.y[len(scales.y) - room :]])
    around = [np.linalg.norm(slope(state) * unit, axis=1) for state in reduced.around]
    sizes = np.array([scales.energy, *np.max(around, axis=0)[1:]])
    return tuple(functions), tabulate(both, reduced.near), np.where(sizes > 0, sizes, 1.0)


def _energy_is_reduced(reduced: Reduced, state: State, dE: np.ndarray) -> bool:
    """Whether E does not change along ignorable directions at constant momenta."""
    scales = reduced.scales
    y_z = reduced.slopes(state).y_z * scales.z / scales.y[:, None]
    k = reduced.ignorable / scales.y[:, None]
    # δy = k: the part that the chart reaches; the other part does not change the orbit of a.
    z = np.linalg.lstsq(y_z, k, rcond=None)[0]
    z = z[:, np.linalg.norm(y_z @ z - k, axis=0) < IGNORABLE * np.linalg.norm(k, axis=0)]
    terms = scales.energy * np.linalg.norm(z, axis=0)
    return bool(np.all(np.abs(dE * scales.z @ z) <= IGNORABLE * terms))
