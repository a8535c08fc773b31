"""A function that reads differently each time cannot be compiled once: it is refused in one sentence."""

from __future__ import annotations

import functools
import itertools
import time

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import LagrangianError

CHAOS = np.random.default_rng(7)
COUNT = itertools.count()
CALLS: list[int] = []
SEEN: dict[str, float] = {"scale": 1.0}


def noisy():
    return CHAOS.normal()


def clocked():
    return time.perf_counter()


def counted():
    return float(next(COUNT))


def grown():
    CALLS.append(1)
    return float(len(CALLS))


def alternating():
    SEEN["scale"] = -SEEN["scale"]
    return SEEN["scale"]


def keyed():
    return jax.random.normal(jax.random.PRNGKey(next(COUNT)))


def branching():
    """Another program, not another number."""
    return jnp.sin(1.0) if next(COUNT) % 2 else 1.0


IMPURE = [noisy, clocked, counted, grown, alternating, keyed, branching]


def body(xi):
    return 0.5 * xi @ (np.array([1.0, 2.0, 3.0]) * xi)


def turning(lagrangian=body, **more):
    system = co.System(co.SO3(), lagrangian, **more)
    return system, system.state(xi=[0.1, 0.2, 1.0])


def refused(function) -> str:
    with pytest.raises(LagrangianError) as caught:
        function()
    message = str(caught.value)
    assert "must be pure, but two readings of it differ" in message and "\n" not in message
    return message


@pytest.mark.parametrize("source", IMPURE, ids=lambda source: source.__name__)
def test_an_impure_lagrangian_is_refused_where_its_state_is_made(source):
    assert refused(lambda: turning(lambda xi: (2 + 0.1 * source()) * body(xi))).startswith("The Lagrangian")


def test_an_impure_hamiltonian_is_refused():
    system = co.System(co.SO3(), hamiltonian=lambda mu: (2 + 0.1 * noisy()) * body(mu))
    assert refused(lambda: system.state(xi=[0.0, 0.1, 1.0])).startswith("The Hamiltonian")


@pytest.mark.parametrize("run", [co.simulate, co.trajectory], ids=lambda run: run.__name__)
@pytest.mark.parametrize("source", [noisy, branching], ids=lambda source: source.__name__)
def test_impure_forces_are_refused(run, source):
    def forces(motion):
        return co.Force(torque=-0.1 * source() * motion.xi)

    system, start = turning(forces=forces)
    assert refused(lambda: run(system, start, dt=0.01, steps=3)).startswith("The f")


@pytest.mark.parametrize("run", [co.simulate, co.trajectory], ids=lambda run: run.__name__)
def test_impure_discrete_lagrangians_are_refused(run):
    system = co.System(co.SO3(), discrete_lagrangian=lambda xi, h: h * (2 + 0.1 * noisy()) * body(xi))
    start = system.state(xi=[0.1, 0.2, 1.0]).replace(mu=np.array([0.1, 0.4, 3.0]), from_velocities=False)
    refused(lambda: run(system, start, dt=0.01, steps=3, method=co.Variational(co.Cayley())))


@pytest.mark.parametrize(
    ("what", "arguments"),
    [
        ("The function `inputs`", {"inputs": lambda motion: noisy() * motion.xi}),
        ("The signal", {"inputs": co.mechanics.Signal(lambda t: noisy() * jnp.ones(3))}),
        ("The function `until`", {"until": lambda state: state.xi[0] + noisy() - 100.0}),
        ("𝒦", {"kelvin_noether": co.mechanics.KelvinNoether([0, 0, 1], K=lambda c, a: (2 + noisy()) * c)}),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_what_else_a_run_takes_must_be_pure_too(what, arguments):
    system, start = turning(forces=lambda motion: co.Force(torque=0.0 * motion.xi))
    assert refused(lambda: co.simulate(system, start, dt=0.01, steps=3, **arguments)).startswith(what)


def test_quantities_that_are_watched_must_be_pure():
    system, start = turning(quantities={"spin": lambda state: noisy() * state.xi[2]})
    assert refused(lambda: co.simulate(system, start, dt=0.01, steps=3)).startswith("The quantity `spin`")


def test_an_impure_rule_is_refused():
    def rule(motion, h):
        return {"filtered": motion.internal.filtered + h * noisy()}

    system = co.System(co.SO3(), body, internal=rule)
    start = system.state(xi=[0, 0, 1], internal={"filtered": 0.0})
    assert refused(lambda: co.simulate(system, start, dt=0.01, steps=3)).startswith("The rule `internal`")


def test_an_impure_function_under_jit_is_refused():
    """JAX would keep what it read first, as long as the process lives; another process reads another function."""
    jitted = jax.jit(lambda xi: (2 + 0.1 * noisy()) * body(xi))
    refused(lambda: turning(jitted))


def test_a_value_kept_from_an_earlier_call_is_told():
    kept = {}

    def lagrangian(xi):
        return body(xi) + kept.setdefault("twice", 2 * xi)[0]

    with pytest.raises(LagrangianError, match="keeps a value of an earlier call"):
        turning(lagrangian)


@pytest.mark.parametrize("numbers", [np, jnp], ids=["NumPy", "JAX"])
def test_a_table_that_is_made_once_inside_the_lagrangian_must_be_one_of_numpy(numbers):
    """jax.numpy makes no numbers while JAX reads, but a value of this reading."""
    table = functools.cache(lambda: numbers.linspace(1.0, 2.0, 3))

    def lagrangian(xi):
        return body(xi) + 1e-3 * table() @ xi**2

    if numbers is np:
        turning(lagrangian)
        return
    with pytest.raises(LagrangianError, match=r"which has ended: .* or make tables with NumPy"):
        turning(lagrangian)


@pytest.mark.long
def test_pure_functions_that_rebuild_their_constants_pass():
    table: dict[str, np.ndarray] = {}

    def lagrangian(xi):
        matrix = np.diag(np.random.default_rng(3).uniform(1, 2, size=3))  # the same numbers each time, in a new array
        table.setdefault("kept", matrix)  # and a memory that changes nothing
        noise = jax.random.normal(jax.random.PRNGKey(0), (3,), dtype=jnp.float64)
        cubic = jax.jit(lambda x: jnp.sum(x**4))(xi)
        looped = jax.lax.fori_loop(0, 3, lambda i, s: s + xi[i] ** 2, 0.0)
        return 0.5 * xi @ matrix @ xi + 1e-3 * (cubic + looped) + 1e-3 * noise @ xi

    system, start = turning(lagrangian)
    run = co.simulate(system, start, dt=0.01, steps=3)
    assert run.good_steps == 3


def test_a_global_that_changed_between_two_runs_makes_another_system_not_an_impure_one():
    scale = {"value": 1.0}
    system, start = turning(lambda xi: scale["value"] * body(xi))
    before = co.simulate(system, start, dt=0.01, steps=3).dataset.energy.values[-1]
    scale["value"] = 2.0
    system, start = turning(lambda xi: scale["value"] * body(xi))
    assert co.simulate(system, start, dt=0.01, steps=3).dataset.energy.values[-1] == pytest.approx(2 * before)
