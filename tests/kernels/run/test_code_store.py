"""Machine code on disk is found again, and a store that fails is no store."""

from __future__ import annotations

import os
import stat
from concurrent.futures import ThreadPoolExecutor

import jax
import numpy as np
import pytest
from vehicle import PAPER, VehicleProgram, start

from coadjoint.kernels.run import machine, native, store

NAME = store.key("a", "b")


@pytest.fixture(autouse=True)
def place(tmp_path, monkeypatch):
    monkeypatch.setenv("COADJOINT_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(native, "_kernels", type(native._kernels)())
    return tmp_path / "cache"


def test_code_is_found_again():
    assert store.fetch(NAME) is None
    store.keep(NAME, b"code")
    assert store.fetch(NAME) == b"code"


def test_names_tell_parts_apart():
    assert store.key("ab", "c") != store.key("a", "bc")


@pytest.mark.parametrize("content", [b"", b"short", b"x" * 100])
def test_a_damaged_file_is_ignored(place, content):
    store.keep(NAME, b"code")
    (place / f"{NAME}.code").write_bytes(content)
    assert store.fetch(NAME) is None


def test_many_writers_leave_one_whole_file(place):
    code = os.urandom(100_000)
    with ThreadPoolExecutor(8) as pool:
        list(pool.map(lambda _: store.keep(NAME, code), range(40)))
    assert store.fetch(NAME) == code
    assert [file.name for file in place.iterdir()] == [f"{NAME}.code"]


def test_a_place_that_cannot_be_written_is_no_store(tmp_path, monkeypatch):
    blocked = tmp_path / "file"
    blocked.write_text("not a folder")
    monkeypatch.setenv("COADJOINT_CACHE", str(blocked / "cache"))
    store.keep(NAME, b"code")
    assert store.fetch(NAME) is None
    assert native.run(VehicleProgram(), PAPER, start(0.01), 0.01, 1, 1).steps == 1


@pytest.mark.parametrize("mode", [0o777, 0o1777, 0o770, 0o702])
def test_a_folder_that_others_may_write_to_is_no_store(place, mode):
    store.keep(NAME, b"code")
    place.chmod(mode)
    assert store.fetch(NAME) is None
    store.keep(store.key("other"), b"more")
    place.chmod(0o755)
    assert store.fetch(NAME) == b"code"
    assert store.fetch(store.key("other")) is None


def test_a_folder_of_another_user_is_no_store(place, monkeypatch):
    store.keep(NAME, b"code")
    other = os.geteuid() + 1
    monkeypatch.setattr(os, "geteuid", lambda: other)
    assert store.fetch(NAME) is None


def test_an_empty_setting_turns_the_store_off(monkeypatch):
    monkeypatch.setenv("COADJOINT_CACHE", "")
    assert store.folder() is None
    store.keep(NAME, b"code")


def test_a_full_disk_leaves_nothing_behind(place, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    store.keep(NAME, b"code")
    assert list(place.iterdir()) == []


def test_the_second_process_compiles_nothing(place, monkeypatch):
    s = start(0.01)
    first = native.run(VehicleProgram(), PAPER, s, 0.01, 2, 3)
    assert len(list(place.iterdir())) == 1
    assert stat.S_IMODE(place.stat().st_mode) == 0o700
    native._kernels.clear()
    monkeypatch.setattr(machine, "object_code", lambda _: pytest.fail("compiled again"))
    second = native.run(VehicleProgram(), PAPER, s, 0.01, 2, 3)
    for x, y in zip(jax.tree.leaves(first.final), jax.tree.leaves(second.final), strict=True):
        np.testing.assert_array_equal(x, y)
