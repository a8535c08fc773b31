"""A page that plays a scene in space: one file, with everything inside, that needs no network."""

from __future__ import annotations

import json
from functools import cache
from html import escape
from importlib.resources import files

from coadjoint.plotting.scene import Scene, plain

POINTS = 8000
"""The most nodes on a page, of all members together."""
_SCRIPTS = ("three.min.js", "plan.js", "scene.js", "player.js")


def page(scene: Scene) -> str:
    """The HTML of a player of this scene, about 0.6 MB and the scene's numbers."""
    # "<" cannot end the script from inside a text.
    data = json.dumps(plain(scene), allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    before, between, after = _frame()
    return f"{before.replace('/*TITLE*/', escape(scene.title))}{data}{between}{after}"


@cache
def _frame() -> tuple[str, str, str]:
    """The page before its scene, between that and its scripts, and its scripts to the end."""
    html, _, end = _text("player.html").partition("<script>/*SCRIPT*/</script>")
    before, _, between = html.partition("/*SCENE*/")
    licence = f"/*! three.js, https://threejs.org\n\n{_text('three.LICENSE')}*/\n"
    scripts = [(licence if name.startswith("three") else "") + _text(name) for name in _SCRIPTS]
    return before, between, "\n".join(f"<script>\n{text}</script>" for text in scripts) + end


def _text(name: str) -> str:
    return files("coadjoint.plotting").joinpath("page", name).read_text(encoding="utf-8")
