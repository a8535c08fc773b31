"""The state of a stepper: its memory, its states and commands, and the moves to other states."""

from __future__ import annotations

import math
import secrets
import struct
from collections.abc import Mapping
from typing import Any, Self

import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError, StepError
from coadjoint.kernels.lanes import of_lanes
from coadjoint.kernels.program import Code, StatusFlag
from coadjoint.kernels.run.interruptible import PieceLength
from coadjoint.simulation.steppers.fields import real, seeds
from coadjoint.simulation.steppers.interface import (
    Buffers,
    Engine,
    Prepared,
    StepperInterface,
    StepperLock,
    failed_step,
    put,
)
from coadjoint.simulation.steppers.judging import StepperWarnings

STOPPED = int(Code.STOPPED)


class StepperBase(StepperWarnings):
    """The memory of a stepper and all that can be done without a step. Knows NumPy and an engine only.

    `command` and `observation` are dictionaries of views into permanent memory: writing into
    `stepper.command["thrust"][...]` before `step()` is the fastest way to command, and the arrays of `observation`
    change with the next step. With many members every array has a first axis of members.
    """

    def __init__(self, face: StepperInterface, engine: Engine, buffers: Buffers, origin: np.ndarray, threads: int):
        self._stand(face, engine, buffers, origin, threads, secrets.token_hex(8))
        self.reset()

    def _stand(
        self, face: StepperInterface, engine: Engine, buffers: Buffers, origin: np.ndarray, threads: int, kin: str
    ) -> None:
        """kin: an identifier that clones and saved steppers share with their original."""
        self.face, self._engine, self.threads, self._kin = face, engine, threads, kin
        self._pace, self._turn, self._origin = PieceLength(), StepperLock(), origin
        """The state that `reset` goes back to, (groups, size, lanes)."""
        self._parts = None
        self._take_memory(buffers)
        self._end_sample()

    event: float | None = None
    """The time at which `until` ended a single one, s; for a saved stepper, that of the last node before."""

    def _take_memory(self, buffers: Buffers) -> None:
        face, self._buffers, self._context = self.face, buffers, buffers.context()
        self._address, self._groups = self._context.ctypes.data, len(buffers.state)
        rows = slice(0, face.count) if face.members is not None else 0
        self._commands, shown = buffers.commands[rows], buffers.observations[rows]
        self.command = face.commands.views(self._commands)
        shown = shown.view()
        shown.flags.writeable = False
        self.observed = shown
        """All observations side by side, ([members,] size), in the order of their names."""
        self.observation = face.observations.views(shown)
        scalars = face.members is None and face.commands.scalar
        self._pack = struct.Struct(f"{face.commands.size}d").pack_into if scalars else None
        places = face.commands.places() if scalars else ()
        self._slots = {name: place.start for name, _, place in places}
        self._fast: Any = memoryview(self._commands) if scalars else None  # pyright: ignore[reportArgumentType]

    # The current position.

    @property
    def t(self) -> PyTree:
        """The time, s: a number, or one for each member."""
        return self._number(self._buffers.state, self.face.time)

    @property
    def steps(self) -> PyTree:
        """The number of good steps since the last reset or restore."""
        return self._number(self._buffers.status, 0)

    @property
    def status(self) -> PyTree:
        """How the last step ended: 0 if well, otherwise a `kernels.program.Code`."""
        return self._number(self._buffers.status, 1)

    @property
    def failed(self) -> PyTree:
        """Whether a step failed."""
        if not (codes := self._buffers.status[:, 1]).any():
            return self._of_members(np.zeros(codes.size, bool))
        code = self.status
        return (code != 0) & (code != STOPPED)

    @property
    def ended(self) -> PyTree:
        """Whether the event `until` has stopped it."""
        return self.status == Code.STOPPED

    @property
    def failures(self) -> dict[int, str]:
        """The failures of members by their index."""
        return {int(i): self._sentence(int(i)) for i in np.flatnonzero(np.atleast_1d(self.failed))}

    @property
    def failure(self) -> str | None:
        """The failure of a single one; None if it has not failed."""
        return self.failures.get(0) if self.face.members is None else None

    # Moving to another state.

    def reset(self, state: PyTree = None, *, seed: object = None, mask: object = None) -> dict[str, np.ndarray]:
        """Return to the start, or to another one, and return the observations there; commands are those of the start.

        state: None for the state at the beginning; a value of `state`; or name → values, for the numbers that differ
        from the start. seed: an integer, or one for each of many members, that seeds the random numbers of the
        system's rule; by default they are those of the start. mask: (members,) truth values that choose members; by
        default all.
        """
        which = self._which(mask)
        with self._turn.alone():
            rows = of_lanes(self._origin)[which]
            rows = rows if state is None else self._rows(rows, state, which)
            return self._go(which, rows if seed is None else self._seeded(rows, seeds(seed, self.face.members, which)))

    def _seeded(self, rows: np.ndarray, seeds: np.ndarray) -> np.ndarray:
        """States (k, size) with random numbers of these seeds (k,)."""
        raise ArgumentError("A saved stepper begins with the random numbers of its start: leave out `seed`.")

    def begin(self, starts: Prepared, rows: np.ndarray, members: np.ndarray) -> dict[str, np.ndarray]:
        """Members (k,) begin at these rows (k,) of prepared starts, with the parameters prepared for them.

        The start to which `reset` returns does not change. Returns the observations at the new states.
        """
        with self._turn.alone():
            if starts.parameters is not None:
                if len(self._buffers.parameters) < self._groups:
                    self._take_memory(self._buffers.with_parameters(self._all_parameters(), shared=False))
                put(self._buffers.parameters, members, starts.parameters[rows])
            return self._go(members, starts.states[rows])

    def restore(self, state: PyTree, *, mask: object = None) -> dict[str, np.ndarray]:
        """Continue from an earlier value of `state`, or bitwise as a clone would, and return the observations there.

        state: an earlier state holds the commands, but no parameters: the current ones stay. If a clone is given
        instead, its parameters, its start, its count of steps and whether it failed or ended are also taken over.
        mask: (members,) truth values that choose members; by default all.
        """
        which = self._which(mask)
        # Copied before this one's turn: two that are restored to each other must not wait for each other.
        other = state.clone() if isinstance(state, StepperBase) else None
        with self._turn.alone():
            if other is not None:
                return self._follow(other, which)
            return self._go(which, self._rows(of_lanes(self._buffers.state)[which], state, which))

    def _follow(self, other: StepperBase, which: np.ndarray) -> dict[str, np.ndarray]:
        """Continue as these members of a clone would."""
        if other._kin != self._kin:
            raise ArgumentError("A stepper can be restored to where a clone of it stands, but this is another one.")
        status = of_lanes(other._buffers.status)[which]
        if other._origin is not self._origin:
            self._origin = self._origin.copy()
            put(self._origin, which, of_lanes(other._origin)[which])
        self._take_parameters(other, which)
        found = self._go(which, of_lanes(other._buffers.state)[which])
        put(self._buffers.status, which, status)
        self.event = other.event
        return found

    def _all_parameters(self) -> np.ndarray:
        """Parameters (members, size)."""
        return np.broadcast_to(self._parameter_rows(), (self.face.count, self.face.parameters.size))

    def _parameter_rows(self) -> np.ndarray:
        """Parameters (members or 1, size)."""
        rows = of_lanes(self._buffers.parameters)
        own = len(self._buffers.parameters) == self._groups and np.any(rows[: self.face.count] != rows[0])
        return rows[: self.face.count] if own else rows[:1]

    def _take_parameters(self, other: object, which: np.ndarray) -> None:
        """Have the parameters of these members of a clone."""

    def _rows(self, rows: np.ndarray, state: PyTree, which: np.ndarray) -> np.ndarray:
        """States (k, size) of these members from a given state; `rows` supplies the values that it does not name."""
        if not isinstance(state, Mapping):
            raise ArgumentError(f"Argument `state` must be what `stepper.state` showed, but is {type(state).__name__}.")
        if {"xi", "nu"} & set(state) and not {"mu", "pi"} & set(state):
            raise ArgumentError(
                "Velocities of a stepper follow from its momenta: give `mu` and `pi`, or a state of system.state(xi=…)."
            )
        self._fill(rows, state, which, "state")
        return rows

    def _fill(self, rows: np.ndarray, given: Mapping[str, object], which: np.ndarray, what: str) -> None:
        """Write named values, of all members or of the chosen ones, into rows (k, size)."""
        fields = getattr(self.face, "parameters" if what == "parameter" else "state")
        views = fields.views(rows)
        for name, value in given.items():
            if name not in views:
                raise ArgumentError(fields.unknown(name, what))
            value = real(value, f"The {what} `{name}`")
            single = views[name].shape[1:]
            if self.face.members is not None and value.shape == (self.face.count, *single):
                value = value[which]
            elif value.shape not in (single, views[name].shape):
                expected = "a number" if single == () else f"shape {single}"
                many = "" if self.face.members is None else f", or one for each of {self.face.count} members"
                raise ArgumentError(f"The {what} `{name}` must have {expected}{many}, but has shape {value.shape}.")
            if not np.all(np.isfinite(value)):
                raise ArgumentError(f"The {what} `{name}` must be finite, but is not.")
            lead = 1 if value.shape == single else len(value)
            rows[:, fields.place(name)] = value.reshape(lead, math.prod(single))

    def _go(self, which: np.ndarray, rows: np.ndarray) -> dict[str, np.ndarray]:
        """Move to these states, with no step done."""
        buffers, count = self._buffers, self.face.count
        self.event = None
        put(buffers.state, which, rows)
        put(buffers.status, which, np.zeros((len(which), 4), np.int64))
        buffers.commands[which] = rows[:, list(self.face.commanded)]
        if len(which) and which[-1] == count - 1 and len(buffers.commands) > count:
            idle = np.arange(count, len(buffers.commands))
            put(buffers.state, idle, np.broadcast_to(rows[-1], (len(idle), rows.shape[1])))
        self._look()
        return self.observation

    def _look(self) -> None:
        """Observe the current state; raises StepError if an observation is not finite."""
        flags = self._engine.advance(self._buffers, self._address, self._groups, 0, 1)
        self._judge(flags & StatusFlag.NOT_FINITE)

    @property
    def state(self) -> PyTree:
        """A copy of all numbers of the current state by their names, as `restore` takes them."""
        with self._turn.reading():
            return self.face.state.views(self._of_members(of_lanes(self._buffers.state)))

    def clone(self) -> Self:
        """Another stepper in the same state; both are independent from there on."""
        with self._turn.reading():
            made = object.__new__(type(self))
            made.__dict__.update(self.__dict__)
            made._turn = StepperLock()
            made._sample, made._later = (sample and sample.copy() for sample in (self._sample, self._later))
            made._take_memory(self._buffers.copy())
            return made

    def stand_as(self, other: StepperBase) -> None:
        """Take the state of another stepper of the same system, method and observations, which may have been pickled.

        This stepper continues bitwise as the other would, with its parameters and start; both share memory.
        """
        self._stand(other.face, other._engine, other._buffers, other._origin, other.threads, other._kin)
        self.event = other.event

    def __copy__(self) -> Self:
        return self.clone()

    def __deepcopy__(self, memo: object) -> Self:
        return self.clone()

    # Failures.

    def _judge(self, flags: int, n: int = 0) -> None:
        """Raise if an observation is not finite, or if a single one has failed or ended; n: the requested steps.

        A single one that has just reached its event moves there.
        """
        if flags & (StatusFlag.CLIPPED | StatusFlag.DUE):
            self._heed(flags, n)
        if flags & StatusFlag.NOT_FINITE:
            bad = [name for name, view in self.observation.items() if not np.all(np.isfinite(view))]
            if bad:
                raise StepError(f"Observation `{bad[0]}` is not finite{self._when(0)}: look for a division by zero.")
        if not flags & StatusFlag.FAILED or self.face.members is not None:
            return
        if self.status != Code.STOPPED:
            raise StepError(self._sentence(0))
        if self.event is not None:
            raise StepError(f"The event `until` came at t = {self.event:.6g} s: reset or restore the stepper.")
        self._end(n)

    def _end(self, n: int) -> None:
        """Move to the event that stopped a single one within n steps, as far as possible."""
        self.event = float(self.t)

    def _when(self, member: int) -> str:
        return f" at t = {float(np.atleast_1d(self.t)[member]):.6g} s"

    def _sentence(self, member: int) -> str:
        """The failure of a member, its place, and the remedy."""
        code, done = (int(np.atleast_1d(x)[member]) for x in (self.status, self.steps))
        whose = "" if self.face.members is None else f" of member {member}"
        where = f"Step {done}{whose} (t = {float(np.atleast_1d(self.t)[member]):.6g} s)"
        commands = self.face.commands.views(self._buffers.commands[member])
        return failed_step(where, code, self.face.dt, self.face.remedies, commands)

    # Members.

    def _of_members(self, rows: np.ndarray) -> PyTree:
        """Rows of the members alone; the row of a single one."""
        return rows[: self.face.count] if self.face.members is not None else rows[0]

    def _number(self, grouped: np.ndarray, place: int) -> PyTree:
        """A copy of one number of all members, from (groups, size, lanes)."""
        return self._of_members(grouped[:, place].flatten())

    def _which(self, mask: object) -> np.ndarray:
        """The members that a mask means."""
        if mask is None:
            return np.arange(self.face.count)
        if self.face.members is None:
            raise ArgumentError("Argument `mask` is for many members, but this stepper has a single one: leave it out.")
        try:
            mask = np.asarray(mask)
        except ValueError:
            mask = np.asarray(None)
        if mask.dtype != bool or mask.shape != (self.face.count,):
            raise ArgumentError(
                f"Argument `mask` must be truth values of shape ({self.face.count},), one for each member, but has "
                f"type {mask.dtype} and shape {mask.shape}."
            )
        return np.flatnonzero(mask)

    def __repr__(self) -> str:
        many = "" if self.face.members is None else f"{self.face.members:,} × "
        commands, observations = (", ".join(f.names) or "none" for f in (self.face.commands, self.face.observations))
        takes, shows = f"commands: {commands}", f"observations: {observations}"
        return f"<Stepper of {many}{self.face.title}, dt = {self.face.dt:g} s; {takes}; {shows}>"
