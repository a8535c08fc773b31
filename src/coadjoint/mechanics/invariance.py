"""Left and right invariance: a right-invariant system is a left-invariant one on the opposite group."""

from __future__ import annotations

from typing import Literal, get_args

from coadjoint import checks
from coadjoint.errors import ArgumentError
from coadjoint.groups import LieGroup, Opposite, Power
from coadjoint.mechanics.state import Places
from coadjoint.spaces import Space
from coadjoint.spaces.by_inverse import by_inverse

Invariance = Literal["left", "right"]
"""Whether L(hg, hġ) = L(g, ġ), so that ξ = g⁻¹ġ, or L(gh, ġh) = L(g, ġ), so that ξ = ġg⁻¹."""


def places_of(group: LieGroup, additional: Space, advected: Space, invariance: Invariance) -> Places:
    """Where the equations of left invariance hold: on G, or on Gᵒᵖ, which acts on its spaces by inverses.

    On Gᵒᵖ, g⁻¹·ġ is ġg⁻¹, and the actions of g⁻¹ that give n, ν and a are those of g. Raises ArgumentError unless
    `invariance` is "left" or "right".
    """
    checks.choice(invariance, "invariance", get_args(Invariance))
    if invariance == "left":
        return Places(group, additional, advected)
    if isinstance(group, Opposite):
        raise ArgumentError(
            f'Argument `group` must be the group itself, {group.group!r}, where invariance="right", but is {group!r}.'
        )
    if isinstance(group, Power):
        raise ArgumentError(
            f'Argument `group` must be no power of a group where invariance="right", but is {group!r}: chains are '
            "left-invariant."
        )
    return Places(Opposite(group), by_inverse(additional), by_inverse(advected))


def group_of(places: Places) -> LieGroup:
    """G, also of a right-invariant system."""
    return places.group.group if is_right(places) else places.group  # pyright: ignore[reportAttributeAccessIssue]


def is_right(places: Places) -> bool:
    """Whether ξ, n, ν, a, μ and π are in the space frame, as ġg⁻¹ is."""
    return isinstance(places.group, Opposite)


def in_words(places: Places) -> str:
    """The group, and the invariance if it is right, as printed on certificates."""
    return f"{group_of(places)!r}" + (", right-invariant" if is_right(places) else "")


def acted_on(places: Places, space: Space) -> Space:
    """A space of G as one of the group of `places`, which of a right-invariant system acts by inverses."""
    return by_inverse(space) if is_right(places) else space
