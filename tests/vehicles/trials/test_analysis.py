"""Figures of merit of standard manoeuvres: closed forms of Nomoto's model, and a published turning circle."""

from __future__ import annotations

import numpy as np
import pytest
from mariner import LENGTH, SPEED, TURN_TO_PORT, accelerations
from scipy.integrate import quad

from coadjoint.errors import ArgumentError
from coadjoint_vehicles.trials import Track, analyse
from coadjoint_vehicles.trials.page import TrialCurve, page_of_several

K, T, DELTA, U = 0.2, 4.0, np.radians(10.0), 1.5


def track(manoeuvre, time, heading, order, *, speed=U, rate=None, **more):
    """A path at constant speed along its heading."""
    steps = 0.5 * np.diff(time)
    way = [np.concatenate([[0], np.cumsum(steps * (c[1:] + c[:-1]))]) for c in (np.cos(heading), np.sin(heading))]
    return Track(
        manoeuvre, time, speed * way[0], speed * way[1], heading, np.full(len(time), speed), order, rate=rate, **more
    )


def nomoto_zigzag(duration=60.0, h=0.005):
    """Nomoto's zigzag, order by order in closed form: r = K δ + (r₀ − K δ) e^(−t/T)."""
    time = np.arange(0.0, duration, h)
    heading, rate, order = (np.zeros(len(time)) for _ in range(3))
    begin, psi, r, now = 0, 0.0, 0.0, DELTA
    for k in range(1, len(time) + 1):
        t = (k - begin) * h
        order[k - 1] = now
        if k == len(time):
            break
        goal = K * now
        rate[k] = goal + (r - goal) * np.exp(-t / T)
        heading[k] = psi + goal * t + T * (r - goal) * (1 - np.exp(-t / T))
        if np.sign(now) * heading[k] >= DELTA:
            begin, psi, r, now = k, heading[k], rate[k], -now
    return track("zigzag", time, heading, order, rate=rate, begin=0.0)


def test_a_zigzag_of_nomotos_model_gives_its_gain_and_time_constant_and_the_overshoot_in_closed_form():
    made = nomoto_zigzag()
    found = analyse(made)
    assert found["K"] == pytest.approx(K, rel=1e-5) and found["T"] == pytest.approx(T, rel=1e-5)
    assert found["nomoto_deviation"] < 1e-4
    at = int(np.flatnonzero(np.diff(made.order))[0]) + 1
    r, goal = made.rate[at], K * DELTA  # type: ignore[index]
    turning_back = T * np.log(1 + r / goal)
    assert found["first_overshoot_time"] == pytest.approx(turning_back, abs=0.005)
    assert found["first_overshoot"] == pytest.approx(np.degrees(T * r - goal * turning_back), abs=1e-4)
    assert found["initial_turning"] == pytest.approx(U * found["time_to_first_reversal"], rel=1e-3)
    assert found["second_overshoot"] > found["first_overshoot"]


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_turning_circle_of_nomotos_model_has_the_advance_and_transfer_of_its_integral(side):
    time = np.arange(0.0, 400.0, 0.02)
    after = np.maximum(time - 20.0, 0.0)
    goal = K * DELTA
    heading = side * goal * (after - T * (1 - np.exp(-after / T)))
    order = np.where(time >= 20.0, side * DELTA, 0.0)
    rate = side * goal * (1 - np.exp(-after / T))
    found = analyse(track("turning_circle", time, 0.7 + heading, order, rate=rate, length=1.6))

    def turned(t):
        return goal * (t - T * (1 - np.exp(-t / T)))

    quarter, half = (np.interp(angle, side * heading, after) for angle in (np.pi / 2, np.pi))
    assert found["time_to_90"] == pytest.approx(quarter, abs=1e-3)
    assert found["advance"] == pytest.approx(U * quad(lambda t: np.cos(turned(t)), 0, quarter)[0], abs=1e-3)
    assert found["transfer"] == pytest.approx(U * quad(lambda t: np.sin(turned(t)), 0, quarter)[0], abs=1e-3)
    assert found["tactical_diameter"] == pytest.approx(U * quad(lambda t: np.sin(turned(t)), 0, half)[0], abs=1e-3)
    assert found["steady_radius"] == pytest.approx(U / goal, rel=1e-5)
    assert found["K"] == pytest.approx(K, rel=1e-4) and found["T"] == pytest.approx(T, rel=1e-3)
    assert "tactical diameter" in str(found) and f"{found['advance'] / 1.6:.3g} L" in str(found)


