"""Constrained systems of the audit, with motions that no step of a method computes."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.integrate import solve_ivp

from coadjoint.groups import SO3, attitude
from coadjoint.mechanics.constraints import Holonomic, Nonholonomic
from coadjoint.mechanics.continuous import reference
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.spaces import Defining

INERTIA, MASS, PIN, WEIGHT = np.diag([0.7, 0.9, 0.5]), 1.4, np.array([0.2, -0.1, 0.6]), 1.5
SUSLOV, BLADE = np.diag([1.0, 2.0, 1.5]), np.array([0.3, -0.2, 1.0])


def pinned_body() -> tuple[System, State]:
    """A heavy body on SO(3) with its place in Q = ℝ³, of which one point is held: n + r = 0; against the heavy top."""

    def body(xi, n, nu, a, p):
        return 0.5 * xi @ p.inertia @ xi + 0.5 * p.mass * nu @ nu - p.weight * n @ a

    pinned = System(
        SO3(), body, additional=Defining(), advected=Defining(),
        parameters={"inertia": INERTIA, "mass": MASS, "weight": WEIGHT, "pin": PIN},
        constraints={"pin": Holonomic(lambda n, a, p: n + p.pin)},
    )  # fmt: skip
    return pinned, _pinned(pinned, _top().state(g=attitude.zyx(0.3, 0.5, -0.4), xi=[0.5, -0.3, 2.0], a0=[0, 0, 1]))


def _top() -> System:
    """The same body about its pin, with the inertia by Steiner's theorem."""
    about = INERTIA + MASS * (PIN @ PIN * np.eye(3) - np.outer(PIN, PIN))

    def top(xi, a, p):
        return 0.5 * xi @ p.inertia @ xi + p.weight * p.pin @ a

    return System(SO3(), top, advected=Defining(), parameters={"inertia": about, "weight": WEIGHT, "pin": PIN})


def _pinned(pinned: System, top: State) -> State:
    """The state of the pinned body that moves as the top."""
    R, omega = np.asarray(top.g), np.asarray(top.xi)
    down = R @ np.asarray(top.a)
    return pinned.state(g=R, q=-R @ PIN, xi=omega, qdot=R @ np.cross(omega, -PIN), a0=down, t=float(top.t))


@lru_cache(maxsize=8)
def pinned_exactly(time: float) -> State:
    """Its motion at a time: that of the top, by DOP853."""
    pinned, start = pinned_body()
    top = _top()
    begun = top.state(g=start.g, xi=start.xi, a0=[0, 0, 1])
    record = reference(top, begun, [time])
    names = ("t", "g", "a", "xi", "mu")
    return _pinned(pinned, begun.replace(**{name: getattr(record, name)[0] for name in names}))


def suslov() -> tuple[System, State]:
    """Suslov's body on SO(3), whose rate along one direction fixed in it is held at zero: b·ω = 0; against DOP853."""
    body = System(
        SO3(),
        lambda xi, p: 0.5 * xi @ p.inertia @ xi,
        parameters={"inertia": SUSLOV, "blade": BLADE},
        constraints={"blade": Nonholonomic(lambda p: p.blade[None])},
    )
    omega = np.array([0.9, 0.6, 0.0])
    omega[2] = -BLADE[:2] @ omega[:2] / BLADE[2]
    return body, body.state(g=attitude.zyx(0.3, -0.2, 0.5), xi=omega)


@lru_cache(maxsize=8)
def suslov_exactly(time: float) -> State:
    """Its motion at a time: Jω̇ = Jω × ω + λb with b·ω̇ = 0, and Ṙ = R ω̂, by DOP853."""
    body, start = suslov()
    back = np.linalg.inv(SUSLOV)

    def slopes(_, y):
        omega, R = y[:3], y[3:].reshape(3, 3)
        torque = np.cross(SUSLOV @ omega, omega)
        strength = -(BLADE @ back @ torque) / (BLADE @ back @ BLADE)
        return np.concatenate([back @ (torque + strength * BLADE), np.ravel(np.cross(R, omega))])

    begun = np.concatenate([np.asarray(start.xi), np.ravel(start.g)])
    y = solve_ivp(slopes, (0, time), begun, method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    U, _, V = np.linalg.svd(y[3:].reshape(3, 3))
    return body.state(g=U @ V, xi=y[:3], t=time)
