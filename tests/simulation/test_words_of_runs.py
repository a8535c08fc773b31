"""What certificates say of step sizes, and what saved runs say of themselves and of files that hold none."""

from __future__ import annotations

import re
from types import SimpleNamespace
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
import xarray

import coadjoint as co
from coadjoint.errors import ArgumentError, FileError, LagrangianError
from coadjoint.simulation.certificate import fixed_steps, step_sizes
from coadjoint.simulation.certificate_text import _change, _step_sizes_in_words
from coadjoint.simulation.dataset import _coordinates, labelled
from coadjoint.simulation.saved import SavedRun


def varied(fixed: float, steps: int = 1000, bounds: Any = (0.01, 0.25), variable: bool = True) -> Any:
    state = SimpleNamespace(t=2.5, memory=SimpleNamespace(fixed=fixed))
    extrema = {} if bounds is None else {"step_size": bounds}
    return SimpleNamespace(
        method=SimpleNamespace(variable=variable), position=SimpleNamespace(state=state), extrema=extrema,
        good_steps=steps,
    )  # fmt: skip


def test_step_sizes_are_those_between_which_a_run_went_and_how_many_were_fixed():
    assert step_sizes(varied(3.0)) == {
        "time_final": 2.5, "steps_fixed": 3, "step_size_min": 0.01, "step_size_max": 0.25,
    }  # fmt: skip
    assert step_sizes(varied(0.0, variable=False)) == {} and fixed_steps(varied(0.0, variable=False)) == []
    assert _step_sizes_in_words(varied(0.0)) == "0.01 to 0.25 s, to t = 2.5 s; no step fixed"
    assert _step_sizes_in_words(varied(3.0, bounds=None)) == "to t = 2.5 s; 3 of 1,000 steps (0.30%) fixed at dt"
    assert fixed_steps(varied(0.0)) == []
    (sentence,) = fixed_steps(varied(2.0, steps=4))
    assert sentence.startswith("2 of 4 steps (50.00%) fixed at dt: no other h holds the energy there")


def test_a_saved_run_has_its_certificate_and_the_time_of_its_event():
    made = xarray.Dataset(attrs={"system": "top", "card": "steps 4", "event": 1.5})
    found = SavedRun(made)
    assert (str(found), repr(found), found.event) == ("steps 4", "<SavedRun of top>", 1.5)
    bare = SavedRun(xarray.Dataset())
    assert (str(bare), repr(bare), bare.event) == ("a run without a certificate", "<SavedRun of a system>", None)
    with pytest.raises(ArgumentError, match="`events` is not in the file of a run, which holds accuracy, certificate,"):
        _ = found.events
    with pytest.raises(ArgumentError, match="`SavedRun` has no `datset`: did you mean `dataset`"):
        _ = found.datset
    assert not any(hasattr(found, name) for name in ("events", "at", "method", "nothing")) and found.accuracy is None


BODY = co.System(co.SO3(), lambda xi, p: 0.5 * p.m * xi @ xi, parameters={"m": 1.0})
DRIVEN = BODY.with_forces(lambda motion, p: co.Force(motion.inputs.thrust * jnp.ones(3)))


@pytest.fixture(scope="module")
def run():
    return co.simulate(BODY, BODY.state(xi=[1.0, 0, 0]), dt=0.1, steps=3)


def test_a_run_names_what_is_near(run):
    for call, words in (
        (lambda: run.relative_change("enrgy"), "This run has no monitored quantity `enrgy`: did you mean `energy`"),
        (lambda: run.size("nothing"), "This run has no monitored quantity `nothing`: it knows balance, "),
        (lambda: run.largest("balanc"), "did you mean `balance`"),
        (lambda: run.relative_change("balance"), "`balance` is a residual: its largest value is run.largest"),
        (lambda: run.relativ_change, "`Run` has no `relativ_change`: did you mean `relative_change`"),
        (lambda: co.simulate(BODY, run, dt=0.1, steps=3), "`start` must be a state, but is a Run: .* `run.final`"),
        (lambda: co.models.catalogue["heavytop"], "has no entry 'heavytop': did you mean `heavy_top`"),
    ):
        with pytest.raises(ArgumentError, match=words):
            call()
    assert not hasattr(run, "nothing") and "heavytop" not in co.models.catalogue
    assert co.models.catalogue.get("heavytop") is None
    assert re.fullmatch(r"<Accuracy: local error \S+ at most, median \S+, of \d+ steps>", repr(run.accuracy))
    assert repr(run.plot).startswith("<figures: energy, ") and "variable, scene" in repr(run.plot)
    with pytest.raises(AttributeError, match="animation, variable, scene"):
        _ = run.plot.nothing


