"""The nodes at which a rule evaluates ℓ and the forces on a step, derived again from its definition.

Neither the node forms nor (dτ⁻¹)* of `methods` are used, so that results from here do not share their mistakes. A rule
of one velocity has the nodes g_kX_i with X = e, H, F at t + c_ih, c = 0, ½, 1, and

    Λ(ξ, n, s, a) = h Σ w_i ℓ(ξ, X_i⁻¹(n + c_id), X_i⁻¹d/h, X_i⁻¹a; t + c_ih),   d = s − n.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp

from coadjoint.arrays import Array, Scalar
from coadjoint.errors import ArgumentError
from coadjoint.groups.group import Element
from coadjoint.mechanics.discrete import Point
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods import (
    AdjointVariational,
    Galerkin,
    GroupVariational,
    LeftRectangle,
    Midpoint,
    RightRectangle,
    Simpson,
    Trapezoidal,
    Variational,
)
from coadjoint.methods.increments import HalfStepSquared
from coadjoint.methods.quadrature import gauss, lobatto
from coadjoint.methods.simpson import sagitta
from coadjoint.methods.step import Step
from coadjoint.methods.variable_step import Paced

NODES: dict[type, tuple[tuple[float, float], ...]] = {
    LeftRectangle: ((0.0, 1.0),),
    RightRectangle: ((1.0, 1.0),),
    Trapezoidal: ((0.0, 0.5), (1.0, 0.5)),
    Midpoint: ((0.5, 1.0),),
    Simpson: ((0.0, 1 / 6), (0.5, 4 / 6), (1.0, 1 / 6)),
}
"""Places c_i and weights w_i of the rules of one velocity."""


class NodePlace(NamedTuple):
    """A node: its weight, its frame X = g_k⁻¹g, its position x = X·n seen from node k, and what ℓ sees there.

    weight: one number. x: (ambient,).
    """

    weight: float
    frame: Element
    x: Array
    point: Point


class Curve(NamedTuple):
    """A step: F = g_k⁻¹g_{k+1}, d = s − n, its nodes, and Λ.

    d: (ambient,). value: one number.
    """

    F: Element
    d: Array
    places: list[NodePlace]
    value: Scalar


class Trial(NamedTuple):
    """The unknowns z of a step at its record, and the step as a function of (z, n, a).

    z is (ξ, d) for a rule of one velocity, (χ, d) with F = e^χF_k for Λ in group form, the velocities at the nodes for
    Galerkin's curves.

    z: (unknowns,).
    """

    z: Array
    curve: Callable[[Array, Array, Array], Curve]


def trial(system: System, step: Step, h: Scalar, record: State) -> Trial:
    """The step of length h, one number, that starts at a record.

    Raises ArgumentError for steps without a discrete Lagrangian of their own.
    """
    kinds = [
        (GroupVariational, _in_group_form),
        (Variational, _in_algebra_form),
        (Galerkin, _galerkin),
        (tuple(NODES), _quadrature),
    ]
    if isinstance(step, Paced):
        return trial(system, step.base, step.size(record, h), record)
    for kind, made in kinds:
        if isinstance(step, kind):
            return made(system, step, h, record)
    if type(step).nodes is not Step.nodes:
        return _of_ones_own(system, step, h, record)
    raise ArgumentError(
        f"{type(step).__name__} has no discrete Lagrangian whose Legendre transforms are known: use a variational "
        "method, such as co.Midpoint() or co.methods.GroupVariational()."
    )


def _action(system: System, record: State, h: Scalar, places: list[NodePlace]) -> Array:
    """h Σ w ℓ."""

    def at(point: Point) -> Array:
        return system.reduced_lagrangian(*point, record.inputs, record.over_step, near=(record.mu, record.pi))

    return h * sum((place.weight * at(place.point) for place in places), jnp.zeros(()))


def _place(
    system: System, weight: float, frame: Element, xi: Array, x: Array, v: Array, a: Array, t: Scalar
) -> NodePlace:
    """A node in the frame X: (ξ, X⁻¹x, X⁻¹v, X⁻¹a) at t."""
    group, Q, V = system.places
    back = group.inverse(frame)
    point = Point(xi, Q.act(group, back, x), Q.push(group, back, x, v), V.act(group, back, a), t)
    return NodePlace(weight, frame, x, point)


def _chord(system: System, step: Step, h: Scalar, record: State) -> Array:
    """d = s − n of a record, from ν in the frame of the rule's own node."""
    group, Q, _ = system.places
    turn = step.turn(system, h, record.xi)
    if turn is None:
        return h * record.nu
    return h * Q.push(group, turn, Q.act(group, group.inverse(turn), record.n), record.nu)


