"""The tanker `kvlcc2`: its numbers in docs/validation.md, from an integration of its own, and by the library."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

ROOT = Path(__file__).parents[3]
sys.path.insert(0, str(ROOT / "docs" / "figures"))
import kvlcc2  # noqa: E402

import coadjoint as co  # noqa: E402
import coadjoint_vehicles as vehicles  # noqa: E402
from coadjoint.errors import ArgumentError  # noqa: E402
from coadjoint.kernels.trace.evaluate import evaluate  # noqa: E402
from coadjoint_vehicles.controllers import Trial  # noqa: E402
from coadjoint_vehicles.controllers.allocation import Allocation, allocation  # noqa: E402
from coadjoint_vehicles.missions.example import standard_manoeuvre  # noqa: E402
from coadjoint_vehicles.parts import Flow, mmg  # noqa: E402


def integrated(manoeuvre, rudder, revolutions, duration):
    """The track by (4) of Yasukawa and Yoshimura (2015) in the plane, by SciPy, from order to order."""
    L, m, x, unit = 7.0, 3270.0, 0.25, 0.5 * 1000 * 7.0**2 * 0.46
    m_x, m_y, J = (unit * c for c in (0.022, 0.223, L**2 * 0.011))
    A, B, C = m + m_y, x * m, m * (L / 4) ** 2 + x**2 * m + J
    own, rate = SimpleNamespace(**kvlcc2.balanced(revolutions).parameters()), np.radians(15.8)

    def rates(t, state, order, begin, first):
        u, v, r, _, _, psi = state
        delta = first + np.clip(order - first, -rate * (t - begin), rate * (t - begin))
        X, Y, N = mmg.planar(u, v, r, delta, 1000.0, own)
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
    monkeypatch.setattr(mmg, "jnp", np)
    cells = on_the_page(title)
    for column, revolutions in ((1, None), (2, kvlcc2.MEASURED_REVOLUTIONS)):
        found = kvlcc2.figures(integrated(manoeuvre, rudder, revolutions, 90.0))
        for cell, (name, value) in zip(cells, found.items(), strict=True):
            assert cell[column] == pytest.approx(value, abs=0.1 if "overshoot" in name else 0.011), name


def test_revolutions_and_resistance_keep_the_speed_ahead(monkeypatch):
    monkeypatch.setattr(mmg, "jnp", np)
    for given in (None, kvlcc2.MEASURED_REVOLUTIONS):
        own = SimpleNamespace(**kvlcc2.balanced(given).parameters())
        X, Y, N = mmg.planar(kvlcc2.SPEED, 0.0, 0.0, 0.0, 1000.0, own)
        assert abs(X) < 1e-9 and Y == 0 and N == 0
        assert own.revolutions == pytest.approx(11.8516 if given is None else given, abs=1e-3)
        assert own.resistance == pytest.approx(0.022 if given is None else 0.01555, abs=1e-5)
    assert vehicles.load("kvlcc2").part("rudder").revolutions == pytest.approx(kvlcc2.balanced().revolutions, rel=1e-12)


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
    monkeypatch.setattr(mmg, "jnp", np)
    found = kvlcc2.analyse(integrated(manoeuvre, rudder, kvlcc2.MEASURED_REVOLUTIONS, 70.0))
    for name in kvlcc2.FIGURES[manoeuvre]:
        assert flown[name] == pytest.approx(found[name], rel=5e-3), name


@pytest.mark.long
def test_the_mission_of_a_turning_circle_has_the_figures_of_the_page(tmp_path):
    file = tmp_path / "circle.toml"
    file.write_text(standard_manoeuvre("kvlcc2", "turning_circle").replace("duration = 420", "duration = 130"), "utf-8")
    found = kvlcc2.figures(kvlcc2.Track.of(vehicles.load_mission(file).run().dataset))
    assert list(found.values()) == pytest.approx([cell[1] for cell in on_the_page("to starboard")], abs=0.02)


def test_a_ship_at_rest_is_pushed_ahead_alone_and_has_finite_derivatives():
    part = vehicles.load("kvlcc2").part("rudder")
    own = co.Parameters(**part.parameters())

    def force(motion, own):
        zero = jnp.zeros(())
        found = part.force(Flow(motion[:3], motion[3:], 1e3 + zero, motion[:3], zero, zero), 0.1 + zero, own)
        return jnp.concatenate([found.force, found.torque])

    still, slopes = evaluate(lambda motion, own: (force(motion, own), jax.jacfwd(force)(motion, own)), np.zeros(6), own)
    assert np.all(np.isfinite(slopes)) and np.all(slopes[2:5] == 0)
    race = 0.5 * np.sqrt(8 * 0.2931 / np.pi) * 11.85159 * 0.216  # κ of it, without inflow
    rudder = 0.5 * 1000 * 0.0539 * 2.747 * 1.09**2 * (0.216 / 0.345) * race**2 * np.sin(0.1)
    push = (1 - 0.22) * 1000 * 11.85159**2 * 0.216**4 * 0.2931 - (1 - 0.387) * rudder * np.sin(0.1)
    yaw = (0.5 + 0.312 * 0.464) * 7.0 * rudder * np.cos(0.1)
    assert still == pytest.approx([push, -1.312 * rudder * np.cos(0.1), 0, 0, 0, yaw], rel=1e-6)


def motion_of_a_ship(surge=(0.0, -40.0), pitch=0.0, yaw=9.0):
    """What `allocation` asks of a vehicle under way with one rudder."""
    level = SimpleNamespace(surge=lambda speed: surge[speed > 1.5])
    effects = np.array([[0.0, -5.0, 0.0, 0.0, pitch, yaw]]).T
    return SimpleNamespace(effects=effects, names=("rudder",), level=level, speed=1.0)


def test_a_vehicle_that_holds_its_speed_is_steered_by_its_rudder_alone():
    assert allocation(motion_of_a_ship()).matrix.tolist() == [[0.0, 0.0, 1.0, 0.0]]
    assert allocation(motion_of_a_ship(yaw=-9.0)).matrix.tolist() == [[0.0, 0.0, -1.0, 0.0]]
    for other in (motion_of_a_ship(surge=(-10.0, -40.0)), motion_of_a_ship(pitch=9.0), motion_of_a_ship(yaw=0.0)):
        with pytest.raises(ArgumentError, match="needs parts that push ahead and fins that pitch and turn"):
            allocation(other)


def test_a_ship_without_commanded_propulsion_cannot_be_stopped():
    mixed = Allocation(np.array([[0.0, 0.0, 1.0, 0.0]]), ("rudder",))
    made = Trial(manoeuvre="stop", allocation=mixed, fin_limit=0.6)
    with pytest.raises(ArgumentError, match=r"'stop' needs propulsion that takes commands, and KVLCC2 has none\.$"):
        made.fitted(vehicles.load("kvlcc2"))
