"""The paper's misprints: as printed they fail, corrected they pass; and the left rule is the paper's scheme."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate
from paper import FAST, VELOCITY, Cayley, Exponential, M, run, vehicle
from stepping import Stepper
from systems import generator


def differentiated(scheme, omega, h):
    return evaluate(jax.jacfwd(lambda w: scheme.f(w, h, jnp)), omega)


@pytest.fixture
def omega():
    return generator("misprints").normal(size=3)


def test_jacobian_of_the_cayley_scheme(omega):
    scheme, expected = Cayley(), differentiated(Cayley(), omega, 0.3)
    np.testing.assert_allclose(scheme.jacobian(omega, 0.3), expected, rtol=0, atol=1e-14 * np.max(np.abs(expected)))
    assert np.max(np.abs(scheme.jacobian(omega, 0.3, printed=True) - expected)) > 1e-3


def test_jacobian_of_the_exponential_scheme(omega):
    scheme, expected = Exponential(), differentiated(Exponential(), omega, 0.3)
    size = np.max(np.abs(expected))
    np.testing.assert_allclose(scheme.jacobian(omega, 0.3), expected, rtol=0, atol=1e-14 * size)
    assert np.max(np.abs(scheme.jacobian(omega, 0.3, transposed=True) - expected)) > 1e-5
    assert np.max(np.abs(scheme.jacobian(omega, 0.3, without_h=True) - expected)) > 1e-5


@pytest.mark.long
def test_printed_argument_of_alpha_destroys_the_kelvin_noether_quantity():
    """Relative drift over 20 s: 1e-4, 2.4e-5, 6e-6 at h = 0.1, 0.05, 0.025 as printed; ≤ 4e-13 at θ = h‖ω‖."""
    for h, expected in ((0.1, 1e-4), (0.05, 2.4e-5), (0.025, 6e-6)):
        steps = round(20 / h)
        printed, _ = run(Exponential(printed=True), FAST, h, steps)
        corrected, _ = run(Exponential(), FAST, h, steps)
        drift, kept = (np.max(np.abs(x / x[0] - 1)) for x in (printed, corrected))
        assert drift == pytest.approx(expected, rel=0.25)
        assert kept <= 4e-13


@pytest.mark.cases(1)
@pytest.mark.parametrize("scheme", [Cayley(), Exponential()], ids=lambda s: s.name)
def test_left_rule_with_velocity_start_is_the_paper_s_scheme(scheme):
    """(P73), (P74) step by step; after 40 steps of 0.05 s round-off has grown by the fast rotation."""
    tau = {"cayley": co.Cayley(), "exponential": co.Exponential()}[scheme.name]
    system = vehicle()
    start = system.state(q=[0, 0, 1], xi=FAST, qdot=VELOCITY, a0=[0, 0, 1])
    leaps = Stepper(system, co.LeftRectangle(tau, start="velocity"), compiled=True).run(start, 0.05, 41)
    _, (g, n, omega, nu) = run(scheme, FAST, 0.05, 40)
    last = leaps[40].record
    for found, expected in ((last.g, g), (last.n, n), (last.xi, omega), (last.nu, nu)):
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * (1 + np.max(np.abs(expected))))


SLOW, FAR = np.radians([10.0, 0.0, 20.0]), np.array([270.0, 135.0, 270.0])


@pytest.mark.long
def test_s_as_the_unknown_loses_the_kelvin_noether_quantity_far_from_the_origin():
    """s = n + hν keeps ν to |n| 1e-16/h only; relative to |Mν||n|, 3000 steps of 0.01 s with |n| ≈ 400 m."""
    scale = np.linalg.norm(M @ VELOCITY) * np.linalg.norm(FAR)
    drifts = {}
    for through_s in (False, True):
        values, _ = run(Cayley(), SLOW, 0.01, 3000, FAR, through_s)
        drifts[through_s] = np.max(np.abs(values - values[0])) / scale
    assert drifts[False] <= 3e-15
    assert drifts[True] >= 1e-12

    system = vehicle()
    start = system.state(q=FAR, xi=SLOW, qdot=VELOCITY, a0=[0, 0, 1])
    stepper = Stepper(system, co.LeftRectangle(co.Cayley(), start="velocity"), compiled=True)
    momentum = [s.a @ (s.mu - np.cross(s.pi, s.n)) for s in (leap.record for leap in stepper.run(start, 0.01, 3000))]
    assert np.max(np.abs(np.array(momentum) - momentum[0])) <= 3e-15 * scale
