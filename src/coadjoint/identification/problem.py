"""The problem of an identification: its unknowns and its log, as segments of any length on steps of any size."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import jax
import numpy as np

from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.errors import ArgumentError
from coadjoint.identification.channels import POSITION, VELOCITY, Channels
from coadjoint.identification.log import Log
from coadjoint.identification.process_noise import KNOT, MOST, Knots
from coadjoint.identification.process_noise_model import Moved
from coadjoint.identification.sampling import Between, samples, steps_between
from coadjoint.identification.sensor_model import Sensing
from coadjoint.identification.shooting import Reference, Shooting, require_inputs
from coadjoint.identification.smoothing import at_origin, poses
from coadjoint.identification.unknowns import Unknowns
from coadjoint.losses import Loss
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.declared_constraints import require_free
from coadjoint.mechanics.identity import version
from coadjoint.mechanics.parameters import Parameters
from coadjoint.mechanics.state import State
from coadjoint.mechanics.trace_checks import require_scalar
from coadjoint.methods.method import Method
from coadjoint.methods.program import StepProgram, StepStage
from coadjoint.simulation.simulate import simulate

LONGEST_STEP = 0.05
"""The first step, s, which is then refined: the longest below this that leads from sample to sample."""


@dataclass(frozen=True)
class Observed:
    """`program` with the numbers of `channels` at the node where a step starts as its record."""

    program: StepProgram
    channels: Channels

    @property
    def stages(self) -> tuple[ObservedStage, ...]:
        return tuple(ObservedStage(stage, self.channels) for stage in self.program.stages)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.program, name)


@dataclass(frozen=True)
class ObservedStage:
    """A stage with such a record."""

    stage: StepStage
    channels: Channels

    def record(self, parameters: PyTree, state: PyTree, h: Scalar, z: Array) -> Any:
        return self.channels.of(replace_parameters(self.stage.skeleton, parameters.system), state)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stage, name)


@dataclass(frozen=True)
class Setting:
    """`start` is a state at the first sample, with the inputs of the log; `step`: dt where it is fixed, s.

    `settle`: the time in which actuators settle, s; measurements until then do not count.
    """

    unknowns: Unknowns
    log: Log
    start: State
    channels: Channels
    method: Method
    between: Between
    step: float | None
    settle: float
    sensing: Sensing
    wandering: Moved | None = None
    loss: Loss | None = None
    simulated: Callable[[], None] = lambda: None
    """Called after every simulation of the log."""

    @property
    def longest(self) -> float:
        """The step with which the search begins, s."""
        interval = self.log.interval
        return interval / np.ceil(interval / LONGEST_STEP - 1e-9) if self.step is None else self.step

    @property
    def holds_starts(self) -> bool:
        """Whether the log of a vehicle holds its attitude and its velocity."""
        known = self.channels.vehicle
        return "heading" in known and any(all(name in known for name in names) for names in (POSITION, VELOCITY))

    @cached_property
    def program(self) -> Any:
        """A step with the simulated measurements."""
        system, functions = self.unknowns.system, [function for _, function in self.channels.own]
        digest = version(system, self.method.begin(system, self.start, self.longest), *functions)
        return Observed(StepProgram(replace_parameters(system, None), self.method, version=digest), self.channels)

    def shooting(self, h: float, segment: float | None, knots: Knots | Literal["new"] | None = None) -> Shooting:
        """Segments of about `segment` s on steps h, with process noise on `knots`; "new" makes them."""
        names, units = self.channels.names, self.log.units
        turning = np.array([i for i, name in enumerate(names) if units.get(name) == "rad"], int)
        cut = samples(self.log, turning, h, segment, self.between, self.sensing.reach)
        require_free(self.unknowns.system, "Estimated starts of segments")
        template = self.method.begin(self.unknowns.system, self.start, h)
        if template.memory is not None or self.method.variable:
            remedy = "co.Midpoint()" if self.unknowns.system.continuous else "Λ in algebra form and co.Variational"
            raise ArgumentError(f"{self.method.title} remembers steps before: take {remedy}.")
        rows = cut.rows[:, 0]
        begun = {name: self.log.actual.get(name, values)[rows] for name, values in self.log.inputs.items()}
        reference = self._reference(cut.starts, h)
        if knots == "new":
            knots = self._knots(float(cut.steps_away.max()) * h, h)
        several = template.internal is not None and len(cut.starts) > 1
        steps = steps_between(self.log, cut, self.between) if several else None
        return Shooting(self.unknowns, self.channels, cut, reference, template, self.program, begun, knots, steps)

    def _knots(self, longest: float, h: float) -> Knots | None:
        """The knots of process noise, over the longest of all segments, s; each lasts a multiple of h."""
        if self.wandering is None:
            return None
        spacing = float(np.ceil(max(KNOT * self.log.interval, longest / MOST) / h - 1e-9)) * h
        return Knots(*self.wandering, spacing, max(1, int(np.ceil(longest / spacing - 1e-6))))

    def _reference(self, times: np.ndarray, h: float) -> Reference:
        """The starts of segments: from the log if possible, otherwise from a run of the system with its prior
        values."""
        system, start = self.unknowns.system, self.start
        if self.holds_starts:
            pose = at_origin(poses(self.log, times), self.log)
            if system.additional.ambient(system.group):
                return Reference(pose.R, pose.q, pose.omega, pose.v)
            nothing = np.zeros((len(times), 0))
            return Reference((pose.R, pose.q), nothing, np.concatenate([pose.omega, pose.v], axis=1), nothing)
        if len(times) == 1 and (system.continuous or start.from_velocities):
            records = jax.tree.map(lambda leaf: np.asarray(leaf)[None], start)
            return Reference(records.g, start.q[None], records.xi, records.nu)
        steps = int(np.ceil((times[-1] - times[0]) / h)) + 1
        run = simulate(system, start, dt=h, steps=steps, method=self.method, monitors=False, progress=False)
        records = jax.tree.map(lambda rows: rows[np.rint((times - times[0]) / h).astype(int)], run.records)
        return Reference(records.g, records.q, records.xi, records.nu)


def setting(
    sought: Unknowns,
    log: Log,
    start: State,
    channels: Channels,
    method: Method,
    between: Between,
    step: float | None,
    settle: float,
    sensing: Sensing | None = None,
    wandering: Moved | None = None,
) -> Setting:
    """The problem of the checked arguments; raises ArgumentError."""
    system = sought.system
    if not 0 <= settle < log.duration:
        raise ArgumentError(f"Argument `settle` must be 0 or more and shorter than the log, but is {settle:g} s.")
    needed = sum(int(np.isfinite(values).sum()) for values in log.columns.values())
    sensing = Sensing(channels.names) if sensing is None else sensing
    count = len(sought.each) + len(sensing.each)
    if needed < 2 * (2 * system.unknowns + count):
        raise ArgumentError(
            f"The log holds {needed} numbers, too few for {count} parameters and a start of "
            f"{2 * system.unknowns} numbers."
        )
    t = np.float64(log.time[0])
    held = {name: np.zeros(values.shape[1:]) for name, values in log.inputs.items()}
    begun = start.replace(
        t=t,
        inputs=Parameters(**held) if held else start.inputs,
        internal_due=None if start.internal_due is None else np.float64(1.0),
        t_rest=np.float64(0.0),
    )
    require_inputs(system, begun)
    for name, function in channels.own:
        require_scalar(function, f"The function of `{name}` in `measured`", (begun,))
    return Setting(sought, log, begun, channels, method, between, step, settle, sensing, wandering)
