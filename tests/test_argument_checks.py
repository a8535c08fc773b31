"""Checks of arguments: what passes has its final type, and what does not is one sentence with the argument's name."""

from __future__ import annotations

import math
import re
from fractions import Fraction

import numpy as np
import pytest

from coadjoint import checks
from coadjoint.errors import ArgumentError, FileError, GroupError
from coadjoint.runs.sections import RunSection
from coadjoint.simulation.arguments import grid
from imports import files


def refused(sentence, call, *given, **more):
    with pytest.raises(more.get("error", ArgumentError)) as caught:
        call(*given, **more)
    assert str(caught.value) == sentence


@pytest.mark.parametrize("value", [3, np.int64(3), np.uint8(3)])
def test_whole_numbers_become_ints(value):
    assert checks.whole(value, "n") == 3 and type(checks.whole(value, "n")) is int


def test_truth_values_durations_texts_and_fractions_are_no_whole_numbers():
    for wrong in (True, np.True_, 3.0, "3", None, np.timedelta64(3), Fraction(3), 0, -1):
        with pytest.raises(ArgumentError, match="Argument `n` must be a whole number from 1, but is"):
            checks.whole(wrong, "n")
    refused("Argument `n` must be a whole number from 2 to 4, but is 5.", checks.whole, 5, "n", 2, 4)
    refused(f"Argument `n` must be at most 2⁵³ = {2**53}, but is {2**53 + 1}.", checks.whole, 2**53 + 1, "n")


def test_numbers_become_floats_within_their_bounds():
    for value in (0.5, np.float64(0.5), Fraction(1, 2)):
        assert type(checks.number(value, "x")) is float and checks.number(value, "x", 0.5, 0.5) == 0.5
    for wrong in (True, "1", None, math.nan, math.inf, 10**400, [1.0], np.array(1.0)):
        with pytest.raises(ArgumentError, match="Argument `x` must be a finite number, but is"):
            checks.number(wrong, "x")
    with pytest.raises(ArgumentError, match="Argument `x` must be float64, but is float32"):
        checks.positive(np.float32(0.5), "x")
    refused("Argument `x` must be positive, but is 0.", checks.positive, 0, "x")
    refused("Argument `x` must be a finite number from 0, but is -1.", checks.not_negative, -1, "x")
    refused("Argument `x` must be a number from 1 to 2, but is 3.", checks.number, 3, "x", 1, 2)
    refused("Argument `x` must be a number between 0 and 1, but is 1.", checks.number, 1, "x", above=0, below=1)


def test_the_name_of_a_key_and_another_error_stand_in_the_sentence():
    refused("[run] steps must be positive, but is 0.", checks.positive, 0, "[run] steps")
    refused("Argument `area` of the fin `top` must be positive, but is 0.", checks.positive, 0, "area` of the fin `top")
    refused("Argument `size` must be positive, but is 0.", checks.positive, 0, "size", error=GroupError)


def test_a_choice_names_the_nearest_word():
    assert checks.choice("held", "between", ("", "held", "linear")) == "held"
    refused(
        'Argument `between` must be "held" or "linear", but is \'lineal\': did you mean `linear`?',
        lambda: checks.choice("lineal", "between", ("", "held", "linear")),
    )
    refused("Argument `n` must be 1, 2 or 3, but is True.", checks.choice, True, "n", (1, 2, 3))


def test_kinds_truths_texts_and_mappings_are_named():
    assert checks.truth(np.True_, "x") is True and checks.text("a", "x") == "a"
    for wrong in (1, 0.0, "yes", None, np.array([True])):
        with pytest.raises(ArgumentError, match="must be True or False"):
            checks.truth(wrong, "x")
    refused("Argument `x` must be a text, but is ''.", checks.text, "", "x")
    assert checks.texts(["a", "b"], "x", "names") == ("a", "b")
    refused("Argument `x` must be names, but is ['a', 1].", checks.texts, ["a", 1], "x", "names")
    refused("Argument `x` must be a dictionary of name → value, but is {1: 2}.", checks.mapping, {1: 2}, "x")
    refused("Argument `x` must be a list, but is 3.", checks.instance, 3, "x", list, "a list")
    with pytest.raises(FileError):
        checks.text(3, "x", FileError)


