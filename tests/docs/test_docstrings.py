"""The docstrings of the most public functions and classes say something of each of their arguments."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable

import pytest

import coadjoint as co

PUBLIC = [co.simulate, co.trajectory, co.resume, co.load, co.each, co.System, co.System.state, co.Stepper]
PUBLIC += [co.KelvinNoether, co.Event, co.Signal, co.Held, co.Linear, co.Force, co.Midpoint, co.rayleigh]


@pytest.mark.parametrize("public", PUBLIC, ids=lambda public: public.__qualname__)
def test_every_argument_is_explained(public: Callable) -> None:
    inherited = [kind.__doc__ or "" for kind in getattr(public, "__mro__", (public,))]
    explained = {name for text in inherited for name in names_before_colons(text)}
    missing = set(inspect.signature(public).parameters) - {"self", "args", "kwargs"} - explained
    assert not missing, f"The docstring of {public.__qualname__} says nothing of {sorted(missing)}."


def names_before_colons(text: str) -> set[str]:
    """The names of arguments that a colon follows, as in `q, qdot: …`, at the start of a line or of a sentence."""
    found = re.findall(r"(?:^\s*|\. )(\w+(?:, \w+)*): ", text, re.MULTILINE)
    return {name for names in found for name in names.split(", ")}
