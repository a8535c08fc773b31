"""PyTrees without JAX, in its order: dictionaries by sorted keys, fields as they are declared, None without a leaf.

`coadjoint.before_jax` puts these functions in the place of JAX's until JAX is loaded.
"""

from __future__ import annotations

import dataclasses
from collections import OrderedDict, defaultdict
from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

from coadjoint.arrays import PyTree
from coadjoint.postponed import object_of

IsLeaf = Callable[[PyTree], bool] | None


class OnlyJax(Exception):
    """A node, or a difference of two PyTrees, of which JAX is asked."""


class GetAttrKey(NamedTuple):
    """The name of a field on the path to a leaf."""

    name: str

    def __str__(self) -> str:
        return f".{self.name}"


class DictKey(NamedTuple):
    """A key of a dictionary on the path."""

    key: PyTree

    def __str__(self) -> str:
        return f"[{self.key!r}]"


class SequenceKey(NamedTuple):
    """A place in a sequence on the path."""

    idx: int

    def __str__(self) -> str:
        return f"[{self.idx}]"


class FlattenedIndexKey(NamedTuple):
    """The place of a child without a name on the path."""

    key: int

    def __str__(self) -> str:
        return f"[<flat index {self.key}>]"


def _by_places(_: object, children: list[PyTree]) -> Iterator[object]:
    return map(FlattenedIndexKey, range(len(children)))


class NodeKind(NamedTuple):
    """How nodes of a type come apart and together."""

    apart: Callable[[PyTree], tuple[Iterable[PyTree], PyTree]]
    """node ↦ children, and what is static."""
    together: Callable[[PyTree, PyTree, Iterable[PyTree]], PyTree]
    """(type, what is static, children) ↦ node."""
    keys: Callable[[PyTree, list[PyTree]], Iterable[object]] = _by_places
    """(node, children) ↦ the entries of the children in paths."""


def _by_keys(node: dict[PyTree, PyTree]) -> tuple[list[PyTree], tuple[PyTree, ...]]:
    try:
        keys = tuple(sorted(node))
    except TypeError:
        raise OnlyJax from None
    return [node[key] for key in keys], keys


def _ask(*_: object) -> PyTree:
    raise OnlyJax


_SEQUENCE = NodeKind(
    lambda node: (node, None),
    lambda kind, _, children: kind(children),
    lambda node, _: map(SequenceKey, range(len(node))),
)
_NAMED_TUPLE = NodeKind(
    lambda node: (node, None),
    lambda kind, _, children: kind(*children),
    lambda node, _: map(GetAttrKey, node._fields),
)
_PLAIN: dict[type, NodeKind] = {
    type(None): NodeKind(lambda _: ((), None), lambda *_: None),
    tuple: _SEQUENCE,
    list: _SEQUENCE,
    dict: NodeKind(
        _by_keys,
        lambda _, keys, children: dict(zip(keys, children, strict=True)),
        lambda node, _: map(DictKey, sorted(node)),
    ),
    OrderedDict: NodeKind(_ask, _ask),
    defaultdict: NodeKind(_ask, _ask),
}
registered: dict[type, NodeKind] = {}


def _kind(node: type) -> NodeKind | None:
    """The kind of a type of nodes, None of a type of leaves."""
    known = _PLAIN.get(node) or registered.get(node)
    return _NAMED_TUPLE if known is None and issubclass(node, tuple) and hasattr(node, "_fields") else known


class TreeStructure(NamedTuple):
    """A PyTree without the values of its leaves."""

    node: type | None = None
    """The type of a node, None of a leaf."""
    static: PyTree = None
    children: tuple[TreeStructure, ...] = ()

    def __eq__(self, other: object) -> bool:
        """Also to one that JAX gives."""
        return tuple.__eq__(self, other) if isinstance(other, TreeStructure) else repr(self) == repr(other)

    def __ne__(self, other: object) -> bool:
        return not self == other

    def __hash__(self) -> int:
        return tuple.__hash__(self)

    @property
    def num_leaves(self) -> int:
        return 1 if self.node is None else sum(child.num_leaves for child in self.children)

    def __getattr__(self, name: str) -> PyTree:
        """Further methods, of JAX's own structure."""
        if name.startswith("_"):
            raise AttributeError(name)
        return getattr(object_of("jax.tree_util.tree_structure")(self.unflatten(range(self.num_leaves))), name)

    def flatten_up_to(self, tree: PyTree) -> list[PyTree]:
        """The parts of a PyTree in the places of the leaves."""
        try:
            return [*_parts(self, tree)]
        except OnlyJax:
            return self.__getattr__("flatten_up_to")(tree)

    def unflatten(self, leaves: Iterable[object]) -> PyTree:
        left = iter(leaves)
        try:
            made = self._filled(left)
        except StopIteration:
            raise ValueError("There are fewer leaves than the PyTree has.") from None
        if next(left, self) is not self:
            raise ValueError("There are more leaves than the PyTree has.")
        return made

    def _filled(self, left: Iterator[object]) -> PyTree:
        if self.node is None:
            return next(left)
        children = [child._filled(left) for child in self.children]
        return (_kind(self.node) or _SEQUENCE).together(self.node, self.static, children)

    def __repr__(self) -> str:
        """As JAX writes it, because names of entries on disk contain it."""
        return f"PyTreeDef({self._text()})"

    def _text(self) -> str:
        parts = [child._text() for child in self.children]
        inner = ", ".join(parts)
        if self.node is None or self.node is type(None):
            return "*" if self.node is None else "None"
        if self.node is tuple:
            return f"({inner},)" if len(parts) == 1 else f"({inner})"
        if self.node is list:
            return f"[{inner}]"
        if self.node is dict:
            return "{" + ", ".join(f"{key!r}: {part}" for key, part in zip(self.static, parts, strict=True)) + "}"
        if self.node in registered:
            return f"CustomNode({self.node.__name__}[{self.static}], [{inner}])"
        return f"CustomNode(namedtuple[{self.node.__name__}], [{inner}])"


