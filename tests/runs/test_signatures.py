"""Systems that differ in parameters alone have one signature; and what a file of Python opens is heard of."""

from __future__ import annotations

import functools
import math
import os

import numpy as np
import pytest

from coadjoint.report import companion_files
from coadjoint.runs.signature import _of


class Turn:
    def __init__(self, angle):
        self.angle = angle

    def by(self, x):
        return self.angle * x

    @functools.cached_property
    def derived(self):
        return object()


def scaled(x, y):
    return x * y


@pytest.mark.parametrize(
    "make",
    [
        lambda k: 1.0 + k, lambda k: "ab"[k], lambda k: np.arange(3.0) + k, lambda k: np.arange(3 + k),
        lambda k: [1, [2, k]],
        lambda k: {"a": k}, lambda k: {"ab"[k]: 1}, lambda k: Turn(k), lambda k: Turn(k).by,
        lambda k: functools.partial(scaled, 2.0, k), lambda k: functools.partial((scaled, math.hypot)[k], 2.0),
        lambda k: functools.partial(scaled, x=k), lambda k: lambda x: k * x,
        lambda k: np.arange(2).astype((float, int)[k]),
    ],
)  # fmt: skip
def test_values_that_are_equal_have_one_signature_and_others_another(make):
    assert _of(make(0), {}) == _of(make(0), {}) != _of(make(1), {})


def test_what_is_derived_or_seen_again_or_no_value_has_a_signature_too():
    one, other = Turn(1), Turn(1)
    assert one.derived is not None and _of(one, {}) == _of(other, {})
    assert _of([one, one], {}) == _of([other, other], {}) != _of([one, other], {})
    objects = np.array([object()], dtype=object)
    assert _of(objects, {}) == id(objects) and _of(math.sin, {}) == id(math.sin)
    slot = object()
    assert _of(slot, {}) == id(slot)
    assert _of(True, {}) != _of(1, {}) and _of(1.0, {}) != _of(1, {})


@pytest.mark.parametrize(
    ("event", "path", "mode", "flags", "heard"),
    [
        ("open", "a.txt", "r", 0, True),
        ("open", b"a.txt", "rb", 0, True),
        ("open", "a.txt", "w", 0, False),
        ("open", "a.txt", "a+", 0, False),
        ("open", "a.txt", None, os.O_RDONLY, True),
        ("open", "a.txt", None, os.O_WRONLY, False),
        ("open", "a.txt", None, os.O_RDWR | os.O_CREAT, False),
        ("open", 3, "r", 0, False),
        ("listdir", "a.txt", "r", 0, False),
    ],
)
def test_files_that_are_read_are_heard_of_and_those_that_are_written_are_not(event, path, mode, flags, heard):
    token = companion_files._opened.set(set())
    try:
        companion_files._heard(event, (path, mode, flags))
        assert companion_files._opened.get() == ({os.path.abspath("a.txt")} if heard else set())
    finally:
        companion_files._opened.reset(token)
    companion_files._heard(event, (path, mode, flags))  # nobody listens
    assert companion_files._opened.get() is None
