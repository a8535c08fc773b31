"""How the numbers of [controller] may be written, in missions and in vehicle files."""

from __future__ import annotations

import pytest

from coadjoint.errors import ArgumentError
from coadjoint_vehicles.files.file import vehicle_from_text
from coadjoint_vehicles.files.registry import load_vehicle, vehicle_text
from coadjoint_vehicles.missions.craft import _controller

REMUS = load_vehicle("remus_100")


@pytest.mark.parametrize(
    ("given", "value"),
    [
        ({"period": 0.2}, 0.2),
        ({"period_ms": 200}, 0.2),
        ({"period": {"value": 200, "unit": "ms"}}, 0.2),
        ({"period": {"value": 0.2}}, 0.2),
    ],
)
def test_a_period_has_its_unit_at_the_key_or_in_a_table(given, value):
    assert _controller(given, REMUS).period == pytest.approx(value)


def test_gains_are_three_numbers_alone_or_in_a_table():
    for gains in ([0.1, 0, 0.2], {"value": [0.1, 0, 0.2], "unit": "SI"}):
        assert _controller({"depth_gains": gains}, REMUS).depth_gains.tolist() == [0.1, 0.0, 0.2]


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"depth_gains": 0.1}, r"depth_gains must be three numbers in SI units, as in depth_gains = \[1.0, 0.0, 0.0\]"),
        ({"period": "0.1 s"}, r'period must be a number .*period_s = 1.0 or period = \{ value = 1.0, unit = "s" \}'),
        ({"fin_limit": {"value": 20, "units": "deg"}}, "fin_limit must be a number in SI units, rad, or with a unit"),
        ({"fin_limit": {"value": 20, "unit": "m"}}, "fin_limit"),
    ],
)
def test_other_values_are_refused_with_the_formats_that_hold(given, words):
    with pytest.raises(ArgumentError, match=words):
        _controller(given, REMUS)


def test_a_text_for_a_number_in_a_vehicle_file_is_refused_with_its_format():
    text = vehicle_text("remus_100").replace('kind = "cruise"', 'kind = "cruise"\nperiod = "0.1 s"')
    with pytest.raises(ArgumentError, match=r'period = \{ value = …, unit = "s", source = "…" \}, but is \'0.1 s\''):
        vehicle_from_text(text, "mine.toml")
