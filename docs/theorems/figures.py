"""The figures of the pages in docs/theorems: both sides of each theorem, and how far they are apart.

Run as: python docs/theorems/figures.py
"""

from __future__ import annotations

from pathlib import Path

import jax
import jax.numpy as jnp
import matplotlib
import numpy as np

import coadjoint as co
from coadjoint import theory
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.plotting.style import COLOURS

matplotlib.use("Agg")
import matplotlib.pyplot as plt

FIGURES = Path(__file__).parents[1] / "figures"
METHOD = co.methods.GroupVariational(co.Exponential(), start="velocity")


def save(figure, name: str) -> None:
    figure.savefig(FIGURES / f"theorem_{name}.png", dpi=110)
    plt.close(figure)


def two(
    title: str, times, left, right, label_left: str, label_right: str, name: str
) -> None:
    """Both sides above, their difference below."""
    figure, (above, below) = plt.subplots(
        2, 1, figsize=(7, 4.6), sharex=True, layout="constrained"
    )
    above.plot(times, left, lw=2.5, color=COLOURS[1], label=label_left)
    above.plot(times, right, ".", ms=4, color=COLOURS[0], label=label_right)
    above.legend(
        frameon=False, ncols=2, loc="lower right", bbox_to_anchor=(1, 1), fontsize=9
    )
    above.set_title(title, loc="left", fontsize=10)
    below.semilogy(
        times, np.maximum(np.abs(left - right), 1e-18), ".", ms=4, color=COLOURS[0]
    )
    below.set(xlabel="step k", ylabel="|difference|", ylim=(1e-18, 1e-12))
    save(figure, name)


def kelvin_noether() -> None:
    def body(xi, n, nu, a):
        turning = 0.5 * xi @ np.diag([1.0, 1.6, 2.2]) @ xi + 0.2 * nu[0] * xi[1]
        return (
            turning
            + 0.5 * nu @ np.diag([2.0, 2.5, 3.0]) @ nu
            + 0.4 * n @ a
            - a @ np.array([0.1, 0.0, 0.5])
        )

    system, method, h = (
        co.System(co.SO3(), body, additional=co.Defining(), advected=co.Defining()),
        co.Midpoint(),
        0.1,
    )
    start = system.state(
        q=[0.2, 0.0, 0.5], qdot=[0.3, -0.1, 0.2], xi=[0.5, 0.9, -0.3], a0=[0, 0, 1]
    )
    noether = co.mechanics.KelvinNoether(
        [1.0, 0.5, 0.2], lambda c, a: jnp.cross(c, a) + c, co.Defining()
    )
    records = co.simulate(system, start, dt=h, steps=100, method=method).records

    def sides(record):
        source = method.sources(system, record, h)[0]
        return noether.paper_quantity(system, method, record, h), noether.momentum_map(
            system, record
        ) @ source

    quantity, source = evaluate(jax.vmap(sides), records)
    labels = "(P51)$_k$ − (P51)$_{k−1}$", "⟨K$_k$, ∂Λ/∂a ⋄ a$_k$⟩"
    two(
        "Theorem 7",
        np.arange(1, 101),
        np.diff(quantity),
        source[1:],
        *labels,
        "kelvin_noether",
    )


def poisson() -> None:
    def top(f, a, h):
        coupling = a[0] * (f[1, 0] - f[0, 1]) + 0.5 * a[1] * (f[2, 1] - f[1, 2])
        return (
            jnp.trace((jnp.eye(3) - f) @ np.diag([2.0, 1.5, 0.4])) / h
            - h * a[2]
            + 0.5 * coupling
        )

    figure, (above, below) = plt.subplots(
        2, 1, figsize=(7, 4.6), sharex=True, layout="constrained"
    )
    h, k = 0.1, np.arange(2, 100)
    for parameter, color in zip(("left", "right"), COLOURS, strict=False):
        l = theory.PoissonLagrangian(co.SO3(), co.Defining(), top, parameter)
        system = theory.poisson_system(l)
        start = system.state(
            g=co.attitude.zyx(0, 0.1, 0.4), xi=[0.3, 0.2, 1.4], a0=[0, 0, 1]
        )
        records = co.simulate(system, start, dt=h, steps=100, method=METHOD).records
        links = theory.PoissonLink(np.swapaxes(records.memory.F, 1, 2), records.a)
        K = np.cross(np.swapaxes(records.g, 1, 2) @ np.array([1.0, 0, 0]), records.a)[
            1:100
        ]
        before, here = (
            theory.PoissonLink(links.f[cut], links.a[cut])
            for cut in (slice(0, 99), slice(1, 100))
        )
        both = jax.vmap(
            lambda b, n, K, l=l: theory.kelvin_noether_poisson(l, b, n, K, h)
        )
        quantity, change = evaluate(both, before, here, K)
        above.plot(
            k,
            np.diff(quantity),
            lw=1.2,
            color=color,
            label=f"I$_{{k+1}}$ − I$_k$, {parameter} end",
        )
        above.plot(
            k,
            change[:-1],
            ".",
            ms=4,
            color=color,
            label=f"−⟨D₂l⋄a$_k$, K$_k$⟩, {parameter} end",
        )
        apart = np.abs(np.diff(quantity) - change[:-1])
        below.semilogy(k, np.maximum(apart, 1e-18), ".", ms=4, color=color)
    above.legend(
        frameon=False, ncols=2, fontsize=8, loc="lower right", bbox_to_anchor=(1, 1)
    )
    above.set_title("Theorem 5.1", loc="left", fontsize=10)
    below.set(xlabel="step k", ylabel="|difference|", ylim=(1e-18, 1e-12))
    save(figure, "poisson")


