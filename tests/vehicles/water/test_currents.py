"""Bodies in currents that change: closed forms of the force on a sphere, the order kept, the energy budget."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import coadjoint as co
from coadjoint.kernels.trace.evaluate import tabulate
from coadjoint_vehicles import Craft, Vehicle
from coadjoint_vehicles.parts import Damping
from coadjoint_vehicles.water import (
    CurrentField,
    CurrentTable,
    GaussMarkovCurrent,
    LinearDensity,
    LinearShear,
    PowerLaw,
    Sea,
    Sheared,
    TidalCurrent,
    TimeCurrent,
    UniformWater,
)

RADIUS, DENSITY = 0.5, 1000.0
VOLUME = 4 / 3 * np.pi * RADIUS**3
DISPLACED = DENSITY * VOLUME
C_M = 0.5
"""The added-mass coefficient of a sphere, and its coefficient of lift in weak shear (Auton 1987)."""


def sphere(heaviness: float, **changes: Any) -> Vehicle:
    """A sphere without weight of `heaviness` times the mass of the water that it displaces."""
    given = {
        "name": "sphere",
        "mass": heaviness * DISPLACED,
        "inertia": np.full(3, 0.4 * heaviness * DISPLACED * RADIUS**2),
        "added_mass": [C_M * DISPLACED] * 3 + [0.0] * 3,
        "volume": VOLUME,
        "gravity": 0.0,
        "fluid_density": DENSITY,
    }
    return Vehicle(**{**given, **changes})


def slender(**changes: Any) -> Vehicle:
    """A body with unlike added masses, coupled, and with centres away from the origin."""
    added = np.diag([30.0, 200.0, 150.0, 1.0, 20.0, 30.0])
    added[1, 5] = added[5, 1] = 12.0
    given = {
        "name": "slender",
        "mass": 180.0,
        "inertia": (3.0, 25.0, 26.0),
        "added_mass": added,
        "volume": 0.17,
        "center_of_mass": (0.05, 0.0, 0.03),
        "center_of_buoyancy": (0.08, 0.01, -0.02),
        "fluid_density": DENSITY,
        "parts": (Damping("damping", linear=[5.0, 30.0, 30.0, 2.0, 20.0, 20.0]),),
    }
    return Vehicle(**{**given, **changes})


def moved(craft: Craft, start: Any, dt: float, duration: float, **more: Any) -> Any:
    return co.simulate(craft.system, start, dt=dt, duration=duration, progress=False, **more)


def swinging(t, numpy=jnp):
    """u(t) = 0.3 sin 0.7t + 0.1t, m/s."""
    return 0.3 * numpy.sin(0.7 * t) + 0.1 * t


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("heaviness", [0.05, 1.2, 3.0])
def test_a_sphere_in_accelerated_flow_is_pushed_by_froude_krylov_and_added_mass(heaviness):
    """(m + C_M ρV) ẍ = ρV(1 + C_M) u̇: at rest at first, x = k∫u dt."""
    craft = Craft(sphere(heaviness), water=TimeCurrent(lambda t: swinging(t) * jnp.array([1.0, 0.0, 0.0])))
    k = (1 + C_M) / (heaviness + C_M)

    def gap(dt):
        run = moved(craft, craft.start(), dt, 10.0)
        t = run.dataset.time.values
        exact = k * (0.3 / 0.7 * (1 - np.cos(0.7 * t)) + 0.05 * t**2)
        assert run.summary()["energy_budget_error_max"] < 1e-3
        return np.max(np.abs(run.dataset.q[:, 0].values - exact))

    coarse, fine = gap(0.1), gap(0.05)
    assert fine < 2e-4
    assert np.log2(coarse / fine) == pytest.approx(2, abs=0.05)


@pytest.mark.long
def test_a_body_of_the_waters_own_density_drifts_with_an_accelerated_current():
    """In any position and with any added mass, as it does in a current that stays."""

    def current(t):
        return jnp.stack([jnp.sin(t), 0.5 * jnp.cos(2 * t), 0.1 * t])

    vehicle = slender(mass=170.0, center_of_mass=(0.08, 0.01, -0.02), parts=())
    craft = Craft(vehicle, water=TimeCurrent(current))
    run = moved(craft, craft.start(euler_zyx=(0.5, 0.3, 0.2)), 0.02, 6.0)
    t = run.dataset.time.values
    exact = np.stack([1 - np.cos(t), 0.25 * np.sin(2 * t), 0.05 * t**2], axis=-1)
    np.testing.assert_allclose(run.dataset.q, exact, atol=2e-4)
    np.testing.assert_allclose(run.dataset.xi, 0.0, atol=1e-12)


@pytest.mark.long
def test_a_body_of_the_waters_own_density_goes_round_with_an_eddy():
    """c = Ω × q: where ν = c, ν̇ = Dc/Dt, and there is no lift."""
    spin = 0.3
    eddy = CurrentField(lambda q: spin * jnp.stack([-q[1], q[0], 0.0 * q[2]]))
    craft = Craft(sphere(1.0), water=eddy)
    run = moved(craft, craft.start(position=(2.0, 0.0, 5.0)), 0.02, 20.0)
    t = run.dataset.time.values
    exact = np.stack([2 * np.cos(spin * t), 2 * np.sin(spin * t), 5 + 0 * t], axis=-1)
    np.testing.assert_allclose(run.dataset.q, exact, atol=2e-4)


@pytest.mark.long
def test_a_sphere_in_linear_shear_has_the_lift_coefficient_of_one_half():
    """Auton, Hunt and Prud'homme: (m + C_M ρV) v̇ = C_L ρV (c − v) × ω, C_L = ½, where c·∇c = 0.

    In c = (Γz, 0, 0) with λ = C_L ρV/(m + C_M ρV): ẍ = λΓż, z̈ = λ(1 − λ)Γ²z − λΓu₀, z = λΓu₀(1 − cosh κt)/κ².
    """
    gamma, ahead, heaviness = 0.4, 1.0, 0.5
    craft = Craft(sphere(heaviness), water=LinearShear((0.0, 0.0, 0.0), (gamma, 0.0, 0.0)))
    rate = 0.5 / (heaviness + C_M)
    kappa = gamma * np.sqrt(rate * (1 - rate))

    def gap(dt):
        run = moved(craft, craft.start(speed=ahead), dt, 8.0)
        t = run.dataset.time.values
        z = rate * gamma * ahead / kappa**2 * (1 - np.cosh(kappa * t))
        assert run.summary()["energy_budget_error_max"] < 1e-4
        assert abs(run.dataset.work_shear[-1]) > 1.0
        return np.max(np.abs(run.dataset.q[:, 2].values - z))

    coarse, fine = gap(0.1), gap(0.05)
    assert fine < 2e-4
    assert np.log2(coarse / fine) == pytest.approx(2, abs=0.05)


def field(q, t):
    """A smooth current without sources: an eddy that grows, waves, and a stagnation flow."""
    x, y, _ = q
    return jnp.stack(
        [
            0.3 * jnp.sin(0.5 * y + 0.2 * t) + 0.05 * x,
            0.2 * jnp.cos(0.4 * x) * (1 + 0.1 * t) - 0.05 * y,
            0.1 * jnp.sin(0.3 * x - 0.4 * t),
        ]
    )


@pytest.mark.long
def test_a_sphere_in_any_smooth_current_moves_by_the_equation_of_auton_hunt_and_prudhomme():
    """(m + C_M ρV) v̇ = ρV[(1 + C_M) Dc/Dt + C_L (c − v) × (∇ × c)], integrated by DOP853; C_L = C_M = ½."""
    heaviness, duration = 0.6, 6.0
    craft = Craft(sphere(heaviness), water=CurrentField(field))
    start = craft.start(position=(0.5, -0.3, 2.0), velocity=(0.4, 0.3, -0.2))
    parts = tabulate(
        lambda q, t: (field(q, t), jax.jacfwd(field)(q, t), jax.jacfwd(field, argnums=1)(q, t)), start.q, np.float64(0)
    )

    def rate(t, y):
        q, v = np.split(y, 2)
        c, J, slope = parts(q, np.float64(t))
        vorticity = np.array([J[2, 1] - J[1, 2], J[0, 2] - J[2, 0], J[1, 0] - J[0, 1]])
        lift = 0.5 * np.cross(c - v, vorticity)
        return np.concatenate([v, ((1 + C_M) * (slope + J @ c) + lift) / (heaviness + C_M)])

    exact = solve_ivp(
        rate, (0.0, duration), np.concatenate([start.q, start.qdot]), method="DOP853", rtol=1e-11, atol=1e-11
    ).y[:3, -1]
    gaps = [np.max(np.abs(moved(craft, start, dt, duration).final.q - exact)) for dt in (0.1, 0.05)]
    assert gaps[1] < 1e-4
    assert np.log2(gaps[0] / gaps[1]) == pytest.approx(2, abs=0.1)


@pytest.mark.long
@pytest.mark.parametrize(
    "method",
    [co.Midpoint(co.Cayley()), co.Trapezoidal(co.Cayley()), co.Galerkin(co.Cayley())],
    ids=["midpoint", "trapezoidal", "galerkin"],
)
def test_the_order_is_kept_in_a_smooth_current_of_place_and_time_and_the_budget_closes_to_it(method):
    craft = Craft(slender(), water=Sea(eddies=CurrentField(field), density=LinearDensity(DENSITY, 0.5)))
    start = craft.start(speed=1.0, euler_zyx=(0.4, 0.1, 0.0), angular_velocity=(0.1, -0.2, 0.3))
    steps = (0.1, 0.05, 0.025) if method.order == 2 else (0.4, 0.2, 0.1)
    runs = [moved(craft, start, dt, 4.0, method=method) for dt in steps]
    apart = [np.max(np.abs(a.final.q - b.final.q)) for a, b in pairwise(runs)]
    assert np.log2(apart[0] / apart[1]) == pytest.approx(method.order, abs=0.25)
    gaps = [run.summary()["energy_budget_error_max"] for run in runs]
    assert np.log2(gaps[1] / gaps[2]) == pytest.approx(method.order, abs=0.2)


@pytest.mark.long
def test_a_current_that_stays_moves_a_craft_as_the_water_at_rest_does_to_round_off():
    velocity = np.array([0.3, -0.2, 0.05])
    attitude = {"speed": 1.0, "euler_zyx": (0.4, 0.1, 0.0), "angular_velocity": (0.1, -0.2, 0.3)}
    still, carried = (Craft(slender(), water=water) for water in (UniformWater(), UniformWater(velocity)))
    one, other = (moved(craft, craft.start(**attitude), 0.05, 20.0) for craft in (still, carried))
    t = one.dataset.time.values
    np.testing.assert_allclose(other.dataset.q - np.outer(t, velocity), one.dataset.q, atol=1e-10)
    np.testing.assert_allclose(other.dataset.R, one.dataset.R, atol=1e-11)


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize(
    "water",
    [
        TimeCurrent(lambda t: jnp.array([0.3, -0.2, 0.05])),
        CurrentField(lambda q: jnp.array([0.3, -0.2, 0.05])),
        CurrentTable(np.tile([0.3, -0.2, 0.05], (3, 1)), depths=[0.0, 1.0, 2.0]),
        Sea(a=UniformWater((0.1, -0.2, 0.0)), b=UniformWater((0.2, 0.0, 0.05))),
        GaussMarkovCurrent((0.0, 0.0, 0.0), 10.0, mean=(0.3, -0.2, 0.05)),
    ],
    ids=["time", "place", "table", "sea", "random"],
)
def test_a_current_that_happens_to_be_the_same_everywhere_moves_a_craft_as_a_uniform_one(water):
    """The two Lagrangians differ by a total derivative: the motions agree to the order of the method."""
    attitude = {"speed": 1.0, "euler_zyx": (0.4, 0.1, 0.0), "angular_velocity": (0.1, -0.2, 0.3)}
    crafts = [Craft(slender(), water=one) for one in (UniformWater((0.3, -0.2, 0.05)), water)]

    def gap(dt):
        one, other = (moved(craft, craft.start(**attitude), dt, 5.0) for craft in crafts)
        return np.max(np.abs(one.final.q - other.final.q))

    assert gap(0.05) < 1e-3
    if not isinstance(water, Sea):
        assert np.log2(gap(0.1) / gap(0.05)) == pytest.approx(2, abs=0.2)


@pytest.mark.long
def test_a_random_current_carries_a_body_of_the_waters_own_density_exactly():
    water = GaussMarkovCurrent((0.2, 0.1, 0.0), 5.0, mean=(0.3, 0.0, 0.0), seed=3)
    craft = Craft(sphere(1.0), water=water)
    run = moved(craft, craft.start(), 0.05, 20.0)
    # q̇ is that of a step, over which the current goes straight from node to node.
    z = run.dataset.internal_water_z.values
    current = np.array([0.3, 0.0, 0.0]) + np.array([0.2, 0.1, 0.0]) * 0.5 * (z[1:] + z[:-1])
    np.testing.assert_allclose(run.records.qdot[:-1], current, atol=1e-12)


@pytest.mark.long
def test_the_budget_of_a_random_current_in_a_sheared_tide_closes():
    sea = Sea(
        tide=Sheared(TidalCurrent([600.0], [[0.5, 0.2, 0.0]]), PowerLaw(40.0)),
        gusts=GaussMarkovCurrent((0.1, 0.1, 0.0), 20.0, seed=7),
        density=LinearDensity(DENSITY, 0.01),
    )
    craft = Craft(slender(), water=sea)
    start = craft.start(speed=1.0, position=(0.0, 0.0, 5.0))
    run = moved(craft, start, 0.05, 15.0)
    assert run.plan.backend == "native"
    assert run.summary()["energy_budget_error_max"] < 1e-4
    assert {"work_time", "work_internal", "work_shear"} <= set(run.dataset.data_vars)
