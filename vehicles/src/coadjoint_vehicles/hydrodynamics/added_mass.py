"""The added mass matrix about another point, in other axes, and made sound after a numerical computation."""

from __future__ import annotations

import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, PyTree
from coadjoint.errors import ArgumentError, FileError, warn
from coadjoint.models.quantities import matrix, vector

ASYMMETRIC = 0.1
"""Up to here |A_ij − A_ji|/√(A_ii A_jj) is an error of discretisation, beyond it a wrong file."""
SUSPICIOUS = 0.01
"""Larger asymmetries are reported."""
NEGATIVE = 1e-3
"""Up to this fraction of the largest eigenvalue, a negative one is an error of discretisation."""

SMALL = 1e-2
"""Diagonal entries count as at least this fraction of the largest where asymmetry is measured."""
WATER = 1000.0
"""kg/m³, for the size of a body from the water that it moves; only a scale."""

Z_UP_TO_Z_DOWN = np.diag([1.0, -1.0, -1.0])
"""From forward, port, up to forward, starboard, down: half a turn about the x axis."""


def added_mass_about(added_mass: object, point: object) -> Array:
    """The added mass matrix (6, 6) about another point O′ fixed in the body, in the same axes.

    M′ = HᵀM H, H = [[I, r̂], [0, I]], since v_O = v_O′ + r × ω; r is the position of O′ from O.

    added_mass: M about O, (6, 6), in the order surge, sway, heave, roll, pitch, yaw. point: r, (3,) m.
    Raises ArgumentError for other shapes.
    Source: the kinetic energy is the same about every point.
    """
    M, r = matrix(added_mass, "added_mass", size=6), vector(point, "point")
    H = np.eye(6)
    H[:3, 3:] = [[0.0, -r[2], r[1]], [r[2], 0.0, -r[0]], [-r[1], r[0], 0.0]]
    return H.T @ M @ H


def added_mass_in_axes(added_mass: object, rotation: object) -> Array:
    """The added mass matrix (6, 6) about the same point in other axes fixed in the body.

    M′ = T M Tᵀ, T = diag(S, S), where S takes components in the old axes to components in the new: v′ = S v, ω′ = S ω.
    For axes forward, port, up to forward, starboard, down: S = diag(1, −1, −1), so that an entry that couples one of
    surge and roll with one of the other four changes its sign, and no other does.

    added_mass: M, (6, 6), in the order surge, sway, heave, roll, pitch, yaw. rotation: S, (3, 3).
    Raises ArgumentError unless SᵀS = I and det S = 1.
    """
    M, S = matrix(added_mass, "added_mass", size=6), matrix(rotation, "rotation")
    if np.max(np.abs(S.T @ S - np.eye(3))) > 1e-9 or np.linalg.det(S) < 0:
        raise ArgumentError(
            "The rotation between the axes must have SᵀS = I and det S = 1, but has not: axes that are exchanged or "
            "turned round one at a time are left-handed."
        )
    T = np.kron(np.eye(2), S)
    return T @ M @ T.T


def body_axes(axes: PyTree) -> Array:
    """S of `added_mass_in_axes` from a program's axes to forward, starboard, down."""
    if isinstance(axes, str):
        known = {"z_up": Z_UP_TO_Z_DOWN, "z_down": np.eye(3)}
        fits = axes in known
        checks.expect(
            fits,
            axes,
            "axes",
            '"z_up" (forward, port, up), "z_down" (forward, starboard, down) or a rotation (3, 3) from the axes of the '
            "file to those of the body",
        )
        return known[axes]
    return matrix(axes, "axes")


def computed_added_mass(found: Array, source: object, axes: PyTree, origin: object) -> Array:
    """The result of a panel program, symmetric, without negative eigenvalues, about `origin` and in the body's axes."""
    point, unit = vector(origin, "origin"), _unit(found)
    scaled = _symmetric_part(found, unit, source)
    sound = _semidefinite(scaled, source) * np.outer(unit, unit)
    return added_mass_in_axes(added_mass_about(sound, point), body_axes(axes))


def _unit(found: Array) -> Array:
    """(1, 1, 1, d, d, d): d is the radius of gyration of the water, or the size of the body if it turns without any."""
    moved, turned = np.trace(found[:3, :3]), np.trace(found[3:, 3:])
    if not moved > 0:
        return np.ones(6)
    return np.repeat([1.0, max(np.sqrt(max(turned, 0.0) / moved), np.cbrt(moved / (3 * WATER)))], 3)


def _symmetric_part(found: Array, unit: Array, source: object) -> Array:
    """½(A + Aᵀ), scaled; the symmetry is Green's theorem, and a panel method has it up to its error."""
    scaled = found / np.outer(unit, unit)
    diagonal = np.diag(scaled)
    if np.any(diagonal[:3] <= 0) or np.any(diagonal < -NEGATIVE * np.max(diagonal)):
        shown = ", ".join(f"{value:.4g}" for value in np.diag(found))
        raise FileError(
            f"The added mass in {source} has the diagonal {shown}, but the kinetic energy of water is positive: check "
            "the direction of the normals of the panels, and that the hull is closed."
        )
    size = np.sqrt(np.maximum(diagonal, SMALL * np.max(diagonal)))
    skew = np.abs(scaled - scaled.T) / np.outer(size, size)
    i, j = np.unravel_index(np.argmax(skew), skew.shape)
    sentence = (
        f"The added mass in {source} is not symmetric: A({i + 1},{j + 1}) = {found[i, j]:.6g}, but "
        f"A({j + 1},{i + 1}) = {found[j, i]:.6g}"
    )
    if skew[i, j] > ASYMMETRIC:
        raise FileError(f"{sentence}: check that the six modes refer to one point and one system of axes.")
    if skew[i, j] > SUSPICIOUS:
        warn(f"{sentence}; the mean of both is taken. A finer mesh brings them together.", stacklevel=4)
    return 0.5 * (scaled + scaled.T)


def _semidefinite(scaled: Array, source: object) -> Array:
    """The nearest matrix without negative eigenvalues."""
    values, vectors = np.linalg.eigh(scaled)
    if values[0] >= 0:
        return scaled
    sentence = f"The added mass in {source} has a negative eigenvalue, {-values[0] / values[-1]:.2g} of the largest"
    if values[0] < -NEGATIVE * values[-1]:
        raise FileError(
            f"{sentence}, but the kinetic energy of water is positive: check the signs of its entries, and that its "
            "moments refer to the point and axes of its forces."
        )
    if values[0] < -1e-9 * values[-1]:
        warn(f"{sentence}; it is set to zero. A finer mesh brings it there.", stacklevel=4)
    return (vectors * np.maximum(values, 0.0)) @ vectors.T
