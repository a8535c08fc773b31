"""PyTrees without JAX are those of JAX: leaves, structures as text, paths, maps."""

from __future__ import annotations

from collections import OrderedDict, namedtuple
from dataclasses import dataclass, field

import jax
import numpy as np
import pytest

from coadjoint import trees
from coadjoint.spaces.named import Named

Pair = namedtuple("Pair", "second first")


@dataclass(frozen=True)
class Body:
    """A node with static fields."""

    mass: object
    shape: tuple[int, ...] = field(default=(3,), metadata={"static": True})
    inertia: object = None


@dataclass
class Skeleton:
    """A node by functions."""

    bones: object


def apart(one: Skeleton) -> tuple[tuple[object, ...], str]:
    return (one.bones, 7), "static"


def together(_: str, children: tuple[object, ...]) -> Skeleton:
    return Skeleton(children[0])


jax.tree_util.register_dataclass(Body)
jax.tree_util.register_pytree_node(Skeleton, apart, together)
EXAMPLES = {
    "a number": 1.0,
    "none": None,
    "a text": "leaf",
    "sequences": ((), [], (1.0,), [2.0], (3.0, [4.0, None])),
    "dictionaries by keys": {"b": 1.0, "a": {"d": (2.0,), "c": None}},
    "numbers as keys": {10: 1.0, 9: 2.0},
    "a named tuple": Pair(1.0, Pair(None, {"z": 2.0})),
    "a dataclass": Body({"y": 1.0}, (2, 4), [2.0]),
    "named values": Named(zeta=1.0, alpha=Named(m=np.ones(2))),
    "a node by functions": [Skeleton((1.0, None))],
}


@pytest.fixture(autouse=True)
def registered(monkeypatch):
    """The kinds of nodes, as `coadjoint.before_jax` registers them."""
    kinds = {Body: trees.dataclass_kind(Body), Named: trees.class_kind(Named)}
    kinds[Skeleton] = trees.kind_by_functions(Skeleton, apart, together)
    monkeypatch.setattr(trees, "registered", kinds)


@pytest.mark.cases(10)
@pytest.mark.parametrize("tree", EXAMPLES.values(), ids=EXAMPLES)
def test_leaves_structures_and_paths_are_those_of_jax(tree):
    leaves, structure = trees.tree_flatten(tree)
    expected, theirs = jax.tree_util.tree_flatten(tree)
    assert list(map(id, leaves)) == list(map(id, expected))
    assert repr(structure) == repr(theirs) and structure == theirs and structure.num_leaves == theirs.num_leaves
    assert trees.like(theirs) == structure
    ours = [(trees.keystr(path), leaf) for path, leaf in trees.tree_leaves_with_path(tree)]
    paths = [(jax.tree_util.keystr(path), leaf) for path, leaf in jax.tree_util.tree_leaves_with_path(tree)]
    assert [path for path, _ in ours] == [path for path, _ in paths]
    marked = trees.tree_map(lambda one, other: (one, str(other)), tree, tree)
    assert repr(marked) == repr(jax.tree.map(lambda one, other: (one, str(other)), tree, tree))
    none = trees.tree_leaves(tree, is_leaf=lambda one: one is None)
    assert list(map(id, none)) == list(map(id, jax.tree.leaves(tree, is_leaf=lambda one: one is None)))


@pytest.mark.parametrize("tree", [OrderedDict(b=1.0, a=2.0), {1: 0.0, "a": 1.0}])
def test_of_other_nodes_jax_is_asked(tree):
    with pytest.raises(trees.OnlyJax):
        trees.tree_flatten(tree)


def test_a_structure_with_nodes_that_only_jax_knows_has_no_like(monkeypatch):
    monkeypatch.setattr(trees, "registered", {})
    assert trees.like(jax.tree.structure([Body(1.0)])) is None


def test_another_structure_is_refused_as_by_jax():
    structure = trees.tree_structure({"a": 1.0, "b": (2.0, 3.0)})
    assert structure.flatten_up_to({"a": [4.0], "b": (5.0, None)}) == [[4.0], 5.0, None]
    with pytest.raises(ValueError):
        structure.flatten_up_to({"a": 4.0, "b": (5.0,)})
    with pytest.raises(ValueError):
        structure.unflatten([1.0, 2.0])
    with pytest.raises(ValueError):
        structure.unflatten([1.0, 2.0, 3.0, 4.0])


def test_maps_with_paths_unflatten_and_hash_as_those_of_jax():
    tree, other = {"b": (1, [2]), "a": None}, {"b": (3, [4]), "a": 5}
    structure = trees.tree_structure(tree)
    assert trees.tree_unflatten(structure, [7, 8]) == {"b": (7, [8]), "a": None}
    named = trees.tree_map_with_path(lambda path, leaf: f"{trees.keystr(path)} {leaf}", tree)
    assert named == jax.tree_util.tree_map_with_path(lambda path, leaf: f"{jax.tree_util.keystr(path)} {leaf}", tree)
    same, differs = trees.tree_structure({"b": (5, [6]), "a": None}), trees.tree_structure(other)
    assert same == structure and hash(same) == hash(structure) and (same != structure) is False and differs != structure
    assert trees.all_leaves([1, "x", 2.0]) and not trees.all_leaves([1, (2,)]) and not trees.all_leaves([None])
