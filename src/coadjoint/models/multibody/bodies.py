"""A rigid body of a mechanism, at its place in the reference configuration."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from coadjoint.errors import ArgumentError
from coadjoint.mechanics.members import Quantity
from coadjoint.models.quantities import matrix, positive, positive_definite, vector

STRAIGHT = 1e-9
"""How far R may be from a rotation."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Body:
    """A rigid body, and where its frame is in the reference configuration, in which all joint coordinates are zero.

        crank = multibody.Body(mass=1.0, inertia=(0.01, 0.1, 0.1), position=(0.5, 0.0, 0.0))

    Arguments:
        mass: kg.
        inertia: about the mass centre, along the axes of the body's frame, (3, 3) or (3,), kg m².
        center: the mass centre in the body's frame, (3,), m, by default its origin.
        position: the origin of the frame in space, (3,), m, by default the origin of space.
        rotation: the attitude of the frame in space, (3, 3), by default the identity.

    Raises ArgumentError for what no body can have.
    """

    mass: Any
    inertia: Any
    center: Any = (0.0, 0.0, 0.0)
    position: Any = (0.0, 0.0, 0.0)
    rotation: Any = None

    def __post_init__(self):
        found = {
            "mass": positive(self.mass, "mass"),
            "inertia": _inertia(self.inertia),
            "center": vector(self.center, "center"),
            "position": vector(self.position, "position"),
            "rotation": np.eye(3) if self.rotation is None else rotation(self.rotation, "rotation"),
        }
        for name, value in found.items():
            object.__setattr__(self, name, value)

    @property
    def place(self) -> np.ndarray:
        """The mass centre in space in the reference configuration, (3,), m."""
        return self.position + self.rotation @ self.center


def rotation(value: Quantity, name: str) -> np.ndarray:
    """A rotation (3, 3); raises ArgumentError."""
    R = np.asarray(matrix(value, name))
    off = float(np.max(np.abs(R.T @ R - np.eye(3))))
    if off > STRAIGHT or np.linalg.det(R) < 0:
        raise ArgumentError(
            f"Argument `{name}` must be a rotation, RᵀR = 1 and det R = 1, but RᵀR is off by {off:.1e} and det R is "
            f"{np.linalg.det(R):.3g}: give it with all its digits, as co.attitude.zyx(…) does."
        )
    return R


def _inertia(value: Quantity) -> np.ndarray:
    J = np.asarray(positive_definite(value, "inertia"))
    moments = np.linalg.eigvalsh(J)
    if moments[2] > (1 + STRAIGHT) * (moments[0] + moments[1]):
        raise ArgumentError(
            f"Argument `inertia` must satisfy J₁ + J₂ ≥ J₃, but has the principal moments "
            f"{np.round(moments, 6).tolist()}: check its unit and its point of reference, the mass centre."
        )
    return J
