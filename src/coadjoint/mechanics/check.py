"""Checks of a Lagrangian or a Hamiltonian before a run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import jax
import numpy as np

from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.errors import CoadjointError, LagrangianError
from coadjoint.groups.group import Element
from coadjoint.kernels.newton.coupled import Coupled
from coadjoint.kernels.trace.evaluate import evaluate, hessian_of, tabulate, traced
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.coupling import large, structure
from coadjoint.mechanics.derivative_check import require_own_derivative
from coadjoint.mechanics.forces import UNNAMED
from coadjoint.mechanics.legendre import Place, curvature
from coadjoint.mechanics.phase_space import require_first_order, require_singular_apart
from coadjoint.mechanics.reduced_functions import ReducedFunctions
from coadjoint.mechanics.trace_checks import in_words, require_float64, require_scalar

if TYPE_CHECKING:
    from coadjoint.mechanics.state import State

SINGULAR = 1e-13
"""The smallest |eigenvalue| of the scaled mass matrix that round-off cannot explain."""


def check(system: ReducedFunctions, start: State, regular: bool = True) -> list[str]:
    """Raise LagrangianError where ℓ or ℋ cannot be integrated from `start`; return warnings, a sentence each.

    ℓ must return one float64 number that is finite, with a finite gradient that is that of its values, hold no float32
    constants, and have a regular Legendre transform: ∂²ℓ/∂(ξ, ν)² invertible; of ℋ, ∂²ℋ/∂(μ, π)². Inside the user's
    own transformations only shapes are seen.
    """
    if system.discrete_lagrangian is not None or system.group_lagrangian is not None:
        _check_discrete(system, start)
    _check_forces(system, start, regular or system.hamiltonian is not None or not system.continuous)
    if not system.continuous:
        return []
    what, function = given(system)
    arguments = point(system, start)
    function = partial(function, t=start.t, inputs=start.inputs, internal=start.internal)
    read = require_scalar(function, what, arguments)
    if traced(system.parameters, start):
        return []
    with in_words(what):
        _require_derivative(system, function, what, arguments, read)
        _require_symmetric(system, start)
        if system.hamiltonian is not None:
            if regular:
                require_regular_hamiltonian(system, start)
            return []
        return _require_regular(system, function, arguments, start) if regular else require_first_order(system, start)


def given(system: ReducedFunctions) -> tuple[str, Callable[..., PyTree]]:
    """The user's function, by name, and as a function of (ξ, n, ν, a, t, inputs, internal) or of (μ, n, π, …)."""
    if system.hamiltonian is not None:
        return "The Hamiltonian", system.reduced_hamiltonian
    return "The Lagrangian", system.reduced_lagrangian


def point(system: ReducedFunctions, state: State) -> tuple[PyTree, ...]:
    """The arguments of ℓ, or of ℋ, at a state."""
    if system.hamiltonian is not None:
        return state.mu, state.n, state.pi, state.a
    return state.xi, state.n, state.nu, state.a


def _check_discrete(system: ReducedFunctions, start: State) -> None:
    rest = (start.n, start.n, start.a, np.float64(1.0))

    def in_algebra(xi: Array, n: Array, s: Array, a: Array, h: Scalar):
        return system.reduced_discrete_lagrangian(xi, n, s, a, h, start.t, start.inputs, start.internal)

    def in_group(F: Element, n: Array, s: Array, a: Array, h: Scalar):
        return system.reduced_group_lagrangian(F, n, s, a, h, start.t, start.inputs, start.internal)

    if system.discrete_lagrangian is not None:
        what = "The discrete Lagrangian"
        read = require_scalar(in_algebra, what, (start.xi, *rest))
        _require_derivative_of_discrete(system, partial(in_algebra, h=rest[-1]), what, (start.xi, *rest[:-1]), read)
    if system.group_lagrangian is not None:
        what, group = "The discrete Lagrangian in group form", system.group
        read = require_scalar(in_group, what, (start.g, *rest))

        def turned(eta: Array, n: Array, s: Array, a: Array):
            return in_group(group.compose(start.g, group.exp(eta)), n, s, a, rest[-1])

        _require_derivative_of_discrete(system, turned, what, (np.zeros(group.dim), *rest[:-1]), read)


def _check_forces(system: ReducedFunctions, start: State, regular: bool) -> None:
    """Raise unless every force is float64 and, where it is finite, has a finite derivative in the velocities.

    regular: whether velocities are given; those of a degenerate ℓ follow from forces, which must be finite.
    """
    if system.forces is None:
        return
    velocities = start.xi, start.nu

    def at(velocities: tuple[Array, Array], t: Scalar) -> PyTree:
        motion = system.motion(velocities[0], start.n, velocities[1], start.a, t, start.inputs, start.internal)
        return system.body_forces(motion)

    names = system.forces.names
    what = [f"The force `{name}`" if name != UNNAMED else "The function `forces`" for name in names]
    try:
        require_float64(at, "The forces", (velocities, start.t))
    except CoadjointError:
        for i, name in enumerate(what):  # Forces are checked separately, to name the one that fails.
            require_float64(lambda *given, i=i: at(*given)[i], name, (velocities, start.t))
        raise
    if traced(system.parameters, start):
        return
    with in_words("The forces"):
        along = jax.tree.map(np.ones_like, velocities)  # infinite or not a number, if one of the derivatives is
        values, slopes = evaluate(
            lambda velocities, t: jax.jvp(lambda given: at(given, t), (velocities,), (along,)), velocities, start.t
        )
    for name, value, slope in zip(what, values, slopes, strict=True):
        if not regular and not _finite(value):
            raise LagrangianError(f"{name} must be finite at the start, but is not: look for a division by zero.")
        if _finite(value) and not _finite(slope):
            raise LagrangianError(
                f"The derivative of {name[0].lower()}{name[1:]} in the velocities must be finite at the start, but is "
                "not: a norm has none at rest; co.mechanics.quadratic_drag is smooth there."
            )


