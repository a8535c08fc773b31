"""Shards of a sweep: what is kept of members at every node, and the statistics of all shards together."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from coadjoint.errors import ArgumentError, FileError, GroupError
from coadjoint.report.folder import UNFINISHED
from coadjoint.simulation.result import Result
from coadjoint.sweeps import store, task
from coadjoint.sweeps.call import _file
from coadjoint.sweeps.local import LIVES, _called, _require_life
from coadjoint.sweeps.reduction import KEPT, Reduction
from coadjoint.sweeps.results import facts, gathered
from coadjoint.sweeps.sketch import Sketch
from coadjoint.sweeps.task import REFUSED, _courses, _joined, _of_all

NAN = np.nan
DEPTHS = np.array([[1.0, 5.0, 9.0], [4.0, 2.0, NAN], [3.0, NAN, NAN]])
"""Of three members at three nodes; the second ended at an event, the third failed."""


def reduced(courses: bool = True, whole: bool = True) -> Reduction:
    nodes = iter(DEPTHS)
    states: Any = SimpleNamespace(t=np.zeros(3))
    found = Reduction(lambda records: {"depth": ((), next(nodes))}, states, courses, whole)  # pyright: ignore
    for depths in DEPTHS:
        found.take(SimpleNamespace(t=np.where(np.isnan(depths), NAN, 0.0), internal=None))  # pyright: ignore[reportArgumentType]
    return found


def test_final_least_largest_and_mean_values_are_those_of_the_nodes_that_a_member_reached():
    found = reduced().results(np.array([False, False, True]))
    expected = {"final": [3, 2, NAN], "least": [1, 2, NAN], "largest": [4, 5, NAN], "mean": [8 / 3, 3.5, NAN]}
    for kind, values in expected.items():
        np.testing.assert_allclose(found[f"{kind}_depth"], values, rtol=1e-15)


def test_of_each_node_all_values_and_their_spread_are_kept():
    found = reduced()
    np.testing.assert_array_equal(found.rows["depth"], DEPTHS)
    assert [sketch.count for sketch in found.nodes["depth"]] == [3, 2, 1]
    assert [float(sketch.mean) for sketch in found.nodes["depth"]] == [5.0, 3.0, 3.0]
    bare = reduced(courses=False, whole=False)
    assert bare.rows == {} and bare.nodes == {}


def test_where_an_event_ends_a_member_counts_for_all_but_its_mean(monkeypatch):
    found = reduced()
    found.observer = SimpleNamespace(system=None, chosen=("depth",))  # pyright: ignore[reportAttributeAccessIssue]

    def observed(*_: Any) -> Any:
        return lambda records, members: {"depth": ((), np.array([7.0]))}

    monkeypatch.setattr("coadjoint.sweeps.reduction.Observer", observed)
    found.end([], None)  # pyright: ignore[reportArgumentType]
    found.end([1], SimpleNamespace())  # pyright: ignore[reportArgumentType]
    kept = found.results(np.zeros(3, bool))
    assert kept["final_depth"].tolist() == [3, 7, 9] and kept["largest_depth"].tolist() == [4, 7, 9]
    assert kept["least_depth"].tolist() == [1, 2, 9] and kept["mean_depth"].tolist() == [8 / 3, 3.5, 9]


def shard(first: int, values: np.ndarray, nodes: np.ndarray, **more: Any) -> store.Shard:
    code = np.where(np.isnan(values), 2, 0)
    return store.Shard(
        {"code": code, "final_q": values},
        {"final_q": Sketch.of(values[code == 0])},
        {"q": [Sketch.of(row) for row in nodes]},
        0.5 * np.arange(len(nodes)),
        {first + k: f"no {first + k}" for k in range(30)} if more.pop("refused", False) else {},
        more.pop("warnings", {}), **more,
    )  # fmt: skip


def folder(path: Path) -> None:
    """Of a sweep that is laid out."""
    (path / UNFINISHED / store.SHARDS).mkdir(parents=True)
    for name in ("code", "final_q"):
        (path / store.MEMBERS / name).mkdir(parents=True)


def test_statistics_of_all_shards_are_those_of_all_members(tmp_path):
    folder(tmp_path)
    random = np.random.default_rng(7)
    values, nodes = random.normal(size=(2, 5)), random.normal(size=(2, 3, 5))
    values[1, 2] = NAN
    first = shard(0, values[0], nodes[0], warnings={"a": 2}, events=3, kernel=0.5, seconds=1.0, refused=True)
    store.write(tmp_path, 0, 5, first, True)
    store.write(tmp_path, 1, 5, shard(5, values[1], nodes[1], warnings={"a": 1, "b": 4}, events=1, seconds=2.0), True)
    assert store.done(tmp_path) == {0, 1} and store.problems(tmp_path, 0) == []
    found, told = gathered(tmp_path, 2, [0.5], {"q": ()})
    good = values[np.isfinite(values)]
    expected = [good.mean(), good.std(ddof=1), good.min(), good.max(), np.median(good)]
    np.testing.assert_allclose(found["final_q"], expected, rtol=1e-14)
    together = nodes.transpose(1, 0, 2).reshape(3, 10)
    np.testing.assert_allclose(found["q"][0], together.mean(axis=1), rtol=1e-12)
    np.testing.assert_allclose(found["q"][4], np.median(together, axis=1), rtol=1e-12)
    assert found.statistic.values.tolist() == ["mean", "std", "min", "max", "50%"]
    assert found.time.values.tolist() == [0.0, 0.5, 1.0]
    assert told["failures"] == {"not finite": 1} and told["finished"] == 9
    assert told["warnings"] == {"a": 3, "b": 4} and told["events"] == 4
    assert told["kernel_seconds"] == 0.5 and told["task_seconds"] == 3.0
    assert told["refusals"] == {str(k): f"no {k}" for k in range(20)}


def test_a_shard_that_changed_is_missing_and_one_of_a_folder_that_is_gone_is_refused(tmp_path):
    place, values = tmp_path / UNFINISHED / store.SHARDS, np.arange(3.0)
    folder(tmp_path)
    place.rmdir()
    with pytest.raises(FileError, match="is gone: the sweep has ended, or was deleted while a task was at work"):
        store.write(tmp_path, 0, 3, shard(0, values, values[None]), True)
    place.mkdir()
    for number in range(3):
        store.write(tmp_path, number, 3, shard(0, values, values[None]), True)
    (file,) = place.glob("000001*")
    file.write_bytes(file.read_bytes()[:-1] + b"x")
    chunk = next(path for path in (tmp_path / store.MEMBERS / "final_q").rglob("*2*"))
    chunk.write_bytes(b"y" * chunk.stat().st_size)
    assert "is damaged: the same command again recomputes it" in store.problems(tmp_path, 1)[0]
    store.discard_damaged(tmp_path)
    assert store.done(tmp_path) == {0}
    with pytest.raises(FileError, match="cannot be read: No such file"):
        store.Statistics(tmp_path, 1)


def piece(places: list[int], refusal: str = "", **more: Any) -> Any:
    if refusal:
        return SimpleNamespace(places=np.array(places), run=None, reduction=None, refusal=refusal)
    count = len(places)
    run = {
        "codes": np.zeros(count, int), "steps_done": np.full(count, 4), "event": None, "seconds": 0.25,
        "warnings": [], "steps_saved": np.arange(3), "plan": SimpleNamespace(h=0.5),
    } | more  # fmt: skip
    rows = np.array(places, float)
    reduction = SimpleNamespace(
        results=lambda failed: {"final_q": np.where(failed, NAN, rows)}, whole=True,
        rows={"q": [rows, 10 + rows]}, nodes={"q": [Sketch.of(rows), Sketch.of(10 + rows)]},
    )  # fmt: skip
    return SimpleNamespace(places=np.array(places), run=SimpleNamespace(**run), reduction=reduction, refusal="")


def test_the_pieces_of_a_task_are_joined_in_the_order_of_its_members():
    whole: Any = SimpleNamespace(count=5, first=100)
    pieces = [
        piece([0, 3], event=np.array([0.7, NAN]), warnings=["slow"]),
        piece([2, 1], codes=np.array([0, 2]), warnings=["slow", "odd"]),
        piece([4], refusal="It is too heavy."),
    ]
    made = _joined(whole, pieces)
    assert made.members["code"][[0, 1, 2, 3]].tolist() == [0, 2, 0, 0] and made.members["code"][4] == REFUSED
    assert made.members["steps_done"].tolist() == [4, 4, 4, 4, 0]
    np.testing.assert_array_equal(made.members["final_q"], [0, NAN, 2, 3, NAN])
    np.testing.assert_array_equal(made.members["event_time"], [0.7, NAN, NAN, NAN, NAN])
    assert made.refusals == {104: "It is too heavy."} and made.warnings == {"slow": 4, "odd": 2}
    assert made.events == 1 and made.kernel == 0.5 and made.times.tolist() == [0.0, 0.5, 1.0]
    assert made.sketches["final_q"].count == 3 and "code" not in made.sketches
    assert made.nodes is not None
    np.testing.assert_array_equal(made.nodes["q"], [[0, 10], [1, 11], [2, 12], [3, 13], [NAN, NAN]])
    assert [float(one.mean) for one in made.courses["q"]] == [1.5, 11.5] and _courses([]) == {}
    assert _joined(whole, pieces[2:]).times.shape == (0,)


def test_the_summary_of_a_sweep_is_in_lines():
    told = {
        "members": 1200, "system": "top", "method": "Midpoint", "dt": 0.1, "numbers": ["mass", "depth"], "tasks": 12,
        "sampling": "random", "members_of_a_task": 100, "failures": {"refused": 3}, "events": 1000, "seconds": 2.0,
        "task_seconds": 20.0,
    }  # fmt: skip
    lines = dict(facts(told))
    assert lines["sweep"] == "1,200 × top, Midpoint, dt = 0.1 s" and lines["numbers"] == "mass, depth (random)"
    assert lines["failed"] == "3 refused" and dict(facts({**told, "failures": {}}))["failed"] == "none"
    assert lines["time"] == "2 s, of all tasks 20 s" and lines["events"] == "1,000"


def _no_group() -> None:
    raise GroupError("It is none.")


def test_a_worker_answers_with_the_result_of_a_call_or_an_error_without_its_traceback():
    import pickle

    assert _called(pickle.dumps(dict)) == {}
    refused = _called(pickle.dumps(_no_group))
    assert isinstance(refused, GroupError) and str(refused) == "It is none."
    broken = _called(b"no pickle")
    assert isinstance(broken, FileError) and str(broken).startswith("A task of the sweep failed: UnpicklingError: ")


def test_workers_that_die_before_their_first_task_end_the_sweep():
    _require_life(None, LIVES)
    with pytest.raises(FileError, match=f"Workers of the sweep ended {LIVES + 1} times before their first task"):
        _require_life(None, LIVES + 1)
    with pytest.raises(FileError, match=f"Task 4 of the sweep was lost with its worker {LIVES + 1} times"):
        _require_life(4, LIVES + 1)


def test_what_is_no_run_cannot_be_swept():
    with pytest.raises(ArgumentError, match="`run` must be the path of a run or mission file, or a mission, but is 3"):
        _file(3)


def test_a_task_writes_what_it_computed_with_its_numbers_and_says_how_long_each_part_took(monkeypatch, tmp_path):
    written: list[Any] = []
    made = shard(0, np.arange(3.0), np.zeros((1, 3)), kernel=0.5, seconds=2.0)
    sweep = SimpleNamespace(results=SimpleNamespace(keep="statistics"))
    monkeypatch.setattr(task, "compute", lambda given, threads: made)
    monkeypatch.setattr(task, "swept", lambda given: (sweep, {}))
    monkeypatch.setattr(task, "write", lambda *given: written.append(given))
    clock = iter([10.0, 10.25])
    monkeypatch.setattr(task, "time", SimpleNamespace(perf_counter=lambda: next(clock)))
    given: Any = SimpleNamespace(rows={"mass": np.ones(3)}, folder=str(tmp_path), number=4, size=3)
    found = task.perform(given)
    assert {name: found[name] for name in ("seconds", "kernel", "writing")} == {
        "seconds": 2.25, "kernel": 0.5, "writing": 0.25,
    }  # fmt: skip
    ((folder, number, size, one, kept),) = written
    assert (folder, number, size, kept) == (tmp_path, 4, 3, False) and one is made
    assert next(iter(made.members)) == "mass" and "final_q" in made.members


def test_a_folder_that_holds_another_sweep_by_now_has_none_of_its_tasks(tmp_path):
    with pytest.raises(FileError, match=r"A worker cannot read .*: No such file .*; all workers need the folder"):
        task.read(str(tmp_path), "x")
    (tmp_path / task.RUN_FILE).write_text("[sweep]\n")
    with pytest.raises(FileError, match="holds another sweep by now: this task does not belong to it"):
        task.read(str(tmp_path), "x")


def test_a_warning_about_members_names_the_worst_of_the_sweep_and_counts_them():
    said = "Of member 1, and of 2 others of 4, `jets` is at its limits."
    assert _of_all(said, np.array([10, 12, 13, 15])) == (said.replace("member 1", "member 12"), 3)
    assert _of_all("The water is cold.", np.arange(4)) == ("The water is cold.", 4)


def test_a_reduction_keeps_internal_states_of_a_bounded_number_of_nodes_to_its_end():
    made = Reduction(cast(Any, None), cast(Any, SimpleNamespace(t=np.zeros(2))), False, False)
    for node in range(1000):
        made._keep({"jets": np.full((2, 3), float(node))})
    nodes = np.concatenate([one["jets"] for one in made.internal])
    assert nodes.shape[1:] == (2, 3) and 32 <= len(nodes) <= KEPT
    assert set(np.diff(nodes[:, 0, 0])) == {16.0} and nodes[-1, 0, 0] >= 984
    assert Result.internal_states(cast(Any, SimpleNamespace(memory=made))) == made.internal
