"""Rows (P79)–(P100) and the tables: the schemes of both difference maps, against the paper's formulas in NumPy."""

from __future__ import annotations

from functools import partial

import jax
import numpy as np
from rows_vehicle import LEFT, SCHEME, dual, motions, record_of
from theorem_row import Rows, off, off_each

import coadjoint as co
import paper
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.models import paper_tables
from coadjoint.report import reproduction
from paper import hat
from systems import generator

ROWS = Rows("SO(3), the vehicle")
row = ROWS.add

H = 0.3
TESTS = "difference_maps/test_difference_maps.py::"
CLOSED = TESTS + "test_closed_form_equals_the_derivation_from_the_map_alone"
MISPRINTS = "methods/test_misprints.py::"


def vee(X):
    return np.array([X[2, 1], X[0, 2], X[1, 0]])


def draws(count: int = 4):
    """ω, a vector u, and a symmetric J."""
    for index in range(count):
        random = generator("schemes", index)
        A = random.normal(size=(3, 3))
        yield *random.normal(size=(2, 3)), A @ A.T + np.eye(3)


def closed_forms(tau, F, dtau_inverse_dual):
    """τ, (dτ⁻¹)* and dτ⁻¹ of the library on SO(3) against matrices."""
    group = co.SO3()
    for omega, u, _ in draws():

        def found(omega, u):
            inverse = tau.dtau_inverse(group, omega, u)
            return tau.tau(group, omega), tau.dtau_inverse_dual(group, omega, u), inverse

        there, back = dtau_inverse_dual(hat(omega), hat(u)), dtau_inverse_dual(-hat(omega), hat(u))
        yield off_each(evaluate(found, omega, u), (F(omega, 1.0), vee(there), vee(back)))


@row(
    "(P79)–(P80)",
    "Cayley transform and (dCay⁻¹)\\*",
    ("difference_maps.Cayley.tau", "difference_maps.Cayley.dtau_inverse_dual", "difference_maps.Cayley.dtau_inverse"),
    (CLOSED,),
)
def cayley():
    """(P80) with Π a matrix; on SO(3) the dual of ω ↦ −ω is the transpose."""
    one = np.eye(3)
    yield from closed_forms(co.Cayley(), paper.Cayley().F, lambda W, P: (one + W / 2) @ P @ (one - W / 2))


def two_steps(tau, F, f_of, name: str):
    """Two steps of the library: the equations of the second at any ω, against (P88) or (P97), and where it starts."""
    step = co.LeftRectangle(tau, start="velocity")
    for vehicle, R, omega, n, nu, a in motions():
        y, M = vehicle.system, vehicle.M
        record = record_of(vehicle, R, omega, n, nu, a)
        after = evaluate(lambda s, y=y: step.advance(y, s, H), fitted(vehicle, record, name))
        last, velocity = generator("next", name, vehicle.m).normal(size=(2, 3))
        here = after.replace(xi=last, nu=velocity)
        left = evaluate(lambda s, y=y: step.equations(y, s, H), here)
        f, behind = (f_of(partial(np.matmul, vehicle.J), w) for w in (last, -omega))
        turned = F(omega, H)
        b = turned.T @ a
        torque = H * np.cross(M @ velocity, velocity) - H * vehicle.buoyancy * np.cross(vehicle.r, b)
        # f(ω) stands for (dτ⁻¹_{hω})*Jω, so that −f(−ω) is (dτ⁻¹_{−hω})*Jω.
        rows = f + behind - torque, M @ velocity - turned.T @ M @ nu - H * vehicle.weight * b
        yield off(left, np.concatenate(rows))
        yield off_each((after.g, after.n, after.a), (R @ turned, turned.T @ (n + H * nu), b))


def fitted(vehicle, record, name: str):
    """The record with the momenta of its own velocities."""
    omega, nu, a, M = record.xi, record.nu, record.a, vehicle.M
    torque = H * np.cross(M @ nu, nu) - H * vehicle.buoyancy * np.cross(vehicle.r, a)
    mu = dual(name, H * omega, vehicle.J @ omega) - torque
    return record.replace(mu=mu, pi=M @ nu - H * vehicle.weight * a)


