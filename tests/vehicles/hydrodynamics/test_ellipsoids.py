"""Lamb's added mass of ellipsoids against published values and limits."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from coadjoint_vehicles.hydrodynamics import displaced_mass, ellipsoid, ellipsoid_added_mass


def test_a_triaxial_ellipsoid_has_the_tabulated_added_mass():
    found = np.diag(ellipsoid_added_mass((1.0, 0.5, 0.3), 1025.0))
    assert np.max(np.abs(found[:3] - [94.0162, 300.2576, 802.0555])) <= 1e-4
    assert np.max(np.abs(found[3:] - [9.8121, 102.5733, 26.9824])) <= 1e-4


def test_the_hull_of_remus_has_the_added_mass_of_its_public_model():
    found = np.diag(ellipsoid_added_mass((0.8, 0.095, 0.095), 1026.0))
    assert displaced_mass((0.8, 0.095, 0.095), 1026.0) == pytest.approx(31.0294, abs=1e-4)
    assert np.max(np.abs(found - [0.838909, 29.437637, 29.437637, 0.0, 3.426210, 3.426210])) <= 1e-6


def test_a_sphere_moves_half_of_its_fluid_and_none_when_it_turns():
    found = ellipsoid_added_mass((0.4, 0.4, 0.4), 1000.0)
    half = 0.5 * displaced_mass((0.4, 0.4, 0.4), 1000.0)
    assert np.max(np.abs(found - np.diag([half] * 3 + [0.0] * 3))) <= 1e-12 * half


def test_a_slender_ellipsoid_has_the_added_mass_of_slender_body_theory():
    """A₁₁ = εm_f, A₂₂ = (1 − 2ε)m_f, ε = (b/a)²(ln(2a/b) − 1), and A₅₅ = m_f a²/5, for b = c ≪ a."""
    a = 200.0
    epsilon = (np.log(2 * a) - 1) / a**2
    found = np.diag(ellipsoid_added_mass((a, 1.0, 1.0))) / displaced_mass((a, 1.0, 1.0))
    assert found[0] == pytest.approx(epsilon, rel=1e-3)
    assert np.max(np.abs((1 - found[1:3]) / (2 * epsilon) - 1)) <= 1e-3
    assert np.max(np.abs(found[4:] * 5 / a**2 - 1)) <= 10 * epsilon


@pytest.mark.parametrize("order", [(0, 1, 2), (1, 2, 0), (2, 0, 1), (1, 0, 2)])
def test_naming_the_axes_otherwise_permutes_the_entries(order):
    axes = np.array([0.5, 0.2, 0.3])
    found, expected = np.diag(ellipsoid_added_mass(axes[list(order)])), np.diag(ellipsoid_added_mass(axes))
    assert np.max(np.abs(found - expected.reshape(2, 3)[:, order].ravel())) <= 1e-11


def test_nearly_equal_semi_axes_give_nearly_no_added_inertia():
    equal, nearly = (ellipsoid_added_mass((0.8, 0.1, 0.1 * (1 + gap))) for gap in (0.0, 1e-9))
    assert np.max(np.abs(equal - nearly)) <= 1e-6 and 0 <= nearly[3, 3] <= 1e-12


def test_an_ellipsoid_of_the_density_of_water_has_its_own_inertia_and_floats():
    p: Any = ellipsoid(semi_axes=(0.5, 0.2, 0.3), fluid_density=1000.0).parameters
    mass = 4 / 3 * np.pi * 1000 * 0.5 * 0.2 * 0.3
    assert p.mass == pytest.approx(mass, rel=1e-14) and p.buoyancy == p.mass * p.gravity
    expected = mass / 5 * np.array([0.04 + 0.09, 0.25 + 0.09, 0.25 + 0.04])
    assert np.max(np.abs(p.inertia - np.diag(expected))) <= 1e-13 * mass
