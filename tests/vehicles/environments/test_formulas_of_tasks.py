"""Rewards, ends, starts and observations of tasks, against their formulas in NumPy at a made-up feedback."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from coadjoint_vehicles.environments import CrossCurrent, Dock, FollowPath, cross_current, dock, follow_path, task
from coadjoint_vehicles.environments.task import Task

TURN = Rotation.from_euler("ZYX", [0.6, -0.3, 0.2]).as_matrix()


@pytest.fixture(autouse=True)
def eager(monkeypatch):
    """Formulas in float64 without traces."""
    for module in (cross_current, dock, follow_path, task):
        monkeypatch.setattr(module, "jnp", np)
        monkeypatch.setattr(module, "length", np.linalg.norm)  # exact on the edge of a sphere


class Uniform:
    """A generator that draws these shares of the ranges, one after the other."""

    def __init__(self, *shares: float):
        self.shares = list(shares)

    def uniform(self, low, high, count=None):
        drawn = [low + (high - low) * self.shares.pop(0) for _ in range(count or 1)]
        return np.array(drawn) if count else drawn[0]


def at(position, velocity=(0.0, 0.0, 0.0), R=TURN, depth=None) -> Any:
    """What a vehicle there feels; its velocity is given along axes of space."""
    position, velocity = np.array(position, float), np.array(velocity, float)
    return SimpleNamespace(
        position=position, g=R, ground_velocity=R.T @ velocity, north=R[0], down=R[2],
        depth=position[2] if depth is None else depth,
    )  # fmt: skip


def met(one: Task, feedback: Any) -> dict[str, bool]:
    return {name: bool(end.when(feedback)) for name, end in one.ends().items()}


def worth(one: Task) -> dict[str, tuple[float, bool]]:
    return {name: (end.reward, end.success) for name, end in one.ends().items()}


CROSSING = CrossCurrent(
    origin=(1.0, 2.0, 5.0), place=(4.0, 6.0, 5.0), speed=0.5, current=0.4, within=0.5, far=5.0, penalty=7.0
)
ALONG, ACROSS = np.array([0.6, 0.8, 0.0]), np.array([-0.8, 0.6, 0.0])


@pytest.mark.parametrize(
    ("along", "across", "made_good", "reward"), [(2.0, 1.5, 0.2, 0.2 / 0.5 - 1.5 / 5), (-1.0, -2.0, 0.9, 1.0 - 2.0 / 5)]
)
def test_a_crossing_is_rewarded_for_way_made_good_up_to_its_speed_less_the_distance_to_the_line(
    along, across, made_good, reward
):
    feedback = at(CROSSING.origin + along * ALONG + across * ACROSS, made_good * ALONG + 3.0 * ACROSS)
    assert CROSSING.reward(feedback) == pytest.approx(reward)
    seen = {name: np.asarray(one(feedback)) for name, one in CROSSING.observations().items()}
    np.testing.assert_allclose(seen["offset"], TURN.T @ ((5 - along) * ALONG - across * ACROSS), atol=1e-14)
    np.testing.assert_allclose(seen["line"], TURN.T @ (-across * ACROSS), atol=1e-14)
    np.testing.assert_allclose(seen["along"], TURN.T @ ALONG, atol=1e-14)


def test_a_crossing_begins_along_its_way_with_a_current_across_it_and_ends_at_the_place_far_off_or_above():
    start = CROSSING.start(cast(Any, None))
    np.testing.assert_allclose(start["position"], [1, 2, 5])
    np.testing.assert_allclose(start["euler_zyx"], [np.arctan2(0.8, 0.6), 0, 0])
    for share, speed in ((1.0, 0.4), (0.25, -0.2)):
        drawn = CROSSING.parameters(cast(Any, Uniform(share)))
        np.testing.assert_allclose(drawn["water.velocity"], speed * ACROSS, atol=1e-15)
    assert worth(CROSSING) == {"arrived": (7.0, True), "far": (-7.0, False), "surface": (-7.0, False)}
    for feedback, name in (
        (at([4.0, 6.4, 5.0]), "arrived"), (at(CROSSING.origin + 5.1 * ACROSS), "far"), (at([1.0, 2.0, -0.1]), "surface")
    ):  # fmt: skip
        assert name in {one for one, holds in met(CROSSING, feedback).items() if holds} <= {name, "far"}
    assert not any(met(CROSSING, at([4.0, 6.6, 5.0])).values())
    assert not np.any(CROSSING.water().velocity)
    np.testing.assert_allclose(CROSSING.goal(), [[1, 2, 5], [4, 6, 5]])
    bounds = CROSSING.bounds()
    assert [bounds[name] for name in ("north", "east", "depth", "speed")] == [(-4, 9), (-3, 11), (0, 10), (0, 1)]
    assert bounds["heading"] == (-np.pi, np.pi)


DOCK = Dock(place=(3.0, 1.0, 4.0), heading=0.5, distance=2.0, within=0.25, slow=0.2, aligned=0.05, penalty=9.0)
STRAIGHT = Rotation.from_euler("Z", 0.5).as_matrix()


@pytest.mark.parametrize(("speed", "off"), [(0.3, 1.0), (1.5, 0.8)])
def test_a_dock_is_rewarded_less_distance_misalignment_and_haste(speed, off):
    feedback = at(DOCK.place + off * np.array([0.0, 0.6, -0.8]), speed * np.array([0.8, 0.0, 0.6]))
    ahead = TURN[0, 0] * np.cos(0.5) + TURN[1, 0] * np.sin(0.5)
    misaligned = 0.5 * (1 - ahead) + 0.5 * (1 - TURN[2, 2])
    hasty = max(0.0, speed - 0.2 - 0.5 * off) / 0.2
    assert DOCK.reward(feedback) == pytest.approx(-off / 2 - 0.5 * misaligned - hasty)
    assert (hasty > 0) == (speed > 1)


def test_a_dock_is_reached_slowly_and_aligned_struck_fast_or_missed():
    assert worth(DOCK) == {
        "docked": (9.0, True), "struck": (-9.0, False), "far": (-9.0, False), "surface": (-9.0, False)
    }  # fmt: skip
    near = DOCK.place + np.array([0.2, 0.0, 0.0])
    for feedback, names in (
        (at(near, [0.19, 0, 0], STRAIGHT), {"docked"}), (at(near, [0.3, 0, 0], STRAIGHT), set()),
        (at(near, [0.41, 0, 0], STRAIGHT), {"struck"}), (at(near, [0.1, 0, 0]), set()),
        (at(DOCK.place + np.array([0.3, 0, 0]), [0.1, 0, 0], STRAIGHT), set()),
        (at(DOCK.place + np.array([6.1, 0, 0]), [0.5, 0, 0], STRAIGHT), {"far"}),
        (at([3.0, 1.0, -0.1]), {"surface"}), (at(DOCK.place + np.array([5.9, 0, 0])), set()),
    ):  # fmt: skip
        assert {name for name, holds in met(DOCK, feedback).items() if holds} == names
    start = DOCK.start(cast(Any, Uniform(1.0, 0.0, 0.75, 0.25)))
    behind = DOCK.place - 2.0 * np.array([np.cos(0.5), np.sin(0.5), 0.0])
    np.testing.assert_allclose(start["position"], behind + np.array([1.0, -1.0, 0.5]))
    np.testing.assert_allclose(start["euler_zyx"], [0.5 - 0.25, 0, 0])
    seen = {name: np.asarray(one(at([1.0, 2.0, 3.0]))) for name, one in DOCK.observations().items()}
    np.testing.assert_allclose(seen["offset"], TURN.T @ [2.0, -1.0, 1.0], atol=1e-14)
    np.testing.assert_allclose(seen["facing"], TURN.T @ [np.cos(0.5), np.sin(0.5), 0.0], atol=1e-14)
    np.testing.assert_allclose(DOCK.goal(), [[3, 1, 4]])
    bounds = DOCK.bounds()
    assert [bounds[name] for name in ("north", "east", "depth")] == [(1, 5), (-1, 3), (2, 6)]
    assert bounds["speed"] == (0, 2)


PATH = FollowPath(
    points=((0.0, 0.0, 5.0), (20.0, 0.0, 5.0), (20.0, 10.0, 9.0)),
    speed=0.5,
    spread=2.0,
    within=1.0,
    far=5.0,
    penalty=3.0,
)
SECOND = np.array([0.0, 10.0, 4.0])


@pytest.mark.parametrize(
    ("position", "point", "leg"),
    [
        ((8.0, 3.0, 5.0), (8.0, 0.0, 5.0), 0),
        ((-2.0, 1.0, 5.0), (0.0, 0.0, 5.0), 0),
        ((21.0, 5.0, 7.0), (20.0, 5.0, 7.0), 1),
        ((20.0, 12.0, 10.0), (20.0, 10.0, 9.0), 1),
    ],
)
def test_a_path_is_followed_along_its_nearest_leg(position, point, leg):
    way = np.array([1.0, 0.0, 0.0]) if leg == 0 else SECOND / np.linalg.norm(SECOND)
    feedback = at(position, 0.3 * way)
    off = np.subtract(point, position)
    assert PATH.reward(feedback) == pytest.approx(0.3 / 0.5 - np.linalg.norm(off) / 5)
    assert PATH.reward(at(position, 2.0 * way)) == pytest.approx(1.0 - np.linalg.norm(off) / 5)
    seen = {name: np.asarray(one(feedback)) for name, one in PATH.observations().items()}
    np.testing.assert_allclose(seen["offset"], TURN.T @ off, atol=1e-13)
    np.testing.assert_allclose(seen["along"], TURN.T @ way, atol=1e-14)
    np.testing.assert_allclose(seen["ahead"], TURN.T @ (PATH.points[leg + 1] - position), atol=1e-13)


def test_a_path_begins_near_its_first_point_at_speed_and_ends_at_its_last():
    start = PATH.start(cast(Any, Uniform(1.0, 0.0, 0.75, 1.0)))
    np.testing.assert_allclose(start["position"], [2.0, -2.0, 6.0])
    np.testing.assert_allclose(start["euler_zyx"], [0.3, 0, 0])
    turned = FollowPath(points=((1.0, 1.0, 5.0), (1.0, 4.0, 5.0))).start(cast(Any, Uniform(0.5, 0.5, 0.5, 0.5)))
    np.testing.assert_allclose(turned["euler_zyx"], [np.pi / 2, 0, 0])
    assert start["speed"] == 0.5
    assert worth(PATH) == {"arrived": (3.0, True), "far": (-3.0, False), "surface": (-3.0, False)}
    for feedback, names in (
        (at([20.0, 10.9, 9.0]), {"arrived"}), (at([20.0, 11.1, 9.0]), set()), (at([8.0, 5.1, 5.0]), {"far"}),
        (at([8.0, 4.9, 5.0]), set()), (at([8.0, 0.0, 5.0], depth=-0.1), {"surface"}),
    ):  # fmt: skip
        assert {name for name, holds in met(PATH, feedback).items() if holds} == names
    bounds = PATH.bounds()
    assert [bounds[name] for name in ("north", "east", "depth", "speed")] == [(-5, 25), (-5, 15), (0, 14), (0, 1)]
    assert PATH.goal() is PATH.points


@pytest.mark.parametrize(
    ("one", "feedback"),
    [
        (CROSSING, at([4.0, 6.5, 5.0])),
        (CrossCurrent(origin=(0, 0, 5), place=(9, 0, 5), far=4.0), at([3.0, 4.0, 5.0])),
        (CROSSING, at([2.0, 3.0, 5.0], depth=0.0)),
        (DOCK, at(DOCK.place + np.array([0.25, 0, 0]), [0.1, 0, 0], STRAIGHT)),
        (DOCK, at(DOCK.place, [0.2, 0, 0], np.eye(3))),
        (DOCK, at(DOCK.place, [0.4, 0, 0], np.eye(3))),
        (DOCK, at(DOCK.place + np.array([0, 0, 6.0]))),
        (DOCK, at(DOCK.place + np.array([1.0, 0, 0]), depth=0.0)),
        (PATH, at([20.0, 11.0, 9.0])),
        (PATH, at([8.0, 5.0, 5.0])),
        (PATH, at([8.0, 0.0, 5.0], depth=0.0)),
    ],
)
def test_on_the_edge_no_episode_ends(one, feedback):
    assert not any(met(one, feedback).values())
