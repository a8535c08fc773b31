"""Rows (P53)–(P78): SO(3) and the underwater vehicle, against the paper's formulas in NumPy, with random parameters."""

from __future__ import annotations

from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np
from theorem_row import Rows, off, off_each

import coadjoint as co
import paper
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics import continuous, noether
from coadjoint.models import paper_form
from coadjoint.spaces import Defining
from paper import hat
from systems import element, generator

ROWS = Rows("the vehicle, SO(3)")
row = ROWS.add

H = 0.05
FORMS = "groups/test_group_axioms.py::test_closed_forms_equal_the_derivation_from_matrices"
SCHEME = "methods/test_misprints.py::test_left_rule_with_velocity_start_is_the_paper_s_scheme"
VEHICLE = "truth/test_paper_run.py::"
LEFT = "methods.LeftRectangle."


class Body(NamedTuple):
    """A vehicle with random parameters: the library's, and its numbers."""

    system: co.System
    m: float
    added: np.ndarray
    J: np.ndarray
    r: np.ndarray
    buoyancy: float

    @property
    def M(self) -> np.ndarray:
        """mI + M_A."""
        return self.m * np.eye(3) + self.added

    @property
    def weight(self) -> float:
        """mg − ρ|V|g."""
        return self.m * 9.81 - self.buoyancy


def symmetric(random) -> np.ndarray:
    A = random.normal(size=(3, 3))
    return A @ A.T + np.eye(3)


@cache
def numbers(index: int) -> dict[str, Any]:
    """Arguments of the library's vehicle, drawn at random."""
    random = generator("vehicle", index)
    return {
        "mass": random.uniform(1.0, 3.0), "added_mass": symmetric(random), "inertia": symmetric(random),
        "buoyancy": random.uniform(10.0, 40.0), "center_of_buoyancy": random.normal(size=3),
    }  # fmt: skip


def body(index: int) -> Body:
    """The vehicle of `models.paper_form` with them; made anew, for it is what rows measure."""
    p = numbers(index)
    system = paper_form.vehicle(**p)
    return Body(system, p["mass"], p["added_mass"], p["inertia"], p["center_of_buoyancy"], p["buoyancy"])


def motions(count: int = 3):
    """Vehicles with R, ω, n, ν and a = R⁻¹e for a random unit e."""
    for index in range(count):
        random = generator("motion", index)
        R = element(co.SO3(), random)
        omega, n, nu, down = random.normal(size=(4, 3))
        yield body(index), R, omega, n, nu, R.T @ down / np.linalg.norm(down)


def state_of(vehicle: Body, R, omega, n, nu, a) -> co.State:
    return vehicle.system.state(g=R, xi=omega, q=R @ n, qdot=R @ nu, a0=R @ a)


@row(
    "(P53)–(P56)",
    "SO(3), so(3) and ω ↦ ω^×",
    (
        "groups.SO3.hat",
        "groups.SO3.vee",
        "groups.SO3.ad",
        "groups.SO3.ad_dual",
        "groups.SO3.Ad",
        "groups.SO3.Ad_dual",
        "groups.SO3.exp",
    ),
    (FORMS,),
)
def rotations():
    group = co.SO3()
    for index in range(3):
        random = generator("rotations", index)
        u, v = random.normal(size=(2, 3))
        R = paper.Exponential().F(random.normal(size=3), 1.0)

        def found(u, v, R):
            made = group.hat(u), group.vee(group.hat(u)), group.ad(u, v), group.ad_dual(u, v)
            return *made, group.Ad(R, u), group.Ad_dual(R, u), group.exp(u)

        hats = hat(u), u, np.cross(u, v), np.cross(v, u)
        yield off_each(evaluate(found, u, v, R), (*hats, R @ u, R.T @ u, paper.Exponential().F(u, 1.0)))
        yield off(0.5 * np.trace(np.asarray(evaluate(found, u, v, R)[0]).T @ hat(v)), u @ v)  # the pairing


