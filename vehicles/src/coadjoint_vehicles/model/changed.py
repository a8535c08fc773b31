"""Replaced parameters pass the checks of their owners: body, parts, controller and water."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError
from coadjoint.extending import traced
from coadjoint.mechanics.members import Each, count_members, member_of
from coadjoint.spaces import Named

FIXED = ("inertia", "added_mass", "allocation", "positions", "directions")
"""Arrays whose shape other code relies on: a diagonal cannot replace a matrix."""


def require_possible(owner: object, nominal: Mapping[str, PyTree], found: Mapping[str, PyTree], path: str = "") -> None:
    """Raise ArgumentError unless the owner of numbers can be built with those that were found, for every member.

    nominal: the original numbers, in nested dictionaries for those of its parts. path: their place among the parameters
    of a craft. Traced values are not checked.
    """
    changed = _changed(owner, nominal, found, path)
    for which, values in _members(changed):
        try:
            _rebuilt(owner, _by_owner(values))
        except ArgumentError as error:
            raise ArgumentError(f"Of {which}: {error}" if which else str(error)) from error


def rebuilt(owner: object, nominal: Mapping[str, object], found: Mapping[str, object]) -> Any:
    """The owner of numbers with those that were found, none of which varies over members; arguments as above."""
    return _rebuilt(owner, _by_owner(_changed(owner, nominal, found, "")))


def _changed(owner: object, nominal: Mapping[str, object], found: Any, path: str) -> dict[tuple[str, ...], Any]:
    """The changed values, by path; raises ArgumentError for other shapes."""
    changed: dict[tuple[str, ...], Any] = {}
    for key, old in nominal.items():
        new, here = getattr(found, key) if isinstance(found, Named) else found[key], f"{path}.{key}" if path else key
        if isinstance(old, Mapping):
            inner = _changed(part_of(owner, key), old, new, here)
            changed |= {(key, *rest): value for rest, value in inner.items()}
        elif not traced(new) and not _same(new, old):
            if not is_dataclass(owner) or getattr(owner, key, None) is not old or key in FIXED:
                _require_shape(here, new, old)
            changed[key,] = new
    return changed


def part_of(owner: object, name: str) -> Any:
    """The owner of the group `name` of parameters: a thruster's curve, the controller at a helm, a current."""
    return getattr(owner, "owners", {}).get(name, getattr(owner, name, None))


def _by_owner(values: Mapping[tuple[str, ...], Any]) -> dict[str, PyTree]:
    """Dictionaries in dictionaries, from paths."""
    found: dict[str, PyTree] = {}
    for (key, *rest), value in values.items():
        found[key] = {**found.get(key, {}), tuple(rest): value} if rest else value
    return {key: _by_owner(value) if isinstance(value, Mapping) else value for key, value in found.items()}


def _rebuilt(owner: object, values: Mapping[str, object]) -> Any:
    """The owner with these numbers; raises ArgumentError. Numbers that are not its fields need no check."""
    if not is_dataclass(owner):
        return owner
    own: dict[str, PyTree] = {field.name: getattr(owner, field.name) for field in fields(owner)}
    new: dict[str, object] = {}
    for key, value in values.items():
        made = _rebuilt(part_of(owner, key), value) if isinstance(value, Mapping) else value
        if key in own and isinstance(own[key], (int, float, np.ndarray, Each)) != isinstance(value, Mapping):
            new[key] = made
    return replace(owner, **new) if new else owner  # pyright: ignore[reportArgumentType]


def _members(values: Mapping[Any, Any]) -> Iterator[tuple[str, Mapping[Any, Any]]]:
    """The values of each member, with a word for it; of one number that varies, its least and its largest.

    Every check of a single number tests an interval, so its two ends suffice.
    """
    varied = {key: value for key, value in values.items() if isinstance(value, Each)}
    if not varied:
        if values:
            yield "", values
        return
    count = count_members(values) or 0
    rows = list(range(count))
    if len(varied) == 1:
        ((_, only),) = varied.items()
        if np.ndim(only.values) == 1:
            rows = sorted({int(np.argmin(only.values)), int(np.argmax(only.values))})
    for row in rows:
        yield f"member {row}", {key: member_of(value, row) for key, value in values.items()}


def _require_shape(name: str, value: Any, nominal: PyTree) -> None:
    """Raise ArgumentError for a number whose shape has changed."""
    given, wanted = (np.shape(v.values)[1:] if isinstance(v, Each) else np.shape(v) for v in (value, nominal))
    checks.shape(np.empty(given), f"The parameter `{name}`", wanted)


def _same(value: Any, nominal: PyTree) -> bool:
    if value is nominal:
        return True
    if any(isinstance(one, Each) for one in (value, nominal)) or traced(nominal):
        return False
    return np.shape(value) == np.shape(nominal) and bool(np.all(np.asarray(value) == np.asarray(nominal)))
