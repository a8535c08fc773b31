"""ℓ, ℋ and Λ whose derivative is not that of their value raise before a run; kinks and tables between knots do not."""

from __future__ import annotations

import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co

TABLE = np.array([0.0, 0.3, 0.9, 2.0, 3.1, 5.0, 5.2, 7.0])
KNOTS = np.arange(8.0)


def kinetic(xi):
    return 0.5 * xi @ (np.array([1.0, 2.0, 3.0]) * xi)


@jax.custom_jvp
def halved(x):
    return x**2


halved.defjvp(lambda primals, tangents: (primals[0] ** 2, primals[0] * tangents[0]))


def stairs(x):
    """One of three heights, by how many edges x is beyond."""
    return jax.lax.switch(jnp.digitize(x, jnp.array([-0.5, 0.5])), [lambda: 0.0, lambda: 1.0, lambda: 3.0])


def read_at_whole(x):
    return jnp.asarray(TABLE)[jnp.clip(x, 0, 7).astype(int)]


def interpolated(x):
    """A table between its knots, by floor and a gather."""
    i = jnp.clip(jnp.floor(x), 0, 6).astype(int)
    table = jnp.asarray(TABLE)
    return table[i] + (table[i + 1] - table[i]) * (x - i)


WRONG = {
    "stop_gradient of all": lambda xi, a: 0.1 * kinetic(xi) + jax.lax.stop_gradient(kinetic(xi)) - a[2],
    "stop_gradient of a part": lambda xi, a: kinetic(xi) - 1e-2 * jax.lax.stop_gradient(a[2]) * a[0],
    "custom_jvp": lambda xi, a: kinetic(xi) - halved(a[2]),
    "round of velocities": lambda xi, a: kinetic(xi) + kinetic(jnp.round(xi, 2)) - a[2],
    "floor": lambda xi, a: kinetic(xi) - jnp.floor(4 * a[2]),
    "ceil": lambda xi, a: kinetic(xi) - jnp.ceil(4 * a[2]),
    "sign": lambda xi, a: kinetic(xi) - jnp.sign(a[2] - 0.3),
    "comparison as a number": lambda xi, a: kinetic(xi) - (a[2] > 0.3) * 2.0,
    "switch by an interval": lambda xi, a: kinetic(xi) - stairs(a[2]),
    "argmax": lambda xi, a: kinetic(xi) - jnp.argmax(a) * 2.0,
    "table at a whole number": lambda xi, a: kinetic(xi) - read_at_whole(5 * a[2]),
}

RIGHT = {
    "smooth": lambda xi, a: kinetic(xi) - a[2],
    "abs at its kink": lambda xi, a: kinetic(xi) - jnp.abs(a[0]) - jnp.abs(xi[2]),
    "clip at its kink": lambda xi, a: kinetic(xi) - jnp.clip(a[0], 0.0, 0.5),
    "maximum at its kink": lambda xi, a: kinetic(xi) - 1e4 * jnp.maximum(a[0], 0.0) - jnp.maximum(a[1], a[0]),
    "where at its kink": lambda xi, a: kinetic(xi) - jnp.where(a[0] > 0, 3.0 * a[0], 7.0 * a[0]),
    "interp": lambda xi, a: kinetic(xi) - jnp.interp(5 * a[2], KNOTS, TABLE),
    "table between its knots": lambda xi, a: kinetic(xi) - interpolated(5 * a[2]),
    "sign times its argument": lambda xi, a: kinetic(xi) - a[0] * jnp.sign(a[0]),
    "cond of functions that meet": lambda xi, a: (
        kinetic(xi) - jax.lax.cond(a[2] > 0.3, lambda x: (x - 0.3) ** 2, lambda x: 0.0 * x, a[2])
    ),
    "comparison times a square": lambda xi, a: kinetic(xi) - (a[2] > 0.3) * (a[2] - 0.3) ** 2,
    "sorted": lambda xi, a: kinetic(xi) - jnp.sort(a)[1],
    "an angle that turns": lambda xi, a: kinetic(xi) - jnp.cos(jnp.mod(7 * a[2], 2 * jnp.pi)),
    "small beside a constant": lambda xi, a: 1e-9 * kinetic(xi) - 1e-9 * a[2] + 1e3,
    "very stiff": lambda xi, a: kinetic(xi) - 1e8 * (a @ a - 1) ** 2,
    "a length": lambda xi, a: kinetic(xi) - jnp.linalg.norm(a),
    "a wave of short length": lambda xi, a: kinetic(xi) - jnp.sin(2e3 * a[2]),
}


