"""The figures of merit of each manoeuvre, by the definitions of IMO and ITTC."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from coadjoint_vehicles.trials.nomoto import nomoto
from coadjoint_vehicles.trials.track import Track

STEADY = np.pi / 2
"""The last part of a turn, rad, over which the steady figures are means."""


class Merit(NamedTuple):
    """A figure of merit: SI units but for angles, which are in degrees."""

    value: float
    unit: str
    meaning: str


def turning_circle(track: Track) -> dict[str, Merit]:
    """Advance, transfer, tactical diameter, extremes, steady radius, drift, speed and rate; K and T.

    Advance is along the course from the place of the execute to that where the heading has changed by 90°; transfer and
    tactical diameter are across the course at 90° and 180° (MSC.137(76), 4.3 and 4.4). Steady figures are means over
    the last 90° of a turn of more than 180°.
    """
    i, turn = track.first, track.side * track.turned
    along, aside = track.ahead_and_aside[i:, 0], track.side * track.ahead_and_aside[i:, 1]
    found: dict[str, Merit] = {}
    for degrees, names in ((90, ("advance", "transfer")), (180, ("", "tactical_diameter"))):
        when = reached(track.time[i:], turn[i:], np.radians(degrees))
        if when is None:
            return found
        for name, course in zip(names, (along, aside), strict=True):
            if name:
                meaning = f"{'along' if course is along else 'across'} the course at {degrees}°"
                found[name] = Merit(float(np.interp(when, track.time[i:], course)), "m", meaning)
        found[f"time_to_{degrees}"] = Merit(when - float(track.time[i]), "s", f"from the execute to {degrees}°")
    found["maximum_advance"] = Merit(float(np.max(along)), "m", "the largest distance along the course")
    found["maximum_transfer"] = Merit(float(np.max(aside)), "m", "the largest distance across the course")
    return {**found, **_steady(track, turn), **_response(track)}


def _steady(track: Track, turn: np.ndarray) -> dict[str, Merit]:
    """Radius, rate, speed and loss of speed over the last 90° of a turn."""
    when = reached(track.time, turn, turn[-1] - STEADY)
    assert when is not None
    ends = np.array([when, track.time[-1]])
    path = np.diff(np.interp(ends, track.time, track.travelled))[0]
    duration = float(ends[1] - ends[0])
    speed = path / duration
    before = max(track.speed[track.first], 1e-9)
    inside = track.time >= when
    return {
        "steady_radius": Merit(float(path / STEADY), "m", "of the path, over the last 90°"),
        "steady_rate": Merit(float(np.degrees(STEADY / duration)), "°/s", "of turn, over the last 90°"),
        "steady_speed": Merit(float(speed), "m/s", "over ground, over the last 90°"),
        "speed_ratio": Merit(float(np.mean(track.speed[inside]) / before), "1", "speed ahead in the turn to before it"),
    }


def zigzag(track: Track) -> dict[str, Merit]:
    """Overshoots after each reversal, initial turning, period; K and T.

    An overshoot is by how much the heading goes on after the rudder is reversed, until it turns back (MSC.137(76),
    4.7 and 4.8).
    """
    i = track.first
    changes = np.flatnonzero(np.diff(np.sign(track.order[i:]))) + i + 1
    found: dict[str, Merit] = {}
    overshoots = _overshoots(track, changes)
    for name, (angle, duration) in zip(("first", "second"), overshoots, strict=False):
        found[f"{name}_overshoot"] = Merit(float(np.degrees(angle)), "°", f"after the {name} reversal")
        found[f"{name}_overshoot_time"] = Merit(duration, "s", "from the reversal until it turns back")
    if overshoots:
        largest = max(angle for angle, _ in overshoots)
        found["largest_overshoot"] = Merit(float(np.degrees(largest)), "°", f"of {len(overshoots)}")
    if len(changes):
        at = int(changes[0])
        found["time_to_first_reversal"] = Merit(float(track.time[at] - track.time[i]), "s", "from the first execute")
        found["initial_turning"] = Merit(float(track.travelled[at]), "m", "the path from execute to first reversal")
    if len(changes) > 2:
        times = track.time[changes]
        period = (times[-1] - times[(len(times) + 1) % 2]) / ((len(times) - 1) // 2)
        found["period"] = Merit(float(period), "s", "from reversal to reversal of the same side, mean")
    return {**found, **_response(track)}


def _overshoots(track: Track, changes: np.ndarray) -> list[tuple[float, float]]:
    """(angle, rad; time, s) from each reversal until the heading turns back, of those that do before the track ends."""
    found = []
    for number, (at, end) in enumerate(zip(changes, [*changes[1:], None], strict=True)):
        course = track.side * (1 if number % 2 == 0 else -1) * track.turned[at:end]
        top = int(np.argmax(course))
        if top == len(course) - 1:
            break
        found.append((float(course[top] - course[0]), float(track.time[at + top] - track.time[at])))
    return found


def spiral(track: Track) -> dict[str, Merit]:
    """The steady rate of turn at each order, down and up, and the loop that they leave.

    A vehicle that is unstable on a straight course has two rates at small orders: `loop_width` is the range of orders
    between the two where the turn changes its side, and `loop_height` the largest difference between both rates.
    """
    orders, rates = steady_rates(track)
    found = {"orders": Merit(float(len(orders)), "1", "that were held to their end")}
    bottom = int(np.argmin(track.side * orders)) if len(orders) else 0
    down, up = slice(None, bottom + 1), slice(bottom, None)
    if len(orders[up]) < 2 or len(orders[down]) < 2:
        return found
    sorting = np.argsort(orders[up])
    rising = np.interp(orders[down], orders[up][sorting], rates[up][sorting])
    inside = (orders[down] >= orders[up].min()) & (orders[down] <= orders[up].max())
    height = np.max(np.abs(rising - rates[down])[inside])
    found["loop_height"] = Merit(float(np.degrees(height)), "°/s", "between the rates down and up")
    ahead, back = (_zero(orders[part], rates[part]) for part in (down, up))
    if ahead is not None and back is not None:
        found["loop_width"] = Merit(float(np.degrees(abs(ahead - back))), "°", "between the neutral orders")
    found["largest_rate"] = Merit(float(np.degrees(np.max(np.abs(rates)))), "°/s", "of the steady turns")
    return found


def steady_rates(track: Track) -> tuple[np.ndarray, np.ndarray]:
    """(orders, rates of turn) of the holds of a spiral, rad and rad/s: means over the last tenth of each.

    The last one counts if it lasts as long as the others.
    """
    i = track.first
    ends = np.flatnonzero(np.diff(track.order[i:])) + i + 1
    last = len(track.time) - 1
    if len(ends) and track.time[last] - track.time[ends[-1]] >= 0.99 * np.min(np.diff(track.time[[i, *ends]])):
        ends = np.append(ends, last)
    orders, rates = [], []
    for begin, end in zip([i, *ends], ends, strict=False):
        late = track.time[end] - 0.1 * (track.time[end] - track.time[begin])
        turned = np.interp(late, track.time, track.heading)
        orders.append(track.order[begin])
        rates.append((track.heading[end] - turned) / (track.time[end] - late))
    return np.array(orders), np.array(rates)


def stop(track: Track) -> dict[str, Merit]:
    """Track reach, head reach, side reach, time and change of heading until the speed ahead is 0 (MSC.137(76), 4.9)."""
    i = track.first
    when = reached(track.time[i:], -track.speed[i:], 0.0)
    if when is None:
        return {"remaining_speed": Merit(float(track.speed[-1]), "m/s", "at the end of the track: not stopped")}
    along, aside = track.ahead_and_aside.T

    def at(values: np.ndarray) -> float:
        return float(np.interp(when, track.time, values))

    return {
        "track_reach": Merit(at(track.travelled), "m", "along the path until it is stopped"),
        "head_reach": Merit(at(along), "m", "along the course"),
        "side_reach": Merit(at(aside), "m", "to starboard of the course"),
        "stopping_time": Merit(when - float(track.time[i]), "s", "from the execute"),
        "heading_change": Merit(float(np.degrees(at(track.turned))), "°", "until it is stopped"),
    }


def pull_out(track: Track) -> dict[str, Merit]:
    """The rate that is left after the rudder is put midships, the time constant of its decay; K and T.

    T = Δψ/(r₀ − r_end) of T ṙ + r = r_end, over the time after midships; left out where the rate does not decay so.
    """
    over = np.flatnonzero((track.order == 0) & (np.arange(len(track.time)) > track.first))
    if len(over) < 10:
        return {}
    assert track.rate is not None
    rate, begin = track.rate, int(over[0])
    late = over[-max(len(over) // 10, 2) :]
    left = (track.heading[late[-1]] - track.heading[late[0]]) / (track.time[late[-1]] - track.time[late[0]])
    duration = track.time[-1] - track.time[begin]
    fallen = track.heading[-1] - track.heading[begin] - left * duration
    decay = float(fallen / (rate[begin] - left)) if rate[begin] != left else 0.0
    decayed = {"decay_time": Merit(decay, "s", "time constant of the rate")} if decay > 0 else {}
    return {
        "rate_before": Merit(float(np.degrees(rate[begin])), "°/s", "when the rudder is put midships"),
        "residual_rate": Merit(float(np.degrees(left)), "°/s", "at the end; 0 of a vehicle that holds its course"),
        **decayed,
        **_response(track),
    }


def reached(time: np.ndarray, values: np.ndarray, level: float) -> float | None:
    """When rising values first reach a level, interpolated; None where they do not."""
    there = np.flatnonzero(values >= level)
    if not len(there):
        return None
    k = int(there[0])
    if k == 0:
        return float(time[0])
    part = (level - values[k - 1]) / (values[k] - values[k - 1])
    return float(time[k - 1] + part * (time[k] - time[k - 1]))


def _response(track: Track) -> dict[str, Merit]:
    """K and T of Nomoto, and how well the model follows; nothing where their signs differ, as of no vehicle.

    A T below the step of the track is none.
    """
    i = track.first
    assert track.rate is not None
    held = track.manoeuvre == "turning_circle"
    found = nomoto(track.time[i:], track.heading[i:], track.rate[i:], track.rudder_integral[i:], held=held)
    if found.gain * found.time_constant < 0 and abs(found.time_constant) > track.time[i] - track.time[i - 1]:
        return {}
    return {
        "K": Merit(found.gain, "1/s", "rate of turn for each angle of the rudder, Nomoto"),
        "T": Merit(found.time_constant, "s", "time constant of turning, Nomoto; negative: unstable"),
        "nomoto_deviation": Merit(float(np.degrees(found.deviation)), "°", "of the heading from the model, rms"),
    }


def _zero(orders: np.ndarray, rates: np.ndarray) -> float | None:
    """The order where the rate changes its sign, interpolated."""
    k = np.flatnonzero(np.sign(rates[1:]) != np.sign(rates[:-1]))
    if not len(k):
        return None
    a, b = k[0], k[0] + 1
    return float(orders[a] - rates[a] * (orders[b] - orders[a]) / (rates[b] - rates[a]))
