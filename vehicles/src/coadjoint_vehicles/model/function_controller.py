"""Any Python function as a controller: traced into the native kernel where it can be, else called from outside."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from coadjoint.arrays import PyTree, Scalar
from coadjoint.errors import ArgumentError, warn
from coadjoint.extending import traced
from coadjoint.spaces import Named
from coadjoint_vehicles.model.controller import Controller, Feedback
from coadjoint_vehicles.model.controller_mistakes import called
from coadjoint_vehicles.model.inputs_read import Read, require_read
from coadjoint_vehicles.model.vehicle import Vehicle

_TOLD: set[tuple[str, int]] = set()


@dataclass(frozen=True, eq=False, kw_only=True)
class FunctionController(Controller):
    """A function (feedback, p) → {part: command} as a controller, p being the parameters of the system.

    With `remembers`, numbers by name that it starts from, it is (feedback, memory, p) → (commands, memory) instead.
    Written with jax.numpy it becomes part of the native kernel. A function that needs numbers, for NumPy, `math`, `if`
    on feedback, or another library, is called from outside at every step: the run then uses XLA, warns of it, is
    slower, and has no derivatives. Its results must depend on its arguments only; it is called once on a craft at rest
    to find the shapes. A vehicle's inputs of any name reach it as `feedback.inputs`.
    """

    function: Callable[..., PyTree]
    remembers: Mapping[str, PyTree] | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        _require_arguments(self.function, ("feedback", "p") if self.remembers is None else ("feedback", "memory", "p"))

    def memory(self) -> dict[str, PyTree]:
        return dict(self.remembers or {})

    def steer(
        self, feedback: Feedback, memory: Named, own: Named, vehicle: Vehicle
    ) -> tuple[dict[str, PyTree], dict[str, PyTree]]:
        if isinstance(feedback.inputs, Named):
            feedback = feedback._replace(inputs=Read(**feedback.inputs.asdict()))
        arguments = (feedback, own) if self.remembers is None else (feedback, memory, own)
        try:
            found, read = self.function(*arguments), feedback.inputs
        except _needs_numbers():
            _tell(self.function)
            found, read = _from_outside(self.function, arguments, called(self))
        require_read(self.function, read, [part.name for part in vehicle.commanded], called(self))
        return found if self.remembers is not None else (found, {})

    def failure(self, t: Scalar, h: Scalar) -> str | None:
        """Why it gave no numbers in the step of length h from t, if it did not; for functions called from outside."""
        when, sentence = _FAILED.get(called(self), (np.inf, None))
        return sentence if abs(when - t) < 1.5 * abs(h) else None


_FAILED: dict[str, tuple[float, str]] = {}
"""By controller, the time and the message of its last failure in the current run."""


def _require_arguments(function: Callable[..., object], names: tuple[str, ...]) -> None:
    """Raise ArgumentError unless a function can be called with these."""
    if not callable(function):
        raise ArgumentError(f"Argument `function` of a controller must be a function ({', '.join(names)}).")
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):  # of a library in C: only a call shows it
        return
    try:
        signature.bind(*names)
    except TypeError:
        name = getattr(function, "__name__", type(function).__name__)
        raise ArgumentError(
            f"The controller `{name}` must be a function of ({', '.join(names)}), but takes {signature}."
        ) from None


def _tell(function: Callable[..., object]) -> None:
    """Warn, once for each function, that it goes round the native kernel."""
    name = getattr(function, "__name__", type(function).__name__)
    if (name, id(function)) not in _TOLD:
        _TOLD.add((name, id(function)))
        warn(
            f"The controller `{name}` has Python `if`, float() or NumPy on its arguments: it is called from "
            f"outside JAX at "
            "every step, which is slower, by XLA, and without derivatives. With jax.numpy alone, and "
            "jnp.where(feedback.depth > 2, a, b) for `if`, it becomes part of the native kernel.",
            stacklevel=2,
        )


def _from_outside(function: Callable[..., PyTree], arguments: tuple[PyTree, ...], name: str) -> tuple[PyTree, PyTree]:
    """The results of a function that takes only numbers, with their shapes at rest, and the inputs that it read."""
    resting = _at_rest(arguments)
    if isinstance(resting[0].inputs, Named):
        resting = (resting[0]._replace(inputs=Read(**resting[0].inputs.asdict())), *resting[1:])
    try:
        example = _numbers(function(*resting))
    except Exception as error:
        raise ArgumentError(
            f"The controller's function failed for a craft at rest and level: {type(error).__name__}: {error}"
        ) from error
    leaves, structure = jax.tree.flatten(example)
    _, given = jax.tree.flatten(arguments)
    shapes = [np.shape(leaf) for leaf in jax.tree.leaves(arguments)]

    expected = [leaf.shape for leaf in leaves]
    size = sum(leaf.size for leaf in leaves)
    _FAILED.pop(name, None)

    def call(bits: object) -> np.ndarray:
        numbers = given.unflatten(_split(np.ascontiguousarray(bits).view(np.float64).ravel(), shapes))
        return _row(function, numbers, name, (structure, expected, size)).view(np.uint32).reshape(-1, 2)

    # As pairs of 32 bits, since JAX takes callbacks' numbers for float32 on the threads that they run on.
    @jax.custom_jvp
    def outside(all_of: Any) -> PyTree:
        bits = jax.ShapeDtypeStruct((size, 2), np.uint32)
        asked = lax.bitcast_convert_type(all_of, jnp.uint32)
        return lax.bitcast_convert_type(jax.pure_callback(call, bits, asked, vmap_method="sequential"), jnp.float64)

    @outside.defjvp
    def refuse(primals: object, tangents: object) -> PyTree:
        raise ArgumentError(
            f"{name} is called from outside JAX and has no derivatives: write it with jax.numpy, and jnp.where for "
            "`if`, to differentiate a run through it."
        )

    all_of = jnp.concatenate([jnp.ravel(jnp.asarray(leaf, dtype=float)) for leaf in jax.tree.leaves(arguments)])
    return structure.unflatten(_split(outside(all_of), expected)), resting[0].inputs


def _row(
    function: Callable[..., PyTree], numbers: PyTree, name: str, expected: tuple[Any, list[PyTree], int]
) -> np.ndarray:
    """The results of a function as a row of float64 numbers; NaN, with a recorded reason, if it fails."""
    structure, shapes, size = expected
    try:
        leaves, found = jax.tree.flatten(_numbers(function(*numbers)))
    except Exception as error:
        first = (str(error).strip().split("\n") or [""])[0].rstrip(".")
        return _failed(name, numbers, f"failed: {type(error).__name__}: {first}", size)
    if found != structure or [leaf.shape for leaf in leaves] != shapes:
        return _failed(name, numbers, "returned other names or shapes than for a craft at rest", size)
    row = np.concatenate([np.ravel(leaf) for leaf in leaves]) if leaves else np.zeros(0)
    return row if np.all(np.isfinite(row)) else _failed(name, numbers, "returned numbers that are not finite", size)


def _failed(name: str, numbers: PyTree, what: str, size: int) -> np.ndarray:
    _FAILED[name] = (float(numbers[0].t), f"{name} {what}.")
    return np.full(size, np.nan)


def _split(numbers: PyTree, shapes: list[tuple[int, ...]]) -> list[PyTree]:
    """Arrays of these shapes from a row of numbers."""
    ends = np.cumsum([int(np.prod(shape, dtype=int)) for shape in shapes])
    return [
        numbers[end - int(np.prod(shape, dtype=int)) : end].reshape(shape)
        for end, shape in zip(ends.tolist(), shapes, strict=True)
    ]


def _at_rest(arguments: tuple[object, ...]) -> tuple[PyTree, ...]:
    """The same structure in numbers: level and at rest, and parameters unchanged, or 1 where they are traced."""
    feedback, *others = arguments
    still = jax.tree.map(lambda leaf: np.zeros(np.shape(leaf)), feedback)
    still = still._replace(down=np.array([0.0, 0.0, 1.0]), north=np.array([1.0, 0.0, 0.0]))
    return still, *(
        jax.tree.map(lambda leaf: np.ones(np.shape(leaf)) if traced(leaf) else np.asarray(leaf), other)
        for other in others
    )


def _numbers(found: object) -> PyTree:
    """Dictionaries of float64 arrays, without types unknown to JAX."""
    if isinstance(found, tuple):
        return tuple(_numbers(part) for part in found)
    if isinstance(found, (Mapping, Named)):
        parts = found.asdict() if isinstance(found, Named) else found
        return {str(name): _numbers(part) for name, part in parts.items()}
    return np.asarray(found, dtype=np.float64)


def _needs_numbers() -> tuple[type[Exception], ...]:
    """The errors of JAX for a function that needs numbers."""
    return (
        jax.errors.ConcretizationTypeError,
        jax.errors.TracerArrayConversionError,
        jax.errors.TracerBoolConversionError,
        jax.errors.TracerIntegerConversionError,
    )
