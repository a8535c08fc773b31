"""Outputs of a run that a user orders: which data, at which cadence, and to which place."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import jax
import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError, shown
from coadjoint.kernels.run.backend import monitor_shapes
from coadjoint.kernels.trace.evaluate import evaluate, tabulate
from coadjoint.mechanics.state import Origin, State
from coadjoint.mechanics.trace_checks import in_words, require_float64
from coadjoint.methods.program import EVENTS
from coadjoint.simulation.arguments import read_of
from coadjoint.simulation.dataset import attributes, members_of
from coadjoint.simulation.derived import BATCH, at_nodes, derivation, times
from coadjoint.simulation.result import Result
from coadjoint.simulation.sinks import Memory, Scheduled

if TYPE_CHECKING:
    import xarray

WHAT = "None for records, names of monitors, or a function of the state"
TO = "None for memory, the path of a folder, or a function of (time, value)"
VALUE = "value"
"""The name of a function's value in a dataset, unless the function returns a dictionary."""


@dataclass(frozen=True)
class Output:
    """What a run gives away on its way: `what` at every `every`-th node, and the last one, goes `to` some place.

        depth = co.Output(every=0.5, what=lambda state: state.q[2])
        alarm = co.Output(every=10, what="energy", to=lambda time, energy: energy > 5.0)
        run = co.simulate(system, start, dt=0.01, duration=60, outputs=[depth, alarm])
        run.outputs[0].value            # an xarray.DataArray over `time`

    every: the cadence, a number of steps as an integer, or s as a float, a multiple of dt; by default each step.
    what: None, the records with their monitors (default); the name of a monitor or a list of them, such as
    "energy"; or a function of the state at a node, in terms of jax.numpy, to an array or a dictionary of arrays.
    to: None, memory (default): `run.outputs` has a dataset for each; the path of a new folder, for records, as that of
    `store`; or a function (time, value), called during the run, which ends it at this node if it returns True. With
    `co.each` values have a first axis of members. Raises ArgumentError for others.
    """

    every: int | float = 1
    what: Callable[[State], PyTree] | str | Sequence[str] | None = None
    to: Callable[[float, Any], object] | str | os.PathLike[str] | None = None

    def __post_init__(self) -> None:
        if checks.is_whole(self.every):
            checks.whole(self.every, "every")
        else:
            checks.positive(self.every, "every")
        if not (self.what is None or callable(self.what)):
            checks.texts((self.what,) if isinstance(self.what, str) else self.what, "what", WHAT)
        fits = self.to is None or callable(self.to) or isinstance(self.to, (str, os.PathLike))
        checks.expect(fits, self.to, "to", TO)
        if isinstance(self.to, (str, os.PathLike)) and self.what is not None:
            raise ArgumentError(
                "An output to a folder holds records: leave out `what`; `system.watching({name: function})` adds a "
                "function of the state to them."
            )

    def steps(self, h: float) -> int:
        """The cadence in steps of h; raises ArgumentError if it is no multiple of h."""
        if checks.is_whole(self.every):
            return int(self.every)
        found = checks.steps(float(self.every), abs(h))
        if found is None:
            uneven = checks.uneven(float(self.every), abs(h))
            raise ArgumentError(f"Argument `every` of an output must be a multiple of dt, but {uneven}.")
        return found


@dataclass(frozen=True)
class Ordered:
    """The outputs that a user ordered: sinks, calls, and how the dataset of each is read, None of a call."""

    sinks: tuple[Scheduled, ...] = ()
    calls: tuple[Call, ...] = ()
    datasets: tuple[Callable[[Result], xarray.Dataset | None], ...] = ()


def ordered(given: object, run: Result, stored: Callable[[Result, object], Result]) -> Ordered:
    """The outputs of a run. stored: a run and a folder → the run that streams there.

    Raises ArgumentError for outputs that the run cannot give.
    """
    if given is None:
        return Ordered()
    given = list(given) if isinstance(given, Iterable) else given
    if not isinstance(given, list) or not all(isinstance(one, Output) for one in given):
        raise ArgumentError(f"Argument `outputs` must be a list of co.Output, but is {shown(given)}.")
    sinks, calls, datasets = list[Scheduled](), list[Call](), list[Callable[[Result], Any]]()
    for one in given:
        every = one.steps(run.plan.h)
        of_run = replace(run, plan=replace(run.plan, save_every=every))
        if callable(one.to):
            if run.members is not None and run.plan.events:
                raise ArgumentError("An output to a function does not go with `until` or `events` of an ensemble.")
            calls.append(Call(every, _values(run, one.what), one.to))
            datasets.append(lambda run: None)
        elif one.to is None:
            sink = InMemory(_values(run, one.what), of_run)
            sinks.append(Scheduled(sink, every))
            datasets.append(sink.dataset)
        else:
            if run.position.steps:
                raise ArgumentError("An output to a folder begins with its run, but this one continues: leave it out.")
            other: Any = stored(of_run, one.to)
            other.memory.attributes = lambda other=other: attributes(replace(other, accuracy=run.accuracy))
            sinks.append(Scheduled(other.memory, every))
            datasets.append(lambda run, other=other: other.dataset)
    return Ordered(tuple(sinks), tuple(calls), tuple(datasets))


def _values(run: Result, what: Any) -> _Records | _Monitors | _Function:
    return _Records(run) if what is None else _Function(run, what) if callable(what) else _Monitors(run, what)