@pytest.mark.parametrize("made", [nomoto_zigzag(20.0, 0.05), None])
def test_a_page_shows_track_rudder_and_table(made):
    time = np.arange(0.0, 100.0, 0.1)
    circle = track("turning_circle", time, 0.1 * time, np.full(len(time), DELTA), length=2.0)
    figure = analyse(circle if made is None else made).plot()
    panels = figure.axes
    labels = {line.get_label() for line in panels[0].get_lines() + panels[1].get_lines()}
    assert labels > (
        {"advance", "transfer", "tactical diameter", "rate of turn"} if made is None else {"heading", "order"}
    )
    assert ("tactical diameter" if made is None else "first overshoot") in panels[2].texts[0].get_text()


def test_a_page_of_several_trials_shows_their_courses_and_figures_side_by_side():
    time = np.arange(0.0, 100.0, 0.1)
    circle = track("turning_circle", time, 0.1 * time, np.full(len(time), DELTA), begin=0.0)
    zigzag = nomoto_zigzag(20.0, 0.05)

    def panels(*tracks):
        found = [TrialCurve(f"run {k}", one, analyse(one).merits, {"color": f"C{k}"}) for k, one in enumerate(tracks)]
        return page_of_several(found).axes

    left, middle, right = panels(circle, zigzag)
    assert [line.get_label() for line in left.get_lines()] == ["run 0", "run 1"]
    assert len(middle.get_lines()) == 2 and middle.get_ylabel() == "rate of turn (°/s)"
    table = {line[:23].strip(): line[23:].split() for line in right.texts[0].get_text().splitlines()[1:]}
    assert table["advance"][1] == table["first overshoot"][0] == "–"
    assert float(table["first overshoot"][1]) == pytest.approx(analyse(zigzag)["first_overshoot"], rel=1e-3)
    assert panels(zigzag, zigzag)[1].get_ylabel() == "change of heading (°)"


def test_a_turn_that_ends_early_has_no_tactical_diameter():
    time = np.arange(0.0, 60.0, 0.1)
    found = analyse(track("turning_circle", time, 0.04 * time, np.full(len(time), DELTA)))
    assert "transfer" in found.merits and "tactical_diameter" not in found.merits


def test_a_pull_out_gives_the_time_constant_and_the_rate_that_is_left():
    time, left = np.arange(0.0, 80.0, 0.02), 0.01
    after = np.maximum(time - 20.0, 0.0)
    rate = np.where(after > 0, left + 0.09 * np.exp(-after / T), 0.1)
    heading = np.where(after > 0, 2.0 + left * after + 0.09 * T * (1 - np.exp(-after / T)), 0.1 * time)
    found = analyse(track("pull_out", time, heading, np.where(time < 20.0, DELTA, 0.0), rate=rate))
    assert found["decay_time"] == pytest.approx(T, rel=1e-4)
    assert found["residual_rate"] == pytest.approx(np.degrees(left), rel=1e-4)


def test_a_rate_that_falls_and_comes_back_after_midships_has_no_time_constant():
    """As of a vehicle that is unstable on a straight course and goes on turning."""
    time = np.arange(0.0, 60.0, 0.1)
    after = np.maximum(time - 20.0, 0.0)
    rate = np.where(after > 0, 0.09 - 0.04 * np.exp(-after / 3), 0.1)
    heading = np.concatenate([[0.0], np.cumsum(0.05 * (rate[1:] + rate[:-1]))])
    found = analyse(track("pull_out", time, heading, np.where(time < 20.0, DELTA, 0.0), rate=rate))
    assert found["residual_rate"] == pytest.approx(np.degrees(0.09), rel=1e-3)
    assert "decay_time" not in found.merits


def test_the_loop_of_a_spiral_is_that_of_a_vehicle_with_two_steady_turns():
    orders = np.radians([10, 5, 0, -5, -10, -5, 0, 5, 10, 10])
    rates = np.array([4, 3, 2, 1, -4, -3, -2, -1, 4, 4]) / 100
    time = np.arange(0.0, 1000.0, 0.5)
    hold = np.minimum((time / 100).astype(int), 9)
    heading = np.concatenate([[0.0], np.cumsum(0.5 * rates[hold][:-1])])
    found = analyse(track("spiral", time, heading, orders[hold]))
    assert found["loop_height"] == pytest.approx(np.degrees(0.04), rel=1e-6)
    # down: from 0.01 at −5° to −0.04 at −10°, zero at −6°; up: zero at 6°
    assert found["loop_width"] == pytest.approx(12.0, rel=1e-6)