def moser_veselov() -> None:
    D = np.diag([1.5, 0.8, 0.2])
    system = co.System(
        co.SO3(), group_lagrangian=lambda F, h: jnp.trace((jnp.eye(3) - F) @ D) / h
    )
    figure, panels = plt.subplots(1, 3, figsize=(9, 3.4), layout="constrained")
    for panel, speed in zip(panels, (0.4, 1.2, 2.6), strict=True):
        for tilt in (0.15, 0.3, 0.5, 0.7):
            start = system.state(xi=[0.5 * tilt, tilt, speed])
            try:
                records = co.simulate(
                    system, start, dt=1.0, steps=1500, method=METHOD, monitors=False
                ).records
            except co.errors.StepError:
                continue
            mu = records.mu / np.linalg.norm(records.mu[0])
            panel.plot(mu[:, 0], mu[:, 1], ".", ms=1.2)
        panel.add_patch(plt.Circle((0, 0), 1, fill=False, lw=0.6, color="0.6"))
        panel.set(
            aspect="equal", xlabel="μ₁/|μ|", title=f"{np.degrees(speed):.0f}° a step"
        )
    panels[0].set_ylabel("μ₂/|μ|")
    save(figure, "moser_veselov")


def core(F, d, a, depth, h):
    D, M = np.diag([1.5, 0.8, 0.2]), np.diag([1.5, 1.8, 2.2])
    kinetic = (
        jnp.trace((jnp.eye(3) - F) @ D)
        + 0.5 * d @ M @ d
        + 0.1 * d[0] * (F[2, 1] - F[1, 2])
    )
    return kinetic / h + h * (0.3 * (depth + 0.5 * a @ d) - 0.4 * a[2])


def four_settings() -> None:
    def unreduced(g, q, g_next, q_next, a0, h):
        return core(g.T @ g_next, g.T @ (q_next - q), g.T @ a0, q @ a0, h)

    h, steps, down = 0.1, 200, np.array([0.0, 0.0, 1.0])
    L = theory.UnreducedLagrangian(
        co.SO3(), unreduced, additional=co.Defining(), advected=co.Defining()
    )
    system = theory.reduce(L)
    start = system.state(
        q=[0.5, -0.2, 0.8], qdot=[0.4, -0.3, 0.6], xi=[0.9, 0.4, 1.5], a0=down
    )
    run = co.simulate(system, start, dt=h, steps=steps, method=METHOD)
    path, links = theory.Configuration(run.records.g, run.records.q), None
    links = theory.reduced_path(system.places, path, down)
    first = theory.Link(*(x[0] for x in links[:4]))
    found = {}
    for name, group in (
        ("SE(3)", co.SE3()),
        ("semidirect product", co.SemidirectProduct(co.SO3(), co.Defining())),
    ):
        other = co.System(
            group,
            advected=co.spaces.Dual(),
            group_lagrangian=lambda F, a, h: core(F[0], F[1], a[:3], a[3], h),
        )
        a = np.append(first.a, path.q[0] @ down)
        link = theory.Link((first.F, first.s - first.n), np.zeros(0), np.zeros(0), a)
        left = evaluate(
            lambda link, other=other: theory.left_momenta(other, link, h), link
        )
        velocity = np.concatenate([start.xi, (first.s - first.n) / h])
        state = other.state(
            g=(path.g[0], path.q[0]), xi=velocity, a0=np.append(down, 0.0)
        )
        state = state.replace(mu=left.mu, pi=left.pi, from_velocities=False)
        method = co.methods.GroupVariational(co.Exponential())
        found[name] = theory.Configuration(
            *co.simulate(other, state, dt=h, steps=steps, method=method).records.g
        )
    ends = [theory.Configuration(path.g[k], path.q[k]) for k in (0, 1)]
    found["unreduced"] = theory.discrete_euler_lagrange_algorithm(
        L, *ends, down, h, steps
    )
    again = theory.discrete_euler_poincare_algorithm(system, first, h, steps)
    found["reduced and reconstructed"] = theory.reconstruct(
        system.places, path.g[0], again
    )
    figure, axes = plt.subplots(figsize=(7, 3.2), layout="constrained")
    way = np.max(np.abs(path.q))
    for name, other in found.items():
        apart = np.maximum(
            np.max(np.abs(other.g - path.g), axis=(1, 2)),
            np.max(np.abs(other.q - path.q), axis=1) / way,
        )
        thick = name == "SE(3)"  # the semidirect product lies on it
        axes.semilogy(
            np.maximum(apart, 1e-17),
            label=name,
            lw=3.0 if thick else 1.2,
        )
    axes.set(xlabel="step k", ylabel="distance from SO(3) with ℝ³", ylim=(1e-17, 1e-11))
    axes.legend(frameon=False, fontsize=9, loc="upper left", ncols=2)
    save(figure, "four_settings")


if __name__ == "__main__":
    for draw in (kelvin_noether, poisson, moser_veselov, four_settings):
        draw()
