"""τ⁻¹ of every difference map on every group that it fits (P38), and its derivative (Definition 5)."""

from __future__ import annotations

import jax
import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import GroupError
from coadjoint.kernels.trace.evaluate import evaluate
from systems import GROUPS, MAPS, generator

UNFIT_PAIRS = {(group, tau) for group in ("SLn3", "SUn3") for tau in ("cayley", "squared", "bent", "pade")}
PAIRS = [(group, tau) for group in GROUPS for tau in MAPS if (group, tau) not in UNFIT_PAIRS]
EXPENSIVE = {"SO3xSE2", "SOn4", "SLn3", "SUn3", "Sp2", "SL2_dual", "nested"}
"""Groups of dimension 5 to 10, on which Newton's iteration runs in the long tests."""
ITERATED = {"bent", "pade", "second kind"}


def _marked(group: str, tau: str):
    return pytest.param((group, tau), marks=[pytest.mark.long] if group in EXPENSIVE and tau in ITERATED else [])


@pytest.fixture(params=[_marked(*names) for names in PAIRS], ids="-".join)
def pair(request):
    """(τ, group, ξ, χ), ξ well inside the chart."""
    group, tau = GROUPS[request.param[0]], MAPS[request.param[1]]
    xi, chi = generator("inverse", *request.param).normal(size=(2, group.dim))
    return tau, group, xi / np.linalg.norm(xi), chi


@pytest.mark.cases(4)
def test_it_undoes_the_map(pair):
    tau, group, xi, _ = pair
    for part in (1e-8, 1.0):
        found = tau.inverse(group, evaluate(lambda x: tau.tau(group, x), part * xi))
        assert np.max(np.abs(found - part * xi)) < 3e-14


@pytest.mark.cases(4)
def test_its_derivative_is_the_inverse_tangent(pair):
    """Dτ⁻¹(τ(ξ))·(χ̂τ(ξ)) = dτ⁻¹_ξ χ (P34)."""
    tau, group, xi, chi = pair

    def both(xi, chi):
        F = tau.tau(group, xi)
        moved = jax.jvp(lambda t: tau.inverse(group, group.compose(group.exp(t * chi), F)), (0.0,), (1.0,))[1]
        return moved, tau.dtau_inverse(group, xi, chi)

    found, expected = evaluate(both, xi, chi)
    np.testing.assert_allclose(found, expected, rtol=0, atol=2e-12 * max(1.0, np.max(np.abs(expected))))


def test_its_sign_changes_with_the_inverse_of_the_element():
    tau, group = co.difference_maps.Pade(2), co.SE3()
    g = evaluate(lambda x: tau.tau(group, x), np.array([0.5, -1.0, 0.3, 1.0, 0.2, -0.4]))
    back = evaluate(group.inverse, g)
    np.testing.assert_allclose(tau.inverse(group, back), -tau.inverse(group, g), rtol=0, atol=1e-14)


@pytest.mark.cases(3)
@pytest.mark.parametrize(
    "tau", [co.Cayley(), co.difference_maps.Squared(co.Cayley()), co.difference_maps.Pade(2)], ids=repr
)
@pytest.mark.parametrize("angle", [0.0, 0.9272, 0.9273, 3.1])
def test_two_derivatives_are_right_with_a_unit_translation_up_to_the_branch(tau, angle):
    """τ⁻¹(τ(ξ + tη)) is ξ + tη, for ξ with τ(ξ) of this angle."""
    group = co.SE3()
    n, eta = np.array([2.0, -1.0, 2.0]) / 3, np.sin(np.arange(1.0, 7.0))
    xi = np.array([*tau.inverse(co.SO3(), co.attitude.from_rotation_vector(angle * n)), 0.6, 0.0, 0.8])

    def slope(t):
        return jax.jvp(lambda t: tau.inverse(group, tau.tau(group, xi + t * eta)), (t,), (1.0,))

    (value, first), (_, second) = evaluate(lambda t: jax.jvp(slope, (t,), (1.0,)), np.float64(0.0))
    size = 1 + np.linalg.norm(xi) ** 2
    np.testing.assert_allclose(value, xi, rtol=0, atol=1e-15 * size)
    np.testing.assert_allclose(first, eta, rtol=0, atol=1e-14 * size)
    np.testing.assert_allclose(second, np.zeros(6), rtol=0, atol=1e-13 * size)


@pytest.mark.parametrize("tau", [co.Cayley(), co.difference_maps.Pade(3)], ids=repr)
def test_an_element_outside_the_image_raises_one_sentence(tau):
    """Cayley's map reaches no half turn; in SO(4) none is on the principal branch."""
    group, g = (co.SO3(), np.diag([1.0, -1.0, -1.0])) if tau == co.Cayley() else (co.SOn(4), -np.eye(4))
    with pytest.raises(GroupError) as caught:
        tau.inverse(group, g)
    assert f"is outside the image of {tau!r}" in str(caught.value) and "\n" not in str(caught.value)


def test_half_a_turn_is_reached_by_the_squared_map():
    """τ₂ of SO(3) is Cayley's transform of SU(2): |ξ| = 4 at half a turn."""
    xi = co.difference_maps.Squared(co.Cayley()).inverse(co.SO3(), np.diag([-1.0, 1.0, -1.0]))
    np.testing.assert_allclose(xi, [0.0, 4.0, 0.0], rtol=0, atol=1e-14)


def test_the_velocity_of_a_step_is_that_of_its_increment():
    """(P38): ξ_k = τ⁻¹(g_k⁻¹g_{k+1})/h."""
    system = co.System(co.SO3(), lambda xi: 0.5 * xi @ (np.array([1.0, 2.0, 3.0]) * xi))
    run = co.simulate(
        system, system.state(xi=[0.3, 1.0, -0.4]), dt=0.1, steps=3, method=co.LeftRectangle(co.Cayley()), monitors=False
    )
    R = run.records.g
    for k in range(3):
        xi = co.Cayley().inverse(co.SO3(), R[k].T @ R[k + 1]) / 0.1
        np.testing.assert_allclose(xi, run.records.xi[k], rtol=0, atol=1e-13)
