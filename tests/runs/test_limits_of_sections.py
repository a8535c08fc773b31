"""Sections of run files and arguments of runs at their limits, units in keys, and changes by --set."""

from __future__ import annotations

import tomllib
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import coadjoint as co
from coadjoint import checks
from coadjoint import units as u
from coadjoint.checks import unknown
from coadjoint.errors import ArgumentError
from coadjoint.runs import run_file
from coadjoint.runs.members import _arrays
from coadjoint.runs.sections import MethodSection, OutputSection, RunSection, SystemSection
from coadjoint.runs.toml_text import to_toml
from coadjoint.sections import in_si, read
from coadjoint.simulation import arguments

INF = float("inf")


def refused(sentence: str, call: Any, *given: Any, **more: Any) -> None:
    with pytest.raises(ArgumentError, match=sentence):
        call(*given, **more)


# Arguments.


@pytest.mark.parametrize("value", [1, np.int64(7), 2**53])
def test_a_whole_number_of_at_least_1_is_kept(value):
    assert checks.whole(value, "steps") == value and type(checks.whole(value, "steps")) is int


@pytest.mark.parametrize("value", [0, -1, 1.0, True, "1", None, np.timedelta64(3)])
def test_another_number_of_steps_is_refused(value):
    refused("`steps` must be a whole number from 1", checks.whole, value, "steps")


def test_more_steps_than_numbers_tell_apart_are_refused():
    refused("`steps` must be at most 2⁵³", checks.whole, 2**53 + 1, "steps")
    refused("`duration` must be at most 2⁵³ steps", arguments.grid, 0.5, 2.0**53, None)
    assert arguments.grid(0.5, 2.0**52, None) == (0.5, 2**53)


@pytest.mark.cases(6)
@pytest.mark.parametrize("value", [0, -0.1, INF, np.nan, True, "1", None])
def test_a_step_is_positive_and_finite(value):
    refused("`dt` must be (a )?positive( number)?, but is", arguments.grid, value, 1.0, None)


def test_a_duration_is_a_whole_number_of_steps_up_to_round_off():
    assert arguments.grid(0.1, 0.3, None) == (0.1, 3) and arguments.grid(np.float64(0.5), None, 4) == (0.5, 4)
    assert arguments.grid(0.1, 100 * (1 + 5e-10), None) == (0.1, 1000)
    refused("is 1000.000002 steps of 0.1 s; give duration=100", arguments.grid, 0.1, 100 * (1 + 2e-9), None)
    refused("0.35 s is 3.5 steps of 0.1 s; give duration=0.[34]", arguments.grid, 0.1, 0.35, None)
    refused("0.04 s is 0.4 steps of 0.1 s; give duration=0.1", arguments.grid, 0.1, 0.04, None)
    for given in ((None, None), (1.0, 10)):
        refused("Give either `duration` or `steps`", arguments.grid, 0.1, *given)


def test_a_step_of_a_trajectory_may_go_back_but_not_stand():
    assert arguments.step_size(-0.1) == -0.1
    refused("`dt` must not be zero", arguments.step_size, 0.0)
    refused(r"`dt` must be one number, but has shape \(1,\)", arguments.step_size, [0.1])


def test_true_and_false_are_no_numbers():
    assert checks.truth(np.True_, "monitors") is True and checks.truth(False, "monitors") is False
    for wrong in (1, 0, "yes", None):
        refused("`monitors` must be True or False", checks.truth, wrong, "monitors")


def test_what_is_no_system_no_start_or_no_method_is_named():
    system, other = (co.System(group, lambda xi: 0.5 * xi @ xi) for group in (co.SO3(), co.SO2()))
    start = system.state(xi=[0.1, 0.2, 0.3])
    arguments.require_kinds(system, start, co.Midpoint())
    refused("`system` must be a co.System, but is 3", arguments.require_kinds, 3, start, co.Midpoint())
    refused("`start` must be a state, system.state", arguments.require_kinds, system, 3, co.Midpoint())
    refused("another group or other spaces", arguments.require_kinds, other, start, co.Midpoint())
    refused("`method` must be a method", arguments.require_kinds, system, start, co.Midpoint)


