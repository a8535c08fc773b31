"""Steady motions whose stability is known in closed form: rigid bodies, tops, bodies in a fluid."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
import coadjoint_vehicles as vehicles
from coadjoint.errors import ArgumentError
from coadjoint.models import general_vehicle, heavy_top, integrable_tops, rigid_body, se3_start, se3_vehicle
from coadjoint.models.paper_form import start as place
from coadjoint.stability import Search, stability, steady_motion
from coadjoint_vehicles.hydrodynamics import ellipsoid


def turning(inertia, omega):
    body = rigid_body.make(inertia=inertia)
    return stability(steady_motion(body, rigid_body.start(body, angular_velocity=omega)))


def test_a_free_body_is_unstable_about_its_middle_axis_at_eulers_rate():
    J = np.array([1.0, 2.0, 3.0])
    middle = turning(J, (0, 1.3, 0))
    rate = 1.3 * np.sqrt((J[2] - J[1]) * (J[1] - J[0]) / (J[0] * J[2]))
    assert middle.growth_rate == pytest.approx(rate, rel=1e-12)
    assert (middle.spectral, middle.energy.verdict, middle.verdict) == ("unstable", "undecided", "unstable")


@pytest.mark.long
def test_a_free_body_is_stable_about_its_shortest_and_longest_axis():
    J = np.array([1.0, 2.0, 3.0])
    for axis in (0, 2):
        others = np.delete(J, axis)
        frequency = 1.3 * np.sqrt(np.prod(J[axis] - others) / np.prod(others))
        found = turning(J, 1.3 * np.eye(3)[axis])
        assert [mode.frequency for mode in found.modes] == [pytest.approx(frequency, rel=1e-12)]
        assert (found.spectral, found.verdict) == ("neutral", "stable")
        assert found.linear.zero_modes == 1


def test_from_a_guess_the_steady_turn_of_the_same_angular_momentum_is_found():
    body = rigid_body.make(inertia=(1.0, 2.0, 3.0))
    found = steady_motion(body, rigid_body.start(body, angular_velocity=(0.1, -0.2, 2.0))).state
    np.testing.assert_allclose(found.xi, [0, 0, np.linalg.norm([0.1, -0.4, 6.0]) / 3], atol=1e-12)


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize(("fraction", "stable"), [(0.998, False), (1.002, True)])
def test_a_sleeping_lagrange_top_is_stable_above_its_critical_spin(fraction, stable):
    """ω² > 4Mgl I₁/I₃², and energy, vertical and axial momentum show it nonlinearly."""
    M, l, I1, I3 = 1.2, 0.5, 1.0, 0.4
    top = integrable_tops.lagrange(mass=M, lever=l, transverse=I1, axial=I3)
    spin = fraction * np.sqrt(4 * M * 9.81 * l * I1) / I3
    found = stability(steady_motion(top, integrable_tops.start(top, angular_velocity=(0, 0, spin))))
    assert (found.spectral, found.verdict) == (("neutral", "stable") if stable else ("unstable", "unstable"))
    # Slow and fast precession about the vertical, I₁λ² − i(I₃ − 2I₁)ωλ + … in body axes; in space they are the roots of
    # I₁Ω² − I₃ωΩ + Mgl = 0, and the body turns at ω under them.
    precession = np.roots([I1, -I3 * spin, M * 9.81 * l])
    frequencies = sorted(mode.frequency for mode in found.modes)
    np.testing.assert_allclose(
        sorted(set(np.abs(precession.real - spin).round(9))), np.unique(np.round(frequencies, 9))
    )
    if not stable:
        assert found.growth_rate == pytest.approx(np.max(precession.imag), rel=1e-9)


@pytest.mark.long
def test_without_the_axial_momentum_the_energy_of_a_sleeping_top_says_nothing():
    top = heavy_top.make(mass=1.2, center_of_mass=(0, 0, 0.5), inertia=(1.0, 1.0, 0.4))
    motion = steady_motion(top, heavy_top.start(top, angular_velocity=(0, 0, 14.0)))
    assert stability(motion).verdict == "undecided"

    def axial_momentum(state):
        return state.mu[2]

    assert stability(motion, [axial_momentum]).verdict == "stable"
    asleep = steady_motion(top, motion.state, symmetries=[axial_momentum])
    assert stability(asleep).verdict == "stable"


@pytest.mark.long
def test_a_hanging_top_is_stable_and_one_that_stands_still_falls():
    for height, verdict in ((-0.5, "stable"), (0.5, "unstable")):
        top = heavy_top.make(mass=1.0, center_of_mass=(0, 0, height), inertia=(1.0, 2.0, 0.4))
        found = stability(steady_motion(top, heavy_top.start(top)))
        assert found.verdict == verdict
        rates = sorted(max(mode.frequency, mode.rate) for mode in found.modes if mode.rate > -1e-9)
        np.testing.assert_allclose(rates, np.sqrt(9.81 * 0.5 / np.array([2.0, 1.0])), rtol=1e-12)


REMUS = vehicles.load("remus_100")


def bare_torpedo(make=general_vehicle, **changes):
    keys = ("mass", "inertia", "added_mass", "buoyancy")
    return make(**{**{key: getattr(REMUS, key) for key in keys}, **changes})


MUNK = 1.5 * np.sqrt(29.4376 - 0.8389) * np.sqrt(REMUS.mass + 0.8389)
MUNK /= np.sqrt((REMUS.mass + 29.4376) * (4.0278 + 3.4262))


@pytest.mark.long
def test_a_bare_torpedo_turns_across_the_flow_at_munks_rate_on_both_groups():
    """u√((m₂ − m₁)m₁/(m₂J₆₆)): REMUS at 1.5 m/s 2.1330 1/s, and it stays when a current is added."""
    assert pytest.approx(2.1330, abs=5e-5) == MUNK
    one, other = bare_torpedo(), bare_torpedo(se3_vehicle)
    guesses = (one, place(one, velocity=(1.5, 0, 0))), (other, se3_start(other, velocity=(1.5, 0, 0)))
    for vehicle, guess in guesses:
        found = stability(steady_motion(vehicle, guess))
        assert found.growth_rate == pytest.approx(MUNK, rel=1e-9)
        assert set(found.modes[0].name.split("-")) in ({"yaw", "sway"}, {"pitch", "heave"})
        assert found.linear.symmetry_defect < 1e-12


@pytest.mark.long
def test_a_simulated_torpedo_turns_at_the_rate_of_the_spectrum():
    vehicle = bare_torpedo()
    guess = place(vehicle, velocity=(1.5, 0, 0), euler_zyx=(0.0, 0.0, 0.0))
    mode = stability(steady_motion(vehicle, guess)).modes[0]
    z = 1e-7 * np.real(mode.velocities) / np.max(np.abs(mode.velocities))
    start = vehicle.state(g=guess.g, q=[0, 0, 0], xi=guess.xi + z[:3], qdot=guess.nu + z[3:], a0=[0, 0, 1])
    run = co.simulate(vehicle, start, dt=0.005, duration=4.0, method=co.Midpoint()).dataset
    size = np.linalg.norm(run.xi.values, axis=1)
    first, last = 200, 700
    rate = np.log(size[last] / size[first]) / (0.005 * (last - first))
    assert rate == pytest.approx(MUNK, rel=2e-3)


LEVER = 0.02


def bottom_heavy(axes):
    """A neutrally buoyant ellipsoid, M = m + added mass, and mgl."""
    body = ellipsoid(semi_axes=axes, center_of_mass=(0, 0, LEVER))
    p = body.parameters
    return body, p.mass + np.diag(p.added_mass)[:3], float(p.mass * p.gravity * LEVER)


def critical_momentum(M, righting, axis):
    """p with mgl = p²(1/m₃ − 1/m₁) or so: the vertical and the horizontal bound of Leonard (1997)."""
    if axis == 2:
        return np.sqrt(righting / max(1 / M[2] - 1 / M[0], 1 / M[2] - 1 / M[1]))
    assert M[1] > M[0]
    return np.sqrt(righting / (1 / M[1] - 1 / M[2]))


AXES = {2: (0.3, 0.5, 1.0), 1: (1.0, 0.4, 0.3)}


def ahead(state, speed, axis):
    """ν = speed e_axis, ω = 0."""
    return jnp.concatenate([state.nu - speed * jnp.eye(3)[axis], state.xi])


@pytest.mark.long
@pytest.mark.parametrize("axis", [2, 1], ids=["vertical", "horizontal"])
def test_the_bounds_of_bottom_heavy_vehicles_are_where_the_spectrum_and_the_energy_say(axis):
    body, M, righting = bottom_heavy(AXES[axis])
    critical = critical_momentum(M, righting, axis) / M[axis]
    search = Search(body, place(body, velocity=critical * np.eye(3)[axis]), lambda s, v: ahead(s, v, axis))

    def at(speed):
        return stability(search.find(place(body, velocity=speed * np.eye(3)[axis]), speed))

    # Many speeds, because λ is not unique at the vertical one and has to be looked for.
    below, above = [at(f * critical) for f in (0.17, 0.5, 0.77, 0.998)], [at(f * critical) for f in (1.002, 2.0)]
    assert [(found.spectral, found.verdict) for found in below] == [("neutral", "stable")] * 4
    assert [(found.spectral, found.energy.verdict) for found in above] == [("unstable", "undecided")] * 2


@pytest.mark.cases(1)
@pytest.mark.parametrize("axis", [2, 1], ids=["vertical", "horizontal"])
def test_bottom_heavy_vehicles_stay_below_their_bound_and_leave_above_it(axis):
    body, M, righting = bottom_heavy(AXES[axis])
    critical = critical_momentum(M, righting, axis) / M[axis]
    away = []
    for fraction in (0.99, 1.01):
        nudge = np.array([2e-4, -1e-4, 1.5e-4])
        start = place(body, velocity=fraction * critical * np.eye(3)[axis], angular_velocity=nudge)
        run = co.simulate(body, start, dt=0.05, duration=250.0, monitors=False).dataset
        away.append(float(np.max(np.abs(run.xi.values))))
    assert away[0] < 3e-4 and away[1] > 0.01


@pytest.mark.long
def test_a_bottom_heavy_ellipsoid_at_rest_swings_with_its_closed_form_periods():
    """ω² = mgl/(J − (ml)²/M), J and M of the axis of the swing and of the sway with it."""
    body, M, righting = bottom_heavy((1.0, 0.5, 0.3))
    p = body.parameters
    found = stability(steady_motion(body, place(body)))
    J = np.diag(p.inertia)[:2] + np.diag(p.added_mass)[3:5] + p.mass * LEVER**2
    expected = np.sqrt(righting / (J - (p.mass * LEVER) ** 2 / M[[1, 0]]))
    np.testing.assert_allclose([mode.frequency for mode in found.modes], sorted(expected, reverse=True), rtol=1e-9)
    assert found.verdict == "stable"


@pytest.mark.long
def test_regular_precession_of_a_lagrange_top_nutates_as_its_effective_potential_says():
    """V(θ) = (p_φ − p₃ cos θ)²/(2I₁ sin²θ) + Mgl cos θ: V'(θ) = 0, nutation ω² = V''(θ)/I₁, and stable."""
    M, l, I1, I3, theta, spin = 1.2, 0.5, 1.0, 0.4, 0.9, 15.0
    weight, p3 = M * 9.81 * l, I3 * spin
    slow = np.min(np.roots([I1 * np.cos(theta), -p3, weight]))
    top = integrable_tops.lagrange(mass=M, lever=l, transverse=I1, axial=I3)
    a = np.array([np.sin(theta), 0, np.cos(theta)])
    omega = np.array([slow * a[0] * 1.02, 0.01, spin])
    guess = integrable_tops.start(top, euler_zyx=(0, -theta, 0), angular_velocity=omega)
    np.testing.assert_allclose(guess.a, a, atol=1e-12)
    motion = steady_motion(top, guess, symmetries=[integrable_tops.axial_momentum])
    found, up = stability(motion), motion.state.a
    tilt = np.arccos(up[2])
    vertical, axial = motion.state.mu @ up, motion.state.mu[2]
    assert tilt == pytest.approx(theta, abs=0.1) and axial == pytest.approx(p3, rel=1e-9)

    def potential(angle):
        return (vertical - axial * np.cos(angle)) ** 2 / (2 * I1 * np.sin(angle) ** 2) + weight * np.cos(angle)

    step = 1e-3
    left, middle, right = (potential(tilt + k * step) for k in (-1, 0, 1))
    assert abs(right - left) / (2 * step) < 1e-4 * weight
    nutation = np.sqrt((left - 2 * middle + right) / step**2 / I1)
    assert [mode.frequency for mode in found.modes] == [pytest.approx(nutation, rel=1e-5)]
    assert found.verdict == "stable" and found.linear.zero_modes == 3


