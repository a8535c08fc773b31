"""Curves, limits and lags of the thrusters of uuv_simulator, in closed form of their conversions."""

from __future__ import annotations

import numpy as np
import pytest

from coadjoint.errors import FileError
from coadjoint.models.descriptions.elements import Element, parse
from coadjoint_vehicles.importing.draft import Draft
from coadjoint_vehicles.importing.uuv_actuators import SAMPLES, _bessa, _curve, _interval, _lag, _limited, _share

DEAD = """<conversion><type>Bessa</type><rotorConstantL>2</rotorConstantL><rotorConstantR>3</rotorConstantR>
<deltaL>-4</deltaL><deltaR>9</deltaR></conversion>"""
TABLE = "<conversion><type>LinearInterp</type><inputValues>{}</inputValues><outputValues>{}</outputValues></conversion>"


def plugin(inside: str) -> Element:
    return parse(f"<plugin>{inside}</plugin>", "a.xacro")


def draft() -> Draft:
    return Draft("vehicle", "source")


def curve(inside: str, efficiency: float = 1.0, scale: float = 1.0, clamp: tuple[float, float] | None = (-4.0, 5.0)):
    return _curve(draft(), plugin(inside), efficiency, scale, clamp)


def test_a_dead_zone_pushes_nothing_inside_and_by_its_own_constant_on_each_side():
    conversion = plugin(DEAD).children[0]
    squares = np.array([-6.0, -4.0, -3.9, 0.0, 8.9, 9.0, 11.0])
    commands = np.sign(squares) * np.sqrt(np.abs(squares))
    assert _bessa(conversion, commands) == pytest.approx([-4.0, 0, 0, 0, 0, 0, 6.0], abs=1e-12)


def test_a_curve_with_a_dead_zone_is_tabulated_between_its_limits():
    (kind, *rows), limit = curve(DEAD, efficiency=0.5, scale=0.8)
    table = np.array(rows)
    assert kind == "table" and table.shape == (SAMPLES, 2) and limit == (-4.0, 5.0)
    assert table[[0, -1]].tolist() == [
        [-4.0, pytest.approx(0.5 * 2 * (-10.24 + 4))],
        [5.0, pytest.approx(0.5 * 3 * (16.0 - 9))],
    ]
    for clamp in (None, (-np.inf, 5.0), (-4.0, np.inf)):
        with pytest.raises(FileError, match="needs <clampMin> and <clampMax>"):
            curve(DEAD, clamp=clamp)


def test_a_table_has_its_commands_by_the_scale_and_its_forces_clipped():
    given = "<thrustMin>-3</thrustMin><thrustMax>4</thrustMax>" + TABLE.format("-2 0 2", "-5 0 10")
    (kind, *rows), limit = curve(given, efficiency=0.5, scale=0.5)
    assert (kind, limit) == ("table", (-4.0, 4.0)) and rows == [(-4.0, -2.5), (0.0, 0.0), (4.0, 4.0)]
    assert curve(TABLE.format("-2 0 2", "-5 0 10"), clamp=None)[1] is None
    with pytest.raises(FileError, match="has 3 inputValues, but 2 outputValues"):
        curve(TABLE.format("-2 0 2", "-5 0"))


def test_a_square_has_the_efficiencies_and_limits_of_command_and_thrust():
    basic = "<conversion><type>Basic</type><rotorConstant>{}</rotorConstant></conversion>"
    assert curve(basic.format(2.0), efficiency=0.5, scale=0.8)[0] == (
        "quadratic",
        pytest.approx(0.64),
        pytest.approx(0.64),
    )
    with pytest.raises(FileError, match="has the rotorConstant 0"):
        curve(basic.format(0.0))
    with pytest.raises(FileError, match="is of the type 'Cubic'"):
        curve("<conversion><type>Cubic</type></conversion>")
    with pytest.raises(FileError, match="needs <conversion>"):
        curve("")


@pytest.mark.parametrize(
    ("k", "clamp", "thrust", "limit"),
    [
        (2.0, None, (-np.inf, np.inf), None),
        (2.0, (-3.0, 5.0), (-np.inf, np.inf), (-3.0, 5.0)),
        (2.0, (-3.0, 5.0), (-8.0, 32.0), (-2.0, 4.0)),
        (2.0, None, (-8.0, np.inf), (-2.0, 20.0)),
        (2.0, None, (-np.inf, 32.0), (-40.0, 4.0)),
        (-2.0, None, (-8.0, 32.0), (-4.0, 2.0)),
    ],
)
def test_limits_are_the_closest_of_command_and_thrust(k, clamp, thrust, limit):
    assert _limited(draft(), plugin(""), k, clamp, thrust) == (None if limit is None else pytest.approx(limit))


def test_limits_lie_about_zero():
    for clamp in ((1.0, 2.0), (-2.0, -1.0)):
        with pytest.raises(FileError, match="which must lie about 0"):
            _limited(draft(), plugin(""), 2.0, clamp, (-np.inf, np.inf))


def test_exchanged_limits_count_as_none_and_an_efficiency_beyond_1_as_1():
    one = draft()
    given = plugin("<clampMin>2</clampMin><clampMax>2</clampMax><thrustMin>-1</thrustMin><eta>1.1</eta><zero>0</zero>")
    assert _interval(one, given, "clamp") == (-np.inf, np.inf) and len(one.report.differs) == 1
    assert _interval(one, given, "thrust") == (-1.0, np.inf) and len(one.report.differs) == 1
    assert [_share(given, tag) for tag in ("eta", "zero", "missing")] == [1.0, 0.0, 1.0]


def test_a_lag_is_of_the_first_order_or_none():
    first = "<dynamics><type>FirstOrder</type><timeConstant>0.05</timeConstant></dynamics>"
    assert _lag(draft(), plugin(first)) == 0.05 and _lag(draft(), plugin("")) == 0.0
    assert _lag(draft(), plugin("<dynamics><type>ZeroOrder</type></dynamics>")) == 0.0
    one = draft()
    assert (
        _lag(one, plugin("<dynamics><type>Yoerger</type></dynamics>")) == 0.0
        and "'Yoerger' is left out" in one.report.differs[0]
    )
