"""A symmetric discrete Lagrangian of one's own is of order 2 and the base of compositions; others are refused."""

from __future__ import annotations

import numpy as np
import pytest

import coadjoint as co

INERTIA, LEVER = np.array([1.0, 1.5, 2.0]), np.array([0.2, 0.1, 1.0])


def potential_at_both_nodes(xi, a, h):
    """The trapezoidal rule of a heavy body: ½ξᵀJξ − ½c·(a + F⁻¹a)."""
    back = co.Cayley().tau(co.SO3(), -h * xi)
    return h * (0.5 * xi @ (INERTIA * xi) - 0.5 * LEVER @ (a + back @ a))


def potential_at_the_left_node(xi, a, h):
    return h * (0.5 * xi @ (INERTIA * xi) - LEVER @ a)


def body(discrete, **more):
    return co.System(
        co.SO3(),
        lambda xi, a: 0.5 * xi @ (INERTIA * xi) - LEVER @ a,
        advected=co.Defining(),
        discrete_lagrangian=discrete,
        **more,
    )


def run(system, method, steps):
    start = system.state(xi=[0.3, -0.4, 1.0], a0=[0.0, 0.0, 1.0])
    return co.trajectory(system, start, dt=1.0 / steps, steps=steps, method=method).final.mu


@pytest.mark.cases(1)
@pytest.mark.parametrize(("method", "order"), [(lambda b: b, 2), (co.Suzuki4, 4)], ids=["alone", "Suzuki4"])
def test_a_symmetric_rule_of_ones_own_has_order_two_and_composed_four(method, order):
    system = body(potential_at_both_nodes)
    rule = method(co.Variational(symmetric=True))
    exact = run(system, co.methods.KahanLi8(co.Midpoint()), 160)
    errors = [np.max(np.abs(run(system, rule, n) - exact)) for n in (10, 20)]
    assert rule.order == order
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.15)


def test_a_rule_that_only_says_that_it_is_symmetric_is_refused():
    with pytest.raises(
        co.errors.ArgumentError, match=r"not symmetric: Λ.* leave out `symmetric`, or use co\.methods\.Symmetrised"
    ):
        run(body(potential_at_the_left_node), co.Suzuki4(co.Variational(symmetric=True)), 10)
    pushed = body(potential_at_both_nodes, forces=lambda motion: co.Force(torque=-0.1 * motion.xi))
    with pytest.raises(co.errors.ArgumentError, match=r"Forces stand at the left node .* leave out `symmetric`"):
        run(pushed, co.Variational(symmetric=True), 10)
    with pytest.raises(co.errors.ArgumentError, match=r"one of your own says so by `symmetric` and `order`"):
        co.Suzuki4(co.Variational())


@pytest.mark.long
def test_many_symmetric_runs_go_beside_one_another():
    system = body(potential_at_both_nodes)
    start = system.state(xi=co.each([[0.3, -0.4, 1.0], [0.1, 0.2, 2.0]]), a0=[0.0, 0.0, 1.0])
    options = {"dt": 0.1, "steps": 10, "monitors": False, "accuracy": False}
    beside = co.simulate(system, start, method=co.Suzuki4(co.Variational(symmetric=True)), **options)
    alone = run(system, co.Suzuki4(co.Variational(symmetric=True)), 10)
    np.testing.assert_allclose(beside.final.mu[0], alone, rtol=1e-12)


def test_the_members_of_an_ensemble_are_asked_for_symmetry_too():
    system = body(potential_at_the_left_node)
    start = system.state(xi=co.each(np.array([[0.3, -0.4, 1.0], [0.1, 0.0, 1.0]])), a0=[0.0, 0.0, 1.0])
    with pytest.raises(co.errors.ArgumentError, match="is not symmetric"):
        co.simulate(system, start, dt=0.1, steps=2, method=co.Variational(symmetric=True, start="velocity"))


@pytest.mark.cases(1)
@pytest.mark.parametrize("shares", [[0.5, 0.5, 1.0], [1.0, 0.5, 0.5]], ids=["the last is not", "the first is not"])
def test_every_member_is_asked_for_symmetry_with_its_own_parameters(shares):
    """The potential stands at the left node with one share, at the right one with the rest."""

    def discrete(xi, a, p, h):
        back = co.Cayley().tau(co.SO3(), -h * xi)
        return h * (0.5 * xi @ (INERTIA * xi) - LEVER @ (p.share * a + (1 - p.share) * back @ a))

    system = co.System(
        co.SO3(), discrete_lagrangian=discrete, advected=co.Defining(), parameters=co.Parameters(share=0.5)
    )
    start, fleet = system.state(mu=[0.3, -0.4, 1.0], a0=[0.0, 0.0, 1.0]), system.replace(share=co.each(shares))
    method = co.Suzuki4(co.Variational(symmetric=True))
    said = r"is not symmetric: Λ\(ξ, n, s, a; h\)" + (" of member 2 =" if shares[0] == 0.5 else " =")
    with pytest.raises(co.errors.ArgumentError, match=said):
        co.simulate(fleet, start, dt=0.1, steps=2, method=method)
    with pytest.raises(co.errors.ArgumentError, match=said):
        co.Stepper(fleet, start, dt=0.1, method=method)
    same = system.replace(share=co.each([0.5, 0.5, 0.5]))
    assert not co.simulate(same, start, dt=0.1, steps=2, method=method, accuracy=False).failures