@pytest.mark.long
def test_what_the_motion_does_not_conserve_is_no_integral_and_makes_nothing_stable():
    """μ₃ of an unsymmetric top: with it the second variation would be definite."""
    top = heavy_top.make(mass=1.2, center_of_mass=(0, 0, 0.5), inertia=(1.0, 1.3, 0.4))
    guess = heavy_top.start(top, angular_velocity=(0, 0, 14.0))
    motion = steady_motion(top, guess)
    assert stability(motion).verdict == "undecided"
    with pytest.raises(ArgumentError, match="integral 1 of those given, is not an integral of the motion: it changes"):
        stability(motion, [lambda s: s.mu[2]])
    with pytest.raises(ArgumentError, match="not an integral of the motion"):
        steady_motion(top, guess, symmetries=[lambda s: s.mu[2]])
    body = rigid_body.make(inertia=(1.0, 1.0, 3.0))
    turning = steady_motion(body, rigid_body.start(body, angular_velocity=(0, 0, 1.0)))
    assert stability(turning, [lambda s: s.xi[2]]).verdict == "stable"


@pytest.mark.long
def test_integrals_without_names_all_count():
    top = heavy_top.make(mass=1.2, center_of_mass=(0, 0, 0.5), inertia=(1.0, 1.0, 0.4))
    motion = steady_motion(top, heavy_top.start(top, angular_velocity=(0, 0, 14.0)))
    found = stability(motion, [lambda s: s.mu[2], lambda s: s.mu[2] ** 2]).energy
    assert found.verdict == "stable" and {"integral_1", "integral_2"} <= set(found.multipliers)


