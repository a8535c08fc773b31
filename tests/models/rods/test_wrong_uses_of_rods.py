"""Each wrong use of a rod is told in one sentence."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import CoadjointError
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.models import rods
from coadjoint.models.rods import statics


def rod(**changes: Any) -> co.System:
    given: Any = {"elements": 3, "length": 1.0, "EI": 1.0, "mass": 1.0, "inertia": 0.01, **changes}
    return rods.planar(**given)


def rod_in_space(**changes: Any) -> co.System:
    given: Any = {"elements": 3, "length": 1.0, "EI": 1.0, "GJ": 1.0, "mass": 1.0, "inertia": (0.02, 0.01, 0.01)}
    return rods.cosserat(**{**given, **changes})


def weighted() -> co.System:
    return rod(ends="clamped", gravity=1.0)


def slope_of_rest():
    with co.float64():
        return jax.grad(lambda EI: rods.equilibrium(rod().replace(EI=EI), rods.planar_start(rod())).mu[0])(1.0)


def slope_of_motion():
    def end(speed):
        driven = rod(ends="clamped", motion=lambda t: (jnp.eye(2), speed * t * jnp.ones(2)))
        return co.trajectory(driven, rods.planar_start(driven), dt=1e-3, steps=2)[1].mu[0]

    with co.float64():
        return jax.grad(end)(1.0)


def pendulum() -> co.System:
    return rods.pendulums(links=2, length=1.0, mass=1.0, inertia=(1.0, 1.0, 1.0))


RODS = {
    "no ends": (lambda: rod(ends="pinned"), '`ends` must be "free", "clamped", .*, but is .pinned.'),
    "too few elements": (
        lambda: rod(elements=1, ends="both clamped"),
        "with ends 'both clamped' must be a whole number from 2, but is 1",
    ),
    "no stiffness": (lambda: rod(EI=-1.0), "`EI` must be positive, but is -1"),
    "lengths of other elements": (lambda: rod(length=[0.5, 0.5]), r"`length` must have shape \(3,\)"),
    "a load where no end is": (lambda: rod(ends="ring", load=(1.0, 0.0)), "has no free end for a `load`"),
    "a motion of a free end": (
        lambda: rod(motion=lambda t: (jnp.eye(2), jnp.zeros(2))),
        "moves a clamped first end, but this rod has ends 'free'",
    ),
    "a motion of NumPy": (
        lambda: rod(ends="clamped", motion=lambda t: (np.eye(2), np.array([0.0, np.sin(t)]))),
        r"in jax.numpy, to a pose .*, but uses NumPy on t",
    ),
    "a motion that is no number": (
        lambda: rod(ends="clamped", motion=lambda t: (jnp.eye(2), jnp.array([t, jnp.nan]))),
        "`motion` must be finite, but at t = 0",
    ),
    "a motion that is no pose": (
        lambda: rod(ends="clamped", motion=lambda t: jnp.zeros(3)),
        r"`motion` must be .* to a pose \(R, x\) of shapes \(2, 2\) and \(2,\), but has shapes \[\(3,\)\]",
    ),
    "a start of rods in space": (lambda: rods.start(rod()), "A planar rod starts by co.models.rods.planar_start"),
    "a start of rods in a plane": (
        lambda: rods.planar_start(rod_in_space()),
        "A Cosserat rod starts by co.models.rods.start",
    ),
    "a motion that jumps at the start": (
        lambda: rod(ends="clamped", motion=lambda t: (jnp.eye(2), jnp.ones(2) + t)),
        r"`motion` must be \(1, 0\) at t = 0",
    ),
    "a motion that is turned at the start": (
        lambda: rod(ends="clamped", motion=lambda t: (-jnp.eye(2), jnp.zeros(2) + t)),
        r"`motion` must be \(1, 0\) at t = 0",
    ),
    "a motion that is no rotation": (
        lambda: rod(ends="clamped", motion=lambda t: ((1 + t) * jnp.eye(2), jnp.zeros(2))),
        "R of `motion` must be a rotation, but at t = 0.1 s",
    ),
    "derivatives by a number of a motion": (
        lambda: slope_of_motion(),
        "uses a value from outside that JAX is tracing: put it into co.Parameters",
    ),
    "a ring that starts straight": (
        lambda: rods.planar_start(rod(ends="ring")),
        "A ring must start closed, but .* its end is 1 m away .*: give `curvature`; .* 2π/L = 6.28319",
    ),
    "an element that turns too far": (
        lambda: rods.planar_start(rod(), curvature=[0.0, 10.0, 0.0]),
        "turn by less than π, but of `curvature` element 1 turns by 3.333 rad: take more elements",
    ),
    "a rest that turns too far": (
        lambda: rods.planar_start(rod(rest_curvature=-20.0), curvature=0.0),
        "of `rest_curvature` element 0 turns by 6.667 rad",
    ),
    "a start of members that turn otherwise": (
        lambda: rods.planar_start(rod(rest_curvature=0.0).replace(rest_curvature=co.each([[0.0] * 3, [0.1] * 3]))),
        "follows from its `rest_curvature`, of which members have several, .*, or give `curvature`",
    ),
    "a member whose rest turns too far": (
        lambda: rods.planar_start(rod().replace(rest_curvature=co.each([[0.0] * 3, [0.0, 10.0, 0.0]])), curvature=0.0),
        "of `rest_curvature` element 1 turns by 3.333 rad",
    ),
    "no direction of gravity": (
        lambda: rods.planar_start(rod(gravity=9.8), down=(0, -2)),
        "`down` must be a unit vector, but has length 2",
    ),
    "places of pendulums": (
        lambda: rods.centerline(rods.pendulums_start(pendulum())),
        "must be a state or records of a rod, as run.final and run.records",
    ),
    "places of a run": (lambda: rods.centerline(rod()), "must be a state or records of a rod"),
    "rest of other elements": (
        lambda: rods.equilibrium(rod(), rods.planar_start(rod(elements=5))),
        "`state` must be a state of this planar rod",
    ),
    "rest where nothing holds": (
        lambda: rods.equilibrium(rod(load=(0.0, 1e-3)), rods.planar_start(rod(load=(0.0, 1e-3)))),
        "no state of rest: nothing holds it, and what acts on it does not balance",
    ),
    "a couple where nothing holds": (
        lambda: rods.equilibrium(rod(moment=1.0), rods.planar_start(rod(moment=1.0))),
        "what acts on it does not balance",
    ),
    "a couple for which elements are too few": (
        lambda: rods.equilibrium(rod(ends="clamped", moment=60.0), rods.planar_start(rod(ends="clamped", moment=60.0))),
        "No state of rest was found: .* or take more elements, of which each turns by less than π",
    ),
    "derivatives of a state of rest": (lambda: slope_of_rest(), "have no derivatives by JAX: take differences"),
    "modes of a rod that falls": (
        lambda: rods.modes(weighted(), rods.planar_start(weighted())),
        r"must be a state of rest: take rods.equilibrium\(rod, state\)",
    ),
    "more sections than there is memory": (
        lambda: rod_in_space(elements=10**8),
        r"A rod of 100000000 elements would take 2e\+04 GB of memory, and .* GB: take up to \d+ elements",
    ),
    "modes of too many sections": (
        lambda: rods.modes(rod_in_space(elements=300), rods.start(rod_in_space(elements=300))),
        "a dense matrix of at most 1500 unknowns, but this has 1806",
    ),
}


DEAR = ("a couple for which elements are too few", "rest where nothing holds", "modes of a rod that falls",
        "modes of too many sections")  # fmt: skip


@pytest.mark.parametrize(
    ("call", "says"),
    [pytest.param(*use, id=name, marks=pytest.mark.long if name in DEAR else ()) for name, use in RODS.items()],
)
def test_a_wrong_use_of_a_rod_is_told_in_a_sentence(call, says):
    with pytest.raises(CoadjointError, match=says) as caught:
        call()
    assert len(str(caught.value)) < 400 and "\n" not in str(caught.value)


@pytest.mark.cases(1)
@pytest.mark.parametrize(("ends", "least"), [("free", 1), ("clamped", 1), ("both clamped", 2), ("ring", 3)])
@pytest.mark.parametrize("space", [False, True])
def test_the_smallest_rod_of_every_kind_of_ends_starts(ends, least, space):
    circle = 2 * np.pi if ends == "ring" else 0.0
    if space:
        state = rods.start(rod_in_space(elements=least, ends=ends), curvature=(0.0, 0.0, circle))
    else:
        state = rods.planar_start(rod(elements=least, ends=ends), curvature=circle)
    assert all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves((state.g, state.mu)))


@pytest.mark.cases(1)
@pytest.mark.parametrize("ends", ["clamped", pytest.param("free", marks=pytest.mark.long)])
def test_a_rod_whose_strains_move_a_little_has_sections_that_move_alike(ends):
    """The sections are rebuilt from the clamp, or from the first one, and are g exp(η) to first order."""
    made = rod(elements=2, ends=ends)
    state = rods.planar_start(made, position=(0.3, -0.2), angle=0.4, curvature=0.6)
    a0 = evaluate(lambda g, a: made.advected.act(made.group, g, a), state.g, state.a)
    eta = np.sin(np.arange(float(made.group.dim)))
    for size, within in ((0.0, 1e-14), (1e-5, 1e-9)):
        found = statics._moved(made, state, a0, size * eta)
        moved = evaluate(lambda g, x: made.group.compose(g, made.group.exp(x)), state.g, size * eta)
        for one, expected in zip(found.g, moved, strict=True):
            np.testing.assert_allclose(one, expected, atol=within)
    assert not np.any(found.mu) and np.max(np.abs(found.a - state.a)) > 1e-7


def test_a_motion_may_end_with_the_run():
    driven = rod(ends="clamped", motion=lambda t: (jnp.eye(2) * jnp.where(t < 5, 1.0, jnp.nan), jnp.zeros(2)))
    assert np.all(rods.planar_start(driven).mu == 0)


@pytest.mark.long
def test_members_at_rest_in_several_curvatures_start_in_one():
    several = rod(ends="clamped").replace(rest_curvature=co.each([[0.0] * 3, [0.5] * 3]))
    fleet = co.simulate(several, rods.planar_start(several, curvature=0.0), dt=1e-3, steps=3, accuracy=False)
    straight, bent = np.max(np.abs(fleet.final.mu), axis=1)
    assert straight < 1e-10 and bent > 1e-6
