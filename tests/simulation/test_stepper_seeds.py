"""Random currents begin anew with a seed, the same for a single stepper, for a member and for a run."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import coadjoint as co
import coadjoint_vehicles as vehicles
from coadjoint.errors import ArgumentError
from coadjoint_vehicles import Craft
from coadjoint_vehicles.water.currents import TidalCurrent
from coadjoint_vehicles.water.gauss_markov import GaussMarkovCurrent
from coadjoint_vehicles.water.random_numbers import normal, stream
from coadjoint_vehicles.water.sea import Sea

COMMANDS = {"rudder": 0.0, "stern_planes": 0.0, "propeller": 15.0}
OBSERVE = {"z": lambda s: s.internal.water.z, "q": lambda s: s.q}


@pytest.mark.long
def test_a_seed_begins_the_noise_of_a_run_with_that_seed():
    craft = Craft(vehicles.load("remus_100"), water=GaussMarkovCurrent((0.2, 0.2, 0.0), 30.0, seed=3))
    start = craft.start(velocity=(1.5, 0.0, 0.0), actuators={"propeller": 15.0})
    remus = co.Stepper(craft.system, start, dt=0.1, inputs=COMMANDS, observe=OBSERVE)
    other = Craft(vehicles.load("remus_100"), water=GaussMarkovCurrent((0.2, 0.2, 0.0), 30.0, seed=8))
    begun = other.start(velocity=(1.5, 0.0, 0.0))
    remus.reset(seed=8)
    assert np.array_equal(remus.state.internal.water.random, begun.internal.water.random)
    table = {name: co.Held([0.0], [value]) for name, value in COMMANDS.items()}
    run = co.trajectory(other.system, remus.state, dt=0.1, steps=50, inputs=table)
    remus.step(n=50)
    assert np.array_equal(remus.observation["z"], run.final.internal.water.z)
    first = remus.observation["z"].copy()
    remus.reset(seed=8)
    remus.step(n=50)
    assert np.array_equal(remus.observation["z"], first)
    remus.reset()
    remus.step(n=50)
    assert np.all(remus.observation["z"] != first)


class Gusts:
    """A rule whose gust is a normal number at every node."""

    def __call__(self, motion, h, p):
        z, random = normal(motion.internal.random, 1)
        return {"z": z, "random": random}

    def seeded(self, internal, seeds):
        return internal.replace(random=np.array([stream(seed) for seed in seeds]))


def test_members_have_seeds_of_their_own():
    vane = co.System(
        co.SO2(),
        lambda xi, p: 0.5 * p.inertia * xi[0] ** 2,
        parameters=co.Parameters(inertia=2.0),
        forces=lambda motion, p: co.Force(torque=motion.internal.z),
        internal=Gusts(),
    )
    start = vane.state(internal={"z": np.zeros(1), "random": stream(0)})
    options = {"dt": 0.1, "observe": {"mu": lambda s: s.mu}}
    single, fleet = co.Stepper(vane, start, **options), co.Stepper(vane, start, **options, members=5)
    fleet.reset(seed=np.arange(10, 15))
    fleet.reset(seed=[21, 22], mask=[False, True, False, True, False])
    fleet.step(n=50)
    for member, seed in enumerate([10, 21, 12, 22, 14]):
        single.reset(seed=seed)
        single.step(n=50)
        np.testing.assert_allclose(fleet.observation["mu"][member], single.observation["mu"], rtol=1e-12)
    for wrong in (3, [1, 2], [0.5] * 5, [-1, 0, 1, 2, 3]):
        with pytest.raises(ArgumentError, match="Argument `seed` must be whole numbers, one for each of 5"):
            fleet.reset(seed=wrong)
    with pytest.raises(ArgumentError, match="Argument `seed` must be a whole number from 0 on"):
        single.reset(seed="now")


@pytest.mark.long
def test_the_random_currents_of_a_sea_have_different_seeds():
    gusts: dict[str, Any] = {name: GaussMarkovCurrent((0.1, 0.1, 0.0), 9.0, seed=k) for k, name in enumerate("ab")}
    sea = Sea(tide=TidalCurrent(["M2"], [[0.5, 0.0, 0.0]]), **gusts)
    seen = [sea.seeded(seed).start()[name]["random"].tobytes() for seed in range(4) for name in gusts]
    assert len(set(seen)) == 8
