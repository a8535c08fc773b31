"""The mechanical connection of a Lagrangian: horizontal motions have momentum zero."""

from __future__ import annotations

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array
from coadjoint.errors import ArgumentError, LagrangianError
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.connection import ROUND_OFF, Connection, random_shapes
from coadjoint.mechanics.system import System
from coadjoint.mechanics.trace_checks import trace
from coadjoint.spaces import Several, Space, Trivial


def mechanical_connection(system: System) -> Connection:
    """The mechanical connection A(x) = I(x)⁻¹ ∂²ℓ/∂ξ∂ẋ of a Lagrangian ℓ(ξ, x, ẋ), I = ∂²ℓ/∂ξ² the locked inertia.

    system: one with the shapes `additional=co.Trivial(m)` and no advected parameters. Horizontal motions are those with
    momentum zero, ∂_ξℓ = I(x)(ξ + A(x)ẋ) = 0. Raises ArgumentError for another system, LagrangianError where ∂_ξℓ is
    not linear in (ξ, ẋ), and where the locked inertia is singular.
    """
    size = timeless(system)
    group, a = system.group, np.zeros(0)

    def momentum(xi: Array, x: Array, v: Array) -> Array:
        return jax.grad(lambda xi: system.reduced_lagrangian(xi, x, v, a))(xi)

    def form(x: Array) -> Array:
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

    def measure(xi: Array, x: Array, v: Array) -> tuple[Array, Array]:
        total = momentum(xi, x, v)
        _, straight = jax.jvp(lambda xi, v: momentum(xi, x, v), (jnp.zeros(dim), jnp.zeros(size)), (xi, v))
        return jnp.max(jnp.abs(total - straight)), jnp.max(jnp.abs(total))

    trace(measure, "The Lagrangian", (xi, x, v))
    bent, scale = map(float, evaluate(measure, xi, x, v))
    if not bent <= ROUND_OFF * max(scale, 1e-300):
        raise LagrangianError(
            f"The mechanical connection needs ∂ℓ/∂ξ linear in (ξ, ẋ), as kinetic energy has it, but it is off by "
            f"{bent:.1e}; co.theory.discrete_mechanical_connection takes any regular Lagrangian."
        )


def timeless(system: System) -> int:
    """m of a system on M × G whose ℓ is one of ξ, x and ẋ alone; raises ArgumentError for others."""
    size = shape_size(system)
    for key in ("t", "inputs", "internal"):
        if system.takes(key):
            raise ArgumentError(
                f"A mechanical connection needs a Lagrangian of ξ, x and ẋ alone, but this one takes `{key}`."
            )
    return size


def shape_size(system: System) -> int:
    """m of a system on M × G with M = ℝᵐ; raises ArgumentError for another system."""
    checks.instance(system, "system", System, "a co.System")
    if not _is_trivial(system.additional) or system.additional.ambient(system.group) == 0:
        raise ArgumentError(
            "A bundle needs a space of shapes on which the group does nothing, additional=co.Trivial(m), but this "
            f"system has additional={system.additional!r}."
        )
    if system.advected.ambient(system.group):
        raise ArgumentError(
            f"The symmetry of a bundle is the full group, but this system has advected={system.advected!r}."
        )
    return system.additional.ambient(system.group)


def _is_trivial(space: Space) -> bool:
    parts = space.factors if isinstance(space, Several) else (space,)
    return all(isinstance(part, Trivial) for part in parts)
