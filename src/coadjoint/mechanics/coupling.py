"""How the unknowns of a system's equations are coupled, linear systems of that structure, and the memory they need."""

from __future__ import annotations

from collections.abc import Callable, Generator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import replace
from functools import lru_cache

import jax
import jax.numpy as jnp

from coadjoint import memory
from coadjoint.arrays import Array
from coadjoint.groups import LieGroup, Power
from coadjoint.kernels.newton.coupled import Coupled
from coadjoint.kernels.newton.solver import Dense
from coadjoint.kernels.program import Structure
from coadjoint.mechanics.state import Places
from coadjoint.spaces import Several, Space


def structure(places: Places, more: tuple[int, ...] = ()) -> Structure:
    """The structure of equations for (ξ, y), (dim G + dim Q,): coupled links, or dense where every pair is coupled.

    more: the sizes of further parts of the unknowns.
    """
    group, Q, _ = places
    return structure_of_links(group, (*_dims(Q, group), *more)) if isinstance(group, Power) else Dense()


@lru_cache(maxsize=256)
def rows_of_links(group: LieGroup, sizes: tuple[int, ...]) -> Coupled | None:
    """The structure of equations for parts of these sizes alone, each of all of many links; None for others."""
    if not large(group) or not isinstance(group, Power) or not isinstance(structure_of_links(group, sizes), Coupled):
        return None
    return Coupled(group.count, tuple(size // group.count for size in sizes), group.pairs)


def _dims(Q: Space, group: LieGroup) -> list[int]:
    """dim Q of the parts of y that hold the links one after the other."""
    parts = Q.factors if isinstance(Q, Several) else (Q,)
    return [size for part in parts for size in (_dims(part, group) if part is not Q else [part.dim(group)])]


@lru_cache(maxsize=256)
def structure_of_links(group: Power, sizes: tuple[int, ...] = ()) -> Structure:
    """The structure of equations for ξ and parts of y of these sizes, each of all links."""
    if group.coupling == "all" or any(size % group.count for size in sizes):
        return Dense()
    found = Coupled(group.count, (group.factor.dim, *(size // group.count for size in sizes)), group.pairs)
    wide = 2 * found.layout.width >= group.count > 2
    return Dense() if wide else found


def jacobian_solve(places: Places, function: Callable[[Array], Array], z: Array, right: Array) -> Array:
    """x with (∂function/∂z) x = right at z = (ξ, y), all (dim G + dim Q,), by the structure of the equations."""
    how = structure(places)
    if isinstance(how, Coupled) and _apart.get():
        return replace(how, pairs=()).jacobian_solve(function, z, right)
    if isinstance(how, Coupled) and not how.native:
        return how.jacobian_solve(function, z, right)
    return jnp.linalg.solve(jax.jacfwd(function)(z), right)


_apart: ContextVar[bool] = ContextVar("apart", default=False)


@contextmanager
def momenta_of_links_apart() -> Generator[None]:
    """Inside, `jacobian_solve` may take it that the momenta of a link depend on its own velocities alone."""
    token = _apart.set(True)
    try:
        yield
    finally:
        _apart.reset(token)


def large(group: LieGroup) -> bool:
    """Whether a group has so many links that no array may hold a number for each pair of its coordinates."""
    return isinstance(group, Power) and group.dim > 60


OF_A_LINK = 200.0
"""Bytes that Newton's method for a chain or a ring holds, at least, for each number of the matrix of a link and each of
the three tangents of its unknowns: nine tenths of what free bodies on SO(3) take, 18 kB a link."""

OF_A_PAIR = 80.0
"""Bytes that it holds, at least, for each pair of unknowns where all links act on each other: 132 were measured."""

SMALL = 4
"""The largest matrices of a link for which `OF_A_LINK` is known."""


def require_room(group: LieGroup) -> None:
    """Raise ArgumentError where Newton's method for a power of a group needs more memory than this machine has."""
    if not isinstance(group, Power):
        return
    link, m, power = group.factor, group.dim, 1
    if group.coupling in ("chain", "ring"):  # without the list of their pairs, which itself may not fit
        needed = OF_A_LINK * 3 * m * link.matrix_size**2 if link.matrix_size <= SMALL else 0.0
    elif isinstance(structure_of_links(group), Dense):
        needed, power = OF_A_PAIR * m**2, 2
    else:
        return
    fits = memory.most_that_fit(group.count, needed, power)
    memory.require_room(f"A step of {group.count} links on {link!r}", needed, f"take up to {fits} links")
