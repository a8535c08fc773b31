"""Strip theory against Lamb's ellipsoids, closed forms of sections, and vortex sheets on sections with fins."""

from __future__ import annotations

import numpy as np
import pytest

from coadjoint.errors import ArgumentError
from coadjoint.models import general_vehicle
from coadjoint_vehicles.hydrodynamics import (
    added_mass_about,
    displaced_mass,
    ellipsoid_added_mass,
    slender_body_added_mass,
)
from coadjoint_vehicles.hydrodynamics.sections import crosswise_added_mass, rolling_added_mass

DENSITY = 1026.0


def sections(semi_axes, number=400):
    """Stations that crowd at the ends, half breadth and half height of an ellipsoid."""
    turn = np.linspace(-np.pi / 2, np.pi / 2, number)
    a, b, c = semi_axes
    return a * np.sin(turn), b * np.cos(turn), c * np.cos(turn)


def heave_of(b, c, s):
    return float(crosswise_added_mass(*np.array([[b], [c], [s]]))[0])


def test_in_the_slender_limit_strips_give_lambs_ellipsoid_of_three_axes():
    """The error is of order ε² ln(1/ε): at a tenth of the slenderness, about a fiftieth of it."""
    errors = []
    for slenderness in (0.05, 0.005):
        axes = (1.0, slenderness, 0.6 * slenderness)
        found, lamb = (
            slender_body_added_mass(*sections(axes), fluid_density=DENSITY),
            ellipsoid_added_mass(axes, DENSITY),
        )
        assert found[0, 0] == pytest.approx(lamb[0, 0], rel=1e-4)
        errors.append(np.diag(found)[1:] / np.diag(lamb)[1:] - 1)
    assert np.all(errors[0] > 0) and np.all(errors[0] < 0.05)
    assert np.all(np.abs(errors[1]) < 1e-3) and np.all(errors[1] < errors[0] / 20)


def test_the_hull_of_remus_lies_within_the_error_of_the_theory_of_its_public_model():
    """Strips: A₂₂ = m_f and A₆₆ = m_f a²/5; REMUS has 29.4376 kg and 3.4262 kg m² of Lamb."""
    x, b, _ = sections((0.8, 0.095, 0.095), 2000)
    found = slender_body_added_mass(x, b, fluid_density=DENSITY)
    fluid = displaced_mass((0.8, 0.095, 0.095), DENSITY)
    assert found[0, 0] == pytest.approx(0.8389, abs=1e-4)
    assert found[1, 1] == found[2, 2] == pytest.approx(fluid, rel=1e-5) and found[3, 3] == 0
    assert found[5, 5] == found[4, 4] == pytest.approx(fluid * 0.64 / 5, rel=1e-5)
    assert found[1, 1] / 29.4376 == pytest.approx(1.054, abs=1e-3)
    assert found[5, 5] / 3.4262 == pytest.approx(1.159, abs=1e-3)


def test_a_cone_has_its_integrals_to_round_off():
    """r = R x/L: A₂₂ = πρR²L/3, A₂₆ = πρR²L²/4, A₅₅ = πρR²L³/5."""
    R, L = 0.2, 3.0
    found = slender_body_added_mass([0.0, L], [0.0, R], fluid_density=DENSITY)
    mass = np.pi * DENSITY * R**2 * L
    assert np.allclose(found[1, [1, 5]], mass * np.array([1 / 3, L / 4]), rtol=1e-14)
    assert np.allclose(found[4, [2, 4]], mass * np.array([-L / 4, L**2 / 5]), rtol=1e-14)


def test_moving_the_stations_moves_the_reference_point():
    x, b, c = sections((1.5, 0.2, 0.1), 60)
    fins = np.where(x < -1.2, 0.25, 0.0)
    here, there = (
        slender_body_added_mass(x + d, b, c, horizontal_fins=fins, vertical_fins=0.8 * fins) for d in (0.0, 0.7)
    )
    assert np.max(np.abs(added_mass_about(here, (-0.7, 0.0, 0.0)) - there)) <= 1e-12 * np.max(there)


def test_a_pair_of_fins_adds_its_strip_and_its_moments():
    """A circle with fins has πρ(s² − R² + R⁴/s²); two sections at one x begin and end the fins."""
    x, R, s = [-1.0, -0.9, -0.9, -0.7, -0.7, 1.0], 0.1, 0.25
    tips = [0.0, 0.0, s, s, 0.0, 0.0]
    bare = slender_body_added_mass(x, R, fluid_density=DENSITY)
    finned = slender_body_added_mass(x, R, fluid_density=DENSITY, vertical_fins=tips)
    strip = np.pi * DENSITY * (s**2 - 2 * R**2 + R**4 / s**2)
    added = finned - bare
    assert added[1, 1] == pytest.approx(0.2 * strip, rel=1e-12)
    assert added[1, 5] == added[5, 1] == pytest.approx(-0.8 * 0.2 * strip, rel=1e-12)
    assert added[5, 5] == pytest.approx((0.9**3 - 0.7**3) / 3 * strip, rel=1e-12)
    assert added[2, 2] == added[4, 4] == added[0, 0] == 0 and added[3, 3] > 0


