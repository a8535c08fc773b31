"""The stepper of a system: compiled once, then one control period at a time, as `co.simulate` would compute it."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import jax
import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.c_sources import identifier, write_library
from coadjoint.checks import positive, truth, whole
from coadjoint.errors import ArgumentError, warn
from coadjoint.kernels import packing
from coadjoint.kernels.emit.plan import specialised
from coadjoint.kernels.lanes import of_lanes
from coadjoint.kernels.packing import layout
from coadjoint.kernels.program import Code
from coadjoint.kernels.run import native
from coadjoint.kernels.run.backend import Backend, fall_back, require_backend
from coadjoint.kernels.run.ensemble import lanes
from coadjoint.kernels.run.portable_code import exported_code, linked
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.kernels.untraceable import NotLinked, Untraceable
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.members import Each, stacked
from coadjoint.mechanics.restart_checks import going_on
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.mechanics.traced_once import tracing_once
from coadjoint.methods.method import Method
from coadjoint.methods.midpoint import Midpoint
from coadjoint.methods.program import Constants, as_read
from coadjoint.methods.rattle import around
from coadjoint.methods.step_model import StepModel
from coadjoint.simulation.accuracy.local_error import PartsOfSteps, Ruler
from coadjoint.simulation.accuracy.ruler import course_of, plain, ruler_of
from coadjoint.simulation.arguments import require_kinds
from coadjoint.simulation.derived import after_step
from coadjoint.simulation.events import Event, as_event
from coadjoint.simulation.members import first_member
from coadjoint.simulation.plan import Plan
from coadjoint.simulation.steppers.beginning import Beginning, Shapes, carried, rows_where, shapes_of, spread
from coadjoint.simulation.steppers.building import (
    Commands,
    checked,
    commanded,
    commanded_system,
    commands_from,
    ending,
    fixed_parameters,
    limits_of,
    members_of,
    places_of,
    program_of,
)
from coadjoint.simulation.steppers.c_library import StepSlopes, sources
from coadjoint.simulation.steppers.engines import Observe, XlaEngine, linked_engine, native_engine, watch
from coadjoint.simulation.steppers.fields import Fields
from coadjoint.simulation.steppers.interface import Buffers, Engine, NativeEngine, Prepared, StepperInterface, put
from coadjoint.simulation.steppers.stepping import Stepping
from coadjoint.simulation.trajectory import Trajectory, computed
from coadjoint.texts import Table


class Stepper(Stepping):
    """A system stepped from outside: set a command, take n steps, read the observations.

        stepper = co.Stepper(vehicle, start, dt=0.05, inputs=("thrust",), observe={"depth": lambda s: s.q[2]})
        seen = stepper.step({"thrust": 3.0}, n=2)
        float(seen["depth"])

    The steps are bitwise identical to those of `co.simulate` without monitors if the same commands are a `co.Held`
    table and the method's nodes lie inside the step; many members agree with that to round-off.

    Arguments:
        system, start, method: those of `co.simulate`; a method of variable steps raises ArgumentError.
        dt: h, the length of a step, s; positive.
        inputs: the names of commands that are numbers and start at 0, by default none; or name → the first value of
            the command, a number or an array. A signal or a function of the motion in place of a first value is an
            input as for `co.simulate`, not a command. A command is held over its steps.
        observe: name → function of the state, or of the state and the parameters, to a number or an array; by default
            none.
        until: a function of the state to a number, or a `co.Event` with a direction: a single one stops where it
            crosses zero, and `stepper.event` is that time in s; of many, each stops at the node before. By default
            none. It reads the ξ and ν of the node, as `stepper.state` and `co.simulate` have them. Two zeros within one
            step are not seen.
        changing: names of parameters that `change` may set to any value without compiling: those that are 0 or 1 are
            otherwise compiled in. By default none.
        members: the number stepped together; by default the number that `co.each` gives to parameters or start,
            otherwise a single one.
        threads: the number of threads that share the members, by default 1.
        backend: as for `co.simulate`, by default "auto".
        accuracy: whether the first step is judged now, and a sample of the steps when they are taken, the first three
            and those after 4, 8, … up to 4096, each by comparison with shorter steps over the same time; by default
            True. It warns once if dt does not resolve the motion, and gives a dt that does. Commands and inputs that
            are functions of the motion count as held. `trajectory` inside your own jit, grad or vmap is not judged.

    Raises ArgumentError and LagrangianError for arguments that cannot be stepped; `step` raises StepError.
    """

    @checks.known_arguments("co.Stepper")
    def __init__(
        self,
        system: System,
        start: State,
        *,
        dt: float,
        inputs: PyTree = (),
        observe: Observe | None = None,
        method: Method | None = None,
        until: Event | Callable[[State], PyTree] | None = None,
        changing: Sequence[str] = (),
        members: int | None = None,
        threads: int = 1,
        backend: Backend = "auto",
        accuracy: bool = True,
    ):
        method = Midpoint() if method is None else method
        require_kinds(system, start, method)
        require_backend(backend)
        judging = truth(accuracy, "accuracy")
        if method.variable:
            raise ArgumentError(f"A stepper takes steps of dt, but {method.title} chooses its own: take another.")
        h, threads, count = positive(dt, "dt"), whole(threads, "threads"), members_of(system, start, members)
        commands = commands_from(inputs)
        system, start = commanded_system(system, start, commands, method.start == "velocity")
        values, axes = stacked(system.parameters)
        parameters = rows_where(values, axes)
        starts = start if np.ndim(start.t) else spread(start, (1 if count is None else count,))
        with tracing_once():
            one, begun, seen = self._trace(system, start, method, h, count, observe, as_event(until))
            for step in dict.fromkeys(step for step, _ in around(one, method.stages)) if len(starts.t) > 1 else ():
                step.require_members(system, values, axes, starts, starts)
            face, engine = self._compiled(one, begun, commands, parameters, changing, Fields.of(seen), backend)
            states = self._beginning.begun(starts, parameters, starts.inputs)
        buffers = Buffers.filled(parameters, h, states, (face.commands.size, face.observations.size), engine.lanes)
        limits = limits_of(system.internal, system.parameters, face.commands)
        super().__init__(face, engine, buffers.with_limits(limits), buffers.state.copy(), threads)
        if judging:
            begins, places = self._beginning.state, begun.places
            course = course_of(begins, system.internal)
            self._begin_sample(PartsOfSteps(self._steps(course), ruler_of(begins, places), course, method.order))

    def _trace(
        self, system: System, start: State, method: Method, h: float, count: int | None, observe: Observe | None,
        event: Event | None,
    ) -> tuple[System, State, Shapes]:  # fmt: skip
        """Check one member and trace its observations: its system, its start as the method begins it, and their shapes.

        Sets the program, the beginning and the observations.
        """
        one, first = first_member(system, start)
        begun, version, warnings = checked(one, first, method, h, event)
        for sentence in warnings:
            warn(sentence, stacklevel=4)
        skeleton = replace_parameters(system, None)
        self._watch, seen = watch(one, observe, begun)
        self._program = program_of(skeleton, method, event, version)
        self._beginning = Beginning(skeleton, method, h, count, begun, Constants(one.parameters, None))
        return one, begun, seen

    def _compiled(
        self, one: System, begun: State, commands: Commands, parameters: np.ndarray, changing: Sequence[str],
        seen: Fields, backend: Backend,
    ) -> tuple[StepperInterface, Engine]:  # fmt: skip
        """The interface and the engine; machine code unless XLA is asked for or needed."""
        program, constants = self._program, Constants(one.parameters, None)
        fixed, compiled_in = fixed_parameters(constants, parameters, changing)
        face = self._face(shapes_of(begun), commands, fixed, seen, compiled_in)
        try:
            if backend != "xla":
                with as_read(program.version):
                    return face, self._native(face, constants, begun)
        except Untraceable as reason:
            fall_back(reason, backend)
        begun = program.method.begin_by_xla(one, begun)
        one_step = self._beginning.skeleton, program.method, self._beginning.h, self._beginning.members
        self._beginning = Beginning(*one_step, begun, constants, by_xla=True)
        face = self._face(shapes_of(begun), commands, fixed, seen, ())
        layouts = self._beginning.constants, self._beginning.state
        return face, XlaEngine(program, self._watch, layouts, face.commanded)

    def _plain_ruler(self) -> Ruler | None:
        if self._parts is None:
            return None
        return plain(self._parts.ruler, self._beginning.state, self._program.skeleton.places)

    def _face(
        self,
        names: Shapes,
        commands: Commands,
        fixed: Fields,
        seen: Fields,
        compiled_in: tuple[tuple[int, float], ...],
    ) -> StepperInterface:
        """The interface of the stepper: names and places of its numbers."""
        begun, method = self._beginning, self._program.method
        return StepperInterface(
            title=f"{self._program.skeleton.name}, {method.title}",
            dt=begun.h,
            members=begun.members,
            parameters=fixed,
            state=Fields.of(names),
            commands=commands.fields,
            observations=seen,
            commanded=places_of(list(names.items()), commands),
            time=Fields.of(names).place("t").start,
            remedies=method.remedies,
            compiled_in=compiled_in,
            of_momenta=begun.of_momenta(),
        )

    def _native(self, face: StepperInterface, constants: Constants, begun: State) -> Engine:
        width = 1 if face.members is None else lanes()
        values = np.full(face.parameters.size, np.nan)
        for place, number in face.compiled_in:
            values[place] = number
        given = self._program, self._watch, constants, begun, specialised(values), face.commanded
        if native.linked(self._program, begun) is not None:
            try:
                return linked_engine(*given)
            except NotLinked:
                if not native.written(self._program):
                    raise
        return native_engine(*given, width)

    def export_c(
        self,
        folder: str | os.PathLike[str],
        *,
        name: str | None = None,
        units: Mapping[str, str] | None = None,
        target: str | None = None,
        overwrite: bool = False,
    ) -> Path:
        """Write a C library without Python: NAME.h, NAME.c, NAME_code.o with the machine code, and CMakeLists.txt.

            stepper.export_c("robot/remus", units={"depth": "m"})

        The library steps, observes, and gives the Jacobian of a step by the state and the commands; the header has the
        names, places and shapes of all numbers, and the error codes. It begins where the stepper is now. On the same
        processor its steps are bitwise those of the stepper.

        folder: where its parent exists. name: of the library, by default that of the folder. units: name → unit, for
        the header; those of the system are known. target: the processor, as a triple such as "aarch64-linux-gnu", by
        default this one. overwrite: whether to replace files. Raises FileError rather than replace one, ArgumentError
        for a stepper of many members or by XLA, and for an unknown target.
        """
        name = identifier(Path(folder).name if name is None else name, "folder" if name is None else "name")
        known = {**dict(self._program.skeleton.units), "t": "s", **(units or {})}
        with self._turn.reading():
            header, source, parts = sources(self, name, known, self._slopes())
        texts, code = {f"{name}.h": header, f"{name}.c": source}, exported_code(linked(parts), target)
        return write_library(folder, name, texts, overwrite, code)

    def _slopes(self) -> StepSlopes | None:
        """The step with its derivatives as machine code; None where the state is not that of a `StepModel`."""
        if self.face.members is not None or not isinstance(self._engine, NativeEngine):
            return None
        program, begun = (
            replace(self._program, until=None),
            self._beginning.state.unpack(of_lanes(self._buffers.state)[0]),
        )
        constants = self._beginning.constants.unpack(self._parameter_rows()[0])
        fixed = {place for place, _ in self.face.compiled_in}
        free = [place for place in range(self.face.parameters.size) if place not in fixed]
        model = StepModel(program, constants, begun, course=True, free=free)
        substep = model.substep_assembly()
        if model.layout != self._beginning.state or substep is None:
            return None
        kernel = model.kernel(1)
        watched = kernel.monitor_size + len(kernel.certificates)
        return StepSlopes(model.assembly(), substep, program.unknowns, tuple(program.substeps), kernel.row, watched)

    # The same as pure functions.

    def trajectory(
        self, state: State, command: PyTree = None, n: int = 1, *, parameters: PyTree = None, backend: Backend = "auto"
    ) -> Trajectory:
        """n steps from a state under commands as a pure function, for jax.grad, jit, vmap and scan: `.final`, `.code`.

            after = stepper.trajectory(state, {"thrust": gain * error}, n=2).final

        state: a value of `stepper.state`, or a result of this function; for a stepper of many members that of one
        member. command: name → value; commands that are not named keep their values in `state.inputs`. parameters:
        those of the system, by default the current ones. Derivatives, failures and backend are those of
        `co.trajectory`; the result agrees with `step` to round-off, without an event.
        """
        n, program = whole(n, "n"), replace(self._program, until=None)
        moved = commanded(program.skeleton.inputs, self._single(state), command)
        constants = self._beginning.fitting(self._constants(parameters), moved)
        found = computed(program, constants, moved, np.float64(self.face.dt), (1, n), backend)
        return replace(found, final=after_step(program, constants.system, found.final))

    def observe(self, state: State, parameters: PyTree = None) -> Table:
        """The observations of a state, name → array, as a pure function."""
        found = evaluate(self._watch, self._constants(parameters), self._single(state))
        return dict(zip(self.face.observations.names, found, strict=True))

    def _single(self, state: State) -> State:
        state = self._beginning.carrying(going_on(state)) if isinstance(state, State) else state
        if not isinstance(state, State) or state.from_velocities or layout(state) != self._beginning.state:
            raise ArgumentError("Argument `state` must be that of a single member, as `stepper.state` shows it.")
        if any(np.dtype(getattr(leaf, "dtype", float)) != np.float64 for leaf in jax.tree.leaves(state)):
            raise ArgumentError("Argument `state` must be float64: wrap your own jit, grad or vmap in `co.float64()`.")
        return state

    def _constants(self, parameters: PyTree) -> Constants:
        rows = self._parameter_rows()
        if parameters is None and len(rows) > 1:
            raise ArgumentError("The members have parameters of their own: give those meant as `parameters`.")
        return self._beginning.constants.unpack(rows[0]) if parameters is None else Constants(parameters, None)

    def _end(self, n: int) -> None:
        """Take the part of a step that leads to the event, as `co.simulate` does; or continue from a start at one."""
        until, direction = self._program.until, self._program.direction
        assert until is not None
        backend: Backend = "native" if isinstance(self._engine, NativeEngine) else "xla"
        constants = self._beginning.constants.unpack(self._parameter_rows()[0])
        run = Plan(backend, self._program, constants, self.face.dt, 1, 1, False)
        state, happens = ending(run, Event(until, direction), self._last, self.steps == 0)
        put(self._buffers.state, np.zeros(1, int), packing.rows(spread(state, (1,)), 1))
        if happens:
            self.event = float(state.t)
            self._look()
            return
        self._buffers.status[0, :2, 0] = 1, Code.CONVERGED
        self._judge(self._beyond(n - 1), n - 1)

    @property
    def state(self) -> State:
        """A copy of the current state, for `restore` and as a start of `co.simulate` and `co.trajectory`.

        ξ and ν are those of the node, as `run.final` and functions of `observe` have them; they are computed when they
        are read first. Those of a saved stepper are the last unknowns, of the step that ended there.
        """
        with self._turn.reading():
            state = self._last
            rows = np.broadcast_to(self._parameter_rows(), (self.face.count, self.face.parameters.size))
            constants = self._beginning.constants.unpack(self._of_members(rows.copy()))
        return after_step(self._program, constants.system, state)

    @property
    def _last(self) -> State:
        """The current state with the last unknowns, from which the next step begins, as ξ and ν."""
        return self._beginning.state.unpack(self._of_members(of_lanes(self._buffers.state)))

    def _rows(self, rows: np.ndarray, state: Any, which: np.ndarray) -> np.ndarray:
        if isinstance(state, State):
            found = self._beginning.rows(state, self._parameter_rows())[which]
        else:
            found = super()._rows(rows, state, which)
        self._beginning.require_place(found, self._all_parameters()[which], "the state")
        return found

    def prepared(self, states: State, parameters: PyTree = None) -> Prepared:
        """k starts that the method begins together, for `begin`: moving to one of them costs a copy of its numbers.

        states: velocities and configurations of single members, as system.state(…) gives them, each leaf with a first
        axis (k, …). parameters: those of the system at each start, with `co.each` of k where they differ; by default
        the current ones.
        """
        count, rows = len(states.t), None
        if parameters is not None:
            rows = rows_where(*stacked(parameters))
            rows = np.broadcast_to(rows, (count, rows.shape[1]))
            if columns := self.face.compiled_out(rows):
                self._recompile(columns, rows)
        given = self._parameter_rows()[:1] if rows is None else rows
        held = None if self._beginning.held is None else spread(self._beginning.held, (count,))
        return Prepared(self._beginning.begun(states, given, held), rows)

    def _seeded(self, rows: np.ndarray, seeds: np.ndarray) -> np.ndarray:
        """By the rule's own seeded(internal, seeds): internal states (k, …) with random numbers of seeds (k,)."""
        seeded = getattr(self._program.skeleton.internal, "seeded", None)
        if seeded is None:
            raise ArgumentError(
                "Nothing in this system is random: leave out `seed`, or give its rule a method seeded(internal, seeds)."
            )
        states = self._beginning.state.unpack(rows)
        return packing.rows(states.replace(internal=seeded(states.internal, seeds)), len(rows))

    @property
    def parameters(self) -> PyTree:
        """The current parameters of the system; if members have different ones, with a first axis of members."""
        rows = self._parameter_rows()
        return self._beginning.constants.unpack(rows[0] if len(rows) == 1 else rows).system

    def _fill(self, rows: np.ndarray, given: Mapping[str, Any], which: np.ndarray, what: str) -> None:
        plain = {name: value.values if isinstance(value, Each) else value for name, value in given.items()}
        super()._fill(rows, plain, which, what)

    def _with(self, parameters: np.ndarray) -> Buffers:
        """The memory with parameters (members, size) and their limits of commands, save limits with a past warning."""
        rows = self._beginning.constants.unpack(parameters).system
        system = jax.tree.map(lambda leaf: leaf[0] if np.all(leaf == leaf[0]) else Each(leaf), rows)
        ends = limits_of(self._program.skeleton.internal, system, self.face.commands)
        open_, made = np.isinf(self._buffers.limits[..., 0]), self._buffers.with_parameters(parameters)
        return made.with_limits(np.where(open_, self._buffers.limits[..., 0], ends))

    def _carried(self, states: np.ndarray, before: np.ndarray, after: np.ndarray) -> np.ndarray:
        return carried(self._beginning, states, before, after)

    def _require_fit(self, states: np.ndarray, before: np.ndarray, after: np.ndarray) -> None:
        self._beginning.require_place(states, after, "the state under these parameters")

    def _recompile(self, columns: list[int], parameters: np.ndarray) -> None:
        warn(
            f"Parameter {self._called(columns)} was compiled in as 0 or 1, and the step is compiled anew: name it in "
            "`changing` of co.Stepper, and it changes at once.",
            stacklevel=3,
        )
        kept = tuple(pair for pair in self.face.compiled_in if pair[0] not in columns)
        self.face = replace(self.face, compiled_in=kept)
        constants = self._beginning.constants.unpack(parameters[0])
        begun = self._beginning.state.unpack(of_lanes(self._origin)[0])
        self._engine = self._native(self.face, constants, begun)
