"""Logs of ArduPilot: every number that pymavlink reads, and what of them is a vehicle's motion."""

from __future__ import annotations

import struct

import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import FileError
from coadjoint_vehicles.logs import read_log
from coadjoint_vehicles.logs.bags import BAG_FORMATS, BagFormat, dataflash_file
from coadjoint_vehicles.logs.bags.dataflash_file import read_dataflash

RANDOM = np.random.default_rng(1776)
KINDS = {
    "FMT": (128, "BBnNZ", "Type,Length,Name,Format,Columns"),
    "FMTU": (129, "QBNN", "TimeUS,FmtType,UnitIds,MultIds"),
    "IMU": (130, "QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ"),
    "XKF1": (131, "QBccCfffffff", "TimeUS,C,Roll,Pitch,Yaw,VN,VE,VD,dPD,PN,PE,PD"),
    "RCOU": (132, "QHHg", "TimeUS,C1,C2,Half"),
    "MSG": (133, "QZ", "TimeUS,Message"),
    "ODD": (134, "IaqLEeMhbd", "TimeMS,a,q,L,E,e,M,h,b,d"),
}
SIZES = {letter: letter for letter in "bBhHiIfdqQ"} | {"M": "B", "g": "e", "n": "4s", "N": "16s", "Z": "64s"}
SIZES |= {"c": "h", "C": "H", "e": "i", "E": "I", "L": "i", "a": "64s"}


def message(name, *values):
    kind, letters, _ = KINDS[name]
    return b"\xa3\x95" + bytes([kind]) + struct.pack("<" + "".join(SIZES[c] for c in letters), *values)


def definitions():
    for name, (kind, letters, columns) in KINDS.items():
        length = 3 + struct.calcsize("<" + "".join(SIZES[c] for c in letters))
        yield message("FMT", kind, length, name.encode(), letters.encode(), columns.encode())
    yield message("FMTU", 0, 130, b"s#EEEooo", b"F-000000")
    yield message("FMTU", 0, 131, b"s#ddhnnnnmmm", b"F-BBB0000000")


@pytest.fixture(scope="module")
def numbers():
    return RANDOM.normal(size=(60, 12))


@pytest.fixture(scope="module")
def log(tmp_path_factory, numbers):
    path = tmp_path_factory.mktemp("ardupilot") / "00000007.BIN"
    rows = [*definitions()]
    for i, x in enumerate(numbers):
        t = 5_000_000 + 100_000 * i
        rows += [message("IMU", t, core, *(x[:6] + core)) for core in (0, 1)]
        roll, pitch, yaw = 100 * i, -50 * i, 500 * i
        rows += [message("XKF1", t + 50, core, roll, pitch, yaw, *(x[:7] + core)) for core in (0, 1)]
        rows += [message("RCOU", t + 60, 1500 + i, 1400 - i, 0.5 * i), message("MSG", t, b"hello")]
        rows.append(message("ODD", 5000 + 100 * i, bytes(64), -(2**60) + i, 450000000 + i, i, -i, 7, -3, -1, x[0]))
    path.write_bytes(b"".join(rows))
    return path


def test_every_number_is_that_of_pymavlink(log):
    reader = pytest.importorskip("pymavlink.DFReader").DFReader_binary(str(log))
    found = read_dataflash(log, lambda topic, kind: True)
    theirs: dict[str, list] = {}
    while (one := reader.recv_msg()) is not None:
        name = one.get_type()
        instance = f"[{one.I}]" if name == "IMU" else f"[{one.C}]" if name == "XKF1" else ""
        theirs.setdefault(f"{name}{instance}", []).append(one)
    names = {"IMU[0]", "IMU[1]", "XKF1[0]", "XKF1[1]", "RCOU", "ODD"}
    assert {name for name, (_, count) in found.topics().items() if count} == names | {"MSG"}
    for name in names:
        columns = [c for c in theirs[name][0].get_fieldnames() if c != "a"]
        ours = found.topic(name).numbers(columns)
        for column in columns:
            assert np.array_equal(ours[column], [getattr(one, column) for one in theirs[name]]), (name, column)


