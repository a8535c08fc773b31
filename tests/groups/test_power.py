"""Powers of a group: the operations of every link, and what is no power."""

import jax
import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import GroupError
from coadjoint.kernels.trace.evaluate import evaluate

MAPS = [co.Cayley(), co.Exponential(), co.difference_maps.Squared(co.Cayley())]
RANDOM = np.random.default_rng(3)


def elements(group, xi):
    """The same element of Gᴺ and of the product of N factors."""
    return [evaluate(G.exp, xi) for G in (group, co.DirectProduct(*[group.factor] * group.count))]


def same(power, product):
    rows = [jax.tree.map(lambda leaf, i=i: np.asarray(leaf)[i], power) for i in range(len(product))]
    return all(
        np.allclose(a, b, rtol=0, atol=1e-14) for a, b in zip(*map(jax.tree.leaves, (rows, product)), strict=True)
    )


@pytest.mark.cases(2)
@pytest.mark.parametrize("factor", [co.SO3(), co.SE3(), co.SE2(), co.groups.UnitQuaternion()], ids=repr)
def test_a_power_is_the_product_of_its_links(factor):
    power, product = co.Power(factor, 3), co.DirectProduct(*[factor] * 3)
    xi, eta, mu = 0.4 * RANDOM.normal(size=(3, power.dim))
    g, G = elements(power, xi)
    h, H = elements(power, eta)
    assert same(evaluate(power.compose, g, h), list(evaluate(product.compose, G, H)))
    assert same(evaluate(power.inverse, g), list(evaluate(product.inverse, G)))
    assert same(evaluate(power.identity), list(evaluate(product.identity)))
    for name, arguments, others in (
        ("Ad", (g, eta), (G, eta)), ("Ad_dual", (g, mu), (G, mu)), ("ad", (xi, eta), (xi, eta)),
        ("ad_dual", (xi, mu), (xi, mu)), ("defect", (g,), (G,)), ("rotation_angle", (xi,), (xi,)),
    ):  # fmt: skip
        ours, theirs = evaluate(getattr(power, name), *arguments), evaluate(getattr(product, name), *others)
        assert np.allclose(ours, theirs, rtol=0, atol=1e-14), name


@pytest.mark.cases(1)
@pytest.mark.parametrize("tau", MAPS, ids=repr)
def test_difference_maps_act_on_every_link(tau):
    power, product = co.Power(co.SE3(), 2), co.DirectProduct(co.SE3(), co.SE3())
    xi, mu = 0.4 * RANDOM.normal(size=(2, power.dim))
    assert same(evaluate(lambda x: tau.tau(power, x), xi), list(evaluate(lambda x: tau.tau(product, x), xi)))
    for member in (tau.dtau, tau.dtau_inverse_dual):
        ours, theirs = (evaluate(lambda x, m, G=G, f=member: f(G, x, m), xi, mu) for G in (power, product))
        assert np.allclose(ours, theirs, rtol=0, atol=1e-13)
    assert float(evaluate(lambda x: tau.chart(power, x), xi)) == pytest.approx(
        max(float(evaluate(lambda x: tau.chart(co.SE3(), x), part)) for part in xi.reshape(2, 6))
    )


def test_a_power_of_a_thousand_links_forms_no_array_of_pairs_of_coordinates():
    power = co.Power(co.SE3(), 1000)
    assert (power.dim, power.matrix_size, len(power.pairs)) == (6000, 4, 999)
    with pytest.raises(GroupError, match="has no basis, because it would take"):
        _ = power.basis


def test_poses_between_links_are_carried_by_both_ends_and_by_the_ground():
    group, space = co.Power(co.SE3(), 3), co.spaces.RelativePoses([(0, 1), (-1, 0), (2, 0)])
    space.require_fit(group)
    random = np.random.default_rng(5)
    xi, eta = 0.5 * random.normal(size=(2, group.dim))
    e = space.point(group, None, "a0")
    g, one = evaluate(group.exp, eta), np.eye(4)
    matrices = [np.block([[R, x[:, None]], [np.zeros((1, 3)), 1.0]]) for R, x in zip(*map(np.asarray, g), strict=True)]
    moved = evaluate(lambda g: space.view(group, space.act(group, group.inverse(g), e)), g)
    for i, (first, second) in enumerate([(0, 1), (-1, 0), (2, 0)]):
        before = one if first < 0 else matrices[first]
        expected = np.linalg.inv(before) @ matrices[second]
        assert np.allclose(moved[0][i], expected[:3, :3], atol=1e-14)
        assert np.allclose(moved[1][i], expected[:3, 3], atol=1e-14)
    # Its own forms of ξ·e and b⋄e are those that follow from the action.
    at = np.concatenate([np.reshape(leaf, (3, -1)) for leaf in moved], axis=1).ravel()
    b, derived = random.normal(size=at.size), co.spaces.Space
    for name, arguments in (("infinitesimal", (xi, at)), ("diamond", (b, at))):
        ours = evaluate(lambda *x, name=name: getattr(space, name)(group, *x), *arguments)
        theirs = evaluate(lambda *x, name=name: getattr(derived, name)(space, group, *x), *arguments)
        assert np.allclose(ours, theirs, rtol=0, atol=1e-13), name


