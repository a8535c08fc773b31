"""Passive forces that put energy in are named: by records, between them, in ensembles and in runs on disk."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co

RUN: dict[str, Any] = {"dt": 0.01, "accuracy": False, "progress": False}


def passive(force):
    force.passive = lambda p: True
    return force


def body(*names: str) -> co.System:
    """A body that a brake turns faster from t = 0.1 s to 0.2 s, by the share `wrong`, and slower otherwise."""

    def brake(motion, p):
        pushes = (motion.t > 0.1) & (motion.t < 0.2)
        return co.Force(torque=jnp.where(pushes, p.wrong, -1.0) * motion.xi / len(names))

    return co.System(
        co.SO3(),
        lambda xi, p: 0.5 * xi @ (p.inertia * xi),
        parameters=co.Parameters(inertia=[1.0, 2.0, 3.0], wrong=4.0),
        forces={name: passive(lambda motion, p: brake(motion, p)) for name in names},
    )


def told(run) -> list[str]:
    return [sentence for sentence in run.warnings if "which should only brake, put in" in sentence]


@pytest.mark.cases(1)
@pytest.mark.parametrize("names", [("brake",), ("brake", "fins")])
def test_a_burst_between_two_saved_nodes_is_named_with_at_least_half_of_its_energy(names):
    system = body(*names)
    start = system.state(xi=[0.3, 0.2, 1.0])
    fine = co.simulate(system, start, steps=100, **RUN)
    coarse = co.simulate(system, start, steps=100, save_every=100, **RUN)
    work = np.sum([fine.monitors[f"work_{name}"] for name in names], axis=0)
    assert work[-1] < work[0] and len(coarse.records.t) == 2
    (by_nodes,), (between,) = told(fine), told(coarse)
    assert "from t = 0.1 s on" in by_nodes
    assert "between two saved nodes" in between and ", ".join(f"`{name}`" for name in names) in between
    energy = float(between.split("put in ")[1].split(",")[0])
    assert 0.5 * np.sum(np.maximum(np.diff(work), 0)) < energy <= 1.001 * np.sum(np.maximum(np.diff(work), 0))


@pytest.mark.cases(1)
@pytest.mark.parametrize("save_every", [1, 100])
def test_brakes_that_only_brake_are_not_named(save_every):
    system = body("brake", "fins").replace(wrong=-1.0)
    run = co.simulate(system, system.state(xi=[0.3, 0.2, 1.0]), steps=100, save_every=save_every, **RUN)
    assert told(run) == [] and run.ends["work_brake"][1] < -0.1


@pytest.mark.long
@pytest.mark.parametrize("save_every", [pytest.param(1, marks=pytest.mark.long), 100])
def test_members_that_their_brakes_drive_are_named_on_disk_as_in_memory(save_every, tmp_path):
    system = body("brake").replace(wrong=co.each([-1.0, 4.0, -1.0, 6.0]))
    start = system.state(xi=[0.3, 0.2, 1.0])
    settings = {**RUN, "steps": 100, "save_every": save_every}
    memory = co.simulate(system, start, **settings)
    stored = co.simulate(system, start, store=tmp_path / "fleet", **settings)
    assert told(memory) == told(stored)
    (sentence,) = told(stored)
    assert sentence.startswith("In member 3 `brake`") and sentence.endswith("so in 1 more of 4 members: 1.")
    assert sentence in str(stored) and sentence in str(co.load(tmp_path / "fleet"))
    assert told(co.resume(tmp_path / "fleet", system)) == [sentence]


@pytest.mark.long
def test_a_run_on_disk_is_told_as_one_in_memory_also_where_a_step_fails(tmp_path):
    system = body("brake")
    start = system.state(xi=[0.3, 0.2, 1.0])
    stored = co.simulate(system, start, steps=50, store=tmp_path / "run", **RUN)
    assert told(stored) == told(co.simulate(system, start, steps=50, **RUN)) != []
    assert told(stored)[0] in str(co.load(tmp_path / "run"))

    def lost(motion, p):
        return co.Force(torque=motion.xi * jnp.sqrt(0.3 - motion.t))

    failing = co.System(co.SO3(), lambda xi, p: 0.5 * xi @ (p.inertia * xi), parameters=system.parameters,
                        forces={"brake": passive(lost)})  # fmt: skip
    for more in ({}, {"store": tmp_path / "failed"}):
        with pytest.raises(co.errors.StepError, match="which should only brake, put in"):
            co.simulate(failing, failing.state(xi=[0.3, 0.2, 1.0]), steps=50, **RUN, **more)
