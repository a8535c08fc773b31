"""Values of two neighbouring links that the equations of both need: they are computed once for each pair.

The strain of a rod between two sections is one: it turns both, and so does its derivative. As expressions are shared,
such a value is a node that the code of a link and the same code of the next link have in common; these codes differ by
the numbers of links in their symbols alone.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

from coadjoint.kernels.emit.link_symbols import Address
from coadjoint.kernels.expressions.expression import Expr, reachable
from coadjoint.kernels.expressions.graph import Graph, substitute

Codes = Mapping[int, list[Expr]]
"""Expressions at positions of a short chain."""

WORTH = 0.9
"""Values of pairs are stored if the operations that remain, with a store and two loads of each, are fewer than this
part of all."""


class Pairs(NamedTuple):
    """Values of pairs of links.

    link: the first of the pair of which `values` are expressions. known: the nodes that have these values in the code
    at each position, with their number and where their pair begins, 0 at the link itself and −1 at the one before.
    """

    link: int
    values: list[Expr]
    known: dict[int, dict[Expr, tuple[int, int]]]


def pairs_of(graph: Graph, address: Mapping[Expr, Address], codes: Codes, inner: int) -> Pairs | None:
    """The values of pairs in these codes, of which that at `inner` is of all inner links; None if they gain nothing."""
    values = _common(address, codes[inner], _moved(graph, address, 1, codes[inner]))
    shifted = {
        by: _moved(graph, address, by - inner, values) for by in range(max(codes)) if {by, by + 1} & codes.keys()
    }
    known = {c: {x: (k, by - c) for by in (c - 1, c) for k, x in enumerate(shifted.get(by, ()))} for c in codes}
    rest, pair = _operations(codes[inner], known[inner]), _operations(values)
    worth = rest + pair + 3 * len(values) < WORTH * _operations(codes[inner])
    return Pairs(inner, values, known) if worth else None


def _moved(graph: Graph, address: Mapping[Expr, Address], by: int, roots: list[Expr]) -> list[Expr]:
    """The expressions of links further on; a number that one of them has not is unknown."""
    symbols = {place: node for node, place in address.items()}
    further = {
        node: symbols.get(Address(array, slot, link + by)) or graph.unknown()
        for node, (array, slot, link) in address.items()
        if link is not None
    }
    with graph.rewriting():
        return substitute(graph, roots, further) if by else roots


def _common(address: Mapping[Expr, Address], one: list[Expr], other: list[Expr]) -> list[Expr]:
    """The nodes of two links that both lists use, and of which anything else is made.

    Not −x, but x; a sum takes the factors of a product, with which it is one operation (`Emitter`).
    """
    links: dict[Expr, frozenset[int]] = {}
    here, there = set(reachable(one)), set(reachable(other))
    for node in reachable([*one, *other]):
        place = address.get(node)
        own = () if place is None or place.link is None else (place.link,)
        links[node] = frozenset(own).union(*(links[x] for x in node.args))
    both = {node for node in here & there if len(links[node]) > 1}
    uses = [(x, node.op) for node in (here | there) - both for x in node.args]
    used = {x for x, _ in [*uses, *((root, "") for root in (*one, *other))] if x in both}
    products = {x for x, op in uses if op in ("add", "sub") and x.op == "mul"}
    while opened := {x for x in used if x in products or x.op == "neg"}:
        used = (used - opened) | {factor for x in opened for factor in x.args if factor in both}
    return sorted(used, key=lambda node: node.number)


def _operations(roots: Iterable[Expr], known: Mapping[Expr, object] | None = None) -> int:
    """How many operations the roots take."""
    given = known or {}
    return sum(bool(x.args) and x not in given for x in reachable(roots, lambda x: () if x in given else x.args))
