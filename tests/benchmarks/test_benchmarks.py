"""The loop by hand is the native kernel's equal, other programs solve the same problems, and the command runs."""

from __future__ import annotations

import importlib
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
pytest.importorskip("numba", reason="needs the extra `benchmarks`")


@pytest.fixture(autouse=True)
def from_the_root(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT))


@pytest.mark.long
def test_the_loop_by_hand_and_the_native_kernel_take_the_same_steps():
    one, problems = (importlib.import_module(f"benchmarks.{name}") for name in ("one", "problems"))
    vehicle, steps = problems.vehicle(), 2000
    found, iterations = one.hand_written(vehicle, steps, 100)()
    chunk = problems.ready(vehicle, one.PAPER, one.H).run(steps // 100, 100)
    by_hand, ours = one.rows_of_hand(vehicle, found), vehicle.path(chunk)
    difference = np.max(np.abs(by_hand - ours) / np.max(np.abs(ours), axis=0))
    print(f"largest relative difference {difference:.1e}, iterations {iterations} and {chunk.iterations}")
    assert difference <= 2e-12
    assert abs(iterations - chunk.iterations) <= 0.05 * iterations


@pytest.mark.long
def test_the_fleet_by_hand_is_the_native_ensemble():
    many = importlib.import_module("benchmarks.many")
    fleet = many.Fleet(11)
    by_hand, ours = fleet.by_hand(200)(), fleet.native(200, 1).final
    np.testing.assert_allclose(by_hand[:, 10:13], ours.n, rtol=1e-12)
    assert np.ptp(ours.n[:, 2]) > 0.1, "the members should move apart"


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("name", ["vehicle", "heavy_top", "ellipsoid"])
def test_the_equations_for_other_programs_are_those_of_the_system(name: str):
    """RK4 by hand, DOP853 in NumPy and the midpoint rule converge to one motion."""
    import coadjoint as co

    bodies, problems = (importlib.import_module(f"benchmarks.{module}") for module in ("bodies", "problems"))
    problem = getattr(problems, name)()
    times, steps = problem.times[:3], round(problem.times[2] / problem.coarse * 64)
    exact = bodies.reference(problem.body, problem.y0, times)
    plain, _ = bodies.by_scipy(problem.body, problem.y0, times, "DOP853", 1e-10)
    y, out = problem.y0.copy(), np.empty((1, 18))
    bodies.rk4(problem.body.numbers, problem.coarse / 64, y, 1, steps, out)
    method = co.Suzuki4(co.Midpoint(co.Cayley()))
    ours = problem.rows(problems.ready(problem, method, problem.coarse / 64).run(1, steps).final)
    for label, found in (("DOP853", plain[-1]), ("RK4", y), ("Suzuki-4", ours)):
        distance = np.linalg.norm(problem.place(found) - problem.place(exact[-1]))
        print(f"{name}, {label}: {distance:.1e}")
        assert distance <= 2e-8


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("name", ["ellipsoid", "remus"])
def test_bodies_in_an_ideal_fluid_move_alike_by_their_own_equations_and_ours(name: str):
    kirchhoff = importlib.import_module("benchmarks.kirchhoff")
    body = getattr(kirchhoff, name)()
    by_rk4 = kirchhoff._rk4(body, 0.005, 2.0)
    ours = kirchhoff._ours(body, kirchhoff.METHODS["Kahan–Li-8 (midpoint)"], 2.0)()
    distance = np.max(np.abs(by_rk4[::10] - ours))
    print(f"{name}: {distance:.1e}")
    assert distance <= 1e-6
    for rows in (by_rk4, ours):
        for invariant in body.invariants(rows):
            assert np.max(np.abs(invariant - invariant[0])) <= 1e-7 * np.max(np.abs(invariant))


@pytest.mark.long
def test_the_reference_of_the_heavy_top_has_the_published_digits():
    bodies, problems = (importlib.import_module(f"benchmarks.{module}") for module in ("bodies", "problems"))
    top = problems.heavy_top()
    found = top.place(bodies.reference(top.body, top.y0, top.times))[-1]
    np.testing.assert_allclose(found, (-0.150416822746, -0.724165591637, -0.673022269560), atol=3e-12)


def test_results_stay_out_of_the_repository():
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks", "--quick", "--out", str(ROOT / "docs" / "measured")],
        cwd=ROOT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode
    assert "--out must be outside the repository" in done.stderr
    assert not (ROOT / "docs" / "measured").exists()


def test_parts_on_a_gpu_go_on_after_one_that_fails_and_begin_none_that_would_end_too_late(capsys, monkeypatch):
    gpu = importlib.import_module("benchmarks.gpu")
    clock = iter([0.0, 1.0, 2.0, gpu.LIMIT + 1])

    def fail() -> dict[str, float]:
        raise ValueError("no room")

    parts = [("first", 1, fail), ("second", 2, lambda: {"seconds": 0.5}), ("third", 3, fail)]
    monkeypatch.setattr(gpu, "_parts", lambda small: parts)
    monkeypatch.setattr(gpu.time, "perf_counter", lambda: next(clock))
    gpu.main(True)
    rows = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    said = [{key: row[key] for key in row if key not in ("part", "size", "device")} for row in rows]
    assert said == [{"failed": "ValueError: no room"}, {"seconds": 0.5}, {"left_out": f"after {gpu.LIMIT:g} s"}]


def test_commands_are_timed_cold_and_repeated_from_the_checkout_of_each_python(monkeypatch):
    commands, tables = importlib.import_module("benchmarks.commands"), importlib.import_module("benchmarks.tables")
    code = "import os; assert 'cache' in os.environ['COADJOINT_CACHE'] and os.path.isdir('examples')"
    monkeypatch.setattr(commands, "CASES", {"nothing": ["-c", code]})
    found = commands.measure(True)
    (seconds,) = found["nothing"].values()
    assert len(seconds) == 2 and min(seconds) > 0
    (table,) = tables.tables("commands", found)
    assert table.rows[0][0] == "nothing" and " / " in table.rows[0][1]


@pytest.mark.long
def test_the_quick_form_of_the_command_runs(tmp_path: Path):
    sections = ["one", "many_1", "gradients", "stepping", "calls", "instructions", "precision"]
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks", "--quick", "--out", str(tmp_path), "--only", *sections],
        cwd=ROOT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert not done.returncode, done.stdout + done.stderr
    found = json.loads((tmp_path / "benchmarks.json").read_text(encoding="utf-8"))
    assert set(sections) <= set(found)
    ratios = [row["ratio"] for row in found["one"]["rows"].values()]
    assert all(np.isfinite(ratios)) and min(ratios) > 0
    for figure in ("speed.png", "work_precision.png"):
        assert (tmp_path / figure).stat().st_size > 10_000
