"""What is true passes the audit, and what is false does not."""

from __future__ import annotations

import json
from pathlib import Path

import jax
import numpy as np
import pytest
import wrong

import coadjoint as co
import coadjoint.methods
from coadjoint.audit import long_run
from coadjoint.audit.audit import audit, audit_cell
from coadjoint.audit.long_run import drift
from coadjoint.audit.order import fit
from coadjoint.audit.shipped import FOR_EVERY_METHOD, MAPS, SHIPPED, Shipped, audited
from coadjoint.audit.stepper import AuditStepper, coordinates, exact, uncertainty
from coadjoint.audit.systems import PROBLEMS
from coadjoint.cli import auditing
from coadjoint.cli.commands import Audit
from coadjoint.cli.main import main
from coadjoint.errors import ArgumentError, GroupError
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.continuous import reference
from coadjoint.simulation.configuration import method_form, method_from

STEPS = 5_000
TOP = PROBLEMS["heavy top"]
CAYLEY = {"Cayley": co.Cayley()}
BY_NAME = {shipped.name: shipped for shipped in SHIPPED}


def findings(shipped: Shipped, tau: co.difference_maps.DifferenceMap, problem=TOP):
    cell = audit_cell(shipped, "a map", tau, problem, STEPS)
    return {found.claim: found for found in cell.findings}


def not_shown(found) -> set[str]:
    return {claim for claim, finding in found.items() if not finding.shown}


def test_every_public_method_is_audited():
    named = [getattr(co.methods, name) for name in co.methods.__all__]
    public = {kind for kind in named if issubclass(kind, co.methods.Method)} - {co.methods.Method, co.methods.Step}
    audited = {type(shipped.make(co.Cayley())) for shipped in SHIPPED}
    assert public == audited, f"not in coadjoint.audit.shipped: {public - audited}"


def test_every_audited_method_is_written_with_a_stored_run_and_read_again():
    for shipped in SHIPPED:
        method = shipped.make(co.Exponential())
        assert method_from(json.loads(json.dumps(method_form(method)))) == method, shipped.name


def test_what_is_left_out_leaves_every_claim_of_order_to_four_systems():
    """Over every map that a method is audited with; the curved system is not counted, where most orders do not show."""
    flat = [problem for problem in PROBLEMS.values() if problem.system.additional.flat]
    for shipped in SHIPPED:
        for tau in FOR_EVERY_METHOD:
            assert sum(audited(shipped, tau, problem) for problem in flat) >= (2 if shipped.first_order else 5)
        assert audited(shipped, "a map of one's own", TOP) != shipped.first_order
    for tau in set(MAPS) - set(FOR_EVERY_METHOD):
        assert sum(audited(BY_NAME["Midpoint"], tau, problem) for problem in PROBLEMS.values()) == 4
    by_cayley = [problem for problem in PROBLEMS.values() if problem.internal or problem.constrained]
    assert by_cayley and all(audited(BY_NAME["Midpoint"], "Cayley", problem) for problem in by_cayley)
    assert not any(audited(BY_NAME["Midpoint"], tau, one) for tau in set(MAPS) - {"Cayley"} for one in by_cayley)


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("name", ["heavy top", "plane motion"])
def test_order_8_of_a_single_step_shows(name):
    found = audit_cell(BY_NAME["Galerkin(degree=4)"], "Cayley", co.Cayley(), PROBLEMS[name], STEPS)
    order = next(finding for finding in found.findings if finding.claim == "order")
    assert order.claimed == 8
    assert order.measured == pytest.approx(8, abs=0.2)
    assert found.convergence is not None and found.convergence.fitted.sum() == 4
    assert found.shown


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize(
    "name", ["LeftRectangle", "Midpoint", "HamiltonianMidpoint", "Variational", "Suzuki4(LeftRight)"]
)
def test_a_method_shows_what_it_claims(name):
    found = findings(BY_NAME[name], co.Exponential())
    assert not not_shown(found)
    assert {"order", "symplectic", "momentum", "energy"} <= set(found)


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("tau", [co.Cayley(), co.Exponential()], ids=repr)
def test_the_variable_step_shows_its_order_and_an_exact_discrete_energy(tau):
    """Over the exponential many steps of this top are fixed, and tell so; the claim is about the others."""
    found = findings(BY_NAME["VariableStep(Simpson)"], tau)
    assert set(found) == {"order", "momentum", "energy"}
    assert not not_shown(found) and found["energy"].measured <= 1e-14


