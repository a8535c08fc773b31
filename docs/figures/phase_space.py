"""The figure of the section on phase-space Lagrangians: 10⁶ steps with and without the projection, in ten seconds.

Run as: python docs/figures/phase_space.py; it writes docs/figures/phase_space.png.
"""

from pathlib import Path

import jax.numpy as jnp
import numpy as np
from PIL import Image

import coadjoint as co
from coadjoint.audit.systems import guiding_centre, predators
from coadjoint.errors import StepError
from coadjoint.plotting import style

STEPS, SAVE_EVERY, WINDOWS = 10**6, 50, 40
PROJECTED = co.methods.ProjectedMidpoint()


def energy(q):
    x, y = q[..., 0], q[..., 1]
    return x + y - 2 * np.log(x) - np.log(y)


def unprojected(dt: float) -> np.ndarray:
    """The energy errors of the midpoint rule as a discrete Lagrangian, up to the step that fails."""

    def midpoint(xi, n, s, h):
        m, v = (n + s) / 2, (s - n) / h
        theta = jnp.stack([jnp.log(m[1]) / m[0] + m[1], m[0]])
        return h * (theta @ v - (m[0] + m[1] - 2 * jnp.log(m[0]) - jnp.log(m[1])))

    system, start = predators()
    first = co.simulate(system, start, dt=dt / 50, steps=50, method=PROJECTED).final.q
    discrete = co.System(co.Translation(0), discrete_lagrangian=midpoint, additional=co.Trivial(2))
    begun = discrete.state(q=[1.0, 1.0], qdot=(first - 1) / dt)
    try:
        run = co.simulate(discrete, begun, dt=dt, steps=20_000, method=co.Variational(start="velocity"), accuracy=False)
    except StepError as error:
        run = error.run
    return np.abs(energy(run.records.q) - 2)


def draw() -> None:
    figure = style.canvas(style.PAGE, 2.9)
    growth, orbit, band = figure.subplots(1, 3)
    system, start = predators()
    free = unprojected(0.05)
    kept = co.simulate(system, start, dt=0.05, steps=STEPS, method=PROJECTED, accuracy=False)
    errors = np.abs(energy(kept.records.q) - 2)
    for values, name, colour in ((free, "midpoint rule", 1), (errors, "projected", 0)):
        at = np.unique(np.geomspace(10, len(values) - 1, 60).astype(int))
        growth.loglog(at, np.maximum.accumulate(values)[at], color=style.COLOURS[colour], label=name)
    growth.set(xlabel="steps N", title="Lotka–Volterra,\nlargest energy error so far")
    growth.legend()

    system, trapped = guiding_centre()
    for colour, (name, u) in enumerate({"trapped": 0.4, "passing": 1.2}.items()):
        run = co.simulate(system, system.state(q=[1.2, 0, u]), dt=0.1, steps=3000, method=PROJECTED)
        orbit.plot(*run.records.q[:, :2].T, color=style.COLOURS[colour], label=name, linewidth=0.8)
    orbit.set(xlabel="R", ylabel="Z", title="guiding centres\nin a tokamak", aspect="equal")
    orbit.legend(loc="center")

    run = co.simulate(system, trapped, dt=0.1, steps=STEPS, save_every=SAVE_EVERY, method=PROJECTED, accuracy=False)
    values = run.dataset.energy.values
    change = (values / values[0] - 1)[:-1].reshape(WINDOWS, -1)
    middle = (np.arange(WINDOWS) + 0.5) * STEPS / WINDOWS
    band.fill_between(middle, change.min(axis=1), change.max(axis=1), color=style.COLOURS[0], linewidth=0)
    band.plot(middle, change.mean(axis=1), color="black", linewidth=0.8)
    band.ticklabel_format(style="sci", scilimits=(0, 0), useMathText=True)
    band.set_xlabel("steps N")
    band.set_title("energy of the trapped ion,\nbands and means", pad=16)
    target = Path(__file__).parent / "phase_space.png"
    style.save(figure, target)
    Image.open(target).convert("RGB").quantize(64).save(target, optimize=True)


if __name__ == "__main__":
    with style.style():
        draw()
