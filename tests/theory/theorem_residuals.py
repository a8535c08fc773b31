"""Measures the residuals of docs/theorems.md on random data; used by theorem_table.py."""

from __future__ import annotations

from functools import cache, partial

import jax
import numpy as np
from test_equivalences import statements

import coadjoint as co
import paper
from coadjoint import theory
from coadjoint.kernels.evaluate import evaluate
from coadjoint.mechanics import continuous
from coadjoint.mechanics.bundle import horizontal_lift, reconstructed, reduced
from coadjoint.mechanics.discrete import Point, node
from coadjoint.mechanics.noether import spatial_momentum
from coadjoint.mechanics.poisson import vector_field
from coadjoint.theory.discrete_mechanical_connection import discrete_mechanical_connection
from coadjoint.theory.lagrange_poincare import lagrange_poincare_residual
from discrete import random_group_system, random_path
from systems import GROUPS, MAPS, WORLDS, element, generator, random_system

H = 0.1
FITTING = ("SO2", "SO3", "SE2", "SE3", "SO3xSE2")


def size(*arrays) -> float:
    return max(float(np.max(np.abs(leaf), initial=0.0)) for leaf in jax.tree.leaves(arrays))


def pairs():
    for name in FITTING:
        for label in ("cayley", "exponential", "squared"):
            group, random = GROUPS[name], generator("measure", name, label)
            yield group, MAPS[label], *0.6 * random.normal(size=(3, group.dim))


def largest(function) -> float:
    """The largest |found − expected| / |expected| of function(group, τ, ξ, χ, μ) over groups and maps."""
    worst = 0.0
    for group, tau, xi, chi, mu in pairs():
        found, expected = evaluate(partial(function, group, tau), xi, chi, mu)
        worst = max(worst, size(jax.tree.map(lambda x, y: x - y, found, expected)) / max(size(expected), 1.0))
    return worst


def difference_map() -> float:
    """τ(ξ)τ(−ξ) = e."""
    return largest(lambda g, t, x, c, m: (g.matrix(g.compose(t.tau(g, x), t.tau(g, -x))), g.matrix(g.identity())))


def tangent() -> float:
    """Dτ(ξ)χ = (dτ_ξχ)τ(ξ) and (P33)."""

    def sides(group, tau, xi, chi, mu):
        F, moved = jax.jvp(lambda x: group.matrix(tau.tau(group, x)), (xi,), (chi,))
        carried = group.Ad(tau.tau(group, xi), tau.dtau(group, -xi, chi))
        return (moved, carried), (group.hat(tau.dtau(group, xi, chi)) @ F, tau.dtau(group, xi, chi))

    return largest(sides)


def inverse_tangent() -> float:
    """dτ⁻¹_ξ dτ_ξ = 1 and (P35)."""

    def sides(group, tau, xi, chi, mu):
        back = group.Ad(tau.tau(group, -xi), chi)
        found = tau.dtau_inverse(group, xi, tau.dtau(group, xi, chi)), tau.dtau_inverse(group, -xi, back)
        return found, (chi, tau.dtau_inverse(group, xi, chi))

    return largest(sides)


def coadjoint_operator() -> float:
    """⟨ad*_ξμ, η⟩ = ⟨μ, ad_ξη⟩ with the commutator of matrices."""

    def sides(group, tau, xi, chi, mu):
        X, Y = group.hat(xi), group.hat(chi)
        return mu @ group.ad(xi, chi) + group.ad_dual(xi, mu) @ chi, 2 * mu @ group.vee(X @ Y - Y @ X)

    return largest(sides)


def diamond() -> float:
    """⟨b⋄x, ξ⟩ = −⟨b, ξ·x⟩ on every space of the random systems."""
    worst = 0.0
    for name, world in WORLDS.items():
        system, _ = random_system(name)
        for space in (system.additional, system.advected):
            count = space.ambient(world.group)
            b, x = generator("diamond", name).normal(size=(2, count))
            xi = generator("diamond", name).normal(size=world.group.dim)

            def sides(b, x, xi, space=space, group=world.group):
                return space.diamond(group, b, x) @ xi, -b @ space.infinitesimal(group, xi, x)

            found, expected = evaluate(sides, b, x, xi) if count else (0.0, 0.0)
            worst = max(worst, abs(float(found - expected)) / max(abs(float(expected)), 1.0))
    return worst


def _momentum(system, state, names, *values):
    return spatial_momentum(system, state.replace(**dict(zip(names, values, strict=True))))


@cache
def continuous_rates() -> tuple[float, float]:
    """The rate of the spatial momentum against Ad*_{g⁻¹}(∂_aℓ⋄a) (P28), and {·, ℋ} against the motion (P6)."""
    worst = [0.0, 0.0]
    for world in ("SO3", "SE2", "SL2"):
        system, state = random_system(world)

        def sides(state, system=system):
            slope = continuous.vector_field(system, state)
            names = ("g", "n", "a", "mu", "pi", "xi", "nu")
            values = tuple(getattr(state, name) for name in names)
            along = tuple(getattr(slope, name) for name in names)

            rate = jax.jvp(partial(_momentum, system, state, names), values, along)[1]
            at = node(system, state, Point(state.xi, state.n, state.nu, state.a, state.t))
            expected = system.group.Ad_dual(system.group.inverse(state.g), at.source)
            field = vector_field(lambda s: continuous.energy(system, s), state)
            return rate - expected, (slope.mu - field.mu, slope.n - field.n, slope.a - field.a), (expected, slope.mu)

        momentum, bracket, scale = evaluate(sides, state)
        worst = [max(w, size(x) / size(scale)) for w, x in zip(worst, (momentum, bracket), strict=True)]
    return worst[0], worst[1]