@pytest.mark.long
def test_forces_leave_the_order_of_a_symmetric_pair():
    found = findings(BY_NAME["LeftRight"], co.Cayley(), PROBLEMS["driven top"])
    assert set(found) == {"order", "symmetric"}
    assert not not_shown(found)


@pytest.mark.long
@pytest.mark.parametrize("problem", ["predators", "guiding centre"])
def test_a_method_of_first_order_shows_what_it_claims(problem):
    found = findings(BY_NAME["ProjectedMidpoint"], co.Cayley(), PROBLEMS[problem])
    assert set(found) >= {"order", "symmetric", "energy"}
    assert not not_shown(found)


@pytest.mark.long
def test_a_rule_without_potential_is_its_own_adjoint():
    found = findings(BY_NAME["LeftRectangle"], co.Cayley(), PROBLEMS["free rigid body"])
    assert found["order"].claimed == 2
    assert not not_shown(found)


@pytest.mark.long
def test_a_false_half_has_order_3_and_no_symmetry():
    """Mathematics, section 6: "with F = cay(hξ) and H = cay(hξ/2) every composition falls to order 3"."""
    found = findings(wrong.FALSE_HALF, co.Cayley())
    assert not_shown(found) == {"order", "symmetric"}
    assert found["order"].measured == pytest.approx(3, abs=0.2)
    assert not not_shown(findings(wrong.FALSE_HALF, co.difference_maps.Squared(co.Cayley())))


@pytest.mark.long
def test_a_step_that_is_not_symplectic_is_found():
    found = findings(Shipped("losing", wrong.Losing), co.Cayley())
    assert not_shown(found) == {"symmetric", "symplectic", "momentum", "energy"}
    assert found["energy"].measured > 1


@pytest.mark.long
def test_an_approximate_tangent_of_the_map_breaks_momentum_and_two_form():
    printed = Shipped("as printed", wrong.AsPrinted, wrong.unverified)
    assert {"symplectic", "momentum"} <= set(findings(printed, co.Exponential()))
    assert not not_shown(findings(printed, co.Exponential()))
    assert {"symplectic", "momentum"} <= not_shown(findings(printed, wrong.Truncated()))
    # Transport of the momentum does not need dτ⁻¹, so that it stays; the two-form does not.
    found = findings(Shipped("LeftRectangle", co.LeftRectangle, wrong.unverified), wrong.Truncated())
    assert "symplectic" in not_shown(found)
    assert found["momentum"].shown


@pytest.mark.long
def test_a_map_with_a_wrong_closed_form_makes_an_audit_fail():
    """Its system refuses it, and what is refused everywhere is not passed over, whatever the other maps show."""
    maps = {**CAYLEY, "truncated": wrong.Truncated()}
    found = audit([BY_NAME["LeftRectangle"]], maps, [TOP], steps=STEPS, progress=False)
    assert all(cell.shown for cell in found.cells)
    assert not found.passed
    (sentence,) = found.failures
    assert sentence.startswith("truncated has shown nothing") and "`_dtau_inverse_dual`" in sentence


def test_what_cannot_be_measured_is_not_shown():
    class Stuck(co.Midpoint):
        def equations(self, system, record, h):
            return super().equations(system, record, h) + 1e3 * record.xi**2 + 1e3

    cell = audit_cell(Shipped("stuck", Stuck), "Cayley", co.Cayley(), TOP, STEPS)
    assert not cell.shown
    assert all(found.failure for found in cell.findings)
    assert not audit([], CAYLEY, [TOP], steps=STEPS).passed, "an audit of nothing shows nothing"


