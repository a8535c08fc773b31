"""The discrete mechanical connection of a rule: horizontal steps have momentum zero."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, Scalar
from coadjoint.checks import float64
from coadjoint.errors import ArgumentError
from coadjoint.groups.group import Element
from coadjoint.kernels.newton import solver
from coadjoint.kernels.program import Code
from coadjoint.mechanics.connection import random_shapes
from coadjoint.mechanics.discrete_connection import DiscreteConnection
from coadjoint.mechanics.locked_inertia import timeless
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods import Method
from coadjoint.methods.step import Step


def discrete_mechanical_connection(system: System, method: Method, dt: float) -> DiscreteConnection:
    """The discrete mechanical connection of a rule: Ω(x, x⁺) is the F with D^R_FΛ(F, x, x⁺; h) = 0.

    system: one with shapes and without advected parameters, as in co.mechanics.mechanical_connection. method: a rule of
        one stage.
    dt: h, s. D^R_FΛ at fixed x and x⁺ is the total momentum m_k, so that horizontal steps are those with momentum
    zero, and a motion of the method with momentum zero is the horizontal lift of its shapes. Of kinetic energy and a
    potential of shapes on which G does nothing, Ω does not depend on dt. Forces have no part in it. Where no F is
    found, Ω is not finite, and what uses it raises. Raises ArgumentError for other systems and methods.
    """
    size, step, h = timeless(system), one_stage(system, method), positive_step(dt)
    if system.advected.ambient(system.group):
        raise ArgumentError(
            "With advected parameters momentum is not conserved, so that no discrete connection is that of momentum "
            "zero: take co.mechanics.DiscreteConnection.from_connection(co.mechanics.mechanical_connection(system))."
        )
    system = system.unforced
    group, Q, _ = system.places
    at = system.state(q=Q.given(group, random_shapes(Q, group, 1)[0]))
    at = method.begin(system, at, h).replace(mu=np.zeros(group.dim))

    def increment(x: Array, x_next: Array) -> Element:
        def momentum(xi: Array):
            return jax.grad(lambda xi: step.discrete_lagrangian(system, link(system, step, h, at, xi, x, x_next), h))(
                xi
            )

        root = solver.solve(lambda xi: momentum(xi) / h, jnp.zeros(group.dim), h, (group.dim,))
        xi = jnp.where(root.code == Code.CONVERGED, root.unknowns, jnp.nan)
        return step.relative(system, link(system, step, h, at, xi, x, x_next), h)

    return DiscreteConnection(group, size, increment, shapes=Q)


def link(system: System, step: Step, h: Scalar, state: State, xi: Array, x: Array, x_next: Array) -> State:
    """The record of a step with velocity ξ (dim G,) from the shape x to x⁺, (m,) each: n = x, s = F·x⁺."""
    group, Q, _ = system.places
    record = step.record(system, state.replace(n=x), h, jnp.concatenate([xi, jnp.zeros(Q.dim(group))]))
    turn, s = step.turn(system, h, xi), Q.act(group, step.relative(system, record, h), x_next)
    if turn is None:
        return record.replace(nu=(s - x) / h)
    back = group.inverse(turn)
    return record.replace(nu=(Q.act(group, back, s) - Q.act(group, back, x)) / h)


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
