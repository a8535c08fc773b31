"""Figures of the page on filters: a model that is wrong by a tenth, a minute without a DVL, and fixes that come late.

Run as: python docs/figures/filters.py, six minutes; it writes filters_nees.png, filters_gap.png and filters_late.png
into docs/figures and prints their numbers.
"""

from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import chi2

import coadjoint as co
from coadjoint.estimation import Filter, GaussMarkov, InertialState, ModelProcess, RandomWalk, StrapdownProcess
from coadjoint.plotting import style
from coadjoint_vehicles import sensors

H = 0.1
CURRENT = (0.18, 0.24, 0.0)
"""0.3 m/s."""
COMMANDS: Any = {"stern_planes": 0.0, "rudder": 0.0, "propeller": 25.0}
WRONG = ("added_mass", "hull.axial_drag", "hull.crossflow_drag", "rudder.area", "stern_planes.area", "propeller.thrust")
"""What is too large or too small by a tenth, each by itself."""
NOISE = {"torque": 0.02, "force": 0.2}
"""The roots of the spectral densities, N m √s and N √s, of what pushes the vehicle besides."""
WATER = GaussMarkov([0.03, 0.03, 0.0], 900.0, mean=CURRENT)
E = sensors.Errors
TACTICAL = sensors.Imu(
    name="hg1700",
    rate=1 / H,
    gyroscope=E(noise_density=np.radians(0.125) / 60, turn_on_bias=np.radians(1.0) / 3600),
    accelerometer=E(noise_density=0.065 * 0.3048 / 60, turn_on_bias=1e-3 * 9.80665),
)
"""Honeywell HG1700, by its brochure N61-1619: 0.125 °/√h, 1 °/h, 0.065 ft/s/√h, 1 mg."""
SENSORS = (
    sensors.Dvl(name="dvl", rate=5.0, velocity=E(noise=0.01), position=(0.3, 0, 0.05)),
    sensors.Depth(name="depth", rate=2.0, depth=E(noise=0.03)),
    sensors.Compass(name="compass", rate=2.0, heading=E(noise=0.02)),
    sensors.Usbl(name="usbl", rate=0.5, beacon=(60.0, 40.0, 2.0), range=E(noise=0.3), direction=E(noise=0.02)),
)


@cache
def craft():
    """REMUS 100 in a current of 0.3 m/s, and its start."""
    one = co.vehicles.Craft(co.vehicles.load("remus_100"), water=co.vehicles.water.UniformWater(CURRENT))
    return one, one.start(position=(0, 0, 20), speed=1.5, actuators={"propeller": 25.0})


@cache
def process(factor, thrust=0.0, biased=False):
    """The model that a filter has, with `factor` times the noise of the truth and a thrust that drifts by `thrust`."""
    one, start = craft()
    drift = {"water.velocity": WATER}
    if thrust:
        drift["propeller.effectiveness"] = GaussMarkov(thrust, 900.0, mean=1.0)
    noise = {name: factor * size for name, size in NOISE.items()}
    biases = {"hg1700_gyroscope": RandomWalk([1e-9] * 3)} if biased else {}
    return ModelProcess(one.system, start, inputs=COMMANDS, noise=noise, drifting=drift, biases=biases)


@cache
def truth_process():
    """The model of the truth, whose wrong parameters are numbers of its rows."""
    one, start = craft()
    drift = {"water.velocity": WATER, **{name: RandomWalk() for name in WRONG}}
    return ModelProcess(one.system, start, inputs=COMMANDS, noise=NOISE, drifting=drift)


def drawn(members, steps, share, seed, normal=False):
    """True rows (steps + 1, members, size) of the filter's process, with parameters that are wrong by ± `share`.

    normal: whether `share` is the standard deviation of normal errors instead.
    """
    model, true, random = process(1.0), truth_process(), np.random.default_rng(seed)
    rows = np.repeat(true.example[None], members, axis=0)
    kept = len(true.example) - true.drifting
    at = {name: kept + here.start - true.places["water.velocity"].start for name, here in true.places.items()}
    rows[:, kept : kept + 2] += 0.03 * random.normal(size=(members, 2))
    for name in WRONG:
        here = slice(at[name], at[name] + true.error_sizes[name])
        rows[:, here] *= 1 + share * (random.normal if normal else partial(random.choice, (-1, 1)))(size=(members, 1))
    found = [rows]
    for _ in range(steps):
        found.append(true.drawn(found[-1], H, random))
    return as_seen(model, true, np.stack(found))


def as_seen(model, true, rows):
    """The same attitudes, places and velocities with the momenta that they have in the filter's model."""
    states = true.state(rows)
    return model.with_velocities(rows[..., : len(model.example)], states.xi, states.nu)


