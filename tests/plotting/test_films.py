"""Films of any run: GIF, MP4 by ffmpeg, a page, and inline in notebooks."""

from __future__ import annotations

import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import xarray
from matplotlib.colors import to_rgb
from PIL import Image

from coadjoint.errors import ArgumentError, FileError
from coadjoint.plotting import plots
from coadjoint.plotting.entries import entries
from coadjoint.plotting.film import Film
from coadjoint.plotting.plots import Plots, available, figure_names
from coadjoint.plotting.stage import stage
from coadjoint.plotting.style import COLOURS

TIME = np.linspace(0.0, 2.0, 21)


def dataset(**variables: Any) -> xarray.Dataset:
    """A run with these variables, (nodes, …)."""
    found = {name: (("time", *(f"{name}_{i}" for i in range(np.ndim(v) - 1))), v) for name, v in variables.items()}
    return xarray.Dataset(found, coords={"time": TIME}, attrs={"system": "made", "method": "up"})


def spiral(size: int) -> np.ndarray:
    return np.stack([np.cos(3 * TIME), np.sin(3 * TIME), TIME, TIME][:size], axis=1)


def turning() -> np.ndarray:
    c, s, o, one = np.cos(TIME), np.sin(TIME), 0 * TIME, 1 + 0 * TIME
    return np.moveaxis(np.array([[c, -s, o], [s, c, o], [o, o, one]]), 2, 0)


KINDS = [{"q": spiral(3)}, {"x": spiral(2)}, {"R": turning(), "mu": spiral(1)}, {"mu": spiral(4)}]


@pytest.mark.parametrize("variables", KINDS)
def test_up_to_a_time_a_curve_is_bright_with_a_dot_at_its_end_and_a_spoke_if_it_turns(variables: Any) -> None:
    runs = entries([dataset(**variables)] * 2, ["one", "two"])
    _, traces = stage(runs)
    turned, place = "R" in variables, next((name for name in ("q", "x") if name in variables), "")
    shown = (
        [variables[place]] if place else list(np.moveaxis(variables.get("R", np.zeros((21, 3, 0))), 2, 0))[: 3 * turned]
    )
    columns = 2 * next(iter(variables.values())).shape[-1] if not turned else 2
    assert len(traces) == 2 * len(shown) + columns
    for trace in traces:
        trace.axes.draw_artist = lambda line: None
        trace.draw(0.95)
    for path, trace in zip([*shown, *shown], traces, strict=False):
        bright, dot = (getattr(line, "_verts3d", line.get_data()) for line in (trace.path, trace.dot))
        np.testing.assert_allclose(np.stack(bright, axis=1)[-1], path[10])
        assert len(bright[0]) == 11 and len(dot[0]) == 1 + turned
        np.testing.assert_allclose(np.stack(dot, axis=1)[-1], path[10])
        assert not turned or not any(part[0] for part in dot)
    colours = [trace.path.get_color() for trace in traces]
    space = list(COLOURS[: len(shown)]) * 2 if turned else list(COLOURS[:2]) * bool(place)
    assert colours[: 2 * len(shown)] == space
    assert set(colours[2 * len(shown) :]) == set(COLOURS[:2])
    assert turned is (traces[0].axes.get_xlim() == (-1.0, 1.0))
    traces[-1].draw(9.0)
    assert traces[-1].path.get_xdata()[-1] == 2.0


@pytest.mark.cases(1)
@pytest.mark.parametrize("variables", KINDS)
def test_a_gif_of_any_run_has_its_frames_and_moves(variables: Any, tmp_path: Path) -> None:
    path = Plots(dataset(**variables)).animation(path=tmp_path / "made.gif", frames=3)
    assert isinstance(path, Path) and [one.name for one in tmp_path.iterdir()] == ["made.gif"]
    with Image.open(path) as pictures:
        assert getattr(pictures, "n_frames", 1) == 3
        shown = []
        for number in (0, 2):
            pictures.seek(number)
            shown.append(np.asarray(pictures.convert("RGB"), dtype=int))
    assert np.count_nonzero(np.abs(shown[1] - shown[0]).sum(axis=2) > 50) > 100
    for colour in COLOURS[: 2 if "R" in variables else 1]:
        bright = 255 * np.array(to_rgb(colour))
        assert np.count_nonzero(np.abs(shown[1] - bright).sum(axis=2) < 40) > 100, "in the colours of the curves"


