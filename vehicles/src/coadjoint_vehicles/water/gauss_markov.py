"""A random current: a Gauss–Markov process whose statistics do not depend on the step."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.errors import ArgumentError
from coadjoint.extending import evaluate
from coadjoint.mechanics import jumped
from coadjoint.mechanics.members import Each
from coadjoint.models.quantities import positive, vector
from coadjoint.spaces import Named
from coadjoint_vehicles.water.random_numbers import normal, stream
from coadjoint_vehicles.water.water import Water


@dataclass(frozen=True, eq=False)
class GaussMarkovCurrent(Water):
    """c = mean + deviation·z everywhere, with dz = −z dt/τ + √(2/τ) dW in each direction (Ornstein and Uhlenbeck).

    From node to node z ← e^{−h/τ} z + √(1 − e^{−2h/τ}) ζ with ζ normal: the exact law of the process, so that mean,
    variance and the correlation e^{−|t|/τ} are the same whatever the step. z goes straight from node to node, so that ℓ
    has its mean over a step; it begins with its stationary law. deviation: standard deviations, (3,) m/s: north, east,
    down. correlation_time: τ, s. mean: (3,) m/s. seed: an integer ≥ 0; for an ensemble, co.each of integers:
    random numbers are MRG32k3a's, and members with different seeds are independent. Raises ArgumentError for τ ≤ 0,
    negative deviations, and invalid seeds.
    """

    deviation: Any
    correlation_time: Any
    mean: PyTree = (0.0, 0.0, 0.0)
    seed: Any = 0

    steady = False

    def __post_init__(self) -> None:
        deviation = vector(self.deviation, "deviation")
        if np.any(np.asarray(deviation) < 0):
            raise ArgumentError(f"Argument `deviation` must not be negative, but is {np.asarray(deviation).tolist()}.")
        object.__setattr__(self, "deviation", deviation)
        object.__setattr__(self, "correlation_time", positive(self.correlation_time, "correlation_time"))
        object.__setattr__(self, "mean", vector(self.mean, "mean"))
        fits = isinstance(self.seed, (Each, int, np.integer))
        checks.expect(fits, self.seed, "seed", "a whole number, or co.each of them")
        if isinstance(self.seed, Each) and len(set(np.ravel(self.seed.values))) < len(self.seed):
            raise ArgumentError("Argument `seed` must have another number for each member, but some are the same.")
        _ = self._begun

    def parameters(self) -> dict[str, PyTree]:
        return {"deviation": self.deviation, "correlation_time": self.correlation_time, "mean": self.mean}

    def start(self) -> dict[str, PyTree]:
        return self._begun

    @cached_property
    def _begun(self) -> dict[str, PyTree]:
        many = isinstance(self.seed, Each)
        states = np.array([stream(seed) for seed in (self.seed.values if many else [self.seed])])
        z, states = (np.asarray(part) for part in evaluate(jax.vmap(lambda state: normal(state, 3)), states))
        return {"z": Each(z), "random": Each(states)} if many else {"z": z[0], "random": states[0]}

    def seeded(self, seed: object) -> GaussMarkovCurrent:
        return replace(self, seed=seed)

    def advance(self, internal: Named, h: Scalar, own: Named) -> dict[str, PyTree]:
        zeta, random = normal(internal.random, 3)
        kept = jnp.exp(-h / own.correlation_time)
        return {
            "z": kept * internal.z + jnp.sqrt(-jnp.expm1(-2 * h / own.correlation_time)) * zeta,
            "random": jumped(random),
        }

    def current(self, position: Array, t: Scalar, internal: PyTree, own: PyTree) -> Array:
        return own.mean + own.deviation * internal.z
