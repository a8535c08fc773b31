"""A page that plays a scene in space: one file without network access, also as the cell of a notebook."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from functools import cache
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any

from coadjoint.disk import write_text
from coadjoint.errors import ArgumentError
from coadjoint.plotting.entries import entries
from coadjoint.plotting.scene import Scene, plain
from coadjoint.plotting.scene_of_runs import scene

_SCRIPTS = ("three.min.js", "plan.js", "scene.js", "player.js")
_FRAME = """<iframe srcdoc="{page}" title="{title}" sandbox="allow-scripts"
style="width:100%;height:{height}px;border:0"></iframe>"""


@dataclass(frozen=True, repr=False, eq=False)
class Player:
    """A scene that can be played: notebooks show it, and `save(path)` writes its page."""

    scene: Scene
    height: int = 480
    """Height in a notebook, in pixels."""

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the page atomically; raises ArgumentError for a name that does not end in .html."""
        target = Path(path)
        if target.suffix.lower() not in (".html", ".htm"):
            raise ArgumentError(f"A scene's file must end in .html, but is {target.name}.")
        return write_text(target, page(self.scene))

    def _repr_html_(self) -> str:
        return _FRAME.format(page=escape(page(self.scene)), title=escape(self.scene.title), height=self.height)

    def __repr__(self) -> str:
        return f"<Player of {self.scene.title}: save('FILE.html') writes its page>"


def page(scene: Scene) -> str:
    """The HTML of a player of this scene, about 0.6 MB and the scene's numbers."""
    # "<" cannot end the script from inside a text.
    data = json.dumps(plain(scene), allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    before, between, after = _frame()
    return f"{before.replace('/*TITLE*/', escape(scene.title))}{data}{between}{after}"


@cache
def _frame() -> tuple[str, str, str]:
    """The page before its scene, between the scene and its scripts, and its scripts to the end."""
    html, _, end = _text("player.html").partition("<script>/*SCRIPT*/</script>")
    before, _, between = html.partition("/*SCENE*/")
    licence = f"/*! three.js, https://threejs.org\n\n{_text('three.LICENSE')}*/\n"
    scripts = [(licence if name.startswith("three") else "") + _text(name) for name in _SCRIPTS]
    return before, between, "\n".join(f"<script>\n{text}</script>" for text in scripts) + end


def _text(name: str) -> str:
    return files("coadjoint.plotting").joinpath("page", name).read_text(encoding="utf-8")


def cell(certificate: Any, run: object) -> str:
    """The HTML of a cell: the certificate, then a player unless nothing of the run moves in space."""
    shown = certificate._repr_html_()
    try:
        return shown + Player(scene(entries([run], None)))._repr_html_()
    except ArgumentError:
        return shown
