"""Projection onto a group removes round-off, and leaves none that has a sign and adds up over many steps."""

import jax
import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate

COUNT = 4_000


@pytest.mark.parametrize("group", [co.SO2(), co.SO3(), co.SOn(4), co.groups.UnitQuaternion()], ids=repr)
def test_what_projection_leaves_has_no_sign(group):
    """The mean of gᵀg − 1 over products near the identity, in longer precision, is within five standard errors."""
    random = np.random.default_rng(20260118)
    xi = 0.1 * random.normal(size=(2, COUNT, group.dim))
    tau = co.Exponential()

    def projected(xi, eta):
        return group.project(group.compose(tau.tau(group, xi), tau.tau(group, eta)))

    g = np.asarray(evaluate(jax.vmap(projected), *xi)).astype(np.longdouble)
    if g.ndim == 2:
        defect = np.sum(g * g, axis=1, keepdims=True) - 1
    else:
        defect = (np.swapaxes(g, 1, 2) @ g - np.eye(g.shape[1])).reshape(COUNT, -1)
    scatter = np.std(defect, axis=0) / np.sqrt(COUNT)
    assert np.abs(defect).max() <= 2e-15
    assert np.all(np.abs(defect.mean(axis=0)) <= 5 * scatter + 1e-18), defect.mean(axis=0) / np.finfo(float).eps
