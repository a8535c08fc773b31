"""Parameters that replace others go through the checks of what they belong to: body, parts, controller and water."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import is_dataclass, replace
from typing import Any

import numpy as np

from coadjoint.errors import ArgumentError
from coadjoint.kernels.trace.evaluate import traced
from coadjoint.mechanics.each import Each, count_members, member_of
from coadjoint.vehicles.parts.thrusters import Thrusters

FIXED = ("inertia", "added_mass", "allocation", "positions", "directions")
"""Arrays whose shape others count on: a diagonal is no matrix here."""


def require_possible(owners: Mapping[str, Any], changes: Mapping[str, Any]) -> None:
    """Raise ArgumentError unless each owner of parameters can be built with its changes, for every member.

    owners: by the prefix of their parameters, as `rudder` of `rudder_area`. What is being traced is not looked at.
    """
    for prefix, owner in owners.items():
        known = {f"{prefix}_{key}": key for key in owner.parameters()}
        found = {key: changes[name] for name, key in known.items() if name in changes}
        require_buildable(owner, owner.parameters(), found, f"{prefix}_")


def require_buildable(owner: Any, nominal: Mapping[str, Any], changes: Mapping[str, Any], prefix: str = "") -> None:
    """Raise ArgumentError unless this dataclass, whose numbers are `nominal`, can be built with the changes."""
    new = {key: value for key, value in changes.items() if not traced(value) and not _same(value, nominal[key])}
    for key, value in new.items():
        if getattr(owner, key, None) is not nominal[key] or key in FIXED:
            _require_shape(prefix + key, value, nominal[key])
    build = _builder(owner, nominal)
    for which, values in _members(new):
        try:
            build(values)
        except ArgumentError as error:
            raise ArgumentError(f"Of {which}: {error}" if which else str(error)) from error


def _builder(owner: Any, nominal: Mapping[str, Any]) -> Callable[[Mapping[str, Any]], Any]:
    """What builds the owner again; numbers that are no field of its own are those of a curve, or need no check."""

    def build(values: Mapping[str, Any]) -> None:
        own = {key: value for key, value in values.items() if getattr(owner, key, None) is nominal[key]}
        rest = {key: value for key, value in values.items() if key not in own}
        if isinstance(owner, Thrusters) and rest:
            own["curve"] = replace(owner.curve, **rest)
        if own and is_dataclass(owner):
            replace(owner, **own)  # pyright: ignore[reportArgumentType]

    return build


def _members(values: Mapping[str, Any]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """The values of each member, with a word for it; of one number that varies, its least and its largest.

    Every check of one number asks for an interval, so that the two ends tell of all between.
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


def _require_shape(name: str, value: Any, nominal: Any) -> None:
    """Raise ArgumentError for a number whose shape is not what it was."""
    if isinstance(nominal, Mapping):
        return
    given, wanted = (np.shape(v.values)[1:] if isinstance(v, Each) else np.shape(v) for v in (value, nominal))
    if given != wanted:
        expected = "one number" if wanted == () else f"of shape {wanted}"
        raise ArgumentError(f"The parameter `{name}` must be {expected}, but has shape {given}.")


def _same(value: Any, nominal: Any) -> bool:
    if value is nominal:
        return True
    if any(isinstance(one, (Each, Mapping)) for one in (value, nominal)) or traced(nominal):
        return False
    return np.shape(value) == np.shape(nominal) and bool(np.all(np.asarray(value) == np.asarray(nominal)))
