"""Mutations of the functions that rows of the table of theorems name, put where the library uses them.

A mutation is of a function's value: its sign; zero; a factor 1.001; its transpose, of a matrix or of a linear map; the
identity, e for a group element and else an argument of the same shape in its place. Functions that make a function, a
system or a run have their values mutated; one that returns nothing, because it only refuses, is made to accept all.
Of calls within calls the outermost is mutated, so that a sign does not cancel.
"""

from __future__ import annotations

import copy
import functools
import importlib
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from theorem_row import Row

from coadjoint import theory
from coadjoint.groups import LieGroup
from coadjoint.kernels.run import batch, gradient, native
from coadjoint.mechanics.copies import replaced
from coadjoint.mechanics.discrete_connection import DiscreteConnection
from coadjoint.mechanics.system import System
from coadjoint.report.reproduction import Reproduction

TESTS = str(Path(__file__).parents[1])

SCALES = {"sign": -1.0, "zero": 0.0, "factor": 1.001}
LINEAR = ("Ad", "Ad_dual", "ad", "ad_dual", "dtau", "dtau_dual", "dtau_inverse", "dtau_inverse_dual", "push", "pull",
          "lifted")  # fmt: skip
"""Functions that are linear in their last argument, so that they have a transpose."""
LOOK = "look"
"""No mutation: sees which apply."""


@dataclass
class Patch:
    """A mutation of one function: how often the function was called, and which mutations its values allow."""

    kind: str
    name: str
    calls: int = 0
    depth: int = 0
    allowed: set[str] = field(default_factory=set)
    group: LieGroup | None = None

    def wrap(self, function: Callable) -> Callable:
        """The mutated function."""

        @functools.wraps(function, updated=())
        def mutated(*args, **kwargs):
            self.calls += 1
            if self.kind == "accepts":
                return None
            self.depth += 1
            try:
                value = function(*args, **kwargs)
                return value if self.depth > 1 else self.value(function, value, args)
            finally:
                self.depth -= 1

        return mutated

    def value(self, function: Callable, value: Any, args: tuple) -> Any:
        """What stands in the place of a value."""
        if value is None:
            self.allowed.add("accepts")
            return None
        self.group = next((found for found in map(_group_of, (*args, value)) if found is not None), self.group)
        made = self._made(value)
        if made is not None:
            return made
        replaced = {
            **{kind: (lambda s=scale: jax.tree.map(lambda x: _scaled(x, s), value)) for kind, scale in SCALES.items()},
            "transpose": lambda: self._transposed(function, value, args),
            "identity": lambda: self._identity(value, args),
        }
        if self.kind == LOOK:
            self.allowed |= {kind for kind, change in replaced.items() if change() is not None}
            return value
        found = replaced[self.kind]()
        return value if found is None else found

    def _made(self, value: Any) -> Any:
        """A function, system, Lagrangian, connection or run whose own values are mutated; None for plain values."""
        if isinstance(value, System):
            own = [name for name in ("lagrangian", "group_lagrangian") if getattr(value, name) is not None]
            return replaced(value, **{name: self.wrap(getattr(value, name)) for name in own})
        if isinstance(value, theory.UnreducedLagrangian):
            group, Q, V = value.places
            spaces = {"additional": Q, "advected": V, "parameters": value.reduced.parameters}
            return theory.UnreducedLagrangian(group, self.wrap(value.function), **spaces)
        if isinstance(value, theory.ContinuousLagrangian):
            group, Q, V = value.places
            spaces = {"additional": Q, "advected": V, "parameters": value.reduced.parameters}
            return theory.ContinuousLagrangian(group, self.wrap(value.function), **spaces)
        if isinstance(value, theory.Equations):
            return theory.Equations(tuple(row._replace(values=self.value(len, row.values, ())) for row in value.rows))
        if isinstance(value, Reproduction):
            return Reproduction({name: self._run(run) for name, run in value.runs.items()})
        for kind, attribute in ((theory.PoissonLagrangian, "function"), (DiscreteConnection, "increment")):
            if isinstance(value, kind):
                made = copy.copy(value)
                object.__setattr__(made, attribute, self.wrap(getattr(value, attribute)))
                return made
        return self.wrap(value) if callable(value) else None

    def _run(self, run: Any) -> Any:
        """A run with its records mutated."""
        made = copy.copy(run)
        made.__dict__["records"] = self.value(len, run.records, ())
        return made

    def _identity(self, value: Any, args: tuple) -> Any:
        """e, or the last argument that looks like the value."""
        if not any(np.ndim(leaf) for leaf in jax.tree.leaves(value)):
            return None
        if self.group is not None and _alike(e := self.group.identity(), value):
            return e
        return next((arg for arg in reversed(args) if _alike(arg, value)), None)

    def _transposed(self, function: Callable, value: Any, args: tuple) -> Any:
        if self.name.split(".")[-1] in LINEAR and _alike(args[-1], value):
            *rest, last = args
            return jax.vjp(lambda x: function(*rest, x), jnp.zeros_like(last))[1](last)[0]
        if not any(_square(leaf) for leaf in jax.tree.leaves(value)):
            return None
        return jax.tree.map(lambda leaf: jnp.swapaxes(leaf, -1, -2) if _square(leaf) else leaf, value)


