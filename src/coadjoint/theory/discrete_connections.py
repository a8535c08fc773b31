"""The discrete mechanical connection of a rule: horizontal steps have momentum zero."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, Scalar
from coadjoint.checks import float64
from coadjoint.errors import ArgumentError
from coadjoint.kernels.newton import solver
from coadjoint.kernels.program import Code
from coadjoint.mechanics.connection import random_shapes
from coadjoint.mechanics.discrete_connection import DiscreteConnection
from coadjoint.mechanics.locked_inertia import timeless
from coadjoint.mechanics.system import System
from coadjoint.methods import Method
from coadjoint.methods.step import Step


def discrete_mechanical_connection(system: System, method: Method, dt: float) -> DiscreteConnection:
    """The discrete mechanical connection of a rule: Ω(x, x⁺) is the F with D^R_FΛ(F, x, x⁺; h) = 0.

    system: one with the shapes `additional=co.Trivial(m)`, as in co.mechanics.mechanical_connection. method: a rule of
        one stage.
    dt: h, s. D^R_FΛ = μ_k is the left discrete Legendre transform, so that horizontal steps are those with momentum
    zero, and a motion of the method with momentum zero is the horizontal lift of its shapes. Of kinetic energy and a
    potential of x, Ω does not depend on dt. Forces have no part in it. Where no F is found, Ω is not finite, and what
    uses it raises. Raises ArgumentError for other systems and methods.
    """
    size, step, h = timeless(system), one_stage(system, method), positive_step(dt)
    system = system.unforced
    group = system.group
    at = method.begin(system, system.state(q=random_shapes(size, 1)[0]), h)
    at = at.replace(mu=np.zeros(group.dim))

    def increment(x: Array, x_next):
        here, nu = at.replace(n=x), (x_next - x) / h

        def record(xi: Array):
            return step.record(system, here, h, jnp.concatenate([xi, nu]))

        def momentum(xi: Array):
            return step.equations(system, record(xi), h)[: group.dim]

        root = solver.solve(momentum, jnp.zeros(group.dim), h, (group.dim,))
        xi = jnp.where(root.code == Code.CONVERGED, root.unknowns, jnp.nan)
        return step.relative(system, record(xi), h)

    return DiscreteConnection(group, size, increment)


def one_stage(system: System, method: Method) -> Step:
    """The step of a method that has one Λ(F, x, x⁺; h); raises ArgumentError for others."""
    checks.instance(method, "method", Method, "a method such as co.Midpoint()")
    step = method.stages[0][0]
    unknowns = system.group.dim, system.additional.dim(system.group)
    if len(method.stages) != 1 or tuple(step.blocks(system)) != unknowns or not method.claims.symplectic:
        raise ArgumentError(
            "A bundle needs a variational rule of one stage, such as co.Midpoint() or co.LeftRectangle(), but got "
            f"{method.title}."
        )
    step.require_fit(system)
    return step


def positive_step(dt: Scalar) -> Array:
    """h > 0, one number, s; raises ArgumentError."""
    h = float64(dt, "Argument `dt`")
    checks.expect(np.shape(h) == () and h > 0, dt, "dt", "a positive number")
    return h
