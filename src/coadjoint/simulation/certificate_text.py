"""The lines of a certificate, in its short form of five lines and in its long form."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from coadjoint.errors import printable
from coadjoint.mechanics.forces import INPUTS, INTERNAL, TIME
from coadjoint.mechanics.invariance import in_words
from coadjoint.mechanics.system import System
from coadjoint.mechanics.work_balance import changing_momentum, energy_lines
from coadjoint.methods.method import Method
from coadjoint.simulation import energy_budget
from coadjoint.simulation.accuracy.verdict import Accuracy
from coadjoint.simulation.certificate import certificate, factor_renewals, failure, iterations, share, step_sizes
from coadjoint.simulation.certificate_forms import Certificate, aligned
from coadjoint.simulation.monitors import budgets, changing, residuals
from coadjoint.simulation.result import Result
from coadjoint.texts import Table

Lines = Iterator[tuple[str, str]]
"""Titles and texts."""

MUST_VANISH = ("balance", "group_defect", "constraint_gap", "constraint_rate")
"""The residuals that the short form shows."""


def certificate_of(run: Result) -> Certificate:
    """The certificate in both forms."""
    return Certificate(printable(aligned(list(_short(run)))), printable(aligned(list(_long(run)))))


def _short(run: Result) -> Lines:
    """System and method, steps, accuracy, conserved quantities, and time; a line for each warning."""
    yield "system", f"{_system(run)}; {run.method.title}, {order(run.method, run.system)}"
    yield "steps", "; ".join(_steps(run))
    if run.accuracy is not None:
        yield "accuracy", "; ".join(text for _, text in accuracy_lines(run.accuracy))
    if kept := ", ".join(_conserved(run)):
        yield "conserved", kept
    yield from _end(run)


def _long(run: Result) -> Lines:
    """A line for each monitored quantity."""
    yield "system", _system(run)
    yield "method", f"{run.method.title}, {order(run.method, run.system)}"
    yield from _of_run(run) if run.members is None else _of_members(run, run.members)
    if run.plan.solution:
        renewals = factor_renewals(run)
        yield "solved", run.plan.solution + ("" if renewals is None else f", computed anew {renewals:,} times")
    yield "iterations", f"{iterations(run):.2f} a step, at most {int(np.max(run.position.iterations_max))}"
    yield from _end(run)


def _system(run: Result) -> str:
    many = "" if run.members is None else f"{run.members:,} × "
    return f"{many}{run.system.name} on {in_words(run.system.places)}"


def _end(run: Result) -> Lines:
    """The time, and a line for each warning."""
    speed = run.good_steps / run.seconds if run.seconds > 0 else float("inf")
    yield "time", f"{run.seconds:.3g} s, {speed:,.0f} steps/s, and {run.set_up_seconds:.3g} s to set up"
    yield from (("warning", sentence) for sentence in run.warnings)


def _done(run: Result) -> str:
    """The steps of a run, or of each member, that were done."""
    plan, position = run.plan, run.position
    single = run.members is None
    done = run.good_steps if single else plan.steps if position.complete else position.steps
    text = f"{done:,} steps of {plan.h:g} s" + ("" if single else " each")
    return text if done == plan.steps else f"{text}, stopped before {plan.steps:,}"


def _steps(run: Result) -> Iterator[str]:
    """The steps that were done, what ended them, members that failed, and saved nodes."""
    yield _done(run)
    if run.method.variable and run.members is None:
        yield _step_sizes_in_words(run)
    if run.plan.until:
        yield _event(run)
    if run.members is not None and (failed := int(np.count_nonzero(run.position.codes))):
        yield f"{failed:,} of {run.members:,} members failed"
    yield f"{run.count:,} nodes saved" + ("" if run.members is None else " a member")


def _event(run: Result) -> str:
    """How the event of `until` ended the run, or how many members it ended."""
    name = run.plan.events[0][1].title
    if run.event is None:
        return f"{name or 'the event'} never happened: the run went on to its end"
    if run.members is not None:
        return f"{name or 'the event'} ended {np.sum(np.isfinite(run.event)):,} of {run.members:,}"
    return f"{name or 'the event'} ended the run at t = {run.event:.10g} s"


def _conserved(run: Result) -> Iterator[str]:
    """What is conserved, the budgets and the residuals that must vanish, each with its largest change or value."""
    good = slice(None) if run.members is None else run.position.codes == 0
    quantities = {name for name, _ in run.system.quantities}
    for name, title in (*changing(run.system), *((one.name, one.title) for one in budgets())):
        second = name == "discrete_energy" and "energy" in run.ends
        if name not in run.ends or name in quantities or second or driven(run, name) or not _known(run, name):
            continue
        if name.endswith("_budget") and run.members is None:
            yield f"{title} to {certificate(run)[f'{name}_error_max']:.1e}"
        else:
            change, sizes = np.atleast_1d(run.relative_changes(name))[good], np.atleast_1d(run.sizes(name))[good]
            if len(change):
                relative = np.all((sizes > 0) | (change == 0))
                yield f"{title} to {np.max(change):.1e}{'' if relative else ' (absolute)'}"
    for one in residuals():
        if one.name in MUST_VANISH and one.name in run.extrema:
            yield f"{one.title} to {np.max(run.extrema[one.name][1]):.1e}"


def driven(run: Result, name: str) -> bool:
    """Whether forces, reactions or jumps change a monitored quantity, so that its budget shows the error."""
    if name == "kelvin_noether":
        return "kelvin_noether_budget" in run.ends and bool(changing_momentum(run.system))
    return name in ("energy", "discrete_energy") and "energy_budget" in run.ends


def _known(run: Result, name: str) -> bool:
    return name != "energy" or energy_budget.energy_known(run)


def _of_run(run: Result) -> Lines:
    """The lines of a single run between its method and how its equations were solved."""
    c, plan = certificate(run), run.plan
    yield "steps", _done(run)
    if plan.until:
        yield "event", _event(run)
    if run.crossed:
        yield "events", ", ".join(f"{name}: {len(states):,}" for name, states in run.crossed.items())
    if run.method.variable:
        yield "step size", _step_sizes_in_words(run)
    yield "saved", f"{run.count:,} nodes, every {plan.save_every}, float64"
    yield from accuracy_lines(run.accuracy)
    for name, title in changing(run.system):
        if f"{name}_initial" in c:
            yield title, _change(run, c, name) if _known(run, name) else "not known, see the warning"
    if "energy_budget_error_max" in c:
        yield "energy budget", energy_budget.in_words(run)
    momentum = [(f"{one.name}_error_max", one) for one in budgets() if one.largest]
    for key, one in (*momentum, *((f"{one.name}_max", one) for one in residuals())):
        if key in c:
            yield one.title, f"{c[key]:.1e}  {one.largest}"


def _of_members(run: Result, count: int) -> Lines:
    """The lines of an ensemble."""
    failed = np.flatnonzero(run.position.codes)
    yield "steps", _done(run)
    yield "saved", f"{run.count:,} nodes a member, every {run.plan.save_every}, float64"
    yield "finished", f"{count - len(failed):,} of {count:,}"
    yield from accuracy_lines(run.accuracy)
    if run.event is not None:
        yield "event", _event(run)
    for name, members in run.crossed.items():
        yield "events", f"{name}: {sum(map(len, members)):,} in all members"
    yield from (("failed", f"member {index}: {failure(run, index)}") for index in failed[:5])
    for name, title in (*changing(run.system), *((one.name, one.title) for one in reversed(budgets()))):
        if name in run.ends and name != "discrete_energy" and not driven(run, name):
            good = run.position.codes == 0
            change, relative = run.relative_changes(name)[good], run.sizes(name)[good] > 0
            for kind, some in (("relative", change[relative]), ("absolute", change[~relative])):
                if len(some):
                    of = "" if len(some) == len(change) else f" of {len(some):,} of {len(change):,}"
                    yield title, f"largest {kind} change{of}: median {np.median(some):.2e}, worst {np.max(some):.2e}"
    for one in residuals():
        if one.name in run.extrema:
            yield one.title, f"{np.max(run.extrema[one.name][1]):.1e}  worst of all members"


def accuracy_lines(found: Accuracy | None) -> list[tuple[str, str]]:
    """The line on accuracy: the local error, or that dt does not resolve the motion; and that on the trajectory."""
    if found is None:
        return []
    if found.trajectory is not None:
        until = "" if found.holds is None else f"; under 10 % until t = {found.holds:.6g} s only"
        whole = f"error {found.trajectory:.1e} of how far the run goes, largest, by a run of dt/2{until}"
        return [*accuracy_lines(replace(found, trajectory=None)), ("trajectory", whole)]
    if not found.resolved:
        return [("accuracy", f"unresolved: {'; '.join(found.reasons)}; dt = {found.resolving:.2g} would do")]
    turn = f"; h‖ξ‖ ≤ {found.turn:.2g} of 1" if found.turn > 1e-9 else ""
    turn += f"; h × fastest rate {found.rate:.2g}" if found.rate else ""
    where = f"{found.part}, t = {found.when:.4g} s"
    worst = f"local error {found.worst:.1e} of what a step moves, largest of {found.count} ({where}){turn}"
    return [("accuracy", worst)]


def order(method: Method, system: System) -> str:
    """The order of convergence as text; start velocities used as discrete ones have an error of O(h)."""
    if method.start == "velocity" and method.order > 1:
        return "order 1, because it starts by velocities"
    with_internal = method.claims.order_with_internal
    if system.internal is not None and with_internal < method.order:
        return f"order {method.order}, {with_internal} where its internal state acts"
    return f"order {method.order}"


def _change(run: Result, c: Table, name: str) -> str:
    """A quantity at the start, with its largest change; at both ends if forces or reactions change it."""
    first, last = (np.ravel(value) for value in run.ends[name])
    shown = f"{first[0]:.10g}" if len(first) == 1 else f"{len(first)} quantities, norm {np.linalg.norm(first):.6g}"
    if driven(run, name):
        end = last[0] if len(last) == 1 else np.linalg.norm(last)
        return f"{shown} at the start, {end:.6g} at the end; {_causes(run.system, name)}"
    size = run.sizes(name)
    kind = "relative" if size > 0 else "absolute"
    motion = ", of the largest kinetic energy" if size > np.linalg.norm(first) else ""
    errors = f"{c[f'{name}_error_max']:.2e}, at the end {c[f'{name}_error_final']:.2e}"
    return f"{shown}; largest {kind} change {errors}{motion}"


def _causes(system: System, name: str) -> str:
    """What changes the energy or the Kelvin–Noether quantities, as a clause."""
    words = {TIME: "explicit time", INPUTS: "jumps of inputs", INTERNAL: "jumps of the internal state"}
    words |= {one.name: f"the reaction of `{one.name}`" for one in system.constraints}
    lines = changing_momentum(system) if name == "kelvin_noether" else energy_lines(system)
    found = list(dict.fromkeys(words.get(line, "forces") for line in lines))
    plural = len(found) > 1 or found[0].startswith(("forces", "jumps"))
    return f"{', '.join(found[:-1])}{' and ' * (len(found) > 1)}{found[-1]} {'change' if plural else 'changes'} it"


def _step_sizes_in_words(run: Result) -> str:
    found = step_sizes(run)
    bounds = f"{found['step_size_min']:.4g} to {found['step_size_max']:.4g} s, " if "step_size_min" in found else ""
    return f"{bounds}to t = {found['time_final']:.6g} s; {share(run)}"
