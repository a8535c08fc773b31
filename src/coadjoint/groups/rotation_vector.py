"""The rotation vector of a rotation of space, up to and including half a turn, by its unit quaternion."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array
from coadjoint.groups.small_angle import arctangent_ratio


def quaternion(R: Array) -> Array:
    """The unit quaternion (w, x, y, z) of a rotation R (3, 3), with w ≥ 0.

    4qqᵀ is linear in R, and q is its row with the largest diagonal entry, which no rotation makes small. At half a
    turn, w = 0, the largest of x, y, z is positive, the first among equals.

    Source: S. W. Shepperd (1978), Quaternion from rotation matrix, J. Guidance and Control 1(3), 223–224.
    """
    r, trace = R, R[0, 0] + R[1, 1] + R[2, 2]
    x, y, z = r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]
    xy, xz, yz = r[0, 1] + r[1, 0], r[0, 2] + r[2, 0], r[1, 2] + r[2, 1]
    rows: list[tuple[Array, ...]] = [(1 + trace, x, y, z)]
    for i, row in enumerate(([None, xy, xz], [xy, None, yz], [xz, yz, None])):
        square = 1 + 2 * r[i, i] - trace
        rows.append(((x, y, z)[i], *(square if entry is None else entry for entry in row)))
    found, largest = jnp.stack(rows[0]), rows[0][0]
    for i in range(1, 4):
        larger = rows[i][i] > largest
        found, largest = jnp.where(larger, jnp.stack(rows[i]), found), jnp.where(larger, rows[i][i], largest)
    return jnp.where(found[0] < 0, -found, found) / jnp.sqrt(found @ found)


def of_quaternion(q: Array) -> Array:
    """ξ (3,), rad, |ξ| ≤ 2π, with q = (cos ½θ, ½ξ sin ½θ/½θ), θ = |ξ|, of a unit quaternion q (4,).

    ξ = 2v arctan(|v|/w)/|v|, q = (w, v); below |v|/w = ½ by `arctangent_ratio`. At q = −1 it is (2π, 0, 0).
    """
    w, v = q[0], q[1:]
    square = v @ v
    near = (w > 0) & (4 * square < w * w)
    inner = jnp.where(near, w, 1.0)
    below = 2 / inner * arctangent_ratio(0, jnp.where(near, square, 0.0) / (inner * inner))
    reversal = ~near & (square == 0)
    sine = jnp.sqrt(jnp.where(near | reversal, 1.0, square))
    above = 2 * jnp.arctan2(sine, w) / sine
    return jnp.where(reversal, 2 * np.pi * np.eye(3)[0], jnp.where(near, below, above) * v)
