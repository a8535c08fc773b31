"""One-line errors of a Python file: each changes a few characters within one line, found by the syntax tree.

sign        + for −, a minus that is missing
index       the next element, in a subscript or at the end of a slice
transpose   A for Aᵀ
constant    n + 1 for n, 2x for x, False for True
comparison  < for ≤, = for ≠, `is` for `is not`, `in` for `not in`
extremum    min for max, `all` for `any`, floor for ceil
guard       an `if` that raises, returns or goes on to the next never does; a check is not called
logic       `or` for `and`, a condition negated
order       the first two arguments, or the factors of a matrix product, exchanged
"""

from __future__ import annotations

import ast
import random
import re
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

Edit = tuple[int, int, str]
"""Characters from the first to before the second place become the text."""

COMPARISONS = {
    ast.Lt: ("<", "<="), ast.LtE: ("<=", "<"), ast.Gt: (">", ">="), ast.GtE: (">=", ">"), ast.Eq: ("==", "!="),
    ast.NotEq: ("!=", "=="), ast.Is: ("is", "is not"), ast.IsNot: ("is not", "is"), ast.In: ("in", "not in"),
    ast.NotIn: ("not in", "in"),
}  # fmt: skip
_PAIRS = ("max min", "maximum minimum", "argmax argmin", "nanmax nanmin", "amax amin", "any all", "floor ceil")
EXTREMA = {a: b for pair in _PAIRS for a, b in (pair.split(), pair.split()[::-1])}
ANY_ORDER = {
    "isinstance", "issubclass", "getattr", "hasattr", "setattr", "zip", "max", "min", "maximum", "minimum", "allclose",
    "isclose", "array_equal", "logical_and", "logical_or", "add", "multiply", "print", "enumerate", "hypot", "TypeVar",
    "cast", "namedtuple", "field", "range", "reshape",
}  # fmt: skip
"""Functions of whose first two arguments the order changes nothing, or whose wrong order any use shows."""

CHECK = re.compile(r"^_?(check|require|refuse|must|ensure|validate|demand|raise|warn)")
NAMES_ONLY = {"__all__", "__slots__", "TYPE_CHECKING"}


@dataclass(frozen=True)
class Mutant:
    file: str
    """Below the folder of the package, as `groups/so3.py`."""
    line: int
    operator: str
    edit: Edit
    before: str
    after: str
    """The changed line, without the blanks around it."""
    lines: tuple[int, int]
    """The first and the last line of the statement, or of its head."""

    @property
    def key(self) -> tuple[str, str, str]:
        return self.file, self.before, self.after


class _Text:
    """A text and its syntax tree, whose columns count bytes of UTF-8."""

    def __init__(self, text: str):
        self.text, self.tree = text, ast.parse(text)
        self.lines = text.splitlines(keepends=True)
        self.begins = [0]
        for line in self.lines:
            self.begins.append(self.begins[-1] + len(line))

    def _place(self, line: int, column: int) -> int:
        written = self.lines[line - 1]
        return self.begins[line - 1] + (
            column if written.isascii() else len(written.encode()[:column].decode(errors="ignore"))
        )

    def begin(self, node: ast.expr | ast.stmt) -> int:
        return self._place(node.lineno, node.col_offset)

    def end(self, node: ast.expr | ast.stmt) -> int:
        assert node.end_lineno is not None and node.end_col_offset is not None
        return self._place(node.end_lineno, node.end_col_offset)

    def of(self, node: ast.expr | ast.stmt) -> str:
        return self.text[self.begin(node) : self.end(node)]

    def whole(self, node: ast.expr | ast.stmt, text: str) -> Edit:
        return self.begin(node), self.end(node), text

    def between(self, left: ast.expr, right: ast.expr, old: str, new: str) -> Iterator[Edit]:
        """The first `old` between two nodes becomes `new`."""
        begin, end = self.end(left), self.begin(right)
        found = re.search(rf"(?<![\w<>=!]){re.escape(old)}(?![\w<>=])", self.text[begin:end].split("#")[0])
        if found:
            yield begin + found.start(), begin + found.end(), new

    def swapped(self, left: ast.expr, right: ast.expr) -> Iterator[Edit]:
        if self.of(left) != self.of(right):
            middle = self.text[self.end(left) : self.begin(right)]
            yield self.begin(left), self.end(right), self.of(right) + middle + self.of(left)


def _called(node: ast.Call) -> str:
    return node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")


