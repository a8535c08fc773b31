"""Every unit of files against a table of its own, in SI units."""

import math

import pytest

from coadjoint import units as u
from coadjoint.errors import ArgumentError

SYMBOLS = {
    "1": 1, "%": 0.01,
    "kg": 1, "g": 0.001, "t": 1000, "lb": 0.45359237,
    "m": 1, "mm": 0.001, "µm": 1e-6, "cm": 0.01, "km": 1000, "nmi": 1852, "in": 0.0254, "ft": 0.3048,
    "L": 0.001, "l": 0.001, "mL": 1e-6, "ml": 1e-6,
    "s": 1, "ms": 0.001, "µs": 1e-6, "us": 1e-6, "ns": 1e-9, "min": 60, "h": 3600, "days": 86400, "Hz": 1,
    "kn": 0.514444444444444444, "knots": 0.514444444444444444,
    "N": 1, "kN": 1000, "kgf": 9.80665, "lbf": 0.45359237 * 9.80665,
    "J": 1, "W": 1, "V": 1, "A": 1, "Ω": 1, "mΩ": 1e-3, "ohm": 1,
    "rad": 1, "deg": 0.017453292519943295, "°": 0.017453292519943295, "rev": 1, "rpm": 1 / 60,
}  # fmt: skip
"""Sources: The International System of Units (BIPM, 9th edition); NIST SP 811, appendix B."""

ENDINGS = {
    "s": 1, "ms": 0.001, "us": 1e-6, "ns": 1e-9, "min": 60, "h": 3600, "days": 86400,
    "m": 1, "mm": 0.001, "cm": 0.01, "km": 1000, "ft": 0.3048, "nmi": 1852,
    "m_s": 1, "m_per_s": 1, "cm_s": 0.01, "cm_per_s": 0.01, "rad_s": 1, "rad_per_s": 1,
    "deg_s": math.pi / 180, "deg_per_s": math.pi / 180, "km_per_h": 1 / 3.6, "kn": 1852 / 3600, "knots": 1852 / 3600,
    "rad": 1, "deg": math.pi / 180, "rpm": 1 / 60, "per_s": 1, "1_s": 1,
    "kg": 1, "g": 0.001, "t": 1000, "m3": 1, "l": 0.001, "percent": 0.01,
    "N": 1, "kN": 1000, "Nm": 1, "J": 1, "W": 1, "V": 1, "A": 1,
}  # fmt: skip


@pytest.mark.parametrize("symbol", SYMBOLS)
def test_a_symbol_is_so_many_si_units(symbol):
    assert u.unit_of(symbol)[0] == pytest.approx(SYMBOLS[symbol], rel=1e-15)


@pytest.mark.parametrize("ending", ENDINGS)
def test_the_end_of_a_name_is_so_many_si_units(ending):
    name, unit = u.split_name(f"speed_{ending}")
    assert name == "speed"
    assert u.unit_of(unit)[0] == pytest.approx(ENDINGS[ending], rel=1e-15)


def test_every_symbol_and_every_ending_is_in_the_tables():
    assert set(SYMBOLS) == set(u._SYMBOLS)
    assert set(ENDINGS) == set(u.ENDINGS)


@pytest.mark.parametrize(
    ("unit", "dimension", "factor"),
    [
        ("rpm", u.ANGULAR_VELOCITY, 2 * math.pi / 60), ("rpm", u.REVOLUTIONS, 1 / 60), ("Hz", u.REVOLUTIONS, 1.0),
        ("deg/s", u.ANGULAR_VELOCITY, math.pi / 180), ("rev/s", u.ANGULAR_VELOCITY, 2 * math.pi),
        ("km/h", u.SPEED, 1 / 3.6), ("g/cm^3", u.DENSITY, 1000.0), ("kg m^2", u.INERTIA, 1.0),
        ("lb ft^2", u.INERTIA, 0.45359237 * 0.3048**2), ("L/min", u.VOLUME_RATE, 1e-3 / 60),
        ("1/deg", u.PER_ANGLE, 180 / math.pi), ("lbf ft", u.TORQUE, 1.3558179483314),
        ("kg m/s^2", u.FORCE, 1.0), ("kg m^2/s^2", u.TORQUE, 1.0), ("N m/s", u.POWER, 1.0), ("W/A", u.VOLTAGE, 1.0),
        ("V/A", u.RESISTANCE, 1.0), ("W/V", u.ELECTRIC_CURRENT, 1.0), ("kg/L", u.DENSITY, 1e3),
        ("m/s^2", u.ACCELERATION, 1.0), ("s/km", u.SLOWNESS, 1e-3), ("1/min", u.FREQUENCY, 1 / 60),
        ("cm^2", u.AREA, 1e-4), ("cm^3", u.VOLUME, 1e-6),
    ],
)  # fmt: skip
def test_products_quotients_and_powers(unit, dimension, factor):
    assert u.factor_to(dimension, unit, "x") == pytest.approx(factor, rel=1e-13)


@pytest.mark.parametrize(
    "unit, dimension, expected",
    [
        ("deg/s/√Hz", u.per_root(u.ANGULAR_VELOCITY, "Hz"), math.radians(1.0)),
        ("deg/√h", u.per_root(u.ANGULAR_VELOCITY, "Hz"), math.radians(1.0) / 60),
        ("m/s/sqrt(h)", u.per_root(u.ACCELERATION, "Hz"), 1 / 60),
        ("mm/s^2/√Hz", u.per_root(u.ACCELERATION, "Hz"), 1e-3),
        ("cm/√min", u.per_root(u.LENGTH, "s"), 0.01 / math.sqrt(60)),
    ],
)
def test_densities_and_random_walks_have_roots_in_their_units(unit, dimension, expected):
    assert u.in_si(1.0, unit, dimension, "It") == pytest.approx(expected, rel=1e-14)
    with pytest.raises(ArgumentError, match="give a unit of that kind"):
        u.in_si(1.0, unit, u.SPEED, "It")


def test_an_existing_name_has_no_unit_at_its_end():
    assert u.split_name("depth_m") == ("depth", "m") == u.split_name("depth_m", ("depth",))
    assert u.split_name("depth_m", ("depth_m", "depth")) == ("depth_m", "") == u.split_name("depth_m", ("speed",))
