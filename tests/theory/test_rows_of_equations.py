"""Rows of equations: their names, what they say, and their residual relative to its size."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, NamedTuple, cast

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import ArgumentError, StepError
from coadjoint.models import hopf
from coadjoint.theory import bundle_motions, constraints, equations, instant
from coadjoint.theory.algorithm import Algorithm
from coadjoint.theory.equations import Equations, _of_constraints, _of_momenta, consecutive
from coadjoint.theory.residuals import Residual, row


class Record(NamedTuple):
    """The momenta of a node, and where it is."""

    n: Any
    mu: Any
    pi: Any


def test_a_row_has_the_largest_entry_of_each_node():
    found = row("P42", "π = 0", np.array([[[1.0, -3.0]], [[0.5, 0.25]]]), 2.0)
    assert (found.equation, found.statement, found.values.tolist(), found.scale) == ("P42", "π = 0", [3.0, 0.5], 2.0)
    assert found.largest == 1.5 and row("a", "b", np.zeros((2, 0)), 0.0).scale == 1.0
    assert Residual("a", "b", np.array([1.0, np.nan]), 1.0).largest == np.inf


def test_the_momenta_are_told_against_the_legendre_transforms_on_both_sides(monkeypatch):
    """F⁻ of the step that begins at a node and F⁺ of the one that ends there, in their order."""
    system = co.System(co.SO2(), lambda xi, x, v: 0.5 * (xi @ xi + v @ v), additional=co.Trivial(1))
    one = np.ones((3, 1))
    records = cast(Any, Record(n=one, mu=5 * one, pi=7 * one))
    slopes = SimpleNamespace(right=one, along_s=one, along_n=one, link=SimpleNamespace(n=one, s=one))
    ends = [SimpleNamespace(mu=4.0 * one[0], pi=5.0 * one[0]), SimpleNamespace(mu=2.0 * one[0], pi=1.0 * one[0])]
    monkeypatch.setattr(equations, "legendre_transforms", lambda system, at: ends)
    monkeypatch.setattr(equations, "pairs", lambda slopes: (np.zeros(2), np.zeros(2)))
    rows = _of_momenta(system, records, cast(Any, slopes))
    assert [(row.equation, row.values.tolist()) for row in rows] == [
        ("F⁻ μ", [1.0, 1.0]), ("F⁻ π", [2.0, 2.0]), ("F⁺ μ", [3.0, 3.0]), ("F⁺ π", [6.0, 6.0]),
    ]  # fmt: skip
    assert [row.statement.split(" ")[0] for row in rows] == ["μ_k", "π_k", "μ_{k+1}", "π_{k+1}"]
    assert rows[0].scale == pytest.approx(2.0) and rows[1].scale == 1.0


def test_the_rows_of_constraints_are_relative_to_places_and_speeds(monkeypatch):
    one = np.full((2, 1), 3.0)
    off = np.array([[1.0], [2.0]]), np.array([[8.0], [4.0]]), np.array([[0.5], [-2.0]])
    monkeypatch.setattr(equations, "evaluate", lambda function, records: off)
    records = cast(Any, SimpleNamespace(n=one, a=2 * one))
    on, rate = _of_constraints(cast(Any, "system"), records)
    assert (on.equation, on.scale, on.largest) == ("φ", 6.0, pytest.approx(2 / 6))
    assert (rate.equation, rate.scale) == ("A", 7.0 * 2.0) and rate.values.tolist() == [8.0, 4.0]
    off = np.zeros((2, 0)), *off[1:]
    assert [one.equation for one in _of_constraints(cast(Any, "system"), records)] == ["A"]


def test_equations_are_read_by_name_and_printed_by_rows():
    rows = [row("P42", "π = 0", np.array([3.0]), 2.0), row("P43", "μ = 0", np.array([1.0]), 1.0)]
    plain, opposite = Equations(cast(Any, rows), False), Equations(cast(Any, rows), True)
    assert list(plain) == rows and plain["P43"] is rows[1]
    assert str(plain).splitlines() == ["P42       1.5e+00  π = 0", "P43       1.0e+00  μ = 0"]
    assert str(opposite).splitlines()[0] == equations.OPPOSITE and len(str(opposite).splitlines()) == 3


def test_the_momentum_equation_has_the_field_of_both_nodes_in_the_frame_of_the_first(monkeypatch):
    """A field, momenta and sources of numbers that are all different."""
    ends = {"record": 2.0, "after": 3.0}
    sources = np.array([5.0]), np.array([7.0])
    step = SimpleNamespace(sources=lambda *at: sources, relative=lambda *at: 11.0)
    monkeypatch.setattr(constraints, "constrained", lambda system, given: given)
    monkeypatch.setattr(constraints, "total_momentum", lambda system, at: np.array([ends[at]]))
    system: Any = SimpleNamespace(group=SimpleNamespace(Ad=lambda F, x: F * x))
    field = {"record": np.array([13.0]), "after": np.array([17.0])}
    found = constraints.discrete_momentum_equation(
        system, cast(Any, step), cast(Any, "record"), cast(Any, "after"), 0.1, lambda at: field[cast(Any, at)]
    )
    assert tuple(found) == (3 * 17 - 2 * 13, 2 * (11 * 17 - 13), 5 * 11 * 17 + 7 * 17)


@pytest.mark.parametrize("ruled", [False, True])
def test_the_next_instant_is_that_of_a_state_where_the_last_one_ended(monkeypatch, ruled):
    seen = []

    def held(system, state, h):
        seen.append(state)
        return state

    monkeypatch.setattr(instant, "held", held)
    monkeypatch.setattr(instant, "given", lambda system, at: (at.t, at.inputs, at.internal))
    monkeypatch.setattr(instant, "instants", lambda state: "next")
    system: Any = SimpleNamespace(internal="rule" if ruled else None, places=None)
    at = instant.Instant(t=np.float64(0.5), inputs={"u": 1.0}, internal={"x": 2.0}, internal_end={"x": 3.0})
    xi, n, nu, a = (np.full(1, value) for value in (4.0, 5.0, 6.0, 7.0))
    assert instant.next_instant(system, at, 0.25, (xi, n, nu, a)) == cast(Any, "next")
    (state,) = seen
    assert (state.t, state.xi, state.n, state.nu, state.a) == (0.75, [4.0], [5.0], [6.0], [7.0])
    assert state.inputs.u == 1.0 and state.internal.x == 3.0
    assert (state.internal_due, state.internal_mean is None) == ((1.0, False) if ruled else (None, True))
    still = instant.Instant()
    assert instant.next_instant(system, still, 0.25, (xi, n, nu, a)) is still


@dataclass(frozen=True)
class Free(Algorithm):
    """F_k = F_{k−1}R(h²) and n_{k+1} = 2n_k − n_{k−1} + h² for h < 2, of pairs (F, n_{k−1}, n_k)."""

    group: Any = co.SO2()  # noqa: RUF009
    space: Any = co.Trivial(1)  # noqa: RUF009

    def last(self, pair, h):
        F, before, n = pair
        return F, n, (n - before) / h

    def conditions(self, pair, h, F, s):
        last, before, n = pair
        turned = co.SO2().compose(co.SO2().inverse(last), F)
        return jnp.stack([turned[1, 0] - jnp.sin(h**2)]) / jnp.where(h < 2, h, 0.0), (s - 2 * n + before - h**2) / h

    def following(self, pair, h, F, s):
        return F, pair[2], s


def test_an_algorithm_solves_its_conditions_from_pair_to_pair_and_says_where_it_fails():
    h, steps = 0.2, 5
    first = np.array([[np.cos(0.3), -np.sin(0.3)], [np.sin(0.3), np.cos(0.3)]]), np.array([1.0]), np.array([1.1])
    F, before, n = Free().run(first, h, steps)
    k = np.arange(steps + 1)
    assert np.arctan2(F[:, 1, 0], F[:, 0, 0]) == pytest.approx(0.3 + k * h**2, abs=1e-12)
    assert n[:, 0] == pytest.approx(1.1 + 0.1 * k + h**2 * k * (k + 1) / 2, abs=1e-12)
    assert np.array_equal(before[1:], n[:-1])
    with pytest.raises(StepError, match=r"Step 0 of the Free algorithm failed: .*; take a smaller h"):
        Free().run(first, 3.0, steps)


class Turning:
    """Steps through section i of Hopf's fibration, by a twentieth of the way from one pole to the other."""

    calls: list[Any] = []  # noqa: RUF012

    def __init__(self, bundle, lagrangian, i, h):
        self.i = i

    def begin(self, p, velocity):
        return SimpleNamespace(t=0)

    def run(self, state, steps):
        self.calls.append((self.i, state.t, steps))
        return State(np.arange(state.t, state.t + steps + 1)), 0

    def seen(self, nodes):
        depth = 1 - nodes.t / 20
        one = nodes.t[:, None] + 100.0 * self.i
        return bundle_motions._Seen(one, one, one, np.stack([depth, 1 - depth], axis=1))

    def carried(self, j, state):
        self.calls.append(("carried", self.i, j, int(state.t)))
        return state


