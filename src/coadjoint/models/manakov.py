"""The free rigid body in n dimensions, on SO(n), as Manakov's Lax pair with a spectral parameter."""

from __future__ import annotations

from functools import partial
from itertools import combinations

import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, PyTree
from coadjoint.checks import float64
from coadjoint.errors import ArgumentError
from coadjoint.groups import SOn
from coadjoint.kernels.trace.evaluate import traced
from coadjoint.mechanics.members import Quantity
from coadjoint.mechanics.parameters import Parameters
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.models.quantities import checked
from coadjoint.models.rigid_body import UNITS

__all__ = ["body", "integrals", "lax_pair", "spectral_polynomial", "start"]

SKEW = 1e-12
"""The largest entry of Ω + Ωᵀ, relative to Ω, that is round-off."""
WATCHED = 4
"""The highest power of L whose integrals runs observe."""


def body(*, moments: Quantity) -> System:
    """A rigid body in n dimensions that nothing acts on: M = JΩ + ΩJ, Ṁ = [M, Ω], with J = diag(λ₁, …, λ_n).

    λ_i = ∫x_i² dm, so that the moment of inertia of a turn in the plane (i, j) is λ_i + λ_j; for n = 3 it is Euler's
    body with the principal moments λ₂ + λ₃, λ₁ + λ₃, λ₁ + λ₂. For every number z

        d/dt (M + zJ²) = [M + zJ², Ω + zJ],

    a Lax pair: the coefficients of zʲ in tr(M + zJ²)ᵏ are integrals, of degree k − j in M, of which those with j = 0
    are Casimir functions, and as many as make the body integrable are independent. ℋ(μ) = ½ Σ_{i<j} M_ij²/(λ_i + λ_j).
    Runs observe those up to k = 4, `trace_k_j`. `co.IsospectralMidpoint()` and every rule with co.Cayley() keep the
    Casimirs to round-off and the others in a band.

    moments: λ_i, (n,), n from 2, kg m², of which any two have a positive sum. Raises ArgumentError for others.
    Source: Manakov, Note on the integration of Euler's equations of the dynamics of an n-dimensional rigid body,
    Funct. Anal. Appl. 10 (1976).
    """
    p = Parameters(moments=_moments(moments, "moments"))
    n = len(p.moments)
    pairs = [(k, j) for k in range(2, min(WATCHED, n) + 1) for j in range(k - 1) if (k - j) % 2 == 0]
    watched = {f"trace_{k}_{j}": partial(integral, power=k, of_z=j) for k, j in pairs}
    units = {name: _unit(k - j, 2 * j) for name, (k, j) in zip(watched, pairs, strict=True)}
    checks = partial(checked, {"moments": partial(_moments, count=n)})
    options: dict[str, PyTree] = {"quantities": watched, "units": {**UNITS, **units}, "checks": checks}
    return System(SOn(n), hamiltonian=energy, parameters=p, name=f"rigid body in {n} dimensions", **options)


def energy(mu, p):
    """ℋ = ½ Σ_{i<j} M_ij²/(λ_i + λ_j)."""
    i, j = np.array(list(combinations(range(p.moments.shape[0]), 2))).T
    return 0.5 * jnp.sum(mu**2 / (p.moments[i] + p.moments[j]))


def integral(state, p, *, power: int, of_z: int):
    """The coefficient of zʲ in tr(M + zJ²)ᵏ."""
    return _traces(_matrix(state.mu, p.moments), p.moments, power)[of_z]


def start(manakov: System, *, angular_velocity: Quantity) -> State:
    """The state of a body that turns with Ω at R = 1.

    angular_velocity: Ω, skew (n, n), or its entries Ω_ji, i < j, by rows, (n(n − 1)/2,), rad/s: the rate at which e_i
    turns to e_j. Raises ArgumentError for others.
    """
    n = _size(manakov)
    omega = np.asarray(float64(angular_velocity, "Argument `angular_velocity`"))
    if omega.shape == (n, n) and np.max(np.abs(omega + omega.T)) <= SKEW * np.max(np.abs(omega)):
        omega = omega[tuple(np.array(list(combinations(range(n), 2))).T[::-1])]
    if omega.shape == (n, n):
        part = np.max(np.abs(omega + omega.T))
        raise ArgumentError(f"Argument `angular_velocity` must be skew, but Ω + Ωᵀ has an entry of {part:.3g} rad/s.")
    if omega.shape != (manakov.group.dim,):
        raise ArgumentError(
            f"Argument `angular_velocity` must be skew, ({n}, {n}), or its {manakov.group.dim} entries below the "
            f"diagonal, but has shape {omega.shape}."
        )
    return manakov.state(xi=omega)


