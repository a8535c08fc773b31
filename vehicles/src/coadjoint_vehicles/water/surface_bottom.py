"""Surface and bottom: events that end a run, and the height above the bottom."""

from __future__ import annotations

from collections.abc import Callable

import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array
from coadjoint.errors import ArgumentError
from coadjoint.extending import evaluate
from coadjoint.mechanics import State
from coadjoint.models.quantities import number
from coadjoint_vehicles.water.functions import returned

Event = Callable[[State], Array]


def at_surface(depth: object = 0.0) -> Event:
    """The event that the origin of the body comes to the surface, or up to a `depth` (m): `until=at_surface()`.

    A run may start there. Positive below.
    """
    above = number(depth, "depth")
    return _named(lambda state: state.q[2] - above, "surface")


def altitude(bottom: object) -> Event:
    """The height of the origin of the body above the bottom, m, as a function of the state.

    bottom: its depth in m, a number or a function (north, east) → depth in terms of jax.numpy. Raises ArgumentError.
    """
    if callable(bottom):

        def depth_at(north: object, east: object) -> Array:
            return returned(bottom, (north, east), (), "The bottom as a function (north, east)")

        evaluate(depth_at, np.float64(0.0), np.float64(0.0))  # raises where it cannot be traced
        return lambda state: depth_at(state.q[0], state.q[1]) - state.q[2]
    fits = isinstance(bottom, (int, float)) or hasattr(bottom, "dtype")
    checks.expect(fits, bottom, "bottom", "a depth in m, or a function (north, east)")
    depth = number(bottom, "bottom", at_least=0.0)
    return lambda state: depth - state.q[2]


def at_bottom(bottom: object, clearance: object = 0.0) -> Event:
    """The event that the origin of the body comes as near to the bottom as `clearance` (m): `until=at_bottom(40.0)`.

    bottom: as in `altitude`. Positive above.
    """
    height, near = altitude(bottom), number(clearance, "clearance", at_least=0.0)
    return _named(lambda state: height(state) - near, "bottom")


def first_of(*events: Event) -> Event:
    """The first of events that are positive before: `until=first_of(at_surface(), at_bottom(40.0))`."""
    if not events or not all(callable(event) for event in events):
        raise ArgumentError("first_of takes at least one event, such as at_surface().")
    names = [getattr(event, "__name__", "").replace("<lambda>", "") for event in events]
    together = " or ".join(names) if all(names) else ""
    return _named(lambda state: jnp.min(jnp.stack([jnp.asarray(event(state)) for event in events])), together)


def _named(event: Event, name: str) -> Event:
    """The event under the name that certificates give."""
    if name:
        event.__name__ = name
    return event
