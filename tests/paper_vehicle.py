"""The paper's vehicle (Table 1, Table 2), written as a user would."""

import numpy as np

import coadjoint as co

PARAMETERS = co.Parameters(
    mass=123.8,
    added_mass=np.diag([65, 70, 75]),
    inertia=np.diag([5.46, 5.29, 5.72]),
    net_weight=123.8 * 9.81 - 1215.8,
    buoyancy=1215.8,
    center_of_buoyancy=[0, 0, -0.007],
)


def lagrangian(xi, n, nu, a, p):
    kinetic = 0.5 * nu @ (p.mass * nu + p.added_mass @ nu) + 0.5 * xi @ p.inertia @ xi
    return kinetic + p.net_weight * n @ a - p.buoyancy * p.center_of_buoyancy @ a


def system(ell=lagrangian, parameters=PARAMETERS, **keywords) -> co.System:
    """The vehicle, with a Lagrangian, parameters or forces of one's own."""
    places = {"additional": co.Defining(), "advected": co.Defining()}
    return co.System(co.SO3(), ell, **places, parameters=parameters, **keywords)


def start(vehicle: co.System, **changes) -> co.State:
    """Table 2."""
    values = {"q": [0, 0, 1], "xi": np.radians([10, 0, 20]), "qdot": [0.1, 0.1, 0.8], "a0": [0, 0, 1]}
    return vehicle.state(**{**values, **changes})
