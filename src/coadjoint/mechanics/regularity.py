"""Whether a Legendre transform is regular: ∂²ℓ/∂(ξ, ν)², or of a Hamiltonian ∂²ℋ/∂(μ, π)², is invertible."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import jax
import numpy as np

from coadjoint.arrays import Array, PyTree
from coadjoint.errors import LagrangianError
from coadjoint.kernels.newton.coupled import Coupled
from coadjoint.kernels.trace.evaluate import evaluate, hessian_of
from coadjoint.mechanics.coupling import large, structure
from coadjoint.mechanics.legendre import Place, curvature
from coadjoint.mechanics.phase_space import require_singular_apart
from coadjoint.mechanics.reduced_functions import ReducedFunctions

if TYPE_CHECKING:
    from coadjoint.mechanics.state import State

SINGULAR = 1e-13
"""The smallest |eigenvalue| of the scaled mass matrix that round-off cannot explain."""


def require_regular(
    system: ReducedFunctions, lagrangian: Callable[..., PyTree], arguments: tuple[PyTree, ...], start: State
) -> list[str]:
    """Raise LagrangianError where a mass matrix is singular; return a warning where it is not positive."""
    group, Q, _ = system.places
    xi, n, nu, a = arguments

    def at(velocities: Array) -> PyTree:
        y = velocities[group.dim :]
        return lagrangian(velocities[: group.dim], n, nu + Q.tangent(group, n, y), a)

    velocities = np.concatenate([xi, np.zeros(Q.dim(group))])
    how = structure(system.places)
    if large(group) and isinstance(how, Coupled):
        return _require_regular_links(how, at, velocities)
    hessian = hessian_of(at, velocities)
    empty, eigenvalues, direction = _weakest(hessian)
    if empty or abs(eigenvalues).min() <= SINGULAR:
        require_singular_apart(system, start)
        raise LagrangianError(
            "The Legendre transform must be regular, but the mass matrix ∂²ℓ/∂(ξ, ν)² is singular: motion along "
            f"(ξ, ν) = {np.round(direction, 3).tolist()} carries no kinetic energy; give it a mass or leave that "
            "direction out."
        )
    if eigenvalues[0] < 0:
        count = int(np.sum(eigenvalues < 0))
        return [f"The kinetic energy is not positive definite: {count} of its {len(eigenvalues)} axes are negative."]
    return []


def _require_regular_links(how: Coupled, at: Callable[..., object], velocities: np.ndarray) -> list[str]:
    """`require_regular` by block elimination: of D_i − L_i S_{i−1}⁻¹U_{i−1}, what links before it leave of a mass."""
    blocks = evaluate(lambda z: how.blocks(jax.linearize(jax.grad(at), z)[1]), velocities)
    lower, diagonal, upper = map(np.asarray, blocks)
    plan, size = how.layout, sum(how.sizes)
    links = np.argsort(plan.position)
    # In units in which every row has the size 1, as `_weakest` takes them.
    scale = np.sqrt(np.max(np.abs(blocks), axis=(0, 3), initial=0.0))
    scale = np.where(scale > 0, scale, 1.0)
    before, unsound = np.zeros(diagonal.shape[1:]), []
    for row, (L, D, U) in enumerate(zip(lower, diagonal, upper, strict=True)):
        mass = (D - L @ before) / scale[row][:, None] / scale[row]
        eigenvalues, vectors = (
            np.linalg.eigh(0.5 * (mass + mass.T)) if np.all(np.isfinite(mass)) else _weakest(mass)[1:]
        )
        direction = vectors[:, np.argmin(np.abs(eigenvalues))] / scale[row]
        inside = int(np.argmax(np.abs(direction)))
        link = links[min(row * plan.width + inside // size, how.count - 1)]
        if abs(eigenvalues).min() <= SINGULAR:
            first = inside // size * size
            along = direction[first : first + size] / direction[inside]
            raise LagrangianError(
                f"The Legendre transform must be regular, but the mass matrix of link {link} is singular: motion along "
                f"{np.round(along, 3).tolist()} carries no kinetic energy; give it a mass or leave it out."
            )
        if eigenvalues[0] < 0 and not unsound:
            unsound = [f"The kinetic energy is not positive definite at link {link}."]
        before = np.linalg.solve(D - L @ before, U)
    return unsound


def require_regular_hamiltonian(system: ReducedFunctions, state: State) -> None:
    """Raise LagrangianError where ∂²ℋ/∂(μ, π)² is singular at (μ, π), or where (ξ, ν) belong to no momenta."""
    z, p = np.concatenate([state.xi, state.nu]), np.concatenate([state.mu, state.pi])
    solved = bool(np.all(np.isfinite(p)))
    if not solved:
        p = np.zeros_like(p)
    place = Place(system, z, state.n, state.a, state.t, state.inputs, state.internal)
    empty, eigenvalues, direction = _weakest(np.asarray(evaluate(curvature, p, place)))
    if empty or abs(eigenvalues).min() <= SINGULAR:
        raise LagrangianError(
            "The Legendre transform of the Hamiltonian must be regular, but ∂²ℋ/∂(μ, π)² is singular: the velocities "
            f"do not change with the momentum (μ, π) along {_listed(direction)}; give it a mass, leave that direction "
            "out, or start from momenta, system.state(mu=…), with method=co.HamiltonianMidpoint(), or with "
            "co.IsospectralMidpoint() for fluids and other Lie–Poisson systems."
        )
    if not solved:
        raise LagrangianError(
            f"The Hamiltonian must have momenta with ∂ℋ/∂(μ, π) = (ξ, ν) = {np.round(z, 6).tolist()}, but none were "
            "found from zero: look for a velocity that it does not allow."
        )


def _listed(direction: np.ndarray) -> str:
    """A direction in words."""
    if len(direction) <= 12:
        return str(np.round(direction, 3).tolist())
    return f"one of {len(direction)} numbers, the largest of which is number {int(np.argmax(np.abs(direction)))}"


def _weakest(hessian: np.ndarray) -> tuple[bool, np.ndarray, np.ndarray]:
    """Whether H has a zero row, the eigenvalues of D⁻¹HD⁻¹ with D = √(row maxima of |H|), and its weakest direction.

    D makes the test independent of units: 1e-12 kg with 1e-27 kg m² is regular. The direction v,
    D v the eigenvector of the smallest |eigenvalue|, is reported in (ξ, ν) with largest entry 1.
    """
    if not np.all(np.isfinite(hessian)):
        raise LagrangianError(
            "The second derivatives of the Lagrangian, or the Hamiltonian, in the velocities, or momenta, must be "
            "finite at the start, but are not: look for equal eigenvalues, a norm at zero or a division by zero."
        )
    scale = np.sqrt(np.max(np.abs(hessian), axis=1, initial=0.0))
    if np.any(scale == 0.0):
        return True, np.zeros(len(hessian)), (scale == 0.0).astype(float)
    eigenvalues, vectors = np.linalg.eigh(hessian / scale[:, None] / scale)
    direction = vectors[:, np.argmin(np.abs(eigenvalues))] / scale
    return False, eigenvalues, direction / direction[np.argmax(np.abs(direction))]
