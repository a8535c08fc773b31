"""XML as a tree of elements that know their file and line and whether they were read.

A document type raises FileError, which excludes entities and their targets; sizes and depths are bounded.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from coadjoint.errors import FileError
from coadjoint.texts import file_text

LARGEST = 4_000_000
"""The most bytes of a file."""
DEEPEST, MOST = 64, 50_000
"""The most elements within each other, and the most in a file."""


@dataclass(eq=False)
class Element:
    """One element: tag and attributes as written, its text, its place, and its parts read so far."""

    tag: str
    attributes: dict[str, str]
    file: str
    line: int
    children: list[Element] = field(default_factory=list)
    text: str = ""
    taken: bool = False
    asked: set[str] = field(default_factory=set)

    @property
    def place(self) -> str:
        """Its file and line: "rexrov.gazebo.xacro:43"."""
        return f"{self.file}:{self.line}"

    @property
    def label(self) -> str:
        """Its name in messages: its tag with its name, if it has one."""
        name = self.attributes.get("name") or self.attributes.get("reference")
        return f"<{self.tag}> {name!r}" if name else f"<{self.tag}>"

    def get(self, name: str) -> str | None:
        """An attribute, which counts as read."""
        self.asked.add(name)
        return self.attributes.get(name)

    def first(self, tag: str) -> Element | None:
        """Its first child of this tag, which counts as read."""
        found = next((child for child in self.children if child.tag == tag), None)
        if found is not None:
            found.taken = True
        return found

    def all(self, tag: str) -> list[Element]:
        """Its children of this tag, which count as read."""
        found = [child for child in self.children if child.tag == tag]
        for child in found:
            child.taken = True
        return found

    def walk(self) -> Iterator[Element]:
        """Itself and all below it."""
        yield self
        for child in self.children:
            yield from child.walk()

    def fail(self, sentence: str) -> FileError:
        """The error to raise about it, with file and line in front."""
        return FileError(f"{self.place}: {self.label} {sentence}")


def read_elements(path: Path, name: str) -> Element:
    """The root element of a file; messages show `name`.

    Raises FileError for a file that is not XML, has a document type, or is too large or too deep.
    """
    return parse(file_text(path, most=LARGEST), name)


def parse(text: str, name: str) -> Element:
    """The root element of a text."""
    parser = expat.ParserCreate("utf-8")
    parser.buffer_text = True
    open_elements: list[Element] = []
    roots: list[Element] = []
    count = 0

    def begin(tag: str, attributes: dict[str, str]) -> None:
        nonlocal count
        count += 1
        if len(open_elements) >= DEEPEST or count > MOST:
            what = f"{DEEPEST} elements within each other" if count <= MOST else f"{MOST:,} elements"
            raise FileError(f"The file {name} has more than {what}, which no description needs (line {_line(parser)}).")
        made = Element(tag, dict(attributes), name, _line(parser))
        (open_elements[-1].children if open_elements else roots).append(made)
        open_elements.append(made)

    def refuse(*_: object) -> None:
        raise FileError(
            f"{name}:{_line(parser)}: a document type (<!DOCTYPE …>) can name entities and other files, and is not "
            "read: take it out."
        )

    parser.StartElementHandler = begin
    parser.EndElementHandler = lambda _: _ended(open_elements)
    parser.CharacterDataHandler = lambda data: _told(open_elements, data)
    parser.StartDoctypeDeclHandler = refuse
    parser.EntityDeclHandler = refuse
    try:
        parser.Parse(text.encode("utf-8"), True)
    except expat.ExpatError as error:
        said = expat.ErrorString(error.code)
        raise FileError(f"{name}:{error.lineno}: this XML cannot be read: {said}.") from None
    return roots[0]


def _line(parser: expat.XMLParserType) -> int:
    return parser.CurrentLineNumber


def _ended(open_elements: list[Element]) -> None:
    open_elements.pop()


def _told(open_elements: list[Element], data: str) -> None:
    if open_elements:
        open_elements[-1].text += data
