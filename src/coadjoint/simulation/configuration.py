"""The content of a run's folder: the configuration to set it up again, its fingerprint, and its checkpoints."""

from __future__ import annotations

import dataclasses
import hashlib
import io
import json
from collections.abc import Callable, Mapping
from importlib import import_module, metadata
from pathlib import Path
from typing import Any, TypeVar

import jax
import numpy as np

from coadjoint.archives import stored_arrays
from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError, FileError
from coadjoint.kernels.program import NEWTON, Code
from coadjoint.kernels.run import disk_cache, plans
from coadjoint.kernels.run.native import loops, written
from coadjoint.kernels.trace.digest import digest
from coadjoint.kernels.trace.jaxprs import jaxpr_of
from coadjoint.manifest import DAMAGED
from coadjoint.mechanics.parameters import Parameters
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.mechanics.traced_once import Traced, tracing_once
from coadjoint.methods.method import Method
from coadjoint.methods.program import Constants
from coadjoint.simulation.plan import AnyPosition, MembersPosition, Plan, Position
from coadjoint.spaces.named import Named
from coadjoint.texts import Table

_HOMES = ("coadjoint.methods", "coadjoint.difference_maps")


_FIXED = [f.name for f in dataclasses.fields(State) if f.metadata.get("static") and f.name not in ("places", "origin")]


_NUMBERS = [f.name for f in dataclasses.fields(State) if not f.metadata.get("static")]


class Unwritable(ValueError):
    """Something that has no form as JSON: the user gives it again."""


def versions() -> dict[str, str]:
    """The versions of the packages that determine the last bits of a result."""
    return {name: metadata.version(name) for name in ("coadjoint", "jax", "numpy", "llvmlite")}


def method_form(method: Method) -> Any:
    """A method as class names and fields; None if it is not one of the library."""
    try:
        form = _form(method)
        return form if method_from(form) == method else None
    except Unwritable:
        return None


def _form(value: object) -> Any:
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, tuple):
        return [_form(item) for item in value]
    if dataclasses.is_dataclass(value) and _class(type(value).__name__) is type(value):
        fields = {field.name: _form(getattr(value, field.name)) for field in dataclasses.fields(value)}
        return {"class": type(value).__name__, **fields}
    raise Unwritable


def _class(name: str) -> Any:
    found = (getattr(import_module(home), name, None) for home in _HOMES)
    return next((kind for kind in found if isinstance(kind, type)), None)


def method_from(form: object) -> Any:
    """The method that `method_form` described; raises ValueError, AttributeError or TypeError for other forms."""
    if isinstance(form, list):
        return tuple(method_from(item) for item in form)
    if not isinstance(form, Mapping):
        return form
    made = object.__new__(_class(form["class"]))
    for name, value in form.items():
        if name != "class":
            object.__setattr__(made, name, method_from(value))
    if _form(made) != dict(form):
        raise ValueError(f"no {form['class']}")
    return made


def start_form(start: State) -> tuple[Any, dict[str, np.ndarray]]:
    """The structure of a start as JSON, None if it holds anything unusual, and its numbers."""
    numbers: dict[str, np.ndarray] = {}
    try:
        form = {name: _tree(getattr(start, name), numbers) for name in _NUMBERS if name != "g"}
        form["g"] = _tree(list(jax.tree.leaves(start.g)) if _has_names(start.g) else start.g, numbers)
        return {**form, "fixed": {name: getattr(start, name) for name in _FIXED}}, numbers
    except Unwritable:
        return None, {}


def _has_names(g: object) -> bool:
    """Whether g is, or holds, tuples with names, as elements of U(n)."""
    inner = g if isinstance(g, (tuple, list)) else ()
    return hasattr(g, "_fields") or any(map(_has_names, inner))


def _tree(tree: PyTree, numbers: dict[str, np.ndarray]) -> PyTree:
    if tree is None:
        return None
    if isinstance(tree, (Named, dict)):
        kind = "parameters" if isinstance(tree, Parameters) else "named" if isinstance(tree, Named) else "dict"
        values = tree.asdict() if isinstance(tree, Named) else tree
        return {kind: {name: _tree(value, numbers) for name, value in values.items()}}
    if isinstance(tree, (tuple, list)) and not hasattr(tree, "_fields"):
        return {type(tree).__name__: [_tree(value, numbers) for value in tree]}
    if isinstance(tree, (np.ndarray, np.generic, float, int)):
        name = f"start/{len(numbers)}"
        numbers[name] = np.asarray(tree)
        return name
    raise Unwritable


