"""Stepping one control period at a time: commands in, steps, observations out, in memory that is allocated once.

Knows NumPy and an engine only, so that a saved stepper runs without JAX; `steppers.stepper` builds one of a system.
"""

from __future__ import annotations

import math
import os
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.disk import reading
from coadjoint.errors import ArgumentError, FileError, Interrupted, shown, warn
from coadjoint.interrupts import deferred_interrupts
from coadjoint.kernels.lanes import of_lanes
from coadjoint.kernels.program import StatusFlag
from coadjoint.kernels.run.interruptible import FIRST, Clock
from coadjoint.paths import paths
from coadjoint.simulation.accuracy.verdict import SampledSteps
from coadjoint.simulation.steppers.base import StepperBase
from coadjoint.simulation.steppers.code_archive import save
from coadjoint.simulation.steppers.fields import MOST, named_file, real, truths, whole, write
from coadjoint.simulation.steppers.file import from_bytes, to_bytes
from coadjoint.simulation.steppers.interface import Buffers, put


class Stepping(StepperBase):
    """A system that is stepped from outside. One thread at a time steps it: give each thread a `clone()`."""

    def step(self, command: PyTree = None, n: int = 1, *, copy: bool = False) -> dict[str, np.ndarray]:
        """Set the commands, take n steps, and return the observations.

        command: name → value, all numbers in the order of the names, or None: unchanged. Commands stay until they are
        set again. n: steps of dt. copy: whether to return copies, which the next step does not overwrite.
        Raises StepError if the step of a single one fails, and again at every step until `reset` or `restore`; of many
        members, those that fail keep their states, and `failures` gives the reasons. Raises ArgumentError for other
        names and shapes.
        """
        if n.__class__ is not int or not 1 <= n <= MOST:
            n = whole(n)
        lock = self._turn.lock
        if not lock.acquire(False):
            self._turn.wait()
        try:
            if command is not None:
                self._take(command)
            if n <= self._straight:
                flags = self._engine.advance(self._buffers, self._address, self._groups, n, self.threads)
            else:
                flags = self._beyond(n)
            if flags:
                self._judge(flags, n)
            return self._copied() if copy else self.observation
        finally:
            lock.release()

    @deferred_interrupts()
    def _beyond(self, n: int) -> int:
        """n steps: those of the sample are judged before they are taken, and long calls go in pieces."""
        left = n
        while (sample := self._sample) is not None:
            try:
                self._judge_next(sample)
            except KeyboardInterrupt:
                raise _interrupted(n - left, n) from None
            length = left if self._sample is None else min(left, sample.next - sample.count)
            flags = self._in_pieces(length, n - left, n)
            sample.count, left = sample.count + length, left - length
            if sample.over:
                self._end_sample(later=sample)
            if not left:
                return flags
            if flags & StatusFlag.FAILED and self.face.members is None:
                self._judge(flags, n)
                return 0
        return self._in_pieces(left, n - left, n)

    def _judge_next(self, sample: SampledSteps) -> None:
        """Judge the next step if it belongs to the sample, and warn once."""
        if sample.due() and (sentence := self._judgement(sample)):
            self._end_sample()
            warn(sentence, stacklevel=5)

    def _in_pieces(self, n: int, before: int = 0, of: int = 0) -> int:
        """n steps, all members together, in pieces between which Python sees signals; `before` were taken, `of` all."""
        if n <= FIRST or n <= self._pace.steps:
            return self._engine.advance(self._buffers, self._address, self._groups, n, self.threads)
        memory, clock, due = self._buffers, Clock(self._pace), 0
        mark = 0, memory.state.copy(), memory.status.copy()
        try:
            while True:
                steps = min(self._pace.steps, n - mark[0])
                flags = self._engine.advance(memory, self._address, self._groups, steps, self.threads)
                mark = mark[0] + steps, memory.state.copy(), memory.status.copy()
                clock.lap(steps)
                due |= flags & StatusFlag.DUE
                if mark[0] >= n or np.all(memory.status[:, 1] != 0):
                    return flags | due
        except KeyboardInterrupt:
            # Threads may have reached different nodes.
            done, memory.state[...], memory.status[...] = mark
            self._look()
            raise _interrupted(before + done, of or n) from None

    def _take(self, command: PyTree) -> None:
        """Put commands into their memory, all of them or none."""
        kept = self._commands.tobytes()
        try:
            self._put(command)
            if self.face.members is None and not math.isfinite(sum(self._fast or self._commands.ravel())):
                self._require_finite()
        except BaseException:
            self._commands[...] = np.frombuffer(kept).reshape(self._commands.shape)
            raise

    def _require_finite(self) -> None:
        """Raise ArgumentError if a command of a single one is not finite; one of many fails its step instead."""
        for name, value in self.command.items():
            if not np.all(np.isfinite(value)):
                raise ArgumentError(f"Command `{name}` must be finite, but is {np.asarray(value).tolist()}.")

    def _put(self, command: PyTree) -> None:
        if self._pack is not None and command.__class__ in (tuple, list) and not truths(command):
            try:
                self._pack(self._fast, 0, *command)
                return
            except (struct.error, OverflowError):
                pass  # the error message follows
        if command.__class__ is dict or isinstance(command, Mapping):
            for name, value in command.items():
                if value.__class__ is float and name in self._slots:
                    self._fast[self._slots[name]] = value
                    continue
                if name not in self.command:
                    raise ArgumentError(self.face.commands.unknown(name, "command"))
                write(self.command[name], value, f"Command `{name}`", self.face.members)
        else:
            numbers = real(command, "The command")
            same_for_all = self.face.members is not None and numbers.shape == (1,)
            alone = self.face.commands.size == 1 and numbers.ndim < self._commands.ndim and not same_for_all
            place = self._commands[..., 0] if alone else self._commands
            write(place, numbers, "The command", self.face.members)

    def _copied(self) -> dict[str, np.ndarray]:
        return self.face.observations.views(self.observed.copy())

    # Leaving the process.

    def save(self, path: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
        """Write it to a file, such as `remus.step`, from which `co.load_stepper` continues without JAX.

        Raises FileError rather than replace a file, ArgumentError for one that runs by XLA.
        """
        return save(path, overwrite, lambda _: to_bytes(self))

    def __reduce__(self) -> tuple[object, ...]:
        return opened, (to_bytes(self),)

    # Parameters.

    @property
    def parameters(self) -> PyTree:
        """A copy of the parameters by their names; if members have different ones, with a first axis of members."""
        rows = self._parameter_rows()
        return self.face.parameters.views((rows[0] if len(rows) == 1 else rows).copy())

    def change(
        self,
        values: Mapping[str, object] | None = None,
        *,
        mask: object = None,
        keep: str = "velocity",
        **named: object,
    ):
        """Change parameters between two steps, by names, or by a dictionary as `parameters` of a saved stepper shows.

            stepper.change(rudder={"lift_slope": 0.0})        # a lost fin
            fleet.change(mass=30.0, mask=released)            # a dropped mass, of some members

        mask: (members,) truth values that choose members; a value may also have one entry for each member. keep:
        "velocity", so that the velocities of the node are continuous and the momenta jump to match them, or "momentum";
        the start to which `reset` returns changes likewise.
        Raises ArgumentError for names that are not parameters, and for a saved stepper that would have to be recompiled
        or to keep velocities.
        """
        fits = isinstance(keep, str) and keep in ("velocity", "momentum")
        checks.expect(fits, keep, "keep", '"velocity" or "momentum"')
        if values is not None and not isinstance(values, Mapping):
            raise ArgumentError(f"Give parameters by their names, as in change(mass=30.0), but not {shown(values)}.")
        given = paths({**(values or {}), **named})
        if not given:
            raise ArgumentError("Give at least one parameter to change, as in change(mass=30.0).")
        which = self._which(mask)
        with self._turn.alone():
            before = self._all_parameters()
            rows = before[which]
            self._fill(rows, given, which, "parameter")
            after = before.copy()
            after[which] = rows
            here, origin = of_lanes(self._buffers.state)[which], of_lanes(self._origin)[which]
            if keep == "velocity":
                twice = [np.concatenate([part, part]) for part in (before[which], rows)]
                here, origin = np.split(self._carried(np.concatenate([here, origin]), *twice), 2)
            self._require_fit(np.concatenate([here, origin]), *(np.concatenate([k, k]) for k in (before[which], rows)))
            if columns := self.face.compiled_out(after):
                self._recompile(columns, after)
            self._origin = self._origin.copy()
            put(self._origin, which, origin)
            put(self._buffers.state, which, here)
            self._take_memory(self._with(after))
            self._look()

    def _take_parameters(self, other: Any, which: np.ndarray) -> None:
        if self._engine is other._engine and np.array_equal(self._buffers.parameters, other._buffers.parameters):
            return
        after = self._all_parameters().copy()
        after[which] = other._all_parameters()[which]
        if not other.face.compiled_out(after):
            self.face, self._engine = other.face, other._engine
        elif columns := self.face.compiled_out(after):
            self._recompile(columns, after)
        self._take_memory(self._with(after))

    def _with(self, parameters: np.ndarray) -> Buffers:
        """The memory with parameters (members, size); the limits of commands stay those of the file."""
        return self._buffers.with_parameters(parameters)

    def _carried(self, states: np.ndarray, before: np.ndarray, after: np.ndarray) -> np.ndarray:
        """The states (k, size) whose velocities stay when the parameters change."""
        raise ArgumentError('A saved stepper does not know how momenta belong to velocities: pass keep="momentum".')

    def _require_fit(self, states: np.ndarray, before: np.ndarray, after: np.ndarray) -> None:
        """Raise ArgumentError where states (k, size) do not fit the parameters after a change, (k, size) each."""
        changed = [place for place in self.face.of_momenta if np.any(before[:, place] != after[:, place])]
        if changed:
            raise ArgumentError(
                f"Parameter {self._called(changed)} determines the momenta ϑ of a place, which a saved stepper does "
                "not know: change it in co.Stepper."
            )

    def _recompile(self, columns: list[int], parameters: np.ndarray) -> None:
        """Recompile with these places of the parameters free."""
        raise ArgumentError(
            f"Parameter {self._called(columns)} is compiled into this stepper: name it in `changing` of co.Stepper "
            "before saving."
        )

    def _called(self, columns: list[int]) -> str:
        """The names of the parameters at these places."""
        found = [name for name, _, place in self.face.parameters.places() if set(columns) & set(_numbers(place))]
        return ", ".join(f"`{name}`" for name in found)


def _interrupted(done: int, n: int) -> Interrupted:
    return Interrupted(
        f"Interrupted after {done:,} of {n:,} steps: the stepper stands there, and step(n={n - done}) goes on."
    )


def opened(content: bytes) -> Stepping:
    """The stepper whose file has this content."""
    return from_bytes(content, Stepping)


def _numbers(place: slice) -> range:
    return range(place.start, place.stop)


def load_stepper(path: str | os.PathLike[str]) -> Stepping:
    """The stepper that `stepper.save(path)` wrote, in the same state. JAX is not imported.

        stepper = co.load_stepper("remus.step")

    path: the file. On the same processor its steps are bitwise identical to those of the saved stepper; `state`,
    `reset` and `restore` take and give numbers by their names, `change` keeps momenta, and an event stops it at the
    node before. The file holds machine code that is run: load only files that you would run as programs. Raises
    FileError for another kind of file, and for one of a newer version.
    """
    path = named_file(path)
    with reading(path):
        content = path.read_bytes()
    try:
        return opened(content)
    except FileError as error:
        raise FileError(f"The file {path} {error}") from None
