"""What the certificate says of systems with constraints, and how their names are kept."""

from __future__ import annotations

import numpy as np
import pytest

import coadjoint as co
from coadjoint.simulation.certificate_forms import rows
from mechanisms import pendulum


def suslov(**more):
    """A body that must not turn about its third axis: workless, but with a moment in space."""
    inertia = np.array([[1.0, 0, 0.2], [0, 1.5, 0.1], [0.2, 0.1, 2.0]])
    held = {"no3": co.Nonholonomic(lambda: [[0, 0, 1]], **more)}
    return co.System(co.SO3(), lambda xi: 0.5 * xi @ inertia @ xi, constraints=held)


def run(system, xi=(1.0, 0.5, 0.0), **more):
    return co.simulate(system, system.state(xi=np.array(xi)), dt=0.05, steps=10, accuracy=False, **more)


@pytest.mark.long
def test_the_energy_of_a_workless_constraint_is_conserved_and_its_momentum_changed_by_it():
    made = run(suslov())
    short, long = (dict(rows(text)) for text in (str(made.certificate), made.certificate.long()))
    assert "largest relative change" in long["energy"] and "energy budget" not in long
    assert short["conserved"].startswith("energy to ") and "constraint rates to" in short["conserved"]
    assert long["Kelvin–Noether"].endswith("the reaction of `no3` changes it")
    assert "momentum budget to" in short["conserved"]
    assert "constraint rates" in long and "their rates" not in long


def test_a_reaction_that_works_is_named_as_what_changes_the_energy():
    made = run(suslov(right=lambda: [0.1]), xi=(1.0, 0.5, 0.1))
    assert dict(rows(made.certificate.long()))["energy"].endswith("the reaction of `no3` changes it")


@pytest.mark.long
@pytest.mark.parametrize("kind", ["constraint", "force"])
def test_a_folder_is_not_resumed_under_another_name(tmp_path, kind):
    def system(name):
        if kind == "force":
            return co.System(co.SO3(), lambda xi: 0.5 * xi @ xi, forces={name: lambda motion: co.Force(-motion.xi)})
        held = {name: co.Nonholonomic(lambda: [[0, 0, 1]], lambda: [0.0])}
        return co.System(co.SO3(), lambda xi: 0.5 * xi @ xi, constraints=held)

    run(system("one"), store=tmp_path / "run")
    with pytest.raises(co.errors.ArgumentError, match=f"its names are {kind} `one` there and {kind} `two` here"):
        co.resume(tmp_path / "run", system("two"))
    assert co.resume(tmp_path / "run", system("one")).good_steps == 10


def test_a_motor_without_its_input_is_named():
    swing = pendulum(motor=True)
    for given in (None, {"other": 1.0}):
        with pytest.raises(co.errors.ArgumentError, match="motor of the joint `hinge` needs an input: give inputs="):
            co.simulate(swing.system, swing.state(), dt=0.01, steps=1, inputs=given, accuracy=False)
