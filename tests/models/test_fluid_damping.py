"""Damped and stirred fluids on the sphere: decaying waves in closed form, forced solid rotation, order, refusals."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import jax
import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import ArgumentError
from coadjoint.models import fluids
from coadjoint.simulation.arguments import require_forward

NU, ALPHA, OMEGA = 0.03, 0.2, 0.7


def path(fluid, start, steps, method, duration=1.0):
    return co.trajectory(fluid, start, dt=duration / steps, steps=steps, method=method).final


@pytest.mark.long
def test_a_wave_decays_at_its_rate_and_turns_at_its_own():
    """c(t) = c(0) e^{imct} e^{−(ν(l(l+1) − 2) + α)t}, c = 2Ω/(l(l+1)): its size to round-off, its angle to order h²."""
    l, m = 2, 1
    fluid = fluids.euler(3, rotation=OMEGA)
    start = fluids.start(fluid, fluids.rossby_haurwitz(l, m, 0.5))
    decay, errors = np.exp(-NU * (l * (l + 1) - 2) - ALPHA), []
    for steps in (2, 4):
        final = path(fluid, start, steps, fluids.DampedMidpoint(viscosity=NU, drag=ALPHA))
        found = fluids.vorticity(fluid, final)[l, m] / 0.5
        assert np.sum(fluids.power_spectrum(fluids.vorticity(fluid, final))) == pytest.approx(0.5 * decay**2, rel=1e-2)
        errors.append(abs(found - np.exp(1j * m * 2 * OMEGA / (l * (l + 1))) * decay))
    assert errors[1] < 4e-3 and np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.1)


@pytest.mark.long
def test_without_rotation_a_wave_decays_to_round_off_whatever_the_step():
    fluid = fluids.euler(6)
    c = fluids.rossby_haurwitz(3, 2, 0.4 + 0.1j)
    final = path(fluid, fluids.start(fluid, c), 2, fluids.DampedMidpoint(viscosity=NU, drag=ALPHA), 3.0)
    found = fluids.vorticity(fluid, final)
    np.testing.assert_allclose(found[:4, :4], c * np.exp(-3 * (10 * NU + ALPHA)), atol=1e-15)
    assert np.max(np.abs(found[4:])) < 1e-15


@pytest.mark.long
def test_stirring_turns_a_sphere_up_to_where_drag_holds_it():
    """c_10 → f_10/α without viscosity, which a solid rotation does not feel; of ν alone it grows as f t."""
    fluid, f = fluids.euler(3), np.zeros((2, 2))
    f[1, 0] = 0.3
    start = fluids.start(fluid, np.zeros((2, 2)))
    for drag, expected in ((ALPHA, 0.3 * (1 - np.exp(-ALPHA)) / ALPHA), (0.0, 0.3)):
        final = path(fluid, start, 3, fluids.DampedMidpoint(viscosity=NU, drag=drag, stirring=f))
        c = fluids.vorticity(fluid, final)
        assert c[1, 0] == pytest.approx(expected, rel=1e-14) and np.sum(np.abs(c)) == pytest.approx(expected)


@pytest.mark.long
def test_a_turbulent_decay_is_of_order_2_and_loses_energy():
    fluid = fluids.euler(8, rotation=0.3)
    start = fluids.start(fluid, fluids.random_vorticity(5, degree=6))
    method = fluids.DampedMidpoint(viscosity=NU, drag=0.05, stirring=0.2 * fluids.random_vorticity(6, degree=3))
    ends = [path(fluid, start, n, method).mu for n in (5, 10, 20)]
    first, second = (np.max(np.abs(a - b)) for a, b in pairwise(ends))
    assert np.log2(first / second) == pytest.approx(2, abs=0.1)
    method = fluids.DampedMidpoint(viscosity=NU)
    run = co.simulate(fluid, start, dt=0.05, steps=20, method=method, accuracy=False)
    assert np.all(np.diff(run.dataset.kinetic_energy.values) < 0) and np.all(np.diff(run.dataset.enstrophy.values) < 0)
    assert run.largest("balance") < 1e-13 and "viscosity=0.03" in str(run)
    assert run.relative_change("energy") > 0.1 and not run.warnings


@pytest.mark.long
def test_without_damping_it_is_the_isospectral_step_and_gradients_go_through():
    fluid = fluids.euler(4)
    start = fluids.start(fluid, fluids.random_vorticity(5, degree=3))
    plain, damped = (path(fluid, start, 3, m).mu for m in (co.IsospectralMidpoint(), fluids.DampedMidpoint()))
    np.testing.assert_array_equal(plain, damped)
    method = fluids.DampedMidpoint(viscosity=NU)

    def value(e):
        return path(fluid, start.replace(mu=start.mu * (1 + e)), 3, method).mu[3]

    with co.float64():
        slope = float(jax.grad(value)(0.0))
    assert slope == pytest.approx(float(value(1e-5) - value(-1e-5)) / 2e-5, rel=1e-8)


@pytest.mark.long
@pytest.mark.parametrize("stirred", [False, True])
def test_a_solid_rotation_of_a_sphere_that_turns_decays_by_drag_alone(stirred):
    """ω = 2α cos ϑ on a sphere that turns with Ω feels drag, not Ω: α(t) = α(0) e^{−αt}; with stirring of 0 as well."""
    fluid, c = fluids.euler(5, rotation=OMEGA), np.zeros((2, 2))
    c[1, 0] = 0.4
    method = fluids.DampedMidpoint(drag=ALPHA, stirring=np.zeros((2, 2)) if stirred else None)
    found = fluids.vorticity(fluid, path(fluid, fluids.start(fluid, c), 3, method, 2.0))
    assert found[1, 0] == pytest.approx(0.4 * np.exp(-2 * ALPHA), rel=1e-14)
    assert not method.claims.symplectic and not method.claims.momentum
    assert co.IsospectralMidpoint().claims.symplectic and co.IsospectralMidpoint().claims.momentum


def test_compositions_with_substeps_backwards_are_refused_where_viscosity_damps_and_there_alone():
    """The highest degree of N = 8 decays at ν(7·8 − 2) + α."""
    fluid = fluids.euler(8)
    start = fluids.start(fluid, fluids.rossby_haurwitz(degree=3, order=2, amplitude=0.4))
    damped = fluids.DampedMidpoint(viscosity=NU, drag=ALPHA)
    rate = NU * 54 + ALPHA
    with pytest.raises(ArgumentError, match=f"go backwards, by 0.329 s, and it damps, at rates up to {rate:.3g}/s"):
        co.simulate(fluid, start, dt=0.5, steps=2, method=co.Suzuki4(damped))
    allowed = co.Suzuki4(damped, negative_substeps="allow")
    assert require_forward(fluid, allowed, start, 0.5) == []
    (warning,) = require_forward(fluid, allowed, start, 1.5)
    assert "damps at rates up to" in warning and "take dt < " in warning
    assert require_forward(fluid, co.Suzuki4(fluids.DampedMidpoint()), start, 0.5) == []


@pytest.mark.long
def test_steps_back_in_time_undo_those_forward_as_far_as_round_off_allows():
    """λ = ν(3·4 − 2) + α = 2.8/s amplifies by 1e8 over 6.6 s, 13 steps of 0.5 s."""
    fluid = fluids.euler(4)
    start = fluids.start(fluid, fluids.rossby_haurwitz(degree=3, order=2, amplitude=0.4))
    damped = fluids.DampedMidpoint(viscosity=0.27, drag=0.1)
    there = co.trajectory(fluid, start, dt=0.5, steps=13, method=damped, backend="xla").final
    back = co.trajectory(fluid, there, dt=-0.5, steps=13, method=damped, backend="xla").final
    assert np.max(np.abs(there.mu - start.mu)) > 0.1
    np.testing.assert_allclose(back.mu, start.mu, atol=1e-6)


def test_steps_back_in_time_that_amplify_round_off_too_much_are_refused():
    fluid = fluids.euler(4)
    start = fluids.start(fluid, fluids.rossby_haurwitz(degree=3, order=2, amplitude=0.4))
    damped = fluids.DampedMidpoint(viscosity=0.27, drag=0.1)
    for h, steps, sentence in (
        (-0.5, 14, r"14 steps of -0\.5 s back in time amplify round-off by 1e9: take at most 13 steps"),
        (-50.0, 1, r"1 steps of -50 s .* by 1e61: take \|dt\| < 6\.58 s"),
    ):
        with pytest.raises(ArgumentError, match=sentence):
            co.trajectory(fluid, start, dt=h, steps=steps, method=damped)


def test_numbers_of_numpy_are_numbers():
    viscosity: Any = np.float64(0.5)
    drag: Any = np.int64(1)
    assert fluids.DampedMidpoint(viscosity=viscosity, drag=drag) == fluids.DampedMidpoint(viscosity=0.5, drag=1.0)


def test_what_is_no_damping_is_refused(monkeypatch):
    monkeypatch.setattr("coadjoint.models.fluids.damping.LARGEST", 8 * 50**3)
    text: Any = "much"
    for call, sentence in (
        (lambda: fluids.DampedMidpoint(viscosity=-1.0), "`viscosity` must be a finite number from 0, but is -1"),
        (lambda: fluids.DampedMidpoint(drag=text), "`drag` must be a finite number from 0, but is 'much'"),
        (lambda: fluids.DampedMidpoint(stirring=np.eye(2)), r"`stirring` must be c_lm, \(L, L\), with c_00 = 0"),
        (
            lambda: fluids.DampedMidpoint(viscosity=NU).require_fit(fluids.euler(60)),
            r"at N = 60 would take 0.00173 GB: take N up to 50, or drag alone",
        ),
        (
            lambda: fluids.DampedMidpoint().require_fit(co.System(co.Un(3), hamiltonian=lambda mu: mu @ mu)),
            "must be a fluid of co.models.fluids",
        ),
    ):
        with pytest.raises(ArgumentError, match=sentence):
            call()
