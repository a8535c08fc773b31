"""RATTLE around methods: a pinned body in maximal coordinates moves as the top does in minimal ones."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics import reactions
from coadjoint.mechanics.continuous import reference as reference_motion
from coadjoint.mechanics.continuous import vector_field
from coadjoint.mechanics.singular_places import singular_place
from coadjoint.methods.rattle import Rattle
from pinned import PIN, RATES, pinned, reference, start, top

QUIET = {"monitors": False, "accuracy": False}


@pytest.fixture(scope="module")
def exact():
    return reference(1.0).final


def error(method, dt, exact):
    system = pinned()
    run = co.simulate(system, start(system), dt=dt, duration=1.0, method=method, **QUIET)
    return max(np.abs(run.final.g - exact.g).max(), np.abs(run.final.xi - exact.xi).max())


@pytest.mark.long
@pytest.mark.parametrize(
    ("method", "order"),
    [
        (co.Midpoint(), 2),
        pytest.param(co.Midpoint(co.Exponential()), 2, marks=pytest.mark.long),
        pytest.param(co.Trapezoidal(), 2, marks=pytest.mark.long),
        pytest.param(co.Simpson(), 2, marks=pytest.mark.long),
        pytest.param(co.methods.LeftRight(), 2, marks=pytest.mark.long),
        pytest.param(co.LeftRectangle(), 1, marks=pytest.mark.long),
        pytest.param(co.RightRectangle(), 1, marks=pytest.mark.long),
    ],
    ids=lambda value: getattr(value, "title", None),
)
def test_a_pinned_body_converges_to_the_top_with_the_order_of_the_method(method, order, exact):
    coarse, fine = (error(method, dt, exact) for dt in (0.01, 0.005))
    assert np.log2(coarse / fine) == pytest.approx(order, abs=0.15)


@pytest.mark.long
@pytest.mark.parametrize(
    ("scheme", "dt", "order"),
    [(co.Suzuki4, 0.02, 4), (co.methods.KahanLi6, 0.1, 6), (co.methods.KahanLi8, 0.1, 8)],
)
@pytest.mark.parametrize("base", [co.Midpoint(), co.Trapezoidal()], ids=lambda base: base.title)
def test_compositions_keep_their_orders(scheme, dt, order, base, exact):
    if order > 4 and isinstance(base, co.Trapezoidal):
        dt /= 2  # its error is larger by far, so that orders show later
    coarse, fine = (error(scheme(base), step, exact) for step in (dt, dt / 2))
    assert np.log2(coarse / fine) == pytest.approx(order, abs=0.3)


@pytest.mark.long
def test_a_million_steps_leave_no_gap_and_no_trend_of_the_energy():
    system = pinned()
    run = co.simulate(system, start(system), dt=0.05, steps=1_000_000, save_every=100, accuracy=False)
    assert run.extrema["constraint_gap"][1] < 1e-13
    assert run.extrema["constraint_rate"][1] < 1e-12
    error = np.abs(run.monitors["energy"] - run.monitors["energy"][0])
    fifths = [part.max() for part in np.array_split(error, 5)]
    assert max(fifths) < 1.1 * min(fifths)
    assert run.relative_change("kelvin_noether") < 1e-10


def test_gaps_stay_at_round_off_and_energy_in_its_band():
    system = pinned()
    run = co.simulate(system, start(system), dt=0.02, steps=20_000, save_every=20, accuracy=False)
    assert run.extrema["constraint_gap"][1] < 1e-14
    assert run.extrema["constraint_rate"][1] < 1e-13
    assert run.extrema["balance"][1] < 1e-14
    error = np.abs(run.monitors["energy"] / run.monitors["energy"][0] - 1)
    halves = error[:500].max(), error[500:].max()
    assert halves[1] < 1.1 * halves[0] < 5e-3
    assert "constraints" in run.certificate.long() and "constraint rates" in run.certificate.long()


@pytest.mark.long
def test_native_code_and_xla_agree_to_round_off():
    system = pinned()
    runs = [co.simulate(system, start(system), dt=0.01, steps=20, backend=b, **QUIET) for b in ("native", "xla")]
    for name in ("g", "n", "mu", "pi"):
        one, other = (getattr(run.final, name) for run in runs)
        assert np.abs(one - other).max() < 1e-14 * max(1, np.abs(one).max())


@pytest.mark.long
def test_records_of_native_code_solve_the_equations_that_xla_compiles():
    system = pinned()
    run = co.simulate(system, start(system), dt=0.01, steps=3, **QUIET)
    step, records = Rattle(run.method), run.records

    def again(state, z):
        return step.residual(system, state, 0.01, z), step.advance(system, step.record(system, state, 0.01, z), 0.01)

    rows = [jax.tree.map(lambda leaf, k=k: leaf[k], records) for k in (1, 2)]
    z = np.concatenate([rows[0].xi, rows[0].nu, rows[0].memory.step])
    left, after = evaluate(again, rows[0], z)
    assert np.abs(left).max() < 1e-13
    assert all(np.abs(getattr(after, name) - getattr(rows[1], name)).max() < 1e-14 for name in ("g", "n", "mu", "pi"))


def test_a_start_off_a_constraint_raises_with_its_name_and_distance():
    system = pinned()
    with pytest.raises(co.errors.ArgumentError, match=r"constraint `pin`, but \|φ\| is 0\.01"):
        co.simulate(system, start(system, q=-PIN + [0, 0, 0.01]), dt=0.01, steps=1)
    with pytest.raises(co.errors.ArgumentError, match=r"velocities of the start .* `pin`, but \|φ̇\| is 1\.6"):
        co.simulate(system, start(system, qdot=[0, 0, 0]), dt=0.01, steps=1)


def test_the_projection_onto_constraints_is_the_nearest_state_in_the_kinetic_metric():
    system = pinned()
    off = start(system, q=-PIN + [0.01, -0.02, 0.03], xi=RATES + 0.1, qdot=[0, 0, 0])
    found = system.project(off)
    assert np.abs(found.n + PIN).max() < 1e-15
    # The change of the momenta is a reaction, (n × λ, λ): the projection is orthogonal in ⟨p, M⁻¹p⟩.
    again = start(system, qdot=[0, 0, 0])
    held = system.project(again)
    assert held.mu - again.mu == pytest.approx(np.cross(held.pi - again.pi, held.n), abs=1e-9)
    assert np.cross(held.xi, -PIN) == pytest.approx(held.nu, abs=1e-9)


@pytest.mark.long
def test_a_run_that_continues_from_its_end_equals_an_undivided_one():
    system = pinned()
    whole = co.simulate(system, start(system), dt=0.01, steps=40, **QUIET)
    first = co.simulate(system, start(system), dt=0.01, steps=20, **QUIET)
    rest = co.simulate(system, first.final, dt=0.01, steps=20, **QUIET)
    assert np.array_equal(rest.final.mu, whole.final.mu)


def test_a_curve_that_crosses_itself_is_passed_and_its_crossing_is_known_as_singular():
    """Viviani's curve: a sphere and a cylinder that touch at (1, 0, 0)."""
    touching = {
        "sphere": co.Holonomic(lambda n: n @ n - 1),
        "cylinder": co.Holonomic(lambda n: (n[0] - 0.5) ** 2 + n[1] ** 2 - 0.25),
    }
    system = co.System(
        co.SO2(), lambda xi, n, nu: 0.5 * xi @ xi + 0.5 * nu @ nu, additional=co.Trivial(3), constraints=touching
    )

    def at(t, speed=0.0):
        place = [np.cos(t) ** 2, np.sin(t) * np.cos(t), np.sin(t)]
        return system.state(q=place, qdot=speed * np.array([-np.sin(2 * t), np.cos(2 * t), np.cos(t)]))

    run = co.simulate(system, at(0.8, -1.0), dt=0.01, duration=2.0, **QUIET)
    assert run.final.q[2] < -0.3
    assert (
        np.abs([run.final.q @ run.final.q - 1, (run.final.q[0] - 0.5) ** 2 + run.final.q[1] ** 2 - 0.25]).max() < 1e-14
    )
    assert "singular place" in singular_place(system, at(1e-4), None)
    assert singular_place(system, at(0.8), None) == ""


