"""The base of all owners of numbers that can be replaced and varied: parts, force curves, controllers, waters."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import jax
import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.mechanics.members import Each


class Numbers:
    """The parameters of a dataclass, which its methods get as `own`."""

    def parameters(self) -> dict[str, PyTree]:
        """The numbers that can be replaced and varied: by default all fields that hold numbers."""
        given: Any = {field.name: getattr(self, field.name) for field in fields(self)}  # pyright: ignore[reportArgumentType]
        kinds = (int, float, np.ndarray, jax.Array, Each)
        return {key: value for key, value in given.items() if isinstance(value, kinds)}
