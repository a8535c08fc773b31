"""Faults: an actuator that sticks from a time, or from an event, on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, PyTree
from coadjoint.errors import ArgumentError
from coadjoint.extending import named
from coadjoint.mechanics import Course, NodeMotion, jumped
from coadjoint.models.quantities import number
from coadjoint.spaces import Named
from coadjoint_vehicles.parts.part import Part

BARELY = 1e-9
"""s by which a node may lie before the time of a fault, by rounding."""


@dataclass(frozen=True, eq=False)
class Fault:
    """An actuator stays at a value, whatever its command, from the first node of the fault on.

        Fault("rudder", value=0.2, time=30.0)                                    # a fin that is stuck
        Fault("thrusters", value=0.0, which=(2,), time=30.0)                     # one thruster that is out
        Fault("payload", value=1.0, when=lambda motion, p: motion.q[2] - 20.0)   # dropped at 20 m

    part: the name of an actuator. value: in the unit of its command; None: its value at that node. A part
    whose state is more than its command, as a moving mass or a payload, gets `value` as its command. which: of
    thrusters, by their indices from 0; all unless given. time: t, s, or when: (motion, p) → a number, ≥ 0 from the
    event on; motion has q, xi, nu and t of the node. A fault is permanent. Software on board does not know of it.
    Raises ArgumentError for neither or both of time and when, and for a name that is not a word.
    """

    part: str
    value: Any = None
    which: tuple[int, ...] | None = None
    time: float | None = None
    when: Callable[[NodeMotion, PyTree], PyTree] | None = None
    name: str = ""

    def __post_init__(self) -> None:
        if (self.time is None) == (self.when is None):
            raise ArgumentError(f"A fault of `{self.part}` needs either a time or `when`, an event.")
        if self.when is not None:
            checks.function(self.when, "Argument `when` of a fault", "a function (motion, p)")
        if self.time is not None:
            object.__setattr__(self, "time", float(number(self.time, "time` of a fault of `" + self.part)))
        name = self.name or self.part
        fits = isinstance(name, str) and name.isidentifier()
        checks.expect(fits, name, "The name of a fault", "a word such as 'rudder'")
        object.__setattr__(self, "name", name)

    def fits(self, part: Part) -> None:
        """Raise ArgumentError if a part cannot have this fault."""
        shape = () if part.command is None else part.command.shape
        count = shape[0] if shape else 1
        if self.which is not None and (not shape or not all(0 <= i < count for i in self.which)):
            raise ArgumentError(
                f"`which` of the fault `{self.name}` must be from 0 to {count - 1}, but is {self.which}."
            )
        if self.value is None:
            if part.units is not None:
                raise ArgumentError(f"The fault `{self.name}` of the {part.title}` needs a value.")
            return
        value = np.asarray(self.value, dtype=float)
        fits = value.shape in ((), shape) and np.all(np.isfinite(value))
        checks.expect(fits, self.value, f"`value` of the fault `{self.name}`", "a number")
        ends = None if part.command is None else part.travel(named(part.parameters()))
        if ends is not None and (np.any(value < ends[0] - 1e-12) or np.any(value > ends[1] + 1e-12)):
            raise ArgumentError(
                f"`value` of the fault `{self.name}` must be from {np.max(ends[0]):g} to {np.min(ends[1]):g}, the "
                f"range of the {part.title}`, but is {self.value}."
            )

    def there(self, motion: NodeMotion, p: Named) -> Array:
        """1.0 at a node where it is there, else 0.0."""
        if self.when is not None:
            return jnp.where(jnp.asarray(self.when(motion, p)) >= 0, 1.0, 0.0)
        assert self.time is not None
        return jnp.where(motion.t >= self.time - BARELY, 1.0, 0.0)

    def command(self, command: PyTree, there: Array) -> PyTree:
        """The command of a part whose state is more than its command."""
        return jnp.where(there > 0.5, self.value, command)

    def stands(self, course: PyTree, now: PyTree, there: Array) -> Course:
        """The course of a part over a step: its faulty elements stay at `value`."""
        found = course if isinstance(course, Course) else Course(course)
        begin = now if found.begin is None else found.begin
        mean = 0.5 * (begin + found.end) if found.mean is None else found.mean
        value = jnp.asarray(now if self.value is None else self.value)
        of = there > 0.5
        if self.which is not None:
            of = of & jnp.asarray(np.isin(np.arange(np.shape(now)[0]), self.which))
        return Course(*(jnp.where(of, value, part) for part in (found.end, mean, begin)))


def latched(faults: tuple[Fault, ...], motion: NodeMotion, p: Named) -> dict[str, Array]:
    """1.0 of each fault that is there or was before."""
    held = motion.internal.faults
    return {fault.name: jnp.maximum(getattr(held, fault.name), fault.there(motion, p)) for fault in faults}


def remembered(there: dict[str, Array]) -> dict[str, Course]:
    """The faults' part of the internal state after a node."""
    return {name: jumped(value) for name, value in there.items()}


def require_faults(faults: Any, parts: dict[str, Part]) -> tuple[Fault, ...]:
    """The faults of a craft; raises ArgumentError for impossible ones."""
    found = (faults,) if isinstance(faults, Fault) else tuple(faults)
    seen: set[str] = set()
    for fault in found:
        checks.instance(fault, "Each of `faults`", Fault, "a fault such as Fault('rudder', time=30.0)")
        checks.known(fault.part, parts, "actuator", f"The fault `{fault.name}`: the vehicle")
        if fault.name in seen:
            raise ArgumentError(f"Two faults are named `{fault.name}`: give each its own name.")
        seen.add(fault.name)
        fault.fits(parts[fault.part])
    return found
