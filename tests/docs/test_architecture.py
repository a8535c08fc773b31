"""The page on the architecture: its diagram is the call tree of a run, and its files exist."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from types import CodeType, FrameType

import numpy as np

import coadjoint as co

ROOT = Path(__file__).parents[2]
SOURCE = Path(co.__file__).parent
PAGE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
Place = tuple[str, str]
"""The qualified name of a function, and its file."""


def drawn() -> list[tuple[Place | None, Place]]:
    """Each line of the diagram with the line that it is indented under."""
    block = re.search(r"^```text\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)
    assert block is not None
    above: dict[int, Place] = {}
    found: list[tuple[Place | None, Place]] = []
    for line in block.group(1).splitlines():
        name, file, _ = line.split(maxsplit=2)
        depth = (len(line) - len(line.lstrip())) // 2
        above[depth] = name, file
        found.append((above.get(depth - 1), above[depth]))
    return found


def test_the_diagram_is_the_call_tree_of_a_run() -> None:
    body = co.System(co.SO3(), lambda xi: 0.5 * xi @ (np.array([5.3, 5.2, 1.7]) * xi))
    start = body.state(xi=[0.2, 0.1, 2.0])
    tree = drawn()
    named = {place for _, place in tree}
    called: set[tuple[Place | None, Place]] = set()

    known: dict[int, tuple[CodeType, Place | None]] = {}  # comparing codes costs more

    def place(code: CodeType) -> Place | None:
        if id(code) not in known:
            here = code.co_qualname, code.co_filename.removeprefix(f"{SOURCE}/")
            known[id(code)] = code, here if here in named else None
        return known[id(code)][1]

    def note(frame: FrameType, event: str, argument: object) -> None:
        here = place(frame.f_code)
        if here is not None:
            above = frame.f_back
            while above is not None and place(above.f_code) is None:
                above = above.f_back
            called.add((None if above is None else place(above.f_code), here))

    before = sys.gettrace()
    sys.settrace(note)
    try:
        co.simulate(body, start, dt=0.01, steps=20, monitors=False)
    finally:
        sys.settrace(before)
    assert [pair for pair in tree if pair not in called] == []


def test_the_files_of_the_page_exist_and_it_is_short() -> None:
    files = set(re.findall(r"`([\w/]+\.py)`", PAGE))
    places = [str(file) for root in (SOURCE, ROOT / "tests", ROOT / "vehicles") for file in root.rglob("*.py")]
    assert len(files) > 15
    assert [file for file in sorted(files) if not any(name.endswith(f"/{file}") for name in places)] == []
    assert len(PAGE.split()) <= 1200
