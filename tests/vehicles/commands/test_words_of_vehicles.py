"""What `coadjoint vehicles` and `coadjoint serve` say, of made-up vehicles and counts."""

from __future__ import annotations

from collections import Counter, namedtuple
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from coadjoint_vehicles.commands import serving, vehicles

BOAT: Any = SimpleNamespace(name="boat")


@pytest.mark.parametrize(
    ("net", "says"),
    [(1e-8, "0 N, it hovers"), (-1e-8, "0 N, it hovers"), (2.5, "2.5 N, it sinks"), (-1.25, "-1.25 N, it floats up")],
)
def test_net_weight_says_where_a_vehicle_goes(net, says):
    assert vehicles._net(net, 10.0) == says


@pytest.mark.parametrize(
    ("height", "says"),
    [
        (1e-10, "0 mm, the centres of buoyancy and mass coincide in height: no righting moment"),
        (0.0125, "12.5 mm, the centre of buoyancy above the centre of mass"),
        (-0.5, "-500 mm, the centre of buoyancy below the centre of mass"),
    ],
)
def test_the_height_of_buoyancy_is_in_millimetres(height, says):
    assert vehicles._height(height) == says


def test_values_are_written_by_their_shape():
    for value, says in (
        ("steel", "steel"), (2.0, "2"), ([1.0, 2.5], "1 2.5"), ([[1.0, 2.0], [3.0, 4.5]], "1 2; 3 4.5"),
        (1 / 3, "0.333333"),
    ):  # fmt: skip
        assert vehicles._value(cast(Any, SimpleNamespace(value=value))) == says


def test_sensors_parts_and_controllers_are_told_with_their_units():
    dvl: Any = SimpleNamespace(name="dvl", kind="dvl", rate=5, latency=0.1, names=("u", "v"), units=("m/s", "m/s"))
    told = vehicles._sensor(dvl)
    assert told == {"name": "dvl", "kind": "dvl", "rate": 5.0, "latency": 0.1, "reads": ["u (m/s)", "v (m/s)"]}
    controller = {"kind": "cruise", "inputs": {"depth": "m", "heading": "rad"}}
    assert vehicles._told_controller(controller) == "cruise; set points: depth (m), heading (rad)"
    assert vehicles._terminal(BOAT, 2.34567) == "2.346 m/s ahead, with all forward propulsion at its limit"


Driven = namedtuple("Driven", "share power v omega rate")


@pytest.mark.parametrize("ahead", [None, "ahead"])
def test_parts_that_drive_a_vehicle_are_told_with_the_worst_motion(ahead, monkeypatch):
    worst = Driven(0.25, 3.0, np.array([0.1, -1e-9, 0.2]), np.array([0.0, 0.5, -0.5]), 0.125)
    monkeypatch.setattr(vehicles, "_driven", lambda vehicle: {"anywhere": worst, "ahead": ahead})
    where = "going ahead too" if ahead else "not going ahead"
    assert vehicles._passivity(BOAT) == (
        f"its parts drive it in 25% of the motions up to 1 m/s, {where}; most at v = (0.1, 0, 0.2) m/s, "
        "ω = (0, 0.5, -0.5) rad/s, by 3 W, 0.12 of its energy a second"
    )
    assert vehicles._listed(worst) == {
        "share": 0.25, "power": 3.0, "v": [0.1, -1e-9, 0.2], "omega": [0.0, 0.5, -0.5], "rate": 0.125
    }  # fmt: skip
    assert vehicles._listed(None) is None


def served(**changes: Any) -> Any:
    late = SimpleNamespace(share=lambda part: 1e-3 * part, largest=0.25)
    given = {"answers": 7, "refused": 2, "unsent": 0, "simulated": 1.5, "seconds": 3.0, "paced": True, "lateness": late}
    return SimpleNamespace(**given | changes)


def test_the_figures_of_a_service_are_counts_times_and_lateness():
    found = serving._figures(served(), Counter(requests=9))
    assert found == {
        "answers": 7, "refused": 2, "requests": 9, "simulated_s": 1.5, "seconds": 3.0,
        "lateness_s": {"median": 0.0005, "p99": 0.00099, "largest": 0.25},
    }  # fmt: skip
    assert serving._rows(found) == [
        ("answers", "7"), ("refused", "2"), ("requests", "9"),
        ("simulated", "1.5 s, from the first answer to the last 3 s"),
        ("lateness", "median 0.5 ms, p99 0.99 ms, largest 250 ms"),
    ]  # fmt: skip
    assert serving._figures(served(unsent=3), Counter())["unsent"] == 3
    for without in ({"paced": False}, {"answers": 0}):
        assert "lateness_s" not in serving._figures(served(**without), Counter())