def test_the_filter_the_gyroscopes_and_commands_become_a_log(log, numbers):
    command = {"topic": "RCOU", "name": "thrusters", "fields": ["C1", "C2"], "unit": "us"}
    sensors = [{"topic": "XKF1[0]"}, {"topic": "IMU[0]"}]
    found = read_log(log, sensors={"sensor": sensors, "command": [command]})
    there = np.isfinite(found.columns["u"])
    x = numbers.astype(np.float32).astype(float)[1:]
    i = np.arange(1, 60)
    heading, pitch, roll = np.radians(5.0 * i), np.radians(-0.5 * i), np.radians(1.0 * i)
    R = np.asarray(co.attitude.zyx(heading, pitch, roll))
    body = np.stack([found.columns[name][there] for name in "uvw"], axis=1)
    assert np.allclose(np.einsum("kij,kj->ki", R, body), x[:, :3], rtol=0, atol=1e-12)
    assert np.array_equal(np.stack([found.columns[n][there] for n in ("north", "east", "depth")], axis=1), x[:, 4:7])
    assert np.allclose(found.columns["heading"][there], heading, rtol=1e-14)
    turning = np.isfinite(found.columns["p"])
    assert np.array_equal(found.columns["p"][turning], x[:, 0]) and found.units["thrusters"] == "us"
    assert np.array_equal(found.inputs["thrusters"][-1], [1559, 1341])
    plain = read_log(log)
    assert set(plain.columns) == set(found.columns) and not plain.inputs


SHORT_UNITS = (
    message("FMT", 128, 89, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns")
    + message("FMT", 129, 12, b"FMTU", b"QB", b"TimeUS,FmtType")
    + b"\xa3\x95\x81"
    + bytes(9)
)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda c: b"", "is not a log of ArduPilot: it is empty"),
        (lambda c: b"\xa3\x95\x81" + c[3:], "begins with a3 95 81, but must begin with a3 95 80"),
        (lambda c: c[:4] + b"\x10" + c[5:], "its definition of `FMT`.*does not fit together"),
        (lambda c: c[:3000] + bytes(len(c) - 3000), "of its .* bytes are not a message"),
        (lambda c: SHORT_UNITS, "its units, FMTU, have 9 bytes of 25"),
        (lambda c: c[: 89 * 7], "holds no message that measures a vehicle"),
    ],
)
def test_a_log_that_is_none_is_refused(log, tmp_path, change, words):
    path = tmp_path / "bad.bin"
    path.write_bytes(change(log.read_bytes()))
    with pytest.raises(FileError, match=words):
        read_log(path)


def test_a_format_is_a_function_and_a_line_with_its_suffix(log, tmp_path, monkeypatch):
    own = tmp_path / "dive.own"
    own.write_bytes(log.read_bytes())
    own_format = BagFormat(dataflash_file.__name__, "read_dataflash", "NED/FRD")
    monkeypatch.setitem(BAG_FORMATS, ".own", own_format)
    one, other = read_log(own), read_log(log)
    np.testing.assert_array_equal(one.time, other.time)
    assert one.columns.keys() == other.columns.keys()
    assert all(np.array_equal(one.columns[name], other.columns[name], equal_nan=True) for name in other.columns)


def test_a_log_that_was_cut_off_is_read_to_its_last_whole_message_and_tells(log, tmp_path):
    path = tmp_path / "cut.BIN"
    path.write_bytes(log.read_bytes()[:-5])
    assert "bytes are not a message, and are passed over." in " ".join(read_log(path).notes)


def test_a_log_that_is_too_large_is_refused_before_it_is_read(log, tmp_path, monkeypatch):
    file = tmp_path / "x.BIN"
    file.write_bytes(log.read_bytes())
    with file.open("r+b") as opened:
        opened.truncate(dataflash_file.LARGEST + 1)  # of holes, which take no room on the disk
    monkeypatch.setattr(dataflash_file.mmap, "mmap", lambda *_, **__: pytest.fail("it was read"))
    with pytest.raises(FileError, match="larger than the 1000 MB up to which such logs are read"):
        read_log(file)
