"""Elroy's beanie: two bodies in the plane on one hinge through both mass centres (Marsden, Montgomery, Ratiu 1990)."""

from __future__ import annotations

from functools import partial

import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.groups import SO2
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.members import Quantity
from coadjoint.mechanics.parameters import Parameters
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.models.quantities import checked, not_negative, number, positive
from coadjoint.models.rigid_body import WITH_ANGLES
from coadjoint.spaces import Trivial

CHECKS = {"body": positive, "cap": positive, "stiffness": not_negative}
"""Of the parameters, when one is made and when they are replaced."""


def lagrangian(xi, x, v, p):
    """ℓ = ½ I₁ω² + ½ I₂(ω + ψ̇)² − ½kψ²."""
    body, cap = xi[0], xi[0] + v[0]
    return 0.5 * p.body * body**2 + 0.5 * p.cap * cap**2 - 0.5 * p.stiffness * x[0] ** 2


def make(*, body: PyTree, cap: object, stiffness: Quantity) -> System:
    """A body that turns in the plane with a cap on it, on SO(2) with the angle ψ of the cap against it as its shape.

    ℓ = ½ I₁ω² + ½ I₂(ω + ψ̇)² − ½kψ². The mechanical connection A = I₂/(I₁ + I₂) is flat: with momentum zero, a full
    turn of the cap turns the body by −2πI₂/(I₁ + I₂). body, cap: I₁, I₂, kg m². stiffness: k of the spring between
    them, N m. Raises ArgumentError for what no body has.
    """
    p = Parameters(**checked(CHECKS, {"body": body, "cap": cap, "stiffness": stiffness}))
    kept = {"units": WITH_ANGLES, "checks": partial(checked, CHECKS)}
    return System(SO2(), lagrangian, additional=Trivial(1), parameters=p, name="Elroy's beanie", **kept)


def start(
    beanie: System,
    *,
    angle: Quantity = 0.0,
    angular_velocity: Quantity = 0.0,
    cap_angle: Quantity = 0.0,
    cap_rate: Quantity = 0.0,
) -> State:
    """The state at angle θ (rad) of the body, its angular velocity ω (rad/s), the cap's angle ψ and rate ψ̇."""
    theta = number(angle, "angle")
    omega, psi, rate = (
        number(value, name)
        for value, name in ((angular_velocity, "angular_velocity"), (cap_angle, "cap_angle"), (cap_rate, "cap_rate"))
    )
    return beanie.state(g=evaluate(SO2().exp, np.array([theta])), xi=[omega], q=[psi], qdot=[rate])
