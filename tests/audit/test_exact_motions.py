"""The motions against which the audit measures, by invariants and by equations written in another way."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from coadjoint.audit import constrained, page, steered_top, systems
from coadjoint.audit.constrained import BLADE, PIN, SUSLOV
from coadjoint.audit.steered_top import LAG, PERIOD


@pytest.fixture
def states(monkeypatch):
    """States are what is given for them, without the check of a start."""
    start = SimpleNamespace(xi=np.array([0.9, 0.6, -(BLADE[:2] @ [0.9, 0.6]) / BLADE[2]]), g=np.eye(3))
    monkeypatch.setattr(constrained, "suslov", lambda: (SimpleNamespace(state=lambda **given: given), start))
    constrained.suslov_exactly.cache_clear()
    yield start
    constrained.suslov_exactly.cache_clear()


def test_suslovs_body_keeps_its_energy_and_its_constraint_and_follows_its_equations_with_a_multiplier(states):
    """[J −b; bᵀ 0](ω̇, λ) = (Jω × ω, 0), by difference quotients; ½ωᵀJω and b·ω stay."""
    step, found = 1e-3, {}
    for time in (0.4 - step, 0.4, 0.4 + step):
        found[time] = cast(Any, constrained.suslov_exactly(time))
    before, now, after = found.values()
    omega, R = now["xi"], now["g"]
    assert now["t"] == 0.4 and abs(BLADE @ omega) < 1e-12
    assert omega @ SUSLOV @ omega == pytest.approx(states.xi @ SUSLOV @ states.xi, rel=1e-11)
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-14)
    whole = np.block([[SUSLOV, -BLADE[:, None]], [BLADE[None], np.zeros((1, 1))]])
    slopes = np.linalg.solve(whole, [*np.cross(SUSLOV @ omega, omega), 0.0])
    np.testing.assert_allclose((after["xi"] - before["xi"]) / (2 * step), slopes[:3], atol=1e-5)
    turning = R.T @ (after["g"] - before["g"]) / (2 * step)
    np.testing.assert_allclose([turning[2, 1], turning[0, 2], turning[1, 0]], omega, atol=1e-5)


def test_the_pinned_body_moves_as_the_top_about_its_pin(monkeypatch):
    """q = −R p and q̇ = −R (ω × p), and the direction of gravity is that of space."""
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    monkeypatch.setattr(constrained, "_top", lambda: SimpleNamespace(state=lambda **given: State(**given)))
    start = SimpleNamespace(g=np.eye(3), xi=np.ones(3))
    monkeypatch.setattr(constrained, "pinned_body", lambda: (SimpleNamespace(state=lambda **given: given), start))
    record = {"t": [2.0], "g": [turn], "a": [np.array([0.0, 0.6, 0.8])], "xi": [np.array([0.1, 0.2, 0.3])], "mu": [0.0]}
    asked: list[Any] = []
    monkeypatch.setattr(constrained, "reference", lambda *given: asked.append(given[1:]) or SimpleNamespace(**record))
    constrained.pinned_exactly.cache_clear()
    found = cast(Any, constrained.pinned_exactly(2.0))
    constrained.pinned_exactly.cache_clear()
    begun, times = asked[0]
    assert begun.a0 == [0, 0, 1] and begun.g is start.g and begun.xi is start.xi and times == [2.0]
    np.testing.assert_allclose(found["q"], -turn @ PIN)
    np.testing.assert_allclose(found["qdot"], -turn @ np.cross([0.1, 0.2, 0.3], PIN))
    np.testing.assert_allclose(found["a0"], turn @ [0.0, 0.6, 0.8])
    assert found["t"] == 2.0 and found["g"] is not start.g


class State(SimpleNamespace):
    def replace(self, **values: Any) -> State:
        return State(**vars(self) | values)


def test_a_torque_lags_behind_commands_that_are_held_for_a_period(monkeypatch):
    """From command to command T = u + (T − u) exp(−Δ/τ), with the command of the motion at its start."""
    monkeypatch.setattr(steered_top, "jnp", np)
    system = State(state=lambda **given: State(**given), u=None)
    monkeypatch.setattr(steered_top, "System", lambda *given, **more: system)
    begun: Any = (None, SimpleNamespace(g="g", xi=np.array([0.5, -0.3, 2.5])))
    monkeypatch.setattr(steered_top, "steered_top", lambda: begun)
    asked: list[Any] = []

    def reference(top, state, times):
        asked.append((top.u, top.torque, top.since, *times))
        return SimpleNamespace(t=times, g=["g"], a=[0.5 * np.ones(3)], xi=[state.xi + 1.0], mu=[None])

    monkeypatch.setattr(steered_top, "reference", reference)
    steered_top.steered_exactly.cache_clear()
    monkeypatch.setattr(State, "a", np.array([0.0, 0.0, 1.0]), raising=False)
    found = cast(Any, steered_top.steered_exactly(1.2))
    steered_top.steered_exactly.cache_clear()
    assert found.t == 1.2 and [one[2:] for one in asked] == [(0.0, 0.5), (0.5, 1.0), (1.0, 1.2)] and PERIOD == 0.5
    torque, xi, a = np.zeros(3), begun[1].xi, np.array([0.0, 0.0, 1.0])
    for u, before, since, until in asked:
        np.testing.assert_allclose(u, 0.6 * np.sin(2 * since) * a - 0.5 * xi)
        np.testing.assert_allclose(before, torque)
        torque, xi, a = u + (torque - u) * np.exp(-(until - since) / LAG), xi + 1.0, 0.5 * np.ones(3)


def forces_of(monkeypatch, module: Any, make: Any) -> Any:
    """The forces with which a system is made."""
    monkeypatch.setattr(module, "jnp", np)
    monkeypatch.setattr(module, "Force", lambda torque: torque)
    return make()


def test_the_driven_top_is_braked_by_its_rate_and_its_square_and_turned_about_the_vertical(monkeypatch):
    monkeypatch.setattr(systems, "heavy_top", lambda forces: forces)
    forces = forces_of(monkeypatch, systems, systems.driven_top)
    xi, a = np.array([0.6, 0.0, 0.8]), np.array([0.1, 0.2, 0.3])
    torque = forces(SimpleNamespace(xi=2.0 * xi, a=a, t=0.7), SimpleNamespace(damping=0.15))
    np.testing.assert_allclose(torque, -0.15 * 3.0 * 2.0 * xi + 0.5 * np.sin(0.7) * a)


def test_the_actuator_of_the_steered_top_lags_within_a_step_and_on_average(monkeypatch):
    """Course: T at the end of a step, and its mean over it, u + (T − u) τ (1 − exp(−h/τ))/h."""
    monkeypatch.setattr(
        steered_top,
        "sampled",
        lambda motion, h, last, update, period: {"value": State(**update(last)), "period": period},
    )
    monkeypatch.setattr(steered_top, "Course", lambda end, mean: (end, mean))
    kept: dict[str, Any] = {}
    monkeypatch.setattr(
        steered_top, "System", lambda *given, **more: kept.update(more) or SimpleNamespace(state=lambda **one: one)
    )
    monkeypatch.setattr(steered_top, "sampling", lambda begun: begun)
    _, start = forces_of(monkeypatch, steered_top, steered_top.steered_top)
    xi, a, torque = np.array([0.5, -0.3, 2.5]), np.array([0.0, 0.6, 0.8]), np.array([1.0, 2.0, 3.0])
    internal = SimpleNamespace(torque=torque, controller=None)
    motion = SimpleNamespace(xi=xi, a=a, t=0.4, internal=internal)
    after = kept["internal"](motion, 0.2, None)
    u = 0.6 * np.sin(0.8) * a - 0.5 * xi
    end, mean = after["torque"]
    part = np.exp(-0.2 / 0.3)
    np.testing.assert_allclose(end, u + (torque - u) * part)
    np.testing.assert_allclose(mean, u + (torque - u) * (1 - part) * 0.3 / 0.2)
    assert after["controller"]["period"] == 0.5 and not cast(Any, start)["internal"]["torque"].any()
    found = kept["forces"](motion, SimpleNamespace(damping=0.15))
    np.testing.assert_allclose(found, torque - 0.15 * xi)


@pytest.mark.parametrize("long_run", [None, "a run"])
def test_an_audit_writes_its_page_numbers_and_figures(long_run, monkeypatch, tmp_path):
    drawn: list[Any] = []
    for name in ("order_figure", "energy_figure"):
        monkeypatch.setattr(page, name, lambda audit, name=name: name)
    monkeypatch.setattr(page, "_drawn", lambda figure, path: drawn.append((figure, path)) or path)
    monkeypatch.setattr(page, "summary", lambda audit: {"passed": True})
    monkeypatch.setattr(page, "text", lambda audit, command, names: f"{command}: {names}")
    audit: Any = SimpleNamespace(cells=[SimpleNamespace(long_run=None), SimpleNamespace(long_run=long_run)])
    figures = [
        tmp_path / "figures" / name for name in ("audit_orders.png", "audit_energy.png")[: 1 + (long_run is not None)]
    ]
    assert page.write(audit, tmp_path, "audit") == [tmp_path / "audit.md", tmp_path / "audit.json", *figures]
    assert drawn == list(zip(("order_figure", "energy_figure"), figures, strict=False))
    assert (tmp_path / "audit.md").read_text() == f"audit: {[path.name for path in figures]}"
    assert (
        '"passed": true' in (tmp_path / "audit.json").read_text()
        and '"versions"' in (tmp_path / "audit.json").read_text()
    )


@pytest.mark.parametrize("passed", [True, False])
def test_a_page_says_what_was_not_shown_and_what_is_not_supported(passed, monkeypatch):
    monkeypatch.setattr(page, "rows", lambda audit, by_map: [])
    monkeypatch.setattr(page, "markdown", lambda columns, rows: "TABLE")
    cells = [SimpleNamespace(system=name) for name in ("suslov", "own", "suslov")]
    monkeypatch.setattr(page, "PROBLEMS", {"suslov": SimpleNamespace(make=SimpleNamespace(__doc__=" A body. "))})
    audit: Any = SimpleNamespace(
        cells=cells, passed=passed, failures=["order is 1"], refusals=[] if passed else ["no q"]
    )
    found = page.text(audit, "coadjoint audit", ["audit_orders.png"])
    assert found.count("- **suslov**: A body.") == 1 and "- **own**: a system of your own." in found
    assert ("Every claim was shown." in found) == passed and (
        "Not every claim was shown:\n\n- order is 1" in found
    ) != passed
    assert (
        ("What methods do not support:\n\n- no q" in found) != passed
        and "coadjoint audit" in found
        and "TABLE" in found
    )
    assert "](figures/audit_orders.png)" in found and "audit_energy.png" not in found