@cache
def printed() -> dict[str, float]:
    """The largest residual of every printed equation over runs in algebra and in group form."""
    found: dict[str, float] = {}
    runs = []
    for world, method in (
        ("SO3", co.LeftRectangle(co.Exponential())),
        ("SE2", co.Midpoint()),
        ("SE3", co.Trapezoidal()),
    ):
        system, start = random_system(world)
        runs.append(co.simulate(system, start, dt=H, steps=12, method=method))
    for world in ("SO3", "SO3 alone", "SO2"):
        system, start = random_group_system(world)
        runs.append(
            co.simulate(system, start, dt=H, steps=12, method=co.GroupVariational(co.Exponential(), "velocity"))
        )
    for run in runs:
        for row in theory.printed_equations(run):
            found[row.equation] = max(found.get(row.equation, 0.0), row.largest)
    return found


def equation(*names: str) -> float:
    return max(printed()[name] for name in names)


@cache
def equivalence() -> float:
    """The largest difference between the four statements, relative to their terms."""
    worst = 0.0
    for world in ("SO3", "SE3", "SL2"):
        system, _ = random_group_system(world)
        four, scale = evaluate(partial(statements, system, theory.unreduce(system)), *random_path(system, world))
        worst = max(worst, float(np.ptp(four) / scale))
    return worst


def reconstruction() -> float:
    """Reduction after reconstruction, and reconstruction after reduction."""
    system, _ = random_group_system("SE3")
    path, _, _, _ = random_path(system, "SE3", nodes=12)
    a0 = {"plane": np.arange(1.0, 5.0), "field": np.arange(6.0)}
    links = theory.reduced_path(system.places, path, a0)
    first = jax.tree.map(lambda leaf: leaf[0], path.g)
    again = theory.reconstruct(system.places, first, links)
    return size(jax.tree.map(lambda x, y: x - y, again, path)) / size(path)


def semidirect(which: str) -> float:
    """(B1)–(B3) against matrices, or (B4)–(B6) against the general formulas."""
    group = co.SemidirectProduct(co.SO3(), co.Defining())
    random = generator("semidirect", which)
    g, h = element(group, random), element(group, random)
    xi, eta, mu = random.normal(size=(3, 6))

    def product(g, h, xi, eta, mu):
        both = group.matrix(group.compose(g, h)), group.hat(group.ad(xi, eta))
        X, Y = group.hat(xi), group.hat(eta)
        return both, (group.matrix(g) @ group.matrix(h), X @ Y - Y @ X)

    def adjoint(g, h, xi, eta, mu):
        R, v = g
        turned = R @ xi[:3]
        forward = jax.numpy.concatenate([turned, R @ xi[3:] - jax.numpy.cross(turned, v)])
        back = jax.numpy.concatenate([R.T @ (mu[:3] + jax.numpy.cross(mu[3:], v)), R.T @ mu[3:]])
        return (group.Ad(g, xi), group.Ad_dual(g, mu)), (forward, back)

    found, expected = evaluate(product if which == "product" else adjoint, g, h, xi, eta, mu)
    return size(jax.tree.map(lambda x, y: x - y, found, expected)) / size(expected)


def cat():
    """Two planar bodies joined at their mass centres: a shape angle on the bundle over SO(2)."""

    def beanie(xi, x, v, p):
        return 0.5 * p.body * xi[0] ** 2 + 0.5 * p.head * (xi[0] + v[0]) ** 2 - 0.3 * jax.numpy.cos(x[0])

    return co.System(co.SO2(), beanie, additional=co.Trivial(1), parameters={"body": 2.0, "head": 1.0})


@cache
def bundle() -> tuple[float, ...]:
    """Reduction and reconstruction; (B35)–(B36) on a run; zero momentum against the horizontal lift; (B35)–(B36) with
    Ω = e; a connection from its global form."""
    system, method = cat(), co.Midpoint()
    start = system.state(q=[0.4], qdot=[0.9], xi=[0.3])
    run = co.simulate(system, start, dt=H, steps=40, method=method)
    connection = discrete_mechanical_connection(system, method, H)
    sigma = reduced(connection, run.records.g, run.records.n)
    again = reconstructed(connection, run.records.g[0], run.records.n, sigma)
    g, x = run.records.g, run.records.n
    plain = co.DiscreteConnection(co.SO2(), 1, lambda x, x_next: jax.numpy.eye(2))
    momenta = size(run.records.mu, run.records.pi)
    left, trivial = (
        size(lagrange_poincare_residual(system, start, dt=H, method=method, connection=c, g=g, x=x)) / momenta
        for c in (connection, plain)
    )
    same = co.DiscreteConnection.from_form(co.SO2(), 1, connection.form)
    ends = np.array([0.3]), np.array([0.5])
    formed = evaluate(lambda x, y: same.increment(x, y) - connection.increment(x, y), *ends)
    still = system.state(q=[0.4], qdot=[0.9], xi=[-0.3])
    lifted = co.simulate(system, still, dt=H, steps=40, method=method)
    horizontal = horizontal_lift(connection, lifted.records.n, lifted.records.g[0])
    lift = size(np.asarray(horizontal) - lifted.records.g)
    return size(again - g), left, lift, trivial, size(formed)