def measured(filter, truth, times, names, random):
    """name → (times, values (K, members, m)) at the rates of the sensors."""
    found, expected = {}, filter.expected(truth)
    for name in names:
        every, R = round(1 / (H * RATES[name])), filter.measurements[name].covariance
        values = expected[name][every::every]
        found[name] = times[every::every], values + random.multivariate_normal(np.zeros(len(R)), R, values.shape[:2])
    return found


RATES = {one.name: float(one.rate) for one in SENSORS}
SPREAD = {"g": 0.01, "q": [1.0, 1.0, 0.1], "xi": 0.005, "nu": 0.03, "water.velocity": [0.03, 0.03, 0.0]}


def wrong_model(members, factor, thrust, seed, steps=600, share=0.1, normal=False):
    """(times, NEES (K, members), its degrees of freedom) of attitude, place, momenta and current."""
    model = process(factor, thrust)
    known = {one.name: sensors.measurement(one) for one in SENSORS}
    spread = {**SPREAD, "propeller.effectiveness": thrust} if thrust else SPREAD
    filter = Filter(model, model.example, measurements=known, deviations=spread, members=members)
    truth, random = with_ones(drawn(members, steps, share, seed, normal), thrust), np.random.default_rng(seed + 1000)
    filter.rows = first(model, truth[0], filter.P[0], random)
    found = filter.run(
        measured(filter, truth, H * np.arange(steps + 1), known, random), dt=H, save_every=10, covariances=True
    )
    e, P = model.errors(found.rows, truth[::10])[..., :14], found.covariances[..., :14, :14]
    return found.t, np.einsum("...i,...i->...", e, np.linalg.solve(P, e[..., None])[..., 0])


def with_ones(rows, thrust):
    """Rows with the effectiveness 1 behind them, where the filter has it."""
    return np.concatenate([rows, np.ones((*rows.shape[:-1], 1))], axis=-1) if thrust else rows


def first(model, rows, P, random):
    """Estimates whose errors are normal with P."""
    return model.moved(rows, random.multivariate_normal(np.zeros(len(P)), P, len(rows)))


# A minute without a DVL.


def moving(states):
    """(R (…, 3, 3), v, q (…, 3)) of states, in space."""
    return states.g, np.einsum("...ij,...j->...i", states.g, states.nu), states.q


def inertial_readings(R, v, random):
    """(what the unit reads over each step, (K, members, 6), means with errors; the biases, (members, 6))."""
    size = R.shape[1]
    phi = co.attitude.rotation_vector(np.swapaxes(R[:-1], -1, -2) @ R[1:])
    change = np.einsum("kmji,kmj->kmi", R[:-1], v[1:] - v[:-1] - [0, 0, 9.81 * H])
    along = [
        np.linalg.solve(mean_turn(one), part)
        for one, part in zip(phi.reshape(-1, 3), change.reshape(-1, 3), strict=True)
    ]
    exact = np.concatenate([phi / H, np.reshape(along, change.shape) / H], axis=-1)
    deviation = TACTICAL.deviation
    once = np.repeat([TACTICAL.gyroscope.turn_on_bias, TACTICAL.accelerometer.turn_on_bias], 3)
    bias = once * random.normal(size=(size, 6))
    return exact + bias + deviation * random.normal(size=exact.shape), bias


def mean_turn(phi):
    """∫₀¹ exp(φ̂s) ds, (3, 3)."""
    angle, x = np.linalg.norm(phi), np.cross(phi, np.eye(3)).T
    if angle < 1e-4:
        return np.eye(3) + 0.5 * x + x @ x / 6
    return np.eye(3) + (1 - np.cos(angle)) / angle**2 * x + (angle - np.sin(angle)) / angle**3 * x @ x


def gap(members, seed, share=0.0, begin=120.0, length=60.0):
    """(times, horizontal drift since the gap began, (K, members) m, of the model, of the inertial unit alone).

    Both have the same unit, depth and compass all the time, and the DVL until `begin`.
    """
    steps, random = round((begin + length) / H), np.random.default_rng(seed + 500)
    model, times = process(1.0, 0.0, True), H * np.arange(steps + 1)
    truth = np.concatenate([drawn(members, steps, share, seed), np.zeros((steps + 1, members, 3))], axis=-1)
    R, v, q = moving(model.state(truth))
    readings, bias = inertial_readings(R, v, random)
    truth[..., -3:] = bias[:, :3]
    N = TACTICAL.deviation[0] ** 2
    gyro = co.estimation.Measurement(lambda m, p, biases: m.xi + biases.hg1700_gyroscope, N)
    known = {one.name: sensors.measurement(one) for one in SENSORS[:3]}
    spread = {
        "g": 0.01,
        "q": 0.1,
        "xi": 0.005,
        "nu": 0.03,
        "water.velocity": [0.03, 0.03, 0.0],
        "hg1700_gyroscope": 5e-6,
    }
    filter = Filter(model, model.example, measurements={**known, "gyro": gyro}, deviations=spread, members=members)
    seen = measured(filter, truth, times, known, random)
    seen["dvl"] = tuple(part[: round(begin * RATES["dvl"])] for part in seen["dvl"])
    xi = model.state(truth).xi
    noisy = xi + bias[:, :3] + np.sqrt(N) * random.normal(size=xi.shape)
    filter.rows = first(model, truth[0], filter.P[0] * _not_biases(model), random)
    found = filter.run({**seen, "gyro": (times[1:], noisy[1:])}, dt=H, until=times[-1], save_every=10)
    ours = found.states.q
    ins = inertial_alone(known, seen, times, readings, (R[0], v[0], q[0]), members, random)
    at = round(begin)
    errors = [(one - q[::10])[..., :2] for one in (ours, ins)]
    return found.t, *(np.linalg.norm(e - e[at], axis=-1) for e in errors)


