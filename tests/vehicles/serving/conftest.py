"""One vehicle in the water, prepared once for all tests of services."""

from __future__ import annotations

import pytest

import coadjoint_vehicles as vehicles
from autopilot import RATE
from coadjoint_vehicles import Craft
from coadjoint_vehicles.serving.ardupilot import Lockstep
from coadjoint_vehicles.serving.frames import motors, thrusters_of
from coadjoint_vehicles.serving.served import Served

IMU = (0.2, -0.1, 0.05)


@pytest.fixture(scope="session")
def craft() -> Craft:
    water = vehicles.water.UniformWater((0.1, -0.2, 0.0))
    return Craft(vehicles.load("bluerov2_heavy_von_benzon"), water=water)


@pytest.fixture(scope="session")
def served(craft: Craft) -> Served:
    return Served(craft, craft.start(position=(0.0, 0.0, 2.0)), 1.0 / RATE, IMU)


@pytest.fixture
def fresh(served: Served) -> Served:
    served.reset()
    return served


@pytest.fixture
def lockstep(fresh: Served) -> Lockstep:
    thrusters = thrusters_of(fresh.craft.vehicle)
    return Lockstep(lambda rate: fresh, thrusters, motors("vectored_6dof", thrusters))
