"""Functions on the sphere as matrices and back: spherical harmonics, their matrices T_lm, latitudes and longitudes."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from coadjoint import checks
from coadjoint.errors import ArgumentError, shown
from coadjoint.memory import require_room
from coadjoint.models.fluids.laplacian import tridiagonal
from coadjoint.models.memory import require_room_at

Coefficients = np.ndarray
"""c (L, L), complex: f = Σ c_l0 Y_l0 + 2 Re Σ_{m>0} c_lm Y_lm, with Y_lm orthonormal, phases of Condon and Shortley."""

REAL = 1e-12
"""What the imaginary part of a c_l0 may be, of the largest number: round-off."""
SMALL = 1e-6
"""What an entry of an eigenvector must be, of the largest, for its sign to be above round-off."""


@lru_cache(maxsize=1024)
def on_diagonal(size: int, m: int) -> np.ndarray:
    """The columns t_l, l = m … N − 1, (N − m, N − m), of length √(N/4π): the mth diagonal of each T_lm."""
    from scipy.linalg import eigh_tridiagonal  # which takes a fifth of a second to import

    diagonal, off = tridiagonal(size, m)
    vectors = np.ones((1, 1))
    if size - m > 1:
        values, vectors = (array[..., ::-1] for array in eigh_tridiagonal(diagonal, off))
        vectors = vectors * _signs(diagonal, off, values, vectors)
    return (-1.0) ** m * np.sqrt(size / (4 * np.pi)) * vectors


def _signs(diagonal: np.ndarray, off: np.ndarray, values: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """The signs (n,) that make the first entry of each eigenvector, at the pole, positive.

    That entry may be far below round-off. The eigenvectors grow from there, so that the recurrence
    b_i x_{i+1} = (λ − a_i) x_i − b_{i−1} x_{i−1} from x_0 = 1 has the sign of the first entry that is not small.
    """
    columns = np.arange(len(values))
    first = np.argmax(np.abs(vectors) > SMALL * np.max(np.abs(vectors), axis=0), axis=0)
    before, here, signs = np.zeros(len(values)), np.ones(len(values)), np.ones(len(values))
    for i in range(int(np.max(first))):
        before, here = here, ((values - diagonal[i]) * here - (off[i - 1] * before if i else 0.0)) / off[i]
        scale = np.maximum(np.abs(before), np.abs(here))
        before, here = before / scale, here / scale
        signs = np.where(first == i + 1, np.sign(here), signs)
    return signs * np.sign(vectors[first, columns])


def checked(coefficients: Any, name: str = "coefficients") -> Coefficients:
    """c_lm (…, L, L), the argument `name`, as complex numbers.

    Raises ArgumentError for other shapes, where a number is not finite, where c_l0 is not real, and where c_lm is not 0
    for an m above l.
    """
    try:
        c: Any = np.asarray(coefficients, complex)
    except (TypeError, ValueError):
        c = np.zeros(0)
    fits = c.ndim >= 2 and c.shape[-2] == c.shape[-1] and np.all(np.isfinite(c))
    checks.expect(fits, coefficients, name, "finite numbers c_lm, (…, L, L)")
    if np.any(np.abs(c[..., 0].imag) > REAL * np.max(np.abs(c), initial=0.0)):
        raise ArgumentError(f"Argument `{name}` must be real for m = 0, because the function is.")
    if np.any(np.triu(c, 1) != 0):
        *_, l, m = (int(index[0]) for index in np.nonzero(np.triu(c, 1)))
        value = np.triu(c, 1)[np.triu(c, 1) != 0][0]
        raise ArgumentError(
            f"Argument `{name}` must be 0 where m > l, but c[{l}, {m}] is {value:.6g}: its first index is l."
        )
    return c


def from_coefficients(size: int, coefficients: Coefficients) -> np.ndarray:
    """The coordinates (N²,) on U(N) of W = iF, where F is the Hermitian matrix of the function.

    coefficients: c (L, L) as in `Coefficients`, L ≤ N. Raises ArgumentError for another shape, for more than N of them,
    where c_l0 is not real, and where c_lm is not 0 for an m above l.
    """
    c = checked(coefficients)
    if c.ndim != 2 or len(c) > size:
        raise ArgumentError(
            f"Argument `coefficients` must be c_lm, (L, L) with L up to N = {size}, degrees up to {size - 1}, but has "
            f"shape {c.shape}: leave out the higher degrees, or take a larger N."
        )
    rows = np.zeros((size, size))
    for m in range(c.shape[0]):
        entries: Any = on_diagonal(size, m)[:, : c.shape[0] - m] @ c[m:, m]
        i = np.arange(size - m)
        # W = iF: its real part is −Im F, its imaginary part Re F; a coordinate off the diagonal is √2 of an entry.
        if m:
            rows[i, i + m], rows[i + m, i] = -np.sqrt(2) * entries.imag, np.sqrt(2) * entries.real
        else:
            rows[i, i] = entries.real
    return rows.ravel()


def _numbers(given: object) -> np.ndarray | None:
    """The array of real numbers; None where there is none."""
    try:
        found = np.asarray(given)
    except ValueError:  # of rows of several lengths
        return None
    return found if found.dtype.kind in "fiu" else None


def coefficients_of(size: int, momentum: np.ndarray) -> Coefficients:
    """c_lm (…, N, N) of coordinates (…, N²) on U(N): the inverse of `from_coefficients`.

    size: N. momentum: the coordinates. Raises ArgumentError unless they are coordinates, and where all matrices T_lm,
    8N³/3 bytes, do not fit in memory.
    """
    checks.whole(size, "size", 1)
    mu = _numbers(momentum)
    if mu is None or mu.shape[-1:] != (size**2,) or not np.all(np.isfinite(mu)):
        shape = "" if mu is None else f", of shape {mu.shape}"
        raise ArgumentError(
            f"Argument `momentum` must be finite real numbers, the {size**2} coordinates on U({size}) last, but is "
            f"{shown(momentum)}{shape}."
        )
    require_room_at("All spherical harmonics", size, 8.0 * size**3 / 3, 3)
    rows = mu.reshape(*mu.shape[:-1], size, size)
    found = np.zeros(rows.shape, complex)
    for m in range(size):
        i = np.arange(size - m)
        entries = rows[..., i, i] + 0j if m == 0 else (rows[..., i + m, i] - 1j * rows[..., i, i + m]) / np.sqrt(2)
        found[..., m:, m] = entries @ on_diagonal(size, m) * (4 * np.pi / size)
    return found


def legendre(degree: int, z: np.ndarray) -> np.ndarray:
    """P̄_lm(z), shape (degree + 1, degree + 1, points), with Y_lm = P̄_lm(cos θ) e^{imφ} orthonormal; by recurrence in l.

    z: cos θ, a number for each point.
    """
    z = np.asarray(z, float)
    found = np.zeros((degree + 1, degree + 1, len(z)))
    sine = np.sqrt(1 - z * z)
    found[0, 0] = np.sqrt(1 / (4 * np.pi))
    for m in range(degree + 1):
        if m:
            found[m, m] = -np.sqrt((2 * m + 1) / (2 * m)) * sine * found[m - 1, m - 1]
        if m < degree:
            found[m + 1, m] = np.sqrt(2 * m + 3) * z * found[m, m]
        for k in range(m + 2, degree + 1):
            a = np.sqrt((4 * k * k - 1) / (k * k - m * m))
            b = np.sqrt(((k - 1) ** 2 - m * m) / (4 * (k - 1) ** 2 - 1))
            found[k, m] = a * (z * found[k - 1, m] - b * found[k - 2, m])
    return found


def on_grid(
    coefficients: Coefficients, latitudes: int = 91, longitudes: int = 180
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Latitudes, longitudes and the values of a function, (latitudes,), (longitudes,), (…, latitudes, longitudes).

    Latitudes go in even steps from −π/2 to π/2, longitudes from 0 to below 2π, rad; values have the unit of c.

    coefficients: c (…, L, L) as in `Coefficients`. latitudes, longitudes: how many, from 2, by default 91 and 180.
    Raises ArgumentError for other numbers and as `from_coefficients`.
    """
    c = checked(coefficients)
    for name, count in (("latitudes", latitudes), ("longitudes", longitudes)):
        checks.whole(count, name, 2)
    needed = 8.0 * latitudes * (c.shape[-1] ** 2 + 2 * c[..., 0, 0].size * (longitudes + c.shape[-1]))
    require_room(f"A grid of {latitudes} × {longitudes} points", needed, "take fewer latitudes and longitudes")
    latitude = np.linspace(-np.pi / 2, np.pi / 2, latitudes)
    longitude = np.linspace(0, 2 * np.pi, longitudes, endpoint=False)
    size = c.shape[-1]
    values = legendre(size - 1, np.sin(latitude))
    along = np.einsum("...lm,lmt->...mt", c, values)
    waves = np.exp(1j * np.outer(np.arange(size), longitude)) * np.where(np.arange(size) > 0, 2.0, 1.0)[:, None]
    return latitude, longitude, np.einsum("...mt,mp->...tp", along, waves).real


def power_spectrum(coefficients: Coefficients) -> np.ndarray:
    """Σ_m |c_lm|² over all m from −l to l, shape (…, L): the share of every degree l in ∫f², the unit of c squared.

    coefficients: c, shape (…, L, L). Raises ArgumentError as `from_coefficients`.
    """
    c = checked(coefficients)
    return np.sum(np.abs(c) ** 2 * np.where(np.arange(c.shape[-1]) > 0, 2.0, 1.0), axis=-1)