def f_cayley(inertia, w):
    """(P89)."""
    p = inertia(w)
    turned = np.cross(w, p)
    return p + H / 2 * turned + H**2 / 4 * (w @ w * p + np.cross(w, turned))


def alpha(w):
    """(P93) at θ = h‖ω‖."""
    angle = H * np.linalg.norm(w)
    return (1 - angle / 2 / np.tan(angle / 2)) / angle**2


def f_exponential(inertia, w):
    """(P98)."""
    p = inertia(w)
    turned = np.cross(w, p)
    return p + H / 2 * turned + H**2 * alpha(w) * np.cross(w, turned)


@row(
    "(P81), (P88)", "algorithm: the scheme with the Cayley transform", (LEFT + "equations", LEFT + "advance"), (SCHEME,)
)
def cayley_scheme():
    yield from two_steps(co.Cayley(), paper.Cayley().F, f_cayley, "cayley")


@row(
    "Lemma 10, (P82)–(P87)",
    "identities of ω^× and Ĵ; (P83) with tr",
    ("groups.SO3.hat", "groups.SO3.vee"),
    ("theory/test_table.py::test_every_residual_of_the_table_is_round_off",),
)
def skew_identities():
    group = co.SO3()
    for w, _, J in draws():
        Jh = 0.5 * np.trace(J) * np.eye(3) - J
        turned = np.cross(w, J @ w)

        def found(*vectors, Jh=Jh):
            W, *others = (group.hat(x) for x in vectors)
            return W, *others, group.vee(W @ Jh + Jh @ W)

        W, of_Jw, of_turned, of_double, back = evaluate(found, w, J @ w, turned, np.cross(w, turned))
        yield off(W, hat(w))
        yield off(of_Jw, W @ Jh + Jh @ W)  # (P82)
        yield off(back, J @ w)
        yield off(np.trace((Jh @ W).T @ W), w @ J @ w)  # (P83)
        yield off(of_turned, W @ W @ Jh - Jh @ W @ W)  # (P84)
        yield off(W @ of_Jw @ W, -(w @ w * of_Jw + of_double))  # (P85), (P86)
        yield off(W @ W @ W, -(w @ w) * W)  # (P87)


def derivatives(tau, f_of, jacobian):
    """f and ∂f/∂ω in the library's equations, by autodiff, against the paper's."""
    step, group = co.LeftRectangle(tau, start="velocity"), co.SO3()
    for vehicle, R, omega, n, nu, a in motions():
        y, J = vehicle.system, vehicle.J
        record = record_of(vehicle, R, omega, n, nu, a)

        def sides(omega, record=record, y=y, J=J):
            f = tau.dtau_inverse_dual(group, H * omega, J @ omega)
            return f, jax.jacfwd(lambda w: step.equations(y, record.replace(xi=w), H)[:3])(omega)

        f, slope = evaluate(sides, omega)
        yield off_each((f, slope), (f_of(partial(np.matmul, J), omega), jacobian(J, omega)))


def common(J, w):
    """What (P90) and (P99) share, and ∂(ω × (ω × Jω))/∂ω of fixed first factor."""
    p, W = J @ w, hat(w)
    return J + H / 2 * (W @ J - hat(p)), -hat(np.cross(w, p)) + W @ (W @ J - hat(p))


def cayley_jacobian(J, w):
    """(P90), where 2ω(Jω)ᵀ must read 2(Jω)ωᵀ."""
    first, rest = common(J, w)
    return first + H**2 / 4 * (2 * np.outer(J @ w, w) + w @ w * J + rest)


@row(
    "(P89)–(P90)",
    "f(ω) and its derivative, Cayley; 2(Jω)ωᵀ",
    ("difference_maps.Cayley.dtau_inverse_dual", LEFT + "equations"),
    (MISPRINTS + "test_jacobian_of_the_cayley_scheme",),
)
def cayley_derivative():
    yield from derivatives(co.Cayley(), f_cayley, cayley_jacobian)


