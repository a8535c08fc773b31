"""Derivatives of an optimum by its data are the difference quotients of optima that are solved again."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import coadjoint as co
from coadjoint.control import End, Input, Problem
from coadjoint.control.sensitivity import _require
from coadjoint.errors import ArgumentError

J = np.diag([1.0, 2.0, 3.0])
XI = np.array([0.1, -0.1, 0.2])
STEP = 1e-4
FREE = {"lower": -np.inf, "upper": np.inf}
BOUNDED = {"lower": -0.6, "upper": 0.6}


def turn(inertia=J, weight=1.0, xi=XI, first=((1, 0, 0), (0, 1, 0), (0, 0, 1)), limits=FREE):
    system = co.System(
        co.SO3(),
        lambda xi, p: 0.5 * xi @ p.J @ xi,
        parameters={"J": inertia, "weight": weight},
        forces=lambda motion, p: co.Force(torque=motion.inputs.torque),
    )
    return Problem(
        system,
        system.state(xi=xi, g=np.asarray(first, float)),
        dt=0.5,
        steps=10,
        inputs={"torque": Input((3,), **limits)},
        cost=lambda m, p: 0.5 * m.inputs.torque @ m.inputs.torque + p.weight * m.xi @ m.xi,
        end=End(g=Rotation.from_rotvec([0.5, 1.2, -0.8]).as_matrix(), xi=np.zeros(3)),
    )


def quotients(changed, optimum):
    """(J(θ + ε) − J(θ − ε))/2ε of the cost and of the torques, of problems solved again."""
    ahead, behind = (changed(sign * STEP).solve(guess=optimum.run, tolerance=1e-11) for sign in (1, -1))
    of_torques = (ahead.inputs["torque"] - behind.inputs["torque"]) / (2 * STEP)
    return (ahead.cost - behind.cost) / (2 * STEP), of_torques


def test_of_two_steps_from_rest_to_rest_all_is_in_proportion_to_mass_and_way():
    """u ∝ m (1 − g₀), J ∝ u²; the states change with g₀ alone, from 1 at the start to 0 at the end."""
    cart = co.System(
        co.Translation(1),
        lambda xi, p: 0.5 * p.mass * xi @ xi,
        parameters={"mass": 2.0},
        forces=lambda motion, p: co.Force(torque=motion.inputs.push),
    )
    optimum = Problem(
        cart, cart.state(g=[0.0]), dt=0.5, steps=2, inputs={"push": Input((1,))}, accuracy=False,
        cost=lambda m, p: 0.5 * m.inputs.push @ m.inputs.push, end=End(g=[1.0], xi=[0.0]),
    ).solve(tolerance=1e-11)  # fmt: skip
    by_mass, by_start = optimum.sensitivity("mass"), optimum.sensitivity(start="g")
    assert by_mass.cost["mass"] == pytest.approx(optimum.cost, rel=1e-8)  # 2 J/m
    np.testing.assert_allclose(by_mass.inputs["push"]["mass"], optimum.inputs["push"] / 2.0, rtol=1e-7)
    assert by_start.cost["start g"] == pytest.approx([-2.0 * optimum.cost], rel=1e-8)
    np.testing.assert_allclose(by_start.inputs["push"]["start g"][..., 0], -optimum.inputs["push"], rtol=1e-7)
    (place,) = (k for k, name in enumerate(by_start.names) if name.startswith("g"))
    np.testing.assert_allclose(by_start.states["start g"][:, place, 0], [1.0, 0.5, 0.0], atol=1e-8)
    np.testing.assert_allclose(by_mass.states["mass"][:, place], 0.0, atol=1e-8)
    assert by_mass.duration["mass"] == 0.0 and by_mass.duration["mass"].shape == ()
    assert f"{'mass':<18}dJ/dθ " in str(by_mass) and by_mass.parameters == {}


@pytest.mark.parametrize(
    ("names", "start", "told"),
    [
        (("mass",), ("g",), "ask for them one after the other"),
        ((), (), "Name the data"),
        (("chosen",), (), "`chosen` is optimised with the motion"),
        ((), ("place",), "place"),
        ((), "g", "start"),
    ],
)
def test_what_an_optimum_is_not_a_function_of_is_told(names, start, told):
    parameters = co.Parameters(mass=1.0, chosen=2.0)
    problem = SimpleNamespace(
        system=SimpleNamespace(parameters=parameters, name="cart"), parameters={"chosen": None}, free_start={},
        start=SimpleNamespace(from_velocities=True),
    )  # fmt: skip
    with pytest.raises(ArgumentError, match=told):
        _require(problem, names, start)
    problem.free_start = {"g": 1.0}
    with pytest.raises(ArgumentError, match="The start is optimised"):
        _require(problem, (), ("g",))


@pytest.mark.long
def test_forces_are_in_proportion_to_a_mass_and_the_cost_to_its_square():
    """A cart from rest to rest in a given time: u ∝ m, J = ½∫u² ∝ m²."""
    cart = co.System(
        co.Translation(1),
        lambda xi, p: 0.5 * p.mass * xi @ xi,
        parameters={"mass": 2.0},
        forces=lambda motion, p: co.Force(torque=motion.inputs.push),
    )
    optimum = Problem(
        cart, cart.state(g=[0.0]), dt=0.25, steps=4, inputs={"push": Input((1,))},
        cost=lambda m, p: 0.5 * m.inputs.push @ m.inputs.push, end=End(g=[1.0], xi=[0.0]),
    ).solve(tolerance=1e-11)  # fmt: skip
    assert "dJ/dθ" in str(optimum.sensitivity(start=("g", "mu")))
    along = optimum.sensitivity(start="g")
    assert along.cost["start g"] == pytest.approx([-2 * optimum.cost], rel=1e-7)  # J ∝ the square of the distance
    np.testing.assert_allclose(along.inputs["push"]["start g"][..., 0], -optimum.inputs["push"], rtol=1e-6)
    with pytest.raises(co.errors.ArgumentError, match="the start's q, which has no numbers"):
        optimum.sensitivity(start="q")
    found = optimum.sensitivity("mass")
    assert found.cost["mass"] == pytest.approx(2 * optimum.cost / 2.0, rel=1e-7) and optimum.cost > 1
    np.testing.assert_allclose(found.inputs["push"]["mass"], optimum.inputs["push"] / 2.0, rtol=1e-6)


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("limits", [FREE, BOUNDED], ids=["free", "bounded"])
def test_by_parameters_and_weights_of_the_cost(limits):
    optimum = turn(limits=limits).solve(tolerance=1e-11)
    found = optimum.sensitivity("J", "weight")
    changes = {
        "weight": ((), lambda e: turn(weight=1.0 + e, limits=limits)),
        "J": ((0, 0), lambda e: turn(inertia=J + e * np.diag([1.0, 0, 0]), limits=limits)),
    }
    for name, (place, changed) in changes.items():
        cost, torques = quotients(changed, optimum)
        assert found.cost[name][place] == pytest.approx(cost, abs=2e-7)
        np.testing.assert_allclose(found.inputs["torque"][name][(..., *place)], torques, atol=5e-6)
    held = np.abs(np.abs(optimum.inputs["torque"]) - 0.6) < 1e-6
    assert np.any(held) == (limits is BOUNDED)
    assert np.max(np.abs(found.inputs["torque"]["weight"][held]), initial=0.0) < 1e-12


@pytest.mark.long
def test_by_the_start_at_its_momenta_and_turned_in_its_own_frame():
    optimum = turn().solve(tolerance=1e-11)
    found = optimum.sensitivity(start=("mu", "g"))
    turned = lambda s: turn(first=Rotation.from_rotvec([0.0, 0.0, s]).as_matrix())  # noqa: E731
    changes = {"start mu": (0, lambda s: turn(xi=XI + s * np.eye(3)[0])), "start g": (2, turned)}
    for name, (axis, changed) in changes.items():
        cost, torques = quotients(changed, optimum)
        assert found.cost[name][axis] == pytest.approx(cost, abs=2e-7)
        np.testing.assert_allclose(found.inputs["torque"][name][..., axis], torques, atol=5e-6)
    at = [optimum.names.index(f"mu[{i}]") for i in range(3)]
    np.testing.assert_allclose(found.states["start mu"][0, at], np.eye(3), atol=1e-12)


@pytest.mark.long
def test_by_a_parameter_beside_a_free_duration_and_a_chosen_parameter():
    def crossing(weight):
        cart = co.System(
            co.Translation(1),
            lambda xi, p: 0.5 * p.mass * xi @ xi,
            parameters={"mass": 1.0, "weight": weight},
            forces=lambda motion, p: co.Force(torque=motion.inputs.push),
        )
        return Problem(
            cart,
            cart.state(g=[0.0], xi=[0.3]),
            dt=0.1,
            steps=20,
            inputs={"push": Input((1,))},
            cost=lambda m, p: p.weight + 0.5 * m.inputs.push @ m.inputs.push + 0.5 * (p.mass - 2.0) ** 2,
            end=End(g=[2.0], xi=[0.0]),
            free_duration=(0.5, 20.0),
            parameters={"mass": (0.5, 5.0)},
        )

    optimum = crossing(0.7).solve(tolerance=1e-11)
    found = optimum.sensitivity("weight")
    ahead, behind = (crossing(0.7 + s * STEP).solve(guess=optimum.run, tolerance=1e-11) for s in (1, -1))
    assert found.duration["weight"] == pytest.approx((ahead.duration - behind.duration) / (2 * STEP), rel=1e-5)
    slope = (ahead.parameters["mass"] - behind.parameters["mass"]) / (2 * STEP)
    assert found.parameters["mass"]["weight"] == pytest.approx(slope, rel=1e-5)
    assert found.cost["weight"] == pytest.approx(optimum.duration, rel=1e-8)  # dJ/dw = ∂J/∂w = T


@pytest.mark.long
def test_what_has_no_derivative_is_told():
    optimum = turn().solve()
    for names, start, words in [
        (("jay",), (), "no parameter `jay`"),
        ((), ("xi",), "has no part `xi`"),
        ((), "xi", "has no part `xi`"),
        ((), 3, "must be names"),
        ((), ("q",), "no numbers"),
        ((), ("pi",), "no numbers"),
        ((), (), "Name the data"),
        (("J",), ("mu",), "one after the other"),
    ]:
        with pytest.raises(co.errors.ArgumentError, match=words):
            optimum.sensitivity(*names, start=start)
    largest = float(np.max(np.abs(optimum.inputs["torque"])))
    reached = turn(limits={"lower": -largest, "upper": largest}).solve(tolerance=1e-11)
    with pytest.raises(co.errors.OptimumError, match="only just reached"):
        reached.sensitivity("weight")


def heavy(first=((1.0, 0, 0), (0, 1, 0), (0, 0, 1)), q=(0.2, -0.1, 0.3), dmu=0.0, **method):
    """A body that is carried along, with weight along a₀: forces along it, and a place to reach."""
    system = co.System(
        co.SO3(),
        lambda xi, n, nu, a, p: 0.5 * xi @ p.J @ xi + 0.5 * p.mass * nu @ nu + 0.3 * xi @ nu - 0.4 * n @ a - 0.5 * a[0],
        additional=co.Defining(),
        advected=co.Defining(),
        parameters={"J": J, "mass": 1.5},
        forces=lambda motion, p: co.Force(torque=motion.inputs.torque),
    )
    start = system.state(g=first, q=q, a0=[0.0, 0.6, 0.8], mu=np.array([0.2, 0.1, -0.3]) + dmu, pi=[0.1, 0.2, 0.0])
    if method.get("method"):
        start = system.state(g=first, q=q, a0=[0.0, 0.6, 0.8], xi=XI, qdot=[0.1, 0.2, 0.0])
    return Problem(
        system,
        start,
        dt=0.1,
        steps=8,
        inputs={"torque": Input((3,))},
        cost=lambda m, p: 0.5 * m.inputs.torque @ m.inputs.torque + m.q @ m.q + m.xi @ m.xi,
        **method,
    )


@pytest.mark.long
def test_by_a_start_whose_direction_in_the_world_and_place_stay_while_it_is_turned():
    optimum = heavy().solve(tolerance=1e-11)
    found = optimum.sensitivity(start=("g", "q", "mu"))
    e = np.eye(3)[1]
    changes = {
        "start g": lambda s: heavy(first=Rotation.from_rotvec(s * e).as_matrix()),
        "start q": lambda s: heavy(q=np.array([0.2, -0.1, 0.3]) + s * e),
        "start mu": lambda s: heavy(dmu=s * e),
    }
    for name, changed in changes.items():
        cost, torques = quotients(changed, optimum)
        assert found.cost[name][1] == pytest.approx(cost, abs=2e-7), name
        np.testing.assert_allclose(found.inputs["torque"][name][..., 1], torques, atol=5e-6)


@pytest.mark.long
def test_a_start_whose_momenta_depend_on_the_step_has_no_derivative_by_parameters():
    optimum = heavy(method=co.LeftRectangle(start="velocity")).solve()
    with pytest.raises(co.errors.ArgumentError, match='start="momentum"'):
        optimum.sensitivity("mass")
