"""The tanker KVLCC2 that ships, and its turning circles and zigzags next to those that MARIN measured.

The vehicle `kvlcc2` has the coefficients of the model of 7 m by Yasukawa and Yoshimura (2015). The measured tracks are
those of MARIN's free-running model of that length for the workshop SIMMAN 2008, scaled to 320 m: data/01_raw/kvlcc2 of
https://github.com/martinlarsalbert/wPCC_pipeline, commit be1c14f, which states no licence. They are not part of this
library.

Run as: python docs/figures/kvlcc2.py [FOLDER]; it prints the table of docs/validation.md and, with the folder of the
measured tracks, writes docs/figures/kvlcc2.png.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import coadjoint as co
import coadjoint_vehicles as vehicles
from coadjoint.plotting import style
from coadjoint_vehicles import Craft
from coadjoint_vehicles.controllers import Trial
from coadjoint_vehicles.parts.mmg import Mmg
from coadjoint_vehicles.trials import Track, analyse

SPEED, SHIP = 1.179, 320.0
"""m/s of the model, 15.5 knots of the ship of 320 m."""
MEASURED_REVOLUTIONS = 620 / 60
"""1/s, which MARIN's model had."""
STEP = 0.02
"""s."""


def balanced(revolutions: float | None = None) -> Mmg:
    """Hull, propeller and rudder that keep SPEED ahead: as printed, or at other revolutions, 1/s, with their R'_0."""
    part, n = vehicles.load("kvlcc2").part("rudder"), revolutions
    assert isinstance(part, Mmg)
    pressure = 0.5 * part.length * part.draught * SPEED**2
    push, ratio = (1 - part.thrust_deduction) * part.diameter**4, SPEED * (1 - part.wake[0]) / part.diameter
    k = part.thrust
    if n is None:  # push (k₀ n² + k₁ n ratio + k₂ ratio²) = pressure R'_0
        n = float(max(np.roots([k[0], k[1] * ratio, k[2] * ratio**2 - pressure * part.resistance / push])))
    return replace(part, revolutions=n, resistance=push * (k[0] * n**2 + k[1] * n * ratio + k[2] * ratio**2) / pressure)


def flown(manoeuvre: str, rudder: float, revolutions: float | None = None, duration: float = 100.0) -> Track:
    """The track of a turning circle or a zigzag, rudder in °, positive to starboard first; executed at 1 s."""
    trial = Trial(manoeuvre=manoeuvre, rudder=np.radians(rudder), begin=1.0, speed=SPEED, period=STEP)
    one = Craft(replace(vehicles.load("kvlcc2"), parts=(balanced(revolutions),)), controller=trial)
    wanted = {"depth": 0.0, "heading": 0.0, "speed": SPEED}
    run = co.simulate(one.system, one.start(speed=SPEED), dt=STEP, duration=duration, inputs=wanted)
    assert one.controller is not None
    return Track.of(run.dataset.assign_attrs(one.controller.attributes()))


def next_order(manoeuvre: str, order: float, heading: float) -> float:
    """That of a zigzag is reversed once the heading is off by the angle of the rudder, on its side."""
    return -order if manoeuvre == "zigzag" and heading * np.sign(order) > abs(order) else order


MEASURED = {
    ("turning_circle", 35): "tc_-35", ("turning_circle", -35): "tc_35", ("zigzag", 10): "zz_-10",
    ("zigzag", -10): "zz_10", ("zigzag", 20): "zz_-20", ("zigzag", -20): "zz_20",
}  # fmt: skip
"""The file of each manoeuvre, by its rudder, °, positive to starboard; in the files it is positive to port."""