# Sections.


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({}, "needs `dt`"),
        ({"dt": 0.0, "steps": 1}, "dt must be positive, but is 0"),
        ({"dt": INF, "steps": 1}, "dt must be positive, but is inf"),
        ({"dt": 0.1}, "needs `duration` in s, or `steps`"),
        ({"dt": 0.1, "duration": 1.0, "steps": 10}, "gives both"),
        ({"dt": 0.1, "steps": 0}, "steps must be a whole number from 1, but is 0"),
        ({"dt": 0.1, "steps": 1, "save_every": 0}, "save_every must be a whole number from 1, but is 0"),
        ({"dt": 0.1, "duration": 0.0}, "duration must be positive, but is 0"),
        ({"dt": 0.1, "duration": INF}, "duration must be positive, but is inf"),
        ({"dt": 0.1, "duration": 0.35}, r"0.35 s is 3.5 steps of 0.1 s; write 0.[34]"),
        ({"dt": 0.1, "duration": 0.04}, r"0.04 s is 0.4 steps of 0.1 s; write 0.1"),
    ],
)
def test_another_grid_is_refused(given, sentence):
    refused(sentence, read, RunSection, "run", given)


def test_a_grid_at_its_limits_is_kept():
    assert RunSection(dt=0.1, duration=0.3).duration == 0.3 and RunSection(dt=1e-300, steps=1, save_every=1).steps == 1


@pytest.mark.parametrize(
    ("kind", "given", "sentence"),
    [
        (SystemSection, {}, "needs either `model`"),
        (SystemSection, {"model": "a", "factory": "a.py:b"}, "needs either `model`"),
        (SystemSection, {"factory": "a.py"}, 'must be "file.py:function"'),
        (SystemSection, {"factory": "a.py:b:c"}, 'must be "file.py:function"'),
        (SystemSection, {"factory": ":b"}, 'must be "file.py:function"'),
        (SystemSection, {"factory": "a.py:"}, 'must be "file.py:function"'),
        (MethodSection, {"start": "rest"}, 'start must be "momentum" or "velocity"'),
        (MethodSection, {"negative_substeps": "no"}, 'must be "refuse" or "allow"'),
        (OutputSection, {"folder": "a/../../b"}, "must lie in the working directory"),
        (OutputSection, {"figures": ["energy", "portrait", "other"]}, "has no figure `portrait`"),
        (OutputSection, {"format": "jpg"}, 'must be "png", "pdf" or "svg"'),
    ],
)
def test_another_section_is_refused(kind, given, sentence):
    refused(sentence, read, kind, "section", given)


def test_results_of_a_file_lie_in_the_working_directory(tmp_path):
    refused("must lie in the working directory", read, OutputSection, "output", {"folder": str(tmp_path / "a")})


def test_values_have_the_types_of_their_fields():
    made = read(MethodSection, "method", {"degree": 3.0, "coefficients": [1, 0.5], "within": [0.1, 2]})
    assert (made.degree, made.coefficients, made.within) == (3, (1.0, 0.5), (0.1, 2.0)) and type(made.degree) is int
    assert read(RunSection, "run", {"dt_ms": 100, "duration_min": 1}) == RunSection(dt=0.1, duration=60.0)
    for given, words in (
        ({"degree": 2.5}, "degree must be a whole number, but is 2.5"),
        ({"degree": True}, "degree must be a whole number, but is True"),
        ({"name": 3}, "name must be a text, but is 3"),
        ({"coefficients": [1, "a"]}, "coefficients must be a list of numbers"),
        ({"coefficients": 1.0}, "coefficients must be a list of numbers"),
    ):
        refused(words, read, MethodSection, "method", given)
    refused("figures must be true or false or a list of texts", read, OutputSection, "output", {"figures": [1]})
    refused("dt must be a number, but is True", read, RunSection, "run", {"dt": True, "steps": 1})
    refused("must be a section of a file", read, RunSection, "run", 3)


# Units and changes.


