"""What drives a system from outside: signals, taken at every node, and functions of the motion, held over a step."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from coadjoint.errors import ArgumentError
from coadjoint.mechanics.signals import Signal
from coadjoint.mechanics.state import Motion
from coadjoint.spaces.named import Named, named

Given = Signal | Callable[[Motion], Any] | Mapping[str, Signal | Callable[[Motion], Any]]


@dataclass(frozen=True)
class Inputs:
    """The inputs of a run under names, or a single one without a name."""

    names: tuple[str, ...] | None
    sources: tuple[Any, ...]

    @property
    def holds(self) -> bool:
        """Whether some are functions of the motion, held over each step."""
        return not all(isinstance(source, Signal) for source in self.sources)

    def held(self, motion: Motion) -> Any:
        """What is held over the step that starts with this motion; None where all are signals."""
        if not self.holds:
            return None
        if self.names is None:
            return named(self.sources[0](motion))
        pairs = zip(self.names, self.sources, strict=True)
        return Named(**{name: named(source(motion)) for name, source in pairs if not isinstance(source, Signal)})

    def at(self, t: Any, held: Any) -> Any:
        """What ℓ and forces see at time t of a step over which `held` is held."""
        if self.names is None:
            return self.sources[0](t) if isinstance(self.sources[0], Signal) else held
        pairs = zip(self.names, self.sources, strict=True)
        given = {} if held is None else held.asdict()
        return Named(**{name: source(t) if isinstance(source, Signal) else given.get(name) for name, source in pairs})


def inputs_from(given: Any) -> Inputs | None:
    """The argument `inputs` of a run; raises ArgumentError for what is neither a signal nor a function."""
    if given is None or isinstance(given, Inputs):
        return given
    sources = dict(given) if isinstance(given, Mapping) else {"": given}
    for name, source in sources.items():
        if not callable(source) or not isinstance(name, str):
            where = f"Argument `inputs` under {name!r}" if isinstance(given, Mapping) else "Argument `inputs`"
            raise ArgumentError(
                f"{where} must be a function of the motion, held over each step, or a signal such as "
                f"co.Linear(times, values), but is {source!r}."
            )
    if not sources:
        raise ArgumentError("The dictionary `inputs` is empty: leave it out, or name at least one input.")
    return Inputs(tuple(sources) if isinstance(given, Mapping) else None, tuple(sources.values()))
