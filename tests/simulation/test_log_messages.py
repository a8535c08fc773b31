"""What a run tells the standard library's logging: where it stands, and nothing on a terminal by itself."""

from __future__ import annotations

import logging
from pathlib import Path

import pytest

import coadjoint as co
from coadjoint.simulation.progress import LOGGED_SECONDS, Progress


def said(caplog: pytest.LogCaptureFixture) -> list[str]:
    return [record.getMessage() for record in caplog.records if record.name.startswith("coadjoint.")]


@pytest.fixture
def body() -> co.System:
    return co.System(co.SO2(), lambda xi: 0.5 * xi @ xi, name="wheel")


def test_a_long_run_tells_its_progress_every_ten_seconds_of_running(caplog):
    progress = Progress(1000, False, "wheel")
    with caplog.at_level(logging.INFO, "coadjoint"):
        for seconds in (0.5 * LOGGED_SECONDS, LOGGED_SECONDS, 1.5 * LOGGED_SECONDS, 2.5 * LOGGED_SECONDS):
            progress.advance(100, seconds)
    assert said(caplog) == ["wheel: 200 of 1000 steps, 20 steps/s.", "wheel: 400 of 1000 steps, 16 steps/s."]


@pytest.mark.long
def test_a_run_tells_its_begin_and_its_end_once(caplog, body):
    with caplog.at_level(logging.INFO, "coadjoint"):
        run = co.simulate(body, body.state(xi=[1.0]), dt=0.1, steps=5, backend="xla", progress=False)
    first, last = said(caplog)
    assert first == f"{run.title} begins, 5 steps by XLA, Newton's method with a dense Jacobian."
    assert last.startswith(f"{run.title} ends after ")


@pytest.mark.long
def test_a_run_that_is_resumed_tells_what_its_folder_holds(caplog, body, tmp_path: Path):
    folder = tmp_path / "wheel"
    co.simulate(body, body.state(xi=[1.0]), dt=0.1, steps=5, backend="xla", store=folder, progress=False)
    with caplog.at_level(logging.INFO, "coadjoint"):
        co.resume(folder, body)
    assert said(caplog) == [f"{folder} holds 6 of 6 records."]


@pytest.mark.long
def test_a_run_says_nothing_without_being_asked(capfd, body):
    co.simulate(body, body.state(xi=[1.0]), dt=0.1, steps=5, backend="xla", progress=False)
    assert capfd.readouterr() == ("", "")
    assert any(isinstance(handler, logging.NullHandler) for handler in logging.getLogger("coadjoint").handlers)


def compiled(body: co.System, backend: str, progress: bool | None) -> co.Run:
    return co.simulate(body, body.state(xi=[1.0]), dt=0.1, steps=5, backend=backend, progress=progress)


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize(("backend", "progress", "told"), [("xla", True, 1), ("xla", False, 0), ("native", True, 0)])
def test_a_terminal_shows_how_a_step_is_solved_while_xla_compiles_it(capfd, monkeypatch, body, backend, progress, told):
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setattr("coadjoint.simulation.progress._QUIET_SECONDS", 1e-9)
    run = compiled(body, backend, progress)
    said = capfd.readouterr().err
    assert ("compiling a step by XLA, Newton" in said) == bool(told)
    assert ("solved" in run.certificate.long()) == (backend == "xla")


@pytest.mark.long
def test_an_ensemble_by_xla_says_how_it_is_solved(body):
    fleet = co.simulate(body, body.state(xi=co.each([[1.0], [2.0]])), dt=0.1, steps=5, backend="xla", progress=False)
    assert "by XLA, Newton's method with a dense Jacobian" in fleet.certificate.long()