@pytest.mark.parametrize(
    ("made", "sentence"),
    [
        (lambda: co.Power("SO3", 3), "must be a Lie group such as SO3\\(\\), but is 'SO3'"),
        (lambda: co.Power(co.Power(co.SO3(), 2), 2), "must not be a power itself"),
        (lambda: co.Power(co.SO3(), 0), "must be a whole number from 1, but is 0"),
        (lambda: co.Power(co.SO3(), 2.5), "must be a whole number from 1, but is 2.5"),
        (lambda: co.Power(co.SO3(), 3, "line"), 'must be "chain", "ring", "all" or pairs of links, but is'),
        (lambda: co.Power(co.SO3(), 3, [0, 1]), "must be a list of pairs of links"),
        (lambda: co.Power(co.SO3(), 3, 7), "must be a list of pairs of links"),
        (lambda: co.Power(co.SO3(), 3, [(0, 3)]), "The pair \\(0, 3\\) of `coupling` must be of two links from 0 to 2"),
        (lambda: co.Power(co.SO3(), 3, [(1, 1)]), "and of different ones"),
        (lambda: co.spaces.RelativePoses([(0, 1, 2)]), "must be pairs of links such as"),
        (lambda: co.spaces.RelativePoses([(0.5, 1.7)]), "must be pairs of links such as"),
        (lambda: co.spaces.RelativePoses([(0, 9)]).require_fit(co.Power(co.SE3(), 3)), "or −1 for the ground"),
        (lambda: co.spaces.RelativePoses().require_fit(co.SE3()), "need a group of links such as co.Power"),
    ],
)
def test_what_is_no_power_is_told_in_a_sentence(made, sentence):
    with pytest.raises(GroupError, match=sentence):
        made()


@pytest.mark.parametrize(
    "made",
    [
        lambda power: co.groups.Opposite(power),
        lambda power: co.DirectProduct(power, co.SO3()),
        lambda power: co.SemidirectProduct(power, co.Defining()),
    ],
)
def test_a_power_within_another_group_is_refused(made):
    with pytest.raises(GroupError, match="must not hold a power, but got Power"):
        made(co.Power(co.SO3(), 3))


def test_poses_that_are_given_are_elements_of_the_group():
    group, space = co.Power(co.SO3(), 3), co.spaces.RelativePoses()
    rows = np.tile(np.eye(3), (2, 1, 1))
    assert np.array_equal(space.point(group, rows, "a0"), rows.ravel())
    rows[1, 0, 1] = 1e-3
    with pytest.raises(
        co.errors.ArgumentError, match=r"The pose of the pair \(1, 2\) in `a0` must be an element of SO3"
    ):
        space.point(group, rows, "a0")


def test_all_has_no_pairs_and_says_which_to_give():
    with pytest.raises(GroupError, match=r"give the pairs that are meant, as in co.spaces.RelativePoses\(\[\(0, 1\)"):
        co.spaces.RelativePoses().require_fit(co.Power(co.SO3(), 3, "all"))


@pytest.mark.long
def test_datasets_have_velocities_momenta_and_elements_by_links(tmp_path):
    chain = co.System(co.Power(co.SE2(), 3), lambda xi: 0.5 * (xi**2).sum())
    xi = np.arange(9.0).reshape(3, 3)
    options = {"dt": 0.01, "steps": 2, "accuracy": False}
    run = co.simulate(chain, chain.state(xi=xi), **options)
    assert run.dataset.xi.dims == run.dataset.mu.dims == ("time", "link", "algebra")
    assert run.dataset.R.dims == ("time", "link", "R_0", "R_1") and run.dataset.x.dims == ("time", "link", "x_0")
    np.testing.assert_allclose(run.dataset.mu[0], xi, atol=1e-14)
    stored = co.simulate(chain, chain.state(xi=xi), **options, store=tmp_path / "run").dataset
    np.testing.assert_array_equal(stored.xi.isel(link=1), run.dataset.xi.values[:, 1])
    members = co.simulate(chain, chain.state(xi=co.each(np.stack([xi, -xi]))), **options)
    assert members.dataset.mu.dims == ("member", "time", "link", "algebra")
    assert members.statistics("mu").mu.sel(statistic="mean").shape == (3, 3, 3)
