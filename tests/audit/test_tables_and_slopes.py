"""What an audit makes of its numbers: slopes, drifts, spans, sentences, tables and panels."""

from __future__ import annotations

import json
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import coadjoint as co
from coadjoint.audit import long_run, one_step, systems
from coadjoint.audit.figures import BINS, energy_figure, order_figure
from coadjoint.audit.findings import Audit, Cell, Finding, reasons
from coadjoint.audit.long_run import INTERVALS, LongRun, drift
from coadjoint.audit.order import Convergence, convergence, error_after, fit
from coadjoint.audit.page import ENERGY, NUMBERS, ORDERS, PAGE, write
from coadjoint.audit.shipped import with_hamiltonian, with_left_rectangle
from coadjoint.audit.stepper import REFERENCE_TOLERANCE, exact, uncertainty
from coadjoint.audit.systems import AuditSystem
from coadjoint.audit.tables import OVER_MAPS, _span, _worst, markdown, rows, summary
from coadjoint.errors import FileError, StepError
from coadjoint.kernels.trace.evaluate import evaluate

H = 0.5 ** np.arange(8)


def test_a_step_goes_as_many_steps_back_as_ahead(monkeypatch):
    """x⁺ = x + h + |h|³ is off its start by 2·h³ in each of the steps there and back."""

    def run(x: float, h: float, number: int, every: int = 1) -> SimpleNamespace:
        return SimpleNamespace(final=x + number * every * (h + abs(h) ** 3))

    stepper: Any = SimpleNamespace(begin=lambda h: 0.5, run=run)
    monkeypatch.setattr(one_step, "distance", lambda x, y: abs(x - y))
    assert one_step.irreversibility(stepper, 0.1, 7) == pytest.approx(14 * 0.1**3)


def test_the_defect_of_the_two_form_is_the_largest_of_all_pairs(monkeypatch):
    """|ω after − ω before| over the sizes of the terms of both."""
    forms = iter([(np.array([1.0, 1.0, 1.0]), np.array([2.0, 3.0, 4.0])), (np.array([1.0, 2.0, 0.5]), np.ones(3))])
    monkeypatch.setattr(one_step, "_forms", lambda *given: next(forms))
    monkeypatch.setattr(one_step, "_curves", lambda system, state, count: [state] * count)
    for name in ("_rows", "_stack"):
        monkeypatch.setattr(one_step, name, lambda rows: [rows])
    made = SimpleNamespace(final=SimpleNamespace())
    stepper: Any = SimpleNamespace(system=None, begin=lambda h: None, run=lambda *given: made)
    assert one_step.symplectic_defect(stepper, 0.1) == pytest.approx(0.25)


def test_curves_through_a_state_carry_its_advected_parameter_along():
    system, start = systems.heavy_top()
    along = one_step._curves(system, start, 2)
    assert along.g.shape == (2, 8, 3, 3) and np.ptp(along.g, axis=1).min() > 0
    np.testing.assert_allclose(along.a, along.g[:, :, 2], atol=1e-14)


def test_errors_of_energy_are_relative_to_its_largest_terms(monkeypatch):
    """|E − E₀| / (|E₀| + max |μ·ξ| + |π·ν|)."""
    energy = np.array([-2.0, -2.5, -1.0])
    monkeypatch.setattr(long_run, "evaluate", lambda *given: energy)
    monkeypatch.setattr(long_run, "_energy", lambda *given: lambda record: record)
    monkeypatch.setattr(long_run, "_momentum_error", lambda *given: 0.1)
    monkeypatch.setattr(long_run, "_gap", lambda *given: 0.2)
    monkeypatch.setattr(long_run, "drift", lambda error: error.sum())
    mu, pi = np.array([[1.0, 2.0], [3.0, -1.0], [0.0, 0.0]]), np.array([[1.0], [0.5], [1.0]])
    records = SimpleNamespace(mu=mu, xi=np.ones((3, 2)), pi=pi, nu=-np.ones((3, 1)), t=np.arange(3))
    asked: list[Any] = []
    stepper: Any = SimpleNamespace(
        begin=lambda h: h, run=lambda *given: asked.append(given) or SimpleNamespace(records=records), system=None,
        start=None, method=SimpleNamespace(holds=lambda records: np.array([True, True, False])),
    )  # fmt: skip
    found = long_run.long_run(stepper, 0.1, 70, False)
    np.testing.assert_allclose(found.energy_error, [0.0, 0.5 / 6, 0.0])
    assert found.band == pytest.approx(0.5 / 6) and found[3:] == (pytest.approx(0.5 / 6), 0.1, 0.2)
    assert asked == [(0.1, 0.1, 3, 20)]


def order(measured: float, claimed: int = 2, failure: str = "") -> Finding:
    return Finding("order", claimed, measured, 0.1, failure)


