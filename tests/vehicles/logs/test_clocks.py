"""Clocks of logs: units of time, rows out of order, jumps; and units that the kinematics of the log betray."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest

from coadjoint.cli.main import main
from coadjoint.clocks import clock
from coadjoint.errors import ArgumentError, FileError
from coadjoint.identification import Log
from coadjoint.identification.sampling import samples
from coadjoint_vehicles.logs import inputs_from_csv, read_log, write_log
from coadjoint_vehicles.logs.bags.merged import Samples, merged

TIMES = [round(0.1 * k, 1) for k in range(40)]
SHIFTED = [t + (3600.0 if k >= 20 else 0.0) for k, t in enumerate(TIMES)]
BACK = [t - (1.0 if k >= 20 else 0.0) for k, t in enumerate(TIMES)]


@pytest.fixture
def table(tmp_path):
    def write(times, name="time_s"):
        path = tmp_path / "log.csv"
        rows = (f"{t!r},{0.1 * k:.12g},{0.2 * k:.12g}" for k, t in enumerate(times))
        path.write_text(f"{name},u_m_s,command_rudder_deg\n" + "\n".join(rows) + "\n")
        return path

    return write


@pytest.mark.parametrize(
    ("factor", "unit", "zero"), [(1e3, "ms", 1.7e12), (1e6, "us", 1.7e15), (1e9, "ns", 1_700_000_000_000_000_000)]
)
def test_times_since_1970_in_another_unit_are_refused_and_the_column_that_is_named_reads_them(
    table, factor, unit, zero
):
    times = [zero + int(factor * t) for t in TIMES]
    with pytest.raises(FileError, match=rf"line 2, column `time_s`: .* looks like {unit} since 1970; .*`time_{unit}`"):
        read_log(table(times))
    read = read_log(table(times, f"time_{unit}"))
    np.testing.assert_allclose(np.diff(read.time), 0.1, atol=1e-6)
    with pytest.raises(FileError, match=f"looks like {unit} since 1970"):
        inputs_from_csv(table(times))
    with pytest.raises(ArgumentError, match=f"looks like {unit} since 1970"):
        Log(np.array(times, float), {"u": np.zeros(40)})


def test_seconds_since_1970_are_times(table):
    assert not read_log(table([1.7e9 + t for t in TIMES])).doubts


def test_a_jump_of_an_hour_is_refused_or_split_by_choice(table):
    path = table(SHIFTED)
    with pytest.raises(FileError, match=r"line 22, column `time_s`: time jumps by 3600\.1 s.*jumps=\"split\""):
        read_log(path)
    log = read_log(path, jumps="split")
    assert log.breaks == (20,) and any("jumps from 1.9 s to 3602 s" in note for note in log.notes)
    assert [len(part) for part in log.stretches()] == [20, 20]
    np.testing.assert_array_equal(log.time, SHIFTED)


def test_a_clock_that_is_set_back_is_refused_or_split_or_its_rows_are_sorted(table):
    path = table(BACK)
    with pytest.raises(FileError, match=r"line 22.*from 1\.9 s to 1 s.*unsorted=\"sort\".*jumps=\"split\""):
        read_log(path)
    log = read_log(path, jumps="split")
    assert log.breaks == (20,)
    np.testing.assert_allclose(np.diff(log.time), 0.1)
    np.testing.assert_array_equal(log.columns["u"], np.round(0.1 * np.arange(40), 12))
    assert any("goes back from 1.9 s to 1 s" in note and "1 s later than logged" in note for note in log.notes)
    with pytest.raises(FileError, match="comes twice"):
        read_log(path, unsorted="sort")


def test_rows_out_of_order_are_sorted_with_all_their_columns_on_request(table):
    order = np.random.default_rng(1).permutation(40)
    path = table([TIMES[k] for k in order])
    with pytest.raises(FileError, match="where rows are out of order"):
        read_log(path)
    log, first = read_log(path, unsorted="sort"), np.argsort(order)
    np.testing.assert_array_equal(log.time, TIMES)
    np.testing.assert_allclose(log.columns["u"], 0.1 * first)
    np.testing.assert_allclose(log.inputs["rudder"], np.radians(0.2 * first))
    assert any("all are sorted by time" in note for note in log.notes)
    with pytest.raises(FileError, match=r"sorts them\.$"):
        inputs_from_csv(path)
    signal = inputs_from_csv(path, unsorted="sort")["rudder"]
    np.testing.assert_array_equal(signal.times, TIMES)


@pytest.mark.parametrize("wrong", [{"jumps": "keep"}, {"unsorted": "yes"}])
def test_other_choices_are_refused(table, wrong):
    with pytest.raises(ArgumentError, match='must be "refuse" or'):
        read_log(table(TIMES), **wrong)


def test_bags_have_the_same_choices():
    """Of messages of one sensor, ns, as all readers of bags give them."""
    ns = (np.array(SHIFTED) * 1e9).astype(np.int64)
    one = Samples("/imu", ns, {"u": np.arange(40.0)}, {})
    with pytest.raises(FileError, match=r"row 21 of its log: time jumps by 3600\.1 s"):
        merged("dive.mcap", [one], [], [])
    assert merged("dive.mcap", [one], [], [], jumps="split").breaks == (20,)


def test_a_bag_is_refused_or_split(tmp_path):
    pytest.importorskip("mcap")
    log = Log(np.array(SHIFTED), {"u": np.zeros(40), "v": np.zeros(40), "w": np.zeros(40)}, breaks=(20,))
    write_log(log, tmp_path / "log.mcap")
    with pytest.raises(FileError, match="time jumps by 3600"):
        read_log(tmp_path / "log.mcap")
    assert read_log(tmp_path / "log.mcap", jumps="split").breaks == (20,)


def test_all_topics_of_a_bag_are_moved_alike_where_the_clock_goes_back(tmp_path):
    """By stamps and by times of logging; the topics keep how they lie to each other."""
    pytest.importorskip("mcap")
    from tests.vehicles.logs.bags.test_doubtful_bags import PLAIN, SECONDS, TWIST, bag

    back = np.where(SECONDS < 12, SECONDS, SECONDS - 7)
    u, rudder = {"twist.twist.linear.x": 0.1 * SECONDS}, {"data": 0.01 * SECONDS}
    path = bag(tmp_path / "x.mcap", [("/twist", TWIST, u, back), ("/command/rudder", PLAIN, rudder, back)])
    with pytest.raises(FileError, match=r"/twist go back in time: message 13 is stamped 6 s before .*jumps=\"split\""):
        read_log(path)
    log = read_log(path, jumps="split")
    np.testing.assert_array_equal(log.time, SECONDS)
    np.testing.assert_allclose(log.columns["u"], 0.1 * SECONDS)
    np.testing.assert_allclose(log.inputs["rudder"], 0.01 * SECONDS)
    assert log.breaks == (12,) and any("goes back by 6 s" in note for note in log.notes)
    once = bag(tmp_path / "y.mcap", [("/twist", TWIST, u, back), ("/command/rudder", PLAIN, rudder, SECONDS)])
    with pytest.raises(FileError, match=r"clock of /twist goes back 1 times, that of /command/rudder 0 times"):
        read_log(once, jumps="split")


def test_messages_of_a_bag_out_of_order_are_sorted_on_request(tmp_path):
    pytest.importorskip("mcap")
    from tests.vehicles.logs.bags.test_doubtful_bags import PLAIN, SECONDS, TWIST, bag

    order = np.random.default_rng(4).permutation(len(SECONDS))
    u, rudder = {"twist.twist.linear.x": 0.1 * order}, {"data": 0.01 * order}
    path = bag(tmp_path / "x.mcap", [("/twist", TWIST, u, order), ("/command/rudder", PLAIN, rudder, order)])
    with pytest.raises(FileError, match=r"/command/rudder go back in time: .* is logged|/twist go back in time"):
        read_log(path)
    log = read_log(path, unsorted="sort")
    np.testing.assert_allclose(log.columns["u"], 0.1 * SECONDS)
    np.testing.assert_allclose(log.inputs["rudder"], 0.01 * SECONDS)


def test_sparse_logs_and_pauses_below_an_hour_are_no_jumps():
    for times in ([7200.0 * k for k in range(12)], [0.0, 1.0, 3500.0, 3501.0], [0, 1800.0, 9000.0, 9000.5]):
        assert clock(np.array(times), str).breaks == ()


def test_a_log_is_cut_into_segments_at_its_breaks():
    """Also where it is one run, and where the times themselves show no gap."""
    log = Log(np.array(TIMES), {"u": np.zeros(40)}, breaks=(20,))
    for segment, starts in ((None, [0.0, 2.0]), (1.0, [0.0, 1.0, 2.0, 3.0])):
        cut = samples(log, np.zeros(0, int), 0.1, segment, "held")
        np.testing.assert_allclose(cut.starts, starts)
        assert cut.after_gap[np.flatnonzero(np.isclose(starts, 2.0))[0]] and cut.after_gap.sum() == 1
    later = log.between(1.0, 3.0)
    assert later.breaks == (10,) and log.between(2.0, 3.0).breaks == ()


def cruise(n=400, turning=0.3) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """A vehicle that climbs and turns, with the noise of its sensors."""
    random, t = np.random.default_rng(3), 0.1 * np.arange(n)
    heading, pitch = 0.4 + turning * t + 0.5 * np.sin(0.4 * t), 0.2 * np.sin(0.3 * t)
    u = 1.2 + 0.3 * np.sin(0.2 * t)
    speed = {"north": u * np.cos(pitch) * np.cos(heading), "east": u * np.cos(pitch) * np.sin(heading)}
    speed["depth"] = -u * np.sin(pitch)
    columns: dict[str, Any] = {name: 5 + np.append(0, np.cumsum(v[1:] + v[:-1]) * 0.05) for name, v in speed.items()}
    columns |= {"pitch": pitch, "heading": (heading + np.pi) % (2 * np.pi) - np.pi, "u": u}
    columns |= {"q": np.gradient(pitch, t), "r": np.gradient(heading, t)}
    sizes = {"north": 0.1, "east": 0.1, "depth": 0.02, "u": 0.02}
    return t, {name: v + sizes.get(name, 0.004) * random.normal(size=n) for name, v in columns.items()}


def doubts(t, columns, **changed):
    """Sentences on a log with some columns multiplied, or left out (None)."""
    found = {name: values * (changed.get(name, 1) or 1) for name, values in columns.items() if changed.get(name, 1)}
    return Log(t, found).doubts


@pytest.mark.parametrize("kept", [1.0, 0.6])
def test_a_correct_log_is_not_doubted(kept):
    t, columns = cruise()
    silent = np.random.default_rng(5).uniform(size=(len(columns), len(t))) > kept
    columns = {name: np.where(off, np.nan, v) for off, (name, v) in zip(silent, columns.items(), strict=True)}
    assert not doubts(t, columns)
    assert not doubts(t, columns, q=None, r=None) and not doubts(t, columns, u=None)
    assert not doubts(10 * t, columns, u=0.1, q=0.1, r=0.1), "a slow ship"
    spin = {"heading": (25 * t + np.pi) % (2 * np.pi) - np.pi, "r": np.full(len(t), 25.0), "depth": columns["depth"]}
    assert not doubts(t, spin)


@pytest.mark.cases(6)
@pytest.mark.parametrize(("factor", "unit"), [(1e3, "ms"), (1e6, "us"), (1e9, "ns")])
@pytest.mark.parametrize("left_out", [{}, {"q": None, "r": None}, {"north": None, "east": None, "depth": None}])
def test_times_in_another_unit_are_betrayed_by_speeds_or_rates(factor, unit, left_out):
    t, columns = cruise()
    (told,) = doubts(factor * t, columns, **left_out)
    assert told.startswith("`time` runs some") and f"looks like {unit} read as s" in told and f"`time_{unit}`" in told


def test_lengths_in_another_unit_are_betrayed_by_the_velocity():
    t, columns = cruise()
    for name, factor, unit in (
        ("depth", 100, "cm"),
        ("depth", 1000, "mm"),
        ("north", 1000, "mm"),
        ("east", 1e-3, "km"),
    ):
        if unit == "km":
            columns = {n: v if n not in ("north", "east") else v - 0.1 * np.random.default_rng(3).normal(size=len(t))
                       for n, v in columns.items()}  # fmt: skip
        (told,) = doubts(t, columns, **{name: factor})
        assert (
            told.startswith(f"`{name}` moves some")
            and f"like {unit} read as m; name the column `{name}_{unit}`" in told
        )


def test_a_heading_in_another_unit_is_betrayed_by_its_jumps_or_by_where_the_vehicle_goes():
    t, columns = cruise()
    (told,) = doubts(t, columns, heading=np.pi / 180, r=None, north=None, east=None)
    assert told.startswith("`heading` jumps by 6.28 degrees") and "`heading_rad`" in told
    t, columns = cruise(turning=0.0)
    (told,) = doubts(t, columns, heading=np.pi / 180, r=None)
    assert "would if that were rad read as deg: name the column `heading_rad`" in told
    (told,) = doubts(t, columns, heading=180 / np.pi, r=None)
    assert "would if that were deg read as rad: name the column `heading_deg`" in told


def test_a_heading_that_turns_fast_near_a_pitch_of_90_degrees_is_betrayed_by_its_jumps():
    """Two of thirteen crossings are seen from further inside than others; white noise has many such steps."""
    turned = 0.07 * np.arange(1200)
    for crossing in (270, 810):
        turned[crossing:] += 1.2
    heading = np.mod(turned + np.random.default_rng(4).normal(0, 0.01, 1200), 2 * np.pi)
    (told,) = Log(0.1 * np.arange(1200), {"heading": np.radians(heading)}).doubts
    assert told.startswith("`heading` jumps by 6.28 degrees")
    noise = np.random.default_rng(5).uniform(0, 2 * np.pi, 1200)
    assert not Log(0.1 * np.arange(1200), {"heading": np.radians(noise)}).doubts


def test_a_wild_value_is_named_by_row_and_column():
    t, columns = cruise()
    for name, value in (("north", 1e6), ("depth", -4000.0), ("u", 99.0), ("pitch", 1e3), ("r", 500.0)):
        values = columns[name].copy()
        values[123] = value
        (told,) = doubts(t, {**columns, name: values})
        assert told.startswith(f"`{name}` is {value:g} in row 124, at 12.3 s, between ")
    values = columns["north"].copy()
    values[[50, 90, 200]] = 1e6, -1e6, 3e5
    (told,) = doubts(t, {**columns, "north": values})
    assert "and 2 more like it" in told


@pytest.mark.parametrize("rows", [[123, 124], [0, 1], [298, 299], [60, 61, 62]])
def test_neighbouring_wild_values_of_unequal_size_are_named(rows):
    t, columns = cruise()
    values = columns["north"][:300].copy()
    values[rows] = [1.0e6, 1.1e6, 1.2e6][: len(rows)]
    (told,) = doubts(t[:300], {**{name: column[:300] for name, column in columns.items()}, "north": values})
    calm = values[min(rows[0] - 1, 299)] if rows[0] else values[2]
    assert f"between {calm:.6g} and " in told and f"and {len(rows) - 1} more like it" in told


def test_a_number_that_stands_for_no_value_is_named():
    t, columns = cruise()
    for rows, mark in (([40, 41, 90, 200], -999.0), ([77, 78], 1e6)):
        values = columns["depth"].copy()
        values[rows] = mark
        (told,) = doubts(t, {**columns, "depth": values})
        assert told.startswith(f"`depth` is {mark:g} in {len(rows)} rows, first in row {rows[0] + 1}, at ")
    climbs = np.clip(15 + 20 * np.sin(t), 0.0, 30.0)  # between a deck at 0 m and a bottom at 30 m
    rests = np.where(t < 20, 0.0, 2e3)  # of a column that is only one step
    pulses = {"u": np.where(t % 5 < 0.5, 0.0, 2.0), "roll": np.where(t % 5 < 0.5, -3.1, 3.1)}
    assert not doubts(t, {"depth": climbs, "north": rests, **pulses})


def test_steps_pulses_and_heavy_tails_are_not_wild():
    random, t = np.random.default_rng(2), 0.1 * np.arange(2000)
    step = np.where(t > 90, 500.0, 0.0) + random.normal(size=len(t))
    heavy = random.standard_t(3, size=len(t))
    rests = np.where(np.arange(len(t)) == 700, 2.0, 0.0)
    assert not Log(t, {"north": step, "u": heavy, "depth": rests}).doubts


def test_read_log_warns_of_what_it_doubts(table):
    path = table(TIMES)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        read_log(path)
    path.write_text(path.read_text().replace("\n2.0,2,", "\n2.0,2000000,"))
    with pytest.warns(UserWarning, match=r"log\.csv: `u` is 2e\+06 in row 21, at 2 s"):
        read_log(path)


def test_samples_far_apart_without_speeds_are_noted_but_not_doubted():
    t = np.arange(0.0, 4000.0, 100.0)
    log = Log(t, {"heading": 1e-3 * t})
    assert not log.doubts and any("if times are in ms" in note for note in log.notes)
    t, columns = cruise()
    assert not Log(
        200 * t, {**columns, "u": columns["u"] / 200, "q": columns["q"] / 200, "r": columns["r"] / 200}
    ).notes


def test_the_command_offers_the_choices_that_its_errors_name(table, capsys):
    """A parameter that there is not ends it before anything is simulated."""
    asked = ["identify", "remus_100", str(table(SHIFTED)), "--parameters", "hul"]
    assert (
        main(asked) == 2 and "time jumps by 3600.1 s" in (said := capsys.readouterr().err) and "--jumps split" in said
    )
    assert main([*asked, "--jumps", "split"]) == 2 and "holds no commands of" in capsys.readouterr().err
    asked[2] = str(table(TIMES[::-1]))
    assert main(asked) == 2 and "--unsorted sort" in capsys.readouterr().err
    assert main([*asked, "--unsorted", "sort"]) == 2 and "holds no commands of" in capsys.readouterr().err
