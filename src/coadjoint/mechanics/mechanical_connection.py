"""The mechanical connection of a Lagrangian, continuous and discrete: horizontal motions have momentum zero."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.errors import ArgumentError, LagrangianError
from coadjoint.groups.group import Array
from coadjoint.kernels import newton
from coadjoint.kernels.evaluate import evaluate
from coadjoint.kernels.program import Code
from coadjoint.mechanics.check import trace
from coadjoint.mechanics.connection import ROUND_OFF, Connection, random_shapes
from coadjoint.mechanics.discrete_connection import DiscreteConnection
from coadjoint.mechanics.system import System
from coadjoint.spaces import Several, Space, Trivial
from coadjoint.spaces.numbers import float64


def mechanical_connection(system: System) -> Connection:
    """The mechanical connection A(x) = I(x)⁻¹ ∂²ℓ/∂ξ∂ẋ of a Lagrangian ℓ(ξ, x, ẋ), I = ∂²ℓ/∂ξ² the locked inertia.

    Horizontal motions are those with momentum zero, ∂_ξℓ = I(x)(ξ + A(x)ẋ) = 0. The system has the shapes
    `additional=co.Trivial(m)` and no advected parameters. Raises LagrangianError where ∂_ξℓ is not linear in (ξ, ẋ),
    and where the locked inertia is singular.
    """
    size = _timeless(system)
    group, a = system.group, np.zeros(0)

    def momentum(xi, x, v):
        return jax.grad(lambda xi: system.reduced_lagrangian(xi, x, v, a))(xi)

    def form(x):
        rest = jnp.zeros(group.dim), x, jnp.zeros(size)
        inertia, coupling = jax.jacfwd(momentum, argnums=(0, 2))(*rest)
        return jnp.linalg.solve(inertia, coupling)

    _require_linear(momentum, group.dim, size)
    x = random_shapes(size, 1)[0]
    locked = evaluate(lambda x: jax.jacfwd(momentum)(np.zeros(group.dim), x, np.zeros(size)), x)
    if not np.linalg.cond(locked) < 1e13:
        raise LagrangianError("The locked inertia ∂²ℓ/∂ξ² must be invertible, but is singular.")
    return Connection(group, size, form)


def _require_linear(momentum: Callable[..., Array], dim: int, size: int) -> None:
    """Raise LagrangianError unless ∂_ξℓ is linear in (ξ, ẋ) at random arguments."""
    random = np.random.default_rng(1993)
    xi, (x, v) = random.normal(size=dim), random.normal(scale=0.5, size=(2, size))

    def measure(xi, x, v):
        whole = momentum(xi, x, v)
        _, straight = jax.jvp(lambda xi, v: momentum(xi, x, v), (jnp.zeros(dim), jnp.zeros(size)), (xi, v))
        return jnp.max(jnp.abs(whole - straight)), jnp.max(jnp.abs(whole))

    trace(measure, "The Lagrangian", (xi, x, v))
    bent, scale = map(float, evaluate(measure, xi, x, v))
    if not bent <= ROUND_OFF * max(scale, 1e-300):
        raise LagrangianError(
            f"The mechanical connection needs ∂ℓ/∂ξ linear in (ξ, ẋ), as kinetic energy has it, but it is off by "
            f"{bent:.1e}; co.discrete_mechanical_connection takes any regular Lagrangian."
        )


def discrete_mechanical_connection(system: System, method: Any, dt: float) -> DiscreteConnection:
    """The discrete mechanical connection of a rule: Ω(x, x⁺) is the F with D^R_FΛ(F, x, x⁺; h) = 0.

    D^R_FΛ = μ_k is the left discrete Legendre transform, so that horizontal steps are those with momentum zero, and
    a motion of `method`, a rule of one stage, with momentum zero is the horizontal lift of its shapes. Of kinetic
    energy and a potential of x, Ω does not depend on dt. Where no F is found, Ω is not finite, and what uses it raises.
    """
    size, step, h = _timeless(system), one_stage(system, method), positive_step(dt)
    group = system.group
    at = method.begin(system, system.state(q=random_shapes(size, 1)[0]), h)
    at = at.replace(mu=np.zeros(group.dim))

    def increment(x, x_next):
        here, nu = at.replace(n=x), (x_next - x) / h

        def record(xi):
            return step.record(system, here, h, jnp.concatenate([xi, nu]))

        def momentum(xi):
            return step.equations(system, record(xi), h)[: group.dim]

        root = newton.solve(momentum, jnp.zeros(group.dim), h, (group.dim,))
        xi = jnp.where(root.code == Code.CONVERGED, root.unknowns, jnp.nan)
        return step.relative(system, record(xi), h)

    return DiscreteConnection(group, size, increment)


def one_stage(system: System, method: Any) -> Any:
    """The step of a method that has one Λ(F, x, x⁺; h); raises ArgumentError for others."""
    stages = getattr(method, "stages", None)
    if stages is None:
        raise ArgumentError(f"Argument `method` must be a method such as co.Midpoint(), but is {method!r}.")
    step = stages[0][0]
    unknowns = system.group.dim, system.additional.dim(system.group)
    if len(stages) != 1 or tuple(step.groups(system)) != unknowns or not method.claims.symplectic:
        raise ArgumentError(
            "A bundle needs a variational rule of one stage, such as co.Midpoint() or co.LeftRectangle(), but got "
            f"{method.title}."
        )
    step.require_fit(system)
    return step


def positive_step(dt: Any) -> Any:
    """h > 0; raises ArgumentError."""
    h = float64(dt, "Argument `dt`")
    if np.shape(h) != () or not h > 0:
        raise ArgumentError(f"Argument `dt` must be a positive number, but is {dt!r}.")
    return h


def _timeless(system: System) -> int:
    """m of a system on M × G whose ℓ does not depend on time; raises ArgumentError for others."""
    size = shape_size(system)
    if system.takes("t"):
        raise ArgumentError("A mechanical connection needs a Lagrangian of ξ, x and ẋ alone, but this one takes `t`.")
    return size


def shape_size(system: System) -> int:
    """m of a system on M × G with M = ℝᵐ; raises ArgumentError for another system."""
    if not isinstance(system, System):
        raise ArgumentError(f"Argument `system` must be a co.System, but is {system!r}.")
    if not _is_trivial(system.additional) or system.additional.ambient(system.group) == 0:
        raise ArgumentError(
            "A bundle needs a space of shapes on which the group does nothing, additional=co.Trivial(m), but this "
            f"system has additional={system.additional!r}."
        )
    if system.advected.ambient(system.group):
        raise ArgumentError(
            f"A bundle has the whole group as its symmetry, but this system has advected={system.advected!r}."
        )
    if system.takes("inputs"):
        raise ArgumentError("A bundle needs a Lagrangian of ξ, x and ẋ, but this one takes `inputs`.")
    return system.additional.ambient(system.group)


def _is_trivial(space: Space) -> bool:
    parts = space.factors if isinstance(space, Several) else (space,)
    return all(isinstance(part, Trivial) for part in parts)
