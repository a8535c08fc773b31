"""A chain that is folded in two and let go at one end: the end falls faster than a stone.

Run as: python examples/falling_chain.py [number of links: 41]
It prints how long the end takes to fall by 0.9 of the length, against a stone and the continuum, and its greatest
acceleration, and writes falling_chain.png: the chain at some times, and the fall of its end.

Each link is a rod on a ball joint: three rows for a link, solved by blocks, so that the cost grows as their number.
Of a continuous chain that keeps its energy the end has fallen by x with v² = 2gx(1 − x/2L)/(1 − x/L): Calkin and
March, Am. J. Phys. 57 (1989) 154.
"""

import sys

import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from scipy.integrate import quad

import coadjoint as co

count = int(sys.argv[1]) if len(sys.argv) > 1 else 41
length, gravity = 1.0, 9.81
half = 0.5 * length / count
end, inertia = np.array([0, 0, half]), np.array([1.0, 1.0, 0.02]) * half**2 / 3  # of links of 1 kg


def lagrangian(xi, n, nu, a):
    return 0.5 * jnp.sum(inertia * xi**2) + 0.5 * jnp.sum(nu**2) - gravity * jnp.sum(n * a.z)


def joints(n, a):
    """From the lower end of the link before to the upper end of each, in space."""
    axes = jnp.stack([a.x, a.y, a.z], axis=1)
    upper, lower = (jnp.einsum("ikj,ij->ik", axes, n + sign * end) for sign in (1, -1))
    return jnp.ravel(upper - jnp.concatenate([jnp.zeros((1, 3)), lower[:-1]]))


chain = co.System(
    co.Power(co.SO3(), count, coupling="chain"),
    lagrangian,
    additional=co.Defining(),
    advected={name: co.Defining() for name in "xyz"},
    constraints={"joints": co.Holonomic(joints)},
    name="falling chain",
)
middle = count // 2
angles = np.where(np.arange(count) < middle, 0.0, np.pi)
angles[middle] = np.pi / 2  # the link at the fold lies
g = np.array([co.attitude.zyx(0, -angle, 0) for angle in angles])
downs = -g[:, :, 2]  # along each link, away from the support
q = np.cumsum(2 * half * downs, axis=0) - half * downs
a0 = {name: np.tile(e, (count, 1)) for name, e in zip("xyz", np.eye(3), strict=True)}
dt = 4e-4
run = co.simulate(chain, chain.state(g=g, q=q, a0=a0), dt=dt, duration=0.38, accuracy=False)
print(run)

R, centres = run.records.g, run.records.q.reshape(-1, count, 3)
lower = centres - half * R[..., 2]
fallen, t = lower[0, -1, 2] - lower[:, -1, 2], np.asarray(run.records.t)
whole = 2 * half * (2 * middle)  # the length without the link at the fold
times = np.interp(0.9 * whole, fallen, t)
smooth = quad(lambda s: 0.5 * np.sqrt((1 - s) / (s * (1 - s / 2))), 0, 0.9)[0] * np.sqrt(2 * whole / gravity)
stone = np.sqrt(2 * 0.9 * whole / gravity)
print(f"the end falls by 0.9 of the length in {times:.4f} s; continuum {smooth:.4f} s, stone {stone:.4f} s")
faster = np.max(np.diff(fallen[: np.searchsorted(t, times)], 2)) / dt**2 / gravity
print(f"its acceleration comes to {faster:.1f} g")

figure, (left, right) = plt.subplots(1, 2, figsize=(10, 5))
for place, k in enumerate(np.linspace(0, len(t) - 1, 7).astype(int)):
    x, _, z = np.concatenate([np.zeros((1, 3)), lower[k]]).T
    left.plot(x + 0.12 * place, z, "-o", ms=2, lw=1, label=f"{t[k]:.2f} s")
left.set(xlabel="x (m), shifted from time to time", ylabel="z (m)", aspect="equal", title="the chain")
left.legend(fontsize=8, loc="lower left")
right.plot(t, fallen, label="end of the chain")
right.plot(t, np.minimum(0.5 * gravity * t**2, whole), "--", label="stone")
right.set(xlabel="t (s)", ylabel="fallen (m)", title="fall of the end")
right.legend()
figure.tight_layout()
figure.savefig("falling_chain.png", dpi=110)
