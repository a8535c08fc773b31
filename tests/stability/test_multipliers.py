"""Modes of steady motions under the steps of a method: kept on the unit circle, and right to the method's order."""

from __future__ import annotations

from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import coadjoint as co
import coadjoint_vehicles as vehicles
from coadjoint.errors import ArgumentError, LagrangianError
from coadjoint.models import rigid_body
from coadjoint.models.paper_form import start
from coadjoint.stability import integrals, steady_motion, step_modes
from coadjoint.stability.multipliers import StepModes
from coadjoint.stability.reduced import Reduced
from coadjoint_vehicles.hydrodynamics import ellipsoid
from coadjoint_vehicles.trim import SteadyFlight


@pytest.mark.long
def test_symplectic_steps_keep_the_modes_of_a_stable_conservative_motion_on_the_unit_circle():
    body = ellipsoid(semi_axes=(0.3, 0.5, 1.0), center_of_mass=(0, 0, 0.02))
    motion = steady_motion(body, start(body, velocity=(0, 0, 0.4)))
    found = step_modes(motion, 0.2)
    np.testing.assert_allclose(np.abs(found.multipliers), 1, atol=1e-13)
    assert np.max(np.abs(found.effective - found.eigenvalues)) < 0.01


@pytest.fixture(scope="module")
def remus():
    return SteadyFlight(vehicles.load("remus_100")).at(1.5)


def test_the_frequency_of_a_free_body_under_steps_is_right_to_second_order():
    """The left rectangle keeps |m| = 1 as the midpoint does."""
    body = rigid_body.make(inertia=(1.0, 2.0, 3.0))
    motion = steady_motion(body, rigid_body.start(body, angular_velocity=(0, 0, 1.0)))
    found = [step_modes(motion, h, co.LeftRectangle()) for h in (0.2, 0.1)]
    coarse, fine = (np.abs(one.effective.imag[0]) - 1.0 for one in found)
    assert coarse / fine == pytest.approx(4.0, rel=0.1)
    for one in found:
        assert np.abs(one.multipliers) == pytest.approx([1.0, 1.0], abs=1e-12) and abs(one.damping) < 1e-11
        assert one.excitation == pytest.approx(-one.damping, abs=1e-12)


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize(("method", "order"), [(co.Midpoint(), 2), (co.LeftRectangle(), 1)])
def test_frequencies_under_steps_are_right_to_the_order_of_the_method(method, order, remus):
    off = [step_modes(remus, h, method) for h in (0.04, 0.02)]
    first, last = (np.max(np.abs(one.effective - one.eigenvalues)) for one in off)
    assert np.log2(first / last) == pytest.approx(order, abs=0.2)
    # The midpoint rule damps roll less than the equations do; the left rectangle damps every mode less.
    assert off[0].excitation > 0.01


def test_steps_excite_and_damp_by_the_largest_differences_of_the_rates():
    modes = StepModes(0.1, np.array([-1 + 2j, 0.5j]), np.ones(2, complex), np.array([-1.2 + 3j, 0.1 + 0.5j]))
    assert (modes.excitation, modes.damping) == pytest.approx((0.1, 0.2), abs=1e-15)


def test_a_step_size_must_be_positive():
    body = rigid_body.make(inertia=(1.0, 2.0, 3.0))
    motion = steady_motion(body, rigid_body.start(body, angular_velocity=(0, 0, 1.0)))
    with pytest.raises(ArgumentError, match="dt"):
        step_modes(motion, -0.1)


def test_a_motion_that_a_symmetry_carries_has_no_modes_under_steps():
    """Steps do not bring it back to where it was: its multipliers would be those of another motion."""
    body = rigid_body.make(inertia=(1.0, 1.0, 3.0))
    guess = rigid_body.start(body, angular_velocity=(0.3, 0, 1.0))
    with pytest.raises(ArgumentError, match="without symmetries"):
        step_modes(steady_motion(body, guess, symmetries=[lambda s: s.mu[2]]), 0.1)


@pytest.mark.parametrize(
    ("slope", "says"),
    [
        ([0.0, 0.0, 1.0], None),
        ([1.0, 0.0, 1.0], "`C`, integral 1 of those given, is not an integral of the motion: it changes along the"),
        ([0.0, 1.0, 0.0], "it depends on ignorable variables"),
    ],
)
def test_an_integral_stays_along_the_motion_and_along_ignorable_variables_that_are_reached(monkeypatch, slope, says):
    """ẏ = 2e₁, e₂ is ignorable, and so is e₄, which no coordinate reaches."""

    def C(state):
        return 0.0

    y_z, rate = np.eye(4)[:, :3], 2 * np.eye(4)[0]
    monkeypatch.setattr(integrals, "tabulate", lambda *_: lambda state: (np.array([slope]), y_z, rate))
    scales = SimpleNamespace(z=np.ones(3), y=np.ones(4))
    reduced: Any = SimpleNamespace(
        sizes=[3], symmetries=(), near=None, around=[None], scales=scales, ignorable=np.eye(4)[:, [1, 3]]
    )
    with nullcontext() if says is None else pytest.raises(ArgumentError, match=says):
        integrals.require_conserved(reduced, [C])


@pytest.mark.parametrize("where", range(3))
def test_slopes_of_a_motion_that_are_not_finite_are_told(where):
    parts = [np.zeros(2), np.eye(2), np.eye(2)]
    reduced: Any = SimpleNamespace(_tabulated=lambda state: ((np.ones(2), parts[0]), (parts[1], parts[2])))
    assert Reduced.slopes(reduced, None).y_z is parts[1]  # type: ignore[arg-type]
    parts[where] = parts[where] * np.nan
    with pytest.raises(LagrangianError, match="are not finite at the motion"):
        Reduced.slopes(reduced, None)  # type: ignore[arg-type]
