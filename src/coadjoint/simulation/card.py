"""The certificate of a run, as numbers and as a card."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from coadjoint.simulation import step_sizes
from coadjoint.simulation.budget import budget, momentum_gap, sentence

if TYPE_CHECKING:
    from coadjoint.methods.method import Method
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
    if run.plan.program.stops:
        found["event"] = run.event
    found |= step_sizes.step_sizes(run)
    if not run.count:
        return found
    for name in ("energy", "discrete_energy", "kelvin_noether", *dict(run.system.quantities)):
        if name in run.ends:
            first, last = run.ends[name]
            found[f"{name}_initial"] = first.tolist()
            found[f"{name}_error_max"] = run.relative_change(name)
            found[f"{name}_error_final"] = float(np.linalg.norm(last - first)) / (run.size(name) or 1.0)
    found |= budget(run)
    if "kelvin_noether_budget" in run.ends:
        found["kelvin_noether_budget_error_max"] = momentum_gap(run)
    for name in ("balance", "newton_residual", "group_defect"):
        if name in run.extrema:
            found[f"{name}_max"] = run.largest(name)
    return found


def order(method: Method) -> str:
    """The order of convergence in words; velocities taken for discrete ones are off by O(h)."""
    if method.start == "velocity" and method.order > 1:
        return "order 1, because it starts by velocities"
    return f"order {method.order}"


def card(run: Run) -> str:
    """The certificate as text."""
    c = certificate(run)
    lines = [
        ("system", f"{c['system']} on {run.system.group!r}"),
        ("method", f"{c['method']}, {order(run.method)}"),
    ]
    done = f"{run.good_steps:,} steps of {run.dt:g} s"
    lines.append(("steps", done if run.good_steps == run.steps else f"{done}, stopped before {run.steps:,}"))
    if run.plan.program.stops:
        ended = "never happened: the run went on to its end"
        lines.append(("event", ended if run.event is None else f"ended the run at t = {run.event:.10g} s"))
    if run.method.variable:
        lines.append(("step size", step_sizes.sentence(run)))
    lines.append(("saved", f"{run.count:,} nodes, every {run.plan.save_every}, float64"))
    for name, title in (
        ("energy", "energy"),
        ("discrete_energy", "energy, discrete"),
        ("kelvin_noether", "Kelvin–Noether"),
        *((name, name.replace("_", " ")) for name, _ in run.system.quantities),
    ):
        if f"{name}_initial" in c:
            lines.append((title, _change(c, name, run.size(name) > 0)))
    if "energy_budget_error_max" in c:
        lines.append(("energy budget", sentence(run)))
    for key, title, what in (
        ("kelvin_noether_budget_error_max", "momentum budget", "Kelvin–Noether less what was put in, largest change"),
        ("balance_max", "balance", "Kelvin–Noether balance, largest residual, relative"),
        ("newton_residual_max", "Newton", "largest residual, relative"),
        ("group_defect_max", "group defect", "largest distance from the group"),
    ):
        if key in c:
            lines.append((title, f"{c[key]:.1e}  {what}"))
    lines.append(("iterations", f"{c['newton_iterations_mean']:.2f} a step, at most {c['newton_iterations_max']}"))
    speed = run.good_steps / run.seconds if run.seconds > 0 else float("inf")
    lines.append(("time", f"{run.seconds:.3g} s, {speed:,.0f} steps/s, and {run.set_up_seconds:.3g} s to set up"))
    lines += [("warning", sentence) for sentence in run.warnings]
    width = max(len(title) for title, _ in lines)
    return "\n".join(f"{title:<{width}}  {text}" for title, text in lines)


def _change(c: dict[str, Any], name: str, relative: bool) -> str:
    first = np.ravel(c[f"{name}_initial"])
    shown = f"{first[0]:.10g}" if len(first) == 1 else f"{len(first)} quantities, norm {np.linalg.norm(first):.6g}"
    kind = "relative" if relative else "absolute"
    return f"{shown}; largest {kind} change {c[f'{name}_error_max']:.2e}, at the end {c[f'{name}_error_final']:.2e}"


def ensemble_card(ensemble: Ensemble) -> str:
    """The certificate of an ensemble as text."""
    count, plan = ensemble.members.count, ensemble.plan
    failed = ensemble.failures
    lines = [
        ("system", f"{count:,} × {ensemble.system.name} on {ensemble.system.group!r}"),
        ("method", f"{ensemble.method.title}, {order(ensemble.method)}"),
        ("steps", f"{plan.steps:,} steps of {plan.h:g} s each"),
        ("saved", f"{ensemble.count:,} nodes a member, every {plan.save_every}, float64"),
        ("finished", f"{count - len(failed):,} of {count:,}"),
    ]
    lines += [("failed", f"member {index}: {what}") for index, what in list(failed.items())[:5]]
    for name, title in (
        ("energy", "energy"),
        ("kelvin_noether", "Kelvin–Noether"),
        *((name, name.replace("_", " ")) for name, _ in ensemble.system.quantities),
        ("energy_budget", "energy budget"),
        ("kelvin_noether_budget", "momentum budget"),
    ):
        if name in ensemble.ends:
            change = ensemble.relative_changes(name)[ensemble.codes == 0]
            if len(change):
                worst = f"median {np.median(change):.2e}, worst {np.max(change):.2e}"
                lines.append((title, f"largest relative change: {worst}"))
    for name, title in (("balance", "balance"), ("newton_residual", "Newton"), ("group_defect", "group defect")):
        if name in ensemble.extrema:
            lines.append((title, f"{np.max(ensemble.extrema[name][1]):.1e}  worst of all members"))
    done = int(np.sum(ensemble.steps_done))
    lines.append(("iterations", f"{np.sum(ensemble.iterations) / max(done, 1):.2f} a step"))
    speed = done / ensemble.seconds if ensemble.seconds > 0 else float("inf")
    lines.append(("time", f"{ensemble.seconds:.3g} s, {speed:,.0f} steps/s, {ensemble.set_up_seconds:.3g} s to set up"))
    lines += [("warning", sentence) for sentence in ensemble.warnings]
    width = max(len(title) for title, _ in lines)
    return "\n".join(f"{title:<{width}}  {text}" for title, text in lines)
