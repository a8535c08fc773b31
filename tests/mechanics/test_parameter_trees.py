"""Parameters that are PyTrees: lists of layers of a network, of which each leaf is a parameter."""

from __future__ import annotations

from collections import namedtuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import ArgumentError
from coadjoint.paths import paths

Layer = namedtuple("Layer", "weight bias")


def layers(scale=1.0):
    return [{"weight": scale * np.ones((4, 6)), "bias": np.zeros(4)}, Layer(scale * np.ones((1, 4)), 0.0)]


def test_lists_of_layers_keep_their_form_and_lists_of_numbers_are_arrays():
    p = co.Parameters(net=layers(), center=[0, 0, 1], rows=[[1, 2], [3, 4]], ragged=[np.ones(2), np.ones(3)])
    assert list(paths(p))[:4] == ["net[0].weight", "net[0].bias", "net[1][0]", "net[1][1]"]
    assert p.net[0].weight.shape == (4, 6) and isinstance(p.net[1], Layer)
    assert p.center.shape == (3,) and p.rows.shape == (2, 2) and len(p.ragged) == 2
    assert all(leaf.dtype == np.float64 for leaf in jax.tree.leaves(p))


def test_a_list_is_replaced_by_one_of_its_structure():
    p = co.Parameters(net=layers())
    twice = p.replace(net=jax.tree.map(lambda leaf: 2 * leaf, p.net))
    assert np.all(twice.net[0].weight == 2)
    sorted_keys = [{"bias": np.ones(4), "weight": np.ones((4, 6))}, twice.net[1]]
    assert jax.tree.structure(p.replace(net=sorted_keys)) == jax.tree.structure(p)
    assert jax.tree.structure(twice) == jax.tree.structure(p)


WRONG = [
    ({"net": layers()[:1]}, "a list or another PyTree of 4 arrays: replace it by one of the same structure"),
    ({"net": 3.0}, "of the same structure"),
    ({"net[0].weight": 3.0}, "within `net`, a list or another PyTree: replace net itself"),
    ({"net": {"weight": 3.0}}, "is a list, but is to be replaced by a dictionary"),
]


@pytest.mark.parametrize(("values", "says"), WRONG)
def test_another_structure_raises(values, says):
    with pytest.raises(ArgumentError, match=says):
        co.Parameters(net=layers()).replace(**values)


@pytest.mark.parametrize("value", [[np.tanh, np.ones(3)], [{"weight": np.float32(1.2)}], [[1, 2], [3]]])
def test_leaves_that_are_no_float64_numbers_raise(value):
    with pytest.raises(ArgumentError, match="Parameter `net"):
        co.Parameters(net=value)


@pytest.mark.long
def test_a_network_inside_the_lagrangian_keeps_its_structure_under_grad():
    def lagrangian(xi, a, p):
        hidden = jnp.tanh(p.net[0].weight @ jnp.concatenate([xi, a]) + p.net[0].bias)
        return 0.5 * xi @ xi + 0.1 * (p.net[1].weight @ hidden)[0]

    body = co.System(co.SO3(), lagrangian, advected=co.Defining(), parameters={"net": layers(0.1)})
    start = body.state(xi=[0.1, 0.2, 1.0], a0=[0, 0, 1])
    with co.float64():
        slope = jax.grad(lambda net: jnp.sum(body.replace(net=net).state(xi=start.xi, a0=start.a).mu))(
            body.parameters.net
        )
    assert jax.tree.structure(slope) == jax.tree.structure(body.parameters.net)
    assert all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves(slope))


def test_brackets_are_answered_by_the_attribute_that_reads_the_value():
    with pytest.raises(TypeError, match=r"read as attributes, as in p\.mass, and not by brackets as \['mass'\]"):
        co.Parameters(mass=2.0)["mass"]
