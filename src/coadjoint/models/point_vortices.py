"""Point vortices in the plane and on a sphere: right-invariant Hamiltonian systems, as the fluid's vorticity is."""

from __future__ import annotations

from functools import partial
from typing import Any

import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, PyTree
from coadjoint.checks import float64
from coadjoint.errors import ArgumentError
from coadjoint.groups import SO3, DirectProduct, Heisenberg
from coadjoint.kernels.trace.evaluate import traced
from coadjoint.mechanics.members import Quantity
from coadjoint.mechanics.parameters import Parameters
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.models.memory import require_room_at
from coadjoint.models.quantities import checked, positive

__all__ = ["plane", "plane_positions", "plane_start", "sphere", "sphere_positions", "sphere_start"]

APART = 1e-9
"""Vortices nearer than this, relative to the largest distance, are at one place."""
ON_SPHERE = 1e-9
"""How far |x| may be from the radius, relative to it."""

_PLANE = {"g": "1", "xi": "m²/s^(3/2)", "xi_body": "m²/s^(3/2)", "mu": "m²/s^(1/2), 1"}
_SPHERE = {"xi": "1/s", "xi_body": "1/s", "mu": "m⁴/s"}
_BOTH = {"energy": "m⁴/s²", "discrete_energy": "m⁴/s²"}


def plane(*, circulations: Quantity) -> System:
    """N point vortices in the plane, Γ_i ẋ_i = ∂H/∂y_i, Γ_i ẏ_i = −∂H/∂x_i, H = −1/(2π) Σ_{i<j} Γ_iΓ_j ln |r_i − r_j|.

    It is the Lie–Poisson equation on the dual of the Heisenberg algebra, the central extension of the translations:
    μ = (√|Γ_i| x_i, sgn Γ_i √|Γ_i| y_i, 1), of which the last is a Casimir function, and ℋ(μ) = H, right-invariant.
    ∂²ℋ/∂μ² is singular, so that it needs co.HamiltonianMidpoint(), here the implicit midpoint rule. That keeps the
    impulse ΣΓ_i r_i and the angular impulse ΣΓ_i |r_i|² to round-off and H in a band, and turns a rigidly rotating
    configuration by arcsin(hΩ) a step.

    circulations: Γ_i, (N,), two or more, none zero, m²/s. H is per unit of density. Raises ArgumentError for others.
    Source: Newton, The N-Vortex Problem (Springer 2001), section 1.1.
    """
    given = _circulations(circulations, "circulations")
    watched = {"impulse_x": impulse_x, "impulse_y": impulse_y, "angular_impulse": angular_impulse}
    units = {**_PLANE, **_BOTH, "impulse_x": "m³/s", "impulse_y": "m³/s", "angular_impulse": "m⁴/s"}
    return _system(Heisenberg(len(given)), plane_energy, {"circulations": given}, watched, units, "point vortices")


def plane_energy(mu, p):
    """H = −1/(2π) Σ_{i<j} Γ_iΓ_j ln |r_i − r_j|."""
    i, j = np.triu_indices(p.circulations.shape[0], 1)
    r = plane_positions(mu, p.circulations)
    apart = jnp.sum((r[i] - r[j]) ** 2, axis=1)
    return -jnp.sum(p.circulations[i] * p.circulations[j] * jnp.log(apart)) / (4 * np.pi)


def plane_positions(mu: Array, circulations: Array) -> Array:
    """r_i, (…, N, 2), m, of momenta (…, 2N + 1): `plane_positions(run.dataset.mu.values, circulations)`.

    Raises ArgumentError for other shapes.
    """
    mu, gamma = _momenta(mu, circulations, 2, 1)
    xp, N = _arrays(mu, gamma), gamma.shape[0]
    root = xp.sqrt(xp.abs(gamma))
    return xp.stack([mu[..., :N] / root, mu[..., N:-1] / (xp.sign(gamma) * root)], axis=-1)


