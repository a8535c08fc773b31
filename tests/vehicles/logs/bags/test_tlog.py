"""Telemetry of MAVLink, which pymavlink packs and reads."""

from __future__ import annotations

import struct
import subprocess
import sys

import numpy as np
import pytest

from coadjoint.errors import ArgumentError, FileError
from coadjoint_vehicles.logs import read_log
from coadjoint_vehicles.logs.bags import tlog_file

VALUES = np.random.default_rng(1809).uniform(-1, 1, (30, 9)).astype(np.float32)


@pytest.fixture
def telemetry(tmp_path):
    dialect = pytest.importorskip("pymavlink.dialects.v20.ardupilotmega")
    link = dialect.MAVLink(None, srcSystem=1, srcComponent=1)
    rows = []
    for i, x in enumerate(VALUES):
        attitude = dialect.MAVLink_attitude_message(1000 + 100 * i, *map(float, x[:6]))
        place = dialect.MAVLink_local_position_ned_message(1000 + 100 * i, *map(float, x[6:]), 0.0, 0.0, 0.0)
        beat = dialect.MAVLink_heartbeat_message(12, 3, 0, 0, 0, 3)  # which measures nothing
        for late, message in enumerate((attitude, place, beat)):
            rows.append(struct.pack(">Q", 10**15 + 10**5 * i + 1000 * late) + message.pack(link))
    path = tmp_path / "dive.tlog"
    path.write_bytes(b"".join(rows))
    return path


def test_attitude_rates_and_position_become_a_log(telemetry):
    log = read_log(telemetry)
    there = np.isfinite(log.columns["roll"])
    names = ("roll", "pitch", "heading", "p", "q", "r")
    assert np.array_equal(np.stack([log.columns[name][there] for name in names], axis=1), VALUES[:, :6])
    assert np.array_equal(log.columns["depth"][~there], VALUES[:, 8].astype(float))
    assert log.time[1] == pytest.approx(0.001, abs=2e-6) and log.duration == pytest.approx(2.901, abs=2e-6)


def test_telemetry_of_two_vehicles_is_not_mixed(telemetry, tmp_path):
    """Two systems send the same kinds: one is chosen, and read as if it were alone."""
    dialect = pytest.importorskip("pymavlink.dialects.v20.ardupilotmega")
    link, alone = dialect.MAVLink(None, srcSystem=2, srcComponent=1), telemetry.read_bytes()
    other = [
        struct.pack(">Q", 10**15 + 10**5 * i + 5000)
        + dialect.MAVLink_attitude_message(1000 + 100 * i, *map(float, 0.5 + x[:6])).pack(link)
        for i, x in enumerate(VALUES)
    ]
    both = tmp_path / "both.tlog"
    both.write_bytes(alone + b"".join(other))
    with pytest.raises(
        FileError, match=r"holds ATTITUDE of the systems 1, 2: take one vehicle by topics=\[\"ATTITUDE\[1"
    ):
        read_log(both)
    for system, values in ((1, VALUES), (2, 0.5 + VALUES)):
        log = read_log(both, topics=[f"ATTITUDE[{system}]"])
        assert np.array_equal(log.columns["roll"], values[:, 0])
    with pytest.raises(FileError, match=r"has no topic `ATTITUDE`: did you mean `ATTITUDE\[\d\]`"):
        read_log(both, topics=["ATTITUDE"])


def test_a_file_that_is_none_is_refused(tmp_path):
    for content in (b"", b"time_s,u_m_s"):
        (tmp_path / "x.tlog").write_bytes(content)
        with pytest.raises(FileError, match="is not telemetry of MAVLink: its ninth byte must be fd or fe"):
            read_log(tmp_path / "x.tlog")


def test_without_pymavlink_a_sentence_says_how_to_install_it(telemetry, monkeypatch):
    monkeypatch.setitem(sys.modules, "pymavlink.dialects.v20.ardupilotmega", None)
    with pytest.raises(
        ArgumentError, match=r'needs pymavlink, which is not installed: pip install "coadjoint-vehicles\[logs\]"'
    ):
        read_log(telemetry)


def test_a_file_below_a_folder_bin_is_read_and_not_run(telemetry, tmp_path, monkeypatch):
    """pymavlink's mavlink_connection runs files whose paths hold /bin/."""
    monkeypatch.setattr(subprocess, "Popen", lambda *_, **__: pytest.fail("a log was run"))
    below = tmp_path / "bin" / "dive.tlog"
    below.parent.mkdir()
    below.write_bytes(telemetry.read_bytes())
    below.chmod(0o755)
    assert np.array_equal(read_log(below).columns["depth"], read_log(telemetry).columns["depth"], equal_nan=True)


def test_a_damaged_packet_is_passed_over_and_those_behind_it_are_read(telemetry):
    content = telemetry.read_bytes()
    size = len(content) // 30
    telemetry.write_bytes(content[: 5 * size] + bytes(100) + content[5 * size :])
    log = read_log(telemetry)
    assert "packets are damaged" in log.notes[0]
    assert 25 <= np.isfinite(log.columns["roll"]).sum() <= 30 and log.duration == pytest.approx(2.901, abs=2e-6)


def test_a_packet_of_a_time_that_no_clock_has_is_passed_over(telemetry):
    content = bytearray(telemetry.read_bytes())
    content[5 * (len(content) // 30)] = 255
    telemetry.write_bytes(content)
    log = read_log(telemetry)
    assert "1 of 90 packets are damaged" in log.notes[0] and np.isfinite(log.columns["roll"]).sum() == 29


def test_telemetry_that_is_too_large_is_refused_before_it_is_read(telemetry, monkeypatch):
    with telemetry.open("r+b") as opened:
        opened.truncate(tlog_file.LARGEST + 1)  # of holes, which take no room on the disk
    monkeypatch.setattr(tlog_file, "library", lambda *_: pytest.fail("it was read"))
    with pytest.raises(FileError, match="larger than the 256 MB up to which such logs are read"):
        read_log(telemetry)
