"""What is furthest from zero where no steady motion is found, verdicts, and cards of steady motions, in words."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import ArgumentError
from coadjoint.spaces.named import named
from coadjoint.stability.analysis import Stability
from coadjoint.stability.integrals import _is_integral
from coadjoint.stability.reduced import Reduced
from coadjoint.stability.second_variation import _flows
from coadjoint.stability.spectrum import Linearisation, Mode, velocity_names
from coadjoint.stability.steady import Search, _held, _replaced, _solve


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


def test_a_summary_holds_the_motion_its_modes_and_both_verdicts():
    parts = {"xi": [1.0], "n": [2.0], "nu": [3.0], "a": [4.0]}
    found = known(1, zero_modes=2, **{key: np.array(value) for key, value in parts.items()})
    cast(Any, found.motion).residual = 1e-12
    cast(Any, found.linear).modes = (mode(0.1 + 1j * np.pi, 1, yaw=1.0),)
    summary = found.summary()
    assert {key: summary[key] for key in parts} == parts and summary["free"] == {"rudder": 0.25}
    assert (summary["residual"], summary["zero_modes"]) == (1e-12, 2)
    assert (summary["spectral"], summary["verdict"]) == ("unstable", "unstable")
    (one,) = summary["modes"]
    assert (one["name"], one["real"], one["imaginary"], one["shares"]) == ("yaw", 0.1, np.pi, {"yaw": 1.0})
    assert one["damping_ratio"] == pytest.approx(-0.1 / np.hypot(0.1, np.pi))


@pytest.mark.parametrize(
    ("group", "space", "names"),
    [
        (co.SE3(), co.Trivial(0), ["roll", "pitch", "yaw", "surge", "sway", "heave"]),
        (co.SO3(), co.Defining(), ["roll", "pitch", "yaw", "surge", "sway", "heave"]),
        (co.SO3(), co.Trivial(2), ["roll", "pitch", "yaw", "ν1", "ν2"]),
        (co.SE2(), co.Trivial(1), ["ξ1", "ξ2", "ξ3", "ν1"]),
    ],
)
def test_velocities_are_called_by_the_names_of_a_body_in_space(group, space, names):
    system: Any = SimpleNamespace(group=group, additional=space)
    assert velocity_names(system) == names


def phased(*around: float) -> Any:
    """ẏ = (0, μ, 0, 0), of which the change of a is ignorable, around motions with these momenta."""
    states = [
        co.State(
            t=0.0,
            g=None,
            n=np.array([1.0]),
            a=np.array([2.0]),
            mu=np.array([mu]),
            pi=np.array([0.5]),
            xi=np.zeros(1),
            nu=np.zeros(1),
            places=None,
        )
        for mu in around
    ]
    return SimpleNamespace(
        scales=SimpleNamespace(y=np.array([1.0, 2.0, 1.0, 1.0])), around=states, ignorable=np.array([[0, 0, 0, 1.0]]).T,
        phase=lambda s: (jnp.concatenate([s.mu, s.n, s.pi, s.a]), jnp.stack([0.0, s.mu[0], 0.0, 0.0])),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("function", "kept"),
    [
        (lambda s: s.mu[0] * s.pi[0], True), (lambda s: s.n[0], False), (lambda s: s.a[0], False),
        (lambda s: 3.0 + 0 * s.mu[0], False),
    ],
)  # fmt: skip
def test_an_integral_changes_neither_along_the_motion_nor_along_what_is_ignorable(function, kept):
    assert _is_integral(phased(0.3, -2.0), function) is kept
    if not kept:
        assert _is_integral(phased(0.0), lambda s: s.n[0])


def test_flows_of_symmetries_that_move_nothing_are_left_out():
    linear: Any = SimpleNamespace(rows=np.array([[1.0, 0.0, 2.0], [0.0, 1.0, 0.0]]), matrix=np.eye(2))
    reduced: Any = SimpleNamespace(symmetries=(1, 2), flows=lambda s: jnp.array([[1.0, 5.0, 1.0], [2.0, 0.0, -1.0]]))
    assert _flows(reduced, cast(Any, 0.0), linear).tolist() == [[3.0], [5.0]]
    reduced.symmetries = ()
    assert _flows(reduced, cast(Any, 0.0), linear).shape == (2, 0)


def test_what_may_change_is_named_by_its_path():
    state: Any = SimpleNamespace(
        internal=named({"battery": {"position": 1.0, "mass": 2.0}}), inputs=named({"rudder": 3.0})
    )
    assert _held(state, "rudder") == ("inputs", 3.0) and _held(state, "battery.position") == ("internal", 1.0)
    changed = _replaced(state.internal, "battery.position", 7.0)
    assert (changed.battery.position, changed.battery.mass) == (7.0, 2.0)
    for wrong in ("battery", "battery.wing", "thrust"):
        with pytest.raises(ArgumentError, match=f"but has '{wrong}'; there is: battery, rudder"):
            _held(state, wrong)


def test_a_search_goes_on_by_least_squares_where_newtons_iteration_stalls():
    """Newton's steps from 0.1 stall at the minimum of x³ − 2x + 2, as it has no zero beyond −1.77 near there."""

    def both(w):
        return w**3 - 2 * w + 2.0, np.diag(3 * w**2 - 2)

    assert _solve(both, np.array([-3.0])) == pytest.approx([-1.7692923542386314])
    assert abs(both(_solve(both, np.array([0.9])))[0][0]) > 0.5


def test_what_is_essential_are_rows_of_the_unit_matrix_where_coordinates_are_ignorable():
    turn = np.array([[0.8, -0.6], [0.6, 0.8]])
    for K, rows in (
        (np.eye(4)[:, [1, 3]], np.eye(4)[[0, 2]]),
        (np.eye(3)[:, []], np.eye(3)),
        (np.eye(2), np.zeros((0, 2))),
    ):
        found = Reduced.essential.func(SimpleNamespace(ignorable=K))  # pyright: ignore[reportArgumentType]
        np.testing.assert_array_equal(found, rows)
    K = np.zeros((4, 1))
    K[:2, 0] = turn[:, 0]
    C = Reduced.essential.func(SimpleNamespace(ignorable=K))  # pyright: ignore[reportArgumentType]
    np.testing.assert_allclose(C @ C.T, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(C @ K, 0.0, atol=1e-15)
