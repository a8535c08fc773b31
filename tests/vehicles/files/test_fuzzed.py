"""A vehicle file that is changed at random is a vehicle, or one typed sentence; nothing else ever happens."""

from __future__ import annotations

import copy
import tomllib
import warnings

import numpy as np
import pytest
from hypothesis import HealthCheck, given, seed, settings
from hypothesis import strategies as st

from coadjoint.errors import CoadjointError
from coadjoint.runs.toml_text import _value
from coadjoint_vehicles import Craft
from coadjoint_vehicles.files.file import vehicle_from_text
from coadjoint_vehicles.files.registry import vehicle_names, vehicle_text

TABLES = {name: tomllib.loads(vehicle_text(name)) for name in vehicle_names()}
STRANGE = [
    None, True, False, "", "m", "kg m^2", "1/", "/", "^", "deg", "SI", "prime", "FLU", "fin", "T200", "\x00", "°", 0,
    -1, 1e-300, 1e300, -1e9, 10**30, float("nan"), float("inf"), -0.0, [], [[]], [1, 2], [1, 2, 3], [[1, 2, 3]] * 3,
    [0.0] * 6, [-1.0] * 6, [[0.0] * 6] * 6, [[1, 2], [3]], ["a"], [[[1.0]]], {}, {"value": 1}, {"value": [1, 2, 3]},
    {"value": {}, "unit": "SI"}, {"value": 1, "unit": "m", "source": "nobody"}, [{}], [{"kind": "fin"}], [None],
]  # fmt: skip


def places(table, path=()):
    """Every place of a table, inner ones too."""
    items = table.items() if isinstance(table, dict) else enumerate(table)
    for key, inner in items:
        yield (*path, key)
        if isinstance(inner, (dict, list)):
            yield from places(inner, (*path, key))


def written(table) -> str:
    """TOML with all sections inline; None, which TOML does not have, is left out."""
    return "\n".join(f"{key} = {_value(_without_none(value))}" for key, value in table.items() if value is not None)


def _without_none(value):
    if isinstance(value, dict):
        return {key: _without_none(inner) for key, inner in value.items() if inner is not None}
    if isinstance(value, list):
        return [_without_none(inner) for inner in value if inner is not None]
    return value


@st.composite
def changed_files(draw) -> str:
    table = copy.deepcopy(TABLES[draw(st.sampled_from(sorted(TABLES)))])
    for _ in range(draw(st.integers(1, 3))):
        found = list(places(table))
        if not found:
            break
        *way, last = draw(st.sampled_from(found))
        inner = table
        for key in way:
            inner = inner[key]
        action = draw(st.sampled_from(["replace", "delete", "rename", "double", "scale"]))
        if action == "delete":
            del inner[last]
        elif action == "rename" and isinstance(inner, dict):
            inner[draw(st.sampled_from([str(last)[:-1] or "x", str(last) + "x", str(last).upper(), "value"]))] = (
                inner.pop(last)
            )
        elif action == "double" and isinstance(inner, list):
            inner.append(copy.deepcopy(inner[last]))
        elif action == "scale" and isinstance(inner[last], (int, float)):
            inner[last] = inner[last] * draw(st.sampled_from([-1, 0, 1e-3, 1e3, 1e12]))
        else:
            inner[last] = copy.deepcopy(draw(st.sampled_from(STRANGE)))
    return written(table)


@pytest.mark.long
@pytest.mark.filterwarnings("error")
@seed(20261121)
@settings(max_examples=400, deadline=None, database=None, suppress_health_check=[HealthCheck.too_slow])
@given(changed_files())
def test_a_changed_file_is_a_vehicle_or_one_sentence(text: str) -> None:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            vehicle = vehicle_from_text(text, "fuzzed.toml")
    except CoadjointError as error:
        said = str(error)
        assert "fuzzed.toml" in said and "\n" not in said and said.endswith((".", "?")), said
        return
    try:
        assert Craft(vehicle).parameters is not None
    except CoadjointError as error:
        assert "\n" not in str(error)
    numbers = [vehicle.mass, vehicle.volume, *np.ravel(vehicle.inertia), *np.ravel(vehicle.added_mass)]
    assert np.all(np.isfinite(np.array(numbers, dtype=float)))
    assert np.linalg.eigvalsh(vehicle.inertia)[0] > 0
    assert all("nan" not in sentence for sentence in vehicle.warnings)
