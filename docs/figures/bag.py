"""The figure of the page on logs: a dive of REMUS 100 in a bag, the model that comes of it, and what it leaves.

Run as: python docs/figures/bag.py; it writes docs/figures/bag.png, in some seconds.
"""

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

import coadjoint as co
import coadjoint_vehicles as vehicles
from coadjoint.identification import identify, synthetic_log
from coadjoint.plotting import style
from coadjoint_vehicles import Craft
from coadjoint_vehicles.logs import read_log, write_log

NOISE = {
    **dict.fromkeys(("north", "east"), 0.1), "depth": 0.02,
    **dict.fromkeys(("roll", "pitch"), 0.005), "heading": 0.01,
    **dict.fromkeys(("u", "v", "w"), 0.01), **dict.fromkeys(("p", "q", "r"), 0.003),
}  # fmt: skip
"""Standard deviations: m, rad, m/s, rad/s."""
TRUE = {"hull.axial_drag": 0.42, "hull.crossflow_drag": 1.1, "added_mass[1,1]": 29.4376, "added_mass[5,5]": 3.4262}
SHOWN = (("u", "m/s", 1.0), ("pitch", "°", 180 / np.pi), ("r", "°/s", 180 / np.pi), ("depth", "m", 1.0))


def zigzag(t: np.ndarray, period: float, size: float) -> np.ndarray:
    """Between −size and size."""
    return size * np.sign(np.sin(2 * np.pi * t / period) + 1e-12)


def dive(folder: Path, seed: int) -> Path:
    """A bag of 60 s with zigzags of fins and propeller, and noise of all sensors."""
    craft = Craft(vehicles.load("remus_100"))
    t = np.arange(0.0, 60.0, 0.1)
    commands = {
        "rudder": zigzag(t, 16, 0.14) + zigzag(t, 7, 0.07),
        "stern_planes": zigzag(t, 11, 0.10) + zigzag(t, 5, 0.08),
        "propeller": 18 + zigzag(t, 23, 5) + zigzag(t, 9, 2),
    }
    start = craft.start(position=(0, 0, 20), speed=1.5, actuators={"propeller": 18.0})
    inputs = {name: co.Held(t, values) for name, values in commands.items()}
    run = co.simulate(craft.system, start, dt=0.05, duration=59.9, inputs=inputs, save_every=2, monitors=False)
    path = folder / "dive.mcap"
    write_log(synthetic_log(run, noise=NOISE, seed=seed), path)
    return path


def model(path: Path) -> Any:
    """What a bag tells of REMUS 100, sought from parameters that are up to 40 % off."""
    craft, log = Craft(vehicles.load("remus_100")), read_log(path)
    p: Any = craft.system.parameters
    scale = np.ones((6, 6))
    scale[1, 1] = scale[5, 5] = 1.3
    guess = craft.system.replace(hull={"axial_drag": 0.6, "crossflow_drag": 0.8}, added_mass=scale * p.added_mass)
    start = craft.start(actuators={"propeller": 18.0})  # where actuators stand as the dive begins
    return identify(guess, log, start=start, parameters=list(TRUE))


def draw(logs: list[Any], path: Path) -> None:
    """Measured and simulated, what is left, both of the first log, and the intervals of all about the truth."""
    found = logs[0]
    figure = style.canvas(style.PAGE, 4.4)
    parts: Any = figure.subfigures(1, 2, width_ratios=[2.2, 1.0])
    panels = parts[0].subplots(len(SHOWN), 2, sharex=True)
    time = found.log.time
    for (fit, rest), (name, unit, factor) in zip(panels, SHOWN, strict=True):
        fit.plot(time, factor * found.log.columns[name], ".", ms=1.5, color=style.COLOURS[5])
        fit.plot(time, factor * found.simulated[name], lw=0.8, color=style.COLOURS[6])
        fit.set_ylabel(f"{name} ({unit})")
        noise = factor * found.noise[name]
        rest.plot(time, factor * found.residuals[name], ".", ms=1.5, color=style.COLOURS[0])
        rest.axhspan(-2 * noise, 2 * noise, color=style.COLOURS[0], alpha=0.15, lw=0)
    panels[0, 0].set_title("in the bag (dots), simulated (line)", fontsize=7.5)
    panels[0, 1].set_title("residuals, and twice the noise found", fontsize=7.5)
    for axes in panels[-1]:
        axes.set_xlabel("time (s)")
    right = parts[1].subplots()
    for row, (name, true) in enumerate(TRUE.items()):
        for i, one in enumerate(log[name] for log in logs):
            low, value, high = (100 * (x / true - 1) for x in (one.low, one.value, one.high))
            colour, at = style.COLOURS[0 if one.covers(true) else 1], row + 0.13 * (i - 0.5 * (len(logs) - 1))
            right.plot([low, high], [at, at], lw=1.4, color=colour)
            right.plot([value], [at], "o", ms=2.5, color=colour)
    right.axvline(0, color=style.COLOURS[6], lw=0.6)
    right.set_yticks(range(len(TRUE)), [name.replace(".", ".\n") for name in TRUE], fontsize=6.5)
    right.invert_yaxis()
    right.set(xlabel="off the truth by %")
    right.set_title("95 % intervals", fontsize=7.5)
    style.save(figure, path, dpi=150)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder, style.style():
        logs = [model(dive(Path(folder), seed)) for seed in range(1, 6)]
        draw(logs, Path(__file__).with_suffix(".png"))
