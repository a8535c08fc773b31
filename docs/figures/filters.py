"""Figures of the page on filters: a vehicle whose model is wrong by a tenth, and a minute without a DVL.

Run as: python docs/figures/filters.py; it writes docs/figures/filters_nees.png and docs/figures/filters_gap.png.
"""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import chi2

import coadjoint as co
from coadjoint.estimation import Filter, GaussMarkov, InertialState, ModelProcess, RandomWalk, StrapdownProcess
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.plotting import style
from coadjoint.vehicles import sensors

H = 0.1
CURRENT = (0.18, 0.24, 0.0)
"""0.3 m/s."""
COMMANDS: Any = {"stern_planes": 0.0, "rudder": 0.0, "propeller": 25.0}
WRONG = ("added_mass", "hull.axial_drag", "hull.crossflow_drag", "rudder.area", "stern_planes.area", "propeller.thrust")
"""What is too large or too small by a tenth, each by itself."""
NOISE = {"torque": 0.02, "force": 0.2}
"""The roots of the spectral densities, N m √s and N √s, of what pushes the vehicle besides."""
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
    drift = {"water.velocity": GaussMarkov([0.03, 0.03, 0.0], 900.0, mean=CURRENT)}
    if thrust:
        drift["propeller.effectiveness"] = GaussMarkov(thrust, 900.0, mean=1.0)
    noise = {name: factor * size for name, size in NOISE.items()}
    biases = {"hg1700_gyroscope": RandomWalk([1e-9] * 3)} if biased else {}
    return ModelProcess(one.system, start, inputs=COMMANDS, noise=noise, drifting=drift, biases=biases)


@cache
def truth_process():
    """The model of the truth, whose wrong parameters are numbers of its rows."""
    one, start = craft()
    drift = {name: RandomWalk() for name in ("water.velocity", *WRONG)}
    return ModelProcess(one.system, start, inputs=COMMANDS, noise=NOISE, drifting=drift)


def drawn(members, steps, share, seed):
    """True rows (steps + 1, members, size) of the filter's process, with parameters that are wrong by `share`."""
    model, true, random = process(1.0), truth_process(), np.random.default_rng(seed)
    rows = np.repeat(true.example[None], members, axis=0)
    kept = len(true.example) - true.drifting
    at = {name: kept + here.start - true.places["water.velocity"].start for name, here in true.places.items()}
    rows[:, kept : kept + 2] += 0.03 * random.normal(size=(members, 2))
    for name in WRONG:
        here = slice(at[name], at[name] + true.error_sizes[name])
        rows[:, here] *= 1 + share * random.choice([-1.0, 1.0], size=(members, 1))
    roots = np.zeros(true.width)
    roots[true.places["mu"]], roots[true.places["pi"]] = true.densities[:3], true.densities[3:]
    found = [rows]
    for _ in range(steps):
        kicks = roots * np.sqrt(H) * random.normal(size=(members, true.width))
        found.append(true.moved(true.advanced(found[-1], H), kicks))
    return as_seen(model, true, np.stack(found))


def as_seen(model, true, rows):
    """The same attitudes, places and velocities with the momenta that they have in the filter's model."""
    import jax

    size = len(model.example) - 3

    def seen(row):
        motion = true.motion(row)[0]
        here = model.motion(row[: size + 3])[0]
        still = np.zeros(model.width)
        return model._from_velocities(
            row[: size + 3],
            jax.numpy.asarray(still).at[6:12].set(jax.numpy.concatenate([motion.xi - here.xi, motion.nu - here.nu])),
        )

    flat = rows.reshape(-1, rows.shape[-1])
    e = np.asarray(evaluate(jax.vmap(seen), flat))
    return model.moved(flat[:, : size + 3], e).reshape(*rows.shape[:-1], size + 3)


def measured(filter, truth, times, names, random):
    """name → (times, values (K, members, m)) at the rates of the sensors."""
    found = {}
    for name in names:
        one, every = filter._prepared[name], round(1 / (H * RATES[name]))
        rows = truth[every::every]
        flat = rows.reshape(-1, rows.shape[-1])
        values, _ = one.function(np.zeros((len(flat), filter.process.width)), flat)
        noise = random.normal(size=(*rows.shape[:2], len(one.covariance))) @ np.linalg.cholesky(one.covariance).T
        found[name] = times[every::every], values.reshape(*rows.shape[:2], -1) + noise
    return found


