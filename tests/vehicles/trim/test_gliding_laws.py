"""Moving masses, ballast and lifting bodies as laws of their own, and steady gliding in closed form."""

from __future__ import annotations

from typing import Any

import jax
import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.spaces.named import Named, named
from coadjoint_vehicles.parts import Ballast, LiftingBody, MovingMass
from coadjoint_vehicles.parts.part import Flow, Part
from gliding import flattest_glides, steady_glide

WINGS = LiftingBody("wings", drag=(2.15, 25.0), lift=(0.5, 132.5), pitch=(0.1, -100.0, -5.0), side=-60.0, yaw=(9, -3))


def own(part: Part) -> Named:
    return named(part.parameters())


def through(v: Any, omega: Any = (0.0, 0.0, 0.0)) -> Any:
    down = np.array([0.0, 0.0, 1.0])
    return Flow(np.array(v), np.array(omega), np.float64(1025.0), down, np.float64(0), np.float64(0))  # pyright: ignore


def travel(part: Part, start: Any, command: float, h: float, steps: int, which: str = "end") -> list[Any]:
    """The internal states of an actuator at the nodes, or what they are on the mean of the steps before."""

    def chosen(tree: Any, which: str) -> Any:
        return {k: getattr(x, which) for k, x in tree.items()} if isinstance(tree, dict) else getattr(tree, which)

    states, found = [named(start)], [named(start)]
    for _ in range(steps):
        course = evaluate(lambda x, p: part.advance(x, command, h, p), states[-1], own(part))
        states.append(named(chosen(course, "end")))
        found.append(named(chosen(course, which)))
    return found


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("h", [0.05, 0.3])
def test_a_moving_mass_runs_at_its_rate_and_stops_at_its_command_and_at_its_ends(h):
    part = MovingMass("battery", mass=9.0, position=(0, 0, 0.05), axis=(1, 0, 0), low=-0.2, high=0.3, rate=0.05)
    for command, end in ((0.1, 0.1), (2.0, 0.3), (-2.0, -0.2)):
        states, means = (travel(part, part.at_rest(0.0), command, h, int(10 / h), which) for which in ("end", "mean"))
        reached, speeds = (np.array([s.position for s in states]), np.array([s.speed for s in means]))
        assert np.max(np.abs(speeds)) == pytest.approx(0.05, rel=1e-12)
        assert reached[-1] == end and speeds[-1] == 0.0 == states[-1].speed
        # The mean speed of a step takes the mass from node to node, so that hull and mass keep their common centre.
        np.testing.assert_allclose(reached, np.cumsum(h * speeds), atol=1e-14)
        np.testing.assert_allclose(means[1].position, 0.5 * reached[1], atol=1e-14)


def test_a_lag_of_moving_mass_and_ballast_is_exact_whatever_the_step():
    mass = MovingMass("battery", mass=9.0, position=(0, 0, 0), axis=(1, 0, 0), low=-1, high=1, rate=9, lag=0.8)
    tank = Ballast("ballast", position=(0, 0, 0), low=-1e-3, high=1e-3, rate=9.0, lag=0.8)
    for h in (0.01, 0.5, 4.0):
        decay = 1 - np.exp(-h * np.arange(5) / 0.8)
        volumes = travel(tank, 0.0, 4e-4, h, 4)
        np.testing.assert_allclose(np.array(volumes, dtype=float), 4e-4 * decay, rtol=1e-13)
        states = travel(mass, mass.at_rest(0.0), 0.4, h, 4)
        np.testing.assert_allclose([s.position for s in states], 0.4 * decay, rtol=1e-12)
        np.testing.assert_allclose([s.speed for s in states[1:]], 0.4 * (1 - decay[1:]) / 0.8, rtol=1e-12, atol=1e-15)


def test_ballast_is_pumped_at_its_rate_within_its_range():
    tank = Ballast("ballast", position=(0, 0, 0), low=-2e-4, high=3e-4, rate=1e-5)
    volumes = np.array(travel(tank, 0.0, 1.0, 2.0, 20), dtype=float)
    np.testing.assert_allclose(volumes, np.minimum(2e-5 * np.arange(21), 3e-4), rtol=1e-12)


def test_drag_is_against_the_flow_lift_across_it_and_side_force_across_both():
    random = np.random.default_rng(11)
    for _ in range(20):
        speed, alpha, beta = random.uniform(0.2, 2), *random.uniform(-0.4, 0.4, 2)
        v = speed * np.array([np.cos(alpha) * np.cos(beta), np.sin(beta), np.sin(alpha) * np.cos(beta)])
        force = evaluate(WINGS.force, through(v), None, own(WINGS))
        D, L = (2.15 + 25 * alpha**2) * speed**2, (0.5 + 132.5 * alpha) * speed**2
        S = -60 * beta * speed**2
        assert force.force @ v == pytest.approx(-D * speed, rel=1e-12)
        up = np.array([np.sin(alpha), 0.0, -np.cos(alpha)])
        assert force.force @ up == pytest.approx(L, rel=1e-10)
        assert np.linalg.norm(force.force) ** 2 == pytest.approx(D**2 + L**2 + S**2, rel=1e-12)
    turning = evaluate(WINGS.force, through([1.0, 0, 0], [0, 0.2, 0.3]), None, own(WINGS))
    np.testing.assert_allclose(turning.torque, [0, 0.1 - 5 * 0.2, -3 * 0.3], atol=1e-14)


