"""Energy–Casimir verdicts of symmetric bodies with random data on both sides of their thresholds, in several units."""

from __future__ import annotations

import numpy as np
import pytest

from coadjoint.errors import ArgumentError
from coadjoint.models import heavy_top, integrable_tops, kirchhoff, rigid_body
from coadjoint.stability import stability, steady_motion

UNITS = {"kg m s": (1.0, 1.0, 1.0), "g cm s": (1e3, 1e2, 1.0), "t km h": (1e-3, 1e-3, 1 / 3600.0)}
"""How many units of mass, length and time are a kilogram, a metre and a second."""


def sleeping_top(random, units, factor):
    """A Lagrange top upright at ω = factor·√(4Mgl I₁)/I₃, and how it may be known to be symmetric: μ₃ is watched."""
    m, L, T = units
    mass, lever, transverse = random.uniform((0.3, 0.1, 0.2), (5.0, 1.5, 5.0))
    axial = transverse * random.uniform(0.2, 1.9)
    spin = factor * np.sqrt(4 * mass * 9.81 * lever * transverse) / axial
    inertias = {"transverse": transverse * m * L**2, "axial": axial * m * L**2}
    top = integrable_tops.lagrange(mass=mass * m, lever=lever * L, gravity=9.81 * L / T**2, **inertias)
    return top, integrable_tops.start(top, angular_velocity=(0, 0, spin / T)), ()


def spinning_body(random, units, factor):
    """A prolate body along e_i, Π_i = factor·√(4J₁(1/m₃ − 1/m₁)) P: a sleeping top, P²(1/m₃ − 1/m₁) for Mgl."""
    m, L, T = units
    along, transverse, speed = random.uniform((0.3, 0.2, 0.2), (5.0, 5.0, 3.0))
    across, axial = along * random.uniform(1.1, 3.0), transverse * random.uniform(0.1, 1.9)
    i, axis = (k := int(random.integers(3))), np.eye(3)[k]
    spin = factor * np.sqrt(4 * transverse * (1 / along - 1 / across)) * along * speed / axial
    J, M = np.where(axis > 0, axial, transverse), np.where(axis > 0, along, across)
    body = kirchhoff.body(inertia=J * m * L**2, mass=M * m)
    start = kirchhoff.start(body, velocity=speed * axis * L / T, angular_velocity=spin * axis / T)
    return body, start, (lambda state: state.mu[i],)


def verdicts(make, seed, units, factor):
    system, start, integrals = make(np.random.default_rng(seed), units, factor)
    found = stability(steady_motion(system, start), integrals)
    return found.spectral, found.energy.reason, found.verdict


def assert_right_on_both_sides(make, seed, units):
    assert verdicts(make, seed, units, 0.99) == ("unstable", "indefinite", "unstable"), seed
    assert verdicts(make, seed, units, 1.01) == ("neutral", "positive definite", "stable"), seed


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("make", [sleeping_top, spinning_body])
@pytest.mark.parametrize("units", UNITS.values(), ids=UNITS)
def test_a_body_of_random_data_is_stable_above_its_threshold_and_unstable_below_in_any_units(make, units):
    assert_right_on_both_sides(make, 1788, units)


@pytest.mark.long
@pytest.mark.parametrize("make", [sleeping_top, spinning_body])
@pytest.mark.parametrize("units", UNITS.values(), ids=UNITS)
def test_fifty_bodies_of_random_data_are_judged_right_on_both_sides_in_any_units(make, units):
    for seed in range(50):
        assert_right_on_both_sides(make, seed, units)


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("units", UNITS.values(), ids=UNITS)
def test_what_a_body_does_not_conserve_is_refused_in_any_units(units):
    """A body with two nearly equal inertias, J₂ = J₁(1 + 1e-5), does not keep μ₃."""
    m, L, T = units
    J = np.array([1.0, 1.00001, 0.4]) * m * L**2
    top = heavy_top.make(mass=1.2 * m, center_of_mass=(0, 0, 0.5 * L), inertia=J, gravity=9.81 * L / T**2)
    motion = steady_motion(top, heavy_top.start(top, angular_velocity=(0, 0, 14.0 / T)))
    assert stability(motion).energy.verdict == "undecided"
    with pytest.raises(ArgumentError, match="not an integral of the motion: it changes along the motion"):
        stability(motion, [lambda state: state.mu[2]])


@pytest.mark.long
@pytest.mark.parametrize("units", UNITS.values(), ids=UNITS)
def test_a_precessing_top_is_found_stable_in_any_units(units):
    """Regular precession at tilt θ, I₁ cos θ Ω² − I₃ωΩ + Mgl = 0, goes along the flow of μ₃."""
    m, L, T = units
    mass, lever, I1, I3, theta, spin = 1.2, 0.5, 1.0, 0.4, 0.9, 15.0
    slow = np.min(np.roots([I1 * np.cos(theta), -I3 * spin, mass * 9.81 * lever]))
    top = integrable_tops.lagrange(
        mass=mass * m, lever=lever * L, transverse=I1 * m * L**2, axial=I3 * m * L**2, gravity=9.81 * L / T**2
    )
    omega = np.array([slow * np.sin(theta) * 1.02, 0.01, spin]) / T
    guess = integrable_tops.start(top, euler_zyx=(0, -theta, 0), angular_velocity=omega)
    motion = steady_motion(top, guess, symmetries=[integrable_tops.axial_momentum])
    assert motion.state.xi[0] * T == pytest.approx(slow * np.sin(theta), rel=0.1)
    assert stability(motion).verdict == "stable"


def test_multipliers_are_in_the_units_of_the_integrals():
    """E − ΣλᵢCᵢ: for the free body about e₃, E = μ²/2J₃ and C = μ·μ, λ = 1/(2J₃)."""
    body = rigid_body.make(inertia=(100.0, 200.0, 300.0))
    found = stability(steady_motion(body, rigid_body.start(body, angular_velocity=(0, 0, 0.02)))).energy
    assert found.multipliers["casimir_1"] == pytest.approx(1 / 600.0, rel=1e-12)
