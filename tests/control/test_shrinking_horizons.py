"""Controllers that keep the end of their first plan: what is left of an optimum is the optimum of what is left."""

from __future__ import annotations

import numpy as np
import pytest

import coadjoint as co
from coadjoint.control import Bounds, End, Input, Penalty, Problem
from coadjoint.errors import ArgumentError

MASS = co.System(co.Translation(1), lambda xi: 0.5 * xi @ xi, forces=lambda motion: co.Force(torque=motion.inputs.push))
START = MASS.state(g=[0.0])


def pushed(**more):
    def effort(motion):
        return 0.5 * motion.inputs.push @ motion.inputs.push

    given = {"inputs": {"push": Input((1,), -9, 9)}, "cost": effort, "end": End(g=[1.0], xi=[0.0])}
    return Problem(MASS, START, dt=0.1, steps=10, **(given | more))


@pytest.mark.long
@pytest.mark.parametrize("course", ["held", "linear"])
def test_it_arrives_along_the_first_optimum_at_its_time(course):
    inputs = {"push": Input((1,), -9, 9, course=course, previous=3.0)}
    problem = pushed(inputs=inputs, method=co.Trapezoidal() if course == "linear" else co.Midpoint())
    optimum = problem.solve()
    controller, x, spent = problem.controller(shortest=0.2), np.zeros(2), optimum.inputs["push"]
    places = [controller.names.index(name) for name in ("g[0]", "mu[0]")]
    for k in range(8):
        answer = controller(MASS.state(g=x[:1], mu=x[1:]).replace(t=0.1 * k))
        assert answer.status == "solved" and len(answer.nodes) == 11 - k
        assert answer.plan["push"] == pytest.approx(spent[k:], abs=2e-5)
        x = answer.nodes[1][places]
    assert answer.nodes[-1][places] == pytest.approx([1.0, 0.0], abs=1e-7)


def test_from_the_shortest_horizon_on_it_recedes():
    controller = pushed().controller(shortest=0.3)
    lengths = [len(controller(MASS.state(g=[0.1 * k]).replace(t=0.3 * k)).nodes) - 1 for k in range(5)]
    assert lengths == [10, 7, 4, 3, 3]


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"shortest": 0.25}, "whole number of steps"),
        ({"shortest": 1.1}, "between the period and the horizon"),
        ({"shortest": 0.1, "period": 0.2}, "between the period and the horizon"),
    ],
)
def test_a_wrong_shortest_horizon_raises(given, told):
    with pytest.raises(ArgumentError, match=told):
        pushed().controller(**given)


def test_what_a_shrinking_horizon_has_not_raises(tmp_path):
    path = {"slow": Bounds(lambda motion: motion.xi, -1, 1, soft=Penalty(linear=1.0))}
    with pytest.raises(ArgumentError, match="leave out `soft`"):
        pushed(path=path).controller(shortest=0.2)
    with pytest.raises(ArgumentError, match="leave out `shortest`"):
        pushed().controller(shortest=0.2).export_c(tmp_path / "control")
