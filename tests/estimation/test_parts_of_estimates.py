"""Parts of filters by themselves: NEES of singular covariances, saved filters, and sensors away from the origin."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from coadjoint.errors import ArgumentError
from coadjoint.estimation import filtered, saved_filter
from coadjoint.estimation.filtered import Filtered
from coadjoint.estimation.process import arguments_of
from coadjoint.estimation.saved_filter import SavedFilter
from coadjoint.groups import SE3, SO3
from coadjoint.identification import channels
from coadjoint.identification.process_noise import Knots
from coadjoint.identification.shooting import Shooting
from coadjoint.spaces.named import Named


def test_errors_count_along_the_directions_in_which_a_covariance_is_not_singular():
    random = np.random.default_rng(1)
    half = random.normal(size=(4, 3, 2))
    P = half @ half.swapaxes(1, 2)
    e = (half @ random.normal(size=(4, 2, 1)))[..., 0]
    found, rank = filtered._within(e, P)
    np.testing.assert_allclose(found, np.einsum("ki,kij,kj->k", e, np.linalg.pinv(P, rcond=1e-8, hermitian=True), e))
    assert rank == 2
    pairs, _ = filtered._within(e.reshape(2, 2, 3), P.reshape(2, 2, 3, 3))
    np.testing.assert_array_equal(pairs, found.reshape(2, 2))
    P[2] += np.eye(3)
    with pytest.raises(ArgumentError):
        filtered._within(e, P)


def test_coordinates_are_known_exactly_where_they_are_small_against_their_kind():
    """A rotation of 1e-12 next to one of 1, and one that is 0 for all time."""
    deviations = np.array([[1e-30, 0.5, 0.0], [1.0, 0.25, 0.0]])
    process = SimpleNamespace(projector="a projector", places={"turn": slice(0, 2), "way": slice(2, 3)})
    made: Any = SimpleNamespace(deviations=deviations, _process=process)
    assert cast(Any, Filtered._doubtful).fget(made).tolist() == [[False, True, False], [True, True, False]]
    process.projector = None
    assert cast(Any, Filtered._doubtful).fget(made).tolist() == [[True, True, False], [True, True, False]]
    made.covariances = None
    with pytest.raises(ArgumentError, match="run the filter with covariances=True"):
        Filtered.nees(made, None)


class Held(SimpleNamespace):
    pass


def test_a_saved_filter_shows_its_estimate_and_takes_measurements_in_their_order(monkeypatch):
    face = SimpleNamespace(
        errors=("x", "v", "bias"), row=SimpleNamespace(views=lambda row: {"all": row}), awaited=("gps",)
    )
    made: Any = object.__new__(SavedFilter)
    P = np.diag([4.0, 9.0, -1e-20])
    made.face, made._time, made._numbers, made._sizes = face, 1, {"gps": 5, "dvl": 7}, {"gps": 1, "dvl": 1}
    made._begun = made._held = Held(P=P[None], rows=np.array([[1.0, 2.5, 3.0]]))
    made._awaited = set()
    assert made.deviations == {"x": 2.0, "v": 3.0, "bias": 0.0} and made.t == 2.5
    made.state["all"][0] = 9.0
    assert made._held.rows[0, 0] == 1.0 and made.covariance is not P
    taken: list[Any] = []

    def once(held, kind, number, value):
        taken.append((held, kind, number, value.tolist()))
        return f"after {number}", (float(number), len(taken) - 1)

    made._once = once
    found = SavedFilter.update(made, {"dvl": [0.5], "gps": [1.5]})
    assert taken == [(made._begun, saved_filter.CORRECT, 7, [0.5]), ("after 7", saved_filter.CORRECT, 5, [1.5])]
    assert tuple(found["dvl"])[1:] == (False, False) and tuple(found["gps"])[1:] == (True, False)
    assert found["gps"].nis == 5.0 and made._held == "after 5"
    made.reset()
    assert made._held is made._begun and made._awaited == {"gps"}


@pytest.mark.parametrize(("group", "g"), [(SO3(), "R"), (SE3(), ("R", "q"))])
def test_a_sensor_away_from_the_origin_is_moved_and_turned_by_its_place(group, g, monkeypatch):
    monkeypatch.setattr(channels, "jnp", np)
    R, r = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), (1.0, 2.0, 3.0)
    places = R if g == "R" else (R, np.zeros(3))
    known = {**dict(zip(channels.RATES, (0.1, 0.2, 0.3), strict=True))}
    known |= dict.fromkeys((*channels.POSITION, *channels.VELOCITY), 10.0)
    levers = tuple((name, r) for name in (*channels.POSITION, *channels.VELOCITY))
    made: Any = SimpleNamespace(levers=levers)
    found = channels.Channels._elsewhere(
        made, cast(Any, SimpleNamespace(group=group)), cast(Any, SimpleNamespace(g=places)), known
    )
    away, swing = R @ r, np.cross([0.1, 0.2, 0.3], r)
    for k in range(3):
        assert found[channels.POSITION[k]] == pytest.approx(10.0 + away[k])
        assert found[channels.VELOCITY[k]] == pytest.approx(10.0 + swing[k])


def test_segments_after_gaps_begin_with_logged_actuators_and_knots_move_their_parameters():
    made: Any = SimpleNamespace(
        samples=SimpleNamespace(after_gap=np.array([False, True])), active=[3, 7, 5],
        begun={"rudder": np.array([1.0, 2.0]), "screw": np.ones(2)},
    )  # fmt: skip
    internal = Named(rudder=np.array([[0.5], [0.5]]), screw=Named(speed=np.zeros(2)), brake=np.zeros(2))
    found = Shooting._after_gaps(made, internal)
    assert found.rudder.tolist() == [[0.5], [2.0]] and found.screw is internal.screw and found.brake is internal.brake
    made.samples.after_gap = np.zeros(2, bool)
    assert Shooting._after_gaps(made, internal) is internal and Shooting._after_gaps(made, 3.0) == 3.0
    knots = Knots(("a", "b"), np.array([5, 7]), np.array([1, 0]), 0.5, 2)
    expected = np.zeros((4, 3))
    expected[1, 2] = expected[0, 1] = 1.0
    np.testing.assert_array_equal(Shooting._directions(made, knots), expected)


@pytest.mark.parametrize(
    ("function", "number"),
    [
        (lambda: 0, 0),
        (lambda x, t: 0, 2),
        (lambda x, t=0, *, p: 0, 1),
        (lambda x, *more: 0, None),
        (lambda *more, **known: 0, None),
        (dict, 1),
    ],
)
def test_a_function_takes_its_arguments_without_defaults_or_any_number(function, number):
    assert arguments_of(function) == number