def tree_flatten(tree: PyTree, is_leaf: IsLeaf = None) -> tuple[list[PyTree], TreeStructure]:
    leaves: list[PyTree] = []

    def walk(node: PyTree) -> TreeStructure:
        kind = None if is_leaf is not None and is_leaf(node) else _kind(type(node))
        if kind is None:
            leaves.append(node)
            return TreeStructure()
        children, static = kind.apart(node)
        return TreeStructure(type(node), static, tuple(map(walk, children)))

    return leaves, walk(tree)


def tree_leaves(tree: PyTree, is_leaf: IsLeaf = None) -> list[PyTree]:
    return tree_flatten(tree, is_leaf)[0]


def tree_structure(tree: PyTree, is_leaf: IsLeaf = None) -> TreeStructure:
    return tree_flatten(tree, is_leaf)[1]


def tree_unflatten(structure: TreeStructure, leaves: Iterable[object]) -> PyTree:
    return structure.unflatten(leaves)


def tree_map(function: Callable[..., PyTree], tree: PyTree, *rest: PyTree, is_leaf: IsLeaf = None) -> PyTree:
    leaves, structure = tree_flatten(tree, is_leaf)
    rows = [leaves, *([*_parts(structure, other)] for other in rest)]
    return structure.unflatten(list(map(function, *rows)))


def tree_leaves_with_path(tree: PyTree, is_leaf: IsLeaf = None) -> list[tuple[tuple[PyTree, ...], PyTree]]:
    found: list[tuple[tuple[PyTree, ...], PyTree]] = []

    def walk(node: PyTree, path: tuple[PyTree, ...]) -> None:
        kind = None if is_leaf is not None and is_leaf(node) else _kind(type(node))
        if kind is None:
            found.append((path, node))
            return
        children = [*kind.apart(node)[0]]
        for key, child in zip(kind.keys(node, children), children, strict=True):
            walk(child, (*path, key))

    walk(tree, ())
    return found


def tree_map_with_path(function: Callable[..., PyTree], tree: PyTree) -> PyTree:
    return tree_structure(tree).unflatten([function(path, leaf) for path, leaf in tree_leaves_with_path(tree)])


def keystr(path: tuple[object, ...]) -> str:
    return "".join(map(str, path))


def all_leaves(values: Iterable[object]) -> bool:
    return all(_kind(type(value)) is None for value in values)


def like(structure: PyTree) -> TreeStructure | None:
    """The same as a structure of JAX; None where it has nodes of classes that are registered with JAX alone."""
    found = tree_structure(structure.unflatten(range(structure.num_leaves)))
    return found if repr(found) == repr(structure) else None


def _parts(structure: TreeStructure, tree: PyTree) -> Iterator[PyTree]:
    """The parts of a PyTree at the places of the leaves of another one."""
    if structure.node is None:
        yield tree
        return
    kind = _kind(type(tree)) if type(tree) is structure.node else None
    if kind is None:
        raise OnlyJax
    children, static = kind.apart(tree)
    children = [*children]
    if static != structure.static or len(children) != len(structure.children):
        raise OnlyJax
    for child, part in zip(structure.children, children, strict=True):
        yield from _parts(child, part)


def dataclass_kind(node: type, data: Iterable[str] | None = None, static: Iterable[str] = ()) -> NodeKind:
    if data is None:
        fields = dataclasses.fields(node)
        static = [field.name for field in fields if field.metadata.get("static", False)]
        data = [field.name for field in fields if field.name not in static]
    data, static = tuple(data), tuple(static)

    def apart(node: object) -> tuple[list[PyTree], tuple[PyTree, ...]]:
        return [getattr(node, name) for name in data], tuple(getattr(node, name) for name in static)

    def together(kind: type, values: tuple[PyTree, ...], children: Iterable[PyTree]) -> object:
        return kind(**dict(zip(data, children, strict=True)), **dict(zip(static, values, strict=True)))

    return NodeKind(apart, together, lambda *_: map(GetAttrKey, data))


def class_kind(node: PyTree) -> NodeKind:
    return NodeKind(
        lambda one: one.tree_flatten(),
        lambda kind, static, children: kind.tree_unflatten(static, children),
        lambda one, _: (key for key, _ in one.tree_flatten_with_keys()[0]),
    )


def kind_by_functions(node: type, apart: Callable[..., PyTree], together: Callable[..., PyTree]) -> NodeKind:
    return NodeKind(apart, lambda _, static, children: together(static, children))
