"""The section [faults] of a mission: actuators that stick from a time, or a depth, on; payloads that are dropped."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from coadjoint import checks
from coadjoint.checks import is_whole, known, number
from coadjoint.errors import ArgumentError
from coadjoint.sections import key, read
from coadjoint.units import LENGTH, TIME, same, split_name
from coadjoint_vehicles.logs.headers import inside
from coadjoint_vehicles.parts.part import Part

if TYPE_CHECKING:
    from coadjoint.labelled import AnyDataset
    from coadjoint_vehicles.model.faults import Fault

ACTIONS = ("stuck", "out", "dropped")


def require_one_begin(of: FaultSection | Any, title: str) -> None:
    """Raise ArgumentError unless a fault begins at a time or at a depth."""
    if (of.time is None) == (of.depth is None):
        raise ArgumentError(f"[{title}] needs one of `time_s` and `depth_m`, from which on it is there.")


@dataclass(frozen=True)
class FaultSection:
    """A fault of an actuator, in a table [faults.NAME]; `said`: its keys as in the file."""

    name: str
    said: str
    part: str = key("actuator", default="")
    out: Any = key("whether it stands at its neutral command; of thrusters a number or a list, from 1", default=None)
    dropped: Any = key("whether a payload is let go", default=None)
    time: float | None = key("when it begins", TIME, check=number, default=None)
    depth: float | None = key("depth at which it begins", LENGTH, check=number, default=None)
    given: Mapping[str, Any] = key("`stuck`: its position, in the unit of its command", rest=True, factory=dict)

    def __post_init__(self) -> None:
        for name_in_file in self.given:
            if split_name(name_in_file)[0] != "stuck":
                known(name_in_file, ("part", *ACTIONS, "time", "depth"), "key", f"Section [{self.title}]")
        actions = ["stuck"] * bool(self.given) + [name for name in ACTIONS[1:] if getattr(self, name) is not None]
        if len(actions) != 1 or len(self.given) > 1:
            found = ", ".join([*self.given, *actions[bool(self.given) :]]) or "none"
            raise ArgumentError(f"[{self.title}] needs one of `stuck`, `out` and `dropped`, but has {found}.")
        require_one_begin(self, self.title)

    @property
    def title(self) -> str:
        """The section."""
        return f"faults.{self.name}"

    def fault(self, vehicle: Any) -> Fault:
        """The fault of a vehicle; raises ArgumentError for one that it cannot have."""
        from coadjoint_vehicles.model.faults import Fault

        there = [one.name for one in vehicle.commanded]
        known(self.part, there, "actuator", f"[{self.title}] part: the vehicle")
        value, which = self._stands(vehicle.part(self.part))
        if self.time is not None:
            return Fault(self.part, value, which, time=self.time, name=self.name)
        depth = self.depth
        return Fault(self.part, value, which, when=lambda motion, p: motion.q[2] - depth, name=self.name)

    def _stands(self, part: Part) -> tuple[Any, Any]:
        """(the value of the faulty part, which of its thrusters)."""
        if self.given:
            return self._stuck(part), None
        if self.dropped is not None:
            if self.dropped is not True or part.kind != "payload":
                raise ArgumentError(
                    f"[{self.title}] dropped = true is of a payload, but {part.name} is of the kind {part.kind}."
                )
            return 1.0, None
        rest = 0.0 if part.command is None else part.command.start
        if self.out is True:
            return rest, None
        numbers = self.out if isinstance(self.out, list) else [self.out]
        count = part.command.shape[0] if part.command is not None and part.command.shape else np.inf
        fits = all(is_whole(one) and 1 <= one <= count for one in numbers)
        most = f" to {count}" if np.isfinite(count) else ""
        checks.expect(fits, self.out, f"[{self.title}] out", f"true, or the numbers of thrusters from 1{most}")
        return rest, tuple(one - 1 for one in numbers)

    def _stuck(self, part: Any) -> float | None:
        ((name_in_file, value),) = self.given.items()
        unit = split_name(name_in_file)[1]
        if value is True:
            return None
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise ArgumentError(f"[{self.title}] stuck must be a number, or true: where it is then; not {value!r}.")
        if not unit:
            return float(value)
        si, factor = inside(unit)
        if not same(si, part.command.unit):
            raise ArgumentError(
                f"[{self.title}] {name_in_file} is in {si}, but {part.name} stands in {part.command.unit}: give it in "
                "a unit of that."
            )
        return float(value) * factor

    def sentence(self, dataset: AnyDataset) -> str | None:
        """From when on it was there, for the certificate; saved nodes only."""
        found = dataset.get(f"internal_faults_{self.name}")
        if found is None:
            return None
        what = f"The fault `{self.name}` of {self.part} ({self.said})"
        there = np.asarray(found.values) > 0.5
        times = np.asarray(dataset["time"].values)[np.argmax(there, axis=-1)]
        if not np.any(there):
            return f"{what} did not come."
        if there.ndim > 1:
            return f"{what} came to {int(there.any(-1).sum())} members."
        return f"From t = {float(times):.6g} s on, fault `{self.name}` of {self.part}: {self.said}."


def read_fault(name: str, given: object) -> FaultSection:
    """The fault of a table [faults.NAME]; raises ArgumentError."""
    if not isinstance(given, dict):
        raise ArgumentError(f'[faults] holds tables, as in [faults.{name}] with part = "rudder", but is {given!r}.')
    said = ", ".join(f"{one} = {value!r}" for one, value in given.items() if one != "part")
    return read(FaultSection, f"faults.{name}", given, name=name, said=said)
