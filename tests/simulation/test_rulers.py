"""How rows are compared, g·n of rows, frequencies; and members whose energy passive forces raise."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.run import xla
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.state import Places
from coadjoint.simulation import energy_budget, event_driver
from coadjoint.simulation.accuracy import ruler

RANDOM = np.random.default_rng(17)


def laid(g: Any, n: int, size: int) -> Any:
    """A layout in which n follows g, after one number that belongs to neither."""
    ends = size - n
    return SimpleNamespace(places=SimpleNamespace(g=g, n=np.arange(ends, size)), size=size)


SE3_PLACES = np.arange(1, 10).reshape(3, 3), np.arange(10, 13)


@pytest.mark.parametrize(
    ("group", "space", "layout", "moved"),
    [
        (
            co.SO3(), co.Defining(), laid(np.arange(1, 10).reshape(3, 3), 3, 13),
            lambda row: row[1:10].reshape(3, 3) @ row[10:],
        ),
        (
            co.SE3(), co.spaces.Points(), laid(SE3_PLACES, 3, 16),
            lambda row: row[1:10].reshape(3, 3) @ row[13:] + row[10:13],
        ),
    ],
    ids=["linear", "affine"],
)  # fmt: skip
def test_places_in_space_of_rows_are_bilinear_in_g_and_n(group, space, layout, moved, monkeypatch):
    places = Places(group, space, co.Trivial(0))
    found = ruler._bilinear(layout, places)
    rows = RANDOM.normal(size=(4, layout.size))
    assert found is not None and found(rows) == pytest.approx(np.array([moved(row) for row in rows]), abs=1e-13)
    monkeypatch.setattr(ruler, "MOST", found.tensor[0].size - 1)
    assert ruler._bilinear(layout, places) is None


def test_an_action_that_is_not_linear_in_n_has_no_tensor():
    class Bent(co.spaces.Representation):
        def ambient(self, group):
            return 3

        def act(self, group, g, x):
            return g @ x * (1 + 0.1 * x @ x)

    layout = laid(np.arange(1, 10).reshape(3, 3), 3, 13)
    assert ruler._bilinear(layout, Places(co.SO3(), Bent(), co.Trivial(0))) is None


@pytest.mark.parametrize("group", [co.SO3(), co.SOn(4), co.Un(2)], ids=repr)
def test_the_frequency_of_a_row_is_the_largest_of_its_adjoint_operator(group):
    xi = RANDOM.normal(size=(2, group.dim))
    ad = evaluate(lambda xi: jnp.stack([jnp.stack([group.ad(x, e) for e in np.eye(group.dim)], 1) for x in xi]), xi)
    expected = [np.max(np.linalg.eigvals(one).imag) for one in ad]
    assert ruler.turning(group, xi) == pytest.approx(expected, rel=1e-9)
    both = ruler.turning(co.Power(group, 2), xi.reshape(1, -1))
    assert both == pytest.approx([max(expected)], rel=1e-9)


def gained(monkeypatch, energies: dict[int, float], count: int = 14, block: int = 9):
    """The warnings of an ensemble in which these members gain energy; member 3 has no number at the last node."""
    rows = np.tile(np.arange(3.0), (count, 1)) + 10 * np.arange(count)[:, None]
    rows[3, 2] = np.nan
    extrema = {"work": (rows[:, 0] - 1, rows[:, 0] + 5), "energy": (rows[:, 0], rows[:, 1])}

    def gain(system, p, watched):
        member = int(p["mass"])
        kept = 2 if member == 3 else 3
        assert watched.rows["work"].tolist() == rows[member, :kept].tolist() and len(watched.times) == kept
        assert watched.extrema["work"] == (10.0 * member - 1, 10.0 * member + 5)
        assert watched.rows["energy"].tolist() == [1.0] * kept
        return energy_budget._Gain("brake", energies[member], None) if member in energies else None

    monkeypatch.setattr(energy_budget, "_asked", lambda ensemble: ["work", "energy"])
    monkeypatch.setattr(energy_budget, "_gain", gain)
    monkeypatch.setattr(energy_budget, "_told", lambda system, gain: f"{gain.names} put in {gain.energy:g} J")
    monkeypatch.setattr(energy_budget, "BLOCK", block)
    ensemble: Any = SimpleNamespace(
        members=count, node_times=lambda: np.arange(3.0), extrema=extrema,
        system=SimpleNamespace(parameters={"mass": co.each(np.arange(float(count)))}),
        rows_of=lambda names, part: {"work": rows[part], "energy": np.ones_like(rows[part])},
    )  # fmt: skip
    return energy_budget.members_driven(ensemble)


def test_the_member_that_gains_most_is_described_and_others_are_listed(monkeypatch):
    assert gained(monkeypatch, {}) == []
    assert gained(monkeypatch, {3: 2.0}) == ["In member 3 brake put in 2 J."]
    (two,) = gained(monkeypatch, {1: 2.0, 12: 5.0})
    assert two == "In member 12 brake put in 5 J; so in 1 more of 14 members: 1."
    (many,) = gained(monkeypatch, {member: 20.0 - member for member in range(13)}, block=1)
    assert many.startswith("In member 0 ") and many.endswith("12 more of 14 members: 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, ….")


def test_events_beyond_the_last_time_of_a_member_are_forgotten():
    def at(t: float) -> Any:
        return SimpleNamespace(t=np.array(t))

    driver: Any = object.__new__(event_driver.MembersEvents)
    driver.plan, driver.times = SimpleNamespace(h=0.1), np.array([0.5, 0.9, np.nan])
    driver.crossed = {"up": [[at(0.2), at(0.5)], [at(0.4), at(0.9)], [at(0.1)]]}
    driver.ended = {0: at(0.5), 1: at(0.9)}
    driver.undo(SimpleNamespace(state=SimpleNamespace(t=np.array([0.5, 0.6, 0.0]))))
    assert [[float(s.t) for s in states] for states in driver.crossed["up"]] == [[0.2, 0.5], [0.4], []]
    assert list(driver.ended) == [0] and driver.times[0] == 0.5 and np.all(np.isnan(driver.times[1:]))


def test_a_long_run_is_taken_in_pieces_whose_records_are_those_of_one(monkeypatch):
    """Records at every third step, of pieces of at most two: a piece that ends between records adds none."""
    asked = []

    def run(program, p, state, h, records, every, monitors):
        asked.append((state, records, every))
        done = records * every
        return xla.Chunk(np.arange(state, state + done, every), state + done, done, xla.Code(0), 2 * done, done, {}, {})

    monkeypatch.setattr(xla, "run", run)
    monkeypatch.setattr(xla, "capacity", lambda state: 100)
    monkeypatch.setattr(
        xla, "Clock", lambda pace: SimpleNamespace(pace=SimpleNamespace(steps=2), lap=lambda steps: None)
    )
    program: Any = "program"
    found = xla.run_long(program, (), 0, 0.1, 3, 3)
    assert asked == [(0, 1, 2), (2, 1, 1), (3, 1, 2), (5, 1, 1), (6, 1, 2), (8, 1, 1)]
    assert found.records.tolist() == [0, 3, 6]
    assert (found.final, found.steps, found.iterations, found.iterations_max) == (9, 9, 18, 2)

    def stopped(*given):
        if len(asked) == 7:
            raise KeyboardInterrupt
        return run(*given)

    monkeypatch.setattr(xla, "run", stopped)
    with pytest.raises(xla.Cut) as cut:
        xla.run_long(program, (), 0, 0.1, 3, 3)
    cut_off: Any = cut.value.result
    assert cut_off.steps == 2
