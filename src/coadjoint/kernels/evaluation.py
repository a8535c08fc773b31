"""Evaluate a traceable function on NumPy arrays, for set-up and checks."""

from __future__ import annotations

import jax
import numpy as np


def evaluate(function, *arguments):
    with jax.enable_x64(True):
        return jax.tree.map(np.asarray, jax.jit(function)(*arguments))