def scheme(name: str) -> float:
    """The left rule with velocity start against the paper's own scheme in NumPy, 40 steps of 0.05 s."""
    tau, own = {"cayley": (co.Cayley(), paper.Cayley()), "exponential": (co.Exponential(), paper.Exponential())}[name]
    system = paper.vehicle()
    start = system.state(q=[0, 0, 1], xi=paper.FAST, qdot=paper.VELOCITY, a0=[0, 0, 1])
    method = co.LeftRectangle(tau, start="velocity")
    last = co.simulate(system, start, dt=0.05, steps=40, method=method).final
    _, (g, n, omega, nu) = paper.run(own, paper.FAST, 0.05, 40)
    return size(last.g - g, last.n - n, last.xi - omega, last.nu - nu) / size(n)


def jacobian(name: str) -> float:
    own = {"cayley": paper.Cayley(), "exponential": paper.Exponential()}[name]
    omega = generator("misprints").normal(size=3)
    expected = evaluate(jax.jacfwd(lambda w: own.f(w, 0.3, jax.numpy)), omega)
    return size(own.jacobian(omega, 0.3) - expected) / size(expected)


def skew_identities() -> float:
    """Lemma 10, (P83) with tr."""
    random = generator("lemma")
    A, w = random.normal(size=(3, 3)), random.normal(size=3)
    J = A + A.T
    Jh, W, hat = 0.5 * np.trace(J) * np.eye(3) - J, paper.hat(w), paper.hat
    turned = np.cross(w, J @ w)
    return size(
        hat(J @ w) - W @ Jh - Jh @ W,
        w @ J @ w - np.trace((Jh @ W).T @ W),
        hat(turned) - (W @ W @ Jh - Jh @ W @ W),
        W @ hat(J @ w) @ W + hat(w @ w * (J @ w) + np.cross(w, turned)),
    ) / size(J)


def cross_products() -> float:
    """Lemma 8."""
    u, v = generator("lemma 8").normal(size=(2, 3))
    found = evaluate(lambda u, v: (co.SO3().hat(u) @ v, co.Defining().diamond(co.SO3(), u, v)), u, v)
    return size(found[0] - np.cross(u, v), found[1] - np.cross(u, v))


def vehicle() -> float:
    """The Kelvin–Noether quantity (P77) of the paper's vehicle, 2000 steps of 0.01 s."""
    system = paper.vehicle()
    start = system.state(q=[0, 0, 1], xi=np.radians([10.0, 0, 20.0]), qdot=paper.VELOCITY, a0=[0, 0, 1])
    run = co.simulate(system, start, dt=0.01, steps=1200, method=co.LeftRectangle(start="velocity"))
    return run.relative_change("kelvin_noether")


def vehicle_lagrangian() -> float:
    """(P60) in the space frame against the reduced (P62)."""
    random = generator("vehicle")
    system = paper.vehicle()
    R = element(co.SO3(), random)
    omega, q, v = random.normal(size=(3, 3))
    down = np.array([0.0, 0.0, 1.0])
    dR, Jh = R @ paper.hat(omega), 0.5 * np.trace(paper.J) * np.eye(3) - paper.J
    kinetic = 0.5 * v @ R @ paper.M @ R.T @ v + 0.5 * np.trace(dR @ Jh @ dR.T)
    above = kinetic + paper.WEIGHT * q @ down - paper.BUOYANCY * (R @ paper.R_BUOYANCY) @ down
    below = evaluate(system.reduced_lagrangian, omega, R.T @ q, R.T @ v, R.T @ down)
    return abs(float(above - below)) / abs(float(above))


def vehicle_equations() -> float:
    """(P65) against the vector field."""
    random, system = generator("vehicle"), paper.vehicle()
    omega, q, v = random.normal(size=(3, 3))
    state = system.state(g=element(co.SO3(), random), xi=omega, q=q, qdot=v, a0=[0, 0, 1])
    slope = evaluate(partial(continuous.vector_field, system), state)
    turned = np.cross(paper.J @ omega, omega) - paper.BUOYANCY * np.cross(paper.R_BUOYANCY, state.a)
    angular = turned + np.cross(paper.M @ state.nu, state.nu)
    linear = paper.WEIGHT * state.a - np.cross(omega, paper.M @ state.nu)
    return size(paper.J @ slope.xi - angular, paper.M @ slope.nu - linear) / size(angular, linear)
