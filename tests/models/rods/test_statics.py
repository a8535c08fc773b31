"""Rods at rest: circles, elasticas and buckled columns in closed form; frequencies of beams and chains."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.linalg import eigh, expm
from scipy.optimize import brentq
from scipy.special import ellipk, jn_zeros

import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.models import rods
from coadjoint.models.rods.strains import logarithm

SLENDER: dict[str, Any] = {
    "length": 1.0,
    "EI": 1.0,
    "EA": 1e7,
    "GA": 1e7,
    "mass": 1.0,
    "inertia": 1e-8,
    "ends": "clamped",
}


@pytest.mark.parametrize("angle", [0.0, 1e-8, 0.3, 0.489, 0.4901, 1.0, 3.0])
@pytest.mark.parametrize("group", [co.SE3(), co.SE2()], ids=repr)
def test_a_strain_is_the_inverse_of_the_exponential(group: co.groups.LieGroup, angle: float):
    xi = np.cos(np.arange(float(group.dim)))
    turning = group.dim // 2
    xi[:turning] *= angle / np.linalg.norm(xi[:turning])
    assert np.max(np.abs(evaluate(lambda xi: logarithm(group.exp(xi)), xi) - xi)) < 5e-15


def bent(elements: int, **changes: Any) -> tuple[co.System, co.State]:
    curvature = changes.pop("start", 0.3)
    rod = rods.planar(**{**SLENDER, "elements": elements, **changes})
    return rod, rods.equilibrium(rod, rods.planar_start(rod, curvature=curvature))


@pytest.mark.long
def test_a_couple_bends_a_rod_into_a_circle_of_three_elements():
    elements = 3
    _, state = bent(elements, moment=1.5 * np.pi)
    s = np.arange(1, elements + 1) / elements * 1.5 * np.pi
    circle = np.stack([np.sin(s), 1 - np.cos(s)], axis=1) / (1.5 * np.pi)
    assert np.max(np.abs(rods.centerline(state) - circle)) < 1e-14


@pytest.mark.long
def test_a_couple_about_a_slanted_axis_bends_a_rod_in_space():
    rod = rods.cosserat(
        elements=3, length=1.0, EI=2.0, GJ=1.0, mass=1.0, inertia=(2e-3, 1e-3, 1e-3), ends="clamped",
        moment=(0.0, 1.2, 1.6),
    )  # fmt: skip
    state = rods.equilibrium(rod, rods.start(rod))
    sideways = np.cross([0.0, 0.6, 0.8], [1.0, 0.0, 0.0])
    away = rods.centerline(state)[-1] - [np.sin(1), 0, 0] - (1 - np.cos(1)) * sideways
    assert np.max(np.abs(away)) < 1e-13


@pytest.mark.long
def test_a_cantilever_is_the_elastica_of_order_two_in_the_elements():
    """Mattiasson, Int. J. Numer. Meth. Eng. 17 (1981), table I, FL²/EI = 10."""
    load, across, along = 10.0, 0.81061, 0.55500
    ends = [rods.centerline(bent(elements, load=(0.0, load), start=1.0)[1])[-1] for elements in (6, 12)]
    exact = np.array([1 - along, across])
    coarse, fine = (np.linalg.norm(end - exact) for end in ends)
    assert 3.6 < coarse / fine < 4.4
    assert np.max(np.abs(ends[1] + (ends[1] - ends[0]) / 3 - exact)) < 2e-5


@pytest.mark.long
@pytest.mark.parametrize("L", [1e-4, 100.0])
def test_rods_of_any_size_hang_alike(L: float):
    def hanging(L: float, EI: float):
        rod = rods.planar(
            elements=np.int64(4), length=L, EI=EI, mass=2.0, inertia=1e-3 * L**2, ends="clamped", gravity=9.8
        )
        return rods.centerline(rods.equilibrium(rod, rods.planar_start(rod))) / L

    assert np.max(np.abs(hanging(L, 3.0 * L**3) - hanging(1.0, 3.0))) < 1e-9  # of one mgL³/EI


@pytest.mark.long
def test_a_cantilever_sags_along_gravity_and_a_load_by_the_beam_of_bernoulli():
    """mgL⁴/8EI and FL³/3EI, small, in the plane and in space about both axes, each with its EI."""
    weight, force = 2 * 1e-3 / 8, 1e-3 / 3
    plane = {**SLENDER, "elements": 6, "gravity": 2.0, "mass": 1e-3}
    rod = rods.planar(**plane, load=(0.0, 2e-3))
    tip = rods.centerline(rods.equilibrium(rod, rods.planar_start(rod)))[-1]
    assert tip[1] == pytest.approx(2 * force - weight, rel=2e-2)
    rod = rods.cosserat(**{**plane, "inertia": (1e-8,) * 3, "EI": (1.0, 3.0), "GJ": 1.0}, load=(0.0, 1e-3, 0.0))
    tip = rods.centerline(rods.equilibrium(rod, rods.start(rod, down=(0.0, 0.0, 1.0))))[-1]
    np.testing.assert_allclose(tip[1:], [force / 3, weight], rtol=2e-2)  # towards the third axis about the second


CURVED = {**SLENDER, "elements": 3, "rest_curvature": 1.2}


@pytest.mark.long
def test_a_rod_that_is_curved_at_rest_comes_back_to_its_circle():
    rod = rods.planar(**CURVED)
    found = rods.centerline(rods.equilibrium(rod, rods.planar_start(rod, curvature=0.0)))
    arcs = 1.2 * np.arange(1, 4) / 3
    assert np.max(np.abs(found - np.stack([np.sin(arcs), 1 - np.cos(arcs)], axis=1) / 1.2)) < 1e-9


@pytest.mark.long
def test_a_couple_straightens_a_rod_that_is_curved_at_rest():
    """By EIκ."""
    against = rods.planar(**CURVED, moment=-1.2)
    found = rods.centerline(rods.equilibrium(against, rods.planar_start(against)))
    assert np.max(np.abs(found - np.stack([np.arange(1, 4) / 3, np.zeros(3)], axis=1))) < 1e-9


@pytest.mark.long
def test_a_column_buckles_at_the_load_of_euler():
    def smallest(load: float, elements: int) -> float:
        rod = rods.planar(**SLENDER, elements=elements, load=(-load, 0.0))
        return rods.modes(rod, rods.equilibrium(rod, rods.planar_start(rod)))[0][0]

    euler, found = np.pi**2 / 4, []
    for elements in (4, 8):
        below, above = 0.995 * euler, 1.02 * euler
        first, second = smallest(below, elements), smallest(above, elements)
        assert first > 0 > second
        found.append(below + (above - below) * first / (first - second))
    assert 3.7 < (found[0] - euler) / (found[1] - euler) < 4.3
    assert abs(found[1] + (found[1] - found[0]) / 3 - euler) < 2e-4 * euler


@pytest.mark.long
def test_beyond_that_load_it_leans_as_the_elastica_does():
    # P/P_cr = (2 K(sin α/2)/π)² of the tip's angle α.
    alpha = np.pi / 3
    load = np.pi**2 / 4 * (2 * ellipk(np.sin(alpha / 2) ** 2) / np.pi) ** 2
    angles = []
    for elements in (16, 8):
        s = (np.arange(elements) + 0.5) / elements
        rod, state = bent(elements, load=(-load, 0.0), start=alpha * np.pi / 2 * np.cos(np.pi / 2 * s))
        R = np.asarray(state.g[0])[-1]
        angles.append(np.arctan2(R[1, 0], R[0, 0]))
    assert abs(angles[0] + (angles[0] - angles[1]) / 3 - alpha) < 2e-3
    assert rods.modes(rod, state)[0][0] > 0  # and is stable there


BEAM: dict[str, Any] = {"length": 1.0, "EI": 1.0, "EA": 1200.0, "GA": 400.0, "mass": 1.0, "inertia": 1 / 1200}


def timoshenko(free: bool, between: tuple[float, float]) -> float:
    """ω of the beam by its equations w' = θ + Q/GA, θ' = M/EI, Q' = −mω²w, M' = −Q − ρIω²θ."""

    def determinant(omega: float) -> float:
        A = np.zeros((4, 4))
        A[0, 1], A[0, 3], A[1, 2] = 1, 1 / BEAM["GA"], 1 / BEAM["EI"]
        A[2, 3], A[2, 1], A[3, 0] = -1, -BEAM["inertia"] * omega**2, -BEAM["mass"] * omega**2
        whole = expm(A)
        return float(np.linalg.det(whole[2:, :2] if free else whole[2:, 2:]))

    return float(brentq(determinant, *between))  # pyright: ignore[reportArgumentType]


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize(("ends", "rigid", "between"), [("clamped", 0, (2.0, 4.0)), ("free", 3, (15.0, 25.0))])
def test_first_frequencies_are_those_of_timoshenkos_beam(ends: str, rigid: int, between: tuple[float, float]):
    exact, found = timoshenko(ends == "free", between), []
    for elements in (8, 16):
        rod = rods.planar(**BEAM, elements=elements, ends=ends)
        squares, _ = rods.modes(rod, rods.planar_start(rod))
        assert np.max(np.abs(squares[:rigid]), initial=0.0) < 1e-8
        found.append(np.sqrt(squares[rigid]))
    assert 3.5 < (found[0] - exact) / (found[1] - exact) < 4.5
    assert abs(found[1] + (found[1] - found[0]) / 3 - exact) < 6e-4 * exact
    bernoulli = 4.730041**2 if ends == "free" else 1.875104**2
    assert 0.9 * bernoulli < exact < 0.999 * bernoulli


@pytest.mark.long
def test_a_chain_of_pendulums_swings_at_the_frequencies_of_its_matrices():
    N, l, g = 5, 0.3, 9.81
    chain = rods.pendulums(links=N, length=l, mass=0.7, center=l, inertia=(0.1, 0.0, 0.0), gravity=g)
    squares, _ = rods.modes(chain, rods.pendulums_start(chain))
    i = np.arange(N)
    M, K = (N - np.maximum.outer(i, i)) * l, np.diag(g * (N - i) * 1.0)
    assert np.max(np.abs(squares[N:] - np.repeat(eigh(K, M, eigvals_only=True), 2))) < 1e-10 * squares[-1]
    assert np.max(np.abs(squares[:N])) < 1e-10  # turns of the links about themselves


def test_bodies_with_springs_and_mass_centres_anywhere_swing_and_twist_at_their_frequencies():
    """Two links: about the second and third axis K = k(2, −1; −1, 1) + gravity, about the first springs alone."""
    l, c, m, k, g = np.array([0.5, 0.4]), np.array([0.2, 0.3]), np.array([1.0, 0.7]), 3.0, 9.8
    J = np.array([[0.02, 0.03, 0.05], [0.01, 0.04, 0.02]])
    chain = rods.pendulums(links=2, length=l, mass=m, inertia=J, center=c, stiffness=k, gravity=g)
    squares, _ = rods.modes(chain, rods.pendulums_start(chain))
    springs, expected = k * np.array([[2.0, -1.0], [-1.0, 1.0]]), []
    for axis in range(3):
        M, K = np.diag(J[:, axis]), springs
        if axis:
            of_masses = m[0] * np.outer([c[0], 0], [c[0], 0]) + m[1] * np.outer([l[0], c[1]], [l[0], c[1]])
            M, K = M + of_masses, K + g * np.diag([m[0] * c[0] + m[1] * l[0], m[1] * c[1]])
        expected.extend(np.linalg.eigvals(np.linalg.solve(M, K)))
    np.testing.assert_allclose(squares, np.sort(expected), rtol=1e-10)


def test_round_sections_have_the_integrals_of_a_disc():
    """EA, EI, GJ, ρJ, … by sums over rings, and 0.9 of A for shear."""
    r, rho, E, G = 0.03, 1100.0, 5e6, 2e6
    found = rods.round_section(radius=r, density=rho, young=E, shear=G)
    rings = (np.arange(2000) + 0.5) * r / 2000
    area, polar = (np.sum(2 * np.pi * rings**power) * r / 2000 for power in (1, 3))
    expected = {"EA": E * area, "GA": 0.9 * G * area, "GJ": G * polar, "EI": E * polar / 2, "mass": rho * area}
    for name, value in expected.items():
        assert found[name] == pytest.approx(value, rel=1e-6), name
    np.testing.assert_allclose(found["inertia"], rho * polar * np.array([1, 0.5, 0.5]), rtol=1e-6)


@pytest.mark.long
def test_a_chain_of_many_pendulums_is_the_hanging_chain_of_bernoulli():
    errors = []
    for N in (6, 12):
        chain = rods.pendulums(links=N, length=2 / N, mass=1 / N, inertia=(1.0, 1e-9, 1e-9), gravity=9.81)
        squares, _ = rods.modes(chain, rods.pendulums_start(chain))
        errors.append(np.sqrt(squares[N]) / (jn_zeros(0, 1)[0] / 2 * np.sqrt(9.81 / 2)) - 1)
    assert abs(errors[1]) < 2e-3 and abs(errors[1]) < 0.4 * abs(errors[0])