def lax_pair(manakov: System, mu: Array, z: complex) -> tuple[Array, Array]:
    """L = M + zJ² and B = Ω + zJ, (…, n, n) each, of momenta μ (…, n(n − 1)/2), with L̇ = [L, B] at every z.

    z: one number. Units of L are kg m²/s, so that z is in 1/(kg m² s) and those of B are rad/s.
    Raises ArgumentError for others.
    """
    moments = _lambdas(manakov)
    checks.expect(isinstance(z, (int, float, complex, np.number)) and np.isfinite(z), z, "z", "a finite number")
    M = _matrix(_momenta(manakov, mu), moments)
    Omega = M / (moments[:, None] + moments + (2 * np.abs(moments) + 1) * np.eye(len(moments)))  # M_ii = 0
    return M + z * np.diag(moments**2), Omega + z * np.diag(moments)


def spectral_polynomial(manakov: System, mu: Array, z: complex) -> np.ndarray:
    """The coefficients (n + 1,) of det(w − L(z)) in w, from wⁿ on, of a momentum μ (n(n − 1)/2,).

    Where it is 0 is the spectral curve, which the motion does not change. Raises ArgumentError as `lax_pair`.
    """
    if np.ndim(mu) > 1:
        raise ArgumentError(f"Argument `mu` must be that of one momentum, but has shape {np.shape(mu)}.")
    found = np.poly(lax_pair(manakov, mu, z)[0])
    return found.real if np.isreal(z) else found


def integrals(manakov: System, mu: Array) -> dict[tuple[int, int], np.ndarray]:
    """The coefficients of zʲ in tr(M + zJ²)ᵏ by (k, j), k up to n and k − j even, (…,) each, of μ (…, n(n − 1)/2).

    Those with k − j odd are 0, and those of J alone are left out. Raises ArgumentError for others.
    """
    moments = _lambdas(manakov)
    M = _matrix(_momenta(manakov, mu), moments)
    rows = {k: _traces(M, moments, k) for k in range(2, len(moments) + 1)}
    return {(k, j): row[j] for k, row in rows.items() for j in range(k - 1) if (k - j) % 2 == 0}


def _traces(M: Array, moments: Array, power: int) -> list[PyTree]:
    """The coefficients of zʲ in tr(M + zJ²)ᵏ, j = 0 … k."""
    squares = moments**2
    terms = [M, squares[:, None] * np.eye(M.shape[-1])]
    for _ in range(power - 1):
        first = [term @ M for term in terms]
        second = [term * squares for term in terms]
        terms = [first[0], *(a + b for a, b in zip(first[1:], second[:-1], strict=True)), second[-1]]
    xp = jnp if traced(M) else np
    return [xp.trace(term, axis1=-2, axis2=-1) for term in terms]


def _matrix(mu: Array, moments: Array) -> Array:
    """M, (…, n, n), with M_ji = μ_ij for i < j."""
    n = moments.shape[0]
    places = np.full((n, n), mu.shape[-1])
    i, j = np.array(list(combinations(range(n), 2))).T
    places[j, i] = np.arange(mu.shape[-1])
    xp = jnp if traced(mu) else np
    below = xp.concatenate([mu, xp.zeros((*mu.shape[:-1], 1))], axis=-1)[..., places]
    return below - xp.swapaxes(below, -1, -2)


def _moments(value: object, name: str, count: int | None = None) -> Array:
    """λ_i, (n,); of `count` where that is given."""
    found = float64(value, f"Argument `{name}`")
    if np.ndim(found) != 1 or len(found) < 2 or (count is not None and len(found) != count):
        wanted = "two or more numbers" if count is None else f"{count} numbers"
        raise ArgumentError(f"Argument `{name}` must hold {wanted}, but has shape {np.shape(found)}.")
    if not traced(found):
        least, next_one = np.argsort(found)[:2]
        if not found[least] + found[next_one] > 0:
            raise ArgumentError(
                f"Argument `{name}` must have positive sums of any two, but those of the axes {least + 1} and "
                f"{next_one + 1} make {found[least] + found[next_one]:g}: a body has a mass."
            )
    return found


def _unit(of_momentum: int, of_moments: int) -> str:
    return f"(kg m²/s)^{of_momentum}" + (f" (kg m²)^{of_moments}" if of_moments else "")


def _lambdas(manakov: System) -> np.ndarray:
    _size(manakov)
    return np.asarray(manakov.parameters.moments)  # pyright: ignore[reportOptionalMemberAccess]


def _momenta(manakov: System, mu: Array) -> np.ndarray:
    """μ, (…, n(n − 1)/2), finite."""
    if traced(mu):
        raise ArgumentError(
            "Integrals of momenta are computed from numbers: under jax.jit observe `trace_k_j` instead."
        )
    return np.asarray(checks.array(mu, "mu", f"(…, {manakov.group.dim})"))


def _size(manakov: System) -> int:
    """n of a body; raises ArgumentError for another system."""
    checks.expect(
        isinstance(manakov, System) and manakov.hamiltonian is energy, manakov, "manakov", "a body of co.models.manakov"
    )
    return manakov.group.matrix_size
