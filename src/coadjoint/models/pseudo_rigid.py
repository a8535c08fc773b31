"""Pseudo-rigid bodies, whose deformation is one matrix F: elastic ones on GL(3), self-gravitating fluids on SL(3)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, PyTree
from coadjoint.errors import ArgumentError
from coadjoint.groups import GLn, LieGroup, SLn
from coadjoint.groups.group import Element
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.members import Quantity
from coadjoint.mechanics.parameters import Parameters
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.models.quantities import checked, matrix, not_negative, positive, positive_definite
from coadjoint.spaces.representations import Representation

__all__ = ["Forms", "elastic", "gravitating", "start"]

UNITS = {
    **dict.fromkeys(("xi", "xi_spatial"), "1/s"),
    **dict.fromkeys(("mu", "kelvin_noether"), "kg m²/s"),
    **dict.fromkeys(("energy", "discrete_energy"), "J"),
    **dict.fromkeys(("g", "a"), "1"),
}
FLATTEST = 0.05
"""The smallest axis of an ellipsoid at the start, of the largest, by which its energy is right to 1e-5."""
TRACELESS = 1e-9
"""What the trace of the velocity of an incompressible body may be, relative to its size: round-off."""

_NODES, _WEIGHTS = (0.5 * (x + shift) for x, shift in zip(np.polynomial.legendre.leggauss(24), (1.0, 0.0), strict=True))


@dataclass(frozen=True)
class Forms(Representation):
    """Symmetric forms X (N, N), by rows, with X ↦ g⁻ᵀXg⁻¹: advected from 1 they are C = gᵀg, of lengths in the body."""

    def ambient(self, group: LieGroup) -> int:
        return group.matrix_size**2

    def act(self, group: LieGroup, g: Element, x: Array) -> Array:
        back = group.matrix(group.inverse(g))
        return jnp.ravel(back.T @ self._square(group, x) @ back)

    def infinitesimal(self, group: LieGroup, xi: Array, x: Array) -> Array:
        X, U = self._square(group, x), group.hat(xi)
        return -jnp.ravel(U.T @ X + X @ U)

    def _square(self, group: LieGroup, x: Array) -> Array:
        return jnp.reshape(x, (group.matrix_size, group.matrix_size))


def elastic(*, moments: Quantity, shear: Quantity, lame: Quantity, volume: Quantity = 1.0) -> System:
    """A body x = F(t)X that stays an affine image of itself, F in GL(3), with the energy of a compressible rubber.

        L = ½ tr(Ḟ E Ḟᵀ) − V(FᵀF),   V(C) = v(½G(tr C − 3 − 2 ln J) + ½λ (ln J)²),   J = √det C

    In the library's form ℓ(ξ, C) = ½ tr(ξ E ξᵀC) − V(C), ξ = F⁻¹Ḟ, with C = FᵀF advected from the form 1 of space.
    Rotations of space keep that form: the angular momentum is conserved, `kelvin_noether`. V is isotropic, so that a
    body with E = e·1 may also be turned within itself, and the circulation is conserved, the skew part of μ:
    `circulation_x`, … with every method, and with every map that turns with the body, τ(Ad_Qξ) = Qτ(ξ)Q⁻¹, as all do
    but co.difference_maps.SecondKind. About rest it breathes at ω² = v(2G + 3λ)/e and shears at 2vG/e.

    moments: E = ∫XXᵀ dm about the mass centre, (3, 3) or its diagonal (3,), kg m². shear: G, Pa. lame: λ, Pa, not
    negative. volume: v, m³. Raises ArgumentError for others. Source: Cohen and Muncaster, The Theory of Pseudo-rigid
    Bodies (Springer 1988); Lewis and Simo, Nonlinear stability of rotating pseudo-rigid bodies, Proc. R. Soc. Lond. A
    427 (1990).
    """
    checks = {"moments": positive_definite, "shear": positive, "lame": not_negative, "volume": positive}
    given = {"moments": moments, "shear": shear, "lame": lame, "volume": volume}

    def energy(C, p):
        first, _, third = invariants(C)
        log = 0.5 * jnp.log(third)
        return p.volume * (0.5 * p.shear * (first - 3 - 2 * log) + 0.5 * p.lame * log**2)

    return _body(GLn(3), energy, lambda p: p.moments, checks, given, "pseudo-rigid body")


def gravitating(*, mass: Quantity, radius: Quantity, gravitational_constant: Quantity = 6.6743e-11) -> System:
    """A self-gravitating ellipsoid of an ideal fluid of constant density, x = F(t)X, F in SL(3): Dirichlet's problem.

        L = (mr²/10) tr ḞḞᵀ − W(FᵀF),   W = −(3/10)Gm² ∫₀^∞ du/√det(r²C + u)

    F deforms a ball of radius r; det F = 1 is upheld by the pressure, which is quadratic in x and 0 on the surface, so
    that this is Euler's equation, exactly. Conserved are the angular momentum and, by the symmetry of the ball, the
    circulation. Steady motions F = R(t)AQ(t)ᵀ are the ellipsoids of Maclaurin, Jacobi, Dedekind and Riemann.
    The group needs a map that keeps volumes: co.Midpoint(co.Exponential()). The integral is that of 24 points of
    Gauss and Legendre in √(r²/(r² + u)), good to 1e-13 where no axis is below a quarter of another, to 1e-8 at a tenth;
    it is not for flatter bodies. `start` refuses those below a twentieth; only the axes, np.linalg.svd(run.records.g,
    compute_uv=False), show whether a run becomes that flat.

    mass: m, kg. radius: r, m. gravitational_constant: G, by default 6.6743e-11 m³/(kg s²). Raises ArgumentError for
    others. Source: Chandrasekhar, Ellipsoidal Figures of Equilibrium (Yale 1969), chapters 4, 5, 7.
    """
    given = {"mass": mass, "radius": radius, "gravitational_constant": gravitational_constant}

    def energy(C, p):
        return -0.3 * p.gravitational_constant * p.mass**2 / p.radius * attraction(C)

    def of(p):
        return 0.2 * p.mass * p.radius**2 * np.eye(3)

    return _body(SLn(3), energy, of, dict.fromkeys(given, positive), given, "self-gravitating ellipsoid")


def attraction(C: Array) -> Array:
    """∫₀^∞ du/√det(C + u), one number, of C (3, 3) with det C = 1; 2 of the ball.

    With u = 1/τ² − 1 it is ∫₀¹ 2dτ/√det(τ²C + (1 − τ²)).
    """
    first, second, third = invariants(C)
    rest = 1 - _NODES**2
    det = third * _NODES**6 + second * _NODES**4 * rest + first * _NODES**2 * rest**2 + rest**3
    return 2 * jnp.sum(_WEIGHTS / jnp.sqrt(det))


def invariants(C: Array) -> tuple[Array, Array, Array]:
    """tr C, ½(tr² C − tr C²) and det C of a symmetric C (3, 3)."""
    first = C[0, 0] + C[1, 1] + C[2, 2]
    return first, 0.5 * (first**2 - jnp.sum(C * C)), C[0] @ jnp.cross(C[1], C[2])


def start(body: System, *, deformation: Quantity | None = None, velocity: Quantity | None = None) -> State:
    """The state of a body with x = FX and ẋ = ḞX.

    deformation: F, (3, 3), by default 1, with det F = 1 for a fluid. velocity: Ḟ, (3, 3), 1/s, by default 0, with
    tr F⁻¹Ḟ = 0 for a fluid. Raises ArgumentError for others.
    """
    if not isinstance(body, System) or not isinstance(body.advected, Forms):
        raise ArgumentError("Argument `body` must be a body of co.models.pseudo_rigid.")
    F = np.eye(3) if deformation is None else np.asarray(matrix(deformation, "deformation"))
    F_dot = np.zeros((3, 3)) if velocity is None else np.asarray(matrix(velocity, "velocity"))
    if not np.linalg.det(F) > 0:
        raise ArgumentError(
            f"Argument `deformation` must have a positive determinant, but that is {np.linalg.det(F):.3g}."
        )
    U = np.linalg.solve(F, F_dot)
    fluid = isinstance(body.group, SLn)
    axes = np.linalg.svd(F, compute_uv=False)
    if fluid and axes[-1] < FLATTEST * axes[0]:
        raise ArgumentError(
            f"Argument `deformation` makes an ellipsoid one axis of which is {axes[-1] / axes[0]:.2g} of another, but "
            f"its gravity is right from {FLATTEST:g} on only."
        )
    if fluid and abs(np.trace(U)) > TRACELESS * np.max(np.abs(U)):
        raise ArgumentError(
            f"Argument `velocity` of a fluid must keep its volume, tr F⁻¹Ḟ = 0, but the trace is {np.trace(U):.3g}/s."
        )
    return body.state(g=F, xi=evaluate(body.group.vee, U), a0=np.eye(3).ravel())


def _body(
    group: Any,
    energy: PyTree,
    moments: Callable[[PyTree], PyTree],
    checks: Any,
    given: dict[str, PyTree],
    name: str,
) -> System:
    """The system of ℓ(ξ, C) = ½ tr(ξ E ξᵀC) − V(C), which observes the circulation."""

    def lagrangian(xi, a, p):
        U, C = group.hat(xi), jnp.reshape(a, (3, 3))
        return 0.5 * jnp.sum((U @ moments(p)) * (C @ U)) - energy(C, p)

    ways = [evaluate(group.vee, np.cross(np.eye(3)[k], np.eye(3)).T) for k in range(3)]
    watched = {f"circulation_{axis}": partial(_along, way=way) for axis, way in zip("xyz", ways, strict=True)}
    return System(
        group,
        lagrangian,
        advected=Forms(),
        parameters=Parameters(**checked(checks, given)),
        quantities=watched,
        checks=partial(checked, checks),
        units={**UNITS, **dict.fromkeys(watched, "kg m²/s")},
        name=name,
    )


def _along(state, *, way):
    """A component of the circulation, ⟨μ, ê⟩ of a skew ê: that of the velocities within the body."""
    return state.mu @ way
