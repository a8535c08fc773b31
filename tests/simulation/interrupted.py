"""A run in a process of its own, for tests that kill it; `python interrupted.py FOLDER`."""

import sys

import numpy as np

import coadjoint as co

STEPS, SAVE_EVERY = 300_003, 7


def lagrangian(xi, n, nu, a, p):
    kinetic = 0.5 * nu @ (p.mass * nu + p.added_mass @ nu) + 0.5 * xi @ p.inertia @ xi
    return kinetic + p.net_weight * n @ a - p.buoyancy * p.center_of_buoyancy @ a


def system(**changes) -> co.System:
    """The paper's vehicle."""
    values = {
        "mass": 123.8,
        "added_mass": np.diag([65, 70, 75]),
        "inertia": np.diag([5.46, 5.29, 5.72]),
        "net_weight": -1.322,
        "buoyancy": 1215.8,
        "center_of_buoyancy": [0, 0, -0.007],
    }
    parameters = co.Parameters(**{**values, **changes})
    return co.System(co.SO3(), lagrangian, additional=co.Defining(), advected=co.Defining(), parameters=parameters)


def start(vehicle: co.System) -> co.State:
    """Table 2 of the paper."""
    return vehicle.state(q=[0, 0, 1], xi=np.radians([10, 0, 20]), qdot=[0.1, 0.1, 0.8], a0=[0, 0, 1])


def simulate(store=None, **changes):
    """The run that is interrupted."""
    vehicle = system()
    grid = {"dt": 0.01, "steps": STEPS, "save_every": SAVE_EVERY, "progress": False}
    return co.simulate(vehicle, start(vehicle), store=store, **{**grid, **changes})


def without_pauses() -> None:
    """A checkpoint after every stretch, so that interruptions meet writing as often as computing."""
    from coadjoint.simulation import store

    store.PERIOD, store.BURDEN = 0.0, 0.0


if __name__ == "__main__":
    without_pauses()
    simulate(sys.argv[1])
