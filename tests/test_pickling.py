"""Objects leave the process: by pickle where their functions have names, by cloudpickle always; and they are copied."""

from __future__ import annotations

import copy
import math
import pickle
from collections.abc import Callable
from functools import cache, partial
from multiprocessing import get_context
from typing import Any

import cloudpickle
import numpy as np
import pytest

import coadjoint as co
import coadjoint_vehicles as vehicles
import pickled
from coadjoint.errors import ArgumentError
from coadjoint.portable import Remade

WAYS: dict[str, Callable[[Any], Any]] = {
    "pickle": lambda one: pickle.loads(pickle.dumps(one)),
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
    "cloudpickle": lambda one: pickle.loads(cloudpickle.dumps(one)),
}
BASES = {
    "coadjoint.difference_maps.DifferenceMap",
    "coadjoint.groups.LieGroup",
    "coadjoint.spaces.Representation",
    "coadjoint.spaces.Space",
}
NOT_MADE = {
    "coadjoint.control.PhasedOptimum": "runs and numbers, from a solver",
    "coadjoint.identification.Identification": "runs and numbers, from a solver",
    "coadjoint.control.ExportedStep": "a function of CasADi, which pickles itself",
    "coadjoint.vehicles.serving.Loop": "a socket, which belongs to its process",
}
OTHERS = {"coadjoint.Stepper": "Stepping"}
"""What comes back is of another class: a saved stepper, whose functions are machine code."""


QUICK = (
    "systems",
    "methods",
    "signals",
    "values",
    "vehicles",
    "tasks",
    "controllers",
    "water sea",
    "measurement",
    "log",
)


@cache
def cheap() -> dict[str, Any]:
    return pickled.instances(iter([make() for make in pickled.cheap().values()]))


@cache
def dear() -> dict[str, Any]:
    found = pickled.instances(iter([make() for make in pickled.dear().values()]))
    return {name: one for name, one in found.items() if name not in cheap()}


def taken(one: Any, name: str) -> None:
    for way, take in WAYS.items():
        found = take(one)
        assert type(found).__name__ == (OTHERS.get(name, type(one).__name__) if "pickle" in way else type(one).__name__)


def test_groups_methods_signals_and_parts_of_vehicles_leave_the_process():
    known = pickled.cheap()
    found = pickled.instances(iter([known[name]() for name in QUICK]))
    assert len(found) > 90
    for name, one in found.items():
        assert type(pickle.loads(pickle.dumps(one))) is type(one), name


@pytest.mark.long
def test_objects_of_all_public_classes_leave_the_process():
    for name, one in {**cheap(), **dear()}.items():
        taken(one, name)
    assert set(pickled.public()) - set(cheap()) - set(dear()) == BASES | set(NOT_MADE)


def rotor() -> tuple[co.System, co.State]:
    system = pickled.system()
    return system, system.state(xi=[0.1, 1.0, 0.1])


def rotated(weight: float) -> Any:
    system, start = rotor()
    return co.simulate(
        system.replace(inertia=np.diag([1.0, 2.0, weight])),
        start,
        dt=0.01,
        duration=0.2,
        progress=False,
        accuracy=False,
    )


def test_a_run_comes_back_as_it_was():
    run = rotated(3.0)
    for take in WAYS.values():
        found = take(run)
        assert str(found) == str(run) and found.dataset.identical(run.dataset)
        np.testing.assert_array_equal(found.at([0.055]).mu, run.at([0.055]).mu)


@pytest.mark.long
def test_runs_come_back_from_a_pool_of_processes():
    with get_context("spawn").Pool(1) as pool:
        for weight, found in zip((3.0, 4.0), pool.map(rotated, (3.0, 4.0)), strict=True):
            np.testing.assert_array_equal(found.final.mu, rotated(weight).final.mu)


