"""Xacro: properties, arguments, includes, macros and conditions, as far as descriptions of vehicles use them.

Expressions are arithmetic; no Python is run, no YAML is loaded and no address is opened. Files are included from below
one folder only. Expanded elements keep the file and line of their source.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from coadjoint.errors import ArgumentError, FileError
from coadjoint.models.descriptions.elements import Element, read_elements
from coadjoint_vehicles.importing.arithmetic import value_of
from coadjoint_vehicles.importing.workspace import package_folder

DEEPEST, MOST, LONGEST = 64, 50_000, 100_000
"""The most elements, macros, includes and properties within each other, steps of making, and characters of a text."""
MOST_FILES, MOST_BYTES, MOST_WRITTEN = 256, 16_000_000, 10_000_000
"""The most files that are read, their bytes, and the characters that are made in all."""
LOOKS = ("visual", "material")
"""Elements without which a vehicle moves as with them."""
RUN = "run xacro on it first, as in `xacro vehicle.xacro > vehicle.urdf`, and import its result"
_DOLLAR = re.compile(r"\$\$|\$\{([^{}]*)\}|\$\(([^()]*)\)")

_ARGUMENT = re.compile(r"(?<!\$)\$\(arg ([\w.-]+)\)")
_PARAMETER = re.compile(r"(?:'[^']*'|[^\s'])+")


@dataclass(eq=False)
class Scope:
    """Names of a macro's call, and of the enclosing scopes."""

    outer: Scope | None = None
    names: dict[str, str] = field(default_factory=dict)
    blocks: dict[str, tuple[Element, Scope]] = field(default_factory=dict)
    asked: set[str] = field(default_factory=set)

    def find(self, name: str) -> tuple[str, Scope] | None:
        scope: Scope | None = self
        while scope is not None:
            if name in scope.names:
                return scope.names[name], scope
            scope = scope.outer
        return None

    def block(self, name: str) -> tuple[Element, Scope] | None:
        scope: Scope | None = self
        while scope is not None:
            if name in scope.blocks:
                return scope.blocks[name]
            scope = scope.outer
        return None

    @property
    def whole(self) -> Scope:
        """The outermost."""
        return self if self.outer is None else self.outer.whole


