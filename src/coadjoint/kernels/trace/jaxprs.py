"""What the library knows of JAX's inside: how jaxprs are written, and what the parameters of their primitives mean.

No other file imports `jax.core`, `jax.extend` or `jax.interpreters`. It holds for JAX 0.10, 0.11 and 0.12, whose jaxprs
differ: counts of carried values therefore come from the inputs and outputs of a body, not from parameters. What a
version writes in another way than is known here raises UnknownVersion, so that the program goes to XLA.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax._src import xla_bridge
from jax.core import ShapedArray
from jax.core import Tracer as Tracer
from jax.extend import core
from jax.interpreters import ad, batching, mlir, partial_eval

from coadjoint.kernels.untraceable import UnknownVersion

Atom = Any
"""A variable of a jaxpr, or a number that stands in its place."""


def jaxpr_of(function: Callable, *args: Any) -> tuple[Any, Any]:
    """The jaxpr of a pure function of PyTrees of arrays, with its constants, and the structure of its result.

    Floats of any width count as float64; the user's JAX configuration stays as it is.
    """
    shapes = jax.tree_util.tree_map(_shape, args)
    with jax.enable_x64(True):
        closed, result = jax.make_jaxpr(function, return_shape=True)(*shapes)
        return lowered(closed), jax.tree_util.tree_structure(result)


def lowered(jaxpr: Any) -> Any:
    """A jaxpr whose high primitives, which hold Python functions since JAX 0.11, are written out in plain ones."""
    lower = getattr(partial_eval, "lower_jaxpr2", None)
    return lower(jaxpr) if lower and getattr(jaxpr, "is_high", False) else jaxpr


def _shape(leaf: Any) -> jax.ShapeDtypeStruct:
    dtype = np.dtype(getattr(leaf, "dtype", type(leaf)))
    return jax.ShapeDtypeStruct(np.shape(leaf), np.float64 if dtype.kind in "fO" else dtype)


def depends(function: Callable, *args: Any) -> list[bool]:
    """For each leaf of the arguments whether the function, as it is traced, uses it for its result."""
    closed, _ = jaxpr_of(function, *args)
    return list(partial_eval.dce_jaxpr(closed.jaxpr, [True] * len(closed.jaxpr.outvars))[1])


def xla_has_begun() -> bool:
    """Whether XLA has started its threads in this process; False where this JAX does not tell."""
    told = getattr(xla_bridge, "backends_are_initialized", None)
    return told is not None and told()


def is_jaxpr(value: Any) -> bool:
    """Whether this is a jaxpr, with constants of its own or without."""
    return isinstance(value, (core.ClosedJaxpr, core.Jaxpr))


def constants(jaxpr: Any) -> list[Any]:
    """The values of the constants of a jaxpr; an open one has none."""
    return list(getattr(jaxpr, "consts", ()))


@dataclass(frozen=True, slots=True)
class Variables:
    """The atoms of a jaxpr: the variables of its constants and inputs, and what it returns."""

    constants: Sequence[Atom]
    inputs: Sequence[Atom]
    outputs: Sequence[Atom]


def variables(jaxpr: Any) -> Variables:
    """The variables of a jaxpr's constants and inputs, and the atoms of its outputs."""
    inner = opened(jaxpr)
    return Variables(inner.constvars, inner.invars, inner.outvars)


def results(jaxpr: Any) -> list[jax.ShapeDtypeStruct]:
    """Shapes and types of what a jaxpr returns."""
    return [jax.ShapeDtypeStruct(shape(atom), dtype(atom)) for atom in variables(jaxpr).outputs]


def equations(jaxpr: Any) -> Iterator[Equation]:
    """The equations of a jaxpr in the order in which they are computed."""
    return map(Equation, opened(jaxpr).eqns)


def inner_jaxprs(parameters: Mapping[str, Any]) -> list[Any]:
    """The jaxprs among the parameters of an equation, also those in tuples."""
    rows = (value if isinstance(value, (tuple, list)) else (value,) for value in parameters.values())
    return [value for row in rows for value in row if is_jaxpr(value)]


def opened(jaxpr: Any) -> Any:
    """A jaxpr without the values of its constants."""
    return getattr(jaxpr, "jaxpr", jaxpr)  # from 0.11 a jaxpr holds its constants and is its own `.jaxpr`


def number(atom: Atom) -> np.ndarray | None:
    """The number that stands in the place of a variable, or None."""
    return np.asarray(atom.val, dtype(atom)) if isinstance(atom, core.Literal) else None


def dtype(atom: Atom) -> Any:
    """The type of the elements of a variable; None for what is no array."""
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
        raise _unknown(self.primitive, f"no parameter `{name}`, which coadjoint reads")

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
            raise _unknown(primitive, f"a `{name}` without `{field}`, which coadjoint reads") from None


