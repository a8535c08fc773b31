"""A chain of a few links with a symbol for every number, and where the numbers of each link are."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

import jax
import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.kernels.expressions.expression import Expr
from coadjoint.kernels.expressions.graph import Graph, substitute
from coadjoint.kernels.packing import layout
from coadjoint.kernels.program import LinkedStage
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.kernels.trace.tracer import Tracer, flat
from coadjoint.kernels.untraceable import NotLinked


class Address(NamedTuple):
    """Where the value of a symbol is: number `slot` of a link in an array, or of all links together (None)."""

    array: str
    slot: int
    link: int | None


class LinkPlaces(NamedTuple):
    """The places in a row of numbers: of each link (N, slots), −1 for one that a link does not have, and of those that
    belong to none."""

    links: np.ndarray
    shared: np.ndarray

    @property
    def size(self) -> int:
        """How many numbers there are."""
        return int(np.sum(self.there)) + len(self.shared)

    @property
    def there(self) -> np.ndarray:
        """Which numbers links have, (N, slots)."""
        return self.links >= 0

    @property
    def spans(self) -> list[tuple[int, int]]:
        """The first link that has a number, and the one after the last, for each slot."""
        firsts, lasts = np.argmax(self.there, axis=0), len(self.links) - np.argmax(self.there[::-1], axis=0)
        return list(zip(firsts.tolist(), lasts.tolist(), strict=True))

    @property
    def lines(self) -> tuple[np.ndarray, np.ndarray]:
        """(a, d) of each slot, whose place of link i is a + d i."""
        first = np.argmax(self.there, axis=0)
        following = np.minimum(first + 1, len(self.links) - 1)
        slots = np.arange(self.links.shape[1])
        start = self.links[first, slots]
        distance = np.where(self.there[following, slots], self.links[following, slots] - start, 0)
        return start - distance * first, distance

    def of(self, row: np.ndarray) -> np.ndarray:
        """The numbers of links in a row, (N, slots), 0 for those that a link does not have."""
        return np.where(self.there, row[self.links], 0.0)


def places_of(stage: LinkedStage, state: PyTree) -> LinkPlaces:
    """The places of the numbers of a state; raises NotLinked if some belong to no link or to several."""
    links, shared = evaluate(stage.rows, layout(state).places)
    parts = [np.asarray(part) for part in jax.tree_util.tree_leaves(links) if np.size(part)]
    if any(part.shape[:1] != (stage.count,) for part in parts):
        raise NotLinked("arrays of the state have other sizes than a number of each link")
    rows = np.concatenate([part.reshape(stage.count, -1) for part in parts], axis=1)
    others = np.array([x for part in jax.tree_util.tree_leaves(shared) for x in np.ravel(part)])
    found = LinkPlaces(rows.astype(int), others.astype(int))
    everything = np.sort(np.concatenate([found.links[found.there], found.shared]))
    if not np.array_equal(everything, np.arange(layout(state).size)):
        raise NotLinked("numbers of the state belong to no link")
    first, distance = found.lines
    even = found.links == first + np.arange(stage.count)[:, None] * distance
    spans = [np.arange(a, b) for a, b in found.spans]
    if not np.all(even | ~found.there) or any(
        len(span) != n for span, n in zip(spans, found.there.sum(0), strict=True)
    ):
        raise NotLinked("the numbers of links are not evenly spaced")
    return found


def unknowns_of(stage: LinkedStage) -> np.ndarray:
    """The places of the unknowns of each link in z, (N, b)."""
    return np.asarray(stage.structure.by_links(np.arange(sum(stage.blocks), dtype=float))).astype(int)


def constants_of(flags: Iterable[bool], parameters: PyTree, count: int) -> LinkPlaces:
    """The places of the constants of each link, those of leaves with a flag, and of the others."""
    flags, sizes = list(flags), [np.size(leaf) for leaf in jax.tree_util.tree_leaves(parameters)]
    parts = [np.arange(end - size, end) for size, end in zip(sizes, np.cumsum(sizes), strict=True)]
    leaves = jax.tree_util.tree_leaves(parameters)
    rows = [
        _by_links(part.reshape(len(leaf), -1), count)
        for part, leaf, own in zip(parts, leaves, flags, strict=True)
        if own
    ]
    others = [part for part, own in zip(parts, flags, strict=True) if not own]
    nothing = np.zeros((count, 0), int)
    return LinkPlaces(np.concatenate([nothing, *rows], axis=1), np.concatenate([np.zeros(0, int), *others]))


def _by_links(places: np.ndarray, count: int) -> np.ndarray:
    """Rows by links: one row less is that of all links but the first, those of further rows are of the last link."""
    missing, further = max(count - len(places), 0), places[count:].reshape(1, -1)
    found = np.pad(places[:count], [(missing, 0), (0, 0)], constant_values=-1)
    return np.concatenate([found, np.pad(further, [(count - 1, 0), (0, 0)], constant_values=-1)], axis=1)


class ShortChain:
    """A stage of a few links, with symbols for its constants p, a state s, the state f after its free step, the
    unknowns z, the impulses d of the multipliers, and the length h; `address` says where their values are.

    reach: how far the links are whose numbers a link may read. count: how many links there are. positions: those at its
    ends whose neighbours are missing, and the middle one. base, joint: how many unknowns of a link are eliminated
    before the sweep over links, those of bodies with joints, and how many are not. state, parameters: the places of the
    numbers of all links of the long chain; places, z_places, d_places: of the short one.
    """

    def __init__(
        self, stage: LinkedStage, parameters: PyTree, state: PyTree, pattern: tuple[int, ...], reach: int
    ) -> None:
        self.reach, self.count = reach, 4 * reach + 1
        self.positions = (*range(reach), 2 * reach, *range(self.count - reach, self.count))
        self.long, self.stage, self.tracer = stage, stage.shortened(self.count), Tracer()
        self.graph: Graph = self.tracer.graph
        self.address: dict[Expr, Address] = {}
        self.flags = stage.per_link(parameters)
        self.state, self.parameters = places_of(stage, state), constants_of(self.flags, parameters, stage.count)
        short = stage.short_state(state, self.count)
        self.places, self.z_places = places_of(self.stage, short), unknowns_of(self.stage)
        self.jointed = stage.structure.multipliers
        self.joint = stage.blocks[-1] // stage.count if self.jointed else self.z_places.shape[1]
        self.base = self.z_places.shape[1] - self.joint
        self.d_places = self.z_places[:, self.base :] - (sum(self.stage.blocks[:-1]) if self.jointed else 0)
        self.p, self.h = self._constants(stage.short(parameters, self.count), pattern), self.tracer.symbols("h", 0.0)
        self.s, self.f = (self._state(name, short) for name in "sf")
        self.z, self.d = self._vector("z", self.z_places), self._vector("d", self.d_places)

    @property
    def fixed(self) -> list[Expr]:
        """The symbols that are the same at every step and link."""
        return [*(node for node, a in self.address.items() if a.array == "p" and a.link is None), self.h[()]]

    def own(self, name: str, slots: int) -> list[list[Expr]]:
        """Symbols of an array that has `slots` numbers of each link, by links."""
        places = np.arange(self.count * slots).reshape(self.count, slots)
        return [list(row) for row in self._vector(name, places)[places]]

    def of_links(self, tree: PyTree) -> np.ndarray:
        """The expressions of a state by links, (count, slots)."""
        return np.array([*flat(tree), self.graph.zero], object)[self.places.links]

    def shared(self, tree: PyTree) -> list[Expr]:
        """Those that belong to no link."""
        return list(np.array(flat(tree), object)[self.places.shared])

    def chart(self) -> dict[int, Expr]:
        """How far each of `positions` is into the chart: the largest of all links, where the others do not move."""
        (chart,) = flat(self.tracer.trace(self.stage.chart, self.p, self.s, self.h, self.z))
        at_rest = dict.fromkeys(self.z, self.graph.zero)
        moving = {c: {**at_rest, **{x: x for x in self.z[self.z_places[c]]}} for c in self.positions}
        return {c: substitute(self.graph, [chart], known)[0] for c, known in moving.items()}

    def _state(self, name: str, tree: PyTree) -> Any:
        found = self.tracer.symbols(name, tree)
        self._addressed(name, flat(found), self.places)
        return found

    def _vector(self, name: str, places: np.ndarray) -> Any:
        found = self.tracer.symbols(name, np.zeros(places.size))
        self._addressed(name, flat(found), LinkPlaces(places, np.zeros(0, int)))
        return found

    def _addressed(self, name: str, symbols: list[Expr], places: LinkPlaces) -> None:
        for link, row in enumerate(places.links):
            for slot, place in enumerate(row):
                if place >= 0:
                    self.address[symbols[place]] = Address(name, slot, link)
        for slot, place in enumerate(places.shared):
            self.address[symbols[place]] = Address(name, slot, None)

    def _constants(self, given: PyTree, pattern: tuple[int, ...]) -> Any:
        """The constants; those of all links that are exactly 0 or 1 by `specialised` as numbers."""
        found = self.tracer.symbols("p", given)
        places = constants_of(self.flags, given, self.count)
        self._addressed("p", flat(found), places)
        kinds = [pattern[place] for place in self.parameters.shared]
        known = {flat(found)[k]: float(kind) for k, kind in zip(places.shared, kinds, strict=True) if kind < 2}

        def place(leaf: np.ndarray) -> np.ndarray:
            nodes = [self.graph.constant(known[x]) if x in known else x for x in leaf.ravel()]
            out = np.empty(len(nodes), object)
            out[:] = nodes
            return out.reshape(leaf.shape)

        return jax.tree_util.tree_map(place, found)
