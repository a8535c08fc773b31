"""Failures of a controller, each as one sentence that names it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError, CoadjointError, nearest
from coadjoint.extending import Untraceable
from coadjoint.spaces import Named
from coadjoint_vehicles.model.controller import Controller, Feedback

_UNKNOWN = re.compile(r"There is no `(\w+)` here; there is: (.*)\.$")


def steer(
    controller: Controller, feedback: Feedback, memory: PyTree, own: PyTree, vehicle: Any
) -> tuple[dict[str, PyTree], dict[str, PyTree]]:
    """The commands and the memory of the controller; raises ArgumentError for any failure inside it."""
    try:
        found = controller.steer(feedback, memory, own, vehicle)
    except (CoadjointError, Untraceable):
        raise
    except Exception as error:
        if "dtype promotion" in str(error):  # float32, which is reported elsewhere
            raise
        raise ArgumentError(f"{called(controller)} {_what(error, feedback)}") from error
    return _require_memory(controller, found)


def _require_memory(controller: Controller, found: Any) -> tuple[dict[str, PyTree], dict[str, PyTree]]:
    """Raise ArgumentError unless a controller returned commands, and a memory with the names that it began with."""
    if not isinstance(found, tuple) or len(found) != 2:
        raise ArgumentError(
            f"{called(controller)} must return (commands, memory), but returned {type(found).__name__}."
        )
    commands, memory = found
    begun = set(controller.memory())
    if not isinstance(memory, (Mapping, Named)):
        raise ArgumentError(f"{called(controller)} must return its memory as a dictionary, but returned {memory!r}.")
    if set(memory) != begun:
        wanted, name = ", ".join(sorted(begun)) or "nothing", sorted(set(memory) ^ begun)[0]
        what = "returned" if name in memory else "did not return"
        raise ArgumentError(
            f"{called(controller)} {what} `{name}` in its memory, but begins with {wanted}: match the two."
        )
    return commands, dict(memory) if isinstance(memory, Mapping) else memory.asdict()


def called(controller: Any) -> str:
    """A controller in words: the name of its function, or of its class."""
    function = getattr(controller, "function", None)
    name = getattr(function, "__name__", "") if function is not None else type(controller).__name__
    return f"The controller `{name}`" if name and name != "<lambda>" else "The controller"


def _what(error: Exception, feedback: Feedback) -> str:
    first = (str(error).strip().split("\n") or [""])[0]
    missing = _UNKNOWN.search(first)
    if isinstance(error, AttributeError) and isinstance(error.obj, Feedback):
        return _asks(str(error.name), [*Feedback._fields, "g", "q"], "its feedback")
    if isinstance(error, AttributeError) and missing is not None:
        return _asks(missing.group(1), missing.group(2).split(", "), "what it is given")
    if type(error).__module__.startswith("jax"):
        return (
            "has Python `if`, float() or NumPy on its arguments, which have no values while it is compiled: write "
            "jnp.where(feedback.depth > 2, a, b) and jax.numpy, or give a plain function (feedback, p), which "
            "is called from "
            "outside."
        )
    inputs = feedback.inputs.asdict() if isinstance(feedback.inputs, Named) else {}
    shaped = [f"`{name}` has shape {np.shape(value)}" for name, value in inputs.items() if np.shape(value) != ()]
    said = f"{type(error).__name__}: {first.rstrip('.')}"
    if shaped:
        return f"failed where of its inputs {', '.join(shaped)}: give one number, or a signal of numbers ({said})."
    return f"failed: {said}."


def _asks(name: str, known: list[str], whom: str) -> str:
    near = nearest(name, known)
    hint = f"did you mean `{near}`? It has" if near else "it has"
    return f"asks {whom} for `{name}`, which is not there: {hint} {', '.join(known)}."
