"""Figures of sweeps."""

from __future__ import annotations

import numpy as np
import pytest
import xarray

import coadjoint as co
from coadjoint.sweeps.figures import columns, failure_map, parallel, responses


class Made:
    """A sweep of two numbers, as `SweepResults`, without a run."""

    def __init__(self, members: int = 400, failed: int = 20):
        random = np.random.default_rng(4)
        mass, depth = random.uniform(4, 6, members), random.uniform(0, 1, members)
        code = np.zeros(members, int)
        code[:failed] = 2
        q = np.stack([mass**2, 0 * mass, depth], axis=1)
        q[:failed] = np.nan
        numbers = {"parameters.mass": mass, "initial.position_m[2]": depth}
        coordinates = {name: ("member", values, {"swept": 1}) for name, values in numbers.items()}
        held = {"code": ("member", code), "final_q": (("member", "additional"), q, {"units": "m"})}
        self.dataset = xarray.Dataset(held, coords=coordinates)


def test_all_members_that_did_not_fail_are_lines_through_what_varies():
    figure = parallel(Made())  # pyright: ignore[reportArgumentType]
    (lines,) = figure.axes[0].collections
    assert len(lines.get_segments()) == 380
    (axes, _) = figure.axes
    assert axes.get_xlim() == pytest.approx((-0.3, 3.3)) and axes.get_ylim() == pytest.approx((-0.1, 1.1))
    labels = [label.get_text() for label in figure.axes[0].get_xticklabels()]
    assert labels[:3] == ["mass", "position_m[2]", "final_q[0] (m)"]


def test_a_response_surface_has_the_means_of_its_cells():
    made = Made(4000)
    figure = responses(made, "final_q[0]")  # pyright: ignore[reportArgumentType]
    (cells,) = figure.axes[0].collections
    values = np.asarray(cells.get_array())
    assert figure.axes[0].get_xlabel() == "mass"
    middle = np.linspace(4, 6, values.shape[1] + 1)
    np.testing.assert_allclose(np.nanmean(values, axis=0), ((middle[1:] + middle[:-1]) / 2) ** 2, rtol=0.05)


def test_the_result_that_varies_with_the_numbers_is_chosen():
    numbers, results = columns(Made())  # pyright: ignore[reportArgumentType]
    assert list(numbers) == ["parameters.mass", "initial.position_m[2]"] and len(results) == 3
    assert responses(Made()).axes[-1].get_ylabel() == "final_q[2] (m)"  # pyright: ignore[reportArgumentType]


def test_failures_are_marked_by_cause():
    figure = failure_map(Made())  # pyright: ignore[reportArgumentType]
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["good", "not finite"]
    assert len(figure.axes[0].lines[1].get_xdata()) == 20


def test_a_result_that_there_is_not_is_told():
    with pytest.raises(co.errors.ArgumentError, match="did you mean"):
        responses(Made(), "final_q[7]")  # pyright: ignore[reportArgumentType]


def test_scattered_members_are_points_and_axes_end_where_the_sweep_does():
    made = Made(40, 2)
    figure = responses(made, "final_q[0]")  # pyright: ignore[reportArgumentType]
    (points,) = figure.axes[0].collections
    assert len(points.get_offsets()) == 38
    mass = made.dataset["parameters.mass"].values
    assert figure.axes[0].get_xlim() == (mass.min(), mass.max())


def test_a_number_that_only_failed_members_vary_leaves_a_curve_of_the_other():
    made = Made(40, 2)
    depth = np.full(40, 0.5)
    depth[:2] = [0.1, 0.9]
    made.dataset["initial.position_m[2]"] = ("member", depth, {"swept": 1})
    figure = responses(made, "final_q[0]")  # pyright: ignore[reportArgumentType]
    assert len(figure.axes) == 1 and len(figure.axes[0].lines[0].get_xdata()) == 38


def test_parallel_lines_tell_how_many_members_failed_and_have_constants_in_the_middle():
    made = Made(40, 2)
    made.dataset["parameters.mass"] = ("member", np.full(40, 5.0), {"swept": 1})
    figure = parallel(made)  # pyright: ignore[reportArgumentType]
    assert figure.get_suptitle() == "2 of 40 members failed and are not shown"
    (lines,) = figure.axes[0].collections
    assert {float(row[0, 1]) for row in lines.get_segments()} == {0.5}
