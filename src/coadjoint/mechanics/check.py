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
from coadjoint.kernels.trace.evaluate import evaluate, tabulate, traced
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.derivative_check import require_own_derivative
from coadjoint.mechanics.forces import UNNAMED
from coadjoint.mechanics.phase_space import require_first_order
from coadjoint.mechanics.reduced_functions import ReducedFunctions
from coadjoint.mechanics.regularity import require_regular, require_regular_hamiltonian
from coadjoint.mechanics.trace_checks import in_words, require_float64, require_scalar

if TYPE_CHECKING:
    from coadjoint.mechanics.state import State


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
        return require_regular(system, function, arguments, start) if regular else require_first_order(system, start)


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
