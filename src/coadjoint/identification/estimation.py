"""Parameters of a system from a logged trajectory, by least squares through the simulation."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Literal, get_args

import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.checks import truth
from coadjoint.errors import ArgumentError
from coadjoint.identification.channels import UNITS, VEHICLE, Channels, is_vehicle
from coadjoint.identification.commands import lacks_current, require_commands, with_current
from coadjoint.identification.diagnostics import likely_causes
from coadjoint.identification.fitting import fitted
from coadjoint.identification.log import Log, merged
from coadjoint.identification.log_checks import wild
from coadjoint.identification.problem import Setting, setting
from coadjoint.identification.process_noise_model import wandering
from coadjoint.identification.result import Identification, judged
from coadjoint.identification.sampling import Between
from coadjoint.identification.sensor_model import GROUPS, Attitude, sensing
from coadjoint.identification.unknowns import unknowns
from coadjoint.interrupts import deferred_interrupts
from coadjoint.losses import Loss, require_loss
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.method import Method
from coadjoint.methods.midpoint import Midpoint
from coadjoint.methods.program import Constants
from coadjoint.simulation.arguments import require_kinds
from coadjoint.simulation.progress import Progress
from coadjoint.simulation.unread_inputs import unread


@deferred_interrupts()
def identify(
    system: System,
    log: Log | Sequence[Log],
    *,
    start: State,
    parameters: Sequence[str],
    noise: Mapping[str, float] | None = None,
    measured: Mapping[str, Callable[[State], PyTree]] | None = None,
    segment: float | Literal["auto"] | None = "auto",
    dt: float | None = None,
    between: Between = "held",
    settle: float = 0.0,
    positive: Sequence[str] = (),
    still: Sequence[str] = (),
    level: float = 0.95,
    method: Method | None = None,
    coloured: Sequence[str] = (),
    biases: Sequence[str] = (),
    delays: Sequence[str] | Mapping[str, Sequence[str]] = (),
    longest_delay: float = 0.5,
    attitude: Attitude | None = None,
    process_noise: Sequence[str] = (),
    loss: Loss | None = None,
    progress: bool | None = None,
) -> Identification:
    """The parameters of `system` with which its simulation comes closest to the log, with confidence intervals.

    min ½ Σ ((y_i − y(t_i; p, starts))/σ)² over the parameters p and over the start of every segment of the log, by
    Levenberg–Marquardt with exact derivatives through every step. Covariance is (JᵀJ)⁻¹ with the starts eliminated.

    log: a Log, as of `co.vehicles.logs.read_log`, or several of one system, which are fitted together, each from its
    own start, as `merged` puts them in a row. A steady current that they hold and the model lacks is estimated. start:
    a state of the system, for the quantities that the log lacks: the advected parameters, the internal state.
    parameters: names of arrays (their nonzero entries) or entries, ["damping", "added_mass[1,1]"], or several that are
    equal, "rudder.area = stern_planes.area"; the search starts from
    the values of the system. noise: standard deviations in SI units by column, or for position, attitude, velocity,
    rates; those not given are estimated from the residuals. measured: functions of the state for columns that are not
    those of a vehicle. segment: s; None takes the log as one run from one start; by default 10 s, and None where an
    internal state depends on the motion, as that of a controller that is simulated: what parameters do to it does not
    cross segments. dt: s, by default that of the simulation which wrote the log, and of a measured log one that shifts
    no parameter by more than about a tenth of its standard error. between: whether inputs are held between samples or
    run linearly. settle: the initial time, s, that is not fitted, because the states of actuators are unknown.
    positive: parameters that must stay positive, estimated by their logarithms; the diagonals of positive definite
    matrices always are, and the matrices stay positive definite. still: actuators without commands in the log, which
    stay where `start` has them; others must have commands. level: of the intervals. coloured: columns, or position,
    attitude, velocity, rates, with coloured noise of covariance σ² exp(−|Δ|/τ); σ and τ are estimated, `found.noise`
    and `found.correlation_times`. biases: columns or such groups with a constant bias of the sensor, `found["bias.u"]`,
    in the unit of the column. delays: columns or such groups with a delay, `found["delay.position"]`, s, or new names
    with the columns that share a delay, {"gps": ("north", "east")}; none is longer than `longest_delay` s. attitude:
    "angles" compares Euler angles, "rotation" takes log(R_measuredᵀR_simulated) along the body axes, where noise and
    bias of roll, pitch and heading are those about forward, starboard and down; by default that where the log pitches
    by over 60°. process_noise: "force" and "torque", which the model lacks, in the body, or their components X, Y, Z,
    K, M, N, or parameters such as "water.velocity". Each is an Ornstein–Uhlenbeck process, whose deviation and
    correlation time are estimated, `found.process_noise`, and the intervals account for it. loss: `co.losses.Huber()`
    or `Student()`, with which values far off count less, `found.weights`, and those that no motion explains are left
    out and named by row and column in `found.warnings`; by default these raise an error. progress: None, a bar on a
    terminal after one second (the default); False, never. Raises ArgumentError for arguments that do not fit, and if no
    estimate is found.
    """
    method = Midpoint() if method is None else method
    log = log if isinstance(log, Log) else merged(log)
    require_arguments(system, log, start, method)
    _require_numbers(level, settle, longest_delay, segment, dt)
    for name, value in {"noise": noise, "measured": measured}.items():
        if value is not None:
            checks.mapping(value, name, "name → value by columns of the log")
    checks.choice(between, "between", get_args(Between))
    require_loss(loss, "Argument `loss`")
    if loss is not None and (coloured or process_noise):
        raise ArgumentError(
            "Argument `loss` is for white noise: leave out `coloured` and `process_noise`, or the loss."
        )
    progress = None if progress is None else truth(progress, "progress")
    require_commands(system, start, log, still)
    parameters, noted = with_current(system, log, parameters, process_noise)
    log = _without_wild(replace(log, notes=(*log.notes, *noted)), loss)
    system, moved = wandering(system, process_noise)
    sought = unknowns(system, parameters, positive)
    channels = _channels(system, log, measured or {})
    given = _noise(noise or {}, channels)
    sensed = sensing(
        log, channels.names, coloured=coloured, biases=biases, delays=delays, longest_delay=longest_delay,
        attitude=attitude,
    )  # fmt: skip
    channels = replace(channels, rotation=sensed.rotation)
    step = log.step if dt is None else float(dt)
    asked = replace(setting(sought, log, start, channels, method, between, step, settle, sensed, moved), loss=loss)
    began = time.perf_counter()
    with Progress(None, progress, f"identification of {system.name}", "simulations") as bar:
        asked = replace(asked, simulated=lambda: bar.advance(1, time.perf_counter() - began))
        found = judged(fitted(asked, segment, given), level)
    open_current = lacks_current(system, log, (*parameters, *process_noise))
    causes = [*_unread(asked), *likely_causes(log, found.whiteness, step, open_current)]
    return replace(found, warnings=(*causes, *found.warnings))


def _require_numbers(level: object, settle: object, longest_delay: object, segment: object, dt: object) -> None:
    """Raise ArgumentError unless times are numbers, s, lengths are positive, and the level lies between 0 and 1."""
    checks.number(level, "level", above=0.0, below=1.0)
    for name, value in {"settle": settle, "longest_delay": longest_delay}.items():
        checks.number(value, name)
    for name, value in {"segment": None if segment == "auto" else segment, "dt": dt}.items():
        if value is not None:
            checks.positive(value, name)


def _unread(asked: Setting) -> list[str]:
    """Sentences on the commands of the log that neither the system nor `measured` reads."""
    units = {name.removeprefix("inputs_") for name, _ in asked.unknowns.system.units}
    names = [name for name in asked.log.inputs if name not in units]
    if not names:
        return []
    system = asked.unknowns.system
    start = asked.method.begin(system, asked.start, asked.longest)

    def seen(state: State) -> PyTree:
        return asked.channels.of(system, state)

    found = unread(asked.program.program, Constants(system.parameters, None), start, names, seen)
    return [f"No function of the system reads `{name}` of the log: check its name." for name in found]


def _without_wild(log: Log, loss: Loss | None) -> Log:
    """The log without values that no motion explains, which notes name; raises ArgumentError for them without a
    loss."""
    found = wild(log.time, log.columns, log.units)
    if found and loss is None:
        causes = " ".join(one.sentence for one in found)
        raise ArgumentError(f"Least squares cannot fit a value that no motion explains. {causes}")
    columns = {name: values.copy() for name, values in log.columns.items()}
    for one in found:
        columns[one.name][one.rows] = np.nan
    said = [(f"`{one.name}` is ", f": {one.remedy}.") for one in found]
    kept = [note for note in log.notes if not any(note.startswith(a) and note.endswith(b) for a, b in said)]
    notes = (*kept, *(f"Left out: {one.finding}." for one in found))
    return replace(log, columns=columns, notes=notes) if found else log


def _channels(system: System, log: Log, measured: Mapping[str, Callable[[State], PyTree]]) -> Channels:
    """Every column of the log as a function of the state."""
    for name, function in measured.items():
        checks.known(name, log.columns, "column", "Argument `measured`: the log")
        checks.function(function, f"`{name}` of `measured`", "a function of the state")
    rest = [name for name in log.columns if name not in measured]
    if rest and not is_vehicle(system):
        raise ArgumentError(
            f"The meaning of `{rest[0]}` of the log is unknown: give measured={{{rest[0]!r}: a function of the state}}."
        )
    for name in rest:
        if name not in VEHICLE:
            near = checks.nearest(name, VEHICLE, 0.0)
            raise ArgumentError(
                f"The log's column `{name}` is not a quantity of a vehicle, the nearest is `{near}`: rename it, leave "
                "it "
                "out, or give it in `measured`."
            )
        if (unit := log.units.get(name)) != UNITS[name]:
            raise ArgumentError(
                f"The log's column `{name}` is in {unit}, but a Log has it in {UNITS[name]}: change its numbers, or "
                "read a table with its unit by co.vehicles.logs.read_log."
            )
    levers = tuple((name, r) for name, r in log.positions.items() if name in rest)
    return Channels(tuple(name for name in VEHICLE if name in rest), tuple(measured.items()), levers=levers)


def _noise(given: Mapping[str, float], channels: Channels) -> dict[str, float]:
    """σ by channel, of those that the user gave."""
    known = {name: (name,) for name in channels.names} | GROUPS
    found: dict[str, float] = {}
    for name, value in sorted(given.items(), key=lambda pair: pair[0] not in GROUPS):
        checks.known(name, known, "column", f"Argument `noise` names `{name}`, but the log")
        size = checks.positive(value, f"The noise of `{name}`")
        parts = [part for part in known[name] if part in channels.names]
        if not parts:
            raise ArgumentError(f"Argument `noise` names `{name}`, but the log holds none of {', '.join(known[name])}.")
        found.update(dict.fromkeys(parts, size))
    return found


def require_arguments(system: System, log: object, start: PyTree, method: object) -> None:
    """Raise ArgumentError unless these are a system, a log, a start of the system and a method."""
    if isinstance(inner := getattr(system, "system", None), System):
        raise ArgumentError(
            f"Argument `system` must be a co.System, but is {type(system).__name__}: give its `system`, of "
            f"{inner.name}."
        )
    checks.instance(
        log, "log", Log, "a Log, as co.vehicles.logs.read_log(path) and co.identification.synthetic_log(run) make"
    )
    require_kinds(system, start, method)