@row(
    "(P57)–(P62)",
    "the vehicle's Lagrangian",
    ("models.paper_form.vehicle", "models.paper_form.lagrangian"),
    (
        "models/test_catalogue.py::test_the_entry_of_the_papers_vehicle_is_the_paper",
        "truth/test_underwater_forms.py::test_the_general_form_about_the_mass_centre_is_the_papers",
    ),
)
def vehicle_lagrangian():
    for vehicle, R, omega, n, nu, a in motions():
        J, dR, q, v = vehicle.J, R @ hat(omega), R @ n, R @ nu
        Jh = 0.5 * np.trace(J) * np.eye(3) - J
        linear = 0.5 * vehicle.m * v @ v + 0.5 * v @ R @ vehicle.added @ R.T @ v
        height = vehicle.weight * q @ R @ a - vehicle.buoyancy * (R @ vehicle.r) @ R @ a
        found = evaluate(vehicle.system.reduced_lagrangian, omega, n, nu, a)
        yield off(found, linear + 0.5 * np.trace(dR @ Jh @ dR.T) + height)


@row(
    "(P63)–(P65)",
    "the vehicle's continuous equations",
    ("mechanics.continuous.vector_field", "models.paper_form.vehicle"),
    ("mechanics/test_continuous.py::test_equations_of_the_paper_s_vehicle",),
)
def vehicle_equations():
    for vehicle, R, omega, n, nu, a in motions():
        J, M = vehicle.J, vehicle.M
        state = state_of(vehicle, R, omega, n, nu, a)
        slope = evaluate(partial(continuous.vector_field, vehicle.system), state)
        torque = np.cross(M @ nu, nu) - vehicle.buoyancy * np.cross(vehicle.r, a)
        expected = np.cross(J @ omega, omega) + torque, vehicle.weight * a - np.cross(omega, M @ nu)
        yield off_each((J @ slope.xi, M @ slope.nu), expected)
        yield off_each((slope.n, slope.a, slope.g), (nu - np.cross(omega, n), np.cross(a, omega), R @ hat(omega)))
        yield off_each((state.mu, state.pi), (J @ omega, M @ nu))
        value = 0.5 * omega @ J @ omega + 0.5 * nu @ M @ nu + vehicle.weight * n @ a - vehicle.buoyancy * vehicle.r @ a
        yield off(evaluate(vehicle.system.reduced_lagrangian, omega, n, nu, a), value)


@row(
    "Lemma 8",
    "u^×v = u × v, u⋄v = u × v",
    ("spaces.Defining.diamond", "groups.SO3.hat"),
    ("spaces/test_actions.py::test_diamond_of_vectors_under_rotations_is_the_cross_product",),
)
def cross_products():
    for index in range(3):
        u, v = generator("lemma 8", index).normal(size=(2, 3))
        found = evaluate(lambda u, v: (co.SO3().hat(u) @ v, Defining().diamond(co.SO3(), u, v)), u, v)
        yield off_each(found, (np.cross(u, v), np.cross(u, v)))


def record_of(vehicle: Body, R, omega, n, nu, a) -> co.State:
    """A step of the left rule with these velocities, with momenta that fit nothing."""
    mu, pi = generator("record", vehicle.m).normal(size=(2, 3))
    return state_of(vehicle, R, omega, n, nu, a).replace(mu=mu, pi=pi)


@row(
    "(P66)–(P72)",
    "the vehicle's discrete Lagrangian",
    (LEFT + "discrete_lagrangian", LEFT + "relative", "models.paper_form.vehicle"),
    (SCHEME,),
)
def discrete_lagrangian():
    step = co.LeftRectangle(co.Cayley())
    for vehicle, R, omega, n, nu, a in motions():
        record = record_of(vehicle, R, omega, n, nu, a)

        def found(record, vehicle=vehicle):
            return step.discrete_lagrangian(vehicle.system, record, H), step.relative(vehicle.system, record, H)

        q, q_next = R @ n, R @ n + H * R @ nu
        v, Jh = (q_next - q) / H, 0.5 * np.trace(vehicle.J) * np.eye(3) - vehicle.J
        kinetic = 0.5 * v @ R @ vehicle.M @ R.T @ v + 0.5 * np.trace(hat(omega) @ Jh @ hat(omega).T)
        height = vehicle.weight * q @ R @ a - vehicle.buoyancy * (R @ vehicle.r) @ R @ a
        yield off_each(evaluate(found, record), (H * (kinetic + height), paper.Cayley().F(omega, H)))


def dual(tau, omega, mu):
    """(dτ⁻¹_ω)*μ in NumPy: (P80), or (P94) with α at ‖ω‖."""
    turned = np.cross(omega, mu)
    if tau == "cayley":
        return mu + 0.5 * turned + 0.25 * omega * (omega @ mu)
    angle = np.linalg.norm(omega)
    return mu + 0.5 * turned + (1 - angle / 2 / np.tan(angle / 2)) / angle**2 * np.cross(omega, turned)