@row(
    "(P91)–(P95)",
    "Rodrigues' formula and (dexp⁻¹)\\*; α at θ = h‖ω‖",
    (
        "difference_maps.Exponential.tau",
        "difference_maps.Exponential.dtau_inverse_dual",
        "difference_maps.Exponential.dtau_inverse",
    ),
    (CLOSED, MISPRINTS + "test_printed_argument_of_alpha_destroys_the_kelvin_noether_quantity"),
)
def exponential():
    def dexp_inverse_dual(W, P):
        angle = np.linalg.norm(vee(W))
        of = (1 - angle / 2 / np.tan(angle / 2)) / angle**2
        once = W @ P - P @ W
        return P + once / 2 + of * (W @ once - once @ W)

    yield from closed_forms(co.Exponential(), paper.Exponential().F, dexp_inverse_dual)


@row("(P96)–(P97)", "algorithm: the scheme with the exponential", (LEFT + "equations", LEFT + "advance"), (SCHEME,))
def exponential_scheme():
    yield from two_steps(co.Exponential(), paper.Exponential().F, f_exponential, "exponential")


def exponential_jacobian(J, w):
    """(P99) with (P100): the last term must be (ω×(ω×Jω))(∂α/∂ω)ᵀ, and θ = h‖ω‖ in α and its derivative."""
    first, rest = common(J, w)
    t = H * np.linalg.norm(w)
    slope = (t**2 / 4 / np.sin(t / 2) ** 2 - 2 + t / 2 / np.tan(t / 2)) * H**2 * w / t**4
    return first + H**2 * (alpha(w) * rest + np.outer(np.cross(w, np.cross(w, J @ w)), slope))


@row(
    "(P98)–(P100)",
    "f(ω) and its derivative, exponential",
    ("difference_maps.Exponential.dtau_inverse_dual", LEFT + "equations"),
    (MISPRINTS + "test_jacobian_of_the_exponential_scheme",),
)
def exponential_derivative():
    yield from derivatives(co.Exponential(), f_exponential, exponential_jacobian)


STEPS = 25


@row(
    "Tables 1–2, Figures 1–3",
    "the vehicle, the start and the run of 500 s, here its first quarter of a second",
    ("models.paper_tables.paper_vehicle", "models.paper_tables.paper_start", "report.reproduction.compute"),
    (
        "report/test_reproduction.py::test_the_paper_run_conserves_what_the_paper_says",
        "truth/test_paper_run.py::test_the_start_is_that_of_table_2",
    ),
    bound=1e-12,
    equivalent={("models.paper_tables.paper_start", "transpose"): "R₀ = I is the only matrix of the start."},
)
def tables():
    vehicle = paper_tables.paper_vehicle()
    start = paper_tables.paper_start(vehicle)
    omega0 = np.radians([10.0, 0.0, 20.0])
    yield off_each((start.g, start.n, start.nu, start.xi, start.a),
                   (np.eye(3), np.array([0, 0, 1.0]), paper.VELOCITY, omega0, np.array([0, 0, 1.0])))  # fmt: skip
    for w, u, _ in draws():
        a = np.cross(w, u)
        value = 0.5 * u @ paper.M @ u + 0.5 * w @ paper.J @ w
        value += paper.WEIGHT * w @ a - paper.BUOYANCY * paper.R_BUOYANCY @ a + paper.WEIGHT * u @ a
        yield off(evaluate(vehicle.reduced_lagrangian, w, w + u, u, a), value)
    runs = reproduction.compute(duration=STEPS * paper_tables.PAPER_STEP, progress=False).runs
    for name, own in (("cayley", paper.Cayley()), ("exponential", paper.Exponential())):
        for label, parts in ((name, 1), (f"{name}_half_step", 2)):
            _, (g, n, omega, nu) = paper.run(own, omega0, paper_tables.PAPER_STEP / parts, STEPS * parts)
            last = jax.tree.map(lambda leaf: leaf[-1], runs[label].records)  # with the velocities of a step, as paper's
            yield off_each((last.g, last.n, last.xi, last.nu), (g, n, omega, nu))
