"""The figure of the page on long runs: Kelvin–Noether error and group defect over 10⁸ steps, in about two minutes.

Run as: python docs/figures/long_runs.py [FOLDER]; it writes docs/figures/long_runs.png, and streams the runs to FOLDER
(a temporary one by default; runs that it holds already are gone on with).
"""

import sys
import tempfile
from pathlib import Path

import numpy as np

import coadjoint as co
from coadjoint.models import heavy_top, paper_form
from coadjoint.plotting import style

STEPS, SAVE_EVERY = 10**8, 10**4


def top():
    """The fast heavy top of Brüls, Cardona and Arnold."""
    inertia = (15.234375, 0.46875, 15.234375)
    system = heavy_top.make(mass=15, center_of_mass=(0, 1, 0), inertia=inertia)
    return system, heavy_top.start(system, angular_velocity=(0, 150, -4.61538)), 1e-3


def vehicle():
    """The paper's vehicle, its buoyancy equal to its weight, at the origin without velocity, tilted and turning."""
    masses = {"mass": 123.8, "added_mass": (65, 70, 75), "inertia": (5.46, 5.29, 5.72)}
    system = paper_form.vehicle(**masses, center_of_buoyancy=(0, 0, -0.007))
    attitude = {"euler_zyx": (0.3, 0.4, 0.2), "angular_velocity": np.radians([10, 0, 20])}
    return system, paper_form.start(system, **attitude), 1e-2


def errors(run):
    """Steps, |I − I₀| relative to |μ| + |π⋄n|, and the group defect, each as the largest value so far."""
    found = run.dataset
    scale = np.linalg.norm(found.mu, axis=1)
    if "pi" in found:
        scale = scale + np.linalg.norm(np.cross(found.pi, found.n), axis=1)
    change = np.linalg.norm(found.kelvin_noether - found.kelvin_noether[0], axis=1) / scale
    return found.step.values, np.maximum.accumulate(change), np.maximum.accumulate(found.group_defect.values)


def draw(folder: Path) -> None:
    """Run, or go on, and draw."""
    figure = style.canvas(style.PAGE, 2.6)
    axes = figure.subplots(1, 2)
    for i, (name, make) in enumerate((("heavy top", top), ("vehicle", vehicle))):
        system, start, h = make()
        place = folder / name.replace(" ", "_")
        given = {"dt": h, "steps": STEPS, "save_every": SAVE_EVERY, "store": place}
        run = co.resume(place, system) if place.exists() else co.simulate(system, start, **given)
        print(f"{name}\n{run}\n")
        steps, *series = errors(run)
        for axis, values in zip(axes, series, strict=True):
            axis.loglog(steps[1:], values[1:], color=style.COLOURS[i], label=name)
            slope = np.polyfit(*np.log([steps[1:], values[1:]]), 1, w=1 / np.sqrt(steps[1:]))[0]
            print(f"grows like N^{slope:.2f}")
    for axis, title in zip(axes, ("Kelvin–Noether error", "group defect"), strict=True):
        n = np.geomspace(SAVE_EVERY, STEPS, 2)
        axis.loglog(n, 2**-53 * np.sqrt(n), color="0.5", linewidth=0.8, linestyle=":", label=r"$2^{-53}\sqrt{N}$")
        axis.set_xlabel("steps N")
        axis.set_title(title)
        axis.legend()
    style.save(figure, Path(__file__).parent / "long_runs.png")


if __name__ == "__main__":
    with style.style(), tempfile.TemporaryDirectory() as temporary:
        draw(Path(sys.argv[1] if len(sys.argv) > 1 else temporary))
