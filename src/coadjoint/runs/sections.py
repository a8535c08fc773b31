"""The sections of a run file: dataclasses that are file, command line and Python at once."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from pathlib import Path
from types import UnionType
from typing import Any, ClassVar, Union, get_args, get_origin, get_type_hints

from coadjoint.errors import ArgumentError
from coadjoint.runs.units import in_si
from coadjoint.units import TIME


@dataclass(frozen=True)
class SystemSection:
    """What moves: `model`, a name of the catalogue, or `factory`, "file.py:function" in the folder of the run file."""

    model: str = ""
    factory: str = ""

    def __post_init__(self):
        if bool(self.model) == bool(self.factory):
            raise ArgumentError(
                'Section [system] needs either `model`, a name of the catalogue, or `factory`, "file.py:function".'
            )
        if self.factory and (self.factory.count(":") != 1 or not all(self.factory.split(":"))):
            raise ArgumentError(f'[system] factory must be "file.py:function", but is {self.factory!r}.')


@dataclass(frozen=True)
class MethodSection:
    """How it is integrated: the rule, its difference map, the base of a composition, its coefficients and whether its
    substeps may go backwards where forces dissipate, the degree of Galerkin's polynomials, the points of
    EnergyMomentum, the bounds of VariableStep, and the start."""

    name: str = "Midpoint"
    map: str = "Cayley"
    base: str = ""
    coefficients: tuple[float, ...] | None = None
    negative_substeps: str = ""
    degree: int | None = None
    points: int | None = None
    within: tuple[float, ...] | None = None
    start: str = "momentum"

    def __post_init__(self):
        if self.start not in ("momentum", "velocity"):
            raise ArgumentError(f'[method] start must be "momentum" or "velocity", but is {self.start!r}.')
        if self.negative_substeps not in ("", "refuse", "allow"):
            raise ArgumentError(
                f'[method] negative_substeps must be "refuse" or "allow", but is {self.negative_substeps!r}.'
            )


@dataclass(frozen=True)
class RunSection:
    """The grid: dt in s, and either `duration` in s or `steps`; every save_every-th node is kept."""

    dt: float = field(default=-math.inf, metadata={"dimension": TIME})
    duration: float | None = field(default=None, metadata={"dimension": TIME})
    steps: int | None = None
    save_every: int = 1

    def __post_init__(self):
        if self.dt == -math.inf:
            raise ArgumentError("Section [run] needs `dt`, the length of a step in s.")
        if not 0 < self.dt < math.inf:
            raise ArgumentError(f"[run] dt must be positive, but is {self.dt:g}.")
        if self.duration is not None and self.steps is not None:
            raise ArgumentError("Section [run] gives both `duration` and `steps`: leave one out.")
        if self.duration is None and self.steps is None:
            raise ArgumentError("Section [run] needs `duration` in s, or `steps`.")
        if self.steps is not None and self.steps < 1:
            raise ArgumentError(f"[run] steps must be at least 1, but is {self.steps}.")
        if self.save_every < 1:
            raise ArgumentError(f"[run] save_every must be at least 1, but is {self.save_every}.")
        if self.duration is not None:
            self._require_whole(self.duration)

    def _require_whole(self, duration: float) -> None:
        if not 0 < duration < math.inf:
            raise ArgumentError(f"[run] duration must be positive, but is {duration:g}.")
        count = max(round(duration / self.dt), 1)
        if abs(count * self.dt - duration) > 1e-9 * duration:
            raise ArgumentError(
                f"[run] duration must be a whole number of steps, but {duration:g} s is {duration / self.dt:.6g} steps "
                f"of {self.dt:g} s; write {count * self.dt:.10g}."
            )


@dataclass(frozen=True)
class OutputSection:
    """Where results go: `folder`, by default named like the run file; `figures`, all (true), none, or a list."""

    folder: str = ""
    figures: bool | list[str] = True
    format: str = "png"
    ALWAYS: ClassVar[tuple[str, ...]] = ()

    @property
    def asked(self) -> list[str]:
        """The figures that are asked for by name and that a run may have nothing to draw for."""
        return [name for name in self.figures if name not in self.ALWAYS] if isinstance(self.figures, list) else []

    def __post_init__(self):
        from coadjoint.plotting.plots import figure_names

        if Path(self.folder).is_absolute() or ".." in Path(self.folder).parts:
            raise ArgumentError(
                f"[output] folder must lie in the working directory, but is {self.folder!r}: name another one by --out."
            )
        known = figure_names()
        wrong = [name for name in (self.figures if isinstance(self.figures, list) else []) if name not in known]
        if wrong:
            raise ArgumentError(f"[output] figures has no figure `{wrong[0]}`: there are {', '.join(known)}.")
        if self.format not in ("png", "pdf", "svg"):
            raise ArgumentError(f'[output] format must be "png", "pdf" or "svg", but is {self.format!r}.')


def section(kind: type, title: str, given: Any) -> Any:
    """The dataclass `kind` filled from a table of a run file; raises ArgumentError for what does not fit."""
    if not isinstance(given, dict):
        raise ArgumentError(f"[{title}] must be a section of a run file, but is {given!r}.")
    kinds = {f.name: f.metadata["dimension"] for f in fields(kind) if "dimension" in f.metadata}
    values = in_si(title, given, [f.name for f in fields(kind)], kinds)
    types = get_type_hints(kind)
    return kind(**{name: _typed(f"[{title}] {name}", value, types[name]) for name, value in values.items()})


_WORDS = {
    float: "a number",
    int: "a whole number",
    str: "a text",
    bool: "true or false",
    list: "a list of texts",
    tuple: "a list of numbers",
}


def _typed(what: str, value: Any, expected: Any) -> Any:
    """`value` as one of the expected types; a whole number counts as a number, true and false do not."""
    choices = [c for c in _choices(expected) if c is not type(None)]
    for choice in choices:
        plain = get_origin(choice) or choice
        if plain is float and isinstance(value, (int, float)) and not isinstance(value, bool):
            return float(value)
        if plain is int and isinstance(value, float) and value.is_integer():
            return int(value)
        if plain is tuple and isinstance(value, list) and all(type(inner) in (int, float) for inner in value):
            return tuple(float(inner) for inner in value)
        if plain is list and isinstance(value, list) and all(isinstance(inner, str) for inner in value):
            return value
        if plain in (int, str, bool) and isinstance(value, plain) and isinstance(value, bool) == (plain is bool):
            return value
    words = " or ".join(_WORDS[get_origin(choice) or choice] for choice in choices)
    raise ArgumentError(f"{what} must be {words}, but is {value!r}.")


def _choices(expected: Any) -> tuple[Any, ...]:
    return get_args(expected) if get_origin(expected) in (Union, UnionType) else (expected,)