def test_sections_have_their_closed_forms():
    assert heave_of(0.3, 0.1, 0.3) == pytest.approx(np.pi * 0.09, rel=1e-14)
    assert heave_of(0.3, 0.3, 0.5) == pytest.approx(np.pi * (0.25 - 0.09 + 0.0081 / 0.25), rel=1e-14)
    assert heave_of(0.0, 0.4, 0.5) == pytest.approx(np.pi * 0.25, rel=1e-14)  # a plate along the motion changes nothing
    assert heave_of(0.0, 0.0, 0.0) == 0
    assert rolling_added_mass(0.3, 0.1, 0.3, 0.1) == pytest.approx(np.pi / 8 * 0.08**2, rel=1e-14)
    assert rolling_added_mass(0.3, 0.1, 0.3 * (1 + 1e-9), 0.1) == pytest.approx(np.pi / 8 * 0.08**2, rel=1e-6)
    assert rolling_added_mass(0.0, 0.0, 0.5, 0.0) == pytest.approx(np.pi / 8 * 0.5**4, rel=1e-13)
    assert rolling_added_mass(0.0, 0.0, 0.5, 0.5) == pytest.approx(2 / np.pi * 0.5**4, rel=1e-5)
    assert rolling_added_mass(0.2, 0.1, 0.5, 0.4) == pytest.approx(rolling_added_mass(0.1, 0.2, 0.4, 0.5), rel=1e-6)


def sheet(b, c, horizontal, vertical, number=90):
    """Middle points and lengths of short pieces of an ellipse with fins, finer at tips and roots."""
    turn = np.linspace(0, 2 * np.pi, 2 * number + 1)
    parts = [b * np.cos(turn) + 1j * c * np.sin(turn)]
    crowd = 0.5 - 0.5 * np.cos(np.linspace(0, np.pi, number + 1))
    for root, tip, side in ((b, horizontal, 1), (b, horizontal, -1), (c, vertical, 1j), (c, vertical, -1j)):
        if tip > root:
            parts.append(side * (root + (tip - root) * crowd))
    middle = np.concatenate([(part[1:] + part[:-1]) / 2 for part in parts])
    return middle, np.concatenate([np.abs(np.diff(part)) for part in parts])


def energy(middle, lengths, psi):
    """2T/ρ of the vortex sheet of no circulation whose stream function is ψ + const. on the section, both sides."""
    n = len(middle)
    distance = np.abs(middle[:, None] - middle) + np.eye(n)
    kernel = -np.log(distance) / (2 * np.pi)
    kernel[np.diag_indices(n)] = (1 - np.log(lengths / 2)) / (2 * np.pi)
    system = np.block([[kernel, np.ones((n, 1))], [np.ones((1, n)), np.zeros((1, 1))]])
    return float(np.linalg.solve(system, np.append(psi, 0.0))[:-1] @ psi)


@pytest.mark.parametrize("section", [(0.3, 0.3, 0.5, 0.3), (0.3, 0.3, 0.5, 0.45), (0.35, 0.2, 0.5, 0.4)])
def test_maps_of_sections_with_fins_agree_with_vortex_sheets(section):
    """The sheet moves the water inside of the ellipse too: πbc of it in heave, and that of ∇(x² − y²) in roll."""
    b, c, horizontal, _ = section
    middle, lengths = sheet(*section)
    heave = energy(middle, lengths, middle.real) - np.pi * b * c
    roll = energy(middle, lengths, 0.5 * np.abs(middle) ** 2)
    roll -= np.pi * b * c * (b**2 - c**2) ** 2 / (4 * (b**2 + c**2))
    assert heave == pytest.approx(heave_of(b, c, horizontal), rel=0.01)
    assert roll == pytest.approx(rolling_added_mass(*section), rel=0.01)


def test_a_hull_with_fins_is_a_vehicle():
    x, b, c = sections((0.8, 0.1, 0.08), 40)
    found = slender_body_added_mass(x, b, c, horizontal_fins=np.where(x < -0.6, 0.15, 0.0))
    assert np.array_equal(found, found.T) and np.linalg.eigvalsh(found)[0] > 0
    general_vehicle(mass=20.0, inertia=(0.1, 3.0, 3.0), added_mass=found)


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (([1.0, 0.0], 0.1), "rise"),
        (([0.0], 0.1), "two stations or more"),
        (([0.0, 1.0], [0.1, 0.1, 0.1]), "half_breadth"),
        (([0.0, 1.0], -0.1), "negative"),
        (([0.0, 1.0], 0.0), "no volume"),
        (([0.0, np.nan], 0.1), "finite"),
    ],
)
def test_sections_that_are_no_hull_are_refused(arguments, word):
    with pytest.raises(ArgumentError, match=word):
        slender_body_added_mass(*arguments)