def cell(method: str = "Midpoint", tau: str = "Cayley", system: str = "top", **more: Any) -> Cell:
    given: dict[str, Any] = {"order": 2, "findings": (order(2.01),)} | more
    return Cell(method, tau, system, **given)


def measured(slope: float) -> Convergence:
    return Convergence(H, H**slope, np.arange(8) > 3, slope)


# Slopes and drifts.


def test_the_slope_is_that_of_the_finest_usable_errors():
    error = H**2
    error[:3], error[-2:] = 7.0, 1e-3  # coarse, and round-off
    found = fit(H, error, np.arange(8) < 6, 3)
    assert found.order == pytest.approx(2.0) and found.fitted.tolist() == [False] * 3 + [True] * 3 + [False] * 2
    assert np.isnan(fit(H, error, np.arange(8) < 2, 3).order) and np.isfinite(fit(H, error, np.arange(8) < 3, 3).order)


def problem(**more: Any) -> AuditSystem:
    """A motion x = t that is known: nothing is made of it."""
    return AuditSystem("known", lambda: pytest.fail("a system was made"), 2.0, exact=state, **more)


def state(t: float, off: float = 0.0) -> Any:
    none = np.zeros(0)
    return SimpleNamespace(t=t, g=np.eye(2), n=np.array([t + off]), a=none, mu=none, pi=none)


def test_a_motion_that_is_known_is_its_own_reference():
    known = problem()
    assert exact(known, 1.5).n == [1.5] and uncertainty(known) == REFERENCE_TOLERANCE


def test_the_order_of_errors_is_measured_down_to_round_off():
    """e = h³ of |(1, 0, 0, 1, 2)|, over halvings."""

    class Stepper:
        method = SimpleNamespace(claims=SimpleNamespace(order=3, order_with_internal=1))
        asked: list[int] = []  # noqa: RUF012

        def end(self, h, steps):
            self.asked.append(steps)
            if h > 0.3:
                raise StepError("Newton did not converge.")
            return state(h * steps, np.sqrt(6) * h**3)

    known = problem()
    object.__setattr__(known, "make", lambda: (SimpleNamespace(internal=None), None))
    assert error_after(Stepper(), known, 0.1, 20) == pytest.approx(1e-3)
    assert error_after(Stepper(), known, 0.5, 4) == np.inf
    Stepper.asked.clear()
    found = convergence(Stepper(), known)
    assert Stepper.asked == [4, 8, 16, 32, 64, 128, 256, 512, 1024][: len(Stepper.asked)]
    assert found.order == pytest.approx(3.0) and found.error[0] == np.inf and not found.fitted[0]
    assert found.fitted.sum() == 4 and found.h[0] == 0.5


def test_a_drift_is_what_a_line_gains_beyond_three_standard_errors():
    nodes = 100 * INTERVALS
    assert drift(np.zeros(nodes)) == 0.0
    assert drift(np.full(nodes, 2.0)) == pytest.approx(0.0, abs=1e-12)
    line = np.linspace(0, 2, nodes)
    places = np.arange(INTERVALS) - (INTERVALS - 1) / 2
    means = line.reshape(INTERVALS, -1).mean(axis=1)
    assert drift(line) == pytest.approx(places @ means / (places @ places) * INTERVALS, rel=1e-9)
    assert drift(line[::-1].copy()) == 0.0
    rough = means + np.where(np.arange(INTERVALS) % 2, 0.05, -0.05)
    slope = places @ rough / (places @ places)
    rest = rough - rough.mean() - slope * places
    wide = 3 * np.sqrt(rest @ rest / (INTERVALS - 2) / (places @ places))
    found = drift(np.repeat(rough, 100))
    assert found == pytest.approx((slope - wide) * INTERVALS / rough.mean()) and 0 < found < drift(line)


# Tables.


def test_a_span_is_one_number_where_both_ends_look_alike():
    assert [_span(v) for v in ([], [np.nan], [2.001, 2.004], [2.0, np.inf, 2.5])] == ["–", "–", "2.00", "2.00–2.50"]
    assert (_worst([]), _worst([1e-14, 3e-13]), _worst([0.1, 0.25], "{:.2f}")) == ("–", "3e-13", "0.25")


def test_a_row_has_the_worst_of_all_systems():
    energy, momentum = Finding("energy", "bounded", 0.01, 0.1), Finding("momentum", "kept", 1e-13, 1e-9)
    run = LongRun(np.arange(3.0), np.zeros(3), 2e-4, 0.0, 0.0)
    first = cell(findings=(order(2.01), energy, momentum), long_run=run)
    gap = Finding("constraints", "exact", 3e-16, 1e-13)
    others = (order(1.97), order(3.0, claimed=3), Finding("momentum", "kept", 1e-12, 1e-13), gap)
    second = cell(system="body", findings=others)
    refused = cell(system="curved", findings=(), refusal="no")
    (row,) = rows(Audit((first, second, refused), 1.0))
    assert row == ("Midpoint", "Cayley", "2", "1.97–2.01", "–", "–", "1e-12", "2e-04", "0.01", "3e-16", "NO")
    (row,) = rows(Audit((cell(findings=(Finding("energy", "exact", 1e-15, 1e-9),)),), 1.0))
    assert row[-3:] == ("exact", "–", "yes") and row[3] == "–"
    (row,) = rows(Audit((cell(),), 1.0))
    assert row[-3:] == ("–", "–", "yes")