def _finite(tree: PyTree) -> bool:
    return all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves(tree))


def _require_derivative(
    system: ReducedFunctions, function: Callable[..., object], what: str, arguments: tuple[PyTree, ...], read: Any
) -> None:
    """Raise unless ℓ or ℋ and its gradient are finite at the start, and its gradient is that of its value.

    read: its jaxpr, None where the function is the library's own.
    """
    slopes = tabulate(jax.value_and_grad(function, argnums=(0, 1, 2, 3)), *arguments)
    value, gradient = slopes(*arguments)
    if not np.isfinite(value):
        raise LagrangianError(f"{what} must be finite at the start, but is {float(value)}.")
    names = ("mu", "n", "pi", "a") if "Hamiltonian" in what else ("xi", "n", "nu", "a")
    bad = [name for name, part in zip(names, gradient, strict=True) if not np.all(np.isfinite(part))]
    if bad:
        raise LagrangianError(
            f"The gradient of t{what[1:]} in {', '.join(bad)} must be finite at the start, but is not: look for "
            "a norm or square root at zero, or a division by zero."
        )
    if read is not None:
        require_own_derivative(system.places, slopes, what, arguments, read)


def _require_derivative_of_discrete(
    system: ReducedFunctions, function: Callable[..., object], what: str, arguments: tuple[PyTree, ...], read: Any
) -> None:
    """Raise unless the gradient of Λ is that of its value; read as above."""
    if read is not None and not traced(system.parameters, arguments):
        slopes = tabulate(jax.value_and_grad(function, argnums=(0, 1, 2, 3)), *arguments)
        require_own_derivative(system.places, slopes, what, arguments, read)


def _require_symmetric(system: ReducedFunctions, start: State) -> None:
    """A matrix whose antisymmetric part is lost in ℓ was meant to be symmetric: raise instead of dropping that part."""
    if system.parameters is None:
        return
    paths = jax.tree_util.tree_leaves_with_path(system.parameters)
    skewed = {jax.tree_util.keystr(path).lstrip("."): leaf for path, leaf in paths if _asymmetric(leaf)}
    if not skewed:
        return
    gradients = _parameter_gradients(system, start)
    for name, matrix in skewed.items():
        slopes = [gradient[name] for gradient in gradients if np.all(np.isfinite(gradient[name]))]
        if any(np.any(slope) for slope in slopes) and not any(_asymmetric(slope) for slope in slopes):
            worst = float(np.max(np.abs(matrix - matrix.T)))
            raise LagrangianError(
                f"Parameter `{name}` must be symmetric, but differs from its transpose by {worst:.3g}: the Lagrangian "
                f"takes no notice of its antisymmetric part; use ({name} + {name}.T) / 2 if that is what you mean."
            )


def _parameter_gradients(system: ReducedFunctions, start: State) -> list[dict[str, np.ndarray]]:
    """∂ℓ/∂p or ∂ℋ/∂p by name at a random point, and at one next to the start, where it is defined."""
    random = np.random.default_rng(11)
    at_start = point(system, start)
    far = [random.normal(size=np.shape(x)) for x in at_start]
    near = [x + 1e-3 * (1 + np.abs(x)) * random.normal(size=np.shape(x)) for x in at_start]

    def slope(parameters: PyTree, point: Sequence[Array]) -> PyTree:
        function = given(replace_parameters(system, parameters))[1]
        return function(*point, t=start.t, inputs=start.inputs, internal=start.internal)

    gradient = tabulate(jax.grad(slope), system.parameters, far)
    found = [jax.tree_util.tree_leaves_with_path(gradient(system.parameters, place)) for place in (far, near)]
    return [{jax.tree_util.keystr(path).lstrip("."): np.asarray(leaf) for path, leaf in leaves} for leaves in found]


def _asymmetric(matrix: Array) -> bool:
    shape = np.shape(matrix)
    square = len(shape) == 2 and shape[0] == shape[1]
    return square and bool(np.max(np.abs(matrix - matrix.T), initial=0.0) > 1e-9 * np.max(np.abs(matrix), initial=0.0))


def _require_regular(
    system: ReducedFunctions, lagrangian: Callable[..., PyTree], arguments: tuple[PyTree, ...], start: State
) -> list[str]:
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
    """`_require_regular` by block elimination: of D_i − L_i S_{i−1}⁻¹U_{i−1}, what links before it leave of a mass."""
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
