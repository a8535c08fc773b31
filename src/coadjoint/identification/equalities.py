"""Parameters that are equal, as those of four fins: one unknown for all of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from coadjoint.errors import ArgumentError

SIGN = " = "
"""The sign between the names of parameters that are equal."""


class NamedEntry(NamedTuple):
    """One number of a parameter: its name with its index, its place among all numbers, its value.

    `places`: two for an off-diagonal entry of a symmetric matrix. `definite`: whether it is on the diagonal of a
    positive definite one.
    """

    label: str
    places: tuple[int, ...]
    value: float
    definite: bool


def groups(
    parameters: Sequence[object], known: Mapping[str, object], expanded: Callable[..., list[str]]
) -> Iterator[tuple[str, ...]]:
    """The names that each unknown stands for: one, or those of `"a = b"`; parts stand for all their parameters."""
    for text in parameters:
        names = [name.strip() for name in text.split("=")] if isinstance(text, str) else [text]
        lists = [expanded([name], known) for name in names]
        if len({len(each) for each in lists}) > 1:
            raise ArgumentError(
                f"Parameters that are equal must have the same entries, but in `{text}` there are "
                f"{' and '.join(str(len(each)) for each in lists)}: name the parameters themselves."
            )
        yield from zip(*lists, strict=True)


def require_equal(names: Sequence[str], members: Sequence[Sequence[NamedEntry]]) -> None:
    """Raise ArgumentError for equal parameters that have different sizes or prior values."""
    for name, entries in zip(names[1:], members[1:], strict=True):
        if len(entries) != len(members[0]):
            raise ArgumentError(
                f"Parameters that are equal must have as many numbers, but `{names[0]}` has {len(members[0])} and "
                f"`{name}` has {len(entries)}."
            )
        for first, other in zip(members[0], entries, strict=True):
            if abs(first.value - other.value) > 1e-9 * abs(first.value):
                raise ArgumentError(
                    f"Parameters that are equal must begin equal, but `{first.label}` is {first.value:g} and "
                    f"`{other.label}` is {other.value:g}: change one of them in the system first."
                )


def require_once(chosen: Mapping[tuple[int, ...], Any]) -> None:
    """Raise ArgumentError where an entry belongs to two unknowns."""
    owner: dict[int, Any] = {}
    for places, unknown in chosen.items():
        for place in places:
            if place in owner:
                raise ArgumentError(
                    f"`{owner[place].label}` and `{unknown.label}` are both estimated, but share a number: keep one."
                )
            owner[place] = unknown
