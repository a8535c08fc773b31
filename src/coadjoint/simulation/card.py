"""The certificate of a run, as numbers and as a card."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from coadjoint.kernels.newton.coupled import Factors
from coadjoint.mechanics.invariance import in_words
from coadjoint.simulation import step_sizes
from coadjoint.simulation.budget import budget, momentum_gap, sentence
from coadjoint.simulation.energy_warnings import energy_known
from coadjoint.simulation.monitors import budgets, changing, residuals

if TYPE_CHECKING:
    from coadjoint.mechanics.system import System
    from coadjoint.methods.method import Method
    from coadjoint.simulation.accuracy.judgement import Accuracy
    from coadjoint.simulation.ensemble import Ensemble
    from coadjoint.simulation.run import Run


def certificate(run: Run) -> dict[str, Any]:
    """What the card says, under plain names; errors are maxima over every step, relative unless the start is zero."""
    found: dict[str, Any] = {
        "system": run.system.name,
        "method": run.method.title,
        "steps": run.good_steps,
        "dt": run.dt,
        "newton_iterations_mean": run.newton_iterations_mean,
        "newton_iterations_max": run.position.iterations_max,
        "seconds": run.seconds,
        "set_up_seconds": run.set_up_seconds,
    }
    if (renewals := factor_renewals(run)) is not None:
        found["factor_renewals"] = renewals
    if run.plan.until:
        found["event"] = run.event
    if run.crossed:
        found["events"] = {name: len(states) for name, states in run.crossed.items()}
    found |= step_sizes.step_sizes(run)
    found |= accuracy_numbers(run.accuracy)
    if not run.count:
        return found
    for name, _ in changing(run.system):
        if name in run.ends:
            first, last = run.ends[name]
            found[f"{name}_initial"] = first.tolist()
            found[f"{name}_error_max"] = run.relative_change(name)
            found[f"{name}_error_final"] = float(np.linalg.norm(last - first)) / (run.size(name) or 1.0)
    found |= budget(run)
    if "kelvin_noether_budget" in run.ends:
        found["kelvin_noether_budget_error_max"] = momentum_gap(run)
    for one in residuals():
        if one.name in run.extrema:
            found[f"{one.name}_max"] = run.largest(one.name)
    return found


def accuracy_numbers(found: Accuracy | None) -> dict[str, Any]:
    """What was judged of a run's accuracy, under plain names."""
    if found is None:
        return {}
    return found.numbers()


def accuracy_line(found: Accuracy | None) -> list[tuple[str, str]]:
    """The accuracy in words: what dt leaves out, or that it does not resolve the motion."""
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
    """The order of convergence in words; velocities taken for discrete ones are off by O(h)."""
    if method.start == "velocity" and method.order > 1:
        return "order 1, because it starts by velocities"
    with_internal = method.claims.order_with_internal
    if system.internal is not None and with_internal < method.order:
        return f"order {method.order}, {with_internal} where its internal state acts"
    return f"order {method.order}"


def card(run: Run) -> str:
    """The certificate as text."""
    c = certificate(run)
    lines = [
        ("system", f"{c['system']} on {in_words(run.system.places)}"),
        ("method", f"{c['method']}, {order(run.method, run.system)}"),
    ]
    done = f"{run.good_steps:,} steps of {run.dt:g} s"
    lines.append(("steps", done if run.good_steps == run.steps else f"{done}, stopped before {run.steps:,}"))
    if run.plan.until:
        ended = "never happened: the run went on to its end"
        lines.append(("event", ended if run.event is None else f"ended the run at t = {run.event:.10g} s"))
    if run.crossed:
        lines.append(("events", ", ".join(f"{name}: {len(states):,}" for name, states in run.crossed.items())))
    if run.method.variable:
        lines.append(("step size", step_sizes.sentence(run)))
    lines.append(("saved", f"{run.count:,} nodes, every {run.plan.save_every}, float64"))
    lines += accuracy_line(run.accuracy)
    for name, title in changing(run.system):
        if f"{name}_initial" in c:
            known = name != "energy" or energy_known(run)
            lines.append((title, _change(c, name, run.size(name) > 0) if known else "not known, see the warning"))
    if "energy_budget_error_max" in c:
        lines.append(("energy budget", sentence(run)))
    momentum = [(f"{one.name}_error_max", one) for one in budgets() if one.largest]
    for key, one in (*momentum, *((f"{one.name}_max", one) for one in residuals())):
        if key in c:
            lines.append((one.title, f"{c[key]:.1e}  {one.largest}"))
    lines += solution_line(run)
    lines.append(("iterations", f"{c['newton_iterations_mean']:.2f} a step, at most {c['newton_iterations_max']}"))
    speed = run.good_steps / run.seconds if run.seconds > 0 else float("inf")
    lines.append(("time", f"{run.seconds:.3g} s, {speed:,.0f} steps/s, and {run.set_up_seconds:.3g} s to set up"))
    lines += [("warning", sentence) for sentence in run.warnings]
    width = max(len(title) for title, _ in lines)
    return "\n".join(f"{title:<{width}}  {text}" for title, text in lines)


