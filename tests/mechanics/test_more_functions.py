"""Forces and constraints that copies of a system add, and shapes that mean the members of an ensemble."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import coadjoint as co

RUN: dict[str, Any] = {"dt": 0.05, "steps": 4, "accuracy": False, "progress": False}


def brake(motion: Any, p: Any) -> co.Force:
    return co.Force(torque=-p.drag * motion.xi)


def twist(motion: Any, p: Any) -> co.Force:
    return co.Force(torque=np.array([0.0, 0.0, 0.3]))


def lagrangian(xi: Any, n: Any, nu: Any, p: Any) -> Any:
    return 0.5 * xi @ (p.inertia * xi) + 0.5 * nu @ nu


def body(**more: Any) -> co.System:
    return co.System(
        co.SO3(), lagrangian, additional=co.Defining(), parameters={"inertia": [1.0, 2.0, 3.0], "drag": 0.2}, **more
    )


def final(system: co.System) -> Any:
    return co.simulate(system, system.state(q=[0, 0, 0], xi=[0.3, 0.1, 1]), **RUN).final.mu


def test_forces_are_added_and_those_of_a_name_replaced() -> None:
    both = final(body(forces={"brake": brake, "twist": twist}))
    np.testing.assert_array_equal(final(body().with_forces({"brake": brake}).with_forces({"twist": twist})), both)
    none = body(forces={"brake": brake, "twist": brake})
    assert none.with_forces({"twist": twist}).forces == body(forces={"brake": brake, "twist": twist}).forces
    assert body(forces=brake).with_forces(twist).forces == body(forces=twist).forces
    with pytest.raises(co.errors.LagrangianError, match="name of a force must be a word"):
        body().with_forces({"time": brake})


def test_constraints_are_added_and_bound_to_the_system() -> None:
    held = co.Holonomic(lambda n, p: n)
    made = body().with_constraints({"pin": held})
    assert made.constraints == body(constraints={"pin": held}).constraints
    with pytest.raises(co.errors.ArgumentError, match="both are called `pin`"):
        made.with_forces({"pin": brake})
    with pytest.raises(co.errors.ArgumentError, match="must be a dictionary of names and constraints"):
        body().with_constraints(held)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (
            lambda: body().state(q=[0, 0, 0], xi=np.ones((10, 3))),
            r"shape \(10, 3\); for an ensemble of 10 members write xi=co",
        ),
        (lambda: body().state(q=np.ones((1000, 3))), r"ensemble of 1,000 members write q=co\.each\(values\)\."),
        (
            lambda: body().state(q=[0, 0, 0], g=np.ones((5, 3, 3))),
            r"shape \(5, 3, 3\); for .* write g=co\.each\(values\)\.",
        ),
        (lambda: body().state(q=[0, 0, 0], xi=np.ones((3, 2))), r"shape \(3, 2\)\.$"),
        (
            lambda: final(body().replace(inertia=np.ones((5, 3)), drag=np.ones(5))),
            r"one value for each member .* co\.each\(values\)\.",
        ),
    ],
)
def test_an_array_with_an_axis_of_members_names_each(make: Callable[[], object], words: str) -> None:
    with pytest.raises(co.errors.CoadjointError, match=words):
        make()