def made(lagrangian):
    system = co.System(co.SO3(), lagrangian, advected=co.Defining())
    return system, system.state(xi=[0.4, 0.3, 0.0], a0=[0.0, 0.0, 1.0])


@pytest.mark.parametrize("name", WRONG)
def test_a_derivative_that_is_not_that_of_the_value_raises(name):
    system, start = made(WRONG[name])
    with pytest.raises(co.errors.LagrangianError, match=r"(the value changes by \S+ and the derivative gives \S+)"):
        system.check(start)


@pytest.mark.cases(5)
@pytest.mark.parametrize("name", RIGHT)
def test_what_is_smooth_between_kinks_passes(name):
    system, start = made(RIGHT[name])
    assert system.check(start) == []


def test_fine_rounding_raises_where_short_differences_see_nothing_of_it():
    """Parts of a staircase shrink as those of a kink do; their sum does not."""
    system = co.System(co.SO3(), lambda xi: kinetic(xi) + kinetic(jnp.round(xi, 6)))
    with pytest.raises(
        co.errors.LagrangianError, match="must be continuous, but it holds the operation `round` and jumps"
    ):
        system.check(system.state(xi=[0.3, 0.2, 1.0]))


def test_fine_kinks_pass():
    """A saw without jumps, with 10⁴ teeth along the line on which jumps are searched for."""
    system, start = made(lambda xi, a: kinetic(xi) - 1e-4 * jnp.abs(jnp.mod(1e4 * a[2], 1.0) - 0.5))
    assert system.check(start) == []


def test_both_numbers_are_those_along_the_direction():
    system, start = made(lambda xi, a: kinetic(xi) - halved(a[2]))
    with pytest.raises(co.errors.LagrangianError) as raised:
        system.check(start)
    number = r"(-?[\d.e+-]+)"
    found = re.search(
        rf"\(ξ, a\) = \(\[(.*)\], \[(.*)\]\) .* changes by {number} and the derivative gives {number}:",
        str(raised.value),
    )
    xi, a = (np.array(part.split(","), float) for part in found.groups()[:2])
    true = np.array([0.4, 0.6, 0.0]) @ xi - 2 * a[2]
    assert np.allclose([float(x) for x in found.groups()[2:]], [true, true + a[2]], atol=3e-3)


def test_runs_steppers_and_filters_raise_before_their_first_step():
    system, start = made(WRONG["stop_gradient of all"])
    for made_of in (
        lambda: co.simulate(system, start, dt=0.01, steps=2, progress=False),
        lambda: co.Stepper(system, start, dt=0.01),
    ):
        with pytest.raises(co.errors.LagrangianError, match="must be that of its value"):
            made_of()


def test_a_hamiltonian_is_compared_too():
    system = co.System(co.SO3(), hamiltonian=lambda mu: 0.5 * mu @ mu + 0.1 * jax.lax.stop_gradient(mu[0]) ** 2)
    with pytest.raises(co.errors.LagrangianError, match=r"derivative of the Hamiltonian .* along \(μ\)"):
        system.check(system.state(mu=[0.3, 0.0, 0.1]))


@pytest.mark.parametrize("form", ["algebra", "group"])
def test_a_discrete_lagrangian_is_compared_too(form):
    def of_algebra(xi, h):
        return 0.5 * h * (xi @ xi) + 0.1 * jax.lax.stop_gradient(xi[0])

    def of_group(F, h):
        return jnp.trace(F) / h + jax.lax.stop_gradient(F[0, 1])

    given = {"discrete_lagrangian": of_algebra} if form == "algebra" else {"group_lagrangian": of_group}
    system = co.System(co.SO3(), **given)
    with pytest.raises(co.errors.LagrangianError, match="derivative of the discrete Lagrangian"):
        system.check(system.state(xi=[0.3, 0.0, 0.1]))


def test_points_stay_on_a_curved_space():
    """ℓ that is only defined on the sphere, and whose derivative is right along it."""
    system = co.System(
        co.SO3(),
        lambda xi, n, nu: kinetic(xi) + 0.5 * nu @ nu - jnp.sqrt(1 - n[2] ** 2 / (n @ n)),
        additional=co.Sphere(),
    )
    start = system.state(q=[1.0, 0.0, 0.0], xi=[0.1, 0.2, 0.3], qdot=[0.0, 0.1, 0.0])
    assert system.check(start) == []