def test_maps_may_share_a_row_of_the_worst_and_methods_a_reason():
    over = (cell(), cell(tau="Exponential", findings=(order(1.9),)))
    assert [row[1] for row in rows(Audit(over, 1.0))] == ["Cayley", "Exponential"]
    (row,) = rows(Audit(over, 1.0), by_map=False)
    assert row[1:4] == ("2", "2", "1.90–2.01")
    said = (
        "Simpson(Cayley(), n=2) needs a flat space, but got Sphere(): use a chart.",
        "co.Gauss takes no b, but got c.",
    )
    found = reasons([("Simpson(n=2)", said[0]), ("Other", said[0]), ("Gauss", said[1])])
    assert found == ["Simpson(n=2), Other: needs a flat space: use a chart.", "Gauss: takes no b."]


@pytest.mark.long
def test_the_page_has_the_verdict_the_tables_and_the_figures(tmp_path):
    watched = cell(convergence=measured(2.0), long_run=LongRun(np.arange(200.0), np.ones(200), 1e-3, 0.0, 0.0))
    lost = cell("Galerkin", system="curved", findings=(), refusal="It needs a flat space")
    written = write(Audit((watched, lost), 1.0), tmp_path, "coadjoint audit")
    page, numbers, *figures = written
    assert [path.relative_to(tmp_path).as_posix() for path in figures] == [f"figures/{n}" for n in (ORDERS, ENERGY)]
    assert all(path.stat().st_size > 1000 for path in figures)
    text = page.read_text()
    assert "`coadjoint audit` writes it." in text and "Not every claim was shown:\n\n- Galerkin has shown" in text
    assert "- Galerkin: It needs a flat space" in text and "a system of your own" in text
    assert markdown(OVER_MAPS, rows(Audit((watched, lost), 1.0), by_map=False)) in text and f"figures/{ENERGY}" in text
    assert json.loads(numbers.read_text())["failures"] == Audit((watched, lost), 1.0).failures
    written = write(Audit((cell(convergence=measured(2.0)),), 1.0), tmp_path / "one", "audit")
    assert [path.name for path in written] == [PAGE, NUMBERS, ORDERS]
    assert "Every claim was shown." in written[0].read_text() and "refuse" not in written[0].read_text()
    with pytest.raises(FileError, match=r"The folder .*audit.md cannot be written to"):
        write(Audit((cell(),), 1.0), page, "audit")


# Systems as methods need them.


def test_the_body_in_fluid_rights_itself():
    system, start = systems.body_in_fluid()
    up, rest = start.g @ start.a, [np.zeros(3)] * 3
    upright, capsized = (float(system.lagrangian(*rest, a, system.parameters)) for a in (up, -up))
    np.testing.assert_allclose(up, [0, 0, 1], atol=1e-15)
    assert upright == -capsized == pytest.approx(0.6)


def test_the_guiding_centre_has_the_lagrangian_of_littlejohn():
    """L = (A + u b)·ẋ − ½u² − m|B| in (φ, R, Z) with A = −(r²/2q, 0, ln R)/ρ and b = (R, −Z/q, (R − 1)/q)/S."""
    system, _ = systems.guiding_centre()
    q, rho, moment, R, Z, u = 2.0, 2e-3, 1.2, 1.3, -0.4, 0.6
    r2 = 0.3**2 + 0.4**2
    S, rates = np.sqrt(1 + r2 / q**2), np.array([0.2, -0.5, 0.7])
    A, b = np.array([-r2 / (2 * q), 0.0, -np.log(R)]) / rho, np.array([R, -Z / q, (R - 1) / q]) / S
    expected = (A + u * b) @ rates - 0.5 * u**2 - moment * S / R
    given = rates[:1], np.array([R, Z, u]), np.array([*rates[1:], 9.0])
    assert float(evaluate(system.lagrangian, *given, system.parameters)) == pytest.approx(expected, rel=1e-12)


