"""What turns with the sphere is at rest on it, and the energy of a swimmer is that of its ellipses on their way."""

from __future__ import annotations

import jax
import numpy as np
import pytest

from coadjoint.errors import ArgumentError
from coadjoint.groups import attitude
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.parameters import Parameters
from coadjoint.models import falling_cat, fluids, integrable_tops, swimmer
from coadjoint.models.fluids.euler import axial
from coadjoint.models.fluids.harmonics import from_coefficients

FLUIDS = [fluids.euler, fluids.magnetohydrodynamics, fluids.boussinesq]


@pytest.mark.parametrize("model", FLUIDS, ids=lambda model: model.__name__)
def test_a_fluid_that_turns_with_its_sphere_has_neither_energy_nor_velocity(model):
    """μ = f = 2Ω cos θ: ℋ(f) = 0 and ∂ℋ/∂μ(f) = 0; f + ω has the energy of ω on a sphere at rest."""
    N, rotation = 4, 0.7
    fluid, still = model(N, rotation), model(N)
    f, omega = rotation * axial(N, 2.0), from_coefficients(N, fluids.random_vorticity(3, 3))
    nothing = () if model is fluids.euler else (np.zeros(N * N),)

    def energy(system, mu):
        return evaluate(jax.value_and_grad(lambda mu: system.hamiltonian(mu, *nothing, system.parameters)), mu)

    none, velocity = energy(fluid, f)
    assert none == 0 and np.max(np.abs(velocity)) == 0
    assert energy(fluid, f + omega)[0] == pytest.approx(energy(still, omega)[0], rel=1e-13) and energy(still, omega)[0]


def test_the_energy_of_a_swimmer_is_that_of_its_ellipses():
    """½Σ(𝒥ω_i² + M_x u_i² + M_y w_i²) of places and angles in space that are differentiated in time, less ½k|x|²."""
    p = Parameters(semi_axes=np.array([0.5, 0.1]), density=2.0, stiffness=3.0)
    x, v, xi = np.array([0.4, -0.7]), np.array([1.1, 0.6]), np.array([0.3, -0.2, 0.5])
    a, b = p.semi_axes
    mass = np.pi * p.density * a * b
    about = mass * (a**2 + b**2) / 4 + np.pi * p.density * (a**2 - b**2) ** 2 / 8
    along, across = mass + np.pi * p.density * b**2, mass + np.pi * p.density * a**2

    def placed(t):
        """Angles (3,) and centres (3, 2) in space, the middle one at O along the axis at t = 0."""
        bends, turned = x + t * v, t * xi[0]
        way = lambda angle: a * np.array([np.cos(angle), np.sin(angle)])  # noqa: E731
        front = way(turned) + way(turned + bends[0])
        rear = -way(turned) - way(turned + bends[1])
        return turned + np.array([bends[0], 0, bends[1]]), t * xi[1:] + np.array([front, [0, 0], rear])

    step = 1e-5
    turning, moving = ((after - before) / (2 * step) for after, before in zip(placed(step), placed(-step), strict=True))
    c, s = np.cos(placed(0)[0]), np.sin(placed(0)[0])
    u, w = c * moving[:, 0] + s * moving[:, 1], c * moving[:, 1] - s * moving[:, 0]
    expected = 0.5 * np.sum(about * turning**2 + along * u**2 + across * w**2) - 0.5 * p.stiffness * x @ x
    assert evaluate(swimmer.lagrangian, xi, x, v, p) == pytest.approx(expected, rel=1e-9)


def test_a_swimmer_starts_where_and_as_bent_as_it_is_said():
    made = swimmer.make(semi_axes=(1.0, 0.2), density=1000.0, stiffness=5.0)
    state = swimmer.start(
        made, angle=0.3, position=(1.0, -2.0), velocity=(0.1, 0.2, 0.3), bend=(0.4, 0.5), bend_rate=(0.6, 0.7)
    )
    turned = [[np.cos(0.3), -np.sin(0.3)], [np.sin(0.3), np.cos(0.3)]]
    np.testing.assert_allclose(state.g[0], turned, atol=1e-15)
    for found, given in zip((state.g[1], state.xi, state.n, state.nu),
                            ((1.0, -2.0), (0.1, 0.2, 0.3), (0.4, 0.5), (0.6, 0.7)), strict=True):  # fmt: skip
        np.testing.assert_array_equal(found, given)
    with pytest.raises(ArgumentError, match=r"`position` must have shape \(2,\)"):
        swimmer.start(made, position=(1.0, 2.0, 3.0))


def test_a_cat_starts_in_an_attitude_with_its_spine_bent():
    cat = falling_cat.make(mass=(1.0, 2.0), axial=(0.1, 0.2), transverse=(0.3, 0.4), reach=(0.2, 0.3), stiffness=5.0)
    state = falling_cat.start(
        cat, euler_zyx=(0.3, 0.0, 0.0), angular_velocity=(0.1, 0.2, 0.3), bend=(0.4, 0.5), bend_rate=(0.6, 0.7)
    )
    np.testing.assert_allclose(state.g, attitude.zyx(0.3, 0, 0), atol=1e-15)
    for found, given in ((state.xi, (0.1, 0.2, 0.3)), (state.n, (0.4, 0.5)), (state.nu, (0.6, 0.7))):
        np.testing.assert_array_equal(found, given)


def test_the_integrals_of_tops_are_their_published_formulas():
    """With ω = (1, 2, −1), a = (0.6, 0, 0.8) and k = mgl/C = 3."""
    omega, a, given = np.array([1.0, 2.0, -1.0]), [0.6, 0.0, 0.8], {"mass": 2.0, "lever": 1.5, "gravity": 2.0}
    for make, name, expected in (
        (integrable_tops.kovalevskaya, "kovalevskaya_integral", (-3 - 1.8) ** 2 + 4**2),
        (integrable_tops.goryachev_chaplygin, "chaplygin_integral", -5 - 3 * 0.8),
    ):
        top = make(axial=2.0, **given)
        momentum = np.diag(top.parameters.inertia) * omega
        state = top.state(xi=omega, a0=a).replace(mu=momentum)
        found = evaluate(lambda s, p, top=top, name=name: dict(top.quantities)[name](s, p), state, top.parameters)
        assert found == pytest.approx(expected, rel=1e-14)
