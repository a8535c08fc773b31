"""A space of a chain is that of one link on every link; spaces of opposite groups and submanifolds pass on the rest."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.groups import Opposite
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.spaces.by_inverse import ByInverse, by_inverse
from coadjoint.spaces.links import Links

FACTOR, COUNT = co.SO3(), 3
CHAIN = co.Power(FACTOR, COUNT)
SPHERE = co.Sphere(co.Defining())
RANDOM = np.random.default_rng(31)
ROWS = {
    "pull": "gxb", "push": "gxb", "act": "gx", "infinitesimal": "ex", "lifted": "exv", "diamond": "bx",
    "lifted_diamond": "bxv", "tangent": "xy", "coordinates": "xb", "project": "xb", "momentum": "xvb",
}  # fmt: skip


@pytest.mark.parametrize("space", [SPHERE, co.Defining()], ids=["curved", "flat"])
def test_operations_on_links_are_those_of_each_link(space):
    links, given = Links(space), RANDOM.normal(size=(4, COUNT, 3))
    given[0] /= np.linalg.norm(given[0], axis=1)[:, None]
    g = evaluate(jax.vmap(FACTOR.exp), RANDOM.normal(size=(COUNT, 3)))

    def both(x, v, b, e, g):
        known, found = {"x": x, "v": v, "b": b, "e": e, "y": v[:, : space.dim(FACTOR)]}, {}
        for name, takes in ROWS.items():
            flat = [g if one == "g" else known[one].ravel() for one in takes]
            each = jax.vmap(lambda *row, name=name: getattr(space, name)(FACTOR, *row))
            there = each(*(g if one == "g" else known[one] for one in takes))
            found[name] = getattr(links, name)(CHAIN, *flat), jnp.ravel(there)
        return found

    for name, (found, expected) in evaluate(both, *given, g).items():
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14, err_msg=name)
    assert links.dim(CHAIN) == COUNT * space.dim(FACTOR) and links.flat is space.flat


def test_a_chain_is_off_its_space_as_far_as_its_furthest_link_and_points_are_of_one_or_all():
    links, x = Links(SPHERE), np.repeat(np.eye(3)[:1], COUNT, axis=0)
    assert evaluate(lambda x: links.defect(CHAIN, x), np.ravel(x * [[1.0], [2.0], [1.0]])) == pytest.approx(
        float(SPHERE.defect(FACTOR, np.array([2.0, 0.0, 0.0])))
    )
    assert Links(co.Defining()).defect(CHAIN, np.ravel(x)) == 0.0
    assert links.point(CHAIN, [0.0, 1.0, 0.0], "q").tolist() == [0.0, 1.0, 0.0] * COUNT
    assert links.point(CHAIN, np.eye(3), "q").tolist() == np.ravel(np.eye(3)).tolist()
    assert links.view(CHAIN, np.arange(9.0)).tolist() == np.arange(9.0).reshape(3, 3).tolist()


def test_a_space_of_the_opposite_group_has_points_and_names_of_its_own_space():
    several = co.spaces.Several({"place": co.Defining(), "still": co.Trivial(2)})
    turned, opposite = by_inverse(several), Opposite(co.SO3())
    assert by_inverse(co.Trivial(2)) == co.Trivial(2) and turned.factors == (ByInverse(co.Defining()), co.Trivial(2))
    assert ByInverse(several).components(opposite, "q") == several.components(co.SO3(), "q")
    sphere = ByInverse(SPHERE)
    assert (sphere.flat, sphere.affine) == (False, SPHERE.affine) and ByInverse(co.Defining()).flat
    for give in (sphere.point, sphere.velocity):
        assert give(opposite, [0.0, 0.6, 0.8], "q").tolist() == [0.0, 0.6, 0.8]
    assert sphere.view(opposite, np.arange(3.0)).tolist() == [0.0, 1.0, 2.0]
    assert np.array_equal(
        sphere.sample(opposite, np.random.default_rng(3)), SPHERE.sample(co.SO3(), np.random.default_rng(3))
    )


def test_a_random_point_of_a_submanifold_lies_in_it_next_to_one_of_the_space_around():
    shell = co.spaces.Submanifold(lambda x: jnp.stack([x @ x - 4.0]), co.Defining())
    x = shell.sample(co.SO3(), np.random.default_rng(8))
    around = co.Defining().sample(co.SO3(), np.random.default_rng(8))
    assert x @ x == pytest.approx(4.0, rel=1e-12) and np.linalg.norm(np.cross(x, around)) < 1e-12 and x @ around > 0
    never = co.spaces.Submanifold(lambda x: jnp.stack([x @ x + 1.0]), co.Defining())
    assert np.array_equal(never.sample(co.SO3(), np.random.default_rng(8)), around)
    g = evaluate(co.SO3().exp, np.array([0.3, -0.2, 0.9]))
    for name in ("push", "pull"):
        found, expected = (getattr(s, name)(co.SO3(), g, x, x + 1) for s in (shell, co.Defining()))
        assert np.array_equal(found, expected)
    assert shell.components(co.SO3(), "q") == co.Defining().components(co.SO3(), "q")
    assert shell.velocity(co.SO3(), [1.0, 2.0, 3.0], "qdot").tolist() == [1.0, 2.0, 3.0]
