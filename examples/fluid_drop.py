"""An elliptical drop of an ideal fluid in the plane, as a right-invariant system on SL(2).

Run as: python examples/fluid_drop.py [duration in s]
It prints the certificate, compares with Newton's equation of the particles, and writes fluid_drop.png.

The affine flows x = F(t)X with det F = 1 are a subgroup of the diffeomorphisms that keep areas, and move a drop without
forces as an ideal fluid does, with zero pressure on its edge. With the right velocity U = ḞF⁻¹ and the advected moments
S = FS₀Fᵀ of the drop the Lagrangian is ½ tr(U S Uᵀ): Euler's equation, restricted to this subgroup. What is
conserved by invariance is the circulation, Kelvin's theorem.
"""

import sys

import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from scipy.integrate import solve_ivp

import coadjoint as co

duration = float(sys.argv[1]) if len(sys.argv) > 1 else 4.0
group = co.groups.SLn(2)


class Moments(co.spaces.Space):
    """Symmetric matrices S ↦ FSFᵀ, row by row."""

    def ambient(self, group):
        return 4

    def act(self, group, g, x):
        F = group.matrix(g)
        return jnp.ravel(F @ jnp.reshape(x, (2, 2)) @ F.T)


def lagrangian(xi, a):
    U = group.hat(xi)
    return 0.5 * jnp.trace(U @ jnp.reshape(a, (2, 2)) @ U.T)


with co.float64():
    spin = np.asarray(group.vee(np.array([[0.0, -1.0], [1.0, 0.0]])))
    U0 = np.array([[0.5, -1.1], [0.3, -0.5]])
    xi = np.asarray(group.vee(U0))
drop = co.System(group, lagrangian, advected=Moments(), invariance="right", name="fluid drop")
drop = drop.watching({"angular_momentum": lambda state: state.mu @ spin})
start = drop.state(xi=xi, a0=[1, 0, 0, 1])
run = co.simulate(drop, start, dt=0.01, duration=duration, method=co.Suzuki4(co.Midpoint(co.Cayley())))
print(run)


def newton(t, y):
    """F̈ = λF⁻ᵀ, with the pressure's λ such that det F stays."""
    F, V = y.reshape(2, 2, 2)
    back = np.linalg.inv(F)
    A = back @ V
    return np.ravel([V, np.trace(A @ A) / np.sum(back**2) * back.T])


times, F = run.dataset.time.values, run.records.g
exact = solve_ivp(newton, (0, times[-1]), np.ravel([np.eye(2), U0]), "DOP853", times, rtol=1e-12, atol=1e-12).y.T
error = np.max(np.abs(F - exact[:, :4].reshape(-1, 2, 2)))
print(f"largest distance of F from Newton's equation {error:.1e}")

figure, (plane, axes) = plt.subplots(1, 2, figsize=(7, 3), layout="constrained")
circle = np.stack([np.cos(np.linspace(0, 2 * np.pi, 200)), np.sin(np.linspace(0, 2 * np.pi, 200))])
for k in np.linspace(0, len(F) - 1, 5).astype(int):
    plane.plot(*(F[k] @ circle), linewidth=1, label=f"{times[k]:.1f} s")
plane.set(aspect="equal", xlabel="x", ylabel="y", title="the drop")
plane.legend(fontsize=7, ncols=3, loc="upper center", bbox_to_anchor=(0.5, -0.4))
axes.plot(times, np.linalg.svd(F, compute_uv=False), linewidth=1)
axes.set(xlabel="time (s)", ylabel="semi-axes", title="its semi-axes")
figure.savefig("fluid_drop.png", dpi=150)
