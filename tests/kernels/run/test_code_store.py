"""Machine code on disk is found again, and a store that fails is no store."""

from __future__ import annotations

import hashlib
import os
import stat
from concurrent.futures import ThreadPoolExecutor

import jax
import numpy as np
import pytest
from vehicle import PAPER, VehicleProgram, start

from coadjoint.kernels import store
from coadjoint.kernels.run import machine, native

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
    assert {file.name for file in place.iterdir()} == {f"{NAME}.code", "key"}


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


@pytest.mark.parametrize("mode", [0o620, 0o602, 0o666])
def test_a_file_that_others_may_write_to_does_not_run(place, mode):
    store.keep(NAME, b"code")
    (place / f"{NAME}.code").chmod(mode)
    assert store.fetch(NAME) is None
    (place / f"{NAME}.code").chmod(0o644)
    assert store.fetch(NAME) == b"code"


def test_a_file_of_another_user_does_not_run(place, monkeypatch):
    store.keep(NAME, b"code")
    fstat, other = os.fstat, os.geteuid() + 1

    def of_another(handle):
        found = fstat(handle)
        return found if stat.S_ISDIR(found.st_mode) else os.stat_result((*found[:4], other, *found[5:]))

    monkeypatch.setattr(os, "fstat", of_another)
    assert store.fetch(NAME) is None


def test_a_link_does_not_run(place, tmp_path):
    store.keep(NAME, b"code")
    file = place / f"{NAME}.code"
    file.rename(tmp_path / "elsewhere")
    file.symlink_to(tmp_path / "elsewhere")
    assert store.fetch(NAME) is None
    file.unlink()
    os.mkfifo(file)
    assert store.fetch(NAME) is None, "and a pipe keeps nobody waiting"


def test_content_of_another_place_or_name_does_not_run(place, tmp_path, monkeypatch):
    other = store.key("other")
    store.keep(NAME, b"code")
    store.keep(other, b"more")
    (place / f"{other}.code").write_bytes((place / f"{NAME}.code").read_bytes())
    assert store.fetch(other) is None, "code of another system"
    monkeypatch.setenv("COADJOINT_CACHE", str(tmp_path / "second"))
    store.keep(other, b"more")
    (tmp_path / "second" / f"{NAME}.code").write_bytes((place / f"{NAME}.code").read_bytes())
    assert store.fetch(NAME) is None, "code that was sealed under another key"


def test_content_with_a_digest_of_its_own_does_not_run(place):
    store.keep(NAME, b"code")
    (place / f"{NAME}.code").write_bytes(hashlib.sha256(b"evil").digest() + b"evil")
    assert store.fetch(NAME) is None


@pytest.mark.parametrize("spoil", [lambda key: key.chmod(0o644), lambda key: key.write_bytes(b"short"), os.unlink])
def test_a_key_that_others_know_or_that_is_damaged_is_made_anew(place, spoil):
    store.keep(NAME, b"code")
    spoil(place / "key")
    assert store.fetch(NAME) is None
    store.keep(NAME, b"code")
    assert store.fetch(NAME) == b"code"
    assert stat.S_IMODE((place / "key").stat().st_mode) == 0o600


def test_what_has_not_been_used_for_longest_goes_first(place, monkeypatch):
    names = [store.key(str(i)) for i in range(6)]
    for age, name in enumerate(names[:5]):
        store.keep(name, bytes(range(1, 101)))
        os.utime(place / f"{name}.code", (1000 + age, 1000 + age))
    left = place / "given_up.part"
    left.write_bytes(b"half")
    os.utime(left, (1000, 1000))
    assert store.fetch(names[0]) is not None, "used now, so that it is new again"
    monkeypatch.setattr(store, "LIMIT", 3 * 132)
    store.keep(names[5], bytes(100))
    assert [i for i, name in enumerate(names) if store.fetch(name)] == [0, 4, 5]
    assert not left.exists()
    assert sum(file.stat().st_size for file in place.glob("*.code")) <= store.LIMIT


def test_a_file_system_without_second_names_has_a_key_too(place, monkeypatch):
    def refused(*_):
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "link", refused)
    store.keep(NAME, b"code")
    assert store.fetch(NAME) == b"code"


def test_an_empty_setting_turns_the_store_off(monkeypatch):
    monkeypatch.setenv("COADJOINT_CACHE", "")
    assert store.folder() is None
    store.keep(NAME, b"code")


def test_a_full_disk_leaves_nothing_behind(place, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    store.keep(NAME, b"code")
    assert [file.name for file in place.iterdir()] == ["key"]


def test_the_second_process_compiles_nothing(place, monkeypatch):
    s = start(0.01)
    first = native.run(VehicleProgram(), PAPER, s, 0.01, 2, 3)
    assert len(list(place.glob("*.code"))) == 1
    assert stat.S_IMODE(place.stat().st_mode) == 0o700
    native._kernels.clear()
    monkeypatch.setattr(machine, "object_code", lambda _: pytest.fail("compiled again"))
    second = native.run(VehicleProgram(), PAPER, s, 0.01, 2, 3)
    for x, y in zip(jax.tree.leaves(first.final), jax.tree.leaves(second.final), strict=True):
        np.testing.assert_array_equal(x, y)
