"""The figure of the page on integrable systems: their integrals over 10⁶ steps, in half a minute.

Run as: python docs/figures/integrable.py; it writes docs/figures/integrable.png.
"""

from pathlib import Path

import numpy as np
from PIL import Image

import coadjoint as co
from coadjoint.models import catalogue
from coadjoint.plotting import style

STEPS, SAVE_EVERY, WINDOWS = 10**6, 50, 40
SYSTEMS = {
    "kovalevskaya_top": ("Kovalevskaya", "kovalevskaya_integral"),
    "goryachev_chaplygin_top": ("Goryachev–Chaplygin", "chaplygin_integral"),
    "clebsch_body": ("Clebsch", "clebsch_integral"),
}


def draw() -> None:
    """Run and draw: bands and means of energy and last integral in windows, and the Casimir functions' errors."""
    figure = style.canvas(style.PAGE, 3.4)
    grid = figure.add_gridspec(2, 4, width_ratios=(1, 1, 1, 1.4))
    last = figure.add_subplot(grid[:, 3])
    for i, (name, (label, integral)) in enumerate(SYSTEMS.items()):
        entry = catalogue[name]
        system = entry.make()
        casimirs = co.mechanics.casimirs(system)
        system = system.watching(casimirs)
        run = co.simulate(system, entry.start(system), dt=entry.dt, steps=STEPS, save_every=SAVE_EVERY)
        print(f"{run}\n")
        for row, (quantity, title) in enumerate((("energy", "energy"), (integral, "last integral"))):
            axis = figure.add_subplot(grid[row, i])
            values = run.dataset[quantity].values
            change = (values / values[0] - 1)[:-1].reshape(WINDOWS, -1)
            middle = (np.arange(WINDOWS) + 0.5) * STEPS / WINDOWS
            axis.fill_between(middle, change.min(axis=1), change.max(axis=1), color=style.COLOURS[i], linewidth=0)
            axis.plot(middle, change.mean(axis=1), color="black", linewidth=0.8)
            axis.ticklabel_format(style="sci", scilimits=(0, 0), useMathText=True)
            axis.set_title(f"{label}\n{title}" if row == 0 else title, pad=16)
        axis.set_xlabel("steps N")
        rows = np.array([run.dataset[key] for key in casimirs])
        errors = np.max(np.abs(rows - rows[:, :1]) / np.maximum(np.abs(rows[:, :1]), 1.0), axis=0)
        steps = np.arange(0, STEPS + 1, SAVE_EVERY)
        last.loglog(steps[20::20], np.maximum.accumulate(errors)[20::20], color=style.COLOURS[i])
    n = np.array([20 * SAVE_EVERY, STEPS])
    last.loglog(n, 2**-53 * np.sqrt(n), color="0.5", linewidth=0.8, linestyle=":", label=r"$2^{-53}\sqrt{N}$")
    last.set_xlabel("steps N")
    last.set_title("Casimir functions,\nlargest error so far")
    last.legend(loc="lower right")
    target = Path(__file__).parent / "integrable.png"
    style.save(figure, target)
    Image.open(target).convert("RGB").quantize(64).save(target, optimize=True)


if __name__ == "__main__":
    with style.style():
        draw()
