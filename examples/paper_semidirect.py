"""Discrete Lagrangians on semidirect products, with parameters, and on principal bundles: from Λ to residuals.

Run as: python examples/paper_semidirect.py [steps]
It prints the residuals of the older paper's equations (B8)–(B36) on runs of the library, how far these differ from its
algorithms, and writes paper_semidirect.png.
"""

import sys

import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

import coadjoint as co
from coadjoint import theory

steps, h = int(sys.argv[1]) if len(sys.argv) > 1 else 300, 0.1
group, V, D = co.SO3(), co.Defining(), np.diag([1.5, 0.8, 0.2])
method = co.methods.GroupVariational(co.Exponential(), start="velocity")
residuals, apart = {}, {}


def show(title, run, difference):
    found = theory.printed_equations(run)
    residuals[title] = [row.largest for row in found if row.equation.startswith("B")]
    apart[title] = np.max(np.abs(difference))
    print(f"{title}: largest difference from the paper's algorithm {apart[title]:.1e}\n{found}\n")


# Theorem 3.1 on SO(3) Ⓢ ℝ³, with f_k = g_{k+1}⁻¹g_k: a body, and a mass on a spring that drags it along
def coupled(f, y, u, h):
    d = u - y
    return (jnp.trace((jnp.eye(3) - f) @ D) + 0.5 * d @ d + 0.1 * d[0] * (f[2, 1] - f[1, 2])) / h - h * (u @ u) / 2


body = theory.semidirect_system(group, V, coupled)
start = body.state(q=[1.0, 0.2, 0.1], qdot=[0.1, 0.5, -0.3], xi=[0.3, 0.4, 1.2])
swung = co.simulate(body, start, dt=h, steps=steps, method=method)
f, u = np.swapaxes(swung.records.memory.F[:steps], 1, 2), swung.records.n
first = theory.SemidirectLink(f[0], f[0] @ u[0], u[1])
own = theory.semidirect_algorithm(group, V, coupled, first, h, steps)
show("semidirect product", swung, own.f - f)


# Theorem 4.1, Euler–Poincaré–Poisson: a heavy top with the direction of gravity as parameter
def heavy(f, a, h):
    return jnp.trace((jnp.eye(3) - f) @ D) / h - h * a[2]


poisson = theory.PoissonLagrangian(group, V, heavy, "left")
top = theory.poisson_system(poisson)
start = top.state(g=co.attitude.zyx(0, 0.1, 0.4), xi=[0.3, 0.2, 1.4], a0=[0, 0, 1])
spun = co.simulate(top, start, dt=h, steps=steps, method=method)
link = theory.PoissonLink(spun.records.memory.F[0].T, spun.records.a[0])
own = theory.poisson_algorithm(poisson, link, h, steps)
show("heavy top", spun, own.a - spun.records.a[:steps])


# Theorem 6.1 on the bundle S¹ × SO(2): a body whose head turns against it, without total momentum
def beanie(xi, x, v, p):
    return 0.5 * p.body * xi[0] ** 2 + 0.5 * p.head * (xi[0] + v[0]) ** 2 + p.spring * jnp.cos(x[0])


bundle = co.System(co.SO2(), beanie, additional=co.Trivial(1), parameters={"body": 2, "head": 1, "spring": 0.3})
start, midpoint = bundle.state(q=[0.4], qdot=[0.9], xi=[-0.3]), co.Midpoint()
cat = co.simulate(bundle, start, dt=h, steps=steps, method=midpoint)
given = {"dt": h, "method": midpoint, "connection": theory.discrete_mechanical_connection(bundle, midpoint, h)}
given |= {"g": cat.records.g, "x": cat.records.n}
found = theory.lagrange_poincare_residual(bundle, start, **given)
residuals["principal bundle"] = [np.max(np.abs(found))]
print("principal bundle: (B35), (B36)", *residuals["principal bundle"])

figure, (axis, sizes) = plt.subplots(1, 2, figsize=(8, 3.4), layout="constrained")
axis.plot(*spun.records.g[:, :2, 2].T, linewidth=0.8)
axis.set_title("axis of the top, from above")
for name, rows in residuals.items():
    sizes.semilogy(np.maximum(rows, 1e-17), "o", label=name)
sizes.set(title="residuals of the printed equations", xlabel="equation", ylim=(1e-17, 1e-8), xticks=[])
sizes.legend()
figure.savefig("paper_semidirect.png", dpi=100)
