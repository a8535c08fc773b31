"""The energy–momentum method keeps the Legendre energy and the momenta to round-off, and gives up the two-form."""

from __future__ import annotations

from functools import lru_cache

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
import paper_vehicle
from coadjoint.kernels.trace.evaluate import evaluate, tabulate
from coadjoint.mechanics.continuous import energy
from coadjoint.mechanics.noether import isotropy_algebra, spatial_momentum
from coadjoint.models import catalogue
from stepping import Leap, Stepper, tabulated
from systems import SL2, generator, random_system, system_on
from two_form import carry, tangents

H, STEPS, POINTS = 0.03, 6, 4
"""At four points the random Lagrangians' means are exact to round-off."""

CASES = {
    "SO3": co.Cayley(),
    "SE2": co.Cayley(),
    "SL2": co.Cayley(),
    "Heisenberg": co.Exponential(),
    "SO4": co.Exponential(),
    "SO3xSE2": co.Cayley(),
}


@lru_cache(maxsize=16)
def leaps(world: str, forced: bool) -> tuple[co.System, list[Leap]]:
    system, start = random_system(world, forced)
    return system, Stepper(system, co.EnergyMomentum(CASES[world], points=POINTS)).run(start, H, STEPS)


def energies(system: co.System, found: list[Leap]) -> np.ndarray:
    of = tabulate(lambda state: energy(system, state), found[0].record)
    return np.array([of(leap.record) for leap in found])


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("world", CASES)
def test_energy_is_kept_on_nonlinear_systems_over_many_groups(world):
    found = energies(*leaps(world, False))
    print(f"{world}: {np.ptp(found) / abs(found[0]):.1e}")
    assert np.ptp(found) <= 2e-14 * np.max(np.abs(found))


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("world", CASES)
def test_momenta_of_the_isotropy_algebra_are_kept(world):
    system, found = leaps(world, False)
    c0 = isotropy_algebra(system, found[0].record)
    of = tabulate(lambda state: spatial_momentum(system, state), found[0].record)
    momenta = np.array([of(leap.record) for leap in found])
    assert np.all(np.abs((momenta - momenta[0]) @ c0.T) <= 1e-13 * np.max(np.abs(momenta)))
    balance = tabulated(
        lambda system, step, r, h: step.balance(system, r, h, step.advance(system, r, h)), system, found
    )
    assert max(balance) <= 1e-14


@pytest.mark.long
def test_energy_changes_by_the_work_of_the_forces_and_of_time():
    """Each of them is told apart, and the budget closes to round-off instead of to the order of the method."""
    system, found = leaps("SO3", True)
    work = np.array(tabulated(lambda system, step, r, h: step.work(system, r, h), system, found))
    changes = np.diff(energies(system, found))
    print(f"{changes} by {work[:-1]}")
    assert work.shape[1] == 2 and np.min(np.abs(work)) > 1e-4
    assert np.allclose(changes, np.sum(work, axis=1)[:-1], rtol=0, atol=2e-14 * np.max(np.abs(energies(system, found))))


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("world", ["SO3", "SO4"])
def test_a_step_back_undoes_a_step(world):
    system, found = leaps(world, True)
    first = found[0]
    stepper = Stepper(system, co.EnergyMomentum(CASES[world], points=POINTS))
    stepper._solvers.clear()
    back = stepper.leaps(first.after, -first.h)[0].after
    for name in ("n", "a", "mu", "pi", "t"):
        assert np.allclose(getattr(back, name), getattr(first.record, name), rtol=0, atol=1e-13), name


@pytest.mark.long
def test_the_two_form_is_what_it_gives_up():
    system, start = random_system("SO3")
    method, random = co.EnergyMomentum(co.Cayley()), generator("two-form")
    state = method.begin(system, start, H)
    pair = tangents(system, state, random), tangents(system, state, random)
    *_, code, (before, after, size) = evaluate(lambda s, d1, d2: carry(system, method, s, 0.15, d1, d2), state, *pair)
    assert code == 0 and not method.claims.symplectic
    assert abs(after - before) > 1e-6 * size


