"""Loops over the links of a chain as LLVM code: arrays with a place for each link, and numbers of all links."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager

import numpy as np
from llvmlite import ir

from coadjoint.kernels.emit.emitter import DOUBLE, INT64, Emitter, Value
from coadjoint.kernels.emit.lanes import LaneEmitter
from coadjoint.kernels.emit.link_pairs import Pairs
from coadjoint.kernels.emit.link_plan import LinkCode, LinkPlan
from coadjoint.kernels.emit.link_symbols import LinkPlaces
from coadjoint.kernels.expressions.expression import Expr, reachable

LINE = 8
"""Numbers of a line of the cache."""

Roots = Callable[[LinkCode], list[Expr]]
Write = Callable[[Emitter, list[Value], Value, LinkCode], None]
Known = Mapping[Expr, tuple[int, int]]
Places = list[tuple[Expr, str, int]]
"""Expressions, each with an array and the number of a link there."""

Lanes = dict[Emitter, Value]
"""A local variable for each emitter: of one link, and of several in SIMD lanes."""


def sizes(plan: LinkPlan) -> dict[str, int]:
    """How many numbers of a link each array holds.

    s, n: the state and the next one. b: that at the node. z, y: the unknowns and the next ones. d: the solution of the
    sweep. t: of chords the blocks, then their factors. v: of it and the next link, `LinkPlan.pairs`.
    Of joints f: the state after the free step. x, q: `LinkCode.solved` and `LinkCode.joints`. t: rows L, D, U, r.
    w: W and y of the sweep.
    """
    m, slots, inner = plan.joint, plan.state.links.shape[1], plan.codes[plan.reach]
    found = {"p": plan.parameters.links.shape[1], "s": slots, "n": slots, "b": slots}
    found |= {"z": len(plan.blocks), "y": len(plan.blocks), "d": m}
    if not plan.jointed:
        values = max((len(pairs.values) for pairs in plan.pairs.values()), default=0)
        return found | {"t": 3 * m**2, "v": values}
    return found | {"f": slots, "x": len(inner.solved), "q": len(inner.joints), "t": 3 * m**2 + m, "w": m**2 + m}


def stride(plan: LinkPlan) -> int:
    """From one number of a link to the next: an odd number of lines, because powers of two collide in the cache."""
    return LINE * (-(-plan.count // LINE) | 1)


def at(array: str, nodes: Iterable[Expr]) -> Places:
    """Expressions at the first numbers of an array."""
    return [(node, array, slot) for slot, node in enumerate(nodes)]


class LinkArrays:
    """Writes loops over links into a builder.

    memory: a pointer to the arrays, in which number k of link i is at k·stride + i. exact: expressions whose sums keep
    their order. width: of the SIMD lanes.
    """

    def __init__(self, plan: LinkPlan, module: ir.Module, b: ir.IRBuilder, memory: Value, width: int) -> None:
        self.plan, self.module, self.b, self.memory, self.stride = plan, module, b, memory, stride(plan)
        self.one = Emitter(module, b, 1)
        alone = width == 1 or plan.count - 2 * plan.reach < width
        self.many = self.one if alone else LaneEmitter(module, b, width)
        self.emitters = [self.one] if alone else [self.one, self.many]
        ends = np.cumsum([0, *(size * self.stride for size in sizes(plan).values())])
        self.place = {name: INT64(int(end)) for name, end in zip(sizes(plan), ends[:-1], strict=True)}

    # Numbers of links.

    def at(self, array: str, slot: int, link: Value) -> Value:
        """A pointer to number `slot` of a link in an array."""
        start = self.b.add(self.place[array], INT64(slot * self.stride))
        return self.b.gep(self.memory, [self.b.add(start, link)])

    def load(self, emit: Emitter, array: str, slot: int, link: Value) -> Value:
        """Number `slot` of a link, and of those after it in the other lanes."""
        return self.b.load(self.b.bitcast(self.at(array, slot, link), emit.number.as_pointer()), align=8)

    def store(self, emit: Emitter, value: Value, array: str, slot: int, link: Value) -> None:
        """Set them."""
        place = self.b.bitcast(self.at(array, slot, link), emit.number.as_pointer())
        self.b.store(value, place, align=8)

    def copied(self, source: str, to: str) -> None:
        """Copy an array to another one."""
        kind = ir.IntType(8).as_pointer()
        copy = self.module.declare_intrinsic("llvm.memcpy", [kind, kind, INT64])
        places = [self.b.bitcast(self.at(array, 0, INT64(0)), kind) for array in (to, source)]
        self.b.call(copy, [*places, INT64(sizes(self.plan)[to] * self.stride * 8), ir.IntType(1)(0)])

    def in_row(self, row: Value, places: LinkPlaces, link: Value) -> list[Value]:
        """Pointers to the numbers of a link in a row, which are at a constant distance from link to link."""
        first, distance = places.lines
        pairs = zip(first.tolist(), distance.tolist(), strict=True)
        return [self.b.gep(row, [self.b.add(INT64(a), self.b.mul(link, INT64(d)))]) for a, d in pairs]

    def transposed(self, row: Value, places: LinkPlaces, array: str, reading: bool) -> None:
        """The numbers of all links from a row into an array, or back."""
        for span in sorted(set(places.spans)):
            with self.over(INT64(span[0]), INT64(span[1])) as i:
                for slot, (there, own) in enumerate(zip(self.in_row(row, places, i), places.spans, strict=True)):
                    if own == span:
                        here = self.at(array, slot, i)
                        self.b.store(self.b.load(there if reading else here), here if reading else there)

    def bind_all(self, node: Expr, value: Value) -> None:
        """The same number for all links."""
        for emit in self.emitters:
            emit.bind(node, self._spread(emit, value))

    def _spread(self, emit: Emitter, value: Value) -> Value:
        if emit.width == 1:
            return value
        nothing, first = ir.Constant(emit.number, ir.Undefined), ir.IntType(32)(0)
        mask = ir.Constant(ir.VectorType(ir.IntType(32), emit.width), [first] * emit.width)
        return self.b.shuffle_vector(self.b.insert_element(nothing, value, first), nothing, mask)

    # Loops.

    @contextmanager
    def scopes(self) -> Iterator[None]:
        """Values emitted inside are not used outside."""
        with ExitStack() as stack:
            for emit in self.emitters:
                stack.enter_context(emit.scope())
            yield

    @contextmanager
    def over(self, begin: Value, end: Value, step: int = 1) -> Iterator[Value]:
        """for i in range(begin, end, step), at least once."""
        b = self.b
        before, body, after = b.block, b.append_basic_block("links"), b.append_basic_block("on")
        b.branch(body)
        b.position_at_end(body)
        i = b.phi(INT64)
        i.add_incoming(begin, before)
        yield i
        following = b.add(i, INT64(step))
        i.add_incoming(following, b.block)
        b.cbranch(b.icmp_signed("<" if step > 0 else ">", following, end), body, after)
        b.position_at_end(after)

    def links(self, roots: Roots, write: Write, emit: Emitter | None = None, pairs: Pairs | None = None) -> None:
        """The values of expressions of every link: of the first ones, of those between by lanes, and of the last ones.

        pairs: what they share. The last lanes of those between may repeat links, from the same numbers: nothing is
        changed in place.
        """
        codes, reach, emit = self.plan.codes, self.plan.reach, emit or self.many
        if pairs is not None:
            self._pairs(pairs)
        known = {} if pairs is None else pairs.known
        for link, code in enumerate(codes[:reach]):
            self._link(self.one, code, roots, write, INT64(link), known.get(code.link, {}))
        end, inner = self.plan.count - reach, codes[reach]
        with self._grouped(reach, end, emit) as here:
            self._link(emit, inner, roots, write, here, known.get(inner.link, {}))
        for link, code in enumerate(codes[reach + 1 :], end):
            self._link(self.one, code, roots, write, INT64(link), known.get(code.link, {}))

    @contextmanager
    def _grouped(self, begin: int, end: int, emit: Emitter) -> Iterator[Value]:
        """A loop over the first links of groups by lanes, the last of which may repeat some of the one before."""
        final = INT64(end - emit.width)
        with self.over(INT64(begin), INT64(end), emit.width) as i:
            yield i if emit.width == 1 else self.b.select(self.b.icmp_signed("<", i, final), i, final)

    def _pairs(self, pairs: Pairs) -> None:
        """Store the values of all pairs."""
        emit = self.many
        with self._grouped(0, self.plan.count - 1, emit) as here, emit.scope():
            self._bind(emit, pairs.values, pairs.link, here, {})
            for slot, value in enumerate(emit.values(pairs.values)):
                self.store(emit, value, "v", slot, here)

    def _link(self, emit: Emitter, code: LinkCode, roots: Roots, write: Write, link: Value, known: Known) -> None:
        found = roots(code)
        with emit.scope():
            self._bind(emit, found, code.link, link, known)
            write(emit, emit.values(found), link, code)

    def _bind(self, emit: Emitter, roots: list[Expr], own: int, link: Value, known: Known) -> None:
        """The symbols in expressions of number `own` of the short chain, as those of a link, and values of pairs."""
        for node in reachable(roots, lambda node: () if node in known else node.args):
            address = self.plan.address.get(node)
            if node in known:
                slot, away = known[node]
                emit.bind(node, self.load(emit, "v", slot, self.b.add(link, INT64(away))))
            elif address is not None and address.link is not None:
                there = self.b.add(link, INT64(address.link - own))
                emit.bind(node, self.load(emit, address.array, address.slot, there))

    def fill(self, array: str, part: str, watched: Lanes | None = None) -> None:
        """Store the expressions of a part of the code of every link in an array; `watched` collects their sum."""
        self.fill_both({array: part}, watched)

    def fill_both(self, parts: dict[str, str], watched: Lanes | None = None) -> None:
        """The same of several arrays."""

        def write(emit: Emitter, values: list[Value], link: Value, code: LinkCode) -> None:
            slots = [(array, slot) for array, part in parts.items() for slot in range(len(getattr(code, part)))]
            for (array, slot), value in zip(slots, values, strict=True):
                self.store(emit, value, array, slot, link)
            if watched is not None:
                self.add(emit, watched, values)

        pairs = self.plan.pairs.get(tuple(parts.values()))
        self.links(lambda code: [x for part in parts.values() for x in getattr(code, part)], write, pairs=pairs)

    def carried(
        self, given: Places, before: list[Expr], roots: Places, links: tuple[Value, Value, int], first: int = 0
    ) -> None:
        """A loop over links, of which each gets results of the one before, from zero.

        given: symbols and where their numbers are. roots: results and where they go, from number `first` on those for
        `before` of the next link.
        """
        b, one = self.b, self.one
        variables = [one.variable(DOUBLE, DOUBLE(0.0)) for _ in before]
        with self.over(*links) as i, one.scope():
            for node, array, slot in given:
                if node.op == "symbol":
                    one.bind(node, self.load(one, array, slot, i))
            for node, variable in zip(before, variables, strict=True):
                if node.op == "symbol":
                    one.bind(node, b.load(variable))
            values = one.values([node for node, _, _ in roots])
            for value, (_, array, slot) in zip(values, roots, strict=True):
                self.store(one, value, array, slot, i)
            for value, variable in zip(values[first:], variables, strict=False):
                b.store(value, variable)

    @property
    def forward(self) -> tuple[Value, Value, int]:
        """From the first link to the last."""
        return INT64(0), INT64(self.plan.count), 1

    @property
    def backward(self) -> tuple[Value, Value, int]:
        """From the last link to the first."""
        return INT64(self.plan.count - 1), INT64(-1), -1

    # Numbers of all links together.

    def variables(self) -> Lanes:
        """A variable for each emitter."""
        return {emit: emit.variable(emit.number) for emit in self.emitters}

    def set(self, places: Lanes, value: float) -> None:
        """Set them to a number."""
        for emit, place in places.items():
            self.b.store(emit.constant(value), place)

    def add(self, emit: Emitter, places: Lanes, values: Iterable[Value]) -> None:
        """Add values, which only shows whether they are finite."""
        total = self.b.load(places[emit])
        for value in values:
            total = self.b.fadd(total, value)
        self.b.store(total, places[emit])

    def widen(self, emit: Emitter, places: Lanes, values: Iterable[Value]) -> None:
        """The larger of what is there and |value|; NaN is passed over."""
        most = self.b.load(places[emit])
        for value in values:
            size = emit.intrinsic("fabs", value)
            most = self.b.select(self.b.fcmp_ordered(">", size, most), size, most)
        self.b.store(most, places[emit])

    def largest(self, places: Lanes) -> Value:
        """The largest number of all lanes."""
        first, *others = self._numbers(places)
        for value in others:
            first = self.b.select(self.b.fcmp_ordered(">", value, first), value, first)
        return first

    def finite(self, places: Lanes) -> Value:
        """Whether the sum of all lanes is finite."""
        total, *others = self._numbers(places)
        for value in others:
            total = self.b.fadd(total, value)
        return self.b.fcmp_ordered("<", self.one.intrinsic("fabs", total), DOUBLE(float("inf")))

    def _numbers(self, places: Lanes) -> list[Value]:
        found = []
        for emit, place in places.items():
            value, lanes = self.b.load(place), range(emit.width)
            found += [value] if emit.width == 1 else [self.b.extract_element(value, ir.IntType(32)(k)) for k in lanes]
        return found
