"""A function of many rows with its derivatives, by machine code and by XLA."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np

from coadjoint.kernels.run.function import RowFunction, _by_xla


def bent(x, y):
    return jnp.stack([x[0] * y[0] + jnp.sin(x[1]), x[0] ** 2 - y[1], x[1] * y[1]])


def test_machine_code_and_xla_give_the_values_and_slopes_of_every_row():
    x, y = np.random.default_rng(3).normal(size=(2, 5, 2))
    values = np.stack([x[:, 0] * y[:, 0] + np.sin(x[:, 1]), x[:, 0] ** 2 - y[:, 1], x[:, 1] * y[:, 1]], axis=1)
    slopes = np.zeros((5, 3, 2))
    slopes[:, 0, 0], slopes[:, 0, 1], slopes[:, 1, 0], slopes[:, 2, 1] = y[:, 0], np.cos(x[:, 1]), 2 * x[:, 0], y[:, 1]
    native = RowFunction(bent, x[0], y[0])
    assert native.native is not None
    for call in (native, _by_xla(bent)):
        found, by_x = call(x, y)
        np.testing.assert_allclose(found, values, rtol=1e-14)
        np.testing.assert_allclose(by_x, slopes, rtol=1e-14, atol=1e-15)