def _group_of(argument: Any) -> LieGroup | None:
    """The group that an argument is, or has."""
    if isinstance(argument, LieGroup):
        return argument
    # A Lagrangian that is being made has a group, but no system yet.
    found = getattr(argument, "group", None)
    found = getattr(getattr(argument, "system", None), "group", None) if found is None else found
    return found if isinstance(found, LieGroup) else None


def _scaled(leaf: Any, scale: float) -> Any:
    return scale * leaf if jnp.issubdtype(jnp.asarray(leaf).dtype, jnp.floating) else leaf


def _square(leaf: Any) -> bool:
    shape = np.shape(leaf)
    return len(shape) >= 2 and shape[-1] == shape[-2] > 1


def _alike(arg: Any, value: Any) -> bool:
    try:
        if jax.tree.structure(arg) != jax.tree.structure(value):
            return False
        return all(np.shape(x) == np.shape(y) for x, y in zip(*map(jax.tree.leaves, (arg, value)), strict=True))
    except (TypeError, ValueError):
        return False


def resolve(name: str) -> tuple[Any, str, Any]:
    """The module or class that holds coadjoint.name, its attribute, and the function."""
    parts = name.split(".")
    for length in range(len(parts) - 1, 0, -1):
        try:
            owner = importlib.import_module(".".join(["coadjoint", *parts[:length]]))
        except ModuleNotFoundError:
            continue
        for part in parts[length:-1]:
            owner = getattr(owner, part)
        return owner, parts[-1], getattr(owner, parts[-1])
    raise LookupError(f"coadjoint.{name} does not exist.")


def _homes(owner: Any, attribute: str, function: Any) -> Iterator[tuple[Any, str]]:
    """Where the function is used from: the class and subclasses that override it, or every module that holds it."""
    if isinstance(owner, type):
        yield owner, attribute
        rest = owner.__subclasses__()
        while rest:
            cls = rest.pop()
            rest += cls.__subclasses__()
            if attribute in vars(cls):
                yield cls, attribute
        return
    for module in list(sys.modules.values()):
        if module.__name__.startswith("coadjoint") or str(getattr(module, "__file__", "")).startswith(TESTS):
            yield from ((module, key) for key, value in list(vars(module).items()) if value is function)


def forget() -> None:
    """Empty every cache that could hold what was traced, compiled or measured with other functions."""
    for module in list(sys.modules.values()):
        if module.__name__.startswith("coadjoint"):
            for value in list(vars(module).values()):
                if hasattr(value, "cache_clear") and getattr(value, "__module__", "") == module.__name__:
                    value.cache_clear()
    for kept in (native._kernels, batch._known, gradient._adjoints):
        kept.clear()
    jax.clear_caches()


@contextmanager
def mutated(name: str, kind: str):
    """The library with one function mutated, wherever it is used, and the patch."""
    owner, attribute, function = resolve(name)
    patch, undo = Patch(kind, name), []
    try:
        for home, key in dict.fromkeys(_homes(owner, attribute, function)):
            own = key in vars(home)
            known = vars(home)[key] if own else getattr(home, key)
            undo.append((home, key, known, own))
            method = isinstance(known, (staticmethod, classmethod))
            wrapped = patch.wrap(known.__func__ if method else known)
            setattr(home, key, type(known)(wrapped) if method else wrapped)
        forget()
        yield patch
    finally:
        for home, key, known, own in undo:
            setattr(home, key, known) if own else delattr(home, key)
        forget()


def mutations(row: Row) -> list[tuple[str, str]]:
    """(function, kind) of every mutation that a row's own use of its functions allows.

    Measures the row on the way; raises AssertionError where it does not hold, or where it does not use a function.
    """
    with ExitStack() as stack:
        looks = [stack.enter_context(mutated(name, LOOK)) for name in row.functions]
        residual = row.residual()
    assert residual <= row.bound, f"{row.number} is off by {residual:.1e}"
    unused = [look.name for look in looks if not look.calls]
    assert not unused, f"{row.number} names {', '.join(unused)}, but does not use it"
    return [(look.name, kind) for look in looks for kind in sorted(look.allowed)]


def detected(row: Row, name: str, kind: str) -> bool:
    """Whether the residual of a row rises above its bound under a mutation; an exception is no detection."""
    with mutated(name, kind):
        try:
            return any(not residual <= row.bound for residual in row.cases())
        except Exception:
            return False
