"""What SECURITY.md says: limits are those of the code, and nothing else opens a connection or unpickles."""

from __future__ import annotations

import inspect
import re
import socket
from pathlib import Path
from typing import get_args

import pytest

import coadjoint as co
from coadjoint import csv_tables, manifest, sealed, texts, vehicles
from coadjoint.cli.main import every_command
from coadjoint.errors import CoadjointError
from coadjoint.kernels import store
from coadjoint.models.descriptions import elements
from coadjoint.plotting import bodies, meshes
from coadjoint_vehicles.hydrodynamics import wamit
from coadjoint_vehicles.importing import xacro
from coadjoint_vehicles.logs import read_log
from coadjoint_vehicles.logs.bags import dataflash_file, decompressing, tlog_file
from coadjoint_vehicles.serving import plain
from coadjoint_vehicles.water import bottom, geotiff
from imports import files

PAGE = Path(__file__).parent.parent / "SECURITY.md"
IMPORTED = re.compile(
    r"^\s*(?:import|from) (socket|ssl|http|urllib\.request|asyncio|distributed|pickle|cloudpickle|marshal|shelve|"
    r"subprocess|multiprocessing|webbrowser|runpy)\b|\b(eval|exec|spec_from_file_location)\(",
    re.M,
)
FILES = (co, co.simulation, co.sweeps, vehicles, vehicles.water, vehicles.logs, vehicles.hydrodynamics, bodies)
"""Packages whose functions take names of files or folders."""
TAKEN = {"path", "folder", "store"}
WRITES = ("write_log", "write_mcap")
"""Those that open no file of others."""
KNOWN = {
    "cli/start.py": {"exec"},  # of an empty text
    "cli/viewing.py": {"webbrowser"},
    "kernels/run/compiled.py": {"pickle"},  # of the sealed cache of this user
    "kernels/trace/programs.py": {"pickle"},  # of the same cache
    "plotting/film.py": {"subprocess"},  # ffmpeg of this machine, with a list of arguments
    "runs/factory.py": {"spec_from_file_location"},
    "sealed.py": {"subprocess"},  # a child that reads netCDF
    "simulation/lock.py": {"socket"},  # the name of this machine
    "simulation/steppers/compiled_fmu.py": {"subprocess"},  # the C compiler of this machine, with a list of arguments
    "sweeps/address.py": {"socket"},
    "sweeps/cluster.py": {"distributed"},
    "sweeps/local.py": {"pickle", "subprocess"},  # of this library's own processes
    "vehicles/serving/loop.py": {"socket"},
}


def test_no_other_module_imports_what_opens_connections_or_runs_what_it_reads():
    found = {}
    for name, file in files().items():
        words = {word for pair in IMPORTED.findall(file.read_text(encoding="utf-8")) for word in pair if word}
        found |= {name: words} if words else {}
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
        f"| netCDF 3 and 4 | of each file {megabytes(sealed.LEAST)} of numbers, or {sealed.MOST_TIMES} times",
        f"of a bottom | {bottom.MOST // 10**6} million nodes",
        f"| logs of ArduPilot | {megabytes(dataflash_file.LARGEST)}, telemetry {megabytes(tlog_file.LARGEST)} |",
        f"a chunk of {megabytes(decompressing.LARGEST_CHUNK)};",
        f"names {megabytes(decompressing.LARGEST_CHUNK)}, or {decompressing.MOST_KEPT} times",
        f"of GeoTIFF {geotiff.MOST_PAGES} pictures",
        f"ask for {plain.MOST_STEPS:,} steps".replace(",", " "),
        f"| meshes | {megabytes(meshes.LARGEST)}, as much for all buffers, {meshes.MOST // 1000} 000 triangles",
        f"| {megabytes(wamit.LARGEST)}; {megabytes(texts.LARGEST_SUMMARY)} |",
        f"at most {store.LIMIT >> 20} MB",
    ):
        assert words in text, words
    assert pytest.approx(texts.LARGEST_SUMMARY, rel=0.05) == manifest._LARGEST
    assert (plain.MOST_ERRORS == 10 and "at most ten\nerrors" in text) or "at most ten errors" in text


def test_the_page_names_each_command_and_each_function_that_opens_files():
    text = PAGE.read_text(encoding="utf-8")
    page = text[text.index("## What each command") : text.index("## What is data")]
    commands = [word for kind in get_args(every_command()) for word in (get_args(kind)[1].name,)]
    assert len(commands) == 20 and all(f"`{name}`" in page for name in commands)
    for package in FILES:
        for name in getattr(package, "__all__", vars(package)):
            found = getattr(package, name)
            named = {name: found}
            if inspect.isclass(found):
                named = {f"{name}.{key}": getattr(found, key) for key in vars(found) if key.startswith("from_")}
            for word, function in named.items():
                if inspect.isroutine(function) and TAKEN & {*inspect.signature(function).parameters}:
                    assert re.search(rf"{re.escape(word)}[`(]", page) or word in WRITES, word


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