def _quadrature(system: System, step: Step, h: Scalar, record: State) -> Trial:
    group, tau, dim = system.group, step.difference_map, system.group.dim

    def curve(z: Array, n: Array, a: Array) -> Curve:
        xi, d = z[:dim], z[dim:]
        H = tau.tau(group, 0.5 * h * xi)
        F = group.compose(H, H) if isinstance(step, HalfStepSquared) else tau.tau(group, h * xi)
        frames = {0.0: group.identity(), 0.5: H, 1.0: F}
        e = _bend(system, step, H, n, d)
        places = [
            _place(
                system,
                w,
                frames[c],
                xi,
                n + c * d + 4 * c * (1 - c) * e,
                (d + 4 * (1 - 2 * c) * e) / h,
                a,
                record.t + c * h,
            )
            for c, w in next(nodes for kind, nodes in NODES.items() if isinstance(step, kind))
        ]
        return Curve(F, d, places, _action(system, record, h, places))

    return Trial(jnp.concatenate([record.xi, _chord(system, step, h, record)]), curve)


def _bend(system: System, step: Step, H: Element, n: Array, d: Array) -> Array:
    """How far the middle of Simpson's parabola on a curved Q is from that of the chord, (ambient,), in n's frame."""
    group, Q, _ = system.places
    if Q.flat or not isinstance(step, Simpson):
        return jnp.zeros_like(d)
    back = group.inverse(H)
    return Q.push(group, H, n, sagitta(system, Q.act(group, back, n), Q.act(group, back, n + d)))


def _of_ones_own(system: System, step: Step, h: Scalar, record: State) -> Trial:
    """A rule that only gives its sum h Σ w ℓ, without forces: the places of its nodes are not known."""
    if system.forces is not None:
        raise ArgumentError(
            f"Where {type(step).__name__} lets forces act is not known here: take co.Midpoint() or another rule of the "
            "library, or a system without forces."
        )
    group, Q, dim = system.group, system.additional, system.group.dim

    def curve(z: Array, n: Array, a: Array) -> Curve:
        xi, d = z[:dim], z[dim:]
        turn = step.turn(system, h, xi)
        nu = d / h if turn is None else Q.push(group, group.inverse(turn), n, d / h)
        value = step.discrete_lagrangian(system, record.replace(xi=xi, n=n, nu=nu, a=a), h)
        return Curve(step.relative(system, record.replace(xi=xi), h), d, [], value)

    return Trial(jnp.concatenate([record.xi, _chord(system, step, h, record)]), curve)


def _in_algebra_form(system: System, step: Variational, h: Scalar, record: State) -> Trial:
    """Λ(ξ, n, s, a) of the user with forces at the left node, or its adjoint with forces at the right one."""
    group, Q, V = system.places
    dim, held = group.dim, (record.inputs, record.over_step)
    adjoint = isinstance(step, AdjointVariational)

    def curve(z: Array, n: Array, a: Array) -> Curve:
        xi, d = z[:dim], z[dim:]
        F = step.difference_map.tau(group, h * xi)
        back, s = group.inverse(F), n + d
        if adjoint:
            ends = Q.act(group, back, s), Q.act(group, back, n), V.act(group, back, a)
            value = -system.reduced_discrete_lagrangian(xi, *ends, -h, record.t + h, *held)
            place = _place(system, 1.0, F, xi, s, d / h, a, record.t + h)
        else:
            value = system.reduced_discrete_lagrangian(xi, n, s, a, h, record.t, *held)
            place = _place(system, 1.0, group.identity(), xi, n, d / h, a, record.t)
        return Curve(F, d, [place], value)

    return Trial(jnp.concatenate([record.xi, _chord(system, step, h, record)]), curve)


