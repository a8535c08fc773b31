"""The figure of the page on energy: midpoint, energy–momentum and variable step on the paper's vehicle, in seconds.

Run as: python docs/figures/energy.py; it writes docs/figures/energy.png.
"""

from pathlib import Path

import numpy as np

import coadjoint as co
from coadjoint.models import catalogue
from coadjoint.plotting import style

METHODS = {
    "Midpoint": (co.Midpoint(), "energy"),
    "EnergyMomentum": (co.EnergyMomentum(), "energy"),
    "VariableStep, discrete energy": (co.methods.VariableStep(), "discrete_energy"),
    "VariableStep, Legendre energy": (co.methods.VariableStep(), "energy"),
}


def draw() -> None:
    """Run and draw."""
    entry = catalogue["underwater_vehicle"]
    vehicle = entry.make()
    figure = style.canvas(style.PAGE, 2.8)
    errors, steps = figure.subplots(1, 2)
    for i, (label, (method, energy)) in enumerate(METHODS.items()):
        found = co.simulate(vehicle, entry.start(vehicle), dt=0.01, steps=50_000, method=method, save_every=20).dataset
        change = np.abs(found[energy] / found[energy][0] - 1)
        errors.semilogy(found.time, np.maximum(change, 1e-17), color=style.COLOURS[i], label=label, linewidth=0.8)
        if energy == "discrete_energy":
            steps.plot(found.time, found.step_size, color=style.COLOURS[i], linewidth=0.8)
    errors.set(xlabel="time [s]", ylabel="relative energy error", ylim=(1e-17, 1.0))
    errors.legend(loc="upper left", fontsize=6)
    steps.set(xlabel="time [s]", ylabel="h of the variable step [s]")
    figure.savefig(Path(__file__).with_suffix(".png"), dpi=150)


if __name__ == "__main__":
    draw()
