"""Checks of the arguments of filters and of model processes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError
from coadjoint.estimation.drifts import not_negative
from coadjoint.estimation.measurements import semidefinite
from coadjoint.estimation.numbers import numbers
from coadjoint.estimation.process import Process
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.method import Method
from coadjoint.spaces.space import require_affine, require_flat

WHOSE = "co.estimation.ModelProcess"


def sizes_of(shapes: PyTree) -> dict[str, int]:
    """Name → count of numbers, from (name, shape)."""
    return {name: int(np.prod(shape, dtype=int)) for name, shape in shapes}


def require_fit(method: Method, system: System, start: State, error: str) -> None:
    """Raise ArgumentError for methods, spaces and starts that a filter does not support."""
    checks.choice(error, f"Argument `error` of {WHOSE}", ("left", "right"))
    if method.variable or any(step.tolerant for step, _ in method.pattern):
        raise ArgumentError(f"A filter takes a method of fixed steps, such as co.Midpoint(), not {method.title}.")
    if not system.continuous:
        raise ArgumentError(
            "A filter's errors of velocities need their momenta by ℓ or ℋ, but this system has only a discrete "
            "Lagrangian: give co.System `lagrangian` as well."
        )
    if method.start == "velocity":
        raise ArgumentError(
            f"A filter's states are given by momenta, but {method.title} starts from velocities: take co.Midpoint()."
        )
    require_flat(system.additional, "A filter", "take one such as co.Defining()")
    require_affine(system.additional, "A filter", "take one such as co.Defining()")
    if np.ndim(start.t):
        raise ArgumentError("Argument `start` must be of one member: give `Filter` many covariances or starts instead.")


def roots_of_noise(given: Mapping[str, PyTree] | None, d: int, q: int) -> np.ndarray:
    """Roots of densities, (dim G + dim Q,)."""
    given, found = given or {}, []
    checks.all_known(given, ("torque", "force"), "part", "`noise`")
    for name, size in (("torque", d), ("force", q)):
        value = not_negative(given.get(name, 0.0), name, "`noise`")
        if name in given and not size:
            lacks = "of a trivial group" if name == "torque" else "without `additional`"
            raise ArgumentError(f"`noise` gives `{name}`, but this system is {lacks}, so that it acts on nothing.")
        checks.shape(value, f"`{name}` of `noise`", (), (size,))
        found.append(np.broadcast_to(value, (size,)))
    return np.concatenate(found)


def array(value: Any, name: str, shape: tuple[int, ...]) -> np.ndarray:
    """Rows or covariances of a filter, in the order of C; raises ArgumentError if they do not fit."""
    if not isinstance(value, np.ndarray) or value.dtype != float or value.shape != shape:
        raise ArgumentError(
            f"`{name}` of a filter must be a float64 array of the shape {shape}, but its shape is {np.shape(value)}."
        )
    return np.ascontiguousarray(value)


def first_covariance(process: Process, row: np.ndarray, deviations: PyTree, covariance: PyTree) -> np.ndarray:
    if (deviations is None) == (covariance is None):
        raise ArgumentError("Give a filter either `deviations` or `covariance` of its errors at the start.")
    if covariance is None:
        return process.admitted(row[None], process.first_covariance(row, deviations)[None])[0]
    P = numbers(covariance)
    checks.expect(
        P.shape == (process.width, process.width) and semidefinite(P),
        covariance,
        "covariance",
        f"a symmetric matrix ({process.width}, {process.width}) without negative eigenvalues, of the errors "
        f"{', '.join(process.error_sizes)}",
    )
    return process.admitted(row[None], 0.5 * (P + P.T)[None])[0]


def inputs_of_step(process: Process, inputs: PyTree, awaited: set[str]) -> dict[str, PyTree]:
    """The inputs of one step, name → value; raises ArgumentError for other names, and without one that is awaited."""
    if inputs is not None:
        checks.instance(inputs, "inputs", Mapping, "name → value")
    given = dict(inputs or {})
    for name in given:
        checks.known(name, process.input_sizes, "input", "The process")
    for name in awaited - set(given):
        raise ArgumentError(f"There is no step without a reading of `{name}`: give inputs={{{name!r}: …}}.")
    return given
