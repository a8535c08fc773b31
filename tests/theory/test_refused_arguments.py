"""What the theory is not asked for: members, instants of other steps, parts of steps, parameters that are missing."""

from __future__ import annotations

from functools import partial

import jax
import numpy as np
import pytest

import coadjoint as co
from coadjoint import theory
from coadjoint.theory import instant
from discrete import at, velocity

SO3, H, DOWN = co.SO3(), 0.1, [0, 0, 1.0]
PARAMETERS = {"J": [1.0, 2.0, 3.0], "weight": 1.0}
SUZUKI = co.Suzuki4(co.Midpoint(), negative_substeps="allow")


def _discrete(F, a, p, h):
    z = velocity(SO3, F, h)
    return h * (0.5 * z @ (p.J * z) - p.weight * a[2])


def _lagrangian(xi, a, p):
    return 0.5 * xi @ (p.J * xi) - p.weight * a[2]


TOP = co.System(SO3, group_lagrangian=_discrete, advected=co.Defining(), parameters=PARAMETERS)
SMOOTH = co.System(SO3, _lagrangian, advected=co.Defining(), parameters=PARAMETERS)
START = {"xi": [0.3, 1.0, 0.2], "a0": DOWN}


@pytest.fixture(scope="module")
def path():
    how = {"dt": H, "steps": 4, "method": co.methods.GroupVariational(co.Cayley(), "velocity"), "progress": False}
    run = co.simulate(TOP, TOP.state(**START), **how)
    return theory.Configuration(run.records.g, run.records.q)


@pytest.mark.long
def test_the_legendre_transforms_of_a_composition_are_found_for_all_members():
    """F⁻ is the momentum of the records, F⁺ that of the next."""
    start = SMOOTH.state(xi=co.each([[0.3, 1.0, 0.2], [0.1, 2.0, 0.2]]), a0=DOWN)
    records = co.simulate(SMOOTH, start, dt=H, steps=3, method=SUZUKI, progress=False).records
    found = theory.discrete_legendre(SMOOTH, SUZUKI, records, H)
    np.testing.assert_allclose(found.minus.mu, records.mu, atol=1e-13)
    np.testing.assert_allclose(found.plus.mu[:, :-1], records.mu[:, 1:], atol=1e-13)
    space = theory.discrete_momentum_maps(SMOOTH, SUZUKI, records, H)
    np.testing.assert_allclose(space.plus[..., 2], space.minus[..., 2], atol=1e-13)


def test_a_part_of_a_step_that_led_to_an_event_has_another_transform_and_is_refused():
    run = co.simulate(
        SMOOTH, SMOOTH.state(**START), dt=H, steps=40, until=lambda motion: motion.t - 0.75, progress=False
    )
    with pytest.raises(
        co.errors.ArgumentError, match=r"some are 0.05 s: give the `h` of the run, and of a run that ended"
    ):
        theory.discrete_legendre(SMOOTH, co.Midpoint(), run.records, H)
    records = jax.tree.map(lambda leaf: leaf[:-2], run.records)
    found = theory.discrete_legendre(SMOOTH, co.Midpoint(), records, H)
    np.testing.assert_allclose(found.plus.mu[:-1], records.mu[1:], atol=1e-13)


@pytest.mark.parametrize(
    ("space", "rail"), [(co.Defining(), co.Nonholonomic(lambda n: [0.0, 0, 0, 0, 1, n[0]])), (co.Sphere(), None)]
)
def test_tangents_need_holonomic_constraints_alone_and_a_flat_space(space, rail):
    constraints = {"height": co.Holonomic(lambda n: n[2] - 0.3), **({"rail": rail} if rail else {})}
    system = co.System(SO3, lambda xi, n, nu: 0.5 * xi @ xi + nu @ nu, additional=space, constraints=constraints)
    with pytest.raises(co.errors.ArgumentError, match="need holonomic constraints on a flat space"):
        theory.off_constraints(system, None, None)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("lagrangian", "given"),
    [
        (lambda xi: 0.5 * xi @ xi, {"forces": {"drag": lambda motion: co.Force(-motion.xi)}}),
        (lambda xi, *, t: 0.5 * xi @ xi * (1 + t * t), {}),
        (lambda xi, *, internal: 0.5 * xi @ xi * (1 + internal.x), {"internal": lambda motion, h: {"x": 0.0}}),
    ],
    ids=["forces", "time", "internal"],
)
def test_steps_that_depend_on_when_they_start_need_an_instant(lagrangian, given):
    with pytest.raises(co.errors.ArgumentError, match="depend on when they start"):
        instant.given(co.System(SO3, lagrangian, **given), theory.Instant())
    assert instant.given(co.System(SO3, lambda xi: 0.5 * xi @ xi), theory.Instant()) == (0.0, None, None)


