"""What a controller returns: commands and, of one that remembers, a memory with the names that it began with."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from coadjoint.errors import ArgumentError
from coadjoint.spaces.named import Named
from coadjoint_vehicles.controllers import FunctionController
from coadjoint_vehicles.model.controller import Feedback
from coadjoint_vehicles.model.controller_mistakes import steer
from coadjoint_vehicles.model.function_controller import _FAILED, _row, _split

AT_REST = Feedback(**{name: jnp.zeros(()) for name in Feedback._fields})
VEHICLE = SimpleNamespace(commanded=())


def told(returned: Any, **remembers: float) -> Any:
    """What a controller says that returns this."""

    def law(feedback, memory, p):
        return returned

    return steer(FunctionController(function=law, remembers=remembers), AT_REST, remembers, {}, cast(Any, VEHICLE))


def test_a_controller_that_remembers_returns_commands_and_its_memory():
    assert told(({"rudder": 0.1}, {"sum": 2.0}), sum=0.0) == ({"rudder": 0.1}, {"sum": 2.0})
    assert told(({"rudder": 0.1}, Named(sum=2.0)), sum=0.0) == ({"rudder": 0.1}, {"sum": 2.0})


@pytest.mark.parametrize(
    ("returned", "sentence"),
    [
        ({"rudder": 0.1}, r"must return \(commands, memory\), but returned dict"),
        (({"rudder": 0.1}, {"sum": 2.0}, 3), r"must return \(commands, memory\), but returned tuple"),
        (({"rudder": 0.1}, 2.0), "must return its memory as a dictionary, but returned 2.0"),
        (({"rudder": 0.1}, {}), "did not return `sum` in its memory, but begins with sum"),
        (({"rudder": 0.1}, {"sum": 1.0, "t": 1.0}), "returned `t` in its memory, but begins with sum"),
    ],
)
def test_another_return_raises_a_sentence_that_says_what_is_wrong(returned, sentence):
    with pytest.raises(ArgumentError, match=sentence):
        told(returned, sum=0.0)


def test_a_controller_without_memory_returns_commands_alone():
    law = FunctionController(function=lambda feedback, p: {"rudder": 0.2})
    assert steer(law, AT_REST, {}, {}, cast(Any, VEHICLE)) == ({"rudder": 0.2}, {})


def test_an_error_inside_a_controller_names_it():
    def law(feedback, p):
        raise ZeroDivisionError("division by zero")

    with pytest.raises(ArgumentError, match=r"The controller `law` .*ZeroDivisionError: division by zero"):
        steer(FunctionController(function=law), AT_REST, {}, {}, cast(Any, VEHICLE))


def test_a_failure_is_told_in_the_step_in_which_it_was_and_no_other():
    def law(feedback, p):
        return {"rudder": 0.0}

    controller = FunctionController(function=law)
    assert controller.failure(1.0, 0.1) is None
    _FAILED["The controller `law`"] = (1.0, "It failed.")
    try:
        assert [controller.failure(1.0 + k * 0.1, 0.1) for k in (-2, -1, 0, 1, 2)] == [None, *["It failed."] * 3, None]
        assert controller.failure(1.1, -0.1) == "It failed."
    finally:
        del _FAILED["The controller `law`"]


def test_numbers_from_outside_have_the_names_and_shapes_of_a_craft_at_rest_or_are_nan_with_the_reason():
    example = {"a": np.zeros(2), "b": np.zeros(())}
    leaves, structure = jax.tree.flatten(example)
    expected = structure, [leaf.shape for leaf in leaves], 3
    given = (SimpleNamespace(t=0.5),)
    cases = {
        "": {"b": 3.0, "a": [1.0, 2.0]},
        "returned other names or shapes": {"b": 3.0, "a": [1.0, 2.0, 3.0]},
        "returned other names": {"b": 3.0},
        "returned numbers that are not finite": {"b": np.inf, "a": [1.0, 2.0]},
        "failed: TypeError": {"b": object(), "a": [1.0, 2.0]},
    }
    for said, returned in cases.items():
        _FAILED.pop("law", None)
        row = _row(lambda _, returned=returned: returned, given, "law", expected)
        if not said:
            assert row.tolist() == [1.0, 2.0, 3.0] and "law" not in _FAILED
            continue
        assert np.all(np.isnan(row)) and len(row) == 3
        when, sentence = _FAILED.pop("law")
        assert when == 0.5 and f"law {said}" in sentence


def test_a_row_of_numbers_falls_into_arrays_of_their_shapes():
    first, second, third = _split(np.arange(7.0), [(2, 2), (), (2,)])
    assert first.tolist() == [[0.0, 1.0], [2.0, 3.0]] and second == 4.0 and third.tolist() == [5.0, 6.0]