def test_a_system_is_given_the_hamiltonian_and_the_left_rectangle_of_its_lagrangian():
    """ℋ = ½(μ − b)·J⁻¹(μ − b) + ½π²/m + U(n), Λ = hℓ, and on the group with ξ = (F − Fᵀ)ᵛ/2h."""
    J, b, mass, h = np.diag([1.0, 2.0, 3.0]), np.array([0.1, -0.2, 0.3]), 2.5, 0.2

    def lagrangian(xi, n, nu):
        return 0.5 * xi @ (J @ xi) + b @ xi + 0.5 * mass * nu @ nu - n[0] ** 3

    system = co.System(co.SO3(), lagrangian, additional=co.Trivial(1))
    xi, n, nu = np.array([0.3, -0.5, 0.4]), np.array([0.7]), np.array([-0.6])
    made = with_hamiltonian(system)
    mu, pi = J @ xi + b, mass * nu
    assert evaluate(made.hamiltonian, mu, n, pi) == pytest.approx(mu @ xi + pi @ nu - lagrangian(xi, n, nu), rel=1e-14)
    made = with_left_rectangle(system)
    expected = h * lagrangian(xi, n, nu)
    assert evaluate(made.discrete_lagrangian, xi, n, n + h * nu, h) == pytest.approx(expected, rel=1e-14)
    F = evaluate(co.SO3().exp, h * xi)
    turned = np.sin(h * np.linalg.norm(xi)) / (h * np.linalg.norm(xi)) * xi
    expected = h * lagrangian(turned, n, nu)
    assert evaluate(made.group_lagrangian, F, n, n + h * nu, h) == pytest.approx(expected, rel=1e-13)


def test_a_table_is_written_in_markdown():
    assert markdown(("a", "b"), [("1", "2")]) == "| a | b |\n|---|---|\n| 1 | 2 |"


def test_a_claim_is_shown_within_what_is_allowed_of_the_order_or_of_zero():
    assert order(2.1 - 1e-12).shown and not order(2.2).shown and not order(1.8).shown and not order(np.nan).shown
    assert Finding("momentum", "kept", 1e-9, 1e-9).shown and not Finding("momentum", "kept", 2e-9, 1e-9).shown
    assert not order(2.0, failure="a step failed").shown


def test_a_failure_says_what_was_claimed_and_what_was_measured():
    short = cell(findings=(order(1.5), Finding("energy", "bounded", 0.5, 0.1)))
    stuck = cell(system="body", findings=(order(np.nan, failure="a step failed"),))
    lost = cell("Galerkin", system="curved", findings=(), refusal="It needs a flat space")
    audit = Audit((short, stuck, lost), 1.0)
    assert audit.failures == [
        "Midpoint over Cayley on top: order 2 is claimed, 1.50 was measured.",
        "Midpoint over Cayley on top: energy is off by 5.0e-01, more than 1.0e-01.",
        "Midpoint over Cayley on body: order could not be measured: a step failed.",
        "Galerkin has shown nothing, as it was refused everywhere: It needs a flat space",
    ]
    assert audit.refusals == ["Galerkin: It needs a flat space"]
    assert not audit.passed and not Audit((), 1.0).passed and Audit((cell(),), 1.0).passed
    found = summary(audit)
    assert found["passed"] is False and found["failures"] == audit.failures and len(found["cells"]) == 3
    assert found["cells"][0]["findings"][0] == {
        "claim": "order", "claimed": 2, "measured": 1.5, "allowed": 0.1, "shown": False, "failure": "",
    }  # fmt: skip


# Figures.


def test_each_panel_shows_the_methods_on_its_system_over_one_map():
    cells = [
        cell(convergence=measured(2.0)), cell(tau="Exponential", convergence=measured(2.5)),
        cell("Suzuki4", convergence=measured(4.0)), cell(system="body", convergence=measured(3.0)),
    ]  # fmt: skip
    top, body = order_figure(Audit(tuple(cells), 1.0)).axes[:2]
    assert (top.get_title(), body.get_title()) == ("top", "body")
    assert [line.get_label() for line in top.get_lines()[::2]] == ["Midpoint", "Suzuki4"]
    assert [line.get_label() for line in body.get_lines()[::2]] == ["Midpoint"]
    curve, fitted = (line.get_xydata() for line in body.get_lines())
    assert np.allclose(curve, np.stack([H, H**3], axis=1)) and np.allclose(fitted, curve[4:])
    assert top.get_ylabel() == "relative error at the end" and body.get_ylabel() == "step $h$ (s)".replace(
        "step $h$ (s)", ""
    )


def test_the_energy_error_of_each_fiftieth_is_its_largest():
    error = np.abs(np.sin(np.arange(200.0)))
    watched = cell(long_run=LongRun(np.arange(200.0), error, 1.0, 0.0, 0.0))
    (panel,) = energy_figure(Audit((watched, cell(system="body")), 1.0)).axes
    (curve,) = (line.get_xydata() for line in panel.get_lines())
    assert np.allclose(curve[:, 1], error.reshape(BINS, 4).max(axis=1)) and np.allclose(
        curve[:, 0], np.arange(3.0, 200, 4)
    )
