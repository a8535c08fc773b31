"""Files that are changed at random end in a result or in one sentence, within seconds."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from mutations import LARGE, mutated
from readers import LIMIT, LOG, MISSION, Corpus

from coadjoint.csv_tables import read_sheet
from coadjoint.errors import CoadjointError, FileError
from coadjoint.runs.run_file import read
from coadjoint_vehicles.files.file import read_vehicle

HERE = Path(__file__).parent
pytestmark = pytest.mark.skipif(os.name != "posix", reason="a time limit by signals")

SOME = {"run": 4, "vehicle": 4, "mission": 1, "csv": 12, "netcdf": 1, "zarr": 1}
MANY = {"run": 1300, "vehicle": 900, "mission": 600, "csv": 1200, "netcdf": 500, "zarr": 500}


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    return Corpus(tmp_path_factory.mktemp("fuzz"))


@pytest.mark.parametrize("kind", SOME)
def test_changed_files_end_in_a_result_or_a_sentence(corpus, kind):
    found = {number: corpus.outcome(kind, number) for number in range(SOME[kind])}
    assert {number: what for number, what in found.items() if what not in ("result", "sentence")} == {}


@pytest.mark.long
@pytest.mark.parametrize("kind", MANY)
def test_many_changed_files_end_in_a_result_or_a_sentence(kind, tmp_path):
    """In a process of its own, which a crash or a hang in a library does not outlive."""
    counts, bad = campaign(kind, range(MANY[kind]), tmp_path)
    print(kind, dict(counts))
    assert bad == {}


def campaign(kind: str, numbers: range, folder: Path) -> tuple[Counter[str], dict[int, str]]:
    """How files ended, by kind of end, and those that ended otherwise."""
    counts, bad, next_one = Counter[str](), dict[int, str](), numbers.start
    while next_one < numbers.stop:
        given = [sys.executable, str(HERE / "readers.py"), kind, str(next_one), str(numbers.stop), str(folder)]
        path = os.pathsep.join([str(HERE.parent), *sys.path])
        process = subprocess.Popen(given, stdout=subprocess.PIPE, text=True, env={**os.environ, "PYTHONPATH": path})
        assert process.stdout is not None
        while line := _line(process):
            number, what = json.loads(line)
            next_one = number + 1
            counts[what.split(":")[0]] += 1
            if what not in ("result", "sentence"):
                bad[number] = what
        if process.wait():
            end = "hang" if process.returncode == -signal.SIGKILL else f"crash {-process.returncode}"
            bad[next_one] = end
            counts[end] += 1
            next_one += 1
    return counts, bad


def _line(process: Any) -> str:
    """The next line of a process, which is killed if there is none in twice the limit: C code hears no alarm."""
    watch = threading.Timer(2 * LIMIT + 10.0, process.kill)
    watch.start()
    try:
        return process.stdout.readline()
    finally:
        watch.cancel()


DEEP = {
    "lists": "x = " + "[" * 20_000 + "]" * 20_000,
    "lists that are not closed": "x = " + "[" * 20_000,
    "tables": "x = " + "{a=" * 5_000 + "1" + "}" * 5_000,
    "a key": "b.c = 1\n" + ".".join(["a"] * 100_000) + " = 1",
    "a section": "[" + ".".join(["a"] * 100_000) + "]",
    "lists within bounds of Python": "x = " + "[" * 200 + "]" * 200,
}


@pytest.mark.parametrize("text", DEEP.values(), ids=DEEP)
@pytest.mark.parametrize("reader", [read, read_vehicle], ids=["run", "vehicle"])
def test_what_is_nested_too_deeply_is_refused(tmp_path, text, reader):
    file = tmp_path / "deep.toml"
    file.write_text(text)
    with pytest.raises(FileError, match="is nested too deeply"):
        reader(file)


@pytest.mark.parametrize("reader", [read, read_vehicle], ids=["run", "vehicle"])
def test_a_large_toml_file_is_refused_before_it_is_read(tmp_path, reader):
    file = tmp_path / "large.toml"
    file.write_bytes(MISSION + b"# \n" * (LARGE // 3))
    with pytest.raises(FileError, match="larger than the 1 MB up to which"):
        reader(file)


def test_a_file_without_an_end_is_refused():
    with pytest.raises(FileError, match="larger than"):
        read("/dev/zero")


def test_a_table_of_ten_megabytes_is_read(tmp_path):
    file = tmp_path / "log.csv"
    head, row = LOG.split(b"\n")[:2]
    file.write_bytes(head + b"\n" + (row + b"\n") * 20_000)
    assert len(read_sheet(file).rows) == 20_000


@pytest.mark.parametrize("size", [131_072, 131_073, 1_000_000])
def test_a_field_of_any_length_is_a_number_or_a_sentence(tmp_path, size):
    file = tmp_path / "log.csv"
    file.write_bytes(b"time_s,depth_m\n0,1\n1," + b"1" * size + b"\n")
    with pytest.raises(CoadjointError) as error:
        read_sheet(file).numbers(1)
    assert str(error.value).count("\n") == 0 and len(str(error.value)) < 500


@pytest.mark.parametrize("mark", [b"\xef\xbb\xbf", b"\xff\xfe", b"\xfe\xff"])
def test_byte_order_marks_are_taken_off_or_named(tmp_path, mark):
    file, table = tmp_path / "mission.toml", tmp_path / "log.csv"
    file.write_bytes(mark + MISSION)
    table.write_bytes(mark + LOG)
    if mark == b"\xef\xbb\xbf":
        assert read(file) is not None and read_sheet(table).names[0] == "time_s"
        return
    for reader in (read, read_sheet):
        with pytest.raises(FileError, match="not a text in UTF-8"):
            reader(file if reader is read else table)


def test_the_same_number_is_the_same_file():
    assert mutated(MISSION, "mission 3") == mutated(MISSION, "mission 3") != mutated(MISSION, "mission 4")
