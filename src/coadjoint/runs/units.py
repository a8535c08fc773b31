"""Units in the key names of run files: `duration_min = 10` is `duration` in SI units."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from difflib import get_close_matches
from typing import Any

from coadjoint.errors import ArgumentError
from coadjoint.units import Dimension, dimension_of, factor_to, split_name, times


def in_si(
    section: str, given: Mapping[str, Any], known: Collection[str], kinds: Mapping[str, Dimension | None]
) -> dict[str, Any]:
    """The values of a section under their known names, in SI units.

    `known`: the names of the section; `kinds`: what those measure of which it is known, None for what has SI units
    only. Raises ArgumentError for an unknown key, naming the nearest known one, for a unit of another kind, and for a
    value given twice.
    """
    found: dict[str, Any] = {}
    for key, value in given.items():
        name, unit = split_name(key, known)
        if name not in known:
            raise ArgumentError(unknown(f"key `{key}`", f"Section [{section}]", key, known))
        if name in found:
            raise ArgumentError(f"Section [{section}] gives `{name}` twice: once as `{key}`, once in another unit.")
        found[name] = value if not unit else _converted(section, key, value, unit, name, kinds)
    return found


def _converted(section: str, key: str, value: Any, unit: str, name: str, kinds: Mapping[str, Dimension | None]) -> Any:
    wanted = kinds.get(name, dimension_of(unit))
    _require_numbers(f"[{section}] {key}", value)
    try:
        if wanted is not None:
            return times(value, factor_to(wanted, unit, key))
    except ArgumentError:
        pass
    raise ArgumentError(
        f"Key `{key}` of section [{section}] ends in a unit of {dimension_of(unit).word}, but `{name}` measures "
        f"{wanted.word if wanted else 'what is in SI units only'}."
    )


def without_unit(key: str) -> str:
    """A key name without the unit that it ends in."""
    return split_name(key)[0]


def unknown(what: str, where: str, given: str, known: Collection[str]) -> str:
    """The sentence for a name that is not known, with the nearest one that is."""
    near = get_close_matches(given, list(known), n=1, cutoff=0.5)
    listed = ", ".join(sorted(known))
    if not listed:
        return f"{where} has no {what}: it has none."
    hint = f"did you mean `{near[0]}`? It knows {listed}." if near else f"it knows {listed}."
    return f"{where} has no {what}: {hint}"


def letters(name: str) -> str:
    """The letters and digits of a name in lower case, by which `left-rectangle` is `LeftRectangle`."""
    return "".join(letter for letter in name.lower() if letter.isalnum())


def _require_numbers(what: str, value: Any) -> None:
    if isinstance(value, list):
        for inner in value:
            _require_numbers(what, inner)
    elif isinstance(value, (bool, str)) or not hasattr(value, "__rmul__"):  # co.each can be multiplied, too
        raise ArgumentError(f"{what} must hold numbers, because its name ends in a unit, but holds {value!r}.")
