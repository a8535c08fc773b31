"""The audit: every claim of every method over every difference map on every system, measured."""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np

from coadjoint.audit.findings import Audit, Cell, Claim, Finding
from coadjoint.audit.long_run import LongRun, long_run
from coadjoint.audit.one_step import irreversibility, symplectic_defect
from coadjoint.audit.order import Convergence, convergence
from coadjoint.audit.shipped import MAPS, SHIPPED, Shipped, audited
from coadjoint.audit.stepper import AuditStepper
from coadjoint.audit.systems import PROBLEMS, AuditSystem
from coadjoint.difference_maps import DifferenceMap
from coadjoint.errors import ArgumentError, GroupError, StepError
from coadjoint.simulation.progress import Progress

STEPS, QUICK_STEPS = 100_000, 20_000
"""Of a long run."""
ORDER_WITHIN = 0.2
SYMPLECTIC_WITHIN = 1e-11
"""Of the sum of the sizes of the terms of the two-form; what the differences resolve is near 1e-13."""
REVERSIBLE_WITHIN = 1e-11
"""Of the size of the state, after ten steps and back."""
DRIFT_WITHIN = 0.5
"""Of the mean error; an error that grows as the square root of time is above 1, one in proportion to time at 2."""
ROUND_OFF = float(np.finfo(float).eps)
"""What rounding adds to a momentum at each stage at worst, when all errors have one sign."""
ON_CONSTRAINTS = 1e-13
"""The largest |φ|, |φ̇| and |A·(ξ, ν) − b| at nodes, of systems whose sizes are of order one."""
WANDERING = 10 * ROUND_OFF
"""Times the square root of the number of stages: what rounding adds to an energy that is kept."""


def audit(
    methods: Sequence[Shipped] = SHIPPED,
    maps: dict[str, DifferenceMap] = MAPS,
    problems: Sequence[AuditSystem] = tuple(PROBLEMS.values()),
    *,
    steps: int = STEPS,
    progress: bool | None = None,
) -> Audit:
    """Measure the claims of `methods` over `maps` on `problems`; `steps` of the long runs."""
    began, cells = time.perf_counter(), []
    grid = [
        (shipped, tau, problem)
        for problem in problems
        for shipped in methods
        for tau in maps
        if audited(shipped, tau, problem)
    ]
    with Progress(len(grid), progress, "audit", "cells") as bar:
        for shipped, tau, problem in grid:
            cells.append(audit_cell(shipped, tau, maps[tau], problem, steps))
            bar.advance(1, time.perf_counter() - began)
    return Audit(tuple(cells), time.perf_counter() - began)


def audit_cell(shipped: Shipped, tau: str, difference_map: DifferenceMap, problem: AuditSystem, steps: int) -> Cell:
    """The findings of one method on one system, or the sentence by which it refuses it."""
    method = shipped.make(difference_map)
    claims = method.claims
    stepper = AuditStepper(method, shipped.adapt(problem.system), problem.start)
    h = long_step(claims.order)
    try:
        stepper.begin(h)
    except (ArgumentError, GroupError) as refusal:
        return Cell(shipped.name, tau, problem.name, claims.order, (), refusal=str(refusal))
    curves: dict[str, Convergence | LongRun] = {}

    def order() -> list[Finding]:
        curves["convergence"] = found = convergence(stepper, problem)
        expected = claims.order + claims.order % 2 * problem.of_velocity
        expected = claims.order_with_internal if problem.internal else expected
        few = "" if np.isfinite(found.order) else "fewer than three errors are clear of round-off"
        return [Finding("order", expected, found.order, ORDER_WITHIN, few)]

    def symmetric() -> list[Finding]:
        return [Finding("symmetric", "yes", irreversibility(stepper, h), REVERSIBLE_WITHIN)]

    def symplectic() -> list[Finding]:
        return [Finding("symplectic", "yes", symplectic_defect(stepper, h), SYMPLECTIC_WITHIN)]

    def kept() -> list[Finding]:
        curves["long_run"] = found = long_run(stepper, h, steps, claims.energy == "discrete")
        stages = steps * len(method.stages)
        round_off = WANDERING * np.sqrt(stages)
        findings = []
        if problem.constrained:
            findings.append(Finding("constraints", "exact", found.gap, ON_CONSTRAINTS))
        if claims.momentum and problem.holonomic and np.isfinite(found.momentum_error):
            findings.append(Finding("momentum", "exact", found.momentum_error, ROUND_OFF * stages))
        reversible = claims.symmetric and len(method.stages) == 1
        if claims.energy == "bounded" and (problem.holonomic or reversible):
            drift = found.drift if found.band > ROUND_OFF * stages else 0.0
            findings.append(Finding("energy", "bounded", max(drift, 0.0), DRIFT_WITHIN))
        elif claims.energy in ("exact", "discrete") or (claims.energy == "quadratic" and problem.quadratic):
            findings.append(Finding("energy", "exact", found.band, round_off))
        return findings

    highest = problem.highest if tau == "Cayley" else min(problem.highest, 8)
    measurements: list[tuple[Claim, bool, object]] = [
        ("order", problem.internal or claims.order <= highest, order),
        ("symmetric", claims.symmetric and not problem.internal, symmetric),
        ("symplectic", claims.symplectic and problem.conservative and not problem.constrained, symplectic),
        ("energy", problem.conservative, kept),
    ]
    findings: list[Finding] = []
    for claim, claimed, measure in measurements:
        if claimed:
            findings += _guarded(claim, measure)
    return Cell(shipped.name, tau, problem.name, claims.order, tuple(findings), **curves)  # type: ignore[arg-type]


def long_step(order: int) -> float:
    """The step of long runs, in s: so short that the remainder of backward error analysis, e^(−c/h), causes no
    drift."""
    return 0.05 if order == 1 else 0.1


def _guarded(claim: Claim, measure) -> list[Finding]:
    """The findings of a measurement, or one that says why it failed."""
    try:
        return measure()
    except StepError as error:
        return [Finding(claim, "yes", float("nan"), 0.0, str(error))]
