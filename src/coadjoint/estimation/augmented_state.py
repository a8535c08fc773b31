"""The numbers θ that a filter estimates with the motion: parameters that drift, and biases that only sensors read."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.errors import ArgumentError, shown
from coadjoint.estimation.drifts import Drift, GaussMarkov, finite, require_drift
from coadjoint.kernels.packing import pack
from coadjoint.kernels.trace.evaluate import traced
from coadjoint.methods.program import Constants
from coadjoint.simulation.steppers.beginning import shapes_of
from coadjoint.spaces.named import Named

FAR = 5.0
"""The largest distance of a Gauss–Markov process from its mean at the start, in deviations."""


class Drifting:
    """θ (k,), by names, each of which drifts by itself: θ⁺ = m + φ(h)(θ − m) + w.

    sizes: name → count of numbers. drifts: name → its `Drift`, in the same order.
    """

    def __init__(self, sizes: Mapping[str, int], drifts: Mapping[str, Drift]):
        self.sizes, self._drifts = dict(sizes), dict(drifts)
        for name, drift in self._drifts.items():
            for what in ("deviation", "density", "mean"):
                checks.shape(getattr(drift, what, 0.0), f"`{what}` of how `{name}` drifts", (), (self.sizes[name],))
        self.count = sum(self.sizes.values())
        self.means = self._each(0.0, lambda drift: drift.mean)

    def require_near(self, first: np.ndarray) -> None:
        """Raise ArgumentError if a Gauss–Markov process begins implausibly far from its mean."""
        for name, here in self.slices.items():
            drift = self._drifts[name]
            if isinstance(drift, GaussMarkov) and np.any(
                np.abs(first[here] - self.means[here]) > FAR * np.broadcast_to(drift.deviation, (self.sizes[name],))
            ):
                raise ArgumentError(
                    f"`{name}` begins at {shown(first[here].tolist())} and would decay to the mean "
                    f"{shown(self.means[here].tolist())} of its co.estimation.GaussMarkov, more than {FAR:g} "
                    "deviations away: give `mean`, or a co.estimation.RandomWalk."
                )

    @property
    def slices(self) -> dict[str, slice]:
        """Name → the slice of its numbers in θ."""
        ends = np.cumsum([0, *self.sizes.values()]).tolist()
        return {name: slice(*pair) for name, *pair in zip(self.sizes, ends[:-1], ends[1:], strict=True)}

    def moved(self, theta: Array, h: Scalar) -> Array:
        """θ (…, k) after a step of h without noise."""
        return self.means + (theta - self.means) * self._each(h, lambda drift: drift.factor(h))

    def variances(self, h: Scalar) -> Array:
        """q(h) of every number, (k,)."""
        return self._each(h, lambda drift: drift.variance(h))

    def named(self, theta: Array) -> Named:
        """θ by names."""
        return Named(**{name: theta[here] for name, here in self.slices.items()})

    def _each(self, h: Scalar, value: Callable[[Drift], PyTree]) -> Array:
        xp = jnp if traced(h) else np
        parts = [xp.broadcast_to(value(drift), (self.sizes[name],)) for name, drift in self._drifts.items()]
        return xp.concatenate(parts) if parts else np.zeros(0)


class DriftingParameters(Drifting):
    """Parameters of a system that are part of the state, then biases, which begin at 0 and are not parameters.

    constants: of the step. drifting, biases: name → `Drift`. Raises ArgumentError for unknown parameters and for a bias
    whose drift has no definite size.
    """

    def __init__(self, constants: Constants, drifting: Mapping[str, Drift], biases: Mapping[str, Drift]):
        self._layout, self._values = pack(constants)
        known = _places(constants)
        checks.all_known(drifting, known, "parameter", "The system")
        for name, drift in {**drifting, **biases}.items():
            require_drift(drift, name)
        sizes = {name: len(known[name]) for name in drifting}
        self.places = np.array([i for name in drifting for i in known[name]], int)
        self._biases = Drifting({name: _count(name, drift) for name, drift in biases.items()}, biases)
        super().__init__({**sizes, **self._biases.sizes}, {**drifting, **biases})
        self.first = np.concatenate([self._values[self.places], np.zeros(self._biases.count)])
        self.require_near(self.first)

    def true(self, constants: Constants, known: Mapping[str, object], count: int) -> np.ndarray:
        """θ at `count` nodes, (count, k), of a system with these constants; `known` values, name → numbers or (count,
        numbers), take their place. Raises ArgumentError unless both determine all of θ."""
        places, values = _places(constants), pack(constants)[1]
        checks.all_known(known, self.sizes, "drifting number", "Argument `known`: the process")
        found = []
        for name, size in self.sizes.items():
            if name not in known and (name in self._biases.sizes or len(places.get(name, ())) != size):
                raise ArgumentError(
                    f"Argument `truth` lacks `{name}`, which the filter estimates: give known={{{name!r}: …}}."
                )
            value = finite(known[name], name, "`known`") if name in known else values[list(places[name])]
            if np.shape(value) not in ((), (size,), (count, size)):
                raise ArgumentError(
                    f"`{name}` of `known` must be {size} numbers, or ({count}, {size}) at the nodes, but has the shape "
                    f"{np.shape(value)}."
                )
            found.append(np.broadcast_to(value, (count, size)))
        return np.concatenate([np.zeros((count, 0)), *found], axis=1)

    def biases(self, theta: Array) -> Named:
        """The biases of θ by names, each (size,)."""
        return self._biases.named(theta[len(self.places) :])

    def replaced(self, theta: Array) -> Constants:
        """The constants with θ in their places."""
        if not len(self.places):
            return self._layout.unpack(self._values)
        numbers = list(self._values)
        for i, place in enumerate(self.places):
            numbers[place] = theta[i]
        joined: object = jnp.stack([jnp.asarray(one, dtype=float) for one in numbers])
        return self._layout.views(joined)


def _places(constants: Constants) -> dict[str, range]:
    """Name of a parameter → the slice of its numbers among those of the constants."""
    known, start = {}, 0
    for name, shape in shapes_of(constants).items():
        size = int(np.prod(shape, dtype=int))
        known[name.removeprefix("system.")] = range(start, start + size)
        start += size
    return known


def _count(name: str, drift: Drift) -> int:
    """The size of a bias: that of its drift."""
    sizes = [np.size(getattr(drift, what)) for what in ("deviation", "density", "mean") if hasattr(drift, what)]
    if not name.isidentifier():
        raise ArgumentError(f"A bias must have a name such as `gyroscope`, but is called {shown(name)}.")
    return max(sizes)