def plane_start(vortices: System, *, positions: Quantity) -> State:
    """The state with the vortices at r_i. positions: (N, 2), m, all different; raises ArgumentError for others."""
    gamma = _of(vortices, plane_energy, "plane")
    r = _positions(positions, len(gamma), 2)
    root = np.sqrt(np.abs(gamma))
    return vortices.state(mu=np.concatenate([root * r[:, 0], np.sign(gamma) * root * r[:, 1], [1.0]]))


def impulse_x(state, p):
    """ΣΓ_i x_i."""
    return p.circulations @ plane_positions(state.mu, p.circulations)[:, 0]


def impulse_y(state, p):
    """ΣΓ_i y_i."""
    return p.circulations @ plane_positions(state.mu, p.circulations)[:, 1]


def angular_impulse(state, p):
    """ΣΓ_i |r_i|²."""
    return p.circulations @ jnp.sum(plane_positions(state.mu, p.circulations) ** 2, axis=1)


def sphere(*, circulations: Quantity, radius: Quantity) -> System:
    """N point vortices on a sphere, ẋ_i = 1/(4πR) Σ_j Γ_j x_j × x_i / (R² − x_i·x_j), |x_i| = R.

    It is the Lie–Poisson equation on so(3)*ᴺ with μ_i = RΓ_i x_i and ℋ = −1/(4π) Σ_{i<j} Γ_iΓ_j ln |x_i − x_j|²,
    right-invariant: ξ_i is the rate at which the i-th vortex is carried. ∂²ℋ/∂μ² may be singular, so that it needs
    co.HamiltonianMidpoint(), or co.IsospectralMidpoint() for hundreds of vortices. Both keep |x_i| and the moment of
    vorticity ΣΓ_i x_i to round-off and H in a band.

    circulations: Γ_i, (N,), two or more, none zero, m²/s. radius: R, m. H is per unit of density. Raises ArgumentError
    for others. Source: Newton, The N-Vortex Problem (Springer 2001), section 4.1.
    """
    given = {"circulations": _circulations(circulations, "circulations"), "radius": positive(radius, "radius")}
    watched = {f"moment_{axis}": partial(moment, axis=k) for k, axis in enumerate("xyz")}
    units = {**_SPHERE, **_BOTH, **dict.fromkeys(watched, "m³/s")}
    group = DirectProduct(*[SO3()] * len(given["circulations"]))
    return _system(group, sphere_energy, given, watched, units, "point vortices on a sphere")


def sphere_energy(mu, p):
    """H = −1/(4π) Σ_{i<j} Γ_iΓ_j ln |x_i − x_j|², whose slopes are small along x_i, where they move nothing."""
    i, j = np.triu_indices(p.circulations.shape[0], 1)
    x = sphere_positions(mu, p.circulations, p.radius)
    apart = jnp.sum((x[i] - x[j]) ** 2, axis=1)
    return -jnp.sum(p.circulations[i] * p.circulations[j] * jnp.log(apart)) / (4 * np.pi)


def sphere_positions(mu: Array, circulations: Array, radius: Array | float) -> Array:
    """x_i, (…, N, 3), m, of momenta (…, 3N), m⁴/s, circulations (N,), m²/s, and R, m; else ArgumentError."""
    mu, gamma = _momenta(mu, circulations, 3, 0)
    xp = _arrays(mu, gamma)
    return xp.reshape(mu, (*mu.shape[:-1], -1, 3)) / (radius * gamma[:, None])


