"""Systems, states, crafts, vehicles, problems and filters in one line and as a table: sizes, numbers and units."""

from __future__ import annotations

import re
from html import unescape
from typing import Any

import jax
import numpy as np
import pytest

import coadjoint as co
import coadjoint_vehicles as vehicles
from coadjoint.overview import value_text

TOP = co.System(
    co.SO3(),
    lambda xi, a, p: 0.5 * xi @ (p.inertia * xi) - p.weight * a[2],
    advected=co.Defining(),
    parameters={"inertia": [5.0, 5.0, 1.0], "weight": 20.0},
    units={"inertia": "kg m²", "weight": "N"},
    name="<top>",
)
START = TOP.state(xi=[0, 0, 20], a0=[0, 0, 1])


def cells(shown: Any) -> list[list[str]]:
    """The rows of the tables of an object in a notebook."""
    return [
        [unescape(cell) for cell in re.findall(r"<t[dh][^>]*>(.*?)</t[dh]>", row)]
        for row in re.findall(r"<tr>(.*?)</tr>", shown._repr_html_())
    ]


def test_a_system_shows_its_places_functions_and_parameters_with_units() -> None:
    text = "<System <top>: on SO3(); of lagrangian; advected Defining(); parameters inertia (3,), weight>"
    assert repr(TOP) == text and "<b>System &lt;top&gt;</b>" in TOP._repr_html_()
    rows = cells(TOP)
    assert ["parameter", "value", "unit"] in rows and ["on", "SO3()"] in rows
    assert ["inertia", "[5, 5, 1]", "kg m²"] in rows and ["weight", "20", "N"] in rows


def test_a_state_shows_its_time_and_its_parts_also_of_many_and_traced() -> None:
    assert repr(START) == "<State on SO3(): t 0 s; parts g (3, 3), a (3,), mu (3,), xi (3,)>"
    assert ["xi", "[0, 0, 20]", ""] in cells(START)
    run = co.simulate(TOP, START, dt=0.01, steps=3, accuracy=False)
    assert repr(run.records).startswith("<States, 4, on SO3(): t [0, 0.01, 0.02, 0.03] s; of <top>; parts g (4, 3, 3)")
    seen: list[str] = []
    jax.make_jaxpr(lambda state: seen.append(repr(state)))(START)
    assert "xi (3,)" in seen[0]


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (2.0, "2"),
        ([[1.0, 2.5]], "[[1, 2.5]]"),
        (np.zeros((4, 5)), "array of 4 × 5"),
        (co.each([1.0, 2.0]), "each(2 values)"),
    ],
)
def test_numbers_are_short(value: Any, text: str) -> None:
    assert value_text(value) == text


def test_a_vehicle_and_a_craft_show_parts_commands_and_numbers_with_units() -> None:
    vehicle = vehicles.load("remus_100")
    assert repr(vehicle).startswith("<Vehicle REMUS 100: ") and "parts " in repr(vehicle) and len(repr(vehicle)) < 1500
    assert any(row[0] == "mass" and row[2] == "kg" for row in cells(vehicle) if len(row) == 3)
    craft = vehicles.Craft(vehicle)
    rows = {row[0]: row[1:] for row in cells(craft)}
    assert rows["mass"][1] == "kg" and rows["rudder.area"][1] == "m²" and "rudder (rad)" in rows["commands"][0]
    assert repr(craft).startswith("<Craft REMUS 100: water UniformWater; commands ")


def test_a_problem_shows_steps_and_what_is_optimised() -> None:
    body = co.System(
        co.SO3(), lambda xi, p: 0.5 * xi @ (p.inertia * xi), parameters={"inertia": [1.0, 2.0, 3.0]},
        forces=lambda motion, p: co.Force(motion.inputs.torque), name="body",
    )  # fmt: skip
    problem = co.control.Problem(
        body, body.state(xi=[0, 0, 0], inputs={"torque": np.zeros(3)}), dt=0.1, steps=5,
        inputs={"torque": co.control.Input((3,), lower=-1, upper=1)},
        cost=lambda motion, p: motion.inputs.torque @ motion.inputs.torque, end=co.control.End(xi=[0, 0, 1]),
    )  # fmt: skip
    assert repr(problem) == (
        "<Problem: of body on SO3(); steps 5 of 0.1 s, Midpoint(Cayley()); optimised torque; cost cost; end given; "
        "parameters inertia (3,)>"
    )
    assert ["inertia", "[1, 2, 3]", ""] in cells(problem)


def test_a_filter_shows_its_process_measurements_and_deviations() -> None:
    process = co.estimation.ModelProcess(TOP, START, noise={"torque": 0.1})
    tilt = co.estimation.Measurement(lambda motion, p: motion.a[:1], 0.01)
    found = co.estimation.Filter(process, START, measurements={"tilt": tilt}, deviations={"xi": 0.5})
    assert repr(found).startswith(
        "<Filter: by ModelProcess; t 0 s; errors 6 coordinates; measurements tilt (1); deviations "
    )
    assert ["deviation", "value", "unit"] in cells(found) and ["mu[0]", "2.5", ""] in cells(found)
