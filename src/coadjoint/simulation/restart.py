"""The exact last record of a run in its file, with the parameters, so that a run can be continued from the file."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import jax
import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError, FileError
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.invariance import in_words
from coadjoint.mechanics.parameters import Parameters
from coadjoint.mechanics.state import Origin, State
from coadjoint.mechanics.system import System
from coadjoint.methods.rattle import Reactions, kept
from coadjoint.simulation.result import LAST_RECORD
from coadjoint.spaces.named import Named
from coadjoint.texts import Table

if TYPE_CHECKING:
    import xarray


_VECTORS = ("n", "nu", "pi", "a", "mu", "xi")


_FREE = ("inputs", "internal", "internal_mean", "internal_end")


def written(record: State, system: System) -> Table:
    """The last record, without the memory of the method save multipliers, and the parameters of the run.

    Each is a row of numbers with the paths and shapes of its parts as the attribute `parts`.
    """
    memory = kept(record)
    memory = None if memory is None else replace(memory, base=None, independent=None, kept=None)
    last = record.replace(memory=memory, ledger=None)
    return {name: _row(name, tree) for name, tree in zip(LAST_RECORD, (last, system.parameters), strict=True)}


def _row(name: str, tree: PyTree) -> tuple[str, np.ndarray, dict[str, str]]:
    found = jax.tree_util.tree_leaves_with_path(tree)
    parts = [[[str(getattr(key, "name", key)) for key in path], np.shape(leaf)] for path, leaf in found]
    numbers = np.concatenate([np.zeros(0), *(np.ravel(np.asarray(leaf, float)) for _, leaf in found)])
    return f"{name}_numbers", numbers, {"parts": json.dumps(parts)}


def read(found: Mapping[str, object], dataset: xarray.Dataset, system: System | None) -> State:
    """The record that `written` put into the file of a dataset, with the velocities at its node.

    Raises ArgumentError without a system and for another one, and FileError if the file lacks the record.
    """
    if any(name not in found for name in LAST_RECORD):
        raise FileError(
            "This file holds no record to go on from: it is of an ensemble, of a run that streamed to its folder, "
            "which goes on by co.resume(folder, system), or of an older version."
        )
    if system is None:
        raise ArgumentError(
            "A record to go on from needs the system, which a file does not hold: load it with co.load(path, system)."
        )
    attributes = dataset.attrs
    where = f"{attributes.get('group')}" + (", right-invariant" if attributes.get("invariance") == "right" else "")
    if where != in_words(system.places):
        raise ArgumentError(
            f"The file is of a run on {where}, but the system that was given lives on {in_words(system.places)}."
        )
    record, parameters = (_parts(found[name]) for name in LAST_RECORD)
    if ("internal_time",) in record:
        raise FileError(
            "This file was written by an older version, in which internal states were held from node to node: begin "
            "anew, from system.state(…)."
        )
    of_run = replace_parameters(system, _parameters(parameters, system))
    last = _state(record, system).replace(origin=Origin(of_run))
    return _at_node(dataset, system, last)


def _at_node(dataset: xarray.Dataset, system: System, last: State) -> State:
    """The record with the velocities at its node; files of older versions hold only those of steps."""
    if not any(str(name).startswith(("xi_step", "nu_step")) for name in dataset):
        return last
    group, Q, _ = system.places
    xi = np.ravel(dataset["xi"].values[-1]) if "xi" in dataset else last.xi
    parts = [dataset[name].values[-1] for name in Q.components(group, "nu") if name in dataset]
    nu = np.concatenate(parts) if parts else last.nu
    return last.replace(xi=xi, nu=nu, origin=Origin(last.origin.system, (last.xi, last.nu)))


def _parts(row: PyTree) -> dict[tuple[str, ...], np.ndarray]:
    numbers, start, found = np.asarray(row.values, np.float64), 0, {}
    for path, shape in json.loads(row.attrs["parts"]):
        end = start + int(np.prod(shape))
        found[tuple(path)] = numbers[start:end].reshape(shape)
        start = end
    return found


def _state(record: dict[tuple[str, ...], np.ndarray], system: System) -> State:
    group, Q, V = system.places
    sizes = (Q.ambient(group),) * 3 + (V.ambient(group),) + (group.dim,) * 2
    vectors: Table = {name: record[(name,)] for name in _VECTORS}
    leaves, structure = jax.tree_util.tree_flatten(evaluate(group.identity))
    g = [leaf for path, leaf in record.items() if path[0] == "g"]
    fits = [v.shape == (size,) for v, size in zip(vectors.values(), sizes, strict=True)]
    carried = bool(g) or not leaves  # by co.IsospectralMidpoint() records have no g
    if (carried and [np.shape(x) for x in g] != [np.shape(x) for x in leaves]) or not all(fits):
        raise ArgumentError(
            "The file is of a run of another system than the one that was given: its spaces have other dimensions."
        )
    within = {name: _tree({path[1:]: leaf for path, leaf in record.items() if path[0] == name}) for name in _FREE}
    held = within["inputs"]
    return State(
        t=record[("t",)][()],
        g=jax.tree_util.tree_unflatten(structure, g) if carried else None,
        inputs=Parameters(**held.asdict()) if isinstance(held, Named) else held,
        internal=within["internal"],
        internal_mean=within["internal_mean"],
        internal_end=within["internal_end"],
        internal_due=record[("internal_due",)][()] if ("internal_due",) in record else None,
        memory=_multipliers(record),
        t_rest=record[("t_rest",)][()],
        places=system.places,
        **vectors,
    )


def _multipliers(record: dict[tuple[str, ...], np.ndarray]) -> Reactions | None:
    """The guess of the multipliers of constraints."""
    if ("memory", "end") not in record:
        return None
    return Reactions(record["memory", "step"], record["memory", "end"], base=None)


def _tree(leaves: dict[tuple[str, ...], np.ndarray]) -> PyTree:
    """An array alone, values under names, or None."""
    if () in leaves:
        return leaves[()]
    heads = list(dict.fromkeys(path[0] for path in leaves))
    inner = {head: {path[1:]: leaf for path, leaf in leaves.items() if path[0] == head} for head in heads}
    return Named(**{head: _tree(part) for head, part in inner.items()}) if heads else None


def _parameters(given: dict[tuple[str, ...], np.ndarray], system: System) -> Parameters | None:
    """The parameters of the run in the structure of those of the system."""
    own = {
        tuple(str(getattr(key, "name", key)) for key in path): np.shape(leaf)
        for path, leaf in jax.tree_util.tree_leaves_with_path(system.parameters)
    }
    if own != {name: leaf.shape for name, leaf in given.items()}:
        raise ArgumentError(
            f"The file is of a run with the parameters {_listed(given)}, but the system that was given has "
            f"{_listed(own)}, or of other shapes."
        )
    return jax.tree_util.tree_unflatten(jax.tree_util.tree_structure(system.parameters), [given[name] for name in own])


def _listed(names: Mapping[tuple[str, ...], Any]) -> str:
    return ", ".join(f"`{'.'.join(name)}`" for name in names) or "none"
