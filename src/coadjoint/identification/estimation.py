"""Parameters of a system from a logged trajectory, by least squares through the simulation."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import jax
import numpy as np

from coadjoint.errors import ArgumentError
from coadjoint.identification.channels import ATTITUDE, POSITION, RATES, VEHICLE, VELOCITY, Channels, is_vehicle
from coadjoint.identification.findings import Identification, judged
from coadjoint.identification.fitting import fitted
from coadjoint.identification.log import Log
from coadjoint.identification.sampling import Between, samples
from coadjoint.identification.shooting import Reference, Shooting, require_inputs
from coadjoint.identification.smoothing import poses
from coadjoint.identification.unknowns import Unknowns, unknowns
from coadjoint.mechanics.parameters import Parameters
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.method import Method
from coadjoint.methods.midpoint import Midpoint
from coadjoint.simulation.simulate import simulate

LONGEST_STEP = 0.05
"""The step, s, from which on it is refined: the longest not above this that leads from sample to sample."""

_GROUPS = {"position": POSITION, "attitude": ATTITUDE, "velocity": VELOCITY, "rates": RATES}


def identify(
    system: System,
    log: Log,
    *,
    start: State,
    parameters: Sequence[str],
    noise: Mapping[str, float] | None = None,
    measured: Mapping[str, Callable[[State], Any]] | None = None,
    segment: float | None = 10.0,
    dt: float | None = None,
    between: Between = "held",
    positive: Sequence[str] = (),
    level: float = 0.95,
    method: Method | None = None,
) -> Identification:
    """The parameters of `system` with which its simulation comes closest to the log, with confidence intervals.

    min ½ Σ ((y_i − y(t_i; p, starts))/σ)² over the parameters p and over the start of every segment of the log, by
    Levenberg–Marquardt with exact derivatives through every step. Covariance is (JᵀJ)⁻¹ with the starts eliminated.

    log: `co.identification.read_log`, or a Log. start: a state of the system, for what the log does not tell: the
    advected parameters, the internal state. parameters: names of whole arrays (their entries that are not zero) or
    entries, ["damping", "added_mass[1,1]"]; the system's own values are where the search starts.
    noise: standard deviations in SI units by column, or for position, attitude, velocity, rates; those not given are
    estimated from the residuals. measured: functions of the state for columns that are not those of a vehicle.
    segment: s; None takes the log as one run from one start. dt: s, by default so that it shifts no parameter by more
    than a tenth of its standard error. between: whether inputs are held between samples or
    run linearly. positive: parameters that must stay positive, sought by their logarithms; the diagonals of positive
    definite matrices always are, and the matrices stay so. level: of the intervals.
    Raises ArgumentError for what does not fit, and where nothing is found.
    """
    if not 0 < level < 1:
        raise ArgumentError(f"Argument `level` must lie between 0 and 1, but is {level:g}.")
    method = Midpoint() if method is None else method
    sought = unknowns(system, parameters, positive)
    channels = _channels(system, log, measured or {})
    h = log.interval / np.ceil(log.interval / LONGEST_STEP - 1e-9) if dt is None else float(dt)
    given = _noise(noise or {}, channels)
    shooting = _shooting(sought, log, start, channels, method, h, segment, between)
    return judged(fitted(shooting, log, given, between, dt is not None), level)


def _channels(system: System, log: Log, measured: Mapping[str, Callable[[State], Any]]) -> Channels:
    """Every column of the log as a function of the state."""
    for name in measured:
        if name not in log.columns:
            raise ArgumentError(f"Argument `measured` names `{name}`, but the log holds {', '.join(log.columns)}.")
    rest = [name for name in log.columns if name not in measured]
    if rest and not is_vehicle(system):
        raise ArgumentError(
            f"It is not known what `{rest[0]}` of the log is: give measured={{{rest[0]!r}: a function of the state}}."
        )
    for name in rest:
        if name not in VEHICLE:
            near = difflib.get_close_matches(name, VEHICLE, 1, 0.0)[0]
            raise ArgumentError(
                f"The log's column `{name}` is no quantity of a vehicle, the nearest is `{near}`: rename it, leave it "
                "out, or give it in `measured`."
            )
    return Channels(tuple(name for name in VEHICLE if name in rest), tuple(measured.items()))


def _noise(given: Mapping[str, float], channels: Channels) -> dict[str, float]:
    """σ by channel, of those that are given."""
    known = {name: (name,) for name in channels.names} | _GROUPS
    found: dict[str, float] = {}
    for name, value in sorted(given.items(), key=lambda pair: pair[0] not in _GROUPS):
        if name not in known:
            near = difflib.get_close_matches(name, known, 1, 0.0)[0]
            raise ArgumentError(
                f"Argument `noise` names `{name}`, which the log does not hold; the nearest is `{near}`."
            )
        if not (np.isfinite(value) and value > 0):
            raise ArgumentError(f"The noise of `{name}` must be a positive number, but is {value!r}.")
        found.update({part: float(value) for part in known[name] if part in channels.names})
    return found


def _shooting(
    sought: Unknowns, log: Log, start: State, channels: Channels, method: Method, h: float, segment: float | None,
    between: Between,
) -> Shooting:  # fmt: skip
    system = sought.system
    if not isinstance(start, State) or start.places != system.places:
        raise ArgumentError("Argument `start` must be a state of the system, such as system.state(…).")
    if not (np.isfinite(h) and h > 0):
        raise ArgumentError(f"Argument `dt` must be positive, but is {h:g}.")
    needed = sum(int(np.isfinite(values).sum()) for values in log.columns.values())
    if needed < 2 * (2 * system.unknowns + len(sought.each)):
        raise ArgumentError(
            f"The log holds {needed} numbers, too few for {len(sought.each)} parameters and a start of "
            f"{2 * system.unknowns} numbers."
        )
    turning = np.array([i for i, name in enumerate(channels.names) if log.units.get(name) == "rad"], int)
    cut = samples(log, turning, h, segment, between)
    t = float(log.time[0])
    inputs = Parameters(**{n: np.zeros(v.shape[1:]) for n, v in log.inputs.items()}) if log.inputs else start.inputs
    timed = None if start.internal_time is None else np.float64(t)
    begun = start.replace(t=np.float64(t), inputs=inputs, internal_time=timed, t_rest=np.float64(0.0))
    require_inputs(system, begun)
    template = method.begin(system, begun, h)
    if template.memory is not None or method.variable:
        raise ArgumentError(f"{method.title} remembers steps before: take co.Midpoint().")
    reference = _reference(system, log, begun, channels, cut.starts, h)
    return Shooting(sought, channels, cut, reference, template, method)


def _reference(system: System, log: Log, start: State, channels: Channels, times: np.ndarray, h: float) -> Reference:
    """Where segments start: from the log of a vehicle that tells where it heads and how fast, else from a run."""
    moving = any(all(name in channels.vehicle for name in names) for names in (POSITION, VELOCITY))
    if "heading" in channels.vehicle and moving:
        pose = poses(log, times)
        if system.additional.ambient(system.group):
            return Reference(pose.R, pose.q, pose.omega, pose.v)
        nothing = np.zeros((len(times), 0))
        return Reference((pose.R, pose.q), nothing, np.concatenate([pose.omega, pose.v], axis=1), nothing)
    if len(times) == 1:
        records = jax.tree.map(lambda leaf: np.asarray(leaf)[None], start)
    else:
        steps = int(np.ceil((times[-1] - times[0]) / h)) + 1
        run = simulate(system, start, dt=h, steps=steps, monitors=False, progress=False)
        records = jax.tree.map(lambda rows: rows[np.rint((times - times[0]) / h).astype(int)], run.records)
    return Reference(records.g, records.q, records.xi, records.nu)