MAPS = {"cayley": (co.Cayley(), paper.Cayley()), "exponential": (co.Exponential(), paper.Exponential())}


def scheme(name: str, in_s: bool = False):
    """Left and right side of (P73) or (P74) by the library's step, and by the paper's formulas.

    At any (ω, ν) of a step, and momenta that do not fit, the equations of the step are those of the paper minus these;
    with momenta that fit, the step ends with the right sides of the next equations.
    """
    tau, own = MAPS[name]
    step = co.LeftRectangle(tau, start="velocity")
    for vehicle, R, omega, n, nu, a in motions():
        record = record_of(vehicle, R, omega, n, nu, a)
        F, J, M = own.F(omega, H), vehicle.J, vehicle.M
        if in_s:
            s = n + H * nu
            torque = np.cross(M @ (s - n), s - n) / H
            linear = M @ (s - n) / H
        else:
            s, torque, linear = n + H * nu, H * np.cross(M @ nu, nu), M @ nu
        torque = torque - H * vehicle.buoyancy * np.cross(vehicle.r, a)
        mu, pi = dual(name, H * omega, J @ omega) - torque, linear - H * vehicle.weight * a
        left = evaluate(lambda s, y=vehicle.system: step.equations(y, s, H), record)
        yield off(left, np.concatenate([mu - record.mu, pi - record.pi]))
        fitting = record.replace(mu=mu, pi=pi)
        after = evaluate(lambda s, y=vehicle.system: step.advance(y, s, H), fitting)
        right = dual(name, -H * omega, J @ omega), F.T @ linear
        yield off_each((after.g, after.n, after.a, after.mu, after.pi), (R @ F, F.T @ s, F.T @ a, *right))


@row(
    "(P73), Remark 9 (P74)",
    "the vehicle's discrete equations, in s and in ν",
    (LEFT + "equations", LEFT + "advance"),
    (SCHEME, "methods/test_misprints.py::test_s_as_the_unknown_loses_the_kelvin_noether_quantity_far_from_the_origin"),
)
def discrete_equations():
    for name in MAPS:
        yield from scheme(name, in_s=True)
        yield from scheme(name)


@row(
    "(P75)–(P78)",
    "the vehicle's discrete Kelvin–Noether quantity",
    (
        "mechanics.noether.spatial_momentum",
        "mechanics.noether.KelvinNoether.paper_quantity",
        "mechanics.noether.KelvinNoether.momentum_map",
    ),
    (VEHICLE + "test_both_maps_keep_the_kelvin_noether_quantity_the_balance_and_the_group",),
)
def vehicle_quantity():
    for name, (tau, _) in MAPS.items():
        step = co.LeftRectangle(tau, start="velocity")
        for vehicle, R, omega, n, nu, a in motions():
            w0 = generator("w0", name, vehicle.m).normal(size=3)
            left, torque = dual(name, H * omega, vehicle.J @ omega), np.cross(vehicle.M @ nu, nu)
            source = H * vehicle.weight * np.cross(n, a) - H * vehicle.buoyancy * np.cross(vehicle.r, a)
            mu = left - H * torque + H * vehicle.buoyancy * np.cross(vehicle.r, a)
            pi = vehicle.M @ nu - H * vehicle.weight * a
            record = state_of(vehicle, R, omega, n, nu, a).replace(mu=mu, pi=pi)
            printed = R @ (left - np.cross(vehicle.M @ nu, n + H * nu))  # (P78)

            def found(record, w0=w0, vehicle=vehicle, step=step):
                quantities, after = co.mechanics.KelvinNoether(w0), step.advance(vehicle.system, record, H)
                value = quantities.paper_quantity(vehicle.system, step, record, H)
                ahead = noether.spatial_momentum(vehicle.system, after)
                return quantities.momentum_map(vehicle.system, record), value, w0 @ ahead

            def before(record, vehicle=vehicle):
                return noether.spatial_momentum(vehicle.system, record)

            yield off_each(evaluate(found, record), (R.T @ w0, w0 @ printed, w0 @ printed))
            yield off(evaluate(before, record), printed - R @ source)  # (P77): what the step's source changes
