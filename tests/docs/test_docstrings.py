"""The docstrings of the most public functions and classes say something of each of their arguments."""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Callable, Iterator

import pytest

import coadjoint as co
from imports import parsed

PACKAGES = (co, co.difference_maps, co.errors, co.groups, co.mechanics, co.methods, co.simulation, co.spaces, co.sweeps)
PUBLIC = list(dict.fromkeys(getattr(package, name) for package in PACKAGES for name in package.__all__))
PUBLIC = [one for one in PUBLIC if one not in (co.simulation.Ensemble, co.simulation.Run)]  # which runs return
PUBLIC.append(co.System.state)
PUBLIC = [one for one in PUBLIC if callable(one) and not (inspect.isclass(one) and issubclass(one, Exception))]
PUBLIC += [co.stability.steady_motion, co.stability.stability, co.stability.energy_casimir]
PUBLIC += [co.stability.linearised, co.stability.step_modes]


@pytest.mark.parametrize("public", PUBLIC, ids=lambda public: public.__qualname__)
def test_every_argument_is_explained(public: Callable) -> None:
    inherited = [kind.__doc__ or "" for kind in getattr(public, "__mro__", (public,))]
    explained = {name for text in inherited for name in names_before_colons(text)}
    missing = set(inspect.signature(public).parameters) - {"self", "args", "kwargs"} - explained
    assert not missing, f"The docstring of {public.__qualname__} says nothing of {sorted(missing)}."


def names_before_colons(text: str) -> set[str]:
    """The names of arguments that a colon follows, as in `q, qdot: …`, at the start of a line or of a sentence."""
    found = re.findall(r"(?:^\s*|[.;] )\**(\w+(?:, \w+)*):(?: |$)", text, re.MULTILINE)
    return {name for names in found for name in names.split(", ")}


CHAPTERS = ("groups", "spaces", "difference_maps", "mechanics", "methods", "theory", "stability", "audit", "models")
RUNS = ("run", "result", "simulate", "trajectory", "resume", "saved", "events", "steppers.stepper")
"""Of `simulation`, what `co.simulate` returns and what `coadjoint` itself names."""
ARRAY = re.compile(r"\b(Array|ArrayLike|ndarray)\b")
SIZE = (
    r"(?:…|\.\.\.|\d+N?²?|N²?|n|k|m|d|j|dim|ambient|members|nodes|rows|steps|lines|unknowns|symmetries|size|count|s|y|z"
)
SIZE += r"|number of \w+|[a-z]+ of \w+)"
SIZE += r"(?: [GQV]\b\*?)?(?: [+−·] [\w ]+)?"
SHAPE = re.compile(rf"\({SIZE},(?: {SIZE}(?:, {SIZE})*)?\)|\bshapes?\b|\b(?:[Oo]ne|a) number\b|\bnumbers\b")


def bases(tree: ast.ClassDef, known: dict[str, ast.ClassDef]) -> Iterator[ast.ClassDef]:
    for base in tree.bases:
        if isinstance(base, ast.Name) and base.id in known:
            yield known[base.id]
            yield from bases(known[base.id], known)


def functions(tree: ast.Module, known: dict[str, ast.ClassDef]) -> Iterator[tuple[str, ast.FunctionDef, str]]:
    """Public functions and methods with their docstrings; what overrides a member of the library has its docstring."""
    for node in tree.body:
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
            yield node.name, node, ast.get_docstring(node) or ""
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            derived = {member.name for base in bases(node, known) for member in methods(base)}
            for member in methods(node):
                if member.name == "__init__":
                    yield f"{node.name}.__init__", member, ast.get_docstring(node) or ""
                elif not member.name.startswith("_") and member.name not in derived:
                    yield f"{node.name}.{member.name}", member, ast.get_docstring(member) or ""


def methods(tree: ast.ClassDef) -> list[ast.FunctionDef]:
    return [member for member in tree.body if isinstance(member, ast.FunctionDef)]


def has_arrays(function: ast.FunctionDef) -> bool:
    """Whether an argument or the result is an array; the arguments of a function that is an argument do not count."""
    given = [*function.args.posonlyargs, *function.args.args, *function.args.kwonlyargs]
    written = [ast.unparse(note) for note in (*(a.annotation for a in given), function.returns) if note is not None]
    return any(ARRAY.search(re.sub(r"Callable\[.*\]", "", note)) for note in written)


@pytest.mark.long
def test_public_functions_of_arrays_state_a_shape() -> None:
    trees = parsed()
    known = {node.name: node for tree in trees.values() for node in tree.body if isinstance(node, ast.ClassDef)}
    public = [m for m in trees if m.split(".")[1:2] and m.split(".")[1] in CHAPTERS]
    public += [f"coadjoint.simulation.{name}" for name in RUNS]
    found = [(f"{m}.{name}", f, text) for m in public for name, f, text in functions(trees[m], known) if has_arrays(f)]
    assert len(found) > 200
    silent = [name for name, _, text in found if not SHAPE.search(text)]
    assert not silent, "Say the shape of arrays, as in (dim,) or `one number`, in the docstrings of: " + ", ".join(
        silent
    )


@pytest.mark.long
def test_public_classes_with_arrays_state_a_shape() -> None:
    trees = parsed()
    kinds = [
        (m, node)
        for m, tree in trees.items()
        if m.split(".")[1:2] and m.split(".")[1] in CHAPTERS
        for node in tree.body
    ]
    kinds = [
        (m, n) for m, n in kinds if isinstance(n, ast.ClassDef) and not n.name.startswith("_") and has_array_fields(n)
    ]
    assert len(kinds) > 15
    silent = [f"{m}.{node.name}" for m, node in kinds if not SHAPE.search(ast.get_docstring(node) or "")]
    assert not silent, "Say the shape of the fields that are arrays in the docstrings of: " + ", ".join(silent)


def has_array_fields(kind: ast.ClassDef) -> bool:
    notes = [ast.unparse(field.annotation) for field in kind.body if isinstance(field, ast.AnnAssign)]
    return any(ARRAY.search(re.sub(r"Callable\[.*\]", "", note)) for note in notes)
