"""The certificate of a run, as plain numbers and as text."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from coadjoint.kernels.newton.coupled import Factors
from coadjoint.kernels.program import Code
from coadjoint.mechanics.invariance import in_words
from coadjoint.mechanics.system import System
from coadjoint.methods.method import Method
from coadjoint.simulation import energy_budget
from coadjoint.simulation.accuracy.verdict import Accuracy
from coadjoint.simulation.monitors import budgets, changing, residuals
from coadjoint.simulation.result import Result
from coadjoint.texts import Table

Lines = Iterator[tuple[str, str]]
"""Titles and texts."""


def certificate(run: Result) -> dict[str, object]:
    """The certificate under plain names; errors are maxima over every step, relative unless the start is zero.

    That of an ensemble has the system, the method, the accuracy and the time alone.
    """
    found: Table = {"system": run.system.name, "method": run.method.title}
    times = {"seconds": run.seconds, "set_up_seconds": run.set_up_seconds}
    accuracy = {} if run.accuracy is None else run.accuracy.numbers()
    if run.members is not None:
        return {**found, "dt": run.plan.h, **times, **accuracy}
    found |= {"steps": run.good_steps, "dt": run.plan.h, "newton_iterations_mean": _iterations(run)}
    found |= {"newton_iterations_max": run.position.iterations_max, **times}
    if (renewals := factor_renewals(run)) is not None:
        found["factor_renewals"] = renewals
    if run.plan.until:
        found["event"] = run.event
    if run.crossed:
        found["events"] = {name: len(states) for name, states in run.crossed.items()}
    found |= step_sizes(run)
    found |= accuracy
    if not run.count:
        return found
    for name, _ in changing(run.system):
        if name in run.ends:
            first, last = run.ends[name]
            found[f"{name}_initial"] = first.tolist()
            found[f"{name}_error_max"] = float(run.relative_changes(name))
            found[f"{name}_error_final"] = float(np.linalg.norm(last - first)) / (float(run.sizes(name)) or 1.0)
    found |= energy_budget.budget(run)
    if "kelvin_noether_budget" in run.ends:
        found["kelvin_noether_budget_error_max"] = energy_budget.momentum_gap(run)
    for one in residuals():
        if one.name in run.extrema:
            found[f"{one.name}_max"] = float(np.max(run.extrema[one.name][1]))
    return found


def card(run: Result) -> str:
    """The certificate as text."""
    many = "" if run.members is None else f"{run.members:,} × "
    lines = [
        ("system", f"{many}{run.system.name} on {in_words(run.system.places)}"),
        ("method", f"{run.method.title}, {order(run.method, run.system)}"),
        *(_of_run(run) if run.members is None else _of_members(run, run.members)),
        *_solution(run),
    ]
    most = int(np.max(run.position.iterations_max))
    lines.append(("iterations", f"{_iterations(run):.2f} a step, at most {most}"))
    speed = run.good_steps / run.seconds if run.seconds > 0 else float("inf")
    lines.append(("time", f"{run.seconds:.3g} s, {speed:,.0f} steps/s, and {run.set_up_seconds:.3g} s to set up"))
    lines += [("warning", sentence) for sentence in run.warnings]
    width = max(len(title) for title, _ in lines)
    return "\n".join(f"{title:<{width}}  {text}" for title, text in lines)


def _of_run(run: Result) -> Lines:
    """The lines of a single run between its method and how its equations were solved."""
    c, plan = certificate(run), run.plan
    done = f"{run.good_steps:,} steps of {plan.h:g} s"
    yield "steps", done if run.good_steps == plan.steps else f"{done}, stopped before {plan.steps:,}"
    if plan.until:
        ended = "never happened: the run went on to its end"
        yield "event", ended if run.event is None else f"ended the run at t = {run.event:.10g} s"
    if run.crossed:
        yield "events", ", ".join(f"{name}: {len(states):,}" for name, states in run.crossed.items())
    if run.method.variable:
        yield "step size", _step_sizes_in_words(run)
    yield "saved", f"{run.count:,} nodes, every {plan.save_every}, float64"
    yield from accuracy_line(run.accuracy)
    for name, title in changing(run.system):
        if f"{name}_initial" in c:
            known = name != "energy" or energy_budget.energy_known(run)
            yield title, _change(c, name, run.sizes(name) > 0) if known else "not known, see the warning"
    if "energy_budget_error_max" in c:
        yield "energy budget", energy_budget.in_words(run)
    momentum = [(f"{one.name}_error_max", one) for one in budgets() if one.largest]
    for key, one in (*momentum, *((f"{one.name}_max", one) for one in residuals())):
        if key in c:
            yield one.title, f"{c[key]:.1e}  {one.largest}"


def _of_members(run: Result, count: int) -> Lines:
    """The lines of an ensemble."""
    plan, position = run.plan, run.position
    done, failed = plan.steps if position.complete else position.steps, np.flatnonzero(position.codes)
    each = f"{done:,} steps of {plan.h:g} s each"
    yield "steps", each if done == plan.steps else f"{each}, stopped before {plan.steps:,}"
    yield "saved", f"{run.count:,} nodes a member, every {plan.save_every}, float64"
    yield "finished", f"{count - len(failed):,} of {count:,}"
    yield from accuracy_line(run.accuracy)
    if run.event is not None:
        yield "event", f"ended {np.sum(np.isfinite(run.event)):,} of {count:,}"
    for name, members in run.crossed.items():
        yield "events", f"{name}: {sum(map(len, members)):,} in all members"
    yield from (("failed", f"member {index}: {failure(run, index)}") for index in failed[:5])
    for name, title in (*changing(run.system), *((one.name, one.title) for one in reversed(budgets()))):
        if name in run.ends and name != "discrete_energy":
            good = position.codes == 0
            change, relative = run.relative_changes(name)[good], run.sizes(name)[good] > 0
            for kind, some in (("relative", change[relative]), ("absolute", change[~relative])):
                if len(some):
                    of = "" if len(some) == len(change) else f" of {len(some):,} of {len(change):,}"
                    yield title, f"largest {kind} change{of}: median {np.median(some):.2e}, worst {np.max(some):.2e}"
    for one in residuals():
        if one.name in run.extrema:
            yield one.title, f"{np.max(run.extrema[one.name][1]):.1e}  worst of all members"


def failure(run: Result, member: int) -> str:
    """How a member failed, and at which step."""
    code = Code(int(run.position.codes[member]))
    return f"{code.name.lower().replace('_', ' ')} at step {run.position.steps_done[member]}"


def accuracy_line(found: Accuracy | None) -> list[tuple[str, str]]:
    """The line on accuracy: the local error, or that dt does not resolve the motion."""
    if found is None:
        return []
    if found.trajectory is not None:
        until = "" if found.holds is None else f"; under 10 % until t = {found.holds:.6g} s only"
        whole = f"error {found.trajectory:.1e} of how far the run goes, largest, by a run of dt/2{until}"
        return [*accuracy_line(replace(found, trajectory=None)), ("trajectory", whole)]
    if not found.resolved:
        return [("accuracy", f"unresolved: {'; '.join(found.reasons)}; dt = {found.resolving:.2g} would do")]
    turn = f"; h‖ξ‖ ≤ {found.turn:.2g} of 1" if found.turn > 1e-9 else ""
    turn += f"; h × fastest rate {found.rate:.2g}" if found.rate else ""
    where = f"{found.part}, t = {found.when:.4g} s"
    return [
        (
            "accuracy",
            f"local error {found.worst:.1e} of what a step moves, largest of {found.count} ({where}){turn}",
        )
    ]


def order(method: Method, system: System) -> str:
    """The order of convergence as text; start velocities used as discrete ones have an error of O(h)."""
    if method.start == "velocity" and method.order > 1:
        return "order 1, because it starts by velocities"
    with_internal = method.claims.order_with_internal
    if system.internal is not None and with_internal < method.order:
        return f"order {method.order}, {with_internal} where its internal state acts"
    return f"order {method.order}"


def _solution(run: Result) -> Lines:
    """The line on the solver of a step, if it is not Newton's method in machine code."""
    if run.plan.solution:
        renewals = factor_renewals(run)
        anew = "" if renewals is None else f", computed anew {renewals:,} times"
        yield "solved", run.plan.solution + anew


