"""Integrable systems against elliptic functions and closed forms, and what long runs keep of their integrals."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.special import ellipj

import coadjoint as co
from coadjoint.models import catalogue
from coadjoint.models.catalogue_entries import INTEGRABLE

METHODS = [co.LeftRectangle(co.Exponential()), co.Midpoint(co.Cayley()), co.Trapezoidal(co.Cayley())]


def nutation(roots: np.ndarray, strength: float, t: np.ndarray) -> np.ndarray:
    """u with u̇² = strength (u − u₁)(u − u₂)(u − u₃), u₁ ≤ u ≤ u₂ < u₃, from u(0) = u₁: by Jacobi's sn."""
    first, second, third = roots
    sn, *_ = ellipj(0.5 * np.sqrt(strength * (third - first)) * t, (second - first) / (third - first))
    return first + (second - first) * sn**2


class LagrangeTop:
    """Started at rest in θ, at the lower turning point: u = cos θ = a₃."""

    name, duration = "lagrange_top", 1.0
    inertia, axial, torque = 0.02, 0.01, 9.81 * 0.1

    def __init__(self):
        entry = catalogue[self.name]
        tilt, precession, spin = 1.1, 4.0, 30.0
        self.system = entry.make()
        self.start = entry.start(self.system, euler_zxz=(0.0, tilt, 0.0), euler_rates=(precession, 0.0, spin))

    def observed(self, records: co.State) -> np.ndarray:
        return records.a[:, 2]

    def exact(self, t: np.ndarray) -> np.ndarray:
        """u̇² = ((2E − p₃²/I₃ − 2τu)(1 − u²) − (p − p₃u)²/I₁)/I₁, p = μ·a, p₃ = μ₃."""
        s, inertia = self.start, self.inertia
        p, axial = s.mu @ s.a, s.mu[2]
        energy = s.mu @ s.xi + 2 * self.torque * s.a[2] - axial**2 / self.axial
        u = np.polynomial.Polynomial([0, 1])
        cubic = ((energy - 2 * self.torque * u) * (1 - u**2) - (p - axial * u) ** 2 / inertia) / inertia
        roots = np.sort(np.real(cubic.roots()))
        assert np.min(np.abs(roots - s.a[2])) <= 1e-12
        if abs(roots[0] - s.a[2]) > abs(roots[1] - s.a[2]):
            half = half_period(roots, 2 * self.torque / inertia)
            return nutation(roots, 2 * self.torque / inertia, t + half)
        return nutation(roots, 2 * self.torque / inertia, t)


def half_period(roots: np.ndarray, strength: float) -> float:
    """The time from u₁ to u₂."""
    from scipy.special import ellipk

    first, second, third = roots
    return float(2 * ellipk((second - first) / (third - first)) / np.sqrt(strength * (third - first)))


class SphericalPendulum:
    """Pushed sideways from below: z = q·e_z from its lower turning point."""

    name, duration, gravity = "spherical_pendulum", 2.0, 9.81

    def __init__(self):
        entry = catalogue[self.name]
        self.system = entry.make(mass=0.7, length=1.0)
        self.start = entry.start(self.system, bob=(0.6, 0.0, -0.8), bob_velocity=(0.0, 3.0, 0.0))

    def observed(self, records: co.State) -> np.ndarray:
        return np.sum(records.n * records.a, axis=1)

    def exact(self, t: np.ndarray) -> np.ndarray:
        """ż² = (v₀² + 2g(z₀ − z))(1 − z²) − (q × q̇)₃², l = 1."""
        z = np.polynomial.Polynomial([0, 1])
        cubic = (9.0 + 2 * self.gravity * (-0.8 - z)) * (1 - z**2) - (0.6 * 3.0) ** 2
        roots = np.sort(np.real(cubic.roots()))
        assert abs(roots[0] + 0.8) <= 1e-12
        return nutation(roots, 2 * self.gravity, t)


@pytest.mark.cases(1)
@pytest.mark.parametrize("problem", [LagrangeTop(), SphericalPendulum()], ids=lambda p: p.name)
@pytest.mark.parametrize("method", METHODS, ids=lambda m: m.title)
def test_nutation_converges_to_its_elliptic_function(problem, method):
    errors = []
    for steps in (500, 1000, 2000):
        run = co.simulate(
            problem.system, problem.start, dt=problem.duration / steps, steps=steps, method=method, monitors=False
        )
        exact = problem.exact(run.steps_saved * run.dt)
        errors.append(np.max(np.abs(problem.observed(run.records) - exact)) / np.ptp(exact))
    print(f"{problem.name}, {method.title}: {errors}")
    assert errors[-1] <= {1: 0.05, 2: 1e-3}[method.order]
    assert abs(np.log2(errors[-2] / errors[-1]) - method.order) <= 0.15