@pytest.mark.parametrize(
    "change",
    [
        {"lagrangian": lambda xi, p: 0.5 * xi @ xi},
        {"forces": lambda motion, p: co.Force(torque=motion.xi)},
        {"quantities": {"spin": lambda state: state.mu[2]}},
    ],
    ids=["lagrangian", "forces", "quantities"],
)
def test_a_lambda_is_named_by_one_sentence_and_taken_by_cloudpickle_and_deepcopy(change):
    given = {"lagrangian": pickled.lagrangian, "forces": pickled.drag, **change}
    system = co.System(co.SO3(), given.pop("lagrangian"), parameters={"inertia": np.eye(3)}, **given)
    with pytest.raises(ArgumentError, match=r"^A \w+ holds <lambda> of .*test_pickling.py, line \d+, which cannot"):
        pickle.dumps(system)
    assert copy.deepcopy(system).name == system.name == pickle.loads(cloudpickle.dumps(system)).name


def test_a_function_within_another_one_is_named():
    def inner(xi, p):
        return 0.5 * xi @ xi

    system = co.System(co.SO3(), inner, parameters={"inertia": np.eye(3)})
    with pytest.raises(ArgumentError, match=r"A System holds test_a_function.*<locals>.inner of"):
        pickle.dumps(system)


@pytest.mark.long
def test_a_craft_gives_the_same_system_on_the_other_side():
    remus = vehicles.load("remus_100")
    craft = vehicles.Craft(remus, controller=remus.controller)
    found = pickle.loads(pickle.dumps(craft))
    start, other = craft.start(speed=1.5), found.start(speed=1.5)
    np.testing.assert_array_equal(start.mu, other.mu)
    assert [name for name, _ in craft.system.forces] == [name for name, _ in found.system.forces]


@pytest.mark.long
@pytest.mark.parametrize("members", [None, 2])
def test_an_environment_goes_on_to_the_bit_on_the_other_side(members):
    if members is None:
        env: Any = vehicles.environment("bluerov2_heavy_von_benzon", reward=pickled.worth)
    else:
        env = vehicles.vector_environment("bluerov2_heavy_von_benzon", num_envs=members, reward=pickled.worth)
    env.reset(seed=1)
    shape = env.action_space.shape
    env.step(np.full(shape, 0.1))
    others = [WAYS[way](env) for way in ("pickle", "deepcopy", "cloudpickle")]
    for k in range(3):
        seen = [one.step(np.full(shape, 0.1 * k)) for one in (env, *others)]
        for found in seen[1:]:
            np.testing.assert_array_equal(found[0], seen[0][0])
            np.testing.assert_array_equal(found[1], seen[0][1])
    begun = [one.reset()[0] for one in (env, *others)]
    for found in begun[1:]:
        np.testing.assert_array_equal(found, begun[0])


@pytest.mark.long
def test_a_filter_goes_on_to_the_bit_on_the_other_side():
    system, start = rotor()
    process = co.estimation.ModelProcess(system, start, noise={"torque": 0.1})
    filter = pickled.filtering(process, start)
    filter.predict(0.05)
    others = [take(filter) for take in WAYS.values()]
    for one in (filter, *others):
        one.predict(0.05)
        one.update({"spin": 0.2})
    for one in others[1:]:
        np.testing.assert_array_equal(one.rows, filter.rows)
        np.testing.assert_array_equal(one.P, filter.P)


class Made(Remade):
    """A list that grows, and an argument by name."""

    STANDING = ("grown",)

    def __init__(self, function, more=1):
        self.function, self.more, self.grown, self.lost = function, more, [], 0


def test_what_holds_machine_code_is_made_again_from_its_arguments_with_its_current_state():
    first = Made(math.sqrt, more=5)
    first.grown, first.lost = [1, 2], 3
    again = pickle.loads(pickle.dumps(first))
    assert (again.function, again.more, again.grown, again.lost) == (math.sqrt, 5, [1, 2], 0)
    for held in (lambda x: x, partial(lambda x: x, 1), [{"f": lambda x: x}]):
        with pytest.raises(ArgumentError, match=r"A Made holds .*<lambda>"):
            pickle.dumps(Made(held))
