"""Words for the values of arguments in the help of commands, such as FILE, DIR and SECONDS."""

from __future__ import annotations

import tyro

NOTHING = ("None", "", "''", "()", "[]")
"""Defaults that help leaves out: the sentence of the argument says what happens without it."""


def called(metavar: str) -> object:
    """The annotation of an argument whose values help calls `metavar`; "NAME …" stands for several."""
    return tyro.conf.arg(metavar=metavar, help_behavior_hint=_hint)


def _hint(default: str) -> str:
    return "" if default.strip() in NOTHING else f"(default: {default})"