def _is_text(node: ast.expr) -> bool:
    return isinstance(node, ast.JoinedStr) or (isinstance(node, ast.Constant) and isinstance(node.value, str))


def _number(node: ast.expr | None) -> int | None:
    """The value of a whole number, with its sign."""
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        value = _number(node.operand)
        return None if value is None else -value
    return node.value if isinstance(node, ast.Constant) and type(node.value) is int else None


def _index(t: _Text, node: ast.Subscript) -> Iterator[Edit]:
    within = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
    for part in within:
        for bound in (part.lower, part.upper) if isinstance(part, ast.Slice) else (part,):
            value = _number(bound)
            if value is not None and bound is not None:
                yield t.whole(bound, str(value + 1 if value >= 0 else value - 1))


def _transpose(t: _Text, node: ast.Attribute) -> Iterator[Edit]:
    if node.attr in ("T", "mT"):
        yield t.end(node.value), t.end(node), ""


def _constant(t: _Text, node: ast.Constant) -> Iterator[Edit]:
    value = node.value
    if isinstance(value, bool):
        yield t.whole(node, str(not value))
    elif isinstance(value, int):
        yield t.whole(node, str(value + 1))
    elif isinstance(value, float):
        yield t.whole(node, repr(2 * value if value else 1.0))


def _call(t: _Text, node: ast.Call) -> Iterator[tuple[str, Edit]]:
    name = _called(node)
    if name in EXTREMA:
        end = t.end(node.func)
        yield "extremum", (end - len(name), end, EXTREMA[name])
    if name in ("swapaxes", "transpose", "matrix_transpose") and node.args:
        yield (
            "transpose",
            t.whole(node, f"({t.of(node.args[0])})")
            if not isinstance(node.func, ast.Attribute) or t.of(node.func.value) in ("np", "jnp", "numpy")
            else (t.end(node.func.value), t.end(node), ""),
        )
    if len(node.args) > 1 and name not in ANY_ORDER and not any(isinstance(a, ast.Starred) for a in node.args[:2]):
        yield from (("order", edit) for edit in t.swapped(*node.args[:2]))


def _guard(t: _Text, node: ast.If) -> Iterator[Edit]:
    last = node.body[-1]
    if isinstance(last, ast.Raise | ast.Return | ast.Continue):
        yield t.whole(node.test, "False")


def _edits(t: _Text, node: ast.AST) -> Iterator[tuple[str, Edit]]:
    """What may be wrong at one node: its kind and the edit."""
    match node:
        case ast.BinOp(left, ast.Add() | ast.Sub() as op, right) if not (_is_text(left) or _is_text(right)):
            signs = ("+", "-") if isinstance(op, ast.Add) else ("-", "+")
            yield from (("sign", edit) for edit in t.between(left, right, *signs))
        case ast.BinOp(left, ast.MatMult(), right):
            yield from (("order", edit) for edit in t.swapped(left, right))
        case ast.UnaryOp(ast.USub(), operand):
            yield "sign", (t.begin(node), t.begin(operand), "")
        case ast.UnaryOp(ast.Not(), operand):
            yield "logic", (t.begin(node), t.begin(operand), "")
        case ast.BoolOp(op, values):
            words = ("and", "or") if isinstance(op, ast.And) else ("or", "and")
            yield from (("logic", edit) for edit in t.between(values[0], values[1], *words))
        case ast.Compare(left, [op], [right]):
            yield from (("comparison", edit) for edit in t.between(left, right, *COMPARISONS[type(op)]))
        case ast.IfExp(test=test):
            yield "logic", t.whole(test, f"not ({t.of(test)})")
        case ast.Subscript():
            yield from (("index", edit) for edit in _index(t, node))
        case ast.Attribute():
            yield from (("transpose", edit) for edit in _transpose(t, node))
        case ast.Constant():
            yield from (("constant", edit) for edit in _constant(t, node))
        case ast.Call():
            yield from _call(t, node)
        case ast.If():
            yield from (("guard", edit) for edit in _guard(t, node))
        case ast.Expr(ast.Call() as call) if CHECK.match(_called(call)):
            yield "guard", t.whole(node, "pass")


def _skipped(node: ast.AST) -> bool:
    """Texts, whose columns Python 3.11 does not know, what is for types alone, and lengths that are always equal."""
    match node:
        case ast.keyword("strict", ast.Constant(True)):
            return True
        case ast.Expr(ast.Constant()) | ast.JoinedStr():
            return True
        case ast.Assign([ast.Name(name)]) | ast.If(ast.Name(name)):
            return name in NAMES_ONLY
    return False


