"""Environments and served craft whose steps are too long for the vehicle say so once; theirs by default are not."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import coadjoint_vehicles as vehicles
from coadjoint_vehicles import Craft
from coadjoint_vehicles.environments import simulated
from coadjoint_vehicles.serving import served
from coadjoint_vehicles.serving.served import Served

pytest.importorskip("gymnasium")


class Made(Exception):
    """What a stepper is made with."""


def recording(*_, **given):
    raise Made(given["accuracy"])


@pytest.mark.parametrize("accuracy", [True, False])
def test_environments_and_served_craft_hand_on_whether_steps_are_judged(monkeypatch, accuracy):
    monkeypatch.setattr(simulated, "Stepper", recording)
    monkeypatch.setattr(served, "Stepper", recording)
    craft = Craft(vehicles.load("remus_100"))
    for made in (
        lambda: vehicles.environment("remus_100", accuracy=accuracy),
        lambda: vehicles.vector_environment("remus_100", num_envs=2, accuracy=accuracy),
        lambda: Served(craft, craft.start(), 0.05, accuracy=accuracy),
    ):
        with pytest.raises(Made, match=str(accuracy)):
            made()


def told(run) -> int:
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        run()
    return sum("does not resolve this motion" in str(one.message) for one in said)


def flown(**more):
    env = vehicles.environment("remus_100", task="hold_station", **more)
    env.reset(seed=1)
    for _ in range(12):
        if any(env.step(np.ones(env.action_space.shape, np.float32))[2:4]):
            env.reset()


@pytest.mark.long
def test_an_environment_of_long_steps_warns_once():
    long = {"dt": 2.0, "period": 2.0}
    assert told(lambda: flown(**long)) == 1
    assert told(lambda: flown(**long, accuracy=False)) == 0
    assert told(flown) == 0


@pytest.mark.long
def test_a_served_craft_of_long_steps_warns_once():
    craft = Craft(vehicles.load("remus_100"))
    start = craft.start(position=(0, 0, 5), speed=1.5, actuators={"propeller": 25.0})

    def run(dt, **more):
        made = Served(craft, start, dt, **more)
        for _ in range(20):
            made.advance({"rudder": 0.15, "stern_planes": 0.05, "propeller": 25.0}, steps=1)

    assert told(lambda: run(2.0)) == 1
    assert told(lambda: run(2.0, accuracy=False)) == 0
    assert told(lambda: run(0.05)) == 0
