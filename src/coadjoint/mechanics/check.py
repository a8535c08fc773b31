"""What is wrong with a Lagrangian, said before a run."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import numpy as np

from coadjoint.errors import CoadjointError, LagrangianError
from coadjoint.kernels.evaluate import evaluate, traced
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System, replace_parameters


def check(system: System, start: State) -> list[str]:
    """Raise LagrangianError where ℓ cannot be integrated from `start`; return warnings, a sentence each.

    ℓ must return one float64 number that is finite with finite gradient, hold no float32 constants, and have a
    regular Legendre transform: ∂²ℓ/∂(ξ, ν)² invertible. Inside the user's own transformations only shapes are seen.
    """
    if system.lagrangian is None:
        require_scalar(system.reduced_discrete_lagrangian, "The discrete Lagrangian", _discrete_arguments(start))
        return []
    arguments = (start.xi, start.n, start.nu, start.a)

    def lagrangian(xi, n, nu, a):
        return system.reduced_lagrangian(xi, n, nu, a, start.t, start.inputs)

    require_scalar(lagrangian, "The Lagrangian", arguments)
    if system.forces is not None:
        motion = system.motion(*arguments, start.t, start.inputs, start.internal)
        trace(lambda m: system.body_force(m), "`forces`", (motion,))
    if traced(system.parameters, start):
        return []
    _require_finite(lagrangian, arguments)
    _require_symmetric(system, start)
    return _require_regular(system, lagrangian, arguments)


def _discrete_arguments(start: State) -> tuple[Any, ...]:
    return start.xi, start.n, start.n, start.a, np.float64(1.0)


def trace(function: Callable[..., Any], what: str, arguments: tuple[Any, ...]) -> Any:
    """The jaxpr of a user's function; whatever goes wrong inside it becomes one sentence."""
    try:
        with jax.enable_x64(True):
            return jax.make_jaxpr(function)(*arguments)
    except CoadjointError:
        raise
    except Exception as error:
        first = str(error).strip().split("\n")[0]
        kind = type(error).__name__
        if "dtype promotion" in first:
            raise
        if type(error).__module__.startswith("jax"):
            raise LagrangianError(
                f"{what} cannot be differentiated by JAX ({kind}): write it with jax.numpy, without `if` on values, "
                "float() or NumPy functions of its arguments."
            ) from error
        raise LagrangianError(f"{what} raised {kind}: {first}") from error


def require_scalar(function: Callable[..., Any], what: str, arguments: tuple[Any, ...]) -> None:
    """Raise LagrangianError unless the function returns one float64 number and holds no float32."""
    closed = trace(function, what, arguments)
    outputs = closed.out_avals
    if len(outputs) != 1 or outputs[0].shape != ():
        found = ", ".join(str(o.shape) for o in outputs) or "nothing"
        raise LagrangianError(f"{what} must return one number, but returns {found}; use @ or jnp.sum.")
    if not np.issubdtype(outputs[0].dtype, np.floating):
        raise LagrangianError(f"{what} must return a float64 number, but returns {outputs[0].dtype}.")
    if _holds_float32(closed.jaxpr) or _promotes_float32(function, what, arguments):
        raise LagrangianError(
            f"{what} holds float32 numbers, which have lost digits already (5.46 becomes 5.460000038): make its "
            "constants with NumPy or put them into co.Parameters, and leave out float32."
        )


def _promotes_float32(function: Callable[..., Any], what: str, arguments: tuple[Any, ...]) -> bool:
    """Whether a float32 constant is promoted before JAX writes it down, so that the jaxpr does not show it."""
    try:
        with jax.numpy_dtype_promotion("strict"):
            trace(function, what, arguments)
    except Exception as error:
        return "float32" in str(error) or "float16" in str(error)
    return False


