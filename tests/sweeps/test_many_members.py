"""Of many members a figure shows a random choice, and says so; the command's table shows all digits."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import xarray

from coadjoint.cli import terminal
from coadjoint.plotting.decimation import some
from coadjoint.simulation.accuracy.resolution import chosen_members
from coadjoint.sweeps import figures
from coadjoint.sweeps.figures import columns, failure_map, parallel, responses


class Grid:
    """A sweep of 4 headings and 500 masses, as `SweepResults`; every k-th member has one heading."""

    def __init__(self, failed: int = 0):
        mass, heading = (
            axis.ravel() for axis in np.meshgrid(np.linspace(13, 14, 500), [0.0, 90, 180, 270], indexing="ij")
        )
        code = np.zeros(len(mass), int)
        code[np.arange(failed) * 4] = 2
        q = np.where(code == 0, mass + heading, np.nan)
        numbers = {"parameters.mass": mass, "initial.heading_deg": heading}
        coordinates = {name: ("member", values, {"swept": 1}) for name, values in numbers.items()}
        held = {"code": ("member", code), "final_q": ("member", q, {"units": "m"})}
        self.dataset = xarray.Dataset(held, coords=coordinates)


@pytest.fixture(autouse=True)
def few(monkeypatch):
    monkeypatch.setattr(figures, "MOST_LINES", 500)
    monkeypatch.setattr(figures, "MOST_POINTS", 500)


def test_members_of_a_grid_are_chosen_among_all_its_values():
    numbers, _ = columns(Grid())  # pyright: ignore[reportArgumentType]
    heading, mass = numbers["initial.heading_deg"], numbers["parameters.mass"]
    assert len(heading) == 500 and np.unique(heading).tolist() == [0, 90, 180, 270]
    assert np.mean(mass) == pytest.approx(13.5, abs=0.05) and np.unique(mass).size > 250
    assert np.array_equal(some(2000, 500), some(2000, 500)) and some(3, 5).tolist() == [0, 1, 2]


def test_figures_say_how_many_members_they_show_of_how_many():
    told = {
        parallel: "500 of 1,990 members that did not fail, chosen at random; "
        "10 of 2,000 members failed and are not shown",
        responses: "500 of 2,000 members, chosen at random",
        failure_map: "490 of 1,990 members that did not fail, chosen at random",
    }
    for draw, words in told.items():
        figure = draw(Grid(failed=10))  # pyright: ignore[reportArgumentType]
        assert figure.get_suptitle() == words
    points = responses(Grid(), "final_q").axes[0].collections[0].get_offsets()  # pyright: ignore[reportArgumentType]
    assert min(len({*column.tolist()}) for column in np.asarray(points).T) == 4


def test_few_failures_among_many_members_are_all_marked():
    figure = failure_map(Grid(failed=10))  # pyright: ignore[reportArgumentType]
    assert len(figure.axes[0].lines[1].get_xdata()) == 10


def test_members_that_are_judged_are_no_stride_through_a_grid():
    run = SimpleNamespace(members=4000)
    found = chosen_members(run)  # pyright: ignore[reportArgumentType]
    assert found[0] == 0 and found[-1] == 3999 and len({*np.diff(found).tolist()}) > 3


@pytest.mark.parametrize("width", ["30", "80", "200"])
def test_a_table_wraps_names_and_never_shortens_numbers(width, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", width)
    monkeypatch.setattr("sys.stdout.isatty", lambda: True, raising=False)
    numbers = ["-7.392e-05", "1.235e-123", "nan", "41.88", "-1.5e+100", "3", "0.002259"]
    terminal.table(("result", *"abcdefg"), [("final_euler_angles[pitch] (rad)", *numbers), ("count", *"1234567")])
    told = capsys.readouterr().out
    assert all(number in told for number in numbers) and "…" not in told
    assert "final_euler_angl" in told


def test_the_statistics_of_a_sweep_have_units(capsys):
    from coadjoint.cli.sweeping import _rows

    values = xarray.DataArray(np.ones((1, 2)), dims=("statistic", "x"), name="final_q", attrs={"units": "m"})
    assert [row[0] for row in _rows(values)] == ["final_q[0] (m)", "final_q[1] (m)"]
