"""The members of a run file with numbers for each member, `co.each`: made one by one, and put together.

A model or a factory gets the plain numbers of one member at a time, so that it may compute with them, branch on them
and reject them. Its systems must differ only in parameters and in arguments of the start; then all members are one
system and one start with `co.each` in these places.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Hashable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import jax
import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.members import Each
from coadjoint.mechanics.start import StartGiven, starts_given
from coadjoint.mechanics.state import State
from coadjoint.runs.setup import Setup
from coadjoint.runs.signature import signature
from coadjoint.spaces.named import Named
from coadjoint.texts import Table

if TYPE_CHECKING:
    from coadjoint.mechanics.system import System
    from coadjoint.runs.run_file import RunFile

Maker = Callable[[Table, Table], tuple[Any, Any]]


@dataclass(frozen=True)
class MadeMembers:
    """Systems and starts of members. signatures: those of the systems apart from their numbers, at the time of
    making."""

    systems: Sequence[System]
    starts: Sequence[State | StartGiven]
    signatures: Sequence[Hashable]

    @cached_property
    def _numbers(self) -> list[Any]:
        """Of each member, parameters and arguments of the start as a tree of arrays."""
        given = [one.arguments if isinstance(one, StartGiven) else () for one in self.starts]
        return [
            (one.parameters, tuple(map(_arrays, arguments))) for one, arguments in zip(self.systems, given, strict=True)
        ]

    @property
    def varying(self) -> frozenset[str]:
        """The places of the numbers in which members differ; raises ArgumentError where they differ in others."""
        self._require_alike()
        rows = [jax.tree_util.tree_leaves_with_path(one) for one in self._numbers]
        return frozenset(
            jax.tree_util.keystr(column[0][0]) for column in zip(*rows, strict=True) if _differ([x for _, x in column])
        )

    def together(self, varying: Collection[str]) -> Setup:
        """All members as one set-up, in which the numbers at these places, and others that differ, are `co.each`.

        Raises ArgumentError where members differ in more than numbers.
        """
        places = {*varying, *self.varying}

        def one(path: Any, *leaves: PyTree) -> PyTree:
            return Each(np.stack(leaves)) if jax.tree_util.keystr(path) in places else leaves[0]

        parameters, arguments = jax.tree_util.tree_map_with_path(one, *self._numbers)
        system = replace_parameters(self.systems[0], parameters)
        given = self.starts[0]
        if isinstance(given, StartGiven):
            element, *others = arguments
            made = StartGiven(system, (_element(element, len(self.systems)), *others), given.by_momenta)
            return Setup(system, made.state())
        return Setup(system, jax.tree.map(lambda *leaves: np.stack(leaves), *self.starts))

    def _require_alike(self) -> None:
        trees = {jax.tree.structure(one) for one in self._numbers}
        if len({*self.signatures}) > 1 or len(trees) > 1 or len({type(one) for one in self.starts}) > 1:
            raise ArgumentError("Members of a sweep differ in more than numbers, and cannot step together.")


def members(file: RunFile, possible: bool = False) -> MadeMembers:
    """The members of a run file with `co.each` in [parameters] or [initial]; raises the errors of making one of them.

    possible: leave out those that cannot be made.
    """
    make, rows = file.maker, _rows(file)
    try:
        with starts_given():
            return _made(make, rows, possible)
    except _Looked:
        return _made(make, rows, possible)


class _Looked(Exception):
    """A maker reads or changes the start that it made, so it needs a computed one."""


def _made(make: Maker, rows: Sequence[tuple[Table, Table]], possible: bool) -> MadeMembers:
    systems, starts, signatures = list[Any](), list[Any](), list[Hashable]()
    for parameters, initial in rows:
        try:
            system, start = make(parameters, initial)
        except Exception:
            try:
                with starts_given(False):
                    make(parameters, initial)
            except ArgumentError:
                if possible:
                    continue
                raise
            raise _Looked from None
        systems.append(system)
        starts.append(start)
        signatures.append(signature(system))  # now: another call may change the values that functions read
    return MadeMembers(systems, starts, signatures)


def _rows(file: RunFile) -> list[tuple[Table, Table]]:
    """[parameters] and [initial] of each member, in plain numbers as a file has them."""
    leaves, structure = jax.tree.flatten((file.parameters, file.initial))
    count = next(len(leaf) for leaf in leaves if isinstance(leaf, Each))
    columns = [np.asarray(leaf.values).tolist() if isinstance(leaf, Each) else [leaf] * count for leaf in leaves]
    return [jax.tree.unflatten(structure, row) for row in zip(*columns, strict=True)]


def _arrays(value: object) -> PyTree:
    """An argument of a start with arrays for its numbers; lists are arrays, tuples are elements of several."""
    if value is None:
        return None
    if isinstance(value, Named):
        return _arrays(value.asdict())
    if isinstance(value, Mapping):
        return {name: _arrays(one) for name, one in value.items()}
    if isinstance(value, tuple) and any(np.ndim(one) for one in value):
        return tuple(map(_arrays, value))
    return np.asarray(value, dtype=float)


def _differ(leaves: Sequence[np.ndarray]) -> bool:
    """Whether some of these arrays differ, in shape too."""
    first = np.asarray(leaves[0])
    return any(np.shape(one) != first.shape or np.asarray(one).tobytes() != first.tobytes() for one in leaves[1:])


def _element(given: object, count: int) -> PyTree:
    """An element of a group; with `co.each` in one of its parts, `co.each` of elements."""
    if not isinstance(given, tuple) or not any(isinstance(one, Each) for one in given):
        return given
    return Each(tuple(one.values if isinstance(one, Each) else np.repeat(one[None], count, axis=0) for one in given))
