"""Steps of more links than this machine has memory for are refused before anything of their size is made."""

from __future__ import annotations

from coadjoint import memory
from coadjoint.groups import LieGroup, Power
from coadjoint.kernels.newton.solver import Dense
from coadjoint.mechanics.coupling import structure_of_links

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
    if group.coupling in ("chain", "ring"):  # without the list of their pairs, which may be what does not fit
        needed = OF_A_LINK * 3 * m * link.matrix_size**2 if link.matrix_size <= SMALL else 0.0
    elif isinstance(structure_of_links(group), Dense):
        needed, power = OF_A_PAIR * m**2, 2
    else:
        return
    fits = memory.most_that_fit(group.count, needed, power)
    memory.require_room(f"A step of {group.count} links on {link!r}", needed, f"take up to {fits} links")
