"""Physical quantities as arguments of models: checked once, with an error for impossible values."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, PyTree
from coadjoint.checks import array, float64
from coadjoint.errors import ArgumentError
from coadjoint.kernels.trace.evaluate import traced
from coadjoint.mechanics.members import Each, each, member_of

LONGEST = 1000.0
"""m: no vehicle is so long."""
TURNS = 1000
"""Angles beyond so many turns are taken for a mistake in their unit."""
SYMMETRIC = 1e-9
"""How far a matrix may differ from its transpose, relative to its largest entry."""
SINGULAR = 1e-13
"""Up to this fraction of the largest eigenvalue, an eigenvalue counts as zero."""


Check = Callable[[PyTree, str], PyTree]
"""(value, name) → the value in its final form, or ArgumentError."""


def checked(checks: Mapping[str, Check], given: Mapping[str, object]) -> dict[str, PyTree]:
    """Values after the checks of their names, a model's own and those that replace them; raises ArgumentError."""
    return {name: _checked(checks[name], value, name) if name in checks else value for name, value in given.items()}


def _checked(check: Check, value: object, name: str) -> PyTree:
    if not isinstance(value, Each):
        return check(value, name)
    return each([check(member_of(value, member), f"{name}` of member `{member}") for member in range(len(value))])


def number(value: object, name: str, at_least: float | None = None) -> Array:
    """A finite number; raises ArgumentError, also for a number below `at_least`."""
    found = array(value, name, ())
    if at_least is not None and not traced(found) and found < at_least:
        raise ArgumentError(f"Argument `{name}` must be at least {at_least:g}, but is {float(found):g}.")
    return found


def not_negative(value: object, name: str) -> Array:
    """One number, at least 0; raises ArgumentError."""
    return number(value, name, at_least=0.0)


def positive(value: object, name: str) -> Array:
    """One number, positive and finite; raises ArgumentError."""
    found = number(value, name)
    if not traced(found) and found <= 0:
        raise ArgumentError(f"Argument `{name}` must be positive, but is {float(found):g}.")
    return found


def positive_pair(value: object, name: str) -> PyTree:
    """Two positive numbers, (2,); raises ArgumentError."""
    found = vector(value, name, 2)
    for one in () if traced(found) else found:
        positive(one, name)
    return found


def angles(value: object, name: str) -> PyTree:
    """Angles, rad, of at most `TURNS` turns; raises ArgumentError."""
    found = float64(value, f"Argument `{name}`")
    most = 0.0 if traced(found) else float(np.max(np.abs(found), initial=0.0))
    if most > 2 * np.pi * TURNS:
        raise ArgumentError(
            f"Argument `{name}` must be of at most {TURNS} turns, but has {most:.6g} rad, {most / (2 * np.pi):.6g} "
            "turns: is its unit right?"
        )
    return found


def vector(value: object, name: str, size: int = 3) -> Array:
    """A finite vector (size,); raises ArgumentError."""
    return array(value, name, (size,))


def place(value: object, name: str) -> PyTree:
    """A point of a vehicle, (3,) m, up to `LONGEST` from the origin; raises ArgumentError."""
    found = vector(value, name)
    distance = 0.0 if traced(found) else float(np.linalg.norm(found))
    if distance > LONGEST:
        raise ArgumentError(
            f"Argument `{name}` must be a point of the vehicle, but is {distance:.3g} m from the origin: check its "
            "unit."
        )
    return found


def matrix(value: object, name: str, size: int = 3) -> Array:
    """A finite matrix (size, size); raises ArgumentError."""
    return array(value, name, (size, size))


def direction(value: object, name: str, size: int = 3) -> Array:
    """A unit vector (size,); raises ArgumentError."""
    found = vector(value, name, size)
    length = 1.0 if traced(found) else float(np.linalg.norm(found))
    if abs(length - 1) > 1e-9:
        raise ArgumentError(f"Argument `{name}` must be a unit vector, but has length {length:.6g}; divide by it.")
    return found


def positive_definite(value: Any, name: str, size: int = 3) -> Array:
    """A symmetric positive definite matrix (size, size), or its diagonal (size,); raises ArgumentError."""
    found = _symmetric(value, name, size)
    if traced(found):
        return found
    eigenvalues, vectors = np.linalg.eigh(found)
    if abs(eigenvalues[0]) <= SINGULAR * np.max(np.abs(eigenvalues)):
        axis = np.round(vectors[:, 0], 3).tolist()
        raise ArgumentError(
            f"Argument `{name}` must be positive definite, but is singular: it gives no inertia along {axis}."
        )
    if eigenvalues[0] < 0:
        raise ArgumentError(
            f"Argument `{name}` must be positive definite, but has the eigenvalue {eigenvalues[0]:.6g}."
        )
    return found


def positive_semidefinite(value: Any, name: str, size: int = 3) -> Array:
    """A symmetric matrix (size, size) without negative eigenvalues, or its diagonal (size,); raises ArgumentError.

    For added mass, which may vanish: a body of revolution moves no fluid when it rolls.
    """
    found = _symmetric(value, name, size)
    if traced(found):
        return found
    eigenvalues = np.linalg.eigvalsh(found)
    if eigenvalues[0] < -SINGULAR * np.max(np.abs(eigenvalues)):
        raise ArgumentError(
            f"Argument `{name}` must have no negative eigenvalue, but has {eigenvalues[0]:.6g}: added mass is positive "
            "here, the negative of derivatives such as X_u̇."
        )
    return found


def _symmetric(value: Array, name: str, size: int) -> Array:
    found = array(value, name, (size, size), (size,))
    if np.shape(found) == (size,):
        return jnp.diag(found) if traced(found) else np.diag(found)
    if not traced(found):
        skew = float(np.max(np.abs(found - found.T)))
        if skew > SYMMETRIC * float(np.max(np.abs(found))):
            raise ArgumentError(
                f"Argument `{name}` must be symmetric, but differs from its transpose by {skew:.3g}; use "
                f"({name} + {name}.T) / 2 if that is what you mean."
            )
    return found