def start_from(form: Any, numbers: Mapping[str, np.ndarray], system: System) -> State:
    """The start that `start_form` took apart; raises ArgumentError if it could not be written."""
    if form is None:
        raise ArgumentError("The start of this run has parts that its folder does not keep: give `start` again.")
    grown = {name: _planted(form.get(name), numbers) for name in _NUMBERS}
    if isinstance(grown["g"], list):
        structure = jax.tree.structure(system.group.identity())
        if structure.num_leaves != len(grown["g"]):
            raise ArgumentError(f"The start of this run is no element of {system.group}: give the system it had.")
        grown["g"] = jax.tree.unflatten(structure, grown["g"])
    return State(**grown, **form["fixed"], places=system.places)


def _planted(form: Any, numbers: Mapping[str, np.ndarray]) -> PyTree:
    if form is None:
        return None
    if isinstance(form, str):
        return numbers[form]
    ((kind, values),) = form.items()
    if kind in ("tuple", "list"):
        grown = [_planted(value, numbers) for value in values]
        return tuple(grown) if kind == "tuple" else grown
    grown = {name: _planted(value, numbers) for name, value in values.items()}
    return grown if kind == "dict" else {"parameters": Parameters, "named": Named}[kind](**grown)


TRACING = "2"
"""How equations are traced for a fingerprint: those of other numbers cannot be compared."""


def fingerprint(
    plan: Plan, state: State, one: tuple[Constants, State] | None = None, known: Traced | None = None
) -> dict[str, str]:
    """Digests of the traced equations, of their numbers, and of the grid.

    They are equal in every process with the same versions of Python's packages; names of functions do not count.
    one: the member of an ensemble for which its equations are traced. known: the traces made for the kernel.
    """
    constants, start = (plan.constants, state) if one is None else one
    form = _loops_over_links(plan, constants, start)
    name = plans.name(plan.program, constants, start, "fingerprint", plan.watches, plan.constants.monitors, *form)
    traced = disk_cache.find(name)
    if traced is None:
        with tracing_once(known):
            traced = _traced(plan, constants, start, form)
        disk_cache.keep(name, traced)
    directions = [event.direction for _, event in plan.events]
    return {
        "tracing": TRACING,
        "equations": traced["equations"],
        "parameters": digest(named(plan.constants.system)),
        "start": digest(jax.tree.leaves(state)),
        "monitors": traced["monitors"],
        "grid": digest(plan.h, plan.steps, plan.save_every, plan.monitors, plan.backend, directions),
    }


def _traced(plan: Plan, constants: Constants, state: State, form: list[str]) -> dict[str, str]:
    """Digests of the equations, in the form that native code gives them, and of the monitors and their constants."""
    program, h, whole = plan.program, np.float64(plan.h), np.float64(1.0)
    different = {stage.step: stage for stage in program.stages}
    functions: list[tuple[Callable, tuple]] = [(program.prepare, (constants, state, h))]
    for stage in different.values():
        z = np.zeros(sum(stage.blocks))
        functions += [
            (stage.guess, (constants, state, h)),
            (stage.residual, (constants, state, h, z)),
            (stage.chart, (constants, state, h, z)),
            (stage.advance, (constants, state, h, z, whole)),
        ]
    certificates = [
        (stage.certificate, (constants, state, h, np.zeros(sum(stage.blocks)), state)) for stage in different.values()
    ]
    observed = [(program.monitors, (constants, state, h)), *certificates] if plan.watches else []
    order = {step: i for i, step in enumerate(different)}
    parts = [(order[stage.step], stage.fraction, stage.blocks, stage.tolerant) for stage in program.stages]
    stages = [program.substeps, *parts, *form]
    return {
        "equations": digest(NEWTON, stages, *(jaxpr_of(function, *given)[0] for function, given in functions)),
        "monitors": digest(
            named(plan.constants.monitors), *(jaxpr_of(function, *given)[0] for function, given in observed)
        ),
    }