def _in_group_form(system: System, step: GroupVariational, h: Scalar, record: State) -> Trial:
    """Λ(F, n, s, a) with F = (1 + χ̂)F_k, which is e^χF_k to first order; forces at the left node."""
    group, dim = system.group, system.group.dim
    last = step.relative(system, record, h)

    def curve(z: Array, n: Array, a: Array) -> Curve:
        chi, d = z[:dim], z[dim:]
        turn = jax.tree.map(lambda e, change: e + change, group.identity(), group.tangent(chi))
        F = group.compose(turn, last)
        value = system.reduced_group_lagrangian(F, n, n + d, a, h, record.t, record.inputs, record.over_step)
        # Forces are not varied: they see the F of the record.
        xi = group.vee(group.matrix(last) - group.matrix(group.inverse(last))) / (2 * h)
        return Curve(F, d, [_place(system, 1.0, group.identity(), xi, n, d / h, a, record.t)], value)

    return Trial(jnp.concatenate([jnp.zeros(dim), h * record.nu]), curve)


def _galerkin(system: System, step: Galerkin, h: Scalar, record: State) -> Trial:
    """g(t) = ḡτ(Θ(t)), q(t) = ḡ·x(t) with polynomials of the velocities Ω, V at Gauss's nodes; Θ = 0 in the middle.

    On a curved Q z holds Ω, tangents at the points of x between the ends, and the chord s − n.
    """
    group, Q, _ = system.places
    tau, rule = step.difference_map, gauss(step.degree)
    split = step.degree * group.dim
    given, through = record.memory[split:].reshape(step.degree, -1), lobatto(step.degree)
    to_end = h * (through.reach @ given)

    def velocities(z: Array, back: Element, n: Array) -> Array:
        if Q.flat:
            return z[split:].reshape(given.shape)
        half = -h * (rule.half @ record.memory[:split].reshape(step.degree, -1))
        points = Q.act(group, tau.tau(group, half), record.n) + to_end[:-1]
        moves, chord = (
            z[split : -n.shape[0]].reshape(step.degree - 1, Q.dim(group)),
            Q.push(group, back, n, z[-n.shape[0] :]),
        )
        between = [x + Q.tangent(group, x, w) - Q.act(group, back, n) for x, w in zip(points, moves, strict=True)]
        return through.slope[:, 1:] @ jnp.stack([*between, chord]) / h

    def curve(z: Array, n: Array, a: Array) -> Curve:
        omega = z[:split].reshape(step.degree, -1)
        theta = h * (rule.centred @ omega)
        to_middle = group.inverse(tau.tau(group, -h * (rule.half @ omega)))  # ḡ seen from node k
        back = group.inverse(to_middle)
        start, v = Q.act(group, back, n), velocities(z, back, n)
        x = start + h * (rule.until @ v)
        places = []
        for i in range(step.degree):
            frame = group.compose(to_middle, tau.tau(group, theta[i]))
            xi = tau.dtau(group, -theta[i], omega[i])
            there = Q.act(group, to_middle, x[i]), Q.push(group, to_middle, x[i], v[i])
            places.append(_place(system, float(rule.b[i]), frame, xi, *there, a, record.t + h * float(rule.c[i])))
        F = group.compose(to_middle, tau.tau(group, h * (rule.half[::-1] @ omega)))
        d = Q.push(group, to_middle, start, h * (rule.b @ v))
        return Curve(F, d, places, _action(system, record, h, places))

    if Q.flat:
        return Trial(record.memory, curve)
    back = tau.tau(group, h * (rule.half @ record.memory[:split].reshape(step.degree, -1)))
    chord = Q.push(group, back, record.n, to_end[-1])
    still = jnp.zeros((step.degree - 1) * Q.dim(group))
    return Trial(jnp.concatenate([record.memory[:split], still, chord]), curve)
