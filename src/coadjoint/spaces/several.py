"""Several spaces side by side, each with its own action and name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, PyTree
from coadjoint.errors import ArgumentError, shown
from coadjoint.groups import LieGroup
from coadjoint.groups.group import Element
from coadjoint.spaces.named import Named, require_names
from coadjoint.spaces.space import Space


@dataclass(frozen=True, init=False)
class Several(Space):
    """A product of named spaces: the user's functions see `a.down`, `a.current`; arrays hold the factors end to end.

    spaces: a dictionary of names and spaces, one at least, such as dict(down=co.Defining()); `additional` and
    `advected` of co.System take such a dictionary, too. Raises ArgumentError for another one.
    """

    names: tuple[str, ...]
    factors: tuple[Space, ...]

    def __init__(self, spaces: Mapping[str, Space]):
        checks.instance(spaces, "spaces", Mapping, "a dictionary of spaces, as in dict(down=co.Defining())")
        if not spaces:
            raise ArgumentError("A dictionary of spaces must hold at least one space, but is empty.")
        for name, space in spaces.items():
            if not isinstance(space, Space) or not str(name).isidentifier():
                raise ArgumentError(
                    f"A dictionary of spaces must map names to spaces, as in dict(down=co.Defining()), "
                    f"but has {shown(name)}: {shown(space)}."
                )
        require_names(spaces)
        object.__setattr__(self, "names", tuple(spaces))
        object.__setattr__(self, "factors", tuple(spaces.values()))

    @property
    def flat(self) -> bool:  # type: ignore[override]
        return all(space.flat for space in self.factors)

    @property
    def affine(self) -> bool:  # type: ignore[override]
        return all(space.affine for space in self.factors)

    @property
    def at_start(self) -> bool:  # type: ignore[override]
        return all(space.at_start for space in self.factors)

    def _split(self, group: LieGroup, *arrays: Array, inner: bool = False) -> list[tuple[PyTree, ...]]:
        """Each factor with its parts of the arrays; the first array in frame coordinates where `inner`."""
        ambient = [0, *np.cumsum([s.ambient(group) for s in self.factors])]
        frames = [0, *np.cumsum([s.dim(group) for s in self.factors])]
        ranges = [pairwise(frames if inner and i == 0 else ambient) for i in range(len(arrays))]
        parts = [[array[a:b] for a, b in spans] for array, spans in zip(arrays, ranges, strict=True)]
        return list(zip(self.factors, *parts, strict=True))

    def require_fit(self, group: LieGroup) -> None:
        for space in self.factors:
            space.require_fit(group)

    def ambient(self, group: LieGroup) -> int:
        return sum(space.ambient(group) for space in self.factors)

    def dim(self, group: LieGroup) -> int:
        return sum(space.dim(group) for space in self.factors)

    def act(self, group: LieGroup, g: Element, x: Array) -> Array:
        return jnp.concatenate([s.act(group, g, part) for s, part in self._split(group, x)])

    def push(self, group: LieGroup, g: Element, x: Array, v: Array) -> Array:
        return jnp.concatenate([s.push(group, g, *parts) for s, *parts in self._split(group, x, v)])

    def pull(self, group: LieGroup, g: Element, x: Array, b: Array) -> Array:
        return jnp.concatenate([s.pull(group, g, *parts) for s, *parts in self._split(group, x, b)])

    def infinitesimal(self, group: LieGroup, xi: Array, x: Array) -> Array:
        return jnp.concatenate([s.infinitesimal(group, xi, part) for s, part in self._split(group, x)])

    def lifted(self, group: LieGroup, xi: Array, x: Array, v: Array) -> Array:
        return jnp.concatenate([s.lifted(group, xi, *parts) for s, *parts in self._split(group, x, v)])

    def diamond(self, group: LieGroup, b: Array, x: Array) -> Array:
        return sum((s.diamond(group, *parts) for s, *parts in self._split(group, b, x)), jnp.zeros(group.dim))

    def lifted_diamond(self, group: LieGroup, b: Array, x: Array, v: Array) -> Array:
        split = self._split(group, b, x, v)
        return sum((s.lifted_diamond(group, *parts) for s, *parts in split), jnp.zeros(group.dim))

    def tangent(self, group: LieGroup, x: Array, y: Array) -> Array:
        split = self._split(group, y, x, inner=True)
        return jnp.concatenate([s.tangent(group, point, inner) for s, inner, point in split])

    def coordinates(self, group: LieGroup, x: Array, b: Array) -> Array:
        return jnp.concatenate([s.coordinates(group, *parts) for s, *parts in self._split(group, x, b)])

    def difference(self, group: LieGroup, x: Array, u: Array) -> Array:
        return jnp.concatenate([s.difference(group, *parts) for s, *parts in self._split(group, x, u)])

    def project(self, group: LieGroup, x: Array, b: Array) -> Array:
        return jnp.concatenate([s.project(group, *parts) for s, *parts in self._split(group, x, b)])

    def momentum(self, group: LieGroup, x: Array, transported: Array, legendre: Array) -> Array:
        split = self._split(group, x, transported, legendre)
        return jnp.concatenate([s.momentum(group, *parts) for s, *parts in split])

    def defect(self, group: LieGroup, x: Array) -> Array | float:
        defects = [jnp.asarray(s.defect(group, part)) for s, part in self._split(group, x)]
        return jnp.max(jnp.stack(defects))

    def sample(self, group: LieGroup, random: np.random.Generator) -> np.ndarray:
        return np.concatenate([space.sample(group, random) for space in self.factors])

    def view(self, group: LieGroup, x: Array) -> Named:
        parts = self._split(group, x)
        return Named(**{name: s.view(group, part) for name, (s, part) in zip(self.names, parts, strict=True)})

    def point(self, group: LieGroup, value: object, name: str) -> Array:
        return self._joined("point", group, value, name)

    def given(self, group: LieGroup, x: Array) -> dict[str, PyTree]:
        found, first = {}, 0
        for name, space in zip(self.names, self.factors, strict=True):
            last = first + space.ambient(group)
            found[name], first = space.given(group, x[..., first:last]), last
        return found

    def velocity(self, group: LieGroup, value: object, name: str) -> Array:
        return self._joined("velocity", group, value, name)

    def _joined(self, method: str, group: LieGroup, value: object, name: str) -> Array:
        if isinstance(value, Named):
            value = value.asdict()
        may = {key for key, space in zip(self.names, self.factors, strict=True) if space.at_start}
        value = {} if value is None and self.at_start else value
        if not isinstance(value, Mapping) or set(value) | may != set(self.names):
            given = sorted(value) if isinstance(value, Mapping) else value
            raise ArgumentError(
                f"Argument `{name}` must be a dictionary of {', '.join(self.names)}, but is {shown(given)}."
            )
        spaces = zip(self.names, self.factors, strict=True)
        parts = [getattr(s, method)(group, value.get(key), f"{name}.{key}") for key, s in spaces]
        concatenate = np.concatenate if all(isinstance(p, np.ndarray) for p in parts) else jnp.concatenate
        return concatenate(parts)

    def components(self, group: LieGroup, name: str) -> dict[str, slice]:
        ends = [0, *np.cumsum([s.ambient(group) for s in self.factors])]
        return {f"{name}_{key}": slice(int(a), int(b)) for key, (a, b) in zip(self.names, pairwise(ends), strict=True)}
