"""A step of a chain as expressions of one link and its neighbours, ready to be emitted as loops.

The functions are traced for a chain of a few links. The expressions of its first, middle and last links are the code of
the first, of every inner and of the last links of the chain (`link_check` compares them with those of all links).
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import cast

import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.kernels.emit.link_blocks import Blocks, ChordSweep, chord_sweep
from coadjoint.kernels.emit.link_elimination import BlockSweep, Schur, closing, sweep
from coadjoint.kernels.emit.link_pairs import Pairs, pairs_of
from coadjoint.kernels.emit.link_symbols import Address, LinkPlaces, ShortChain
from coadjoint.kernels.expressions.collection import Collector
from coadjoint.kernels.expressions.expression import Expr, reachable
from coadjoint.kernels.expressions.graph import substitute
from coadjoint.kernels.program import JointedStage, LinkedStage
from coadjoint.kernels.trace.tracer import flat
from coadjoint.kernels.untraceable import NotLinked


@dataclass(frozen=True)
class LinkCode:
    """The expressions of one link, number `link` of the short chain.

    prepared: the state after `prepare`, which is s in all that follows. guess: z, (b,). residual: of z. rows: L, D, U
    of its Jacobian. chart: how far it is into the chart. after, record: states.
    there: the slots of the numbers of a state that it has.

    Of joints also solved, joints: `Schur.solved`. rows: L, D, U and the right side of S. increment: δ. free: the
    state after Φ_h. moving, rate: it after the impulse d, with the velocities of its momenta, and φ̇ of these. closing:
    L, D, U and the right side for the last impulse.
    """

    link: int
    prepared: list[Expr]
    guess: list[Expr]
    residual: list[Expr]
    rows: list[Expr]
    chart: list[Expr]
    after: list[Expr]
    record: list[Expr]
    there: list[int]
    solved: list[Expr] = field(default_factory=list)
    joints: list[Expr] = field(default_factory=list)
    increment: list[Expr] = field(default_factory=list)
    free: list[Expr] = field(default_factory=list)
    moving: list[Expr] = field(default_factory=list)
    rate: list[Expr] = field(default_factory=list)
    closing: list[Expr] = field(default_factory=list)

    @property
    def roots(self) -> list[Expr]:
        """All expressions."""
        return [x for part in fields(self) if part.name not in ("link", "there") for x in getattr(self, part.name)]


@dataclass(frozen=True)
class LinkPlan:
    """The code of the first, of every inner and of the last links, and what all share: `prepared` and `after` of a
    state, `record` of a record.

    driven: whether `prepare` changes a state. count: N. base: how many unknowns of a link are eliminated before the
    sweep over links, none but those of bodies with joints. blocks: of which kind each unknown is. state, parameters:
    the places of their numbers in a row. pairs: what the expressions of these parts of `codes` share.
    """

    count: int
    base: int
    blocks: list[int]
    address: dict[Expr, Address]
    h: Expr
    state: LinkPlaces
    parameters: LinkPlaces
    codes: tuple[LinkCode, ...]
    driven: bool
    prepared: list[Expr]
    after: list[Expr]
    record: list[Expr]
    sweep: BlockSweep | ChordSweep
    pairs: dict[tuple[str, ...], Pairs]

    @property
    def reach(self) -> int:
        """How many links at each end have code of their own."""
        return len(self.codes) // 2

    @property
    def joint(self) -> int:
        """m, the number of unknowns of a link in the sweep."""
        return len(self.blocks) - self.base

    @property
    def jointed(self) -> bool:
        """Whether there are joints."""
        return isinstance(self.sweep, BlockSweep)


REACHES = (1, 2)
"""How far the links are whose numbers a link reads: 2 where reactions have directions by the places of neighbours."""


def plan_links(stage: LinkedStage, parameters: PyTree, state: PyTree, pattern: tuple[int, ...]) -> LinkPlan:
    """Trace a stage; raises NotLinked where its equations are not those of links and their neighbours alone.

    pattern: that of `kernels.emit.plan.specialised`.
    """
    for reach in REACHES:
        if stage.count < 4 * reach + 1:
            raise NotLinked(f"a chain of {stage.count} links is too short")
        try:
            chain = ShortChain(stage, parameters, state, pattern, reach)
            plan = _plan(chain)
        except (ArithmeticError, LookupError, TypeError, ValueError) as reason:
            raise NotLinked(f"its functions do not take {4 * reach + 1} links ({reason})") from reason
        together = reachable([*plan.prepared, *plan.after])
        if any(chain.address[node].link is not None for node in together if node in chain.address):
            raise NotLinked("the time or an input of all links depends on links")
        if all(_reach(chain, code) <= reach for code in plan.codes):
            return plan
    raise NotLinked("it reads links beyond its neighbours")


def _reach(chain: ShortChain, code: LinkCode) -> int:
    """How far the links are whose numbers the code of a link reads."""
    links = [chain.address[node].link for node in reachable(code.roots) if node in chain.address]
    return max((abs(link - code.link) for link in links if link is not None), default=0)


def _plan(chain: ShortChain) -> LinkPlan:
    stage, graph, trace = chain.stage, chain.graph, chain.tracer.trace
    p, s, h, z = chain.p, chain.s, chain.h, chain.z
    collect = Collector(graph, chain.fixed)
    prepared = trace(stage.prepare, p, s, h)
    guess = _by_links(trace(stage.guess, p, s, h), chain.z_places)
    residual = _by_links(trace(stage.residual, p, s, h, z), chain.z_places)
    residual = np.array(collect(list(residual.ravel())), object).reshape(residual.shape)
    record, charts = trace(stage.record, p, s, h, z), chain.chart()
    of_kind = _jointed if chain.jointed else _coupled
    own, after, swept = of_kind(chain, residual, collect)
    by_role = {
        "prepared": chain.of_links(prepared), "guess": guess, "residual": residual, "record": chain.of_links(record),
    }  # fmt: skip
    codes = [
        LinkCode(
            c,
            chart=[charts[c]],
            there=np.flatnonzero(chain.places.there[c]).tolist(),
            **own[c],
            **{role: list(of_links[c]) for role, of_links in by_role.items()},
        )
        for c in chain.positions
    ]
    kinds = np.searchsorted(np.cumsum(stage.blocks), chain.z_places[0], side="right")
    return LinkPlan(
        count=chain.long.count,
        base=chain.base,
        blocks=[int(kind) for kind in kinds],
        address=chain.address,
        h=h[()],
        state=chain.state,
        parameters=chain.parameters,
        codes=tuple(codes),
        driven=any(x is not y for x, y in zip(flat(prepared), flat(s), strict=True)),
        prepared=chain.shared(prepared),
        after=after,
        record=chain.shared(record),
        sweep=swept,
        pairs={} if chain.jointed or chain.reach > 1 else _pairs(chain, codes),
    )


SHARING = (("rows", "residual"), ("residual",), ("after",))
"""The parts of codes that are computed together, and whose values of pairs of links are."""


def _pairs(chain: ShortChain, codes: list[LinkCode]) -> dict[tuple[str, ...], Pairs]:
    found = {}
    for parts in SHARING:
        roots = {code.link: [x for part in parts for x in getattr(code, part)] for code in codes}
        found[parts] = pairs_of(chain.graph, chain.address, roots, 2 * chain.reach)
    return {parts: pairs for parts, pairs in found.items() if pairs is not None}


Parts = dict[int, dict[str, list[Expr]]]
"""Expressions of each of the positions of a short chain, by their roles in `LinkCode`."""


def _coupled(chain: ShortChain, residual: np.ndarray, collect: Collector) -> tuple[Parts, list[Expr], ChordSweep]:
    """What is particular to a chain without joints: the blocks of the Jacobian, and the state after the step."""
    after = chain.tracer.trace(chain.stage.advanced, chain.p, chain.s, chain.h, chain.z)
    blocks, ends = Blocks(chain, residual, collect), chain.of_links(after)
    own = {c: {"rows": blocks.rows[c], "after": collect(list(ends[c]))} for c in chain.positions}
    return own, collect(chain.shared(after)), chord_sweep(chain.graph, blocks)


def _jointed(chain: ShortChain, residual: np.ndarray, collect: Collector) -> tuple[Parts, list[Expr], BlockSweep]:
    """What is particular to a chain of joints: its Schur complement, and the step in parts."""
    stage, graph, trace = cast(JointedStage, chain.stage), chain.graph, chain.tracer.trace
    p, h, f, d = chain.p, chain.h, chain.f, chain.d
    free = trace(stage.free, p, chain.s, h, chain.z)
    known = dict(zip(chain.shared(f), chain.shared(free), strict=True))

    def here(values: np.ndarray) -> np.ndarray:
        """Expressions of f, in which time and its rest are those of the step."""
        found = np.empty(values.size, object)
        found[:] = collect(substitute(graph, list(values.ravel()), known))
        return found.reshape(values.shape)

    moving, after = trace(stage.velocities, p, f, d), trace(stage.ended, p, f, h, d)
    rate = here(_by_links(trace(stage.rate, p, moving), chain.d_places))
    velocities, ends = here(chain.of_links(moving)), here(chain.of_links(after))
    schur, last = Schur(chain, residual, collect), closing(chain, rate, collect)
    solved = {c: schur.solved(c) for c in chain.positions}
    x, q = (chain.own(name, len(part)) for name, part in zip("xq", solved[2 * chain.reach], strict=True))
    by_role = {"free": chain.of_links(free), "moving": velocities, "rate": rate, "closing": last, "after": ends}
    own = {
        c: {
            "solved": solved[c][0],
            "joints": solved[c][1],
            "rows": schur.rows(c, q),
            "increment": schur.increment(c, x[c]),
            **{role: list(of_links[c]) for role, of_links in by_role.items()},
        }
        for c in chain.positions
    }
    return own, list(here(np.array(chain.shared(after), object))), sweep(graph, chain.joint)


def _by_links(values: PyTree, places: np.ndarray) -> np.ndarray:
    return np.array(flat(values), object)[places]
