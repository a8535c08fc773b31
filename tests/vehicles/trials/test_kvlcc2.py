"""The tanker of docs/validation.md: its numbers there, from an integration of its own, and by the library."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

ROOT = Path(__file__).parents[3]
sys.path.insert(0, str(ROOT / "docs" / "figures"))
import kvlcc2  # noqa: E402


def integrated(manoeuvre, rudder, revolutions, duration):
    """The track by (4) of Yasukawa and Yoshimura (2015) in the plane, by SciPy, from order to order."""
    half, L, m, x = 0.5 * kvlcc2.DENSITY, kvlcc2.LENGTH, kvlcc2.MASS, kvlcc2.AHEAD
    m_x, m_y, J = (half * L**2 * kvlcc2.DRAUGHT * c for c in (kvlcc2.M_X, kvlcc2.M_Y, L**2 * kvlcc2.J_Z))
    A, B, C = m + m_y, x * m, m * (L / 4) ** 2 + x**2 * m + J
    balance, rate = kvlcc2.balanced(revolutions), np.radians(15.8)

    def rates(t, state, order, begin, first):
        u, v, r, _, _, psi = state
        delta = first + np.clip(order - first, -rate * (t - begin), rate * (t - begin))
        X, Y, N = kvlcc2.forces(u, v, r, delta, *balance)
        Y, N = Y - (m + m_x) * u * r, N - B * u * r
        ahead = (X + A * v * r + B * r**2) / (m + m_x)
        across, turn = (C * Y - B * N) / (A * C - B * B), (A * N - B * Y) / (A * C - B * B)
        return [ahead, across, turn, u * np.cos(psi) - v * np.sin(psi), u * np.sin(psi) + v * np.cos(psi), r]

    def crossed(t, state, order, *_):
        return state[5] * np.sign(order) - abs(order) if manoeuvre == "zigzag" else -1.0

    crossed.terminal, crossed.direction = True, 1.0
    state, t, order, first = np.array([kvlcc2.SPEED, 0, 0, 0, 0, 0]), 0.0, np.radians(rudder), 0.0
    rows = [np.array([[-1.0, -kvlcc2.SPEED, 0, 0, kvlcc2.SPEED, 0]])]
    while t < duration:
        times = np.arange(t, duration, 0.1)
        found = solve_ivp(
            rates, (t, duration), state, t_eval=times, args=(order, t, first), events=crossed, rtol=1e-5, atol=1e-7
        )
        rows.append(np.stack([found.t, *found.y[[3, 4, 5, 0]], np.full(len(found.t), order)], axis=1))
        if not len(found.t_events[0]):
            break
        state, t, first, order = found.y_events[0][0], found.t_events[0][0], order, -order
    return kvlcc2.Track(manoeuvre, *np.concatenate(rows).T, length=L)


def on_the_page(title):
    """The cells of a row of the page: [measured, model, model at the measured revolutions] of each figure."""
    text = (ROOT / "docs/validation.md").read_text("utf-8")
    (row,) = re.findall(rf"^\| {title} \| (.*) \|$", text, re.MULTILINE)
    return [[float(number.strip(" *")) for number in cell.split(",")] for cell in row.split("|")]


@pytest.mark.parametrize(
    ("manoeuvre", "rudder", "title"),
    [
        ("turning_circle", 35, "to starboard"), ("turning_circle", -35, "to port"),
        ("zigzag", 10, "10°, starboard first"), ("zigzag", -10, "10°, port first"),
        ("zigzag", 20, "20°, starboard first"), ("zigzag", -20, "20°, port first"),
    ],
)  # fmt: skip
def test_the_page_has_the_figures_of_an_independent_integration(monkeypatch, manoeuvre, rudder, title):
    monkeypatch.setattr(kvlcc2, "jnp", np)
    cells = on_the_page(title)
    for column, revolutions in ((1, None), (2, kvlcc2.MEASURED_REVOLUTIONS)):
        found = kvlcc2.figures(integrated(manoeuvre, rudder, revolutions, 90.0))
        for cell, (name, value) in zip(cells, found.items(), strict=True):
            assert cell[column] == pytest.approx(value, abs=0.1 if "overshoot" in name else 0.011), name


def test_revolutions_and_resistance_keep_the_speed_ahead(monkeypatch):
    monkeypatch.setattr(kvlcc2, "jnp", np)
    for given in (None, kvlcc2.MEASURED_REVOLUTIONS):
        n, resistance = kvlcc2.balanced(given)
        X, Y, N = kvlcc2.forces(kvlcc2.SPEED, 0.0, 0.0, 0.0, n, resistance)
        assert abs(X) < 1e-9 and Y == 0 and N == 0
        assert n == pytest.approx(11.8516 if given is None else given, abs=1e-3)
        assert resistance == pytest.approx(0.022 if given is None else 0.01555, abs=1e-5)


def test_a_measured_turn_is_read_with_starboard_positive_and_without_its_pull_out(tmp_path):
    time = np.repeat(np.arange(0.0, 60.0), 2)
    angle = np.where(time < 5, -0.5, np.where(time < 50, -35.0, 0.0))  # positive to port, as in the file
    turned = np.clip(time - 5, 0, None) * 4.0
    rows = np.stack([time, 8 * time, turned, 0 * time, turned, 8 + 0 * time, 0 * time, *[0 * time] * 2, angle, time], 1)
    path = tmp_path / "MARIN_FREE_KVLCC2_tc_-35_m.dat"
    path.write_text("title\n\n" + "".join("\t".join(f"{x:.2E}" for x in row) + "\n" for row in rows), "latin-1")
    track = kvlcc2.read(tmp_path, "turning_circle", 35)
    assert track.begin == 5.0 and track.side == 1.0 and track.time[-1] == 48.0
    assert track.heading[10] == pytest.approx(np.radians(20.0), rel=1e-2)


@pytest.mark.long
@pytest.mark.parametrize(("manoeuvre", "rudder"), [("turning_circle", 35), ("zigzag", -20)])
def test_the_ship_of_the_library_follows_the_independent_integration(monkeypatch, manoeuvre, rudder):
    flown = kvlcc2.analyse(kvlcc2.flown(manoeuvre, rudder, kvlcc2.MEASURED_REVOLUTIONS, duration=70.0))
    monkeypatch.setattr(kvlcc2, "jnp", np)
    found = kvlcc2.analyse(integrated(manoeuvre, rudder, kvlcc2.MEASURED_REVOLUTIONS, 70.0))
    for name in kvlcc2.FIGURES[manoeuvre]:
        assert flown[name] == pytest.approx(found[name], rel=5e-3), name
