"""Programs of the library's functions on disk, for commands: a repeated one evaluates them without JAX.

The name of a program is the identity of its function, with all that it holds, and the shapes of the arguments. It is
kept with machine code (`kernels.store`), sealed like this. A process that has loaded JAX from its beginning traces,
except where the caller names the program.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable

from coadjoint.arrays import PyTree
from coadjoint.kernels import store
from coadjoint.kernels.trace.identity import Shapes, identity
from coadjoint.kernels.trace.jaxprs import jaxpr_of
from coadjoint.kernels.trace.library import edited, library
from coadjoint.kernels.trace.plain import Plainer
from coadjoint.postponed import waited
from coadjoint.trees import like

MOST = 200
"""The most programs that a process keeps: a loop over many functions would fill the cache."""
_kept: list[str] = []


def program_of(
    function: Callable[..., PyTree], args: tuple[PyTree, ...], name: str | None = None
) -> tuple[PyTree, PyTree]:
    """The jaxpr of a function of PyTrees of arrays, and the structure of its result: kept, or traced now.

    name: under which it is kept in any process, of a function of a user too.
    """
    name = _name(function, args) if name is None and waited("jax") else name
    if name is None:
        return jaxpr_of(function, *args)
    content = store.fetch(name)
    if content is not None:
        return pickle.loads(content)
    jaxpr, structure = jaxpr_of(function, *args)
    known = like(structure)
    if known is None:
        return jaxpr, structure
    found = Plainer().program(jaxpr), known
    if len(_kept) < MOST and not edited():
        _kept.append(name)
        store.keep(name, pickle.dumps(found))
    return found


def _name(function: Callable[..., PyTree], args: tuple[PyTree, ...]) -> str | None:
    """None for a function of a user, and without a cache."""
    own, here = identity(function, Shapes(args)) if store.folder() is not None else None, library()
    return None if own is None or here is None or not own.library_only else store.key("program", here, own.digest)