def test_arrays_have_shapes_with_letters_for_any_length_and_finite_float64_numbers():
    assert checks.array([[1, 2, 3]], "x", "(n, 3)").dtype == np.float64
    assert checks.array(3, "x", (), (2,)) == 3 and checks.array(np.ones((4, 2, 3)), "x", "(…, 3)").shape == (4, 2, 3)
    assert checks.shape(np.ones((2, 2)), "x", "(n, n)") == (2, 2)
    refused("Argument `x` must have shape (n, n), but has shape (2, 3).", checks.shape, np.ones((2, 3)), "x", "(n, n)")
    refused("Argument `x` must have shape (n, 3), but has shape (0, 3).", checks.array, np.ones((0, 3)), "x", "(n, 3)")
    refused(
        "Argument `x` must be one number or have shape (2,), but has shape (3,).",
        checks.array,
        [1, 2, 3],
        "x",
        (),
        (2,),
    )
    refused("Argument `x` must be finite, but is [nan].", checks.array, [math.nan], "x", "(n,)")
    refused(
        "Argument `x` must be strictly increasing, but is not: sort it, and give each once.",
        checks.increasing,
        np.array([1.0, 1.0]),
        "x",
    )


def test_a_name_that_is_not_known_has_the_nearest_one():
    assert checks.known("fin", ("fin", "hull"), "part", "It") == "fin"
    refused(
        "It has no part `fim`: did you mean `fin`? It knows fin, hull.",
        checks.known,
        "fim",
        ("fin", "hull"),
        "part",
        "It",
    )
    refused("It has no part `3`: it has none.", checks.known, 3, (), "part", "It")


def test_functions_and_rows_of_texts_are_told_from_others():
    assert checks.function(math.sin, "f") is math.sin and checks.texts(["a"], "x", "names") == ("a",)
    refused("Argument `f` must be a function, but is 3.", checks.function, 3, "f")
    refused("Argument `x` must be names, but is 'a'.", checks.texts, "a", "x", "names")


@pytest.mark.parametrize("h", [0.002, 0.1, 1e-5, 3.0])
def test_a_time_that_is_no_whole_number_of_steps_shows_the_digits_that_make_it_so(h):
    for count in (1, 12, 213696):
        assert checks.steps(count * h, h) == count
        for off in (1e-3, 0.5):
            time = (count + off) * h
            assert checks.steps(time, h) is None
            given, steps, each = re.fullmatch(r"(.+) s is (.+) steps of (.+) s", checks.uneven(time, h)).groups()
            assert (float(given), float(each)) == (time, h)
            assert float(steps) == pytest.approx(count + off, abs=2e-4) and not float(steps).is_integer()
    assert checks.uneven(427.3921, 0.002) == "427.3921 s is 213696.05 steps of 0.002 s"
    with pytest.raises(ArgumentError, match=r"427\.3921 s is 213696\.05 steps of 0\.002 s; write 427\.392\."):
        RunSection(dt=0.002, duration=427.3921)
    with pytest.raises(ArgumentError, match=r"427\.3921 s is 213696\.05 steps of 0\.002 s; give duration=427\.392\."):
        grid(0.002, 427.3921, None)


def test_the_nearest_name_is_the_most_similar_one_and_empty_where_none_is_similar_enough():
    assert checks.nearest("Midpiont", ["Midpoint", "Trapezoidal"]) == "Midpoint"
    assert checks.nearest("qqq", ["Midpoint", "Trapezoidal"]) == ""
    assert checks.nearest("idp", ["Midpoint", "Trapezoidal"], 0.0) == "Midpoint"
    assert checks.nearest(7, []) == ""


def test_the_nearest_name_is_searched_for_by_one_function():
    found = {name for name, path in files().items() if "get_close_matches" in path.read_text(encoding="utf-8")}
    assert found == {"errors.py", "vehicles/logs/bags/messages.py"}  # the last for the three nearest
