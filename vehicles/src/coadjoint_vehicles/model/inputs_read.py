"""Which inputs of a run a controller reads."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any

import jax

from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError
from coadjoint.spaces import Named


@jax.tree_util.register_pytree_with_keys_class
class Read(Named):
    """Values under names that remember which of them were asked for."""

    __slots__ = ("_seen",)
    _seen: set[str]

    def __init__(self, **values: object):
        super().__init__(**values)
        object.__setattr__(self, "_seen", set())

    def __getattr__(self, name: str) -> Any:
        value = super().__getattr__(name)
        self._seen.add(name)
        return value

    def __iter__(self) -> Iterator[str]:
        self._seen.update(self._values)
        return super().__iter__()

    def __contains__(self, name: str) -> bool:
        self._seen.add(name)
        return super().__contains__(name)

    def __reduce__(self):
        self._seen.update(self._values)
        return Named(**self._values).__reduce__()

    def asdict(self) -> dict[str, PyTree]:
        self._seen.update(self._values)
        return super().asdict()

    def replace(self, **values: object) -> Named:
        return Named(**self.asdict()).replace(**values)

    def tree_flatten_with_keys(self):
        self._seen.update(self._values)
        return super().tree_flatten_with_keys()

    @classmethod
    def tree_unflatten(cls, keys, values):
        return Named.tree_unflatten.__func__(Named, keys, values)

    @property
    def unread(self) -> list[str]:
        """The names not read yet."""
        return [name for name in self._values if name not in self._seen]


def require_read(function: Callable[..., object], inputs: PyTree, others: Iterable[str], who: str) -> None:
    """Raise ArgumentError where a function has left out an input of the run that is not for `others`, either.

    An input whose name occurs in the function's code may be read later.
    """
    if not isinstance(inputs, Read):
        return
    code = getattr(function, "__code__", None)
    known = {*others, *(() if code is None else (*code.co_names, *code.co_consts))}
    if left := [name for name in inputs.unread if name not in known]:
        read = [name for name in inputs._values if name not in inputs.unread]
        what = f"it reads {', '.join(read)}" if read else "it reads none"
        raise ArgumentError(
            f"{who} never reads the input `{left[0]}` ({what}): leave it out of `inputs`, or correct its name."
        )
