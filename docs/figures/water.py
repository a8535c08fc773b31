"""The figure of the page on water: REMUS 100 goes to and fro in a tidal current over a bottom, for six hours.

Run as: python docs/figures/water.py; it writes docs/figures/water.png, in about a minute.
"""

from pathlib import Path

import numpy as np

import coadjoint as co
import coadjoint_vehicles as vehicles
from coadjoint.plotting import style
from coadjoint_vehicles import Craft
from coadjoint_vehicles.water import GaussMarkovCurrent, PowerLaw, Sea, Sheared, TidalCurrent

HOURS, LEG, BOTTOM = 6.0, 1200.0, 40.0
TIDE = TidalCurrent(["M2"], [[0.4, 0.1, 0.0]], [[0.0, np.pi / 2, 0.0]])
SHEARED = Sheared(TIDE, PowerLaw(BOTTOM))
WATERS = {
    "still water": None,
    "tide over a bottom": SHEARED,
    "with gusts": Sea(tide=SHEARED, gusts=GaussMarkovCurrent((0.08, 0.08, 0.0), 120.0, seed=1)),
}


def mission() -> dict[str, co.Held]:
    """East and west in turn, between 3 m and 35 m, 1.5 m/s through the water."""
    legs = np.arange(0.0, HOURS * 3600, LEG)
    dives = np.arange(0.0, HOURS * 3600, LEG / 4)
    return {
        "heading": co.Held(legs, np.radians(np.where(np.arange(len(legs)) % 2, 270.0, 90.0))),
        "depth": co.Held(dives, np.where(np.arange(len(dives)) % 2, 35.0, 3.0)),
        "speed": co.Held([0.0], [1.5]),
    }


def profile(depth: np.ndarray, t: float) -> np.ndarray:
    """The north part of the tide at a depth and a time, m/s."""
    return 0.4 * np.cos(2 * np.pi * t / TIDE.periods[0]) * np.clip(1 - depth / BOTTOM, 0, 1) ** (1 / 7)


def draw() -> None:
    """Run and draw."""
    vehicle = vehicles.load("remus_100")
    figure = style.canvas(style.PAGE, 3.1)
    track, shape, felt = figure.subplots(1, 3, width_ratios=[1.1, 0.7, 1.2])
    for colour, (label, water) in zip(style.COLOURS, WATERS.items(), strict=False):
        craft = Craft(vehicle, controller=vehicle.controller, water=water)
        start = craft.start(position=(0.0, 0.0, 3.0), speed=1.5, euler_zyx=(np.pi / 2, 0.0, 0.0))
        run = co.simulate(craft.system, start, dt=0.05, duration=HOURS * 3600, inputs=mission(), save_every=100)
        print(label, run, sep="\n")
        found = run.dataset
        t, (north, east, depth) = found.time.values, found.q.values.T
        track.plot(east / 1000, north / 1000, color=colour, label=label, linewidth=0.7)
        if label == "still water":
            continue
        drift = profile(depth, t)
        if "internal_water_gusts_z" in found:
            drift = drift + 0.08 * found.internal_water_gusts_z.values[:, 0]
        felt.plot(t / 3600, drift, color=colour, linewidth=0.5 if "gusts" in label else 1.0, zorder=3 - len(label) / 20)
    track.set(xlabel="east [km]", ylabel="north [km]", aspect="equal", adjustable="datalim")
    track.legend(loc="best", fontsize=6)
    depths = np.linspace(0.0, BOTTOM, 400)
    for hour, line in ((0, "-"), (2, "--"), (4, "-.")):
        shape.plot(profile(depths, hour * 3600.0), depths, "k", linestyle=line, linewidth=0.8, label=f"{hour} h")
    shape.set(xlabel="tide, to the north [m/s]", ylabel="depth [m]", xticks=[-0.4, 0.0, 0.4])
    shape.invert_yaxis()
    shape.legend(fontsize=6)
    felt.plot(t / 3600, profile(np.zeros_like(t), t), "k--", linewidth=0.7)
    felt.set(xlabel="time [h]", ylabel="at the vehicle, to the north [m/s]")
    figure.savefig(Path(__file__).with_suffix(".png"), dpi=150)


if __name__ == "__main__":
    draw()
