"""Forces that a system names one by one, and what they must return."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, PyTree
from coadjoint.errors import CoadjointError, LagrangianError
from coadjoint.groups import LieGroup, Power
from coadjoint.mechanics.signatures import require_signature
from coadjoint.mechanics.state import Force, Places
from coadjoint.portable import Portable
from coadjoint.spaces import Several, Space
from coadjoint.spaces.named import Named

UNNAMED = "forces"
TIME, INPUTS, INTERNAL = "time", "inputs", "internal"
"""The lines of an energy budget for explicit time and for jumps of held inputs and internal states; reserved names."""


@dataclass(frozen=True)
class Forces(Portable):
    """Functions (motion [, p]) → Force(torque, force) under names; the system's force is their sum."""

    names: tuple[str, ...]
    functions: tuple[Callable[..., Force], ...]

    def __iter__(self):
        return iter(zip(self.names, self.functions, strict=True))

    def each(self, places: Places, *arguments: object) -> list[tuple[Array, Array]]:
        """(T, f) of every function, (dim G,) and (ambient,); raises LagrangianError unless it returns a force."""
        return [_checked(places, name, _called(name, function, arguments)) for name, function in self]


def forces_from(given: Any, parameters: bool) -> Forces | None:
    """The `forces` of a system: one function, or a dictionary of them; raises LagrangianError."""
    if given is None or isinstance(given, Forces):
        return given
    functions = dict(given) if isinstance(given, Mapping) else {UNNAMED: given}
    if not functions:
        raise LagrangianError("The dictionary `forces` is empty: leave it out, or name at least one force.")
    for name, function in functions.items():
        fits = isinstance(name, str) and name.isidentifier() and (name not in (TIME, INPUTS, INTERNAL))
        checks.expect(
            fits,
            name,
            "The name of a force",
            "a word such as 'drag', other than `time`, `inputs` and `internal`",
            LagrangianError,
        )
        what = "The forces" if function is given else f"The force `{name}`"
        require_signature(function, what, ["motion", *(["p"] if parameters else [])])
    return Forces(tuple(functions), tuple(functions.values()))


def _whose(name: str) -> str:
    return "`forces`" if name == UNNAMED else f"The force `{name}`"


def _called(name: str, function: Callable[..., Force], arguments: tuple[PyTree, ...]) -> PyTree:
    """The value of a force; missing inputs raise an error that says so."""
    try:
        return function(*arguments)
    except (AttributeError, TypeError) as error:
        read = f"`{error.name}` of None" if isinstance(error, AttributeError) and error.obj is None else None
        if str(error) == "'NoneType' object is not subscriptable":
            read = "an entry of None"
        if read is not None and arguments[0].inputs is None:
            raise LagrangianError(
                f"{_whose(name)} reads {read}, and the run has no inputs: if it is an input, give `inputs` to "
                "co.simulate or co.trajectory, or constants to system.state."
            ) from error
        raise


def _checked(places: Places, name: str, returned: object) -> tuple[Array, Array]:
    whose = _whose(name)
    if not isinstance(returned, Force):
        raise LagrangianError(f"{whose} must return co.Force(torque=…, force=…), but returned {_shown(returned)}.")
    group, Q, _ = places
    of = "" if name == UNNAMED else f" of `{name}`"
    torque = _covector(group, "torque", returned.torque, group.dim, None, of)
    return torque, _covector(group, "force", returned.force, Q.ambient(group), Q, of)


def _covector(group: LieGroup, name: str, value: object, size: int, space: Space | None, of: str) -> Array:
    """A torque, or a force on a space, as a flat array; on several spaces from the parts by their names."""
    if value is None:
        return jnp.zeros(size)
    what = f"The {name} of co.Force{of}"
    if isinstance(value, (Named, Mapping)):
        parts = value.asdict() if isinstance(value, Named) else value
        spaces = dict(zip(space.names, space.factors, strict=True)) if isinstance(space, Several) else {}
        if set(parts) != set(spaces):
            expected = f"the parts {', '.join(spaces)}" if spaces else f"one array of shape ({size},)"
            raise LagrangianError(f"{what} must have {expected}, but has the parts {', '.join(map(str, parts))}.")
        return jnp.concatenate(
            [_covector(group, f"{name}.{key}", parts[key], s.ambient(group), s, of) for key, s in spaces.items()]
        )
    array = _array(what, value)
    if isinstance(group, Power) and np.ndim(array) == 2 and np.shape(array) == (group.count, size // group.count):
        array = jnp.reshape(array, -1)
    if np.shape(array) != (size,):
        where = "; this system has no additional dynamics that a force could act on" if size == 0 else ""
        raise LagrangianError(f"{what} must have shape ({size},), but has shape {np.shape(array)}{where}.")
    return array


def _array(what: str, value: object) -> Array:
    """A covector as an array of real numbers."""
    try:
        if isinstance(value, (list, tuple)):
            value = jnp.stack([jnp.asarray(part) for part in value]) if value else np.zeros(0)
        array = jnp.asarray(value)
    except CoadjointError:
        raise
    except (TypeError, ValueError) as error:
        raise LagrangianError(f"{what} must be an array of numbers, but is {_shown(value)}.") from error
    if array.dtype.kind not in "fiu" and not jnp.issubdtype(array.dtype, jnp.floating):
        raise LagrangianError(f"{what} must be an array of real numbers, but is one of {array.dtype}.")
    return array if jnp.issubdtype(array.dtype, jnp.floating) else array.astype(float)


def _shown(value: Any) -> str:
    """A value in words; of an array that JAX traces the shape, not the name of its class."""
    if hasattr(value, "shape"):
        return f"an array of shape {value.shape}"
    text = repr(value)
    return text if len(text) < 60 and "Tracer" not in text else f"a {type(value).__name__}"