def test_a_stop_under_constant_thrust_and_quadratic_drag_has_its_reach_and_its_time():
    mass, drag, thrust, begin = 40.0, 6.0, 30.0, 10.0
    a = np.sqrt(thrust / drag)
    time = np.arange(0.0, 20.0, 0.005)
    after = np.maximum(time - begin, 0.0)
    phase = np.arctan(U / a) - a * drag / mass * after
    speed = a * np.tan(np.maximum(phase, -1.0))
    cosine = np.cos(np.maximum(phase, -1.0))
    way = U * np.minimum(time, begin) + mass / drag * np.log(cosine / np.cos(np.arctan(U / a)))
    zero = np.zeros(len(time))
    found = analyse(Track("stop", time, way, zero, zero, speed, zero, begin=begin))
    assert found["stopping_time"] == pytest.approx(np.arctan(U / a) * mass / (a * drag), rel=1e-5)
    assert found["track_reach"] == pytest.approx(mass / (2 * drag) * np.log(1 + (U / a) ** 2), rel=1e-4)
    assert found["head_reach"] == pytest.approx(found["track_reach"], rel=1e-5)
    early = analyse(
        Track("stop", time[:2100], way[:2100], zero[:2100], zero[:2100], speed[:2100], zero[:2100], begin=begin)
    )
    assert set(early.merits) == {"remaining_speed"}


def mariner_turn(order, h=0.5, duration=800.0, begin=99.5):
    """The ship's turn by Heun's method, independently of the library: its rudder moves by 5°/s at most."""
    fastest, rows = np.radians(5.0), []
    state = np.array([SPEED, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])

    def slope(x, wanted):
        u, v, r, delta, _, _, psi = x
        turning = np.clip(wanted - delta, -fastest, fastest)
        north, east = u * np.cos(psi) - v * np.sin(psi), u * np.sin(psi) + v * np.cos(psi)
        return np.array([*accelerations(u, v, r, delta), turning, north, east, r])

    for k in range(int(duration / h) + 1):
        wanted = order if k * h >= begin else 0.0
        rows.append([k * h, wanted, *state])
        first = slope(state, wanted)
        state = state + 0.5 * h * (first + slope(state + h * first, wanted))
    time, orders, u, _, r, delta, north, east, psi = np.array(rows).T
    return Track("turning_circle", time, north, east, psi, u, orders, delta, r, course=0.0, length=LENGTH)


def test_the_mariner_turns_to_port_as_published():
    """The source counts transfers from the line of the approach, which the ship has left at the execute, and advance
    from its place 0.4 s later."""
    track = mariner_turn(np.radians(-15.0))
    found, aside = analyse(track), -track.east[track.first]
    assert track.begin == 99.5
    reached = {name: found[name] + aside * (name in ("maximum_transfer", "tactical_diameter")) for name in TURN_TO_PORT}
    reached["maximum_advance"] -= 0.4 * SPEED
    assert reached == pytest.approx(TURN_TO_PORT, abs=1.0)


def test_a_track_that_cannot_be_judged_is_refused():
    time, zero = np.arange(5.0), np.zeros(5)
    with pytest.raises(ArgumentError, match="order"):
        Track("zigzag", time, zero, zero, zero, zero, zero)
    with pytest.raises(ArgumentError, match="increasing"):
        Track("zigzag", zero, zero, zero, zero, zero, zero, begin=0.0)
    with pytest.raises(ArgumentError, match="first execute"):
        Track("zigzag", time, zero, zero, zero, zero, zero, begin=9.0)
    with pytest.raises(ArgumentError, match="turning_circle"):
        Track("circle", time, zero, zero, zero, zero, zero, begin=1.0)


def test_k_and_t_of_opposite_signs_which_no_vehicle_has_are_left_out():
    time = np.arange(0.0, 60.0, 0.02)
    after = np.maximum(time - 10.0, 0.0)
    growing = 0.5 * np.exp(after / 20)
    rate = np.where(time >= 10.0, K * DELTA * (1 + growing), 0.0)
    heading = K * DELTA * (after + 20 * (growing - 0.5))
    found = analyse(track("turning_circle", time, heading, np.where(time >= 10.0, DELTA, 0.0), rate=rate))
    assert "K" not in found.values and "T" not in found.values and found["advance"] > 0
