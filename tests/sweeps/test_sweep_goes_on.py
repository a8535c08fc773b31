"""A sweep that goes on draws the numbers with which it began."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from coadjoint.errors import FileError
from coadjoint.sweeps.sweep import _planned


def test_a_sweep_whose_numbers_are_drawn_otherwise_does_not_go_on():
    found = {"digest": "a", "size": 3}
    manifest: Any = SimpleNamespace(folder=Path("there"), facts={"sweep": found})
    assert _planned(cast(Any, SimpleNamespace(digest="a")), manifest) is found
    with pytest.raises(FileError, match="not those with which the sweep in there began"):
        _planned(cast(Any, SimpleNamespace(digest="b")), manifest)