def test_keys_end_in_units_of_what_they_measure():
    known, kinds = ["dt", "depth", "steps"], {"dt": u.TIME, "depth": u.LENGTH, "steps": None}
    assert in_si("run", {"dt_ms": 250, "depth_ft": [10, [20]]}, known, kinds) == {
        "dt": 0.25,
        "depth": [pytest.approx(3.048), [pytest.approx(6.096)]],
    }
    refused("gives `dt` twice: once as `dt_ms`", in_si, "run", {"dt": 1, "dt_ms": 2}, known, kinds)
    refused("ends in a unit of .* but `dt` measures", in_si, "run", {"dt_m": 1}, known, kinds)
    refused("but `steps` measures what is in SI units only", in_si, "run", {"steps_ms": 1}, known, kinds)
    refused("Section .run. has no key `dpth`: did you mean `depth`", in_si, "run", {"dpth": 1}, known, kinds)
    refused(r"\[run\] dt_ms", in_si, "run", {"dt_ms": "a"}, known, kinds)


def test_a_name_that_is_not_known_has_the_nearest_one_beside_it():
    assert unknown("key `a`", "Section [b]", "a", []) == "Section [b] has no key `a`: it has none."
    assert unknown("part `ruder`", "It", "ruder", ["rudder", "fin"]).endswith(
        "did you mean `rudder`? It knows fin, rudder."
    )
    assert unknown("part `x`", "It", "x", ["rudder", "fin"]) == "It has no part `x`: it knows fin, rudder."


def test_a_change_replaces_a_key_in_whatever_unit_and_leaves_it_out_without_a_value():
    def changed(*changes: str) -> dict[str, Any]:
        table: dict[str, Any] = {"run": {"dt_ms": 100.0, "steps": 3}, "method": {"name": "Midpoint"}}
        for change in changes:
            run_file._apply(table, change)
        return table

    assert changed("run.dt=0.02")["run"] == {"steps": 3, "dt": 0.02}
    assert changed("run.steps=")["run"] == {"dt_ms": 100.0} and "method" not in changed("method=")
    assert changed("method.name=Galerkin")["method"] == {"name": "Galerkin"}
    assert changed("a.b.c=[1, 2]")["a"] == {"b": {"c": [1, 2]}} and changed("axes=NED/FRD")["axes"] == "NED/FRD"
    for wrong in ("run.dt", "dt=1", ".dt=1", "run.=1", "=1"):
        refused("must be section.key=value", changed, wrong)
    refused("but `name` of 'method.name.a=1' is none", changed, "method.name.a=1")


def test_a_table_is_the_one_that_its_text_is_read_as():
    table = {
        "name": 'a "b" \\ é', "yes": True, "no": False, "n": 3, "x": 1e-7, "list": [1, [2.5, "a"]],
        "run": {"dt": 0.1, "a b": {"c": 1, "d e": False}}, "with-dash_1": {"ü": 1},
    }  # fmt: skip
    assert tomllib.loads(to_toml(table)) == table and to_toml({}) == "\n"


@pytest.mark.parametrize(("asked", "drawn"), [(True, None), (["energy"], ["energy"]), (False, "none")])
def test_the_figures_of_a_run_are_those_that_its_file_names_or_all(monkeypatch, asked, drawn):
    names: list[object] = ["none"]

    def save(datasets, folder, chosen, form):
        names[:] = [chosen]
        return ["energy.png"]

    monkeypatch.setattr("coadjoint.plotting.plots.save_figures", save)
    file = SimpleNamespace(output=SimpleNamespace(figures=asked, format="png"))
    found = run_file.RunFile.results(file, Path("out"), SimpleNamespace(dataset=None))  # type: ignore[arg-type]
    assert found == ({}, [] if drawn == "none" else ["energy.png"]) and names == [drawn]


def test_arguments_of_a_start_become_arrays_by_element_and_by_name():
    found = _arrays({"a": [1, 2], "b": ([1.0, 2.0], 3.0), "c": None, "d": (1.0, 2.0)})
    assert found["a"].tolist() == [1.0, 2.0] and found["c"] is None and found["d"].shape == (2,)
    assert isinstance(found["b"], tuple) and found["b"][0].shape == (2,) and found["b"][1].shape == ()


@pytest.mark.parametrize(("given", "count"), [({"duration": 1.0}, 10), ({"steps": 7}, 7)])
def test_a_run_has_the_steps_of_its_duration(given, count):
    assert RunSection(dt=0.1, **given).count == count