def sphere_start(vortices: System, *, positions: Quantity) -> State:
    """The state with the vortices at x_i. positions: (N, 3), m, |x_i| = R, all different; else ArgumentError."""
    gamma = _of(vortices, sphere_energy, "sphere")
    radius = float(vortices.parameters.radius)  # pyright: ignore[reportOptionalMemberAccess]
    x = _positions(positions, len(gamma), 3)
    off = np.abs(np.linalg.norm(x, axis=1) - radius)
    if np.max(off) > ON_SPHERE * radius:
        i = int(np.argmax(off))
        raise ArgumentError(
            f"Vortices must lie on the sphere of radius {radius:g} m, but |x_{i + 1}| is {np.linalg.norm(x[i]):.9g} m: "
            "scale it."
        )
    return vortices.state(mu=np.ravel(radius * gamma[:, None] * x))


def moment(state, p, *, axis: int):
    """A component of the moment of vorticity ΣΓ_i x_i."""
    return p.circulations @ sphere_positions(state.mu, p.circulations, p.radius)[:, axis]


def _system(group: Any, energy: PyTree, given: dict[str, PyTree], watched: object, units: object, name: str) -> System:
    count = len(given["circulations"])
    checks = partial(checked, {"circulations": partial(_circulations, count=count), "radius": positive})
    options = {"quantities": watched, "units": units, "checks": checks, "name": f"{count} {name}"}
    return System(group, hamiltonian=energy, parameters=Parameters(**given), invariance="right", **options)


def _circulations(value: object, name: str, count: int | None = None) -> Array:
    """Γ_i, (N,); of `count` vortices where that is given."""
    found = float64(value, f"Argument `{name}`")
    if np.ndim(found) != 1 or len(found) < 2:
        raise ArgumentError(f"Argument `{name}` must hold two or more numbers, but has shape {np.shape(found)}.")
    if count is not None and len(found) != count:
        raise ArgumentError(
            f"Argument `{name}` must hold {count} numbers, but holds {len(found)}: make another model for another "
            "number of vortices."
        )
    require_room_at("A step of point vortices", len(found), 96.0 * (2 * len(found) + 1) ** 2, 2)
    if not traced(found) and np.any(found == 0):
        raise ArgumentError(
            f"Argument `{name}` must have no zero, but that of vortex {int(np.argmin(np.abs(found))) + 1} is 0: "
            "leave that vortex out, because it moves no others."
        )
    return found


def _momenta(mu: Array, circulations: Quantity, each: int, more: int) -> tuple[PyTree, PyTree]:
    """μ, (…, each · N + more), and Γ, (N,), as arrays; raises ArgumentError for others."""
    xp = _arrays(mu, circulations)
    mu, gamma = xp.asarray(mu), xp.asarray(circulations)
    count = each * gamma.size + more
    if gamma.ndim != 1 or mu.shape[-1:] != (count,):
        raise ArgumentError(
            f"Momenta `mu` of vortices with `circulations` of shape {gamma.shape} must have shape (…, {count}), but "
            f"have {mu.shape}."
        )
    return mu, gamma


def _arrays(*values: object) -> Any:
    """NumPy, or where JAX traces jax.numpy."""
    return jnp if traced(*values) else np


def _of(vortices: System, energy: object, model: str) -> np.ndarray:
    """Γ_i, (N,), of vortices with this energy; raises ArgumentError for others."""
    fits = isinstance(vortices, System) and vortices.hamiltonian is energy
    checks.expect(fits, vortices, "vortices", f"a system of co.models.point_vortices.{model}")
    return np.asarray(vortices.parameters.circulations)  # pyright: ignore[reportOptionalMemberAccess]


def _positions(value: object, count: int, size: int) -> np.ndarray:
    """(count, size), finite and apart from one another."""
    found = np.asarray(checks.array(value, "positions", (count, size)))
    pairs = np.triu_indices(count, 1)
    apart = np.linalg.norm(found[pairs[0]] - found[pairs[1]], axis=1)
    (i, j), least = (int(row[np.argmin(apart)]) for row in pairs), np.min(apart)
    if least <= APART * np.max(apart) or least == 0:
        raise ArgumentError(
            f"Vortices must be apart, but {i + 1} and {j + 1} are at one place: their energy is infinite."
        )
    return found