@pytest.mark.long
def test_rows_that_were_kept_and_become_dependent_are_named_and_chosen_again():
    """Three rows hold two velocities; the second is the first turned by x, and along it again at x = π."""

    def rows(n):
        turned = jnp.stack([jnp.zeros(()), jnp.zeros(()), jnp.cos(n[0]), jnp.sin(n[0])])
        return jnp.stack([jnp.array([0.0, 0, 1, 0]), turned, jnp.array([0.0, 0, 0, 1])])

    system = co.System(
        co.SO2(),
        lambda xi, n, nu: 0.5 * xi @ xi + 0.5 * nu @ nu - n[2],
        additional=co.Trivial(3),
        constraints={"rail": co.Nonholonomic(rows)},
    )
    begun = system.state(q=[np.pi - 0.5, 0, 0], qdot=[1, 0, 0])
    with pytest.raises(co.errors.StepError, match=r"t = 0\.4 s.* steps keep some, .* those of `rail`") as raised:
        co.simulate(system, begun, dt=0.1, steps=20, **QUIET)
    run = co.simulate(system, raised.value.run.final, dt=0.1, steps=10, **QUIET)
    assert run.final.memory.independent == (0, 2)
    assert run.final.q == pytest.approx([np.pi + 0.8, 0, 0], abs=1e-12)


