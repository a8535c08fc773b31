"""What is furthest from zero where no steady motion is found, verdicts, and cards of steady motions, in words."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from coadjoint.stability.analysis import Stability
from coadjoint.stability.spectrum import Linearisation, Mode
from coadjoint.stability.steady import Search


def search(names: tuple[str, ...] = ("speed",)) -> Any:
    """One with equations of 3 torques, 2 velocities of n, 3 forces and 1 advected rate."""
    made = object.__new__(Search)
    made.reduced = SimpleNamespace(essential=np.eye(9), sizes=(3, 2, 3, 1))
    made.terms, made.names = np.full(9, 2.0), names
    return made


@pytest.mark.parametrize(
    ("worst", "says"),
    [
        (0, "a torque of 0.5 is left"), (2, "a torque of 0.5 is left"), (3, "a velocity of n of 0.5 is left"),
        (5, "a force of 0.5 is left"), (7, "a force of 0.5 is left"),
        (8, "a rate of an advected parameter of 0.5 is left"),
        (9, "speed is off by -0.25"), (10, "condition 2 is off by -0.25"),
    ],
)  # fmt: skip
def test_the_equation_that_is_furthest_from_zero_is_named_by_its_kind(worst, says):
    relative, value = np.full(11, 0.1), np.full(11, 7.0)
    relative[worst], value[worst] = 0.9, -0.25
    assert search()._what(relative, value) == says


def test_the_largest_share_of_an_equation_names_its_kind():
    found = search()
    found.reduced.essential = np.eye(9) + 0.5
    found.reduced.essential[0, 5] = -3.0
    relative, value = np.zeros(9), np.full(9, 0.1)
    relative[0] = 1.0
    assert found._what(relative, value) == "a force of 0.2 is left"


def known(*growths: int, zero_modes: int = 0, forces: Any = None, **state: Any) -> Stability:
    modes = [SimpleNamespace(growth=g, rate=0.1 * g, name=f"mode {g}") for g in growths]
    system = SimpleNamespace(name="top", forces=forces)
    motion = SimpleNamespace(system=system, state=SimpleNamespace(**state), free={"rudder": np.array(0.25)})
    linear = SimpleNamespace(modes=tuple(modes), zero_modes=zero_modes)
    energy = SimpleNamespace(verdict="undecided", reason="neither definite")
    return Stability(cast(Any, motion), cast(Any, linear), cast(Any, energy))


@pytest.mark.parametrize(
    ("growths", "zero_modes", "spectral"),
    [
        ((-1, -1), 0, "stable"), ((-1, -1), 1, "neutral"), ((-1, 0), 0, "neutral"), ((0,), 0, "neutral"),
        ((1, -1), 0, "unstable"), ((1, 0), 2, "unstable"), ((), 0, "neutral"),
    ],
)  # fmt: skip
def test_the_spectrum_is_unstable_where_a_mode_grows_and_stable_where_all_decay(growths, zero_modes, spectral):
    found = known(*growths, zero_modes=zero_modes)
    assert found.spectral == spectral
    assert found.verdict == ("undecided" if spectral == "neutral" else spectral)
    assert found.growth_rate == pytest.approx(max((0.1 * g for g in growths), default=0.0))


def test_a_card_names_what_moves_what_was_found_and_the_verdict(monkeypatch):
    monkeypatch.setattr("coadjoint.stability.analysis.velocity_names", lambda system: ["p", "q", "u"])
    moving = known(1, zero_modes=2, xi=np.array([0.5, 1e-12]), nu=np.array([1.25]))
    lines = [line.split(maxsplit=1) for line in str(moving).splitlines()]
    assert ["motion", "top: p 0.5, u 1.25"] in lines and ["free", "rudder = 0.25"] in lines
    assert "zero modes      2: neighbours with other momenta, and symmetries" in str(moving)
    assert ["spectrum", "unstable"] in lines and ["energy–Casimir", "undecided: neither definite"] in lines
    still = known(-1, forces="drag", xi=np.zeros(2), nu=np.zeros(1))
    assert "top: at rest" in str(still) and "energy–Casimir" not in str(still) and "zero modes" not in str(still)


def mode(eigenvalue: complex, growth: int, **shares: float) -> Mode:
    return Mode(eigenvalue, np.zeros(3), shares, growth)


@pytest.mark.parametrize(
    ("one", "says"),
    [
        (mode(0.5, 1, roll=1.0), "roll: grows, time constant 2 s"),
        (mode(-4.0, -1, roll=0.05, yaw=0.04), "roll: decays, time constant 0.25 s"),
        (mode(0.0, 0), "attitude: stays"),
        (mode(2j * np.pi, 0, a=0.4, b=0.3, c=0.2, d=0.1), "a-b-c: oscillates, period 1 s, neither damped nor excited"),
        (mode(0.1 + 1j * np.pi, 1, yaw=1.0), "yaw: oscillates and grows, period 2 s, time constant 10 s"),
        (
            mode(-3.0 + 4.0j, -1, yaw=1.0),
            "yaw: oscillates and decays, period 1.57 s, time constant 0.333 s, damping ratio 0.6",
        ),
    ],
)
def test_a_mode_says_how_it_moves(one, says):
    assert str(one) == says


def test_a_spectrum_is_as_far_from_a_hamiltonian_one_as_its_worst_eigenvalue_from_the_negative_of_another():
    def defect(*eigenvalues: complex) -> float:
        empty = np.zeros((0, 0))
        return Linearisation(empty, empty, empty, empty, np.array(eigenvalues), 0, ()).symmetry_defect

    assert defect() == 0.0 and defect(2.0, -2.0, 3j, -3j) == 0.0
    assert defect(2.0, -2.0, 4j, -3j) == pytest.approx(0.25) and defect(0.5, -1.0) == pytest.approx(0.5)
