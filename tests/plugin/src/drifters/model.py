"""A bottom-heavy float that swings about its centre of buoyancy."""

from __future__ import annotations

import numpy as np

import coadjoint as co


def lagrangian(xi, a, p):
    """ℓ(ξ, a) = ½ ξ·Jξ + w c·a, with the direction of down a and the centre of mass c below that of buoyancy."""
    return 0.5 * xi @ p.inertia @ xi + p.weight * p.center @ a


def make(*, inertia: tuple[float, ...], weight: float, center: tuple[float, ...]) -> co.System:
    """The float; inertia: the diagonal of J, (3,) kg m²; weight: w, N; center: c, (3,) m."""
    p = co.Parameters(inertia=np.diag(inertia), weight=weight, center=center)
    return co.System(co.SO3(), lagrangian, advected=co.Defining(), parameters=p)


def start(system: co.System, *, roll: float, roll_rate: float) -> co.State:
    """The float at a roll, rad, and with a rate of roll, rad/s."""
    return system.state(g=co.attitude.zyx(0, 0, roll), xi=[roll_rate, 0, 0], a0=[0, 0, 1])
