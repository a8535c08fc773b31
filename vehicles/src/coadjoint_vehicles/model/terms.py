"""The terms of a craft in its system: ℓ and the forces of its parts, as objects that can be pickled and copied."""

from __future__ import annotations

import inspect
from dataclasses import dataclass

import numpy as np

from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.mechanics import Force, Motion
from coadjoint.spaces import Named
from coadjoint_vehicles.model import energies
from coadjoint_vehicles.model.actuators import Rule
from coadjoint_vehicles.model.energies import Surroundings, actual_of
from coadjoint_vehicles.parts.part import Part
from coadjoint_vehicles.water.water import UniformWater, Water


@dataclass(frozen=True, eq=False)
class Lagrangian:
    """ℓ(ξ, n, ν, a, p), with the keywords `t` and `internal` only where they enter."""

    water: Water
    parts: tuple[Part, ...]

    def __call__(
        self, xi: Array, n: Array, nu: Array, a: PyTree, p: PyTree, *, t: Scalar = 0.0, internal: PyTree = None
    ) -> Array:
        return energies.lagrangian(self.water, self.parts, xi, n, nu, a, p, t, internal)

    @property
    def __signature__(self) -> inspect.Signature:
        entering = {
            "t": self.water.timed,
            "internal": bool(self.water.start()) or any(part.holds_mass for part in self.parts),
        }
        known = inspect.signature(self.__call__).parameters
        return inspect.Signature([value for name, value in known.items() if entering.get(name, True)])


@dataclass(frozen=True, eq=False)
class Push:
    """The force of a part in its water. rule: that of a craft without internal state, which inputs are checked by."""

    part: Part
    water: Water
    rule: Rule | None

    def __call__(self, motion: Motion, p: PyTree) -> Force:
        if self.rule is not None:
            self.rule.inputs(motion)  # pyright: ignore[reportArgumentType]
        around = Surroundings(self.water, motion.n, motion.a, motion.t, motion.internal, p)
        flow = around.flow(motion.xi, motion.nu)
        return self.part.force(flow, actual_of(self.part, motion.internal), getattr(p, self.part.name))


@dataclass(frozen=True, eq=False)
class PassivePush(Push):
    """That of a part that only takes energy from the vehicle, which it does in uniform, still water."""

    def passive(self, p: Named) -> bool:
        """Whether it does."""
        return not np.any(p.water.velocity)


@dataclass(frozen=True, eq=False)
class Shear:
    """The additional force in water with a velocity gradient."""

    water: Water
    parts: tuple[Part, ...]

    def __call__(self, motion: Motion, p: PyTree) -> Force:
        return energies.shear(self.water, self.parts, motion, p)


def push(part: Part, water: Water, rule: Rule | None) -> Push:
    """The force of a part."""
    return (PassivePush if part.passive and isinstance(water, UniformWater) else Push)(part, water, rule)