def test_what_moves_in_space_is_a_player_and_else_pictures(tmp_path: Path) -> None:
    moving, still = (Plots(dataset(**kind)).animation(frames=2) for kind in (KINDS[0], KINDS[3]))
    assert isinstance(moving, Film) and isinstance(still, Film)
    assert moving._repr_html_().startswith("<iframe ")
    assert re.match(r'<img alt="[^"]+" src="data:image/gif;base64,R0lGOD', still._repr_html_())
    page = still.save(tmp_path / "still.html").read_text("utf-8")
    assert page.startswith("<!doctype html>") and "data:image/gif;base64," in page


def program(folder: Path, text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A program of the name ffmpeg, alone on the PATH but for those of the shell."""
    folder.mkdir()
    made = folder / "ffmpeg"
    made.write_text(f"#!/bin/sh\n{text}\n")
    made.chmod(0o755)
    monkeypatch.setenv("PATH", f"{folder}:/usr/bin:/bin")


def test_an_mp4_is_written_by_ffmpeg_from_even_pictures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    keep = 'for last; do :; done; cat > "$last.raw"; wc -c < "$last.raw" > "$last"; rm "$last.raw"; echo "$@" > args'
    program(tmp_path / "bin", keep, monkeypatch)
    monkeypatch.chdir(tmp_path)
    Plots(dataset(**KINDS[3])).animation(path="made.mp4", frames=3)
    found = re.search(r"-s (\d+)x(\d+)", (tmp_path / "args").read_text())
    assert found is not None
    width, height = map(int, found.groups())
    assert width % 2 == height % 2 == 0 and int((tmp_path / "made.mp4").read_text()) == 3 * 3 * width * height


def test_what_ffmpeg_says_is_passed_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    program(tmp_path / "bin", "cat > /dev/null; echo 'no encoder' >&2; exit 1", monkeypatch)
    with pytest.raises(FileError, match=r"ffmpeg could not write .*made\.mp4: no encoder\."):
        Plots(dataset(**KINDS[3])).animation(path=tmp_path / "made.mp4", frames=2)
    assert [one.name for one in tmp_path.iterdir()] == ["bin"]


def test_without_ffmpeg_an_mp4_is_refused_with_the_other_formats(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    with pytest.raises(ArgumentError, match=r"needs the program ffmpeg, .*\.gif or \.html"):
        Plots(dataset(**KINDS[3])).animation(path="made.mp4")


def test_a_film_of_a_package_above_gets_the_runs_and_then_the_file(monkeypatch: pytest.MonkeyPatch) -> None:
    added = SimpleNamespace(draw="there:sketch", film=True, doc="A sketch.")
    monkeypatch.setattr(plots, "ADDED", {"sketch": added})
    monkeypatch.setattr(plots, "import_string", lambda name: lambda runs, path, **more: (name, len(runs), path, more))
    figure = Plots(dataset(**KINDS[3])).sketch
    assert figure(Plots(dataset(**KINDS[3])).dataset, path="a.html", fps=3) == ("there:sketch", 2, "a.html", {"fps": 3})
    assert (figure.__name__, figure.__doc__) == ("sketch", "A sketch.")
    with pytest.raises(ArgumentError, match=r"give its name, as in path='sketch\.html'"):
        figure()


def test_every_run_has_an_animation_that_no_report_draws() -> None:
    run = dataset(**KINDS[3])
    assert "animation" in available(run, films=True) and "animation" not in available(run)
    assert "animation" in figure_names() and "animation" not in figure_names(films=False)