RATES = {one.name: float(one.rate) for one in SENSORS}
SPREAD = {"g": 0.01, "q": [1.0, 1.0, 0.1], "xi": 0.005, "nu": 0.03, "water.velocity": [0.03, 0.03, 0.0]}


def wrong_model(members, factor, thrust, seed, steps=600, share=0.1):
    """(times, NEES (K, members), its degrees of freedom) of attitude, place, momenta and current."""
    model = process(factor, thrust)
    known = {one.name: sensors.measurement(one) for one in SENSORS}
    spread = {**SPREAD, "propeller.effectiveness": thrust} if thrust else SPREAD
    filter = Filter(model, model.example, measurements=known, deviations=spread, members=members)
    truth, random = with_ones(drawn(members, steps, share, seed), thrust), np.random.default_rng(seed + 1000)
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
    values, vectors = np.linalg.eigh(P)
    e = (random.normal(size=(len(rows), len(P))) * np.sqrt(np.maximum(values, 0.0))) @ vectors.T
    return model.moved(rows, e)


# A minute without a DVL.


def moving(model, rows):
    """(R (…, 3, 3), v, q (…, 3)) of rows of a model, in space."""
    import jax

    def of(row):
        motion = model.motion(row)[0]
        R = motion.g
        return R, R @ motion.nu, motion.q

    found = evaluate(jax.vmap(of), rows.reshape(-1, rows.shape[-1]))
    return tuple(np.asarray(part).reshape(*rows.shape[:-1], *np.shape(part)[1:]) for part in found)


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
    R, v, q = moving(model, truth)
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
    xi = np.asarray(evaluate(_rates(model), truth.reshape(-1, truth.shape[-1]))).reshape(*truth.shape[:2], 3)
    noisy = xi + bias[:, :3] + np.sqrt(N) * random.normal(size=xi.shape)
    filter.rows = first(model, truth[0], filter.P[0] * _not_biases(model), random)
    found = filter.run({**seen, "gyro": (times[1:], noisy[1:])}, dt=H, until=times[-1], save_every=10)
    ours = moving(model, found.rows)[2]
    ins = inertial_alone(known, seen, times, readings, (R[0], v[0], q[0]), members, random)
    at = round(begin)
    errors = [(one - q[::10])[..., :2] for one in (ours, ins)]
    return found.t, *(np.linalg.norm(e - e[at], axis=-1) for e in errors)


def _rates(model):
    import jax

    return jax.vmap(lambda row: model.motion(row)[0].xi)


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


FACTOR, THRUST = 8.0, 0.2
"""The least of 3, 4, 5, 6 and 8 times the noise by which the ellipsoids hold 95 % of 20 wrong vehicles (seed 7)."""
FREE = 14


def figure_of_nees():
    """The mean NEES of 100 others (seed 10), with the right noise and with that of the matched model."""
    members, fig = 100, style.canvas(style.PAGE, 2.8)
    axes = fig.subplots()
    low, high = chi2.ppf([0.025, 0.975], members * FREE) / members
    shown = ((FACTOR, THRUST, 0.1, "model wrong by 10 %, noise for it"), (1.0, 0.0, 0.0, "matched model"))
    for factor, thrust, share, label in shown:
        t, nees = wrong_model(members, factor, thrust, 10, share=share)
        axes.plot(t[1:], nees.mean(axis=1)[1:], label=label)
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
        (line,) = axes.plot(t[here], np.sqrt(np.mean(drift[here] ** 2, axis=1)), label=f"{label}, RMS of 20")
        axes.plot(t[here], drift[here][:, :5], color=line.get_color(), alpha=0.25, linewidth=0.7)
    axes.set(xlabel="time (s), without DVL from 120 s on", ylabel="horizontal drift (m)")
    axes.legend(fontsize=8)
    return fig


if __name__ == "__main__":
    folder = Path(__file__).parent
    style.save(figure_of_nees(), folder / "filters_nees.png")
    style.save(figure_of_the_gap(), folder / "filters_gap.png")