@pytest.mark.long
def test_round_off_is_no_definite_form():
    """E = |μ|²/2J is the Casimir function of a body with three equal inertias: E − λC is zero, and decides nothing."""
    random = np.random.default_rng(0)
    for J in (0.7, 0.7, 1 / 3, 1 / 3):
        found = turning((J, J, J), random.normal(size=3))
        assert (found.energy.verdict, found.energy.reason, found.spectral) == ("undecided", "degenerate", "neutral")


@pytest.mark.cases(2)
@pytest.mark.parametrize("slow", [1e-2, 1e-3, 1e-4, 1e-5])
def test_modes_that_are_slow_beside_the_fastest_decay_and_grow_by_their_own_rates(slow):
    rates = np.array([-1.0, -slow, 0.6 * slow])
    body = co.System(
        co.SO3(),
        lambda xi, p: 0.5 * xi @ p.inertia @ xi,
        parameters={"inertia": np.diag([1.0, 2.0, 3.0]), "rates": rates},
        forces=lambda motion, p: co.Force(torque=p.rates * (p.inertia @ motion.xi)),
    )
    found = stability(steady_motion(body, body.state(xi=[0, 0, 0])))
    modes = {round(mode.rate, 12): mode.growth for mode in found.modes}
    assert modes == {round(rate, 12): int(np.sign(rate)) for rate in rates}
    assert (found.spectral, found.verdict) == ("unstable", "unstable")
    assert found.growth_rate == pytest.approx(0.6 * slow, rel=1e-9)
