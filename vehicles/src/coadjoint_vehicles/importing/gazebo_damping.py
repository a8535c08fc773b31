"""Damping of Gazebo's system Hydrodynamics: stability derivatives by their names."""

from __future__ import annotations

import re

import numpy as np

from coadjoint.models.descriptions.elements import Element
from coadjoint.models.descriptions.frames import number
from coadjoint_vehicles.importing.draft import Draft, places
from coadjoint_vehicles.parts.damping import Damping
from coadjoint_vehicles.parts.derivatives import Derivatives

ROWS, COLUMNS = "xyzkmn", "UVWPQR"
_NAME = re.compile(r"([xyzkmn])([UVWPQR])(?:(abs)?([UVWPQR]))?")


def damping(draft: Draft, plugin: Element) -> None:
    """A part of damping by matrices, and one of derivatives for the remaining terms."""
    signs = np.concatenate([draft.flip, draft.flip])
    linear, quadratic = np.zeros((6, 6)), np.zeros((6, 6))
    others: dict[str, tuple[float, Element]] = {}
    read: dict[str, list[Element]] = {"linear": [], "quadratic": []}
    old = "systems::Hydrodynamics" not in plugin.attributes.get("name", "")
    for child in plugin.children:
        found = _NAME.fullmatch(child.tag)
        if found is None:
            continue
        child.taken = True
        value = number(child, child.text, f"<{child.tag}>")
        i, j = ROWS.index(found.group(1)), COLUMNS.index(found.group(2))
        k = None if found.group(4) is None else COLUMNS.index(found.group(4))
        size = found.group(3) is not None or (old and j == k)
        if k is None:
            linear[i, j] = -value * signs[i] * signs[j]
            read["linear"].append(child)
        elif size and j == k:
            quadratic[i, j] = -value * signs[i] * signs[j]
            read["quadratic"].append(child)
        elif value:
            name, sign = _derivative(i, j, k, size, signs)
            others[name] = (others.get(name, (0.0, child))[0] + sign * value, child)
    given = {
        key: draft.take(f"damping.{key}", matrix, "SI", places(read[key]), "with the other sign")
        for key, matrix in (("linear", linear), ("quadratic", quadratic))
        if np.any(matrix)
    }
    if given:
        draft.parts.append(Damping("damping", **given))
        _told(draft, plugin, linear, quadratic)
    if others:
        for name, (value, child) in others.items():
            draft.take(f"derivatives.{name}", value, "SI", child)
        draft.parts.append(Derivatives("derivatives", {name: value for name, (value, _) in others.items()}))


def _derivative(i: int, j: int, k: int, size: bool, signs: np.ndarray) -> tuple[str, float]:
    """The name and the sign here of a derivative by two velocities."""
    axis, first, second = "XYZKMN"[i], "uvwpqr"[j], "uvwpqr"[k]
    if size:
        return f"{axis}_{first}|{second}|", signs[i] * signs[j]
    pair = first + second if j <= k else second + first
    return f"{axis}_{pair}", signs[i] * signs[j] * signs[k]


def _told(draft: Draft, plugin: Element, linear: np.ndarray, quadratic: np.ndarray) -> None:
    """Report damping that drives."""
    for word, matrix in (("linear", linear), ("quadratic", np.diag(np.diag(quadratic)))):
        if np.linalg.eigvalsh(matrix + matrix.T)[0] < -1e-9:
            draft.differs(
                f"{plugin.place}: its {word} damping drives some motions, here as there: derivatives that brake are "
                "negative, xU and xUabsU."
            )
