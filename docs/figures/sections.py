"""The figure of Poincaré sections: 10⁴ crossings of a Kovalevskaya top and of one that is not integrable, a call each.

Run as: python docs/figures/sections.py; it writes docs/figures/sections.png, in a minute.
"""

from pathlib import Path

import numpy as np
from PIL import Image

import coadjoint as co
from coadjoint.models import heavy_top
from coadjoint.plotting import style

ENERGY, VERTICAL, MEMBERS, STEPS, CROSSINGS = 2.0, 0.6, 30, 66_000, 10_000
TOPS = {"Kovalevskaya, J = (2, 2, 1)": (2.0, 2.0, 1.0), "J = (2, 1.5, 1)": (2.0, 1.5, 1.0)}


def starts(top: co.System, inertia: tuple[float, float, float]) -> co.State:
    """Members with μ₂ = 0 on the level E = 2, μ·a = 0.6, J₁ω₁a₁ + J₃ω₃a₃ = μ·a, ½J₁ω₁² + ½J₃ω₃² + a₁ = E."""
    random, up, omega = np.random.default_rng(1889), [], []
    (J1, _, J3), level = inertia, ENERGY
    while len(up) < MEMBERS:
        a = random.normal(size=3)
        a /= np.linalg.norm(a)
        # ω₃ = (μ·a − J₁ω₁a₁)/(J₃a₃) in the energy: a quadratic equation for ω₁.
        slope, rest = -J1 * a[0] / (J3 * a[2]), VERTICAL / (J3 * a[2])
        roots = np.roots([J1 + J3 * slope**2, 2 * J3 * slope * rest, J3 * rest**2 - 2 * (level - a[0])])
        if np.isreal(roots).all():
            first = float(random.choice(roots.real))
            up.append(a)
            omega.append([first, 0.0, slope * first + rest])
    return top.state(g=np.eye(3), xi=co.each(np.array(omega)), a0=co.each(np.array(up)))


def section(inertia: tuple[float, float, float]) -> list[np.ndarray]:
    """a and μ₁, μ₃ of every member where μ₂ rises through zero, (crossings, 5)."""
    top = heavy_top.make(mass=1.0, center_of_mass=(1, 0, 0), inertia=inertia, gravity=1.0)
    run = co.simulate(
        top, starts(top, inertia), dt=0.05, steps=STEPS, save_every=STEPS, method=co.Suzuki4(co.Midpoint()),
        events={"section": co.Event(lambda state: state.mu[1], "rising")},
    )  # fmt: skip
    print(f"{run}\n")
    found = [np.column_stack([state.a, state.mu[:, [0, 2]]]) for state in run.events["section"]]
    assert sum(map(len, found)) >= CROSSINGS
    return found


def draw() -> None:
    """Both sections, a colour a member: the direction of up in the body, longitude and height."""
    figure = style.canvas(style.PAGE, 3.2)
    for i, (title, inertia) in enumerate(TOPS.items()):
        axis = figure.add_subplot(1, 2, i + 1)
        for k, rows in enumerate(section(inertia)):
            colour = style.COLOURS[k % len(style.COLOURS)]
            axis.plot(np.arctan2(rows[:, 1], rows[:, 0]), rows[:, 2], ".", color=colour, markersize=0.7)
        axis.set_title(title)
        axis.set_xlabel("arg(a₁ + ia₂)")
        axis.set_ylabel("a₃")
    target = Path(__file__).parent / "sections.png"
    style.save(figure, target)
    Image.open(target).convert("RGB").quantize(64).save(target, optimize=True)


if __name__ == "__main__":
    with style.style():
        draw()
