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


def mechanical_connection(system: System) -> Connection:
    """The mechanical connection A(x) = I(x)⁻¹ ∂²ℓ/∂ξ∂ẋ of a Lagrangian ℓ(ξ, x, ẋ), I = ∂²ℓ/∂ξ² the locked inertia.

    system: one with shapes, which are all of its `additional`: where G acts on q, x = g⁻¹q and ẋ = ν − ξ·x is its rate
    in the body frame. Horizontal motions are those with total momentum zero, m = ∂_ξℓ(ξ, x, ẋ + ξ·x) =
    I(x)(ξ + A(x)ẋ) = 0. Raises ArgumentError for another system, LagrangianError where m is not linear in (ξ, ẋ) or
    depends on advected parameters, and where the locked inertia is singular.
    """
    size = timeless(system)
    group, Q, V = system.places
    random = np.random.default_rng(1994)
    a, other = (V.sample(group, random) for _ in range(2))

    def momentum(xi: Array, x: Array, v: Array, a: Array = a) -> Array:
        """m, (dim G,)."""

        def value(xi: Array) -> Array:
            return system.reduced_lagrangian(xi, x, v + Q.infinitesimal(group, xi, x), a)

        return jax.grad(value)(xi)

    def form(x: Array) -> Array:
        rest = jnp.zeros(group.dim), x, jnp.zeros(size)
        inertia, coupling = jax.jacfwd(momentum, argnums=(0, 2))(*rest)
        return jnp.linalg.solve(inertia, coupling)

    x = random_shapes(Q, group, 1)[0]
    _require_linear(momentum, group.dim, x, other)
    locked = evaluate(lambda x: jax.jacfwd(momentum)(np.zeros(group.dim), x, np.zeros(size)), x)
    if not np.linalg.cond(locked) < 1e13:
        raise LagrangianError("The locked inertia ∂²ℓ/∂ξ² must be invertible, but is singular.")
    return Connection(group, size, form, shapes=Q)


def _require_linear(momentum: Callable[..., Array], dim: int, x: np.ndarray, a: np.ndarray) -> None:
    """Raise LagrangianError unless m is linear in (ξ, ẋ) and the same with other advected parameters a (dim V*,)."""
    random = np.random.default_rng(1993)
    xi, v = random.normal(size=dim), random.normal(scale=0.5, size=len(x))

    def measure(xi: Array, x: Array, v: Array, a: Array) -> tuple[Array, Array, Array]:
        total = momentum(xi, x, v)
        _, straight = jax.jvp(lambda xi, v: momentum(xi, x, v), (jnp.zeros(dim), jnp.zeros(len(x))), (xi, v))
        turned = momentum(xi, x, v, a)
        return jnp.max(jnp.abs(total - straight)), jnp.max(jnp.abs(total - turned)), jnp.max(jnp.abs(total))

    trace(measure, "The Lagrangian", (xi, x, v, a))
    bent, advected, scale = map(float, evaluate(measure, xi, x, v, a))
    if not advected <= ROUND_OFF * max(scale, 1e-300):
        raise LagrangianError(
            f"The mechanical connection needs a momentum ∂ℓ/∂ξ of (ξ, x, ẋ) alone, but with other advected parameters "
            f"it differs by {advected:.1e}: give a connection of your own, co.mechanics.Connection(group, m, form)."
        )
    if not bent <= ROUND_OFF * max(scale, 1e-300):
        raise LagrangianError(
            f"The mechanical connection needs ∂ℓ/∂ξ linear in (ξ, ẋ), as kinetic energy has it, but it is off by "
            f"{bent:.1e}; co.theory.discrete_mechanical_connection takes any regular Lagrangian."
        )


def timeless(system: System) -> int:
    """m of a system with shapes whose ℓ takes no time, inputs or internal state; raises ArgumentError for others."""
    size = shape_size(system)
    for key in ("t", "inputs", "internal"):
        if system.takes(key):
            raise ArgumentError(
                f"A mechanical connection needs a Lagrangian of ξ, x and ẋ alone, but this one takes `{key}`."
            )
    return size


def shape_size(system: System) -> int:
    """m, the length of arrays of shapes, of a system with shapes; raises ArgumentError for one without."""
    checks.instance(system, "system", System, "a co.System")
    size = system.additional.ambient(system.group)
    if not size:
        raise ArgumentError("A bundle needs a space of shapes, such as additional=co.Trivial(m), but there is none.")
    return size