def test_a_method_is_not_asked_where_it_refuses():
    curved = PROBLEMS["pendulum on body"]
    found = audit([BY_NAME["MuntheKaas"]], CAYLEY, [TOP, curved], steps=STEPS, progress=False)
    assert found.passed
    (refusal,) = found.refusals
    assert refusal.startswith("MuntheKaas: needs a flat space of additional dynamics") and "but got" not in refusal
    assert not audit([BY_NAME["MuntheKaas"]], CAYLEY, [curved], progress=False).passed, "it has shown nothing"


@pytest.mark.long
def test_energy_is_exact_where_that_is_claimed():
    for name, problem, expected in (
        ("EnergyMomentum", TOP, True),
        ("EnergyMomentum", PROBLEMS["plane motion"], False),
        ("EnergyMomentum(points=4)", PROBLEMS["plane motion"], True),
    ):
        found = findings(BY_NAME[name], co.Cayley(), problem)
        assert not not_shown(found)
        assert "symplectic" not in found
        assert ("energy" in found) is expected
        assert not expected or found["energy"].measured < 1e-13


@pytest.mark.parametrize("p", [1, 4, 8])
def test_the_slope_leaves_out_round_off_and_coarse_steps(p):
    """e = hᵖ(1 + h) + 1e-12 noise, over factors √2 from h = 1."""
    h = 2.0 ** (-np.arange(20) / 2)
    error = h**p * (1 + h) + 1e-12 * np.abs(np.sin(np.arange(20)))
    found = fit(h, error, error > 5e-11, 4)
    assert found.order == pytest.approx(p, abs=0.2)
    assert p < 8 or abs(np.polyfit(np.log(h), np.log(error), 1)[0] - p) > 0.5, "with round-off the slope is another"
    assert np.isnan(fit(h[:2], error[:2], np.ones(2, bool), 6).order)


def test_drift_of_errors_that_stay_that_wander_and_that_grow():
    t = np.arange(1, 10_001) / 10_000
    wave = np.abs(np.sin(9_000 * t))
    assert drift(wave) < 0.02
    assert drift(wave * (1.5 + np.sin(17 * t))) < 0.2, "a slow exchange is no drift"
    assert 1 < drift(np.sqrt(t) * wave) < 1.3
    assert drift(t * wave) == pytest.approx(2, abs=0.1)
    assert drift(np.arange(10_000) + 0.5) == pytest.approx(2, rel=1e-6), "a straight line has no scatter to take off"


FLAT = ["heavy top", "body in fluid", "free rigid body", "rigid motion", "plane motion", "driven top"]


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("name", FLAT)
def test_the_reference_is_the_motion_that_dop853_finds(name):
    problem = PROBLEMS[name]
    end = problem.start.t + problem.duration
    found = jax.tree.map(lambda row: row[-1], reference(problem.system, problem.start, [problem.start.t, end]))
    ours = coordinates(exact(problem, float(end)))
    assert np.linalg.norm(coordinates(found) - ours) <= 3e-13 * np.linalg.norm(ours)
    assert uncertainty(problem) <= 2e-13


@pytest.mark.long
def test_the_command_writes_a_table_a_page_numbers_and_figures(tmp_path, capsys):
    assert main(["audit", "--quick", "--method", "midpoint", "--system", "heavy top", "--out", str(tmp_path)]) == 0
    out = capsys.readouterr().out
    assert "5 of 5 claims shown" in out
    page = (tmp_path / "audit.md").read_text()
    assert "| Midpoint | Cayley | 2 | 2.00 |" in page
    assert "coadjoint audit --quick --method midpoint" in page
    numbers = json.loads((tmp_path / "audit.json").read_text())
    assert numbers["passed"] and len(numbers["cells"]) == 1
    assert {path.name for path in (tmp_path / "figures").iterdir()} == {"audit_orders.png", "audit_energy.png"}


