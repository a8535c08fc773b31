"""Shadow energies stay where the energy oscillates, and are refused where nothing is conserved."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import ArgumentError
from coadjoint.theory import shadow_energy

INERTIA = np.diag([1.0, 2.0, 1.5])
TOP = co.System(co.SO3(), lambda xi, a: 0.5 * xi @ INERTIA @ xi - a[2] - 0.5 * a[0], advected=co.Defining(), name="top")
MIDPOINT = co.Midpoint()
START = TOP.state(xi=[0.3, 0.5, 1.0], a0=[0.2, 0, 1])


@pytest.mark.parametrize(
    "method", [co.methods.Yoshida4(co.Midpoint()), pytest.param(co.Midpoint(), marks=pytest.mark.long)]
)
def test_a_harmonic_oscillator_keeps_its_shadow_energy_of_the_closed_form(method):
    """A step turns by the sum φ of 2 arctan(γh/2) over substeps γh: H̃ = Hφ/h for H = ½(p² + q²)."""
    oscillator = co.System(
        co.Translation(0), lambda xi, n, nu: 0.5 * nu @ nu - 0.5 * n @ n, additional=co.Trivial(1), name="oscillator"
    )
    h = 0.1
    run = co.simulate(oscillator, oscillator.state(q=[1.0], qdot=[0.3]), dt=h, steps=13, method=method)
    found = shadow_energy(run, points=13)
    phi = sum(2 * np.arctan(0.5 * fraction * h) for _, fraction in method.stages)
    np.testing.assert_allclose(found.values, 0.5 * 1.09 * phi / h, rtol=1e-11)
    np.testing.assert_allclose(found.t, h * np.array([6, 7]), rtol=1e-14)


@pytest.mark.long
@pytest.mark.parametrize("rule", [co.Midpoint, co.Trapezoidal, co.LeftRectangle, co.Simpson])
def test_the_shadow_energy_of_a_top_stays_where_its_energy_oscillates(rule):
    run = co.simulate(TOP, START, dt=0.02, duration=10, method=rule())
    assert run.relative_change("energy") > 1e-4
    assert shadow_energy(run).relative_change < 1e-10
    assert shadow_energy(run, points=13).relative_change < 1e-13


@pytest.mark.long
@pytest.mark.parametrize(
    ("method", "most", "shadow"),
    [
        (co.methods.LeftRight(), 5e-5, 1e-13),
        (co.Suzuki4(co.Trapezoidal()), 1e-9, 1e-13),
    ],
)
def test_the_shadow_energy_of_a_composition_stays(method, most, shadow):
    run = co.simulate(TOP, START, dt=0.02, duration=10, method=method)
    assert run.relative_change("energy") > most
    assert shadow_energy(run, points=13).relative_change < shadow


@pytest.mark.long
def test_its_change_falls_with_the_order_of_the_polynomial_on_a_space_beside_the_group():
    body = co.System(
        co.SE3(),
        lambda xi, n, nu: 0.5 * xi @ xi + 0.5 * nu @ nu * (1 + 0.1 * xi[0] ** 2) - 0.3 * n @ n,
        additional=co.spaces.Points(),
    )
    start = body.state(q=[1, 0.2, 0.3], qdot=[0, 0.5, 0.2], xi=[0.3, 0.2, 0.1, 0.2, 0.1, 0.3])
    runs = [co.simulate(body, start, dt=h, duration=4) for h in (0.1, 0.05)]
    coarse, fine = (shadow_energy(run, points=7).relative_change for run in runs)
    assert 5.5 < np.log2(coarse / fine) < 7.5


def run_of(system: co.System = TOP, method: Any = MIDPOINT, nodes: int = 13) -> Any:
    """What is looked at of a run before any number is computed."""
    records = SimpleNamespace(t=0.1 * np.arange(nodes))
    return SimpleNamespace(plan=SimpleNamespace(save_every=1), dt=0.1, records=records, system=system, method=method)


def body(**given: Any) -> co.System:
    return co.System(co.SO3(), given.pop("lagrangian", lambda xi: 0.5 * xi @ xi), **given)


DRIVEN = {
    "forces": body(forces={"drag": lambda motion: co.Force(torque=-0.1 * motion.xi)}),
    "internal": body(internal=lambda motion, h: {"x": 0.0}),
    "constraints": body(constraints={"axis": co.Nonholonomic(lambda: [0.0, 0.0, 1.0])}),
    "time": body(lagrangian=lambda xi, *, t: 0.5 * xi @ xi * (1 + t * t)),
}


@pytest.mark.parametrize("system", DRIVEN.values(), ids=DRIVEN)
def test_a_system_that_does_not_conserve_energy_has_no_shadow_energy(system):
    with pytest.raises(ArgumentError, match="a motion that conserves energy"):
        shadow_energy(run_of(system))


@pytest.mark.parametrize(
    ("run", "points", "says"),
    [
        (3, 9, "must be a run of co.simulate"),
        (run_of(), 4, "`points` must be odd"),
        (run_of(), 13, "needs 14 records: 13 are few"),
        (run_of(method=co.EnergyMomentum()), 9, "one discrete Lagrangian a substep, which EnergyMomentum"),
    ],
)
def test_other_runs_and_methods_raise(run, points, says):
    with pytest.raises(ArgumentError, match=says):
        shadow_energy(run, points=points)
