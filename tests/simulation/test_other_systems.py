"""Systems other than Linux, whose calls stand in for those of this one: Windows' locks, folders without owners."""

from __future__ import annotations

import json
import os
import sys
import zipfile
from pathlib import Path
from types import ModuleType

import pytest

import coadjoint as co
from coadjoint.errors import FileError
from coadjoint.kernels import store
from coadjoint.simulation.lock import Lock


@pytest.fixture
def windows(monkeypatch: pytest.MonkeyPatch) -> None:
    """Locks by `msvcrt`, whose lock of a byte belongs to a handle and ends with it, and no `sched_yield`."""
    held: dict[tuple[int, int], int] = {}

    def locking(handle: int, mode: int, count: int) -> None:
        assert (mode, count) == (2, 1)
        found = os.fstat(handle)
        if held.setdefault((found.st_dev, found.st_ino), handle) != handle:
            raise PermissionError(13, "Permission denied")

    close = os.close

    def closed(handle: int) -> None:
        for place in [place for place, holder in held.items() if holder == handle]:
            del held[place]
        close(handle)

    made = ModuleType("msvcrt")
    made.__dict__.update(locking=locking, LK_NBLCK=2)
    monkeypatch.setitem(sys.modules, "msvcrt", made)
    monkeypatch.setitem(sys.modules, "fcntl", None)
    monkeypatch.setattr(os, "close", closed)
    monkeypatch.delattr(os, "sched_yield")
    monkeypatch.setattr(os, "kill", lambda *_: pytest.fail("signal 0 ends a process of Windows"))


def test_a_folder_is_held_by_one_where_locks_are_those_of_windows(windows: None, tmp_path: Path) -> None:
    first = Lock(tmp_path)
    with pytest.raises(FileError, match=rf"is in use by process {os.getpid()}: wait until it ends"):
        Lock(tmp_path)
    first.release()
    Lock(tmp_path).release()
    assert not list(tmp_path.iterdir())


def test_machine_code_is_kept_by_its_seal_where_folders_have_no_owners(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COADJOINT_CACHE", str(tmp_path))
    monkeypatch.delattr(os, "geteuid")
    store.keep("a", b"code")
    assert store.fetch("a") == b"code"
    (kept,) = tmp_path.rglob("a.code")
    kept.write_bytes(kept.read_bytes()[:-1] + b"X")
    assert store.fetch("a") is None


def test_machine_code_of_another_kind_of_processor_is_refused(tmp_path: Path) -> None:
    """LLVM loads it, and would run it: the number of the machine in the head of ELF, or the like, tells."""
    system = co.models.rigid_body.make(inertia=(1.0, 2.0, 3.0))
    path = co.Stepper(system, system.state(xi=[0.1, 1.0, 0.2]), dt=0.1).save(tmp_path / "body.step")
    with zipfile.ZipFile(path) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    assert json.loads(parts["stepper.json"])["processor"]
    code = bytearray(parts["step.o"])
    code[18 if code[:4] == b"\x7fELF" else 4] ^= 0xFF
    with zipfile.ZipFile(path, "w") as archive:
        for name, part in {**parts, "step.o": bytes(code)}.items():
            archive.writestr(name, part)
    with pytest.raises(FileError, match=r"holds machine code of another kind of processor than it names: save the"):
        co.load_stepper(path)
