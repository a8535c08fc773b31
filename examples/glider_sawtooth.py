"""The best sawtooth of an underwater glider: least energy for the way, with buoyancy and pitch mass as inputs.

Run as: python examples/glider_sawtooth.py [longest dive in s]
A Slocum in its vertical plane: lift and drag by the angle of attack α, a net weight and a mass on a rail, which counts
by its weight alone. A dive of T seconds ends U T further on, at its first depth, with the mirror image of its start,
which is free: dives and climbs go on for ever, and what drag takes is what the pump puts in. Long ones come to the
steady glide, tan ξ = D/L, of least energy a metre, D/cos ξ with D = (K_D0 + K_D α²) V², U = V cos ξ. It prints
energies and ξ amid dives, and writes glider_sawtooth.png."""

import sys

import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import minimize_scalar

import coadjoint as co
from coadjoint.control import Input, Measured, Problem

longest, U = float(sys.argv[1]) if len(sys.argv) > 1 else 240.0, 0.3  # s, m/s
glider = co.vehicles.load("slocum_graver")
hull, rail, pump = (glider.part(name) for name in ("hull", "battery", "pump"))
M, inertia = glider.mass + rail.mass + np.diag(glider.added_mass)[[0, 2]], glider.inertia[1, 1]
mass, heavy = glider.gravity * rail.mass, glider.gravity * glider.fluid_density * np.array([pump.high, pump.rate])
INPUTS = {"net": Input((), -heavy[0], heavy[0], heavy[1]), "shift": Input((), rail.low, rail.high, rail.rate)}  # N, m


def drag_and_lift(alpha):
    return hull.drag[0] + hull.drag[1] * alpha**2, hull.lift[1] * alpha  # at 1 m/s


def lagrangian(omega, n, v, down, p):
    return 0.5 * v @ (M * v) + 0.5 * inertia * omega @ omega + mass * rail.position[2] * down[1]


def forces(motion, p):
    v, down, speed = motion.nu, motion.a, jnp.sqrt(motion.nu @ motion.nu)
    drag, lift = drag_and_lift(alpha := jnp.arctan2(v[1], v[0]))
    moment = speed**2 * (hull.pitch[2] * motion.xi - hull.pitch[1] * alpha)  # positive: nose down
    push = speed * (lift * jnp.stack([v[1], -v[0]]) - drag * v)
    return co.Force(moment + mass * motion.inputs.shift * down[1], push + motion.inputs.net * down)


def dissipated(motion, p):
    square, (drag, _) = motion.nu @ motion.nu, drag_and_lift(jnp.arctan2(motion.nu[1], motion.nu[0]))
    return square * (drag * jnp.sqrt(square) - hull.pitch[2] * motion.xi @ motion.xi)


def effort(alpha):
    return drag_and_lift(alpha)[0] * U**2 * (1 + np.divide(*drag_and_lift(alpha)) ** 2) ** 1.5


def seen(motion, side=1):
    return jnp.stack([side * motion.g[1, 0], motion.nu[0], side * motion.nu[1], side * motion.xi[0]])


vectors = {"additional": co.Defining(), "advected": co.Defining()}
system = co.System(co.SO2(), lagrangian, **vectors, forces=forces, parameters={"begin": np.zeros(4)})
best = minimize_scalar(effort, bounds=(0.01, 0.4), method="bounded", options={"xatol": 1e-10}).x
glide = np.arctan2(*drag_and_lift(best))
c, s, weight, deg = np.cos(glide - best), np.sin(glide - best), effort(best) / np.tan(glide), np.degrees(glide)
start = system.state(g=[[c, -s], [s, c]], q=[0, 0], xi=[0.0], qdot=[U, U * np.tan(glide)], a0=[0, 1])
found, (figure, (track, pumped)) = {}, plt.subplots(2, 1, figsize=(7.2, 5.6), layout="constrained")
for T in longest / 2.0 ** np.arange(3, -1, -1):
    about = {"net": co.Linear([0, T / 2 - 6, T / 2 + 6], [weight, weight, -weight]), "shift": co.Held([0.0], [0.0])}
    optimum = Problem(
        system, start, dt=1.0, duration=T, inputs=INPUTS, cost=dissipated,
        end=lambda motion, p: jnp.append(seen(motion, -1) - p.begin, motion.q - U * motion.t * np.eye(2)[0]),
        free_start=dict.fromkeys(("g", "xi", "qdot"), np.inf), parameters={"begin": (-2.0, 2.0)},
        measured={"begin": Measured(lambda m, p: seen(m) - p.begin, np.zeros((1, 4)), 1e-4, [0.0])},
    ).solve(guess=co.simulate(system, start, dt=1.0, duration=T, inputs=about))  # fmt: skip
    r = optimum.run.records
    found[T] = optimum.cost / (U * T), np.arctan2(*r.qdot[0][::-1]), np.arctan2(*r.nu[0][::-1])
    print(f"{T:g} s: {found[T][0]:.5f} J/m, steady {effort(best):.5f}; {np.degrees(found[T][1]):.3f}°, {deg:.3f}°")
    track.plot(*np.concatenate([r.q, r.q * [1, -1] + [U * T, 0]]).T, label=f"{T:g} s")
    pumped.step(r.t[:-1] / T, optimum.inputs["net"], where="post")
track.set(xlabel="way (m)", ylabel="depth from the middle (m)", ylim=(9, -9))
track.legend(frameon=False, ncols=4)
pumped.set(xlabel="time of a dive", ylabel="net weight (N)")
figure.savefig("glider_sawtooth.png", dpi=110)