def solution_line(run: Run | Ensemble) -> list[tuple[str, str]]:
    """How the equations of a step were solved, where that is not Newton's method in machine code."""
    if not run.plan.solution:
        return []
    renewals = factor_renewals(run)
    anew = "" if renewals is None else f", computed anew {renewals:,} times"
    return [("solved", run.plan.solution + anew)]


def factor_renewals(run: Run | Ensemble) -> int | None:
    """How many times factors that go on from step to step were computed, by all members; None where there are none."""
    memory = run.position.state.memory
    return int(np.sum(memory.renewals)) if isinstance(memory, Factors) else None


def _change(c: dict[str, Any], name: str, relative: bool) -> str:
    first = np.ravel(c[f"{name}_initial"])
    shown = f"{first[0]:.10g}" if len(first) == 1 else f"{len(first)} quantities, norm {np.linalg.norm(first):.6g}"
    kind = "relative" if relative else "absolute"
    return f"{shown}; largest {kind} change {c[f'{name}_error_max']:.2e}, at the end {c[f'{name}_error_final']:.2e}"


def _members_steps(ensemble: Ensemble) -> str:
    plan, position = ensemble.plan, ensemble.position
    done = plan.steps if position.complete else position.steps
    return f"{done:,} steps of {plan.h:g} s each" + ("" if done == plan.steps else f", stopped before {plan.steps:,}")


def ensemble_card(ensemble: Ensemble) -> str:
    """The certificate of an ensemble as text."""
    count, plan = ensemble.members.count, ensemble.plan
    failed = ensemble.failures
    lines = [
        ("system", f"{count:,} × {ensemble.system.name} on {in_words(ensemble.system.places)}"),
        ("method", f"{ensemble.method.title}, {order(ensemble.method, ensemble.system)}"),
        ("steps", _members_steps(ensemble)),
        ("saved", f"{ensemble.count:,} nodes a member, every {plan.save_every}, float64"),
        ("finished", f"{count - len(failed):,} of {count:,}"),
        *accuracy_line(ensemble.accuracy),
    ]
    if ensemble.event is not None:
        lines.append(("event", f"ended {np.sum(np.isfinite(ensemble.event)):,} of {count:,}"))
    for name, members in ensemble.crossed.items():
        lines.append(("events", f"{name}: {sum(map(len, members)):,} in all members"))
    lines += [("failed", f"member {index}: {what}") for index, what in list(failed.items())[:5]]
    for name, title in (*changing(ensemble.system), *((one.name, one.title) for one in reversed(budgets()))):
        if name in ensemble.ends and name != "discrete_energy":
            good = ensemble.codes == 0
            change, relative = ensemble.relative_changes(name)[good], ensemble.sizes(name)[good] > 0
            for kind, some in (("relative", change[relative]), ("absolute", change[~relative])):
                if len(some):
                    worst = f"median {np.median(some):.2e}, worst {np.max(some):.2e}"
                    count = "" if len(some) == len(change) else f" of {len(some):,} of {len(change):,}"
                    lines.append((title, f"largest {kind} change{count}: {worst}"))
    for one in residuals():
        if one.name in ensemble.extrema:
            lines.append((one.title, f"{np.max(ensemble.extrema[one.name][1]):.1e}  worst of all members"))
    lines += solution_line(ensemble)
    done = int(np.sum(ensemble.steps_done))
    lines.append(("iterations", f"{np.sum(ensemble.iterations) / max(done, 1):.2f} a step"))
    speed = done / ensemble.seconds if ensemble.seconds > 0 else float("inf")
    lines.append(("time", f"{ensemble.seconds:.3g} s, {speed:,.0f} steps/s, {ensemble.set_up_seconds:.3g} s to set up"))
    lines += [("warning", sentence) for sentence in ensemble.warnings]
    width = max(len(title) for title, _ in lines)
    return "\n".join(f"{title:<{width}}  {text}" for title, text in lines)
