"""Scalars of the user, watched at every step: in the card, the dataset, files, fleets and fingerprints."""

from __future__ import annotations

from functools import partial

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import ArgumentError, LagrangianError
from coadjoint.mechanics.quantities import meaning


def height(state, p):
    """Height of the mass centre."""
    return p.lever * state.a[2]


def top(**quantities) -> tuple[co.System, co.State]:
    numbers = {"inertia": np.diag([1.0, 2.0, 3.0]), "lever": 0.5}

    def lagrangian(xi, a, p):
        return 0.5 * xi @ p.inertia @ xi - 2 * p.lever * a[2]

    made = co.System(co.SO3(), lagrangian, advected=co.Defining(), parameters=numbers, quantities=quantities)
    return made, made.state(xi=[0.3, 1, 2], a0=[0, 0.6, 0.8])


@pytest.mark.cases(1)
@pytest.mark.parametrize("backend", ["native", pytest.param("xla", marks=pytest.mark.long)])
def test_a_quantity_is_watched_at_every_step_and_saved_at_every_record(backend):
    system, start = top(height=height)
    run = co.simulate(system, start, dt=0.01, steps=300, save_every=50, backend=backend)
    np.testing.assert_allclose(run.dataset.height, 0.5 * run.records.a[:, 2], rtol=0, atol=1e-15)
    every = co.simulate(system, start, dt=0.01, steps=300).records.a[:, 2]
    np.testing.assert_allclose(run.extrema["height"], [0.5 * every.min(), 0.5 * every.max()], rtol=0, atol=1e-12)
    assert "height" in run.certificate.long() and run.dataset.height.attrs["long_name"] == "Height of the mass centre"
    assert run.summary()["height_initial"] == pytest.approx(0.4)


def test_casimirs_are_kept_to_round_off_at_every_step():
    system, start = top()
    run = co.simulate(system.watching(co.mechanics.casimirs(system)), start, dt=0.02, steps=100_000, save_every=1000)
    assert run.dataset.casimir_1.attrs["long_name"] == "m0 a0 + m1 a1 + m2 a2"
    for name in ("casimir_1", "casimir_2"):
        print(f"{name}: {run.relative_change(name):.1e} over {run.steps} steps")
        assert run.relative_change(name) <= 1e-11


@pytest.mark.long
def test_a_fleet_and_a_stored_run_watch_it_too(tmp_path):
    system, start = top(height=height)
    fleet = co.simulate(system.replace(lever=co.each([0.5, 1.0])), start, dt=0.01, steps=20)
    np.testing.assert_allclose(fleet.dataset.height[:, 0], [0.4, 0.8], rtol=0, atol=1e-15)
    run = co.simulate(system, start, dt=0.01, steps=20, store=tmp_path / "run")
    assert run.dataset.height.shape == (21,)
    np.testing.assert_array_equal(co.resume(tmp_path / "run", system).dataset.height, run.dataset.height)
    other = system.watching({"height": lambda state, p: 2 * p.lever * state.a[2]})
    with pytest.raises(ArgumentError, match=r"monitor|quantities"):
        co.resume(tmp_path / "run", other)


@pytest.mark.parametrize(
    ("quantities", "error", "says"),
    [
        ({"energy": height}, ArgumentError, "a name of its own"),
        ({"mass centre": height}, ArgumentError, "must have a name such as"),
        ({"height": 3.0}, ArgumentError, "must be a function of the state"),
        ({"height": lambda state: state.a}, LagrangianError, "The quantity `height` must return one number"),
    ],
)
def test_what_is_no_quantity_is_refused(quantities, error, says):
    with pytest.raises(error, match=says):
        co.simulate(*top(**quantities), dt=0.01, steps=2)


def test_a_quantity_that_is_not_finite_ends_the_run():
    system, start = top(slope=lambda state: jnp.log(2.99 - state.t))
    with pytest.raises(co.errors.StepError):
        co.simulate(system, start, dt=0.01, steps=400)


@pytest.mark.long
def test_functions_of_a_state_read_named_spaces():
    """Two vectors seen from the body, and two places: by name in quantities, events, brackets and records."""

    def lagrangian(xi, n, nu, a):
        return 0.5 * xi @ xi + 0.5 * nu.buoy @ nu.buoy + 0.5 * nu.sinker @ nu.sinker - a.down @ n.sinker

    system = co.System(
        co.SO3(),
        lagrangian,
        additional={"buoy": co.Defining(), "sinker": co.Defining()},
        advected={"down": co.Defining(), "north": co.Defining()},
    )
    places = {"buoy": [1.0, 0, 0], "sinker": [0, 0, 2.0]}
    rates = {"buoy": [0, 0.1, 0], "sinker": [0.2, 0, 0]}
    start = system.state(q=places, qdot=rates, xi=[0.3, 0.1, 0.2], a0={"down": [0, 0, 1], "north": [1, 0, 0]})
    watched = {"tilt": lambda s: s.named.a.down[2], "depth": lambda s: s.named.q.sinker[2]}
    run = co.simulate(system.watching(watched), start, dt=0.01, steps=50)
    np.testing.assert_array_equal(run.dataset.tilt, run.dataset.a_down[:, 2])
    np.testing.assert_allclose(run.dataset.depth, run.dataset.q_sinker[:, 2], rtol=0, atol=1e-15)
    np.testing.assert_array_equal(run.records.named.n.buoy, run.dataset.n_buoy)

    event = co.simulate(system, start, dt=0.01, steps=200, until=lambda s: s.named.q.sinker[2] - 1.5)
    assert event.event == pytest.approx(1.0, abs=1e-3)  # ½t² = ½
    rate = co.mechanics.poisson_bracket(lambda s: s.named.a.down[0], lambda s: 0.5 * s.mu @ s.mu)(start)
    assert rate == pytest.approx(-0.1)  # (a × ω)₁ of μ = ω: a₂ω₃ − a₃ω₂
    with pytest.raises(LagrangianError, match=r"asks an array for `down`.*state\.named\.a\.down"):
        co.simulate(system.watching({"tilt": lambda s: s.a.down[2]}), start, dt=0.01, steps=3)


@pytest.mark.parametrize("name", ["manakov_body", "sphere_vortices", "toda_lattice", "pseudo_rigid_body"])
def test_meanings_of_quantities_name_no_place_in_memory(name):
    """Two processes write the same file of the same run."""
    meanings = [meaning(function) for _, function in co.models.catalogue[name].make().quantities]
    assert meanings and all(text and " at 0x" not in text for text in meanings)


def test_meanings_of_quantities_say_which_arguments_were_given():
    def power_of(state, power):
        """|ξ|ᵏ."""

    assert meaning(partial(power_of, power=3)) == "|ξ|ᵏ, power = 3"
    assert meaning(partial(power_of, power=np.ones(3))) == meaning(power_of) == "|ξ|ᵏ"
