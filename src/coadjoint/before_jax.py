"""Names of JAX in a process that has not loaded it: PyTrees of NumPy arrays, decorators, types that no value has.

A command that finds plan, machine code and checks in the cache still walks PyTrees, asks whether values are arrays of
JAX, and defines functions with derivatives. `STAND_INS` do this without JAX; any other name loads it
(`coadjoint.postponed`), and from then on each of them does what the object does for which it stands.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property, update_wrapper

from coadjoint import trees
from coadjoint.arrays import PyTree
from coadjoint.postponed import loaded, object_of, when_loaded


def _until_loaded(place: str, own: Callable[..., PyTree]) -> Callable[..., PyTree]:
    """A function without JAX, and JAX's own where it is loaded or the arguments need it."""

    def call(*given: PyTree, **more: PyTree) -> PyTree:
        if not loaded("jax"):
            try:
                return own(*given, **more)
            except trees.OnlyJax:
                pass
        return object_of(place)(*given, **more)

    return call


def _registering(name: str, kind_of: Callable[..., trees.NodeKind]) -> Callable[..., PyTree]:
    """A function that makes a class one of nodes, here and, when it is loaded, for JAX."""

    def register(node: type, *given: PyTree, **more: PyTree) -> type:
        if more:
            return object_of(f"jax.tree_util.{name}")(node, *given, **more)
        trees.registered[node] = kind_of(node, *given)
        when_loaded("jax", lambda: object_of(f"jax.tree_util.{name}")(node, *given))
        return node

    return register


class _Decorated:
    """A function that JAX decorates when it is called first."""

    def __init__(self, decorator: str, function: Callable[..., PyTree], options: dict[str, PyTree]):
        self._decorator, self._function, self._options = decorator, function, options
        self._rules: list[Callable[..., PyTree]] = []
        update_wrapper(self, function)

    def defjvp(self, rule: Callable[..., PyTree]) -> Callable[..., PyTree]:
        """The function of the tangent, as of `jax.custom_jvp`."""
        self._rules.append(rule)
        return rule

    @cached_property
    def _made(self) -> PyTree:
        made = object_of(self._decorator)(self._function, **self._options)
        for rule in self._rules:
            made.defjvp(rule)
        return made

    def __call__(self, *given: PyTree, **more: PyTree) -> PyTree:
        return self._made(*given, **more)

    def __getattr__(self, name: str) -> PyTree:
        if name.startswith("_"):
            raise AttributeError(name)
        return getattr(self._made, name)


def _decorator(place: str) -> Callable[..., PyTree]:
    def decorate(*given: PyTree, **options: PyTree) -> PyTree:
        if loaded("jax") or len(given) != 1 or not callable(given[0]):
            return object_of(place)(*given, **options)
        return _Decorated(place, given[0], options)

    return decorate


class ShapeDtypeStruct:
    """Shape and type of an array."""

    def __init__(self, shape: Sequence[int], dtype: PyTree):
        import numpy as np

        self.shape, self.dtype = tuple(shape), np.dtype(dtype)


class _Type(type):
    """A type of JAX, of which nothing is before JAX is loaded."""

    place = ""

    def __instancecheck__(cls, value: object) -> bool:
        return loaded("jax") and isinstance(value, object_of(cls.place))


class _Array(metaclass=_Type):
    place = "jax.Array"


class _Tracer(metaclass=_Type):
    place = "jax.core.Tracer"


_WALKS = (trees.tree_flatten, trees.tree_leaves, trees.tree_map, trees.tree_structure, trees.tree_unflatten)
_ALSO = (trees.all_leaves, trees.keystr, trees.tree_leaves_with_path, trees.tree_map_with_path)
STAND_INS: dict[str, dict[str, object]] = {
    "jax": {
        "Array": _Array,
        "ShapeDtypeStruct": ShapeDtypeStruct,
        "custom_jvp": _decorator("jax.custom_jvp"),
        "jit": _decorator("jax.jit"),
    },
    "jax.core": {"Tracer": _Tracer},
    "jax.tree": {
        (name := walk.__name__.removeprefix("tree_")): _until_loaded(f"jax.tree.{name}", walk) for walk in _WALKS
    },
    "jax.tree_util": {
        **{one.__name__: _until_loaded(f"jax.tree_util.{one.__name__}", one) for one in (*_WALKS, *_ALSO)},
        "GetAttrKey": trees.GetAttrKey,
        "register_dataclass": _registering("register_dataclass", trees.dataclass_kind),
        "register_pytree_node": _registering("register_pytree_node", trees.kind_by_functions),
        "register_pytree_with_keys_class": _registering("register_pytree_with_keys_class", trees.class_kind),
    },
}
"""The objects that stand for names of JAX, by the modules of these."""