def _not_biases(model):
    keep = np.ones(model.width)
    keep[model.places["hg1700_gyroscope"]] = 0.0
    return np.outer(keep, keep)


def inertial_alone(known, seen, times, readings, start, members, random):
    """Places (K, members, 3) by the readings of the unit and what else is measured."""
    noise = {"gyroscope": TACTICAL.gyroscope.noise_density, "accelerometer": TACTICAL.accelerometer.noise_density}
    unit = StrapdownProcess(noise=noise)
    first_row = unit.row(InertialState(0.0, *(part[0] for part in start)))
    spread = {"attitude": 0.01, "velocity": 0.03, "position": 0.1}
    spread |= {"gyroscope_bias": np.radians(1.0) / 3600, "accelerometer_bias": 9.80665e-3}
    filter = Filter(unit, first_row, measurements=known, deviations=spread, members=members)
    rows = np.stack([unit.row(InertialState(0.0, *(part[i] for part in start))) for i in range(members)])
    e = random.normal(size=(members, unit.width)) * np.sqrt(np.diag(filter.P[0]))
    e[:, 9:] = 0.0
    filter.rows = unit.moved(rows, e)
    found = filter.run(seen, dt=H, until=times[-1], inputs={"imu": (times[:-1], readings)}, save_every=10)
    return found.rows[..., 13:16]


# Fixes that come late.

DELAY = 2.0
"""s, of the fixes of the USBL."""
LEGS = {"heading": [0.5, 2.1, 3.6, 5.2], "depth": [10.0, 14.0, 12.0, 10.0]}
"""Set points, rad and m, of 75 s each."""


@cache
def flown(seconds):
    """The commands at the beginning of each step, name → (steps,), by which the controller flies the legs."""
    vehicle = co.vehicles.load("remus_100")
    one = co.vehicles.Craft(vehicle, controller=vehicle.controller, water=co.vehicles.water.UniformWater(CURRENT))
    start = one.start(position=(0, 0, 10), speed=1.5, actuators={"propeller": 25.0})
    wanted = {name: co.Held(75.0 * np.arange(4), values) for name, values in LEGS.items()}
    run = co.simulate(one.system, start, dt=H, duration=seconds, inputs={**wanted, "speed": 1.5})
    return {name: run.dataset[f"internal_controller_value_{name}"].values[:-1] for name in COMMANDS}


