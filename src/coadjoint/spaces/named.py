"""A namespace of arrays that is a PyTree: parameters, and points of several spaces."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NoReturn

import jax

from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError, shown
from coadjoint.paths import paths, respelled


@jax.tree_util.register_pytree_with_keys_class
class Named:
    """Immutable values under names, read as attributes: `p.mass`, `a.down`.

    values: anything, by names.
    """

    __slots__ = ("_values",)
    _values: dict[str, PyTree]

    def __init__(self, **values: object):
        object.__setattr__(self, "_values", values)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") or name == "_values":
            raise AttributeError(name)
        try:
            return self._values[name]
        except KeyError:
            known = ", ".join(self._values) or "nothing"
            hint = respelled(name, paths(self))
            ending = f": it is `{hint}`" if hint else f"; there is: {known}"
            raise AttributeError(f"There is no `{name}` here{ending}.") from None

    def __getitem__(self, name: object) -> NoReturn:
        raise TypeError(f"Named values are read as attributes, as in p.{name}, and not by brackets as [{name!r}].")

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"Values cannot be changed in place; make a copy with replace({name}=…).")

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __contains__(self, name: str) -> bool:
        return name in self._values

    def __eq__(self, other: object) -> bool:
        return self is other

    def __hash__(self) -> int:
        return id(self)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{k}={v!r}' for k, v in self._values.items())})"

    def __reduce__(self):
        return _made, (type(self), self._values)

    def asdict(self) -> dict[str, PyTree]:
        """The values in a plain dictionary."""
        return dict(self._values)

    def replace(self, **values: object):
        """A copy with some values replaced; raises ArgumentError for a name that is not there."""
        unknown = [name for name in values if name not in self._values]
        if unknown:
            raise ArgumentError(f"There is no `{unknown[0]}` to replace; there is: {', '.join(self._values)}.")
        return type(self)(**{**self._values, **values})

    def tree_flatten_with_keys(self):
        keys = tuple(self._values)
        return [(jax.tree_util.GetAttrKey(key), self._values[key]) for key in keys], keys

    def tree_flatten(self):
        return list(self._values.values()), tuple(self._values)

    @classmethod
    def tree_unflatten(cls, keys: tuple[str, ...], values: Iterable[object]) -> Named:
        return _made(cls, dict(zip(keys, values, strict=True)))


def named(tree: PyTree) -> PyTree:
    """A dictionary, and the dictionaries in it, as namespaces; anything else unchanged."""
    if not isinstance(tree, Mapping):
        return tree
    require_names(tree)
    return Named(**{name: named(value) for name, value in tree.items()})


def require_names(given: Mapping[Any, Any]) -> None:
    """Raise ArgumentError unless the keys of a dictionary are texts, by which its values can be read."""
    others = [key for key in given if not isinstance(key, str)]
    if others:
        raise ArgumentError(f"The names in a dictionary of values must be texts, but one is {shown(others[0])}.")
    for key in given:
        if hasattr(Named, key):
            raise ArgumentError(f"The name {shown(key)} has a meaning of its own in values: take another one.")


def _made(kind: type[Named], values: Mapping[str, object]) -> Named:
    """Values that were pickled or copied."""
    made = object.__new__(kind)
    object.__setattr__(made, "_values", values)
    return made
