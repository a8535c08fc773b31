"""Several currents and a density as one water."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.errors import ArgumentError
from coadjoint.mechanics.members import Each
from coadjoint.spaces import Named
from coadjoint_vehicles.water.density import Density
from coadjoint_vehicles.water.water import Water

RANDOM = ".random"


class Sea(Water):
    """Currents that add up, by names, and a density.

        sea = Sea(tide=TidalCurrent(["M2"], [[0.5, 0.0, 0.0]]), gusts=GaussMarkovCurrent((0.1, 0.1, 0.0), 60.0))

    The `amplitudes` of the current `tide` are `p.water.tide.amplitudes` of the system. density: a Density, by
    default the vehicle's own fluid density. Raises ArgumentError for an invalid current or density.
    """

    def __init__(self, *, density: Density | None = None, **currents: Water):
        if density is not None:
            checks.instance(density, "density", Density, "a Density such as LinearDensity(1025.0)")
        for name, current in currents.items():
            checks.instance(current, f"The current `{name}`", Water, "a Water such as UniformWater(…)")
            if current.stratified:
                raise ArgumentError(f"The current `{name}` has a density, and so has a sea: give it as Sea(density=…).")
        if density is None and not currents:
            raise ArgumentError("A sea needs at least one current or a density; without both it is StillWater().")
        object.__setattr__(self, "own_density", density)
        object.__setattr__(self, "currents", currents)
        _require_different_seeds(self.start())

    own_density: Density | None
    currents: dict[str, Water]

    @property
    def uniform(self) -> bool:  # pyright: ignore[reportIncompatibleVariableOverride]
        return all(current.uniform for current in self.currents.values())

    @property
    def steady(self) -> bool:  # pyright: ignore[reportIncompatibleVariableOverride]
        return all(current.steady for current in self.currents.values())

    @property
    def stratified(self) -> bool:
        return self.own_density is not None

    @property
    def timed(self) -> bool:
        return any(current.timed for current in self.currents.values())

    @property
    def owners(self) -> dict[str, Water | Density]:
        """The owners of its parameters, by name."""
        return {**self.currents, **({} if self.own_density is None else {"density": self.own_density})}

    def parameters(self) -> dict[str, PyTree]:
        return {name: owner.parameters() for name, owner in self.owners.items()}

    def start(self) -> dict[str, PyTree]:
        begun = {name: current.start() for name, current in self.currents.items()}
        return {name: values for name, values in begun.items() if values}

    def seeded(self, seed: Any) -> Sea:
        """Random currents numbered k of K get the seeds K·seed + k, which are different for different seeds."""
        names = list(self.start())
        numbers = seed.values if isinstance(seed, Each) else seed
        seeds = [len(names) * numbers + k for k in range(len(names))]
        own = {name: Each(s) if isinstance(seed, Each) else s for name, s in zip(names, seeds, strict=True)}
        currents = {name: c.seeded(own[name]) if name in own else c for name, c in self.currents.items()}
        return Sea(density=self.own_density, **currents)

    def advance(self, internal: Named, h: Scalar, own: Named) -> dict[str, PyTree]:
        return {
            name: self.currents[name].advance(getattr(internal, name), h, getattr(own, name)) for name in self.start()
        }

    def current(self, position: Array, t: Scalar, internal: PyTree, own: PyTree) -> Array:
        remembering = self.start()
        total = jnp.zeros(3)
        for name, current in self.currents.items():
            memory = getattr(internal, name) if name in remembering else None
            total = total + current.current(position, t, memory, getattr(own, name))
        return total

    def density(self, depth: Array, own: Named) -> Array:
        if self.own_density is None:
            return super().density(depth, own)
        return self.own_density.density(depth, own.density)

    def pressure_head(self, depth: Array, own: Named) -> Array:
        if self.own_density is None:
            return super().pressure_head(depth, own)
        return self.own_density.pressure_head(depth, own.density)

    def __repr__(self) -> str:
        parts = [f"{name}={current!r}" for name, current in self.currents.items()]
        return f"Sea({', '.join(parts + ([] if self.own_density is None else [f'density={self.own_density!r}']))})"


def _require_different_seeds(start: dict[str, PyTree]) -> None:
    """Raise where two random currents begin with the same random numbers: they would go together, not add up."""
    states = {
        name.removesuffix(RANDOM): np.atleast_2d(leaf.values if isinstance(leaf, Each) else leaf)
        for name, leaf in _leaves(start)
        if name.endswith(RANDOM)
    }
    for (one, rows), (other, others) in combinations(states.items(), 2):
        if 1 not in (len(rows), len(others)) and len(rows) != len(others):
            raise ArgumentError(f"The random currents `{one}` and `{other}` must have seeds for equally many members.")
        if np.any(np.all(rows == others, axis=1)):
            raise ArgumentError(
                f"The random currents `{one}` and `{other}` have the same seed, and would change together: give each "
                "another one."
            )


def _leaves(tree: PyTree, name: str = "") -> list[tuple[str, PyTree]]:
    """Everything in nested dictionaries, by names such as `gusts.random`."""
    if not isinstance(tree, dict):
        return [(name, tree)]
    return [leaf for key, part in tree.items() for leaf in _leaves(part, f"{name}.{key}" if name else key)]
