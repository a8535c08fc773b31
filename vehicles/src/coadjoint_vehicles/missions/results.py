"""The results of a mission except its trajectory: logs, figures, an animation, and a summary in numbers."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from coadjoint.arrays import Array, PyTree
from coadjoint.csv_tables import csv_text
from coadjoint.disk import write_text
from coadjoint.errors import ArgumentError
from coadjoint.labelled import of_run
from coadjoint.paths import paths
from coadjoint.plotting.plots import Plots, available, save_figures
from coadjoint.texts import Table
from coadjoint_vehicles.controllers.manoeuvres import TRIAL
from coadjoint_vehicles.figures.declared import FIGURES
from coadjoint_vehicles.logs.records import VehicleRecords
from coadjoint_vehicles.missions.sensors import counts, logs
from coadjoint_vehicles.missions.summary import missed, mission_summary, spread

if TYPE_CHECKING:
    from coadjoint.labelled import AnyDataset
    from coadjoint.simulation import Run
    from coadjoint_vehicles.missions.sections import MissionOutputSection, MissionRunSection
    from coadjoint_vehicles.model.controller import Controller
    from coadjoint_vehicles.trials.analysis import TrialResult

LOG, BAG, MEMBERS = "trajectory.csv", "trajectory.mcap", "members.csv"
DRAWN = (*(name for name, added in FIGURES.items() if not added.film), "attitude", "budget")
"""The figures of a mission where [output] has `figures = true`."""
TILTED = 60.0
"""°: the angle between the vertical of the craft and that of space above which a level run warns."""
MOST_DRAWN = 100
"""The most members in a figure."""
MOST_ANIMATED = 8
"""The most members in an animation."""
MOST_BYTES = 1e9
"""The most bytes of the trajectories of all members."""


def figures(output: MissionOutputSection, folder: Path, dataset: AnyDataset) -> list[str]:
    """Draw the figures of [output]; of very many members an evenly spaced subset, to bound the time."""
    if output.figures is False:
        return []
    count = dataset.sizes.get("member", 1)
    if count > MOST_DRAWN:
        dataset = dataset.isel(member=np.linspace(0, count - 1, MOST_DRAWN).astype(int))
    chosen = output.figures
    there = available(dataset)
    names = [name for name in DRAWN if name in there] if chosen is True else list(chosen)
    names += ["trial"] * ("trial" in there and "trial" not in names)
    return save_figures([dataset], folder, names, output.format)


def left_water(dataset: AnyDataset) -> list[str]:
    """A warning where the craft, or members, left the water by more than half their height; saved nodes only."""
    half = 0.5 * float(dataset.attrs["vehicle_height"])
    depth = np.asarray(dataset["q"].values)[..., 2]
    out = depth < -half
    if not np.any(out):
        return []
    if depth.ndim > 1:
        count = int(np.sum(np.any(out, axis=-1)))
        whose = "1 member leaves" if count == 1 else f"{count} members leave"
        return [f"{whose} the water, up to {-np.nanmin(depth):.3g} m above it."]
    when = float(np.asarray(dataset["time"].values)[np.argmax(out)])
    return [
        f"The vehicle leaves the water: from t = {when:.6g} s on by more than half its height, for {np.mean(out):.0%} "
        f'of the time, up to {-np.min(depth):.3g} m, with forces as in water; [mission] ends = "surface" ends there.'
    ]


def tilted(dataset: AnyDataset, controller: Controller | None) -> list[str]:
    """A warning where a craft, or members, tilt beyond TILTED though the controller keeps level; saved nodes only."""
    if controller is None or not controller.keeps_level:
        return []
    down = np.asarray(dataset["a_down"].transpose("time", ...).values, dtype=float)[..., 2]
    tilt = np.degrees(np.arccos(np.clip(down.reshape(len(down), -1), -1.0, 1.0)))
    most = np.nanmax(tilt, axis=0)
    worst = int(np.nanargmax(most))
    if most[worst] <= TILTED:
        return []
    when = float(np.asarray(dataset["time"].values)[np.argmax(tilt[:, worst] > TILTED)])
    count = int(np.sum(most > TILTED))
    whose = "The vehicle" if down.ndim == 1 else f"{count} of {len(most)} members, member {worst} the most,"
    return [
        f"{whose} {'tilts' if down.ndim == 1 else 'tilt'} by up to {most[worst]:.0f}°, from t = {when:.6g} s on beyond "
        f"{TILTED:g}°, though the controller keeps level: the actuators do not control roll or pitch, or the limits "
        "and the righting moment are too small."
    ]


def astray(dataset: AnyDataset) -> list[str]:
    """A warning for each set point that a vehicle does not follow; of members with their count. Not of trials."""
    if TRIAL in dataset.attrs:
        return []
    if "member" not in dataset.dims:
        return missed(VehicleRecords(dataset))
    told = [missed(VehicleRecords(dataset.isel(member=k))) for k in range(min(dataset.sizes["member"], MOST_DRAWN))]
    off = [k for k, sentences in enumerate(told) if sentences]
    if not off:
        return []
    first = " ".join(told[off[0]])
    return [f"{len(off)} of {len(told)} members do not follow their set points. Of member {off[0]}: {first}"]


def results(output: MissionOutputSection, folder: Path, run: Run, reached: Callable[[Array], str]) -> Table:
    """Write the log and the animation of one run, and return the mission's part of the summary.

    reached: which of the ends of [mission] a place is at.
    """
    if output.csv:
        run.save(folder / LOG, overwrite=True)
    if output.mcap:
        run.save(folder / BAG, overwrite=True)
    if output.animation:
        run.plot.animation(path=folder / f"animation.{output.animation}")
    if output.csv:
        logs(of_run(run), folder)
    ended = {} if run.event is None else {"ended_by": reached(run.final.q)}
    trial = _trial(of_run(run))
    found = {**mission_summary(of_run(run)), "save_every": run.plan.save_every, **ended, **counts(of_run(run))}
    if trial is None:
        return {"mission": found}
    return {"mission": {**found, "trial": {"manoeuvre": trial.track.manoeuvre, **trial.values}}, "notes": [trial.line]}


def _trial(dataset: AnyDataset) -> TrialResult | None:
    """The figures of merit of a standard manoeuvre; None of another mission."""
    if TRIAL not in dataset.attrs:
        return None
    from coadjoint_vehicles.trials.analysis import analyse

    return analyse(dataset)


def members(output: MissionOutputSection, folder: Path, fleet: Any) -> Table:
    """Write a table with a row for each member and the animation, and return the summary of all of them.

    The row holds the parameters that were varied and the member's figures; the summary mean, standard deviation,
    extremes and quantiles of each figure over the members that finished.
    """
    dataset = of_run(fleet)
    done = [k for k in range(dataset.sizes["member"]) if k not in fleet.failures]
    if not done:
        raise ArgumentError(f"No member finished: {next(iter(fleet.failures.values()))}.")
    rows = {k: flat(mission_summary(dataset.isel(member=k))) for k in done}
    names = list(rows[done[0]])
    columns = {"member": np.array(done, dtype=float)}
    columns |= {name: values[done] for name, values in _varied(fleet).items()}
    columns |= {name: np.array([rows[k].get(name, np.nan) for k in done]) for name in names}
    if output.csv:
        write_text(folder / MEMBERS, csv_text(columns))
    if output.animation:
        shown = Plots(dataset.isel(member=done[:MOST_ANIMATED]))
        shown.animation(path=folder / f"animation.{output.animation}")
    return {
        "system": fleet.system.name,
        "method": fleet.method.title,
        "dt": fleet.plan.h,
        "members": dataset.sizes["member"],
        "finished": len(done),
        "failures": {str(k): what for k, what in fleet.failures.items()},
        "seconds": fleet.seconds,
        "set_up_seconds": fleet.set_up_seconds,
        "mission": {name: spread(columns[name]) for name in names},
        "notes": _shown(output, dataset.sizes["member"], len(done)),
        **fleet.certificate.asdict(),
    }


def _shown(output: MissionOutputSection, members: int, done: int) -> list[str]:
    """A sentence on the parts of [output] that an ensemble omits."""
    found = [f"{MEMBERS} has a row for each member, in place of {LOG}"] if output.csv else []
    if output.animation and done > MOST_ANIMATED:
        found.append(f"the animation shows {MOST_ANIMATED} of the members")
    if output.figures is not False and members > MOST_DRAWN:
        found.append(f"figures show {MOST_DRAWN} of the members")
    return [f"Of an ensemble {'; '.join(found)}."] if found else []


def flat(summary: Table, prefix: str = "") -> dict[str, float]:
    """The numbers of nested tables under joined names; computing times do not belong to a member."""
    found: dict[str, float] = {}
    for key, value in summary.items():
        if isinstance(value, dict):
            found |= flat(value, f"{prefix}{key}_")
        elif isinstance(value, np.ndarray):
            found |= {f"{prefix}{key}_{i}": float(v) for i, v in zip(("north", "east", "depth"), value, strict=True)}
        elif value is not None and key != "times_real_time":
            found[f"{prefix}{key}"] = float(value)
    return found


def require_room(grid: MissionRunSection, start: PyTree) -> None:
    """Raise ArgumentError where the trajectories of all members would be too large a file."""
    import jax

    each = 2 * sum(np.asarray(leaf).nbytes for leaf in jax.tree.leaves(start))
    size = each * grid.members * (grid.count // grid.save_every + 1)
    if grid.members > 1 and size > MOST_BYTES:
        wanted = int(grid.save_every * size / MOST_BYTES) + 1
        raise ArgumentError(
            f"The trajectories of {grid.members} members would take some {size / 1e9:.1f} GB: save fewer nodes "
            f"with [run] save_every = {wanted} or more."
        )


def _varied(fleet: Any) -> dict[str, np.ndarray]:
    """The parameters that differ between members, by name, entries of arrays one by one."""
    from coadjoint.mechanics.members import Each

    found: dict[str, np.ndarray] = {}
    for name, value in paths(fleet.system.parameters).items():
        if isinstance(value, Each):
            table = np.asarray(value.values).reshape(len(value), -1)
            ends = [""] if np.ndim(value.values) == 1 else [f"[{i + 1}]" for i in range(table.shape[1])]
            found |= {f"{name}{end}": column for end, column in zip(ends, table.T, strict=True)}
    return found
