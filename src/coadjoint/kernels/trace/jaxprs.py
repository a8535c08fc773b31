"""JAX's internals as far as the library uses them: the form of jaxprs, and the meaning of the parameters of primitives.

No other file than this and `primitives.py` imports `jax.core`, `jax.extend` or `jax.interpreters`. It holds for JAX
0.10, 0.11 and 0.12, whose jaxprs differ: counts of carried values therefore come from the inputs and outputs of a body,
not from parameters. A form that is unknown here raises UnknownVersion, so that the program runs by XLA.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax._src import config, xla_bridge
from jax.core import Tracer as Tracer
from jax.extend import core
from jax.interpreters import partial_eval

from coadjoint.arrays import PyTree
from coadjoint.kernels.trace.parameters import unknown_parameters
from coadjoint.kernels.trace.plain import PlainNumber, PlainProgram
from coadjoint.kernels.untraceable import UnknownVersion
from coadjoint.postponed import loaded

Atom = Any
"""A variable of a jaxpr, or a number that stands in its place."""


def jaxpr_of(function: Callable, *args: object) -> tuple[PyTree, PyTree]:
    """The jaxpr of a pure function of PyTrees of arrays, with its constants, and the structure of its result.

    Floats of any width count as float64; the user's JAX configuration stays unchanged.
    """
    shapes = jax.tree_util.tree_map(_shape, args)
    with jax.enable_x64(True):
        closed, result = jax.make_jaxpr(function, return_shape=True)(*shapes)
        return lowered(closed), jax.tree_util.tree_structure(result)


def lowered(jaxpr: object) -> Any:
    """A jaxpr whose high-level primitives, which hold Python functions since JAX 0.11, are replaced by plain ones."""
    lower = getattr(partial_eval, "lower_jaxpr2", None)
    return lower(jaxpr) if lower and getattr(jaxpr, "is_high", False) else jaxpr


def _shape(leaf: PyTree) -> jax.ShapeDtypeStruct:
    dtype = np.dtype(getattr(leaf, "dtype", type(leaf)))
    return jax.ShapeDtypeStruct(np.shape(leaf), np.float64 if dtype.kind in "fO" else dtype)


def depends(function: Callable, *args: object) -> list[bool]:
    """For each leaf of the arguments whether the traced function uses it for its result."""
    closed, _ = jaxpr_of(function, *args)
    return list(partial_eval.dce_jaxpr(closed.jaxpr, [True] * len(closed.jaxpr.outvars))[1])


def used_by_each(function: Callable, *args: object) -> list[list[bool]]:
    """As `depends`, for each leaf of the result."""
    jaxpr = jaxpr_of(function, *args)[0].jaxpr
    results = len(jaxpr.outvars)
    return [list(partial_eval.dce_jaxpr(jaxpr, [i == k for i in range(results)])[1]) for k in range(results)]


def trace_context() -> object:
    """The settings of JAX that hold here and change traces, hashable; None if this JAX does not show them."""
    if not loaded("jax"):
        return "as JAX begins"
    shown = getattr(config, "trace_context", None)
    return None if shown is None else shown()


def xla_has_begun() -> bool:
    """Whether XLA has started its threads in this process; False if this JAX does not show it."""
    if not loaded("jax"):
        return False
    started = getattr(xla_bridge, "backends_are_initialized", None)
    return started is not None and started()


def is_jaxpr(value: object) -> bool:
    """Whether this is a jaxpr, with its own constants or without."""
    return isinstance(value, PlainProgram) or (loaded("jax") and isinstance(value, (core.ClosedJaxpr, core.Jaxpr)))


def constants(jaxpr: object) -> list[PyTree]:
    """The values of the constants of a jaxpr; an open one has none."""
    return list(getattr(jaxpr, "consts", ()))


@dataclass(frozen=True, slots=True)
class Variables:
    """The atoms of a jaxpr: the variables of its constants and inputs, and its results."""

    constants: Sequence[Atom]
    inputs: Sequence[Atom]
    outputs: Sequence[Atom]


def variables(jaxpr: object) -> Variables:
    """The variables of a jaxpr's constants and inputs, and the atoms of its outputs."""
    inner = opened(jaxpr)
    return Variables(inner.constvars, inner.invars, inner.outvars)


def results(jaxpr: object) -> list[jax.ShapeDtypeStruct]:
    """Shapes and types of the results of a jaxpr."""
    return [jax.ShapeDtypeStruct(shape(atom), dtype(atom)) for atom in variables(jaxpr).outputs]


def equations(jaxpr: object) -> Iterator[Equation]:
    """The equations of a jaxpr in the order in which they are computed."""
    return map(Equation, opened(jaxpr).eqns)