def read(folder: Path, manoeuvre: str, rudder: int) -> Track:
    """A measured track: rows with the same time, of three digits, are averaged.

    The execute is where the rudder has moved by 0.3°; a turn ends where it is put back.
    """
    lines = (folder / f"MARIN_FREE_KVLCC2_{MEASURED[manoeuvre, rudder]}_m.dat").read_text("latin-1").splitlines()
    rows = np.array([line.split() for line in lines if len(line.split()) == 11], dtype=float)
    time, same = np.unique(rows[:, 0], return_inverse=True)
    columns = [np.bincount(same, rows[:, j]) / np.bincount(same) for j in (1, 2, 4, 5, 6, 9)]
    north, east, heading, along, across, angle = columns
    heading, angle = np.radians(heading), -np.radians(angle)
    speed = along * np.cos(heading) + across * np.sin(heading)
    orders = np.zeros(len(time))
    for k in range(int(np.argmax(np.abs(angle - angle[0]) > np.radians(0.3))), len(time)):
        orders[k] = next_order(manoeuvre, orders[k - 1] or np.radians(rudder), heading[k])
    turned = np.flatnonzero(np.abs(angle) > 0.9 * abs(np.radians(rudder)))
    kept = slice(None, turned[-1] if manoeuvre == "turning_circle" else None)
    return Track(manoeuvre, *(one[kept] for one in (time, north, east, heading, speed, orders)), length=SHIP)


FIGURES = {
    "turning_circle": ("advance", "transfer", "tactical_diameter"),
    "zigzag": ("initial_turning", "first_overshoot", "second_overshoot"),
}


def figures(track: Track) -> dict[str, float]:
    """Distances in lengths of the ship, angles in °."""
    found = analyse(track)
    assert track.length is not None
    unit = {name: track.length if found.merits[name].unit == "m" else 1.0 for name in FIGURES[track.manoeuvre]}
    return {name: found[name] / one for name, one in unit.items()}


def figure(manoeuvres: dict[tuple[str, int], list[Track]]) -> Figure:
    """Tracks of the turning circles and headings of the zigzags: measured in black, of the two models in blue."""
    fig = style.canvas(style.PAGE, 3.6)
    grid = fig.add_gridspec(2, 2)
    circle, *zigzags = fig.add_subplot(grid[:, 0]), fig.add_subplot(grid[0, 1]), fig.add_subplot(grid[1, 1])
    looks = ({"color": "black"}, {"color": style.COLOURS[0], "linestyle": ":"}, {"color": style.COLOURS[0]})
    for (manoeuvre, rudder), tracks in manoeuvres.items():
        for track, look in zip(tracks, looks, strict=True):
            assert track.length is not None and track.begin is not None
            if manoeuvre == "turning_circle":
                along, aside = track.ahead_and_aside[track.first :].T / track.length
                shown = np.abs(track.turned[track.first :]) < np.radians(400)
                circle.plot(aside[shown], along[shown], linewidth=0.9, **look)
            else:
                after = (track.time - track.begin) * np.sqrt(SHIP / track.length)
                shown = (after > -10) & (after < 520)
                ax = zigzags[0 if abs(rudder) == 10 else 1]
                ax.plot(after[shown], np.degrees(track.heading[shown]), linewidth=0.9, **look)
    circle.set(xlabel="across / L", ylabel="ahead / L", aspect="equal", title="35°")
    for ax, angle in zip(zigzags, (10, 20), strict=True):
        ax.set(ylabel="heading (°)", title=f"{angle}°/{angle}°")
    zigzags[1].set_xlabel("time of the ship (s)")
    return fig


def main(folder: Path | None) -> None:
    manoeuvres: dict[tuple[str, int], list[Track]] = {}
    for manoeuvre, rudder in MEASURED:
        tracks = [flown(manoeuvre, rudder, n, duration=125.0) for n in (None, MEASURED_REVOLUTIONS)]
        tracks = tracks if folder is None else [read(folder, manoeuvre, rudder), *tracks]
        manoeuvres[manoeuvre, rudder] = tracks
        columns = [figures(track) for track in tracks]
        print(f"{manoeuvre.replace('_', ' ')}, {rudder}°")
        for name in columns[0]:
            print(f"  {name:20s}", *(f"{one[name]:8.2f}" for one in columns))
    if folder is not None:
        style.save(figure(manoeuvres), Path(__file__).with_suffix(".png"))


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else None)
