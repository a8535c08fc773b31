"""What a notebook shows of a run: its certificate, and below it the player."""

from __future__ import annotations

from html import escape
from typing import Any

from coadjoint.errors import ArgumentError
from coadjoint.plotting.entries import entries
from coadjoint.plotting.player import Player
from coadjoint.plotting.staged import scene


def cell(card: str, run: Any) -> str:
    """The HTML of a cell; without a player where nothing of the run moves in space."""
    told = f'<pre style="white-space:pre-wrap">{escape(card)}</pre>'
    try:
        return told + Player(scene(entries([run], None)))._repr_html_()
    except ArgumentError:
        return told
