"""The figure and the table of the page on identification: two vehicles, 100 noisy logs of each.

Run as: python docs/figures/identification.py; it prints how often intervals covered the truth, and writes
docs/figures/identification.png, in some minutes.
"""

import sys
from pathlib import Path
from typing import Any

import numpy as np

import coadjoint as co
import coadjoint_vehicles as vehicles
from coadjoint.identification import identify, synthetic_log
from coadjoint.paths import paths
from coadjoint.plotting import style
from coadjoint_vehicles import Craft

NOISE = {
    **dict.fromkeys(("north", "east"), 0.1), "depth": 0.02,
    **dict.fromkeys(("roll", "pitch"), 0.005), "heading": 0.01,
    **dict.fromkeys(("u", "v", "w"), 0.01), **dict.fromkeys(("p", "q", "r"), 0.003),
}  # fmt: skip
"""Standard deviations: m, rad, m/s, rad/s."""


def zigzag(t, period, size, late=0.0):
    """Between −size and size."""
    return size * np.sign(np.sin(2 * np.pi * (t - late) / period) + 1e-12)


def torpedo():
    """REMUS 100: zigzags of fins and propeller for 200 s; (system, start, run, where the search begins, parameters)."""
    craft = Craft(vehicles.load("remus_100"))
    t = np.arange(0.0, 200.0, 0.1)
    commands = {
        "rudder": zigzag(t, 16, 0.14) + zigzag(t, 7, 0.07),
        "stern_planes": zigzag(t, 11, 0.10, -3) + zigzag(t, 5, 0.08),
        "propeller": 18 + zigzag(t, 23, 5) + zigzag(t, 9, 2),
    }
    start = craft.start(position=(0, 0, 20), speed=1.5, actuators={"propeller": 18.0})
    inputs = {name: co.Held(t, values) for name, values in commands.items()}
    run = co.simulate(craft.system, start, dt=0.05, duration=199.9, inputs=inputs, save_every=2, monitors=False)
    p: Any = craft.system.parameters
    guess = craft.system.replace(
        hull={"axial_drag": 0.6, "crossflow_drag": 0.8},
        damping={"linear": p.damping.linear * [1, 1, 1, 1.4, 0.7, 1]},
        added_mass=1.3 * p.added_mass,
    )
    names = ["hull.axial_drag", "hull.crossflow_drag", "damping.linear[3]", "damping.linear[4]", "added_mass"]
    return craft.system, start, run, guess, names


def hovering():
    """BlueROV2 Heavy: random thrusts along and about all axes for 150 s."""
    craft = Craft(vehicles.load("bluerov2_heavy_von_benzon"))
    p: Any = craft.system.parameters
    random = np.random.default_rng(3)
    t = np.arange(0.0, 150.0, 1.5)
    wanted = random.uniform(-1, 1, (len(t), 6)) * [1, 1, 1, 0.5, 0.5, 0.6]
    shares = np.linalg.pinv(p.thrusters.allocation / np.abs(p.thrusters.allocation).max(axis=1, keepdims=True))
    widths = np.clip(220 * wanted @ shares.T, -250, 250)
    widths = 1500 + np.where(np.abs(widths) < 30, np.copysign(40.0, widths), widths)
    start = craft.start(position=(0, 0, 20), actuators={"thrusters": widths[0]})
    inputs = {"thrusters": co.Held(t, widths)}
    run = co.simulate(craft.system, start, dt=0.05, duration=149.9, inputs=inputs, save_every=2, monitors=False)
    guess = craft.system.replace(
        damping={"quadratic": 0.7 * p.damping.quadratic, "linear": 1.4 * p.damping.linear},
        added_mass=p.added_mass * np.where(np.eye(6) > 0, 1.3, 1.0),
    )
    names = ["damping.quadratic", "damping.linear", *[f"added_mass[{i},{i}]" for i in range(6)]]
    return craft.system, start, run, guess, names


def truth(system, name):
    """The value of a parameter or of one of its entries."""
    key, _, index = name.rstrip("]").partition("[")
    return float(np.asarray(paths(system.parameters)[key])[tuple(map(int, index.split(","))) if index else ()])


def coverage(vehicle, seeds):
    """What was found from each of the logs."""
    system, start, run, guess, names = vehicle
    found = [
        identify(guess, synthetic_log(run, noise=NOISE, seed=seed), start=start, parameters=names)
        for seed in range(seeds)
    ]
    print(f"\n| {system.name} | truth | mean | mean half width | covered |\n|---|---|---|---|---|")
    for name in found[0].estimates:
        right = truth(system, name)
        each = [one[name] for one in found]
        mean, half = np.mean([e.value for e in each]), np.mean([(e.high - e.low) / 2 for e in each])
        print(f"| `{name}` | {right:.4g} | {mean:.4g} | {half:.2g} | {sum(e.covers(right) for e in each)} of {seeds} |")
    return found


def draw(found, system, path):
    """Left: measured and simulated for half a minute; right: the intervals of all logs over the truth."""
    names = ["hull.axial_drag", "hull.crossflow_drag", "damping.linear[4]", "added_mass[1,1]", "added_mass[5,5]"]
    with style.style():
        figure = style.canvas(style.PAGE, 4.2)
        subfigures: Any = figure.subfigures(1, 2, width_ratios=[1, 1.15])
        left, right = subfigures
        panels = left.subplots(3, 1, sharex=True)
        log, simulated = found[0].log, found[0].simulated
        rows = log.time < 40
        for axes, (name, unit, factor) in zip(
            panels, (("u", "m/s", 1.0), ("pitch", "°", 180 / np.pi), ("r", "°/s", 180 / np.pi)), strict=True
        ):
            axes.plot(log.time[rows], factor * log.columns[name][rows], ".", ms=2, color=style.COLOURS[5])
            axes.plot(log.time[rows], factor * simulated[name][rows], lw=0.8, color=style.COLOURS[6])
            axes.set_ylabel(f"{name} ({unit})")
        panels[0].set_title("REMUS 100: measured (dots) and simulated (line)", fontsize=7.5)
        style.time_axis(panels, [log.time[rows]])
        columns = right.subplots(1, len(names), sharey=True)
        for axes, name in zip(columns, names, strict=True):
            true = truth(system, name)
            for seed, one in enumerate(found):
                e = one[name]
                colour = style.COLOURS[0] if e.covers(true) else style.COLOURS[1]
                axes.plot([100 * (e.low / true - 1), 100 * (e.high / true - 1)], [seed, seed], lw=0.8, color=colour)
            axes.axvline(0, color=style.COLOURS[6], lw=0.6)
            axes.set_title(name.replace("_", "\n", 1), fontsize=6.5)
            axes.locator_params(axis="x", nbins=3)
            axes.tick_params(axis="x", labelsize=6)
            axes.set_xlabel("off by %")
        columns[0].set_ylabel("number of the log")
        right.suptitle("95 % intervals about the truth; those that miss it in orange", fontsize=7.5)
    style.save(figure, path, dpi=150)


if __name__ == "__main__":
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    first = torpedo()
    draw(coverage(first, seeds), first[0], Path(__file__).with_suffix(".png"))
    coverage(hovering(), seeds)
