"""Initial vorticities on the sphere: random of a given spectrum, waves of Rossby and Haurwitz, smooth vortices."""

from __future__ import annotations

import numpy as np

from coadjoint import checks
from coadjoint.checks import float64
from coadjoint.errors import ArgumentError, shown
from coadjoint.models.fluids.harmonics import Coefficients, legendre

LEFT_OUT = 0.1
"""How much of the vorticity at the centre of a vortex its degrees may leave out."""


def random_vorticity(seed: int, degree: int = 10, enstrophy: float = 1.0, spectrum: object = None) -> Coefficients:
    """Random c_lm for l = 1 … degree, (degree + 1, degree + 1), 1/s, with ½∫ω² = enstrophy on the unit sphere.

    seed: of the random numbers, an integer ≥ 0. degree: the highest l, from 1, by default 10. enstrophy: 1/s²,
    by default 1. spectrum: the shares of the degrees 0 … degree in ∫ω², (degree + 1,), the first 0, of any sum; by
    default each c_lm is normal with one variance. Raises ArgumentError for others.
    """
    checks.whole(seed, "seed", 0)
    checks.whole(degree, "degree", 1)
    wanted = checks.not_negative(enstrophy, "enstrophy")
    random = np.random.default_rng(seed)
    c = np.tril(random.normal(size=(degree + 1, degree + 1)) + 1j * random.normal(size=(degree + 1, degree + 1)))
    c[:, 0] = np.sqrt(2) * c[:, 0].real
    c[0] = 0
    total = np.sum(np.abs(c) ** 2 * np.where(np.arange(degree + 1) > 0, 2.0, 1.0), axis=1)
    if spectrum is not None:
        shares = np.asarray(float64(spectrum, "Argument `spectrum`"))
        if shares.shape != (degree + 1,) or shares[0] != 0 or np.min(shares) < 0 or not np.any(shares):
            raise ArgumentError(
                f"Argument `spectrum` must hold {degree + 1} shares from 0, of the degrees 0 to {degree}, the first 0 "
                f"and one above 0, but is {shown(spectrum)}."
            )
        shares = shares / np.max(shares)
        c[1:] *= np.sqrt(shares[1:] / total[1:])[:, None]
        total = shares
    return c * np.sqrt(2 * wanted / np.sum(total))


def rossby_haurwitz(degree: int, order: int, amplitude: complex, spin: float = 0.0) -> Coefficients:
    """c_lm of a wave Y_lm on a solid-body rotation: ω = 2α cos θ + 2 Re(amplitude Y_lm), l = degree, m = order > 0.

    Its pattern turns westwards at the rate c = 2(Ω + α)/(l(l + 1)) − α, rad/s, Ω the rotation of the sphere, without
    change of form, at every N > l. c_lm: (degree + 1, degree + 1), 1/s.

    degree: l ≥ 1, an integer. order: m, from 1 to l. amplitude: 1/s. spin: α, rad/s, by default 0.
    Raises ArgumentError for others. Source: Haurwitz, The motion of atmospheric disturbances on the spherical earth,
    J. Mar. Res. 3 (1940).
    """
    checks.whole(degree, "degree", 1)
    checks.whole(order, "order", 1, degree)
    c = np.zeros((degree + 1, degree + 1), complex)
    c[degree, order] = _complex(amplitude, "amplitude")
    c[1, 0] = 2 * checks.number(spin, "spin") * np.sqrt(4 * np.pi / 3)
    return c


def vortices(degree: int, places: object, strengths: object, radius: float) -> Coefficients:
    """c_lm of smooth vortices, ω = Σ_i s_i exp((cos γ_i − 1)/r²) less its mean, γ_i the angle from the ith centre.

    A vortex has the profile of von Mises and Fisher, nearly that of Gauss: c_lm = 4π Σ_i s_i e^{−κ} i_l(κ) Ȳ_lm(x_i),
    κ = 1/r², with modified spherical Bessel functions i_l. c_lm: (degree + 1, degree + 1), 1/s; what degrees above
    leave out is small where degree is some 4/r.

    degree: the highest l, from 1. places: latitudes and longitudes of the centres, (vortices, 2), rad. strengths: the
    vorticities s_i at the centres, (vortices,), 1/s. radius: r, where ω is e^{−1/2} of that, rad, above 0 and up to π.
    Raises ArgumentError for others, and where the degrees leave out over a tenth of a vortex, degree below some 2/r.
    Source: Abramowitz and Stegun, 10.2.36, with the addition theorem.
    """
    checks.whole(degree, "degree", 1)
    at, s = (np.asarray(float64(x, f"Argument `{n}`")) for n, x in (("places", places), ("strengths", strengths)))
    if at.ndim != 2 or at.shape[1] != 2 or s.shape != at.shape[:1]:
        raise ArgumentError(
            "Arguments `places` and `strengths` must be (vortices, 2), latitude and longitude, and (vortices,), but "
            f"have the shapes {at.shape} and {s.shape}."
        )
    if np.any(np.abs(at[:, 0]) > np.pi / 2):
        raise ArgumentError("Argument `places` must have latitudes from −π/2 to π/2, rad, as its first column.")
    if np.any(np.abs(at[:, 1]) > 2 * np.pi):
        raise ArgumentError("Argument `places` must have longitudes from −2π to 2π, rad, as its second column.")
    checks.positive(radius, "radius")
    checks.number(radius, "radius", most=np.pi)
    from scipy.special import ive  # which takes a fifth of a second to import

    kappa = 1 / radius / radius
    l = np.arange(degree + 1)
    bessel = np.sqrt(np.pi / (2 * kappa)) * ive(l + 0.5, kappa)
    left = float((2 * l + 1) @ bessel)  # ω at the centre of a vortex of strength 1: the sum over all degrees is 1
    if not left > 1 - LEFT_OUT:
        raise ArgumentError(
            f"Vortices of the radius {radius:g} rad need degrees up to some 4/r = {4 / radius:.3g}, but those up to "
            f"{degree} hold {left:.2g} of them: take a higher `degree`, or a larger `radius`."
        )
    there = legendre(degree, np.sin(at[:, 0])) * np.exp(-1j * np.outer(l, at[:, 1]))
    c = 4 * np.pi * bessel[:, None] * (there @ s)
    c[0, 0] = 0
    return c


def _complex(value: object, name: str) -> complex:
    if isinstance(value, bool) or not isinstance(value, (int, float, complex, np.number)) or not np.isfinite(value):
        raise ArgumentError(f"Argument `{name}` must be a finite number, but is {shown(value)}.")
    return complex(value)