def test_at_rest_a_lifting_body_feels_nothing_and_its_force_has_no_slope():
    def force(v: Any) -> Any:
        found = WINGS.force(through([0, 0, 0])._replace(velocity=v), None, own(WINGS))
        return found.force + found.torque

    assert np.all(evaluate(force, np.zeros(3)) == 0.0)
    assert np.all(evaluate(jax.jacfwd(force), np.zeros(3)) == 0.0)


def test_a_flow_from_abeam_is_the_limit_of_flows_from_nearly_abeam():
    def force(v: Any) -> Any:
        found = evaluate(WINGS.force, through(v), None, own(WINGS))
        return np.concatenate([found.force, found.torque])

    for side in (0.4, -0.4):
        np.testing.assert_allclose(force([0.0, side, 0.0]), force([1e-9, side, 0.0]), rtol=1e-7, atol=1e-8)


@pytest.mark.parametrize("path", [-70.0, -40.0, -17.0, 12.0, 30.0, 75.0])
def test_in_a_steady_glide_lift_drag_and_net_weight_are_in_balance(path):
    glide = steady_glide(WINGS, np.radians(path), 0.4)
    alpha, theta = glide.angle_of_attack, glide.pitch
    v = 0.4 * np.array([np.cos(alpha), 0, np.sin(alpha)])
    pushed = evaluate(WINGS.force, through(v), None, own(WINGS)).force
    down = np.array([-np.sin(theta), 0, np.cos(theta)])
    np.testing.assert_allclose(pushed + glide.weight * down, 0, atol=1e-13)
    assert np.sign(glide.weight) == -np.sign(path) and abs(alpha) < 0.5


def test_the_flattest_glide_has_the_best_ratio_of_lift_and_drag_and_flatter_ones_are_refused():
    alpha = np.linspace(-1, 1, 200001)
    ratio = (0.5 + 132.5 * alpha) / (2.15 + 25 * alpha**2)
    down, up = flattest_glides(WINGS)
    assert np.tan(down) == pytest.approx(-1 / ratio.max(), rel=1e-8)
    assert np.tan(up) == pytest.approx(-1 / ratio.min(), rel=1e-8)
    steady_glide(WINGS, 1.001 * down, 0.4)
    for path, speed, word in ((np.nan, 0.4, "`path` must be finite"), (2 * down, -0.4, "`speed` must be positive")):
        with pytest.raises(co.errors.ArgumentError, match=word):
            steady_glide(WINGS, path, speed)
    for path in (0.999 * down, 0.0, 0.999 * up, np.pi / 2):
        with pytest.raises(co.errors.ArgumentError, match="`wings` has no steady glide"):
            steady_glide(WINGS, path, 0.4)


WRONG = {
    "`low` of the moving mass `part` must be below": (MovingMass, {"low": 0.5}),
    "`axis` of the moving mass `part` must be a unit vector": (MovingMass, {"axis": (1, 1, 0)}),
    "`rate` of the moving mass `part` must be positive": (MovingMass, {"rate": 0.0}),
    "`mass` of the moving mass `part` must be positive": (MovingMass, {"mass": -1.0}),
    "`lag` of the moving mass `part` must be at least 0": (MovingMass, {"lag": -1.0}),
    "`high` of the ballast `part` must be one number": (Ballast, {"high": (1.0, 2.0)}),
    "`low` of the ballast `part` must be below": (Ballast, {"low": 1.0}),
    "`pitch` of the lifting body `part` must have shape .3,.": (LiftingBody, {"pitch": (0.0, 1.0)}),
}


@pytest.mark.parametrize("sentence", WRONG)
def test_what_no_part_can_have_is_told_in_one_sentence_with_its_name(sentence):
    kind, change = WRONG[sentence]
    given: dict[str, Any] = {
        MovingMass: {"mass": 9.0, "position": (0, 0, 0), "axis": (1, 0, 0), "low": -0.2, "high": 0.3, "rate": 0.05},
        Ballast: {"position": (0, 0, 0), "low": -1e-4, "high": 1e-4, "rate": 1e-5},
        LiftingBody: {"drag": (2.0, 25.0), "lift": (0.0, 130.0), "pitch": (0.0, -100.0, 0.0)},
    }[kind]
    with pytest.raises(co.errors.ArgumentError, match=sentence):
        kind("part", **{**given, **change})