def inner_jaxprs(parameters: Mapping[str, object]) -> list[object]:
    """The jaxprs among the parameters of an equation, also those in tuples."""
    rows = (value if isinstance(value, (tuple, list)) else (value,) for value in parameters.values())
    return [value for row in rows for value in row if is_jaxpr(value)]


def opened(jaxpr: object) -> Any:
    """A jaxpr without the values of its constants."""
    return getattr(jaxpr, "jaxpr", jaxpr)  # from 0.11 a jaxpr holds its constants and is its own `.jaxpr`


def number(atom: Atom) -> np.ndarray | None:
    """The number that stands in the place of a variable, or None."""
    known = isinstance(atom, PlainNumber) or (loaded("jax") and isinstance(atom, core.Literal))
    return np.asarray(atom.val, dtype(atom)) if known else None


def dtype(atom: Atom) -> Any:
    """The type of the elements of a variable; None unless it is an array."""
    return getattr(atom.aval, "dtype", None)


def shape(atom: Atom) -> tuple[int, ...]:
    """The shape of a variable."""
    return atom.aval.shape


def type_name(atom: Atom) -> str:
    """Type and shape of a variable in short, as `f64[3]`."""
    return _short(atom.aval)


@lru_cache(maxsize=4096)
def _short(aval: Any) -> str:
    return aval.str_short()


class EquationParameters(dict[str, Any]):
    """The parameters of an equation; one that is missing is reported as a difference of versions."""

    def __init__(self, primitive: str, given: Mapping[str, Any]):
        super().__init__(given)
        self.primitive = primitive

    def __missing__(self, name: str) -> Any:
        raise unknown(self.primitive, f"no parameter `{name}`, which coadjoint reads")

    def choice(self, name: str) -> str:
        """The name of a parameter that is one of an enumeration of JAX."""
        return str(getattr(self[name], "name", self[name]))

    def fields(self, name: str) -> _Fields:
        """A parameter that has fields, as the dimension numbers of a gather."""
        return _Fields(self.primitive, name, self[name])


class _Fields:
    """A parameter's fields; one that is missing is reported."""

    def __init__(self, primitive: str, name: str, value: Any):
        self._place, self._value = (primitive, name), value

    def __getattr__(self, field: str) -> Any:
        try:
            return getattr(self._value, field)
        except AttributeError:
            primitive, name = self._place
            raise unknown(primitive, f"a `{name}` without `{field}`, which coadjoint reads") from None


def unknown(primitive: str, what: str) -> UnknownVersion:
    """The error for a primitive with a property of this version of JAX that is unknown here."""
    return UnknownVersion(primitive, f"JAX {jax.__version__} gives it {what}")


class Equation:
    """One operation: `inputs` are atoms, `outputs` variables; `several`: whether it returns a list."""

    __slots__ = ("inputs", "name", "outputs", "parameters", "several")

    def __init__(self, equation: Any):
        self.name: str = equation.primitive.name
        self.parameters = EquationParameters(self.name, equation.params)
        self.inputs: Sequence[Atom] = equation.invars
        self.outputs: Sequence[Atom] = equation.outvars
        self.several: bool = equation.primitive.multiple_results

    def require_known(self) -> None:
        """Raise UnknownVersion if an unknown parameter may change the meaning of the primitive."""
        for name in unknown_parameters(self.name, tuple(self.parameters)):
            value = self.parameters[name]
            if not (value is None or value is False or value == ()):
                raise unknown(self.name, f"a parameter `{name}`, which coadjoint does not know")


def traced_by_kinds(function: Callable[..., PyTree]) -> Callable[..., PyTree]:
    """A pure function of PyTrees of arrays that JAX traces once for each structure, shape and type of its arguments.

    Its operations are those of the caller's transformation: unlike jax.jit it puts no compiled call around them, in
    whose transpose XLA cannot compile calls of the host.
    """
    known: dict[object, tuple[Callable[..., Any], Any]] = {}

    def replayed(*arguments: PyTree) -> PyTree:
        leaves, structure = jax.tree.flatten(arguments)
        leaves = [jnp.asarray(leaf) for leaf in leaves]
        key = structure, tuple((leaf.shape, leaf.dtype) for leaf in leaves)
        if key not in known:
            kinds = [jax.ShapeDtypeStruct(leaf.shape, leaf.dtype) for leaf in leaves]
            jaxpr, like = jax.make_jaxpr(lambda *leaves: function(*structure.unflatten(leaves)), return_shape=True)(
                *kinds
            )
            known[key] = core.jaxpr_as_fun(jaxpr), jax.tree.structure(like)
        run, result = known[key]
        return result.unflatten(run(*leaves))

    return replayed
