"""Kovalevskaya's top, which spins as it hangs, is swung up to spin upright with the least effort.

Run as: python examples/top_swung_up.py [duration in s]
The torque a × u at its fixed point is horizontal, as a is the upward direction in the body: the momentum about the
vertical, μ·a, is conserved. At first it hangs, a = −e₁, at last it stands, a = e₁, and turns about the vertical alone:
    min ∫ ½|u|² dt,    μ' = μ × ω + mgl a × e₁ + a × u,    a' = a × ω,    μ = Jω,    J = diag(2C, 2C, C).
It prints the effort and that momentum, and writes top_swung_up.png."""

import sys

import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

import coadjoint as co
from coadjoint.models import integrable_tops

duration, steps, spin = float(sys.argv[1]) if len(sys.argv) > 1 else 1.2, 80, 4.0  # s, -, rad/s
model = integrable_tops.kovalevskaya(mass=1.0, lever=0.2, axial=0.04)
top = co.System(
    co.SO3(),
    model.lagrangian,
    advected=co.Defining(),
    parameters=model.parameters.asdict(),
    forces=lambda motion, p: co.Force(torque=jnp.cross(motion.a, motion.inputs.u)),
)
hanging = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
start = integrable_tops.start(top, rotation=hanging, angular_velocity=(spin, 0.0, 0.0))


def swing(motion):
    """Springs and a damper that bring the top up: e₁ to a, with a push aside as it hangs in balance."""
    return jnp.array([-2.5, 0.15, 0.3]) + 0.15 * jnp.cross(motion.a, motion.xi)


few = {"dt": duration / steps / 10, "steps": 10 * steps, "save_every": 10, "monitors": False, "accuracy": False}
optimum = co.control.Problem(
    top,
    start,
    dt=duration / steps,
    steps=steps,
    inputs={"u": co.control.Input((3,))},
    cost=lambda motion, p: 0.5 * motion.inputs.u @ motion.inputs.u,
    end=lambda motion, p: jnp.concatenate([motion.a[1:] / (1 + motion.a[0]), motion.xi[1:]]),  # and not a = −e₁
).solve(guess=co.simulate(top, start, inputs={"u": swing}, **few))
print(optimum)
run = optimum.run.records
vertical = np.sum(run.mu * run.a, axis=1)
print(f"effort {optimum.cost:.5f} N²m²s; momentum about the vertical {vertical[0]:.4f} to {vertical[-1]:.4f} kg m²/s")

figure = plt.figure(figsize=(7.2, 3.4), layout="constrained")
space, plane = figure.add_subplot(1, 2, 1, projection="3d", computed_zorder=False), figure.add_subplot(1, 2, 2)
u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 37), np.linspace(0, np.pi, 19))
space.plot_wireframe(np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v), color="0.9", linewidth=0.4)
space.plot(*run.g[:, :, 0].T, "C0", linewidth=2)  # e₁ in space
space.plot(*run.g[[0, -1], :, 0].T, "ko", markersize=4)
space.set_axis_off()
space.set_box_aspect((1, 1, 1), zoom=1.3)
space.set_title("way of the mass centre")
middle = run.t[:-1] + 0.5 * duration / steps
for name, column in zip(("$u_1$", "$u_2$", "$u_3$"), optimum.inputs["u"].T, strict=True):
    plane.plot(middle, column, label=name)
plane.plot(run.t, run.a[:, 0], "k--", label="$a_1$")
plane.set(xlabel="time (s)", ylabel="u (N m); height $a_1$")
plane.legend(frameon=False)
figure.savefig("top_swung_up.png", dpi=110)