def factor_renewals(run: Result) -> int | None:
    """How many times factors that pass from step to step were computed, over all members; None without factors."""
    memory = run.position.state.memory
    return int(np.sum(memory.renewals)) if isinstance(memory, Factors) else None


def _iterations(run: Result) -> float:
    """Newton's iterations a step."""
    return float(np.sum(run.position.iterations)) / max(run.good_steps, 1)


def _change(c: Table, name: str, relative: Any) -> str:
    first = np.ravel(c[f"{name}_initial"])
    shown = f"{first[0]:.10g}" if len(first) == 1 else f"{len(first)} quantities, norm {np.linalg.norm(first):.6g}"
    kind = "relative" if relative else "absolute"
    return f"{shown}; largest {kind} change {c[f'{name}_error_max']:.2e}, at the end {c[f'{name}_error_final']:.2e}"


def step_sizes(run: Result) -> Table:
    """Where a variable method ended, how many of its steps were fixed, and the bounds of h where it was monitored."""
    if not run.method.variable:
        return {}
    state = run.position.state
    found = {"time_final": float(state.t), "steps_fixed": round(float(state.memory.fixed))}
    if "step_size" in run.extrema:
        low, high = run.extrema["step_size"]
        found |= {"step_size_min": float(low), "step_size_max": float(high)}
    return found


def _step_sizes_in_words(run: Result) -> str:
    found = step_sizes(run)
    bounds = f"{found['step_size_min']:.4g} to {found['step_size_max']:.4g} s, " if "step_size_min" in found else ""
    return f"{bounds}to t = {found['time_final']:.6g} s; {_share(run)}"


def _share(run: Result) -> str:
    """How many steps were fixed."""
    fixed, steps = step_sizes(run)["steps_fixed"], max(run.good_steps, 1)
    if not fixed:
        return "no step fixed"
    return f"{fixed:,} of {steps:,} steps ({fixed / steps:.2%}) fixed at dt"


def fixed_steps(run: Result) -> list[str]:
    """A warning where the method fell back to fixed steps: over those the discrete energy is not held."""
    if not step_sizes(run).get("steps_fixed"):
        return []
    return [
        f"{_share(run).capitalize()}: no other h holds the energy there, or any h does, as at a relative equilibrium. "
        "Try the base co.Simpson(), or a smaller dt."
    ]
