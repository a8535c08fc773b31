"""Inputs that drive a system: signals, taken at every node, and functions of the motion, held over a step."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from coadjoint.arrays import PyTree, Scalar
from coadjoint.checks import float64, numeric
from coadjoint.errors import ArgumentError, shown
from coadjoint.mechanics.signals import Held, Signal, jumps
from coadjoint.mechanics.state import NodeMotion
from coadjoint.spaces.named import Named, named


@dataclass(frozen=True)
class Command:
    """An input that is set before each step, by `co.Stepper`, and held over it: a number or an array of this shape."""

    shape: tuple[int, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Between(Command):
    """An input u(t) = function(t, c) within a step, with numbers c that are set before it."""

    function: Callable[[PyTree, PyTree], PyTree]


Source = Signal | Callable[[NodeMotion], Any] | float | np.ndarray
Given = Source | Mapping[str, Source]


@dataclass(frozen=True)
class Inputs:
    """The inputs of a run under names, or a single one without a name."""

    names: tuple[str, ...] | None
    sources: tuple[PyTree, ...]

    @property
    def holds(self) -> bool:
        """Whether some are functions of the motion, held over each step."""
        return not all(isinstance(source, Signal) for source in self.sources)

    @property
    def constant(self) -> bool:
        """Whether all are numbers that stay."""
        return all(isinstance(source, Held) and len(source.times) == 1 for source in self.sources)

    @property
    def jump(self) -> bool:
        """Whether some are tables of held values that differ."""
        return any(jumps(source) for source in self.sources)

    @property
    def follow(self) -> bool:
        """Whether some are functions of the motion."""
        return not all(isinstance(source, (Signal, Command)) for source in self.sources)

    def held(self, motion: NodeMotion, before: PyTree = None) -> PyTree:
        """The inputs held over the step that starts with this motion; None where all are signals.

        Commands are taken from `before`, the inputs held until then.
        """
        if not self.holds:
            return None
        if self.names is None:
            source = self.sources[0]
            return before if isinstance(source, Command) else named(source(motion))
        pairs = zip(self.names, self.sources, strict=True)
        held = {name: source for name, source in pairs if not isinstance(source, Signal)}
        return Named(**{n: getattr(before, n) if isinstance(s, Command) else named(s(motion)) for n, s in held.items()})

    def at(self, t: Scalar, held: PyTree, tables: Scalar | None = None) -> PyTree:
        """The inputs that ℓ and forces read at time t, s, of a step over which `held` is held.

        tables: the time, s, at which tables that jump are read instead; by default t.
        """
        times = [t if tables is None or not jumps(source) else tables for source in self.sources]
        if self.names is None:
            return self.sources[0](times[0]) if isinstance(self.sources[0], Signal) else held
        rows = zip(self.names, self.sources, times, strict=True)
        given = {} if held is None else held.asdict()
        return Named(**{name: _now(source, time, given.get(name)) for name, source, time in rows})


def _now(source: object, t: Scalar, held: PyTree) -> PyTree:
    """One input at time t of a step over which `held` is held; None where that is not known yet."""
    if isinstance(source, Signal):
        return source(t)
    return source.function(t, held) if isinstance(source, Between) and held is not None else held


def inputs_from(given: object) -> Inputs | None:
    """The argument `inputs` of a run; raises ArgumentError unless each input is a signal, a number or a function."""
    if given is None or isinstance(given, Inputs):
        return given
    sources = dict(given) if isinstance(given, Mapping) else {"": given}
    if not sources:
        raise ArgumentError("The dictionary `inputs` is empty: leave it out, or name at least one input.")
    if not all(isinstance(name, str) for name in sources):
        raise ArgumentError(f"The names in `inputs` must be texts, but are {', '.join(map(repr, sources))}.")
    found = tuple(_source(name, source) for name, source in sources.items())
    return Inputs(tuple(sources) if isinstance(given, Mapping) else None, found)


def _source(name: str, given: object) -> Signal | Command | Callable[[NodeMotion], PyTree]:
    """A signal or a function of the motion; a number or an array stands for itself at all times."""
    if callable(given) or isinstance(given, Command):
        return given
    where = f"Argument `inputs` under {shown(name)}" if name else "Argument `inputs`"
    if numeric(given):
        return Held([0.0], [float64(given, where)])
    raise ArgumentError(
        f"{where} must be a signal such as co.Linear(times, values), a constant number or array, or "
        f"a function of the motion, held over each step, but is {shown(given)}."
    )