@dataclass
class Xacro:
    """A description while it is made. folder: includes must lie below it. arguments: values of <xacro:arg>."""

    folder: Path
    arguments: dict[str, str] = field(default_factory=dict)
    macros: dict[str, Element] = field(default_factory=dict)
    files: list[str] = field(default_factory=list)
    asked: set[str] = field(default_factory=set)
    """The arguments that <xacro:arg> declares or $(arg NAME) takes."""
    missing: list[str] = field(default_factory=list)
    """Sentences on missing includes and macros."""
    unseen: list[str] = field(default_factory=list)
    """Sentences on looks whose expressions are not read."""
    made: int = 0
    written: int = 0
    bytes: int = 0
    open: int = 0

    def read(self, path: Path) -> Element:
        """The root of a file with everything in it made; raises FileError."""
        root = self._root(path)
        found = list(self._element(root, Scope(), 0, path.parent))
        return found[0]

    def _root(self, path: Path) -> Element:
        try:
            name = str(path.resolve().relative_to(self.folder.resolve()))
        except ValueError:
            raise FileError(
                f"The file {path} lies outside of the folder {self.folder}, which includes are read from: give a "
                "folder that holds both by --folder."
            ) from None
        self.files.append(name)
        self.bytes += path.stat().st_size
        if len(self.files) > MOST_FILES or self.bytes > MOST_BYTES:
            raise FileError(
                f"The file {path} is beyond {MOST_FILES} files or {MOST_BYTES // 10**6} MB, which no vehicle needs."
            )
        return read_elements(path, name)

    def _children(self, of: Element, scope: Scope, depth: int, beside: Path) -> Iterator[Element]:
        for child in of.children:
            yield from self._element(child, scope, depth, beside)

    def _element(self, element: Element, scope: Scope, depth: int, beside: Path) -> Iterator[Element]:
        """The expansion of an element: itself with values substituted, its replacement, or nothing."""
        self._count(element)
        if depth > DEEPEST:
            raise element.fail(f"is within more than {DEEPEST} elements, macros and includes.")
        if element.tag in LOOKS:
            yield self._looks(element, scope, depth, beside)
            return
        if not element.tag.startswith("xacro:"):
            yield self._copied(element, scope, depth, beside)
            return
        word = element.tag.removeprefix("xacro:")
        if word == "property":
            self._property(element, scope)
        elif word == "arg":
            self._argument(element, scope)
        elif word == "include":
            yield from self._included(element, scope, depth, beside)
        elif word == "macro":
            self.macros[element.attributes.get("name", "").removeprefix("xacro:")] = element
        elif word == "insert_block":
            yield from self._inserted(element, scope, depth, beside)
        elif word in ("if", "unless"):
            if self._holds(element, scope) == (word == "if"):
                yield from self._children(element, scope, depth + 1, beside)
        else:
            yield from self._called(word, element, scope, depth, beside)

    def _looks(self, element: Element, scope: Scope, depth: int, beside: Path) -> Element:
        """An element that only says how the vehicle looks, empty where its expressions are not read."""
        try:
            return self._copied(element, scope, depth, beside)
        except FileError as error:
            self.unseen.append(f"{element.place}: of {element.label}, how it looks, nothing is made: {error}")
            return Element(element.tag, {}, element.file, element.line)

    def _copied(self, element: Element, scope: Scope, depth: int, beside: Path) -> Element:
        values = {
            key: self.text(value, scope, element)
            for key, value in element.attributes.items()
            if not key.startswith("xmlns")
        }
        made = Element(element.tag, values, element.file, element.line)
        made.children = list(self._children(element, scope, depth + 1, beside))
        made.text = self.text(element.text, scope, element)
        return made

    def _count(self, element: Element) -> None:
        """One more step of making; raises FileError when they are too many."""
        self.made += 1
        if self.made > MOST:
            raise element.fail(f"makes more than {MOST:,} elements and values, which no vehicle needs.")

    def _property(self, element: Element, scope: Scope) -> None:
        name, value = element.attributes.get("name"), element.attributes.get("value", element.attributes.get("default"))
        if not name:
            raise element.fail("needs a name.")
        if value is None:
            scope.blocks[name] = (element, scope)
            return
        word = element.attributes.get("scope")
        where = scope.whole if word == "global" else (scope.outer or scope) if word == "parent" else scope
        if "value" in element.attributes or where.find(name) is None:
            where.names[name] = value

    def _argument(self, element: Element, scope: Scope) -> None:
        name = element.attributes.get("name", "")
        self.asked.add(name)
        if "default" in element.attributes:
            self.arguments.setdefault(name, self.text(element.attributes["default"], scope, element))

    def _included(self, element: Element, scope: Scope, depth: int, beside: Path) -> Iterator[Element]:
        path = self._include_path(element, scope, beside)
        if not path.is_file():
            self.missing.append(f"{element.place}: the file {path} is not there, so that nothing of it is read.")
            return
        yield from self._children(self._root(path), scope, depth + 1, path.parent)

    def _include_path(self, element: Element, scope: Scope, beside: Path) -> Path:
        given = element.attributes.get("filename", "")
        if not given:
            raise element.fail("needs a filename.")
        package = re.match(r"\$\(find ([\w.-]+)\)/?", given)
        if package is not None:
            path = package_folder(self.folder, package.group(1)) / self.text(given[package.end() :], scope, element)
        else:
            name = self.text(given, scope, element)
            if "://" in name:
                raise element.fail(f"includes {name}: addresses are not opened, copy the file into {self.folder}.")
            path = beside / name
        if not path.resolve().is_relative_to(self.folder.resolve()):
            raise element.fail(
                f"includes {path}, outside of the folder {self.folder} that files are read from: give a folder that "
                "holds both by --folder."
            )
        return path

    def _inserted(self, element: Element, scope: Scope, depth: int, beside: Path) -> Iterator[Element]:
        name = element.attributes.get("name", "")
        found = scope.block(name)
        if found is None:
            raise element.fail("inserts a block that the call of its macro does not give.")
        block, where = found
        if block.tag == "xacro:property":
            yield from self._children(block, where, depth + 1, beside)
        else:
            yield from self._element(block, where, depth + 1, beside)

    def _holds(self, element: Element, scope: Scope) -> bool:
        word = self.text(element.attributes.get("value", ""), scope, element).strip()
        if word.lower() in ("true", "false"):
            return word.lower() == "true"
        try:
            return float(word) != 0
        except ValueError:
            raise element.fail(f"needs a number, true or false, but its value is {word!r}.") from None

    def _called(self, word: str, element: Element, scope: Scope, depth: int, beside: Path) -> Iterator[Element]:
        """The expansion of the macro of that name."""
        name = element.attributes.get("macro", word) if word == "call" else word
        macro = self.macros.get(name)
        if macro is None:
            self.missing.append(f"{element.place}: there is no macro `{name}`, so that nothing of it is made.")
            return
        inner = Scope(scope)
        blocks = list(element.children)
        for parameter in _PARAMETER.findall(macro.attributes.get("params", "")):
            self._given(parameter, element, scope, inner, blocks)
        yield from self._children(macro, inner, depth + 1, beside)

    def _given(self, parameter: str, element: Element, scope: Scope, inner: Scope, blocks: list[Element]) -> None:
        """One parameter of a macro from its call: a block, an attribute, or its default."""
        if parameter.startswith("*"):
            name = parameter.lstrip("*")
            if not blocks:
                raise element.fail(f"needs a block for `{name}`.")
            inner.blocks[name] = (blocks.pop(0), scope)
            return
        name, _, default = parameter.partition(":=" if ":=" in parameter else "=")
        if name in element.attributes:
            inner.names[name] = self.text(element.attributes[name], scope, element)
        elif default or "=" in parameter:
            above = scope.find(name) if default.startswith("^") else None
            inner.names[name] = above[0] if above else default.lstrip("^|").strip("'\"")
        else:
            raise element.fail(f"needs the attribute `{name}`, a parameter of its macro.")

    def text(self, given: str, scope: Scope, element: Element) -> str:
        """A text with ${…} and $(…) in it replaced; raises FileError with file and line."""

        def replaced(found: re.Match[str]) -> str:
            expression, command = found.groups()
            if expression is not None:
                return self._value(expression, scope, element)
            if command is not None:
                return self._command(command.split(), element)
            return "$"

        if "${" in given:  # an argument may stand within an expression
            given = _ARGUMENT.sub(lambda found: self._command(["arg", found[1]], element), given)
        made = _DOLLAR.sub(replaced, given) if "$" in given else given
        if len(made) > LONGEST:
            raise element.fail(f"makes a text of more than {LONGEST:,} characters.")
        self.written += len(made)
        if self.written > MOST_WRITTEN:
            raise element.fail(f"makes more than {MOST_WRITTEN:,} characters in all, which no vehicle needs.")
        return made

    def _value(self, expression: str, scope: Scope, element: Element) -> str:
        def held(name: str) -> str | None:
            self._count(element)
            found = scope.find(name)
            if found is None:
                return None
            raw, where = found
            if "$" not in raw:
                return raw
            if name in where.asked:
                raise ArgumentError(f"the property `{name}` is defined by itself")
            if self.open > DEEPEST:
                raise ArgumentError(f"more than {DEEPEST} properties are defined by one another")
            where.asked.add(name)
            self.open += 1
            try:
                return self.text(raw, where, element)
            finally:
                where.asked.discard(name)
                self.open -= 1

        try:
            value = value_of(expression, held)
        except ArgumentError as error:
            raise element.fail(f"cannot be made: {error}: {RUN}.") from None
        if isinstance(value, str):
            return value
        return str(int(value)) if abs(value) < 1e15 and value == int(value) else repr(value)

    def _command(self, words: list[str], element: Element) -> str:
        if len(words) == 2 and words[0] == "arg":
            self.asked.add(words[1])
            if words[1] not in self.arguments:
                raise element.fail(f"needs the argument `{words[1]}`: give it by --set {words[1]}=VALUE.")
            return self.arguments[words[1]]
        if words[:1] == ["find"] and len(words) == 2:
            return f"package://{words[1]}"
        raise element.fail(f"has $({' '.join(words)}), of which only `arg` and `find` are read: {RUN}.")
