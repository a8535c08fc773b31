"""Outputs of a run: cadences in steps and seconds; records, monitors and functions; memory, folders and calls."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.methods.renewal import ALL_HELD
from coadjoint.simulation.dense import holding

BODY = co.System(co.SO3(), lambda xi, p: 0.5 * xi @ (p.inertia * xi), parameters={"inertia": [1.0, 2.0, 3.0]})
START = BODY.state(xi=[0.3, -0.2, 2.0])
RUN: dict[str, Any] = {"dt": 0.05, "steps": 23, "accuracy": False, "progress": False}


@dataclass(frozen=True)
class Constants:
    renewal: Any


@dataclass(frozen=True)
class Plan:
    constants: Constants


def test_steps_that_hold_what_a_state_holds_renew_neither_inputs_nor_internal_state():
    for given, held in (("renewed", ALL_HELD), (None, None)):
        assert holding(Plan(Constants(given))).constants.renewal is held  # type: ignore[arg-type]


def spin(state: co.State) -> Any:
    return state.xi[2]


@pytest.fixture(scope="module")
def full() -> co.simulation.Run:
    return co.simulate(BODY, START, **RUN)


def test_records_monitors_and_functions_come_at_their_own_cadences(full: Any) -> None:
    orders = [
        co.Output(every=4),
        co.Output(every=0.15, what="energy"),
        co.Output(every=7, what=["energy", "kelvin_noether"]),
        co.Output(every=5, what=spin),
        co.Output(every=10, what=lambda state: {"spin": state.xi, "twice": 2.0 * state.t}),
    ]
    run = co.simulate(BODY, START, **RUN, save_every=23, outputs=orders)
    records, energy, both, value, two = run.outputs
    assert all(
        list(one.step.values) == [*range(0, 23, k), 23] for one, k in zip(run.outputs, (4, 3, 7, 5, 10), strict=True)
    )
    every = full.dataset
    for found, names in (
        (records, ("g", "mu", "energy", "xi", "xi_step")),
        (energy, ("energy",)),
        (both, ("energy", "kelvin_noether")),
    ):
        for name in names:
            name = next(one for one in (name, "R") if one in found)
            np.testing.assert_array_equal(found[name].values, every[name].values[found.step.values])
    np.testing.assert_allclose(value.value, every.xi[value.step.values, 2], rtol=1e-14)
    np.testing.assert_allclose(two.spin, every.xi[two.step.values], rtol=1e-14)
    np.testing.assert_allclose(two.twice, 2 * two.time, rtol=1e-14)
    assert list(run.dataset.step.values) == [0, 23] and "energy" in str(records.attrs["card"])


@pytest.mark.parametrize("events", [None, {"turn": lambda state: state.mu[0] - 0.35}])
def test_a_function_is_called_with_each_node_and_ends_the_run(full: Any, events: Any) -> None:
    seen: list[tuple[float, float]] = []

    def look(time: float, value: Any) -> bool:
        seen.append((time, float(value)))
        return time > 0.55

    run = co.simulate(BODY, START, **RUN, save_every=2, events=events, outputs=[co.Output(every=3, what=spin, to=look)])
    assert run.outputs == (None,) and run.good_steps == 12 and run.event is None
    np.testing.assert_allclose(seen, [(0.05 * k, full.dataset.xi.values[k, 2]) for k in range(0, 13, 3)], rtol=1e-13)
    assert list(run.steps_saved) == [0, 2, 4, 6, 8, 10, 12]
    np.testing.assert_array_equal(run.records.mu, full.records.mu[run.steps_saved])
    assert "12 steps of 0.05 s, stopped before 23" in str(run)
    if events:
        assert len(run.events["turn"].t) > 0 and np.all(run.events["turn"].t <= 0.6)


def test_a_function_that_only_looks_sees_all_nodes_once_and_the_state_at_them(full: Any) -> None:
    seen: list[co.State] = []
    co.simulate(BODY, START, **RUN, save_every=5, outputs=[co.Output(every=4, to=lambda t, s: seen.append(s))])
    assert [round(float(state.t) / 0.05) for state in seen] == [0, 4, 8, 12, 16, 20, 23]
    np.testing.assert_array_equal([state.xi for state in seen], full.dataset.xi.values[[0, 4, 8, 12, 16, 20, 23]])


def test_the_first_node_may_end_a_run_too() -> None:
    run = co.simulate(BODY, START, **RUN, outputs=[co.Output(to=lambda time, state: True)])
    assert run.good_steps == 0 and list(run.steps_saved) == [0]


def test_members_come_with_a_first_axis_and_end_together() -> None:
    starts = BODY.state(xi=co.each([[0.3, -0.2, 2.0], [0.1, 0.0, 1.0]]))
    seen: list[Any] = []

    def look(time: float, value: Any) -> bool:
        seen.append(value)
        return len(seen) == 3

    orders = [co.Output(every=5, what=spin), co.Output(every=5), co.Output(every=2, what=spin, to=look)]
    fleet = co.simulate(BODY, starts, **RUN, outputs=orders)
    assert fleet.position.steps == 4 and np.shape(seen) == (3, 2)
    assert list(fleet.outputs[0].step.values) == [0, 4] and fleet.outputs[0].value.dims == ("member", "time")
    np.testing.assert_allclose(fleet.outputs[0].value, fleet.outputs[1].xi[:, :, 2], rtol=1e-14)
    np.testing.assert_array_equal(fleet.outputs[1].mu, fleet.dataset.mu[:, [0, 4]])


def test_a_folder_of_an_output_is_that_of_a_run(full: Any, tmp_path: Any) -> None:
    run = co.simulate(BODY, START, **RUN, save_every=23, outputs=[co.Output(every=6, to=tmp_path / "fine")])
    found = co.load(tmp_path / "fine").dataset
    assert list(found.step.values) == [0, 6, 12, 18, 23]
    np.testing.assert_array_equal(found.mu, full.dataset.mu[found.step.values])
    np.testing.assert_array_equal(run.outputs[0].energy, found.energy)
    with pytest.raises(co.errors.ArgumentError, match="exists already: choose another one"):
        co.simulate(BODY, START, **RUN, outputs=[co.Output(every=6, to=tmp_path / "fine")])


@pytest.mark.parametrize(
    ("order", "words"),
    [
        ({"every": 0}, "Argument `every` must be"),
        ({"every": 0.12}, "`every` of an output must be a multiple of dt, but 0.12 s is 2.4 steps"),
        ({"what": 3}, "Argument `what` must"),
        ({"what": "enregy"}, "`enregy`.*`energy`"),
        ({"to": 3}, "Argument `to` must be None for memory"),
        ({"what": spin, "to": "folder"}, "An output to a folder holds records"),
        ({"what": lambda state: state.depth}, "of an output"),
    ],
)
def test_a_wrong_output_is_refused(order: Any, words: str) -> None:
    with pytest.raises(co.errors.CoadjointError, match=words):
        co.simulate(BODY, START, **RUN, outputs=[co.Output(**order)])


def test_what_is_no_list_of_outputs_is_refused() -> None:
    with pytest.raises(co.errors.ArgumentError, match=r"`outputs` must be a list of co\.Output"):
        co.simulate(BODY, START, **RUN, outputs=[jnp.sin])  # type: ignore[list-item]
