"""Sentences on what a log does not tell."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import coadjoint as co
from coadjoint.identification.commands import lacks_current
from coadjoint.identification.diagnostics import hidden, likely_causes, vague
from coadjoint.identification.log import Log
from coadjoint.identification.result import Estimate


def test_a_name_in_a_sentence_is_one_of_the_three_strongest():
    names = [f"mass[{i}]" for i in range(9)]
    estimates = {name: Estimate(name, 1.0, -np.inf, np.inf, np.inf, 1.0) for name in names}
    V = np.array([[0.1, 0.1, 0.8, 0.1, 0.5, 0.1, 0.3, 0.1, 0.0]])
    told = hidden(estimates, np.abs(V[0]) > 0, V, np.array([True]))
    assert told == [
        "The log cannot separate mass[2] and mass[4] and mass[6], with 5 others: keep one of them at its known value, "
        "or take a log in which their effects differ, as by commands that change separately."
    ]


def test_what_is_nothing_beside_where_the_search_began_is_well_known():
    """An effectiveness of 0 ± 0.001 that was 1; of one of 0 ± 0.1 it is told, and of one whose search began at 0."""
    lost, vague_one = Estimate("lost", 0.0, -0.001, 0.001, 5e-4, 1.0), Estimate("v", 0.0, -0.1, 0.1, 0.05, 1.0)
    found = vague({"lost": lost, "v": vague_one, "none": Estimate("none", 0.0, -0.001, 0.001, 5e-4, 0.0)})
    assert [sentence.split(" from zero")[0] for sentence in found] == [
        "The log does not distinguish v", "The log does not distinguish none"
    ]  # fmt: skip


def test_an_interval_around_zero_is_told_without_a_percentage():
    told = vague({"a": Estimate("a", 0.24, -0.1, 0.58, 0.17, 0.0), "b": Estimate("b", 1.0, 0.3, 1.7, 0.35, 1.0)})
    assert told[0] == "The log does not distinguish a from zero: its interval is -0.1 to 0.58."
    assert told[1] == "The log hardly excites b: its interval is ±70%."


TIME = 0.1 * np.arange(400)
CALM = dict.fromkeys(("depth", "roll", "pitch", "heading", "p", "q", "r"), 0.02)


def noisy(deviation: float) -> Log:
    random = np.random.default_rng(3)
    names = ("north", "east", "u", "v", *CALM)
    return Log(TIME, {name: np.sin(TIME / 3) + deviation * random.normal(size=400) for name in names})


def test_residuals_of_places_and_velocities_alone_are_those_of_an_unknown_current():
    adrift = {**CALM, "north": 0.93, "east": 0.87, "u": 0.99, "v": 0.98}
    (sentence,) = likely_causes(noisy(0.01), adrift, None, True)
    assert "a current that the log does not hold" in sentence
    assert likely_causes(noisy(0.01), adrift, None, False) == [], "the current is sought"
    assert likely_causes(noisy(0.01), {**adrift, "heading": 0.6}, None, True) == [], "a current turns nothing"
    assert likely_causes(noisy(0.01), {**adrift, "east": 0.1}, None, True) == []


def test_a_log_without_noise_asks_for_the_step_of_its_simulation():
    correlated = {**CALM, "north": 0.98, "east": 0.98, "heading": 0.88}
    (sentence,) = likely_causes(noisy(1e-6), correlated, None, True)
    assert "give the step of that simulation, dt= or --dt" in sentence
    assert likely_causes(noisy(1e-6), correlated, 0.05, True) == []
    assert likely_causes(noisy(1e-6), CALM, None, True) == [], "no warning, no cause"


def test_a_current_can_be_sought_where_the_water_moves_and_the_log_does_not_say_how():
    log = noisy(0.01)
    flowing = co.System(
        co.SO2(), lambda xi, p: 0.5 * p.mass * xi @ xi, parameters={"mass": 1.0, "water": {"velocity": np.zeros(3)}}
    )
    still = co.System(co.SO2(), lambda xi, p: 0.5 * p.mass * xi @ xi, parameters={"mass": 1.0})
    assert lacks_current(flowing, log, ["mass"]) and not lacks_current(flowing, log, ["mass", "water.velocity[0]"])
    assert not lacks_current(still, log, ["mass"])
    assert not lacks_current(flowing, replace(log, current={"north": 0.1 + 0 * TIME}), ["mass"])
