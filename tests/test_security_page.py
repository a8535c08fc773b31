"""What SECURITY.md says: limits are those of the code, and nothing else opens a connection or unpickles."""

from __future__ import annotations

import re
import socket
from pathlib import Path

import pytest

import coadjoint as co
from coadjoint import csv_tables, manifest, sealed, texts
from coadjoint.errors import CoadjointError
from coadjoint.kernels.run import store
from coadjoint.plotting import meshes
from coadjoint.vehicles.hydrodynamics import wamit
from coadjoint.vehicles.importing import elements, xacro
from coadjoint.vehicles.logs import read_log
from coadjoint.vehicles.logs.bags import decompressing
from coadjoint.vehicles.serving import plain
from coadjoint.vehicles.water import bottom

SOURCES = Path(co.__file__).parent
PAGE = Path(__file__).parent.parent / "SECURITY.md"
IMPORTED = re.compile(
    r"^\s*(?:import|from) (socket|ssl|http|urllib\.request|asyncio|distributed|pickle|cloudpickle|marshal|shelve)\b"
    r"|\b(eval|exec)\(",
    re.M,
)
KNOWN = {
    "cli/start.py": {"exec"},  # of an empty text
    "simulation/folder.py": {"socket"},  # the name of this machine
    "sweeps/address.py": {"socket"},
    "sweeps/cluster.py": {"distributed"},
    "sweeps/local.py": {"pickle"},  # of this library's own processes
    "vehicles/serving/loop.py": {"socket"},
}


def test_no_other_module_imports_what_opens_connections_or_runs_what_it_reads():
    found = {}
    for file in SOURCES.rglob("*.py"):
        words = {word for pair in IMPORTED.findall(file.read_text(encoding="utf-8")) for word in pair if word}
        found |= {file.relative_to(SOURCES).as_posix(): words} if words else {}
    assert found == KNOWN


def test_the_limits_on_the_page_are_those_of_the_code():
    text = PAGE.read_text(encoding="utf-8")

    def megabytes(number: float) -> str:
        return f"{number / 1e6:.0f} MB"

    for words in (
        f"| TOML | {megabytes(texts.LARGEST)}, {texts.DEEPEST} tables",
        f"| XML | {megabytes(elements.LARGEST)} a file, {megabytes(xacro.MOST_BYTES)} with all",
        f"| CSV | {megabytes(csv_tables.LARGEST)}, {csv_tables.MOST_LINES // 10**6} million lines, "
        f"{csv_tables.MOST_CELLS // 10**6} million cells",
        f"| netCDF 4 | {megabytes(sealed.LEAST)} of numbers, or {sealed.MOST_TIMES} times",
        f"of a bottom | {bottom.MOST // 10**6} million nodes",
        f"a chunk of {megabytes(decompressing.LARGEST_CHUNK)};",
        f"messages of {megabytes(decompressing.LARGEST_CHUNK)}, or of {decompressing.MOST_KEPT} times",
        f"| meshes | {megabytes(meshes.LARGEST)}, {meshes.MOST // 1000} 000 triangles",
        f"| {megabytes(wamit.LARGEST)}; {megabytes(texts.LARGEST_SUMMARY)} |",
        f"at most {store.LIMIT >> 20} MB",
    ):
        assert words in text, words
    assert pytest.approx(texts.LARGEST_SUMMARY, rel=0.05) == manifest._LARGEST
    assert (plain.MOST_ERRORS == 10 and "at most ten\nerrors" in text) or "at most ten errors" in text


def test_a_log_whose_name_is_an_address_opens_no_connection(tmp_path, monkeypatch):
    """pymavlink takes a relative name such as unix:PATH for an address."""
    pytest.importorskip("pymavlink.mavutil")
    monkeypatch.chdir(tmp_path)
    asked = []
    monkeypatch.setattr(socket.socket, "connect", lambda _, address: asked.append(address))
    for name in ("unix:x.tlog", "tcp:127.0.0.1:9.tlog"):
        Path(name).write_bytes(bytes(8) + b"\xfd" + bytes(40))
        with pytest.raises(CoadjointError):
            read_log(name)
    assert asked == []