def _nodes(node: ast.AST, lines: tuple[int, int]) -> Iterator[tuple[ast.AST, tuple[int, int]]]:
    """All nodes but annotations, decorators, texts and constant subscripts, with the lines of their statements."""
    if isinstance(node, ast.stmt):
        body = getattr(node, "body", None)
        lines = node.lineno, (max(node.lineno, body[0].lineno - 1) if body else node.end_lineno or node.lineno)
    yield node, lines
    for name, field in ast.iter_fields(node):
        if name in ("annotation", "returns", "decorator_list", "type_params"):
            continue
        if isinstance(node, ast.Subscript) and name == "slice" and _number(field) is not None:
            continue
        for child in field if isinstance(field, list) else [field]:
            if isinstance(child, ast.AST) and not _skipped(child):
                yield from _nodes(child, lines)


def changed(text: str, edit: Edit) -> str:
    return text[: edit[0]] + edit[2] + text[edit[1] :]


def mutants(file: str, text: str) -> list[Mutant]:
    """All errors of one file, in the order in which they stand there; some may not parse, see `valid`."""
    t = _Text(text)
    found = {}
    for node, lines in _nodes(t.tree, (1, 1)):
        for operator, edit in _edits(t, node):
            if "\n" in text[edit[0] : edit[1]] or edit in found:
                continue
            number = text.count("\n", 0, edit[0]) + 1
            begin, old = t.begins[number - 1], t.lines[number - 1]
            new = changed(old, (edit[0] - begin, edit[1] - begin, edit[2]))
            found[edit] = Mutant(file, number, operator, edit, old.strip(), new.strip(), lines)
    return sorted(found.values(), key=lambda mutant: mutant.edit)


def valid(mutant: Mutant, text: str) -> bool:
    """Whether the changed text is Python, and means something else."""
    try:
        return ast.dump(ast.parse(changed(text, mutant.edit))) != ast.dump(ast.parse(text))
    except SyntaxError:
        return False


def shares(sizes: Mapping[str, int], count: int, least: int) -> dict[str, int]:
    """`count` shared out in proportion to the sizes, with `least` for each."""
    rest = max(count - least * len(sizes), 0)
    exact = {name: rest * size / sum(sizes.values()) for name, size in sizes.items()}
    found = {name: least + int(share) for name, share in exact.items()}
    left = sorted(exact, key=lambda name: (int(exact[name]) - exact[name], name))
    for name in left[: count - sum(found.values())] if count > sum(found.values()) else []:
        found[name] += 1
    return found


def draw(package: Path, seed: int, count: int, folders: Sequence[str] = (), least: int = 2) -> list[Mutant]:
    """A sample over the folders of a package, by their size; the same for the same seed and source.

    In each folder the kind of error is drawn first, so that kinds with few places come as often as others, and no line
    is drawn twice. folders: names of folders, all by default; files beside the folders are together `.`.
    """
    files = defaultdict(list)
    for path in sorted(package.rglob("*.py")):
        name = path.relative_to(package).as_posix()
        files[name.split("/")[0] if "/" in name else "."].append(name)
    chosen = {folder: files[folder] for folder in sorted(folders or files)}
    texts = {name: (package / name).read_text(encoding="utf-8") for names in chosen.values() for name in names}
    sizes = {folder: sum(len(texts[name]) for name in names) for folder, names in chosen.items()}
    found = []
    for folder, number in shares(sizes, count, least).items():
        kinds = defaultdict(list)
        for name in chosen[folder]:
            for mutant in mutants(name, texts[name]):
                kinds[mutant.operator].append(mutant)
        found += _drawn(random.Random(f"{seed} {folder}"), kinds, number, texts)
    return found


def _drawn(r: random.Random, kinds: dict[str, list[Mutant]], number: int, texts: Mapping[str, str]) -> list[Mutant]:
    found: dict[tuple[str, int], Mutant] = {}
    while len(found) < number and kinds:
        kind = r.choice(sorted(kinds))
        mutant = kinds[kind].pop(r.randrange(len(kinds[kind])))
        if not kinds[kind]:
            del kinds[kind]
        if valid(mutant, texts[mutant.file]):
            found.setdefault((mutant.file, mutant.line), mutant)
    return list(found.values())
