"""Power losses: a run is recorded as it writes, and the folders are made that a loss at each moment could leave.

A loss keeps of a file what was forced to the disk, and of a folder the names that it had when it was forced. What came
later is kept, lost, or kept in part. The names of one folder change in their order, and a move between two folders is
one change, as on file systems with a journal; the bytes of files and the names of different folders keep no order.
"""

from __future__ import annotations

import os
import random
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

Left = dict[str, bytes | None]
"""What a folder holds: the bytes of files by their places, None for folders."""


_ROOT = 1
"""The number of the folder in which all is."""


@dataclass
class Tree:
    """All folders and files at one moment, by numbers that they keep when they are moved."""

    folders: dict[int, dict[str, int]] = field(default_factory=dict)
    files: dict[int, bytes] = field(default_factory=dict)


@dataclass
class History:
    """A tree after each change, what was forced to the disk when, and moves between folders."""

    root: Path
    trees: list[Tree] = field(default_factory=list)
    forced: list[tuple[int, int]] = field(default_factory=list)
    """(moment, number of the file or folder)."""
    moves: list[tuple[int, int, int]] = field(default_factory=list)
    """(moment, from this folder, to that one)."""
    _numbers: dict[int, int] = field(default_factory=dict)
    _next: int = 0

    def look(self) -> None:
        """Take down what there is, if it has changed."""
        seen: dict[int, int] = {}
        tree = Tree()
        self._walk(self.root, tree, seen)
        self._numbers = seen
        if not self.trees or tree != self.trees[-1]:
            self.trees.append(tree)

    def _walk(self, path: Path, tree: Tree, seen: dict[int, int]) -> int:
        inode = path.stat().st_ino
        if inode not in self._numbers:
            self._next += 1
        number = seen[inode] = self._numbers.get(inode, self._next)
        if path.is_dir():
            tree.folders[number] = {name: self._walk(path / name, tree, seen) for name in sorted(os.listdir(path))}
        else:
            tree.files[number] = path.read_bytes()
        return number

    def number(self, inode: int) -> int | None:
        """That of a file or folder that is there now; None for one elsewhere."""
        return self._numbers.get(inode)

    # What a loss leaves.

    def left(self, moment: int, choose: Choice) -> Left:
        """What is found after a loss of power at a moment."""
        first = dict.fromkeys((*self.trees[0].folders, *self.trees[0].files), 0)
        last = first | {number: when for when, number in self.forced if when <= moment}
        cuts = {number: choose.moment(last.get(number), moment) for number in _all(self.trees[: moment + 1])}
        for _ in self.moves:
            for when, source, target in self.moves:
                if when <= moment and max(_at(cuts, source), _at(cuts, target)) >= when:
                    cuts[source], cuts[target] = max(_at(cuts, source), when), max(_at(cuts, target), when)
        left: Left = {}
        self._found(_ROOT, "", cuts, lambda n: self._bytes(n, last.get(n), moment, choose), left)
        return left

    def _found(self, number: int, place: str, cuts: dict[int, int], read: Callable[[int], bytes], left: Left) -> None:
        cut = cuts[number]
        for name, inner in (self.trees[cut].folders.get(number, {}) if cut >= 0 else {}).items():
            here = f"{place}{name}"
            if any(inner in tree.files for tree in self.trees):
                left[here] = read(inner)
            else:
                left[here] = None
                self._found(inner, f"{here}/", cuts, read, left)

    def _bytes(self, number: int, last: int | None, moment: int, choose: Choice) -> bytes:
        versions = [tree.files[number] for tree in self.trees[: moment + 1] if number in tree.files]
        safe = b"" if last is None else self.trees[last].files[number]
        return choose.data(safe, versions[-1] if versions else b"")


def _all(trees: list[Tree]) -> set[int]:
    return {number for tree in trees for number in (*tree.folders, *tree.files)}


def _at(cuts: dict[int, int], number: int) -> int:
    return cuts.get(number, -1)


class Choice:
    """What becomes of what was not forced to the disk: names are kept or not, and bytes."""

    def __init__(self, names: bool, data: bool):
        self.names, self.bytes = names, data

    def moment(self, last: int | None, now: int) -> int:
        """Which names a folder has, those of the moment `last` being safe; -1: none."""
        return now if self.names else -1 if last is None else last

    def data(self, safe: bytes, now: bytes) -> bytes:
        """What a file holds."""
        return now if self.bytes else safe


class Random(Choice):
    """Each folder and each file fares otherwise."""

    def __init__(self, seed: int):
        self.generator = random.Random(seed)

    def moment(self, last: int | None, now: int) -> int:
        first = -1 if last is None else last
        return self.generator.choice([first, now, self.generator.randint(first, now)])

    def data(self, safe: bytes, now: bytes) -> bytes:
        cut = self.generator.randint(0, len(now))
        return self.generator.choice([safe, now, now[:cut], now[:cut] + bytes(len(now) - cut)]) if now != safe else now


LOST, KEPT, NAMED = Choice(False, False), Choice(True, True), Choice(True, False)
"""All is lost that was not forced to the disk, nothing is, and the bytes alone are."""


def recorded(root: Path, run: Callable[[], Any]) -> History:
    """A run that writes below `root`, change by change."""
    history = History(root)
    history.look()
    with pytest.MonkeyPatch.context() as patched:
        for name in ("replace", "unlink", "mkdir", "rmdir"):
            patched.setattr(os, name, _watched(history, getattr(os, name), name == "replace"))
        patched.setattr(os, "fsync", lambda handle: _force(history, os.fstat(handle).st_ino))
        run()
    history.look()
    return history


def _force(history: History, inode: int) -> None:
    history.look()
    if (number := history.number(inode)) is not None:
        history.forced.append((len(history.trees) - 1, number))


def _watched(history: History, change: Callable[..., Any], moves: bool) -> Callable[..., Any]:
    def changed(*given: Any, **options: Any) -> Any:
        history.look()
        places = [history.number(os.stat(Path(path).parent).st_ino) for path in given[:2]] if moves else []
        found = change(*given, **options)
        history.look()
        if moves and places[0] != places[1] and None not in places:
            history.moves.append((len(history.trees) - 1, *places))
        return found

    return changed


def losses(history: History, seeds: int) -> Iterator[tuple[int, Left]]:
    """All different folders that are left by losses, with the last moment that leaves them."""
    found: dict[frozenset[tuple[str, bytes | None]], int] = {}
    for moment in range(len(history.trees)):
        for choose in (LOST, KEPT, NAMED, *(Random(1000 * moment + seed) for seed in range(seeds))):
            found[frozenset(history.left(moment, choose).items())] = moment
    for left, moment in found.items():
        yield moment, dict(left)


def put(left: Left, folder: Path) -> None:
    """Make a folder that holds this."""
    folder.mkdir()
    for place, data in sorted(left.items()):
        if data is None:
            (folder / place).mkdir()
        else:
            (folder / place).write_bytes(data)