def _loops_over_links(plan: Plan, constants: Constants, state: State) -> list[str]:
    """The form of native code where it is not that of `NEWTON`: chords in loops over links."""
    program = plan.program
    if plan.backend != "native" or (plan.members is not None and written(program)):
        return []
    if plan.members is None and not loops(program, constants, state):
        return []
    stage = program.linked(state)
    return [] if stage is None or stage.structure.multipliers else ["chords over links and their pairs"]


def named(tree: PyTree) -> list[PyTree]:
    """The leaves of a PyTree with their names."""
    return [[jax.tree_util.keystr(path), leaf] for path, leaf in jax.tree_util.tree_leaves_with_path(tree)]


Arrays = Mapping[str, np.ndarray]


P = TypeVar("P", Position, MembersPosition)


def packed(header: Mapping[str, Any], arrays: Arrays) -> bytes:
    """A header and arrays as a NumPy archive, stored without compression, with its SHA-256 behind it."""
    body = io.BytesIO()
    text = np.frombuffer(json.dumps(header).encode(), dtype=np.uint8)
    np.savez(body, allow_pickle=False, header=text, **{f"array/{name}": values for name, values in arrays.items()})
    return body.getvalue() + hashlib.sha256(body.getbuffer()).digest()


def unpacked(path: Path) -> tuple[Table, dict[str, np.ndarray]]:
    """The header and the arrays in `path`; raises FileError if it is damaged."""
    data = path.read_bytes()
    body, sealed = data[:-32], data[-32:]
    damaged = FileError(f"The file {path} is damaged: {DAMAGED}.")
    if hashlib.sha256(body).digest() != sealed:
        raise damaged
    try:
        arrays = stored_arrays(body)
        header = json.loads(bytes(arrays.pop("header")))
    except (ValueError, KeyError, RecursionError) as error:
        raise damaged from error
    return header, {name.partition("/")[2]: values for name, values in arrays.items()}


def position_numbers(position: AnyPosition) -> tuple[Table, dict[str, np.ndarray]]:
    """All of a position, exactly: its numbers, and its arrays."""
    header: Table = {}
    arrays = state_numbers("state", position.state)
    for name in _counts(position):
        value = getattr(position, name)
        if isinstance(value, np.ndarray):
            arrays[f"position/{name}"] = value
        else:
            header[name] = int(value) if isinstance(value, Code) else value
    for name, (low, high) in position.extrema.items():
        arrays[f"lowest/{name}"], arrays[f"highest/{name}"] = np.asarray(low), np.asarray(high)
    return header, arrays


def position_at(header: Mapping[str, object], arrays: Arrays, like: P) -> P:
    """The position that `position_numbers` took apart; `like` is one of the same system, method and members."""
    lows = {name.partition("/")[2]: low for name, low in arrays.items() if name.startswith("lowest/")}
    found = {name: header[name] if name in header else arrays[f"position/{name}"] for name in _counts(like)}
    if "code" in found:
        found["code"] = Code(found["code"])
    state = state_like("state", arrays, like.state)
    extrema = {name: (low, arrays[f"highest/{name}"]) for name, low in lows.items()}
    return dataclasses.replace(like, state=state, extrema=extrema, **found)


def _counts(position: AnyPosition) -> list[str]:
    """The fields of a position other than its state and the extrema."""
    return [field.name for field in dataclasses.fields(position) if field.name not in ("state", "extrema")]


def state_numbers(name: str, state: State) -> dict[str, np.ndarray]:
    """The leaves of a state, numbered."""
    return {f"{name}/{i}": np.asarray(leaf) for i, leaf in enumerate(jax.tree.leaves(state))}


def state_like(name: str, arrays: Arrays, like: State) -> State:
    """The state whose leaves are in `arrays`, in the structure of `like`; raises FileError if they do not fit."""
    leaves, structure = jax.tree.flatten(like)
    found = [arrays.get(f"{name}/{i}") for i in range(len(leaves))]
    shapes = [None if leaf is None else leaf.shape for leaf in found]
    if shapes != [np.shape(leaf) for leaf in leaves] or f"{name}/{len(leaves)}" in arrays:
        raise FileError("The checkpoint belongs to another system or method: its state has other shapes.")
    return jax.tree.unflatten(structure, found)