def _unknown(primitive: str, what: str) -> UnknownVersion:
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
        """Raise UnknownVersion if a parameter that is not known here may change what the primitive means."""
        for name in _unknown_names(self.name, tuple(self.parameters)):
            value = self.parameters[name]
            if not (value is None or value is False or value == ()):
                raise _unknown(self.name, f"a parameter `{name}`, which coadjoint does not know")


_ANYWHERE = "accuracy sharding out_sharding out_dtype precision preferred_element_type"
"""Parameters that say where or how precisely a primitive is computed, which for float64 on one CPU changes nothing."""
_CALL = (
    "jaxpr call_jaxpr fun_jaxpr name debug_info ctx_mesh inline keep_unused donated_invars in_shardings out_shardings "
    "in_layouts out_layouts compiler_options_kvs prevent_cse differentiated policy attributes version num_consts "
    "symbolic_zeros out_trees jvp_jaxpr_fun jvp_jaxpr_thunk fwd_jaxpr_thunk bwd"
)
_GATHER = "dimension_numbers indices_are_sorted unique_indices mode fill_value slice_sizes"
_COMBINED = ("-add", "_add", "-sub", "-mul", "_mul", "-min", "_min", "-max", "_max")
_SCATTER = "dimension_numbers indices_are_sorted unique_indices mode update_jaxpr update_consts"
CALLS = ("jit", "pjit", "checkpoint", "remat", "remat2", "composite", "closed_call", "core_call", "custom_jvp_call")
CALLS += ("custom_vjp_call", "custom_vjp_call_jaxpr", "eval_jaxpr")
"""Primitives that run the one jaxpr that they hold."""
_PARAMETERS = {
    **dict.fromkeys(CALLS, _CALL),
    **dict.fromkeys(("argmax", "argmin"), "axes index_dtype"),
    **dict.fromkeys(("cummax", "cummin", "cumprod", "cumsum"), "axis reverse"),
    **dict.fromkeys((f"reduce_{name}" for name in ("and", "max", "min", "or", "prod", "sum")), "axes"),
    **dict.fromkeys(("scatter", *(f"scatter{end}" for end in _COMBINED)), _SCATTER),
    **dict.fromkeys(("stack", "unstack"), "axis"),
    "broadcast_in_dim": "shape broadcast_dimensions",
    "cholesky": "symmetrize_input",
    "concatenate": "dimension",
    "cond": "branches branches_platforms",
    "convert_element_type": "new_dtype weak_type",
    "custom_linear_solve": "const_lengths jaxprs",
    "device_put": "devices srcs copy_semantics",
    "dot_general": "dimension_numbers",
    "dynamic_slice": "slice_sizes",
    "empty": "shape dtype",
    "expand_dims": "dimensions",
    "gather": _GATHER,
    "integer_pow": "y",
    "iota": "shape dtype dimension",
    "lu": "pivot",
    "polynomial": "unroll",
    "pad": "padding_config",
    "platform_index": "platforms",
    "reshape": "new_sizes dimensions",
    "rev": "dimensions",
    "round": "rounding_method",
    "scan": "jaxpr length reverse unroll num_consts num_carry ft_in ft_out linear _split_transpose",
    "slice": "start_indices limit_indices strides",
    "sort": "dimension is_stable num_keys",
    "split": "axis sizes",
    "squeeze": "dimensions",
    "tile": "reps",
    "transpose": "permutation",
    "triangular_solve": "left_side lower transpose_a conjugate_a unit_diagonal",
    "while": "cond_jaxpr body_jaxpr cond_nconsts body_nconsts",
}
"""The parameters whose meaning is known: the rules read them, or they change no value."""


@cache
def _unknown_names(primitive: str, names: tuple[str, ...]) -> list[str]:
    known = {*_ANYWHERE.split(), *_PARAMETERS.get(primitive, "").split()}
    return [name for name in names if name not in known]


def body(equation: Equation) -> Any:
    """The jaxpr that a call, or a scan, runs: the only one that it holds."""
    found = inner_jaxprs(equation.parameters)
    if len(found) != 1:
        raise _unknown(equation.name, f"{len(found)} jaxprs, of which coadjoint reads one")
    return found[0]


@dataclass(frozen=True, slots=True)
class Scan:
    """A body from constants, carried values and a row of each slice to carried values and rows of results."""

    body: Any
    constants: int
    carried: int
    length: int
    reverse: bool


def scan(equation: Equation) -> Scan:
    """What a scan does; the body takes slices, and gives results, of one axis less than the equation does."""
    inside = body(equation)
    slices = _longer(equation, equation.inputs, variables(inside).inputs)
    results = _longer(equation, equation.outputs, variables(inside).outputs)
    carried = len(equation.outputs) - results
    before = len(equation.inputs) - slices - carried
    return Scan(inside, before, carried, equation.parameters["length"], equation.parameters["reverse"])


