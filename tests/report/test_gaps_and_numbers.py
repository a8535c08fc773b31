"""Two datasets side by side at their common times, and numbers as text and as JSON."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
import xarray as xr

from coadjoint.errors import ArgumentError
from coadjoint.report.comparison import _common_times, _gap, _spacing, compare
from coadjoint.report.numbers import Sourced, _defaults, _given, shown
from coadjoint.report.page import Contents, page
from coadjoint.report.summary import to_json


def run(times, offset: float = 0.0, **attrs) -> xr.Dataset:
    q = np.stack([np.asarray(times) * 1.0, np.full(len(times), offset)], axis=1)
    held = xr.Dataset({"q": (("time", "axis"), q), "mass": ((), 2.0)}, {"time": np.asarray(times)})
    held.q.attrs["units"] = "m"
    held.attrs.update({"group": "SO3()", "energy_error_max": 0.5, "method": "Midpoint"} | attrs)
    return held


def test_times_are_common_up_to_round_off_and_each_is_met_by_the_nearest():
    first, second = run([0.0, 0.1, 0.2, 0.3, 0.4]), run([0.0, 0.2 + 1e-11, 0.4, 0.6])
    here, there = _common_times(first, second, ("a", "b"))
    assert (here.tolist(), there.tolist()) == ([0, 2, 4], [0, 1, 2])
    here, there = _common_times(second, first, ("a", "b"))
    assert (here.tolist(), there.tolist()) == ([0, 1, 2], [0, 2, 4])
    here, there = _common_times(run([0.0, 0.2, 0.4]), run([0.0, 0.2 + 1e-9, 0.4]), ("a", "b"))
    assert here.tolist() == [0, 2]


def test_runs_with_the_start_alone_in_common_are_not_compared():
    with pytest.raises(
        ArgumentError, match=r"a \(saved every 0.2 s up to 0.4 s\) and b \(every 0.3 s up to 0.3 s\) have 1"
    ):
        _common_times(run([0.0, 0.2, 0.4]), run([0.0, 0.3]), ("a", "b"))
    with pytest.raises(ArgumentError, match=r"b \(every no time up to 0 s\) have 1 saved times in common"):
        _common_times(run([0.0, 0.2, 0.4]), run([0.0]), ("a", "b"))
    assert (_spacing(np.array([0.0])), _spacing(np.array([0.0, 0.5, 1.0, 9.0]))) == ("no time", "0.5 s")


def test_the_gap_is_euclidean_and_of_angles_within_half_a_turn():
    assert _gap("q", np.array([[3.0, 4.0], [1.0, 0.0]]), np.zeros((2, 2))).tolist() == [5.0, 1.0]
    angles = _gap("euler_angles", np.array([[3.1, 0.0, 0.0]]), np.array([[-3.1, 0.0, 0.0]]))
    assert angles == pytest.approx([2 * np.pi - 6.2])


def test_a_comparison_has_the_last_and_the_largest_gap_and_what_either_conserved():
    second = run([0.0, 0.1, 0.2], 0.5, energy_error_max=0.25, balance_max=1e-15, method="Trapezoid")
    second["q"][1] += 1.0
    found = compare(run([0.0, 0.1, 0.2, 0.3]), second)
    assert (found.common, found.last) == (3, 0.2) and found.units == {"q": "m"}
    assert found.final == {"q": pytest.approx(0.5)} and found.largest == {"q": pytest.approx(np.hypot(1.0, 1.5))}
    assert found.conserved == {"energy_error_max": (0.5, 0.25), "balance_max": (None, 1e-15)}
    assert found.setting["method"] == ("Midpoint", "Trapezoid")
    assert found.summary()["difference_max"] == found.largest and found.summary()["last_common_time"] == 0.2


@pytest.mark.parametrize(
    ("second", "sentence"),
    [
        (run([0.0, 0.1], group="SE3()"), r"is on SO3\(\), but .* on SE3\(\)"),
        (run([0.0, 0.1], invariance="right"), r"on SO3\(\), right-invariant: they cannot be compared"),
        (run([0.0, 0.1]).drop_vars("q"), "have no state in common"),
        (run([0.0, 0.1]).isel(axis=slice(1)), r"`q` has shape \(2,\) in .*, but \(1,\) in .*: the runs are not of one"),
        (run([0.0, 0.1]).expand_dims(member=2), "holds an ensemble: choose a member"),
    ],
)
def test_what_is_not_of_one_system_is_not_compared(second, sentence):
    with pytest.raises(ArgumentError, match=sentence):
        compare(run([0.0, 0.1]), second)


def test_values_are_text_with_ten_digits_and_lists_of_it():
    assert [shown(v) for v in (True, None, 1, 0.1 + 0.2, "a")] == ["true", "none", "1", "0.3", "a"]
    assert shown([1.5, (2, False)]) == "[1.5, [2, false]]"
    assert shown(np.array([[1.0, 2.5]])) == "[[1, 2.5]]" and shown(np.float32(0.5)) == "0.5"


def test_what_a_run_file_gives_is_named_by_section_and_key():
    found = list(_given({"run": {"dt": 0.1, "output": {"every": 2}}, "name": "a"}))
    assert [(one.name, one.value) for one in found] == [("run.dt", "0.1"), ("run.output.every", "2"), ("name", "a")]


def test_what_the_catalogue_gives_is_left_out_where_the_file_gives_it():
    everything = {one.name for one in _defaults("heavy_top", {})}
    assert {name.split(".")[0] for name in everything} == {"parameters", "initial"}
    given = next(name.split(".")[1] for name in sorted(everything) if name.startswith("parameters."))
    for key in (given, f"{given}_kg"):
        assert everything - {one.name for one in _defaults("heavy_top", {"parameters": {key: 1.0}})} == {
            f"parameters.{given}"
        }


def test_json_has_plain_numbers_and_null_for_what_is_not_finite():
    given = {"a": np.float64(0.5), "b": np.array([1.0, np.nan]), 3: (np.int64(2), np.inf, True, None), "c": object}
    assert to_json({"unit": "µm"}) == '{\n  "unit": "µm"\n}\n'
    assert json.loads(to_json(given)) == {"a": 0.5, "b": [1.0, None], "3": [2, None, True, None], "c": str(object)}


def test_a_page_shows_numbers_sources_figures_and_files_and_no_section_that_is_empty():
    summary = {"steps": 12, "final": {"q": [1.0, 2.5]}, "versions": {"jax": "1"}, "failure": "It <fell>.", "card": "no"}
    numbers = {"of the body": [Sourced("mass", "2", "kg", "file", ""), Sourced("side", "3", "m", "file", "")]}
    figure = ("path", "a & b", '<?xml?><svg width="200pt" height="1pt"></svg>')
    held = Contents(
        "A & B", "coadjoint run <a>", {}, summary, figures=[figure], numbers=numbers, files=[("a.nc", 12345, "00ff")],
        settings="x = 1", state="Whole.",
    )  # fmt: skip
    text = page(held)
    assert re.findall("<h2>(.*?)</h2>", text) == ["Certificate", "Figures", "Results", *AFTER]
    rows = [tuple(re.findall("<td>(.*?)</td>", row)) for row in re.findall("<tr><td>.*?</tr>", text)]
    assert rows == [
        ("steps", "12"), ("final.q", "[1, 2.5]"), ("mass", "2", "kg", "file"), ("side", "3", "m", "file"),
        ("a.nc", "12,345", "00ff"),
    ]  # fmt: skip
    assert re.findall('<th scope="col">(.*?)</th>', text)[2:6] == ["number", "value", "unit", "source"]
    assert "computed by this run, with jax 1." in text and '<p class="warning">It &lt;fell&gt;.</p>' in text
    assert "max-width:380px" in text and 'aria-label="path: a &amp; b"' in text and "<?xml" not in text
    assert "<pre>coadjoint run &lt;a&gt;</pre><h3>run.toml</h3><pre>x = 1</pre>" in text and "<p>Whole.</p>" in text
    bare = page(Contents("A", "run", {}, {}))
    assert re.findall("<h2>(.*?)</h2>", bare) == ["How to run it again"] and "<table" not in bare and "h3>" not in bare


AFTER = ["Where the numbers are from", "How to run it again"]