def _holds_float32(jaxpr: Any) -> bool:
    for equation in jaxpr.eqns:
        for variable in (*equation.invars, *equation.outvars):
            if getattr(variable.aval, "dtype", None) in (np.float32, np.float16):
                return True
        for value in equation.params.values():
            for inner in value if isinstance(value, (tuple, list)) else (value,):
                inner = getattr(inner, "jaxpr", inner)
                if hasattr(inner, "eqns") and _holds_float32(inner):
                    return True
    return False


def _require_finite(lagrangian: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
    value, gradient = evaluate(jax.value_and_grad(lagrangian, argnums=(0, 1, 2, 3)), *arguments)
    if not np.isfinite(value):
        raise LagrangianError(f"The Lagrangian must be finite at the start, but is {float(value)}.")
    names = ("xi", "n", "nu", "a")
    bad = [name for name, part in zip(names, gradient, strict=True) if not np.all(np.isfinite(part))]
    if bad:
        raise LagrangianError(
            f"The gradient of the Lagrangian in {', '.join(bad)} must be finite at the start, but is not: look for a "
            "norm or square root at zero, or a division by zero."
        )


def _require_symmetric(system: System, start: State) -> None:
    """A matrix whose antisymmetric part is lost in ℓ was meant to be symmetric: say so instead of dropping it."""
    if system.parameters is None:
        return
    paths = jax.tree_util.tree_leaves_with_path(system.parameters)
    skewed = {jax.tree_util.keystr(path).lstrip("."): leaf for path, leaf in paths if _asymmetric(leaf)}
    if not skewed:
        return
    random = np.random.default_rng(11)
    xi, n, nu, a = (random.normal(size=np.shape(x)) for x in (start.xi, start.n, start.nu, start.a))

    def slope(parameters):
        return replace_parameters(system, parameters).reduced_lagrangian(xi, n, nu, a, start.t, start.inputs)

    gradients = jax.tree_util.tree_leaves_with_path(evaluate(jax.grad(slope), system.parameters))
    for path, gradient in gradients:
        name = jax.tree_util.keystr(path).lstrip(".")
        if name in skewed and np.any(gradient) and not _asymmetric(gradient):
            worst = float(np.max(np.abs(skewed[name] - skewed[name].T)))
            raise LagrangianError(
                f"Parameter `{name}` must be symmetric, but differs from its transpose by {worst:.3g}: the Lagrangian "
                f"takes no notice of its antisymmetric part; use ({name} + {name}.T) / 2 if that is what you mean."
            )


def _asymmetric(matrix: Any) -> bool:
    shape = np.shape(matrix)
    if len(shape) != 2 or shape[0] != shape[1]:
        return False
    return bool(np.max(np.abs(matrix - matrix.T), initial=0.0) > 1e-9 * np.max(np.abs(matrix), initial=0.0))


def _require_regular(system: System, lagrangian: Callable[..., Any], arguments: tuple[Any, ...]) -> list[str]:
    group, Q, _ = system.places
    xi, n, nu, a = arguments

    def at(velocities):
        y = velocities[group.dim :]
        return lagrangian(velocities[: group.dim], n, nu + Q.tangent(group, n, y), a)

    velocities = np.concatenate([xi, np.zeros(Q.dim(group))])
    hessian = np.asarray(evaluate(jax.hessian(at), velocities))
    scale = np.sqrt(np.abs(np.diag(hessian)))
    eigenvalues, vectors = np.linalg.eigh(hessian)
    largest = float(np.max(np.abs(eigenvalues), initial=0.0))
    smallest = int(np.argmin(np.abs(eigenvalues)))
    if largest == 0.0 or np.any(scale == 0.0) or abs(eigenvalues[smallest]) <= 1e-13 * largest:
        direction = np.round(vectors[:, smallest], 3).tolist()
        raise LagrangianError(
            "The Legendre transform must be regular, but the mass matrix ∂²ℓ/∂(ξ, ν)² is singular: motion along "
            f"(ξ, ν) = {direction} carries no kinetic energy; give it a mass or leave that direction out."
        )
    if eigenvalues[0] < 0:
        return [f"The kinetic energy is not positive definite: the smallest eigenvalue is {eigenvalues[0]:.3g}."]
    return []