def test_arguments_without_a_name_or_left_out_are_named():
    for call, words in (
        (lambda: co.simulate(BODY, BODY.state(), steps=3), "co.simulate needs `dt`: give dt=…"),
        (lambda: co.simulate(BODY, dt=0.1), "co.simulate needs `start`: give start=…"),
        (
            lambda: BODY.state([1.0, 0, 0]),
            r"takes its arguments by name, as in g=…, but was given \[1.0, 0, 0\] without",
        ),
        (
            lambda: co.simulate(BODY, BODY.state(), 0.1),
            "arguments after system, start by name, as in dt=…, but was given 0",
        ),
        (lambda: co.attitude.zyx(1, 2), "co.attitude.zyx needs `roll`: give roll=…"),
        (lambda: co.Parameters([1, 2]), r"Parameters have names: write co.Parameters\(name=\[1, 2\]\)"),
        (lambda: co.simulate(BODY, BODY.state(), dt="0.1", steps=3), "`dt` must be a positive number, but is '0.1'"),
        (lambda: co.Suzuki4(co.Midpoint), r"Suzuki4 needs a method, but got a class: write Midpoint\(\)"),
    ):
        with pytest.raises(ArgumentError, match=words):
            call()  # type: ignore[no-untyped-call]


def test_a_function_of_the_time_is_no_function_of_the_motion():
    with pytest.raises(LagrangianError, match="is given the motion at a node, not the time: read motion"):
        co.simulate(DRIVEN, BODY.state(), dt=0.1, steps=3, inputs=lambda t: {"thrust": jnp.sin(t)})


def test_what_holds_no_run_is_named_by_its_kind(tmp_path):
    file = tmp_path / "run.nc"
    with pytest.raises(FileError, match=r"There is no file .*run.nc"):
        co.load(file)
    with pytest.raises(ArgumentError, match=r"`system` must be a co.System, but is 3"):
        co.load(file, 3)  # type: ignore[arg-type]
    file.write_bytes(b"PK\x03\x04 and more")
    with pytest.raises(FileError, match=r"is not a netCDF file of a run, .*: co.load_stepper loads what stepper.save"):
        co.load(file)


def test_vectors_of_a_chain_are_labelled_by_link_and_angles_by_name():
    chain, rows = co.Power(co.SO3(), 2), np.arange(18.0).reshape(3, 6)
    dims, values = _coordinates(chain, rows)
    assert dims == ("time", "link", "algebra") and values[1].tolist() == [[6, 7, 8], [9, 10, 11]]
    assert _coordinates(co.SE3(), rows) == (("time", "algebra"), rows)
    made = labelled({"e": (("time", "angle"), np.zeros((2, 3)), {"units": "rad"})}, set(), {})
    assert made["angle"].values.tolist() == ["yaw", "pitch", "roll"] and made["e"].attrs == {"units": "rad"}


@pytest.mark.parametrize(("size", "kind"), [(3.0, "relative"), (0.5, "relative"), (0.0, "absolute")])
def test_a_change_is_absolute_only_where_a_quantity_has_no_size(size, kind):
    run: Any = SimpleNamespace(ends={"energy": (np.array([0.25]), np.array([0.25]))}, sizes=lambda name: size)
    text = _change(run, {"energy_error_max": 1e-3, "energy_error_final": 2e-4}, "energy")
    assert text.startswith(f"0.25; largest {kind} change 1.00e-03, at the end 2.00e-04")
    assert text.endswith("of the largest kinetic energy") == (size > 0.25)
