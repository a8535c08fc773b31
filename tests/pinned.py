"""A body pinned at one point in maximal coordinates, SO(3) × ℝ³, and the same heavy top in minimal ones."""

from __future__ import annotations

import numpy as np

import coadjoint as co

INERTIA, MASS, PIN = np.diag([0.3, 0.4, 0.2]), 2.0, np.array([0.1, 0.2, -0.5])
RATES = np.array([1.0, 2.0, 3.0])


def lagrangian(xi, n, nu, a, p):
    return 0.5 * xi @ p.inertia @ xi + 0.5 * p.mass * nu @ nu - 9.81 * p.mass * n @ a


def hold(n, a, p):
    """The point `pin` of the body is at the origin of space."""
    return n + p.pin


def body(**more):
    """The body, free unless `constraints` are given."""
    return co.System(
        co.SO3(),
        lagrangian,
        additional=co.Defining(),
        advected=co.Defining(),
        parameters={"inertia": INERTIA, "mass": MASS, "pin": PIN},
        **more,
    )


def pinned(**more):
    return body(constraints={"pin": co.Holonomic(hold)}, **more)


def start(system, **changed):
    return system.state(**{"q": -PIN, "xi": RATES, "qdot": np.cross(RATES, -PIN), "a0": [0, 0, 1], **changed})


def top():
    """The top about the pin: its inertia by Steiner, its centre at −PIN."""
    about = INERTIA + MASS * (PIN @ PIN * np.eye(3) - np.outer(PIN, PIN))
    return co.System(
        co.SO3(),
        lambda xi, a, p: 0.5 * xi @ p.inertia @ xi + 9.81 * p.moment @ a,
        advected=co.Defining(),
        parameters={"inertia": about, "moment": MASS * PIN},
    )


def reference(duration):
    """The final state of the top after `duration` s, to 1e-12."""
    system = top()
    quiet = {"monitors": False, "accuracy": False, "save_every": round(duration / 0.01)}
    method = co.methods.SofroniouSpaletta8(co.Midpoint())
    return co.simulate(system, system.state(xi=RATES, a0=[0, 0, 1]), dt=0.01, duration=duration, method=method, **quiet)