def test_a_rotor_makes_the_turn_about_the_middle_axis_stable():
    """(J₂ − J₁)ω + π and (J₂ − J₃)ω + π have one sign where π > (J₃ − J₂)ω; else the axis tumbles."""
    entry = catalogue["rigid_body_with_rotor"]
    tilts = {}
    for rate in (0.0, 30.0):
        body = entry.make()
        run = co.simulate(body, entry.start(body, rotor_rate=rate), dt=0.05, duration=200.0, monitors=False)
        tilts[rate] = np.min(run.records.xi[:, 1])
    assert tilts[0.0] < 0 and tilts[30.0] > 0.99


EXACT = {
    "lagrange_top": ["kelvin_noether", "axial_momentum"],
    "kovalevskaya_top": ["kelvin_noether"],
    "goryachev_chaplygin_top": ["vertical_momentum"],
    "rigid_body_with_rotor": ["kelvin_noether", "momentum_squared"],
    "spherical_pendulum": ["kelvin_noether", "pendulum_momentum"],
    "clebsch_body": ["kelvin_noether", "linear_casimir", "angular_casimir"],
    "manakov_body": ["trace_2_0", "trace_4_0"],
}
BOUNDED = {
    "kovalevskaya_top": ["energy", "kovalevskaya_integral"],
    "goryachev_chaplygin_top": ["energy", "chaplygin_integral"],
    "clebsch_body": ["energy", "clebsch_integral"],
    "manakov_body": ["energy", "trace_3_1", "trace_4_2"],
}


def reach(run) -> float:
    """How far a body on SE(3) has gone, m: what round-off in its moment x × RP + RΠ is relative to."""
    return float(np.max(np.abs(run.records.g[1]))) if isinstance(run.records.g, tuple) else 0.0


@pytest.mark.cases(1)
@pytest.mark.parametrize("entry", INTEGRABLE, ids=lambda e: e.name)
def test_casimirs_and_momenta_are_exact_and_the_other_integrals_bounded_without_drift(entry):
    """10⁵ steps: the mean over the last tenth is that over the first within a tenth of the band, the band is O(h²)."""
    system = entry.make()
    bands = []
    for h, steps in ((entry.dt, 100_000), (0.5 * entry.dt, 200_000)):
        run = co.simulate(system, entry.start(system), dt=h, steps=steps, save_every=10)
        for name in EXACT[entry.name]:
            print(f"{entry.name}: {name} changes by {run.relative_change(name):.1e}")
            assert run.relative_change(name) <= 1e-12 * (1 + reach(run)), name
        watched = [np.asarray(run.dataset[name]) for name in BOUNDED.get(entry.name, ["energy"])]
        for values in watched:
            tenth = len(values) // 10
            assert abs(values[-tenth:].mean() - values[:tenth].mean()) <= 0.1 * np.ptp(values)
        bands.append([np.ptp(values) for values in watched])
    print(f"{entry.name}: bands {bands[0]}, at half the step {bands[1]}")
    for whole, half in zip(*bands, strict=True):
        assert 3.5 <= whole / half <= 4.5


def test_the_integral_of_another_top_is_none_so_that_the_tests_can_fail():
    """Kovalevskaya's K on a top with J = diag(2, 2, 1.2)C wanders by more than a tenth."""
    from coadjoint.models import heavy_top
    from coadjoint.models.integrable_tops import kovalevskaya_integral

    top = heavy_top.make(mass=1.0, center_of_mass=(0.1, 0, 0), inertia=(0.2, 0.2, 0.12), gravity=10.0)
    start = heavy_top.start(top, euler_zxz=(0.0, 0.8, 0.3), angular_velocity=(1.0, 0.5, 2.0))
    run = co.simulate(top.watching({"K": kovalevskaya_integral}), start, dt=0.005, steps=20_000, save_every=100)
    assert run.relative_change("K") > 0.1


def test_clebschs_condition_is_what_the_fourth_integral_needs():
    """A Kirchhoff body with another third mass does not keep it."""
    from coadjoint.models import kirchhoff

    entry = catalogue["clebsch_body"]
    good = entry.make()
    p: Any = good.parameters
    other = kirchhoff.body(inertia=p.inertia, mass=np.diag(p.mass) * [1, 1, 1.3])
    other = other.watching({"clebsch_integral": kirchhoff.clebsch_integral})
    run = co.simulate(other, entry.start(other), dt=0.02, steps=10_000, save_every=100)
    assert run.relative_change("clebsch_integral") > 1e-2
    with pytest.raises(co.errors.ArgumentError, match="m₃ > 0"):
        entry.make(inertia=(1.0, 1.1, 5.0), mass=(1.0, 3.0))