MODELS = {
    "free_rigid_body": 0.05,
    "heavy_top": 1e-4,
    "simo_wong_top": 5e-3,
    "kirchhoff_ellipsoid": 0.02,
    "underwater_vehicle": 0.01,
}


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.usefixtures("optimised")
@pytest.mark.parametrize("name", MODELS)
def test_one_point_keeps_the_energy_of_bodies_tops_and_vehicles_over_100000_steps(name):
    """Their ℋ is quadratic in (μ, π, n, a) together. Round-off adds up as a random walk, ε√N of the largest term."""
    model = catalogue[name]
    body = model.make()
    run = co.simulate(
        body, model.start(body), dt=MODELS[name], steps=100_000, method=co.EnergyMomentum(), save_every=100
    )
    print(f"{name}: energy {run.relative_change('energy'):.1e}, momenta {run.relative_change('kelvin_noether'):.1e}")
    # The vehicle's weight and buoyancy do work on hundreds of metres: terms far larger than their sum.
    assert run.relative_change("energy") <= {"underwater_vehicle": 2e-11}.get(name, 1e-12)
    q, p = run.dataset.get("q"), run.dataset.get("pi")
    lever = 0.0 if q is None else float(np.max(np.abs(q)) * np.max(np.abs(p)))
    size = np.max(np.abs(run.records.mu)) + lever
    low, high = run.extrema["kelvin_noether"]
    assert np.max(high - low) <= 1e-12 * size
    assert run.largest("balance") <= 2e-15 and run.largest("newton_residual") <= 2e-15


@pytest.mark.long
def test_a_composition_of_it_keeps_the_energy_at_order_four():
    vehicle = paper_vehicle.system()
    run = co.simulate(
        vehicle,
        paper_vehicle.start(vehicle),
        dt=0.05,
        duration=50,
        method=co.Suzuki4(co.EnergyMomentum()),
        save_every=10,
    )
    assert run.relative_change("energy") <= 1e-12


@pytest.mark.long
def test_several_points_keep_a_potential_that_is_not_quadratic():
    """A spring with a cubic force: the energy error falls from h² by points, and is round-off with four."""

    def lagrangian(xi, n, nu, p):
        return 0.5 * xi @ jnp.diag(p.inertia) @ xi + 0.5 * nu @ nu - jnp.cosh(jnp.sqrt(n @ n + 0.3))

    system = co.System(
        co.SO3(), lagrangian, additional=co.Defining(), parameters={"inertia": np.array([1.0, 2.0, 3.0])}
    )
    start = system.state(g=np.eye(3), q=[1.0, 0.2, 0.0], xi=[0.3, 1.0, 0.2], qdot=[0.0, 0.5, 0.4])
    errors = []
    for points in (1, 2, 4):
        found = Stepper(system, co.EnergyMomentum(points=points)).run(start, 0.1, 40)
        errors.append(np.ptp(energies(system, found)))
    print(errors)
    assert errors[0] > 1e-5 and errors[1] < 1e-3 * errors[0] and errors[2] <= 1e-13


def test_what_does_not_fit_is_refused():
    compass = co.System(co.SO3(), lambda xi, a: 0.5 * xi @ xi - a[2], advected=co.Sphere())
    with pytest.raises(co.errors.ArgumentError, match=r"needs affine actions and a flat V\*"):
        co.EnergyMomentum().begin(compass, compass.state(a0=[0, 0, 1]), 0.1)
    skewed, start = system_on(SL2, co.spaces.Adjoint(), None, False, "adjoint of SL2")
    with pytest.raises(co.errors.GroupError, match=r"use co\.Exponential"):
        co.EnergyMomentum(co.Cayley()).begin(skewed, start, 0.1)
    with pytest.raises(co.errors.GroupError, match=r"needs Cayley\(\) or Exponential\(\)"):
        co.EnergyMomentum(co.difference_maps.Squared(co.Cayley())).begin(skewed, start, 0.1)
    with pytest.raises(co.errors.ArgumentError, match="from 1 to 8"):
        co.EnergyMomentum(points=0)
    with pytest.raises(co.errors.ArgumentError, match="starts from momenta"):
        co.EnergyMomentum(start="velocity")