def test_the_continuous_equations_have_the_reactions():
    system, free = pinned(), top()
    here, there = start(system), free.state(xi=RATES, a0=[0, 0, 1])
    turning = evaluate(lambda s: vector_field(system, s).xi, here)
    assert turning == pytest.approx(evaluate(lambda s: vector_field(free, s).xi, there), abs=1e-12)


@pytest.mark.long
def test_the_continuous_reference_has_the_reactions(exact):
    system = pinned()
    found = reference_motion(system, start(system), [1.0], tolerance=1e-11)
    assert np.abs(found.g[-1] - exact.g).max() < 1e-8
    assert np.abs(found.n[-1] + PIN).max() < 1e-9


@pytest.mark.long
def test_lagrangians_that_are_not_quadratic_keep_gaps_at_round_off():
    def stiff(xi, n, nu, a, p):
        return 0.5 * xi @ p.inertia @ xi + 0.5 * p.mass * nu @ nu + 0.02 * (nu @ nu) ** 2 - 9.81 * p.mass * n @ a

    free = pinned()
    spaces = {"additional": co.Defining(), "advected": co.Defining(), "parameters": free.parameters}
    system = co.System(co.SO3(), stiff, constraints={"pin": co.Holonomic(lambda n, a, p: n + p.pin)}, **spaces)
    run = co.simulate(system, start(system), dt=0.005, steps=200, accuracy=False)
    assert run.extrema["constraint_gap"][1] < 1e-14
    assert run.extrema["constraint_rate"][1] < 1e-13
    assert run.relative_change("energy") < 1e-3


def test_one_closing_impulse_meets_the_rates_where_the_lagrangian_is_not_quadratic():
    def stiff(xi, n, nu, a, p):
        return 0.5 * xi @ p.inertia @ xi + 0.5 * p.mass * nu @ nu + 0.02 * (nu @ nu) ** 2

    spaces = {"additional": co.Defining(), "advected": co.Defining(), "parameters": pinned().parameters}
    system = co.System(co.SO3(), stiff, constraints={"pin": co.Holonomic(lambda n, a, p: n + p.pin)}, **spaces)
    slipping = start(system, qdot=[0.3, -0.2, 0.1])
    closed = evaluate(lambda s: reactions.kicked(system, s, reactions.closing(system, s, None)), slipping)
    assert np.abs(evaluate(lambda s: reactions.node_rate(system, s), slipping)).max() > 0.5
    assert np.abs(evaluate(lambda s: reactions.node_rate(system, s), closed)).max() < 1e-12
