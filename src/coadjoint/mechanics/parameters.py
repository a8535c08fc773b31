"""The parameters of a system: named float64 arrays, the leaves that one differentiates, varies and replaces."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import jax

from coadjoint.mechanics.each import Each
from coadjoint.spaces.named import Named, require_names
from coadjoint.spaces.numbers import float64


@jax.tree_util.register_pytree_with_keys_class
class Parameters(Named):
    """Named parameters, kept as float64 and read as attributes: `p.mass`, `p.rudder.area`.

        p = co.Parameters(mass=123.8, inertia=np.diag([5.46, 5.29, 5.72]), rudder=dict(area=0.02))
        p.replace(mass=130.0)

    **values: each a number, an array of any shape, a nested dictionary of these, or `co.each` of them. Units are those
    of the Lagrangian that reads them; models and vehicles use SI. They are a PyTree: JAX differentiates by them.

    Raises ArgumentError for float32, complex numbers, text and values that are not finite.
    """

    __slots__ = ()

    def __init__(self, **values: Any):
        super().__init__(**{name: _leaf(name, value) for name, value in values.items()})


def _leaf(name: str, value: Any) -> Any:
    if isinstance(value, Each):
        return value
    if isinstance(value, Mapping):
        require_names(value)
        return Parameters(**value)
    if isinstance(value, Named):
        return value if isinstance(value, Parameters) else Parameters(**value.asdict())
    return float64(value, f"Parameter `{name}`")
