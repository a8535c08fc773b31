"""The sections of a run file: dataclasses that are file, command line and Python."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from coadjoint import checks
from coadjoint.checks import positive, whole
from coadjoint.errors import ArgumentError
from coadjoint.sections import key
from coadjoint.units import TIME


@dataclass(frozen=True)
class SystemSection:
    """What moves: `model`, a name of the catalogue, or `factory`, "file.py:function" in the folder of the run file."""

    model: str = key("name of a model of the catalogue", default="")
    factory: str = key('function of a Python file next to the run file, "file.py:function"', default="")

    def __post_init__(self):
        if bool(self.model) == bool(self.factory):
            raise ArgumentError(
                'Section [system] needs either `model`, a name of the catalogue, or `factory`, "file.py:function".'
            )
        checks.expect(
            not self.factory or (self.factory.count(":") == 1 and all(self.factory.split(":"))),
            self.factory,
            "[system] factory",
            '"file.py:function"',
        )


@dataclass(frozen=True)
class MethodSection:
    """How it is integrated: a rule and its difference map, and what only some rules take."""

    name: str = key("rule", default="Midpoint")
    map: str = key("difference map", default="Cayley")
    base: str = key("rule of the substeps of a composition, or of VariableStep", default="")
    coefficients: tuple[float, ...] | None = key("lengths of the substeps of Composition, of h", default=None)
    negative_substeps: str = key(
        "whether substeps of a composition may go backwards where forces dissipate",
        words=("", "refuse", "allow"),
        default="",
    )
    degree: int | None = key("degree of the polynomials of Galerkin", default=None)
    points: int | None = key("quadrature points of EnergyMomentum", default=None)
    within: tuple[float, ...] | None = key("bounds on the steps of VariableStep, of h", default=None)
    start: str = key(
        "whether the first step starts from momenta or from velocities",
        words=("momentum", "velocity"),
        default="momentum",
    )


@dataclass(frozen=True)
class RunSection:
    """The grid: dt in s, and either `duration` in s or `steps`; every save_every-th node is kept."""

    dt: float = key("the length of a step", TIME, check=positive)
    duration: float | None = key("simulated time", TIME, check=positive, default=None)
    steps: int | None = key("number of steps, instead of `duration`", check=whole, default=None)
    save_every: int = key("steps from one saved node to the next", check=whole, default=1)

    def __post_init__(self):
        if self.duration is not None and self.steps is not None:
            raise ArgumentError("Section [run] gives both `duration` and `steps`: leave one out.")
        if self.duration is None and self.steps is None:
            raise ArgumentError("Section [run] needs `duration` in s, or `steps`.")
        if self.duration is not None:
            self._require_whole(self.duration)

    def _require_whole(self, duration: float) -> None:
        if checks.steps(duration, self.dt) is None:
            raise ArgumentError(
                f"[run] duration must be a whole number of steps, but {checks.uneven(duration, self.dt)}; write "
                f"{max(round(duration / self.dt), 1) * self.dt:.12g}."
            )

    @property
    def count(self) -> int:
        """The number of steps, of at least one."""
        return self.steps or max(round((self.duration or 0.0) / self.dt), 1)


def folder_within(value: str, name: str) -> str:
    """A folder in the working directory; raises ArgumentError."""
    if Path(value).is_absolute() or ".." in Path(value).parts:
        raise ArgumentError(f"{name} must lie in the working directory, but is {value!r}: name another one by --out.")
    return value


@dataclass(frozen=True)
class OutputSection:
    """Where results go: `folder`, by default named like the run file; `figures`, all (true), none, or a list."""

    folder: str = key("folder of the results; by default named like the file", check=folder_within, default="")
    figures: bool | list[str] = key("figures: all, none, or a list of names", default=True)
    format: str = key("format of the figures", words=("png", "pdf", "svg"), default="png")
    ALWAYS: ClassVar[tuple[str, ...]] = ()

    @property
    def asked(self) -> list[str]:
        """The figures that are asked for by name and that a run may have nothing to draw for."""
        return [name for name in self.figures if name not in self.ALWAYS] if isinstance(self.figures, list) else []

    def __post_init__(self):
        from coadjoint.plotting.plots import figure_names

        asked = self.figures if isinstance(self.figures, list) else []
        checks.all_known(asked, figure_names(), "figure", "[output] figures")