def test_members_are_refused_by_every_function_in_one_sentence(path):
    fleet, smooth = TOP.replace(weight=co.each([1.0, 2.0])), SMOOTH.replace(weight=co.each([1.0, 2.0]))
    link = at(theory.reduced_path(TOP.places, path, DOWN), 0)
    state = SMOOTH.state(**START)
    poisson = theory.poisson_link(SO3, link)
    for call in (
        partial(theory.discrete_euler_poincare_algorithm, fleet, link, H, 2),
        partial(theory.left_momenta, fleet, link, H),
        partial(theory.link_momentum_maps, fleet, np.eye(3), link, H),
        partial(theory.poisson_algorithm, theory.poisson_lagrangian(fleet), poisson, H, 2),
        partial(theory.reduce, theory.unreduce(fleet)),
        partial(theory.reduce_continuous, theory.unreduce_continuous(smooth)),
        partial(theory.action, theory.unreduce(fleet), path, np.array(DOWN), H),
        partial(theory.discrete_legendre, smooth, co.Midpoint(), state, H),
        partial(theory.discrete_momentum_maps, smooth, SUZUKI, state, H),
        partial(theory.equations_of, smooth, co.Midpoint(), state, H),
    ):
        with pytest.raises(
            co.errors.ArgumentError, match=r"that of one system, but parameters of this one are co.each"
        ):
            call()
    with pytest.raises(co.errors.ArgumentError, match="but is an ensemble"):
        theory.printed_equations(co.simulate(smooth, state, dt=H, steps=1, progress=False))


def test_sequences_whose_parts_do_not_belong_together_are_refused_in_one_sentence(path):
    L, links = theory.unreduce(TOP), theory.reduced_path(TOP.places, path, DOWN)
    first, second = at(path, 0), at(path, 1)
    nothing = np.zeros(0)
    for call, says in (
        (partial(theory.action, L, path, np.array(DOWN), H, theory.Instant(0.3)), "instants of all 4 steps"),
        (partial(theory.action, L, path, np.array(DOWN), H, theory.Instant(np.zeros(5))), "instants of all 4 steps"),
        (partial(theory.reduced_path, TOP.places, path, DOWN, theory.Instant(0.3)), "instants of all 4 steps"),
        (partial(theory.reduced_path, TOP.places, path), "advected parameters: give `a0`"),
        (partial(L, first, second, None, H), "advected parameters: give `a0`"),
        (partial(theory.discrete_euler_lagrange_algorithm, L, first, second, None, H, 3), "give `a0`"),
        (
            partial(theory.unreduce_continuous(SMOOTH), theory.Configuration(np.eye(3), nothing),
                    theory.Configuration(np.zeros((3, 3)), nothing), None),
            "give `a0`",
        ),
        (partial(theory.discrete_euler_lagrange_algorithm, L, first, second, DOWN, H, 0), "whole number from 1"),
        (partial(theory.discrete_euler_poincare_algorithm, TOP, at(links, 0), H, 2.5), "whole number from 1"),
        (partial(theory.reconstruct, TOP.places, np.eye(3), at(links, 0)), "one link or more with a leading axis"),
        (partial(theory.reconstruct, TOP.places, np.eye(3), at(links, slice(0))), "one link or more"),
    ):  # fmt: skip
        with pytest.raises(co.errors.ArgumentError, match=says):
            call()
