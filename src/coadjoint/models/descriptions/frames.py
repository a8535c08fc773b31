"""Numbers, poses and inertias of elements."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from coadjoint.models.descriptions.elements import Element

LARGEST = 1e15
"""Numbers beyond it are mistakes in any unit."""

FLAGS = {"0": False, "0.0": False, "false": False, "1": True, "1.0": True, "true": True}


class Placement(NamedTuple):
    """R, (3, 3), and r, (3,) m: a point x of the inner frame is R x + r in the outer one."""

    R: np.ndarray
    r: np.ndarray

    def then(self, inner: Placement) -> Placement:
        """The pose of a frame whose pose in this one is `inner`."""
        return Placement(self.R @ inner.R, self.R @ inner.r + self.r)

    def back(self) -> Placement:
        """The pose of the outer frame in the inner one."""
        return Placement(self.R.T, -self.R.T @ self.r)

    def place(self, point: np.ndarray) -> np.ndarray:
        """R x + r of a point, (3,) both."""
        return self.R @ point + self.r


HERE = Placement(np.eye(3), np.zeros(3))


def rotation(roll: float, pitch: float, yaw: float) -> np.ndarray:
    """R_z(yaw) R_y(pitch) R_x(roll), (3, 3); rad."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(x), math.sin(x)) for x in (roll, pitch, yaw))
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def numbers(element: Element, text: str | None, count: tuple[int, ...], what: str) -> np.ndarray:
    """The finite numbers of a text, as many as one of `count`; raises FileError with file and line."""
    words = (text or "").split()
    try:
        found = np.array([float(word) for word in words])
    except ValueError:
        raise element.fail(f"{what} must be numbers, but is {_shown(text)}.") from None
    if len(found) not in count:
        expected = " or ".join(str(number) for number in count)
        raise element.fail(f"{what} must hold {expected} numbers, but has {len(found)}: {_shown(text)}.")
    if not np.all(np.isfinite(found)) or np.any(np.abs(found) > LARGEST):
        raise element.fail(f"{what} must be finite, but is {_shown(text)}.")
    return found


def number(element: Element, text: str | None, what: str) -> float:
    """One finite number."""
    return float(numbers(element, text, (1,), what)[0])


def number_in(element: Element, tag: str, default: float | None = None) -> float:
    """The number in a child element; without a default it must be there. An empty element means the default."""
    child = element.first(tag)
    if child is None or (default is not None and not child.text.strip()):
        if default is None:
            raise element.fail(f"needs <{tag}>.")
        return default
    return number(child, child.text, "its number")


def limit_of(element: Element, text: str | None, what: str) -> float | None:
    """The number of a limit; None where it is missing or infinite, as ±1e16 is in any unit."""
    word = (text or "").strip()
    try:
        endless = abs(float(word)) > LARGEST
    except ValueError:
        endless = not word
    return None if endless else number(element, text, what)


def text_in(element: Element, tag: str, default: str | None = None) -> str:
    """The text in a child element; without a default it must be there."""
    child = element.first(tag)
    if child is None or not child.text.strip():
        if default is None:
            raise element.fail(f"needs <{tag}>.")
        return default
    return child.text.strip()


def flag_in(element: Element, tag: str, default: bool) -> bool:
    """Whether a child element says true or 1, or 1.0."""
    word = text_in(element, tag, str(default)).lower()
    if word not in FLAGS:
        raise element.fail(f"<{tag}> must be true or false, but is {word!r}.")
    return FLAGS[word]


def origin(element: Element) -> Placement:
    """The pose of <origin xyz rpy> of URDF; zero offset without one."""
    child = element.first("origin")
    if child is None:
        return HERE
    xyz = numbers(child, child.get("xyz") or "0 0 0", (3,), "xyz")
    rpy = numbers(child, child.get("rpy") or "0 0 0", (3,), "rpy")
    return Placement(rotation(*rpy), xyz)


def inertia(element: Element, read: dict[str, float]) -> np.ndarray:
    """[[ixx, ixy, ixz], …], (3, 3) kg m²: the elements of the matrix, as URDF and SDF have them."""
    xx, xy, xz, yy, yz, zz = (read.get(key, 0.0) for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))
    found = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    least = float(np.linalg.eigvalsh(found)[0])
    if least < 0:
        raise element.fail(f"must be positive about every axis, but has the eigenvalue {least:g} kg m².")
    return found


def _shown(text: str | None) -> str:
    found = " ".join((text or "").split())
    return repr(found if len(found) <= 60 else found[:57] + "…")
