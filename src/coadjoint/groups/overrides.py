"""What a class gives in place of a derived member, compared with the derivation at random points.

A closed form is an optimisation, and a wrong one is not seen afterwards: with its sign flipped, the equations of motion
and everything that the certificate measures are wrong in the same way. So each is compared before it is used.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Hashable, Iterator, Sequence
from contextlib import contextmanager
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.errors import CoadjointError, GroupError, error_line, shown
from coadjoint.kernels.trace.evaluate import tabulate
from coadjoint.kernels.trace.library import homes

AGREEMENT = 1e-9
"""How far a member may be from its derivation, relative to the derivation."""
_ROUND_OFF = 1e-14
"""What cancellation may leave where the derivation is zero; all arguments are about 1."""


class Identity(NamedTuple):
    """found = expected, which a member must satisfy; `says` is the equation."""

    member: str
    says: str
    found: Callable[[], PyTree]
    expected: Callable[[], PyTree]


def members(base: type) -> list[str]:
    """What a class of one's own may override."""
    return [name for name in vars(base) if not name.startswith("__")]


def overrides(thing: object, base: type, name: str) -> bool:
    """Whether this is not the member of the base."""
    return _definition(thing, name) is not vars(base)[name]


def own(thing: object, base: type) -> tuple[PyTree, ...]:
    """The definitions that do not stand in this library: of them, and of them alone, nothing is known."""
    if type(thing).__module__.split(".")[0] in homes():
        return ()
    found = (_definition(thing, name) for name in members(base))
    return tuple(definition for definition in found if not _ships(definition, type(thing)))


class _Itself:
    """An object that is equal to itself alone, kept so that no other comes to stand where it is in memory."""

    def __init__(self, thing: object):
        self.thing = thing

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Itself) and self.thing is other.thing

    def __hash__(self) -> int:
        return id(self.thing)


def _key(definition: object) -> Hashable:
    """The key of a definition: the numbers of an array, the entries of a list, otherwise the definition itself."""
    if isinstance(definition, (np.ndarray, jax.Array)) and not definition.dtype.hasobject:
        return definition.dtype.str, definition.shape, np.asarray(definition).tobytes()
    if isinstance(definition, (list, tuple)):
        return type(definition), tuple(map(_key, definition))
    try:
        hash(definition)
    except TypeError:
        return _Itself(definition)
    return definition


def parts(thing: object, kind: type) -> Iterator[PyTree]:
    """What an object holds of this kind, such as the factors of a product, and what these hold: inner ones first."""
    for value in vars(thing).values() if hasattr(thing, "__dict__") else ():
        for inner in value if isinstance(value, (tuple, list)) else (value,):
            if isinstance(inner, kind):
                yield from parts(inner, kind)
                yield inner


def stamp(thing: object, *bases: type) -> tuple[object, ...]:
    """The classes of an object and the definitions of its own, on which a verdict depends in addition to the object."""
    base = next(base for base in bases if isinstance(thing, base))
    inner = [part for kind in bases for part in parts(thing, kind)]
    return type(thing), tuple(map(_key, own(thing, base))), tuple(stamp(part, *bases) for part in inner)


def require_hashable(thing: object) -> None:
    """Raise GroupError for an object that cannot be the key of a cached result."""
    try:
        hash(thing)
    except TypeError as error:
        raise GroupError(
            f"{_name(thing)} must be hashable, because it is static: make it a @dataclass(frozen=True) with numbers, "
            "texts and tuples as fields, or give it __eq__ and __hash__."
        ) from error


def require_given(thing: object, base: type, names: Sequence[str]) -> None:
    """Raise GroupError unless a class overrides these members, which the base does not have."""
    missing = [name for name in names if not overrides(thing, base, name)]
    if missing:
        raise GroupError(f"{_name(thing)} must give `{missing[0]}`, which a {base.__name__} does not have by itself.")


@contextmanager
def in_words(what: str) -> Generator[None]:
    """Whatever a member raises, as one sentence."""
    try:
        yield
    except CoadjointError:
        raise
    except Exception as error:
        raise GroupError(f"{what} raised {error_line(error)}; write it with jax.numpy, for arrays.") from error


def require_agreement(
    thing: object, where: str, identities: Callable[..., list[Identity]], points: Sequence[tuple[PyTree, ...]]
) -> None:
    """Raise GroupError unless all identities hold at these points: |found − expected| ≤ 1e-9 |expected|."""
    stated: list[Identity] = []

    def both(*point: object) -> list[PyTree]:
        stated[:] = identities(*point)
        return [_pair(thing, where, identity) for identity in stated]

    with in_words(f"A comparison of {_name(thing)}{where} with the derived form"):
        function = tabulate(both, *points[0])
        rows = [function(*point) for point in points]
    for identity, *pairs in zip(stated, *rows, strict=True):
        _require_close(thing, where, identity, pairs)


def _require_close(thing: object, where: str, identity: Identity, pairs: Sequence[tuple[PyTree, PyTree]]) -> None:
    error = size = 0.0
    for pair in pairs:
        for found, expected in zip(*map(jax.tree.leaves, pair), strict=True):
            error = np.maximum(error, np.max(np.abs(found - expected), initial=0.0))  # NaN stays
            size = np.maximum(size, np.max(np.abs(expected), initial=0.0))
    if not error <= AGREEMENT * size + _ROUND_OFF:
        much = f"{error / size:.1e} of its size" if size > 0 and np.isfinite(error) else f"{error:.1e}"
        raise GroupError(
            f"`{identity.member}` of {_name(thing)}{where} must satisfy {identity.says}, but at random points it is "
            f"off by {much}: mend it, leave it out where it would be derived, or give verify=False to co.System."
        )


def _pair(thing: object, where: str, identity: Identity) -> tuple[PyTree, PyTree]:
    """Both sides; raises GroupError where the member raises, or returns another structure or another kind."""
    expected = identity.expected()
    what = f"`{identity.member}` of {_name(thing)}{where}"
    with in_words(what):
        found = jax.tree.map(jnp.asarray, identity.found())
    sides = [jax.tree.flatten(side) for side in (found, expected)]
    shapes = [[np.shape(leaf) for leaf in leaves] for leaves, _ in sides]
    if sides[0][1] != sides[1][1] or shapes[0] != shapes[1]:
        raise GroupError(f"{what} must have shape {_shown(shapes[1])}, but has {_shown(shapes[0])}.")
    if any(jnp.iscomplexobj(leaf) for leaf in sides[0][0]):
        raise GroupError(f"{what} must be real, but is complex.")
    return found, expected


def _shown(shapes: list[tuple[int, ...]]) -> str:
    return ", ".join(map(str, shapes)) or "nothing"


def _name(thing: object) -> str:
    words = shown(thing)
    return words if type(thing).__name__ in words and not words.endswith("…") else type(thing).__name__


def _definition(thing: object, name: str) -> object:
    """What stands under a name on the object itself, or first among its classes."""
    homes = [getattr(thing, "__dict__", {}), *map(vars, type(thing).__mro__)]
    return next(home[name] for home in homes if name in home)


def _ships(definition: object, kind: type) -> bool:
    """Whether a definition stands in this library; a plain value does where its class does."""
    function = getattr(definition, "fget", None) or getattr(definition, "__func__", definition)
    function = getattr(function, "func", function)
    home = getattr(function, "__module__", None)
    if home is None:
        home = next((k.__module__ for k in kind.__mro__ if any(v is definition for v in vars(k).values())), "")
    return home.split(".")[0] in homes()