class _Records:
    """The records of the nodes."""

    def __init__(self, run: Result):
        self.system, self.derive, self.members = run.system, derivation(run.plan.program), run.members

    def __call__(self, records: State, monitors: Mapping[str, np.ndarray]) -> State:
        """The records with the velocities at the nodes, with axes (node, [member,] …)."""
        if self.members is None:
            return at_nodes(self.derive, self.system, records)
        leading = np.shape(records.t)
        flat = _flat(records)
        found = at_nodes(self.derive, self.system, flat, members_of(records, 1).ravel())
        return jax.tree.map(lambda leaf: np.reshape(leaf, (*leading, *np.shape(leaf)[1:])), found)


def _flat(records: State) -> State:
    """Records with one leading axis, of nodes or of nodes and members."""
    leading = np.shape(records.t)
    count = int(np.prod(leading))
    return jax.tree.map(lambda leaf: np.reshape(leaf, (count, *np.shape(leaf)[len(leading) :])), records)


class _Monitors:
    """Some monitors of the nodes; raises ArgumentError for names that the run does not observe."""

    def __init__(self, run: Result, what: str | Sequence[str]):
        self.single = isinstance(what, str)
        self.names = (what,) if isinstance(what, str) else tuple(what)
        known = monitor_shapes(run.plan.program, *run.one, "xla") if run.plan.monitors else {}
        for name in self.names:
            if not run.plan.monitors:
                raise ArgumentError("An output of monitors needs them, but `monitors` is False: leave that out.")
            checks.known(name, [one for one in known if one != EVENTS], "monitor", "This run")

    def __call__(self, records: State, monitors: Mapping[str, np.ndarray]) -> PyTree:
        return monitors[self.names[0]] if self.single else {name: monitors[name] for name in self.names}


class _Function:
    """A function of the state at the nodes; raises LagrangianError and ArgumentError if it cannot be read."""

    def __init__(self, run: Result, function: Callable[[State], PyTree]):
        self.records, self.function = _Records(run), function

        def read(state: State) -> Any:
            require_float64(function, "The function `what` of an output", (state,))
            with in_words("The function `what` of an output"):
                return evaluate(function, state)

        read_of(read, "The function `what` of an output", run.one[1])
        self._table: Callable[..., PyTree] | None = None

    def __call__(self, records: State, monitors: Mapping[str, np.ndarray]) -> PyTree:
        nodes = self.records(records, monitors).replace(memory=None, ledger=None, origin=Origin())
        leading, flat = np.shape(nodes.t), _flat(nodes)
        parts, count = [], int(np.prod(leading))
        for first in range(0, count, BATCH):
            rows = jax.tree.map(lambda leaf, first=first: leaf[first : first + BATCH], flat)
            filled = jax.tree.map(lambda leaf: np.resize(leaf, (BATCH, *np.shape(leaf)[1:])), rows)
            if self._table is None:
                self._table = tabulate(jax.vmap(self.function), filled)
            left = min(BATCH, count - first)
            parts.append(jax.tree.map(lambda leaf, left=left: leaf[:left], self._table(filled)))
        return jax.tree.map(lambda *some: np.concatenate(some).reshape(*leading, *some[0].shape[1:]), *parts)


class InMemory(Memory):
    """A sink that keeps what an output takes; records as they are, for the dataset of the run at this cadence."""

    def __init__(self, values: _Records | _Monitors | _Function, run: Result):
        super().__init__()
        self.values, self.run = values, run

    def append(self, steps: np.ndarray, records: State, monitors: Mapping[str, np.ndarray]) -> None:
        if isinstance(self.values, _Records):
            super().append(steps, records, monitors)
            return
        found = self.values(records, monitors)
        held = found if isinstance(found, dict) else {self._name: found}
        super().append(steps, records.replace(**_NOTHING), {str(name): np.asarray(rows) for name, rows in held.items()})

    @property
    def _name(self) -> str:
        return self.values.names[0] if isinstance(self.values, _Monitors) else VALUE

    def dataset(self, run: Result) -> xarray.Dataset:
        """What was taken, over `time`; of an ensemble with a first dimension `member`."""
        import xarray

        mine = replace(self.run, memory=self, position=run.position, accuracy=run.accuracy, warnings=run.warnings)
        if isinstance(self.values, _Records):
            return mine.dataset
        lead = ("time",) if run.members is None else ("member", "time")
        found = {
            name: ((*lead, *(f"{name}_{i}" for i in range(rows.ndim - len(lead)))), rows)
            for name, rows in mine.monitors.items()
        }
        steps = mine.steps_saved
        at = times(run.plan.program, run.start, run.plan.h, steps, mine.records)
        return xarray.Dataset(found, coords={"time": ("time", at), "step": ("time", steps)})


_NOTHING = dict.fromkeys(("g", "n", "a", "mu", "pi", "xi", "nu", "internal", "memory", "ledger"))
"""The fields of records of which a sink keeps nothing but the time."""


class Call:
    """A function that is called with each node at a cadence, and may end the run."""

    def __init__(self, every: int, values: _Records | _Monitors | _Function, function: Callable[[float, Any], object]):
        self.every, self.values, self.function, self.seen = every, values, function, -1

    def __call__(self, step: int, time: float, value: PyTree) -> bool:
        """Whether the function ends the run at this step."""
        self.seen = step
        answer = self.function(time, value)
        return answer is not None and bool(answer)