class State(NamedTuple):
    t: Any


def test_a_motion_goes_through_the_next_section_where_it_is_deeper_than_the_margin(monkeypatch):
    monkeypatch.setattr(bundle_motions, "_Local", Turning)
    monkeypatch.setattr(bundle_motions, "_BLOCK", 7)
    Turning.calls.clear()
    found = bundle_motions.bundle_motion(
        hopf.fibration(), lambda p, v: 0.5 * v @ v, np.eye(4)[0], np.eye(4)[1], dt=0.5, steps=18, margin=0.3
    )
    assert Turning.calls == [(0, 0, 7), (0, 7, 7), (0, 14, 4), ("carried", 0, 1, 15), (1, 15, 3)]
    assert found.section.tolist() == [0] * 15 + [1] * 4 and found.time.tolist() == (0.5 * np.arange(19)).tolist()
    assert found.p[:, 0].tolist() == [*range(15), *(115.0 + k for k in range(4))] and len(found.momentum) == 19


def test_records_of_equations_are_consecutive():
    records = cast(Any, SimpleNamespace(t=np.array([0.0, 0.1, 0.2])))
    with pytest.raises(ArgumentError, match="run with save_every=1"):
        consecutive(cast(Any, SimpleNamespace(records=records, plan=SimpleNamespace(save_every=2), dt=0.1)))
