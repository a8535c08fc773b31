"""What forces put in and take: the energy budget closes to the method's order, the momentum budget to round-off."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.simulation.energy_budget import budget, momentum_gap
from systems import RULES, random_system

METHODS = {
    **{name: rule(co.Cayley()) for name, rule in RULES.items()},
    "suzuki of midpoint": co.Suzuki4(co.Midpoint(co.Cayley()), negative_substeps="allow"),
    "suzuki of the pair": co.Suzuki4(co.methods.LeftRight(co.Cayley()), negative_substeps="allow"),
}


def gap(run) -> float:
    """max_k |E_k − E_0 − ΣW_k|."""
    low, high = run.extrema["energy_budget"]
    first = run.ends["energy_budget"][0]
    return float(np.maximum(high - first, first - low))


def test_gaps_of_budgets_are_counted_from_the_start_of_the_run():
    extrema = {"energy": (-1.0, 5.0), "work_drag": (-8.0, 0.0), "energy_budget": (0.5, 4.5)}
    extrema["kelvin_noether_budget"] = np.array([[0.0, 1.0], [3.0, 5.0]])
    extrema["kelvin_noether"] = np.array([[-3.0, 0.0], [1.0, 4.0]])
    ends = {"energy": (2.0, 1.0), "work_drag": (0.0, -7.0), "energy_budget": (1.0, 3.0)}
    ends["kelvin_noether_budget"] = np.array([[0.0, 5.0], [1.0, 2.0]])
    system = co.System(co.SO3(), lambda xi: 0.5 * xi @ xi, forces={"drag": lambda motion: co.Force(-motion.xi)})
    run: Any = SimpleNamespace(ends=ends, extrema=extrema, system=system)
    assert budget(run) == {"energy_change": -1.0, "work_drag_change": -7.0, "energy_budget_error_max": 3.5 / 8.0}
    assert momentum_gap(run) == 1.0  # √(3² + 4²) over √(3² + 4²)


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
def test_the_energy_budget_closes_to_the_methods_order(method):
    """A force that dissipates and drives, and ℓ that depends on time; the work of every stage of every step counts."""
    system, start = random_system("SO3 alone", True)
    coarse, fine = (gap(co.simulate(system, start, dt=1 / n, steps=n, method=method, progress=False)) for n in (20, 40))
    assert np.log2(coarse / fine) == pytest.approx(method.order, abs=0.1)


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("world", ["SE3", "SO3 on a sphere", "SL2"])
def test_the_energy_budget_closes_on_other_groups_and_spaces(world):
    system, start = random_system(world, True)
    method = co.Trapezoidal(co.Exponential())
    runs = [co.simulate(system, start, dt=1 / n, steps=n, method=method, progress=False) for n in (20, 40)]
    assert np.log2(gap(runs[0]) / gap(runs[1])) == pytest.approx(2, abs=0.15)


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("rule", RULES)
def test_forced_momentum_changes_by_exactly_what_was_put_in(rule):
    """I_k − I_0 = Σ⟨𝒦, Δ⟩ over the whole run, for quantities that gravity and forces change; Theorem 7 summed up."""
    system, start = random_system("SO3", True)
    chosen = [
        co.mechanics.KelvinNoether([1.0, 2.0, 3.0]),
        co.mechanics.KelvinNoether(start.a[3:], K=lambda c, a: a.spin, space=co.spaces.Adjoint()),
    ]
    run = co.simulate(system, start, dt=0.01, steps=200, method=RULES[rule](co.Cayley()), kelvin_noether=chosen)
    assert run.relative_change("kelvin_noether") > 0.05
    assert run.summary()["kelvin_noether_budget_error_max"] < 1e-13
    assert run.largest("balance") < 1e-14


def pendulum(*lines: str) -> tuple[co.System, co.State]:
    """A damped, driven body; `lines` are the forces that act."""
    functions = {
        "drag": lambda motion, p: co.Force(torque=-p.drag * motion.xi),
        "motor": lambda motion, p: co.Force(torque=jnp.array([0.3, 0.2, 0.1]) * jnp.sin(motion.t)),
    }
    p = co.Parameters(inertia=[1.0, 1.5, 2.0], drag=0.2)
    forces = {name: functions[name] for name in lines}
    system = co.System(co.SO3(), lambda xi, p: 0.5 * p.inertia @ xi**2, parameters=p, forces=forces or None)
    return system, system.state(xi=[0.3, -0.4, 1.0])


def test_named_forces_add_up_and_each_has_its_own_line():
    system, start = pendulum("drag", "motor")
    run = co.simulate(system, start, dt=0.01, steps=500)
    drag, motor, energy = (run.ends[name] for name in ("work_drag", "work_motor", "energy"))
    assert drag[0] == motor[0] == 0
    assert drag[1] < -0.1 and motor[1] > 0.01
    assert energy[1] - energy[0] == pytest.approx(drag[1] + motor[1], rel=1e-4)

    def both(motion, p):
        parts = [function(motion, p).torque for _, function in system.forces]
        return co.Force(torque=sum(parts))

    one = co.System(system.group, system.lagrangian, parameters=system.parameters, forces=both)
    same = co.simulate(one, start, dt=0.01, steps=500)
    np.testing.assert_allclose(same.records.mu, run.records.mu, atol=1e-14)
    assert same.ends["work_forces"][1] == pytest.approx(drag[1] + motor[1], rel=1e-13)


def test_the_budget_is_on_the_card_in_the_dataset_and_in_the_summary():
    system, start = pendulum("drag", "motor")
    run = co.simulate(system, start, dt=0.01, steps=500)
    line = next(line for line in run.certificate.long().splitlines() if line.startswith("energy budget"))
    assert "drag took" in line and "motor put in" in line and "closes to" in line
    assert any(line.startswith("momentum budget") for line in run.certificate.long().splitlines())
    np.testing.assert_array_equal(run.dataset.work_drag, run.monitors["work_drag"])
    summary = run.summary()
    assert summary["energy_change"] == pytest.approx(
        summary["work_drag_change"] + summary["work_motor_change"], rel=1e-4
    )
    assert summary["energy_budget_error_max"] < 1e-4


@pytest.mark.long
def test_without_forces_nothing_is_accounted():
    system, start = pendulum()
    run = co.simulate(system, start, dt=0.01, steps=5)
    assert run.final.ledger is None and "energy budget" not in run.certificate.long()
    forced, start = pendulum("drag")
    assert co.simulate(forced, start, dt=0.01, steps=5, monitors=False).final.ledger is None
    assert co.trajectory(forced, start, dt=0.01, steps=5).final.ledger is None


@pytest.mark.long
def test_a_run_that_goes_on_from_a_record_begins_a_new_budget():
    system, start = pendulum("drag")
    first = co.simulate(system, start, dt=0.01, steps=50)
    second = co.simulate(system, first.final, dt=0.01, steps=50)
    assert second.ends["work_drag"][0] == 0
    whole = co.simulate(system, start, dt=0.01, steps=100)
    assert first.ends["work_drag"][1] + second.ends["work_drag"][1] == pytest.approx(
        whole.ends["work_drag"][1], rel=1e-13
    )


@pytest.mark.long
def test_both_backends_keep_the_same_ledger():
    system, start = pendulum("drag", "motor")
    native, xla = (co.simulate(system, start, dt=0.02, steps=20, backend=backend) for backend in ("native", "xla"))
    np.testing.assert_allclose(native.final.ledger[0], xla.final.ledger[0], rtol=1e-12)


@pytest.mark.long
def test_every_member_of_an_ensemble_has_its_own_budget():
    system, start = pendulum("drag", "motor")
    fleet = co.simulate(system.replace(drag=co.each([0.1, 0.2])), start, dt=0.01, steps=100)
    alone = co.simulate(system, start, dt=0.01, steps=100)
    np.testing.assert_allclose(fleet.dataset.work_drag[1], alone.dataset.work_drag, rtol=1e-12)
    assert "energy budget" in fleet.certificate.long()


def test_a_budget_survives_an_interruption(tmp_path):
    system, start = pendulum("drag")
    streamed = co.simulate(system, start, dt=0.01, steps=100, store=tmp_path / "run")
    again = co.resume(tmp_path / "run", system)
    alone = co.simulate(system, start, dt=0.01, steps=100)
    np.testing.assert_array_equal(streamed.dataset.work_drag, alone.dataset.work_drag)
    np.testing.assert_array_equal(again.final.ledger, alone.final.ledger)


def test_a_step_that_is_too_long_is_told_by_the_gap():
    system, start = pendulum("drag")
    run = co.simulate(system.replace(drag=8.0), start, dt=0.2, steps=20, method=co.LeftRectangle(co.Cayley()))
    assert any("energy budget closes only to" in sentence for sentence in run.warnings)


def test_the_figure_of_a_budget(tmp_path):
    system, start = pendulum("drag", "motor")
    run = co.simulate(system, start, dt=0.01, steps=500)
    above, below = run.plot.budget(path=tmp_path / "budget.png").axes
    drawn = [np.asarray(line.get_ydata()) for line in above.get_lines()]
    assert [curve[-1] for curve in drawn] == pytest.approx(
        [np.diff(run.ends["energy"])[0], run.ends["work_drag"][1], run.ends["work_motor"][1]]
    )
    assert below.get_yscale() == "log"
    unforced, start = pendulum()
    with pytest.raises(co.errors.ArgumentError, match="No energy budget was recorded"):
        co.simulate(unforced, start, dt=0.01, steps=5).plot.budget()


@pytest.mark.long
def test_a_ledger_of_a_million_steps_has_the_rounding_of_one():
    """A mass that is pushed: h f enters at each step; added up without the rest, 1e-11 of the sum would be lost."""
    body = co.System(
        co.Translation(1),
        lambda xi, p: 0.5 * p.mass * xi @ xi,
        parameters={"mass": 2.0},
        forces=lambda motion, p: co.Force(torque=jnp.array([0.1])),
    )
    steps = 1_000_000
    run = co.simulate(body, body.state(xi=[0.0]), dt=0.01, steps=steps, save_every=steps, backend="native")
    total, rest = np.asarray(run.final.ledger)
    assert total[-1] == pytest.approx(0.01 * 0.1 * steps, rel=4e-16)
    assert np.all(np.abs(rest) <= 2.0**-52 * np.abs(total))


def tables(kind: str):
    """A point on a spring pushed through ℓ, or a charged top through ℋ, by tables that jump; and its start."""
    if kind == "ℓ":

        def lagrangian(xi, n, nu, *, inputs):
            return 0.5 * nu @ nu - 0.5 * n @ n - 0.4 * inputs.push * n[0] + inputs.spin * (n[0] * nu[1] - n[1] * nu[0])

        system = co.System(co.Translation(0), lagrangian, additional=co.Trivial(2))
        return system, {"q": [1.0, 0.0], "pi": [0.0, 1.0]}

    def hamiltonian(mu, n, pi, *, inputs):
        return 0.5 * (mu @ mu + pi @ pi + n @ n) + inputs.spin * mu[0] - inputs.push * n[0]

    system = co.System(co.SO3(), hamiltonian=hamiltonian, additional=co.Trivial(2))
    return system, {"mu": [0.3, 1.0, 0.2], "q": [1.0, 0.0], "pi": [0.0, 1.0]}


TABLES = {"push": co.Held([0.0, 0.5], [1.0, 2.0]), "spin": co.Held([0.0, 0.3, 0.8], [0.3, -0.5, 0.2])}


@pytest.mark.parametrize("kind", ["ℓ", pytest.param("ℋ", marks=pytest.mark.long)])
def test_the_energy_budget_counts_the_jumps_of_tables(kind):
    """ℓ and ℋ are quadratic, so that the midpoint rule keeps ℋ between the jumps."""
    system, where = tables(kind)
    start = system.state(**where, inputs={"push": 1.0, "spin": 0.3})
    run = co.simulate(system, start, dt=0.02, steps=50, inputs=TABLES, accuracy=False)
    assert run.summary()["energy_budget_error_max"] < 1e-14
    assert abs(run.ends["work_inputs"][1]) > 0.1 and not run.warnings


@pytest.mark.long
@pytest.mark.parametrize("kind", ["ℓ", "ℋ"])
def test_the_energy_budget_counts_the_jumps_of_tables_everywhere(kind, tmp_path):
    """Members, stored runs, compositions, jumps within steps, and tables next to held inputs and smooth signals."""
    system, where = tables(kind)
    start = system.state(**where, inputs={"push": 1.0, "spin": 0.3})
    places = {"q": co.each([[1.0, 0.0], [2.0, 1.0], [0.3, -0.2]])}
    members = system.state(**(where | places), inputs={"push": 1.0, "spin": 0.3})
    how = {"dt": 0.02, "steps": 50, "progress": False}
    within = {name: co.Held(table.times * 1.013, table.values) for name, table in TABLES.items()}
    mixed = TABLES | {"push": lambda motion: jnp.sin(motion.t)}
    runs = [
        co.simulate(system, members, inputs=TABLES, **how),
        co.simulate(system, start, inputs=TABLES, store=tmp_path / "run", **how),
        co.resume(tmp_path / "run", system, inputs=TABLES),
        co.simulate(system, start, inputs=TABLES, method=co.Suzuki4(co.Midpoint()), **how),
        co.simulate(system, start, inputs=within, **how),
        co.simulate(system, start, inputs=mixed, **how),
        co.simulate(system, start, inputs=TABLES, backend="xla", **how),
    ]
    for run in runs:
        first, (low, high) = run.ends["energy_budget"][0], run.extrema["energy_budget"]
        assert np.max(np.abs([high - first, low - first])) < 2e-14
        assert np.min(np.abs(run.ends["work_inputs"][1])) > 1e-3
    smooth = {"push": co.Linear([0.0, 1.0], [1.0, 2.0]), "spin": 0.3}
    assert "work_inputs" not in co.simulate(system, start, inputs=smooth, **how).monitors