def test_the_command_fails_where_a_claim_does(monkeypatch, capsys):
    monkeypatch.setattr(auditing, "SHIPPED", (Shipped("Losing", wrong.Losing),))
    assert main(["audit", "--quick", "--system", "heavy top"]) == 1
    shown = capsys.readouterr()
    assert "NO" in shown.out
    assert "Losing over Cayley on heavy top: symplectic is off by" in shown.err
    assert main(["audit", "--quick", "--system", "heavy top", "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["passed"] is False


def test_the_page_of_an_audit_has_the_command_line_that_made_it():
    made = Audit(out=Path("there"), quick=True, method=("Midpoint", "Suzuki4"), system=("heavy top",))
    assert made._written() == 'coadjoint audit --quick --method Midpoint Suzuki4 --system "heavy top" --out there'
    assert Audit()._written() == "coadjoint audit"


@pytest.mark.parametrize(("flag", "name"), [("--method", "Midpiont"), ("--system", "heavy tops")])
def test_names_that_are_not_known_are_refused(flag, name, capsys):
    assert main(["audit", flag, name]) == 2
    err = capsys.readouterr().err
    assert "did you mean" in err
    assert err.count("\n") == 1


@pytest.mark.long
@pytest.mark.parametrize("name", PROBLEMS)
def test_every_claim_of_every_method_is_shown(name):
    cells = audit(problems=[PROBLEMS[name]], progress=False).cells
    assert not [cell for cell in cells if not cell.shown]
    assert sum(bool(cell.findings) for cell in cells) >= 10


@pytest.mark.long
def test_some_system_takes_every_method_and_every_map():
    def takes(shipped, tau, problem) -> bool:
        stepper = AuditStepper(shipped.make(MAPS[tau]), shipped.adapt(problem.system), problem.start)
        try:
            stepper.begin(0.1)
        except (ArgumentError, GroupError):
            return False
        return True

    for shipped in SHIPPED:
        assert any(takes(shipped, "Exponential", p) or takes(shipped, "Cayley", p) for p in PROBLEMS.values())
    for tau in MAPS:
        assert takes(BY_NAME["Midpoint"], tau, TOP)


def test_the_energy_of_a_record_is_that_of_legendre_unless_a_discrete_one_is_asked_for():
    J = np.array([1.0, 2.0, 3.0])
    body = co.System(co.SO3(), lambda xi, a: 0.5 * xi @ (J * xi) - 2 * a[2], advected=co.Defining())
    stepper = AuditStepper(co.Midpoint(), body, body.state(xi=[0.3, -0.2, 0.5], a0=[0, 0.6, 0.8]))
    legendre, discrete = (evaluate(long_run._energy(stepper, 0.1, one), stepper.start) for one in (False, True))
    assert legendre == pytest.approx(0.5 * (0.09 + 2 * 0.04 + 3 * 0.25) + 1.6, abs=1e-14)
    assert 1e-3 < abs(discrete - legendre) < 0.1


def test_the_gap_of_a_constrained_system_is_that_of_places_and_velocities():
    problem = PROBLEMS["pinned body"]
    start = problem.start
    off = start.replace(n=start.n + np.array([0, 0, 1e-3]))
    states = jax.tree.map(lambda *leaves: np.stack(leaves), start, off)
    assert long_run._gap(problem.system, jax.tree.map(lambda leaf: leaf[:1], states)) < 1e-15
    assert long_run._gap(problem.system, states) == pytest.approx(1e-3)
    assert long_run._gap(TOP.system, TOP.start) == 0


@pytest.mark.long
@pytest.mark.parametrize("name", ["Midpoint", "Suzuki4(Midpoint)"])
def test_constrained_systems_keep_their_constraints_order_and_reversibility(name):
    pinned = findings(BY_NAME[name], co.Cayley(), PROBLEMS["pinned body"])
    assert set(pinned) == {"order", "symmetric", "constraints", "momentum", "energy"}
    suslov = findings(BY_NAME[name], co.Cayley(), PROBLEMS["Suslov's body"])
    assert set(suslov) == {"order", "symmetric", "constraints", *(["energy"] if name == "Midpoint" else [])}
    assert not not_shown(pinned) | not_shown(suslov)