def _longer(equation: Equation, outside: Sequence[Atom], inside: Sequence[Atom]) -> int:
    """How many atoms, all of them at the end, have one axis more outside than inside."""
    if len(outside) != len(inside):
        raise _unknown(equation.name, f"{len(outside)} values where its body has {len(inside)}")
    more = [len(shape(a)) - len(shape(b)) for a, b in zip(outside, inside, strict=True)]
    if more != sorted(more) or not {0, 1}.issuperset(more):
        raise _unknown(equation.name, "inputs or outputs in an order that coadjoint does not know")
    return sum(more)


@dataclass(frozen=True, slots=True)
class While:
    """A test and a body, each with constants of its own before the carried values."""

    test: Any
    body: Any
    of_test: int
    of_body: int


def while_loop(equation: Equation) -> While:
    """What a while does: inputs are the constants of the test, those of the body, and what is carried."""
    test, inside = equation.parameters["cond_jaxpr"], equation.parameters["body_jaxpr"]
    carried = len(equation.outputs)
    of_test, of_body = (len(variables(part).inputs) - carried for part in (test, inside))
    if of_test + of_body + carried != len(equation.inputs):
        raise _unknown(equation.name, f"{len(equation.inputs)} inputs, other than its test and body take")
    return While(test, inside, of_test, of_body)


@dataclass(frozen=True, slots=True)
class LinearSolve:
    """A linear operator and a program that solves it, and how many constants come before the right sides."""

    operator: Any
    of_operator: int
    solve: Any
    of_solve: slice
    constants: int


def linear_solve(equation: Equation) -> LinearSolve:
    """What a custom_linear_solve does: constants of operator, transpose, solve and its transpose, then right sides."""
    lengths, jaxprs = equation.parameters.fields("const_lengths"), equation.parameters.fields("jaxprs")
    start = lengths.matvec + lengths.vecmat
    after = start + lengths.solve
    constants = after + lengths.transpose_solve
    return LinearSolve(jaxprs.matvec, lengths.matvec, jaxprs.solve, slice(start, after), constants)


def is_determinant(equation: Equation) -> bool:
    """Whether a call with a derivative of its own is JAX's determinant, of whatever size and by whatever formula."""
    source = getattr(getattr(opened(body(equation)), "debug_info", None), "func_src_info", None) or ""
    name, _, place = source.partition(" at ")
    return name.startswith("_det") and place.startswith(_DETERMINANTS)


_DETERMINANTS = f"{jax.__path__[0]}/_src/numpy/linalg.py"

NAMES_ONLY = frozenset(
    ("name", "jvp_jaxpr_fun", "jvp_jaxpr_thunk", "fwd_jaxpr_thunk", "bwd", "debug_info", "ctx_mesh", "out_trees")
)
"""Parameters that say how a function is called or where it came from, not what it does."""


def linear_primitive(name: str, no_derivative: Callable[[], Exception]) -> Callable[..., list[Any]]:
    """A family of linear maps whose transpose is given: (constants, x, push, pull, shapes) ↦ push(constants, x).

    `pull`(constants, y) is the transpose, `shapes` are those of push. Members of a batch go one after another. Its own
    derivative, which would be that of the constants, raises `no_derivative`().
    """
    primitive = core.Primitive(name)
    primitive.multiple_results = True

    def apply(*operands: Any, push: Callable, **_: Any) -> Sequence[Any]:
        return push(operands[:-1], operands[-1])

    def transpose(cotangents: Any, *operands: Any, push: Callable, pull: Callable, shapes: Any) -> list[Any]:
        pairs = zip(cotangents, shapes, strict=True)
        whole = [jnp.zeros(s.shape, s.dtype) if type(c) is ad.Zero else c for c, s in pairs]
        return [*[None] * (len(operands) - 1), pull(operands[:-1], whole)]

    def batch(operands: Any, axes: Any, **parameters: Any) -> tuple[Any, tuple[int, ...]]:
        pairs = list(zip(operands, axes, strict=True))
        moving = [jnp.moveaxis(operand, axis, 0) for operand, axis in pairs if axis is not None]

        def one(members: Any) -> tuple[Any, ...]:
            members = iter(members)
            return tuple(primitive.bind(*(x if axis is None else next(members) for x, axis in pairs), **parameters))

        found = jax.lax.map(one, tuple(moving))
        return found, (0,) * len(found)

    def refuse(*_: Any, **__: Any) -> Any:
        raise no_derivative()

    primitive.def_impl(apply)
    primitive.def_abstract_eval(lambda *_, shapes, **__: [ShapedArray(s.shape, s.dtype) for s in shapes])
    ad.primitive_jvps[primitive] = refuse
    ad.primitive_transposes[primitive] = transpose
    batching.primitive_batchers[primitive] = batch
    mlir.register_lowering(primitive, mlir.lower_fun(apply, multiple_results=True))

    def bind(constants: Sequence[Any], x: Any, push: Callable, pull: Callable, shapes: Sequence[Any]) -> list[Any]:
        return primitive.bind(*constants, x, push=push, pull=pull, shapes=tuple(shapes))

    return bind
