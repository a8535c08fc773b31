"""Sections of files as dataclasses: what a field declares is what is read, checked, written and described."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import pytest

from coadjoint.checks import positive
from coadjoint.errors import ArgumentError
from coadjoint.sections import key, read, written
from coadjoint.units import LENGTH, TIME


@dataclass(frozen=True)
class Leg:
    """A section."""

    name: str
    """No key: whoever reads the section gives it."""
    dt: float = key("the length of a step", TIME, check=positive)
    wait: float = key("how long", TIME, needs_unit=True, default=0.0)
    reach: float | None = key("how far", LENGTH, check=positive, others=("reach_radius",), default=None)
    mode: str = key("how", words=("", "held", "linear"), default="")
    rest: Mapping[str, Any] = key("whatever else", rest=True, factory=dict)


def leg(**given: Any) -> Leg:
    return read(Leg, "leg", given, name="first")


def test_keys_are_read_in_their_units_under_all_their_names():
    assert leg(dt_ms=250, reach_radius_ft=10.0) == Leg("first", 0.25, reach=pytest.approx(3.048))
    assert leg(dt=1, mode="held", depth_m=3, name=4).rest == {"depth_m": 3, "name": 4}


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({}, "Section [leg] needs `dt`, the length of a step, in s."),
        ({"dt": 0}, "[leg] dt must be positive, but is 0.0."),
        ({"dt": True}, "[leg] dt must be a number, but is True."),
        ({"dt": 1, "wait": 1}, "Key `wait` of section [leg] needs its unit at its end, as in `wait_s`."),
        ({"dt_m": 1}, "Key `dt_m` of section [leg] ends in a unit of length, but `dt` measures time."),
        ({"dt": 1, "reach": 1, "reach_radius": 1}, "Section [leg] gives `reach` twice: once as `reach_radius`."),
        ({"dt": 1, "dt_ms": 1}, "Section [leg] gives `dt` twice: once as `dt_ms`, once in another unit."),
        ({"dt": 1, "mode": "hold"}, '[leg] mode must be "held" or "linear", but is \'hold\': did you mean `held`?'),
    ],
)
def test_a_mistake_is_one_sentence(given, sentence):
    with pytest.raises(ArgumentError) as caught:
        leg(**given)
    assert str(caught.value) == sentence
    with pytest.raises(ArgumentError, match="must be a section of a file"):
        read(Leg, "leg", 3)


def test_a_section_is_what_its_table_is_read_as():
    made = Leg("first", 0.5, reach=2.0, rest={"depth_m": 3})
    table = written(made)
    table["wait_s"] = table.pop("wait")
    assert read(Leg, "leg", {**table.pop("rest"), **table}, name="first") == made