def late(members, seed, delay, seconds=300, names=("depth", "compass", "usbl"), dated=True):
    """(times, how far the estimate of each time is from the truth then, (K, members) m), on line, with a delay.

    The fixes of the USBL come `delay` after they were taken; dated: whether the filter is told when that was.
    """
    steps, random, commands = round(seconds / H), np.random.default_rng(seed), flown(seconds)
    model, behind, every = process(1.0), round(delay / H), {name: round(1 / (H * RATES[name])) for name in names}
    seen = {one.name: sensors.measurement(one) for one in SENSORS if one.name in names}
    filter = Filter(
        model, model.example, measurements=seen, deviations=SPREAD, members=members, memory=delay + 0.5 if dated else 0
    )
    rows = [first(model, filter.rows, filter.P[0], random)]
    for k in range(steps):
        now = {name: values[k] for name, values in commands.items()}
        rows.append(model.drawn(model.with_inputs(rows[-1], now), H, random))
    truth = np.stack(rows)
    read = {name: values[:: every[name]] for name, values in filter.expected(truth).items()}
    for name, values in read.items():
        R = seen[name].covariance
        read[name] = values + random.multivariate_normal(np.zeros(len(R)), R, values.shape[:2])
    known = []
    for k in range(1, steps + 1):
        filter.predict(H, {name: values[k - 1] for name, values in commands.items()})
        for name in names:
            taken = k - behind if name == "usbl" else k
            if taken > 0 and taken % every[name] == 0:
                t = H * taken if dated else None
                filter.update({name: read[name][taken // every[name]]}, t=t)
        known.append(filter.rows.copy())
    off = model.state(np.stack(known)).q - model.state(truth[1:]).q
    return H * np.arange(1, steps + 1), np.linalg.norm(off, axis=-1)


FACTOR, THRUST = 4.0, 0.2
"""The least of FACTORS times the noise by which the ellipsoids hold 95 % of 20 wrong vehicles (seed 7)."""
FACTORS = (3.0, 4.0, 5.0, 6.0, 8.0)
FREE = 14


def held(factor, members=20, seed=7):
    """Which share of wrong vehicles the nominal 95 % ellipsoids hold, of a filter with `factor` times the noise."""
    _, nees = wrong_model(members, factor, THRUST, seed)
    return float(np.mean(nees < chi2.ppf(0.95, FREE)))


def figure_of_nees():
    """The mean NEES of 100 others (seed 10), with the right noise and with that of the matched model."""
    members, fig = 100, style.canvas(style.PAGE, 2.8)
    axes = fig.subplots()
    low, high = chi2.ppf([0.025, 0.975], members * FREE) / members
    shown = ((FACTOR, THRUST, 0.1, "model wrong by 10 %, noise for it"), (1.0, 0.0, 0.0, "matched model"))
    for factor, thrust, share, label in shown:
        t, nees = wrong_model(members, factor, thrust, 10, share=share)
        mean = nees.mean(axis=1)[1:]
        inside, contained = np.mean((low < mean) & (mean < high)), np.mean(nees < chi2.ppf(0.95, FREE))
        print(f"{label}: mean NEES {mean.min():.2f} to {mean.max():.2f} of {FREE}, in its band at {inside:.0%} of the")
        print(f"  times, below its end at {np.mean(mean < high):.0%}; ellipsoids hold {contained:.1%}")
        axes.plot(t[1:], mean, label=label)
    axes.axhspan(low, high, color="0.85", label="95 % band of the mean of 100")
    axes.set(xlabel="time (s)", ylabel="mean NEES of 14 numbers", ylim=(8, 20))
    axes.legend(fontsize=8, ncols=3, loc="upper center")
    return fig


def figure_of_the_gap():
    """The drift of 20 vehicles in the minute without a DVL, by their model and by the inertial unit alone."""
    t, ours, ins = gap(20, 3)
    fig = style.canvas(style.PAGE, 2.8)
    axes = fig.subplots()
    here = t >= 120
    for drift, label in ((ins, "inertial unit alone"), (ours, "model of the vehicle")):
        print(f"A minute without a DVL, {label}: {root_mean_square(drift[-1]):.2f} m")
        (line,) = axes.plot(t[here], np.sqrt(np.mean(drift[here] ** 2, axis=1)), label=f"{label}, RMS of 20")
        axes.plot(t[here], drift[here][:, :5], color=line.get_color(), alpha=0.25, linewidth=0.7)
    axes.set(xlabel="time (s), without DVL from 120 s on", ylabel="horizontal drift (m)")
    axes.legend(fontsize=8)
    return fig


def figure_of_late_fixes():
    """How far the estimate is from the truth, by fixes at once, late with their times, and late taken as new ones."""
    fig = style.canvas(style.PAGE, 2.8)
    axes = fig.subplots()
    shown = (
        (DELAY, False, "2 s late, taken as of now"),
        (0.0, True, "at once"),
        (DELAY, True, "2 s late, with their times"),
    )
    for delay, dated, label in shown:
        t, off = late(20, 5, delay, dated=dated)
        print(f"Fixes {label}: {root_mean_square(off[AFTER:]):.3f} m after {H * AFTER:g} s")
        axes.semilogy(t, np.sqrt(np.mean(off**2, axis=1)), label=label, linewidth=1.0)
    axes.set(xlabel="time (s)", ylabel="RMS error of the place (m)")
    axes.legend(fontsize=8)
    return fig


AFTER = 600
"""From which step on errors count: before, the filter finds its place."""


def root_mean_square(values):
    """√ of the mean of the squares."""
    return float(np.sqrt(np.mean(np.square(values))))


if __name__ == "__main__":
    folder = Path(__file__).parent
    print("Of 20 wrong vehicles are held: " + ", ".join(f"{held(one):.1%} by {one:g} times" for one in FACTORS))
    _, nees = wrong_model(100, FACTOR, THRUST, 10, normal=True)
    print(f"Of errors that are normal: mean NEES {nees.mean():.0f}, {np.mean(nees < chi2.ppf(0.95, FREE)):.1%} held")
    style.save(figure_of_nees(), folder / "filters_nees.png")
    style.save(figure_of_the_gap(), folder / "filters_gap.png")
    style.save(figure_of_late_fixes(), folder / "filters_late.png")
