"""Physical quantities at their limits: what just may be is kept, what just may not be raises its sentence."""

from __future__ import annotations

import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import ArgumentError
from coadjoint.models import fluids, quantities
from coadjoint.models.fluids.harmonics import legendre

SKEW = np.array([[1.0, 2e-9], [0.0, 1.0]])

KEPT = [
    (quantities.not_negative, 0.0),
    (quantities.positive, 1e-300),
    (quantities.positive_pair, [1.0, 2.0]),
    (quantities.angles, 2000 * np.pi),
    (quantities.angles, [-2000 * np.pi, 0.0]),
    (quantities.vector, [1.0, 2.0, 3.0]),
    (quantities.place, [600.0, 0.0, 800.0]),
    (quantities.matrix, np.arange(9.0).reshape(3, 3)),
    (quantities.direction, [0.6, 0.0, 0.8]),
]
WRONG = [
    (quantities.number, [1.0], r"must be one number, but has shape \(1,\)"),
    (quantities.number, np.inf, "finite"),
    (quantities.not_negative, -1e-9, "must be at least 0, but is -1e-09"),
    (quantities.positive, 0.0, "must be positive, but is 0"),
    (quantities.positive_pair, [1.0, 0.0], "must be positive, but is 0"),
    (quantities.positive_pair, [1.0, 2.0, 3.0], r"must have shape \(2,\)"),
    (quantities.angles, [0.0, -2001 * np.pi], "at most 1000 turns, but has 6286.33 rad, 1000.5 turns"),
    (quantities.vector, [1.0, 2.0], r"must have shape \(3,\), but has shape \(2,\)"),
    (quantities.place, [600.1, 0.0, 800.0], "is 1e.03 m from the origin"),
    (quantities.matrix, np.eye(2), r"must have shape \(3, 3\), but has shape \(2, 2\)"),
    (quantities.direction, [0.6, 0.0, 0.8001], "must be a unit vector, but has length 1.00008"),
]


@pytest.mark.cases(6)
@pytest.mark.parametrize(("check", "value"), KEPT)
def test_a_quantity_at_its_limit_is_kept_as_it_was_given(check, value):
    assert np.array_equal(check(value, "x"), value)


@pytest.mark.parametrize(("check", "value", "sentence"), WRONG)
def test_a_quantity_beyond_its_limit_raises_what_it_must_be(check, value, sentence):
    with pytest.raises(ArgumentError, match=f"Argument `x` {sentence}|Argument `x`.*{sentence}"):
        check(value, "x")


def test_a_diagonal_stands_for_its_matrix_and_a_matrix_is_symmetric_to_round_off():
    for check in (quantities.positive_definite, quantities.positive_semidefinite):
        assert np.array_equal(check([1.0, 2.0], "x", 2), np.diag([1.0, 2.0]))
        assert check(np.array([[1.0, 0.8e-9], [0.0, 1.0]]), "x", 2)[0, 1] == 0.8e-9
        with pytest.raises(ArgumentError, match="must be symmetric, but differs from its transpose by 2e-09"):
            check(SKEW, "x", 2)
        with pytest.raises(ArgumentError, match=r"must have shape \(2, 2\) or \(2,\), but has shape"):
            check(np.eye(3), "x", 2)


def test_a_definite_matrix_has_no_eigenvalue_that_vanishes_and_a_semidefinite_one_none_below_zero():
    with pytest.raises(ArgumentError, match=r"is singular: it gives no inertia along \[0.0, 1.0\]"):
        quantities.positive_definite([1.0, 0.0], "x", 2)
    with pytest.raises(ArgumentError, match=r"has the eigenvalue -0\.5"):
        quantities.positive_definite([1.0, -0.5], "x", 2)
    assert np.array_equal(quantities.positive_definite([1.0, 1e-12], "x", 2), np.diag([1.0, 1e-12]))
    assert np.array_equal(quantities.positive_semidefinite([1.0, 0.0], "x", 2), np.diag([1.0, 0.0]))
    with pytest.raises(ArgumentError, match="no negative eigenvalue, but has -1e-12"):
        quantities.positive_semidefinite([1.0, -1e-12], "x", 2)


def test_values_of_an_ensemble_are_checked_one_by_one_and_named():
    found = quantities.checked({"mass": quantities.positive}, {"mass": co.each([1.0, 2.0]), "other": "kept"})
    assert found["other"] == "kept" and len(found["mass"]) == 2
    with pytest.raises(ArgumentError, match="`mass` of member `1` must be positive"):
        quantities.checked({"mass": quantities.positive}, {"mass": co.each([1.0, -2.0])})


# Vorticities.


VORTEX = {"degree": 20, "places": [[0.3, 0.5]], "strengths": [2.0], "radius": 0.4}


def test_a_vortex_has_its_strength_at_its_centre_and_no_mean():
    """ω(x) = Σ c_lm Y_lm, real parts twice for m > 0; the mean of exp((cos γ − 1)κ) is (1 − e^{−2κ})/2κ."""
    c = fluids.vortices(**VORTEX)
    there = legendre(20, np.sin([0.3]))[..., 0] * np.exp(1j * 0.5 * np.arange(21))
    omega = np.sum((c * there).real * np.where(np.arange(21) > 0, 2.0, 1.0))
    kappa = 1 / 0.4**2
    assert omega == pytest.approx(2 * (1 - (1 - np.exp(-2 * kappa)) / (2 * kappa)), rel=1e-6) and c[0, 0] == 0


@pytest.mark.parametrize("place", [[np.pi / 2, 0.0], [-np.pi / 2, 2 * np.pi], [0.0, -2 * np.pi]])
def test_poles_and_a_turn_are_places_of_vortices(place):
    assert np.all(np.isfinite(fluids.vortices(**VORTEX | {"places": [place]})))
    assert np.all(np.isfinite(fluids.vortices(**VORTEX | {"radius": np.pi})))


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"places": [[1.6, 0.0]]}, "latitudes from −π/2 to π/2"),
        ({"places": [[0.0, 6.3]]}, "longitudes from −2π to 2π"),
        ({"places": [[0.0, -6.3]]}, "longitudes from −2π to 2π"),
        ({"places": [0.3, 0.5]}, r"must be \(vortices, 2\)"),
        ({"strengths": [1.0, 2.0]}, r"must be \(vortices, 2\)"),
        ({"radius": 0.0}, "`radius` must be positive, but is 0"),
        ({"radius": 3.2}, "`radius` must be a finite number up to 3.14159"),
        ({"radius": 0.09}, "take a higher `degree`"),
        ({"degree": 0}, "degree"),
    ],
)
def test_other_vortices_raise_what_they_must_be(change, sentence):
    with pytest.raises(ArgumentError, match=sentence):
        fluids.vortices(**VORTEX | change)


def test_the_degrees_may_leave_out_a_tenth_of_a_vortex():
    """Up to degree L a narrow vortex holds about 1 − exp(−L(L + 2)r²/2) of itself."""
    assert np.any(fluids.vortices(20, [[0.0, 0.0]], [1.0], 0.105))
    with pytest.raises(ArgumentError, match=r"those up to 20 hold 0\.8"):
        fluids.vortices(20, [[0.0, 0.0]], [1.0], 0.095)


@pytest.mark.parametrize("spectrum", [None, [0.0, 1.0, 0.0, 3.0]])
def test_a_random_vorticity_has_its_enstrophy_and_its_spectrum(spectrum):
    c = fluids.random_vorticity(3, 3, enstrophy=0.7, spectrum=spectrum)
    of_degree = np.sum(np.abs(c) ** 2 * np.where(np.arange(4) > 0, 2.0, 1.0), axis=1)
    assert 0.5 * np.sum(of_degree) == pytest.approx(0.7, rel=1e-14) and np.all(c[:, 0].imag == 0)
    if spectrum is not None:
        assert of_degree / np.sum(of_degree) == pytest.approx(np.array(spectrum) / 4, rel=1e-14)


@pytest.mark.parametrize(
    "spectrum", [[0.0, 1.0, 2.0], [1.0, 1.0, 1.0, 1.0], [0.0, -1.0, 1.0, 1.0], [0.0, 0.0, 0.0, 0.0]]
)
def test_another_spectrum_raises_what_it_must_hold(spectrum):
    with pytest.raises(ArgumentError, match="must hold 4 shares from 0, of the degrees 0 to 3"):
        fluids.random_vorticity(3, 3, spectrum=spectrum)


def test_a_wave_is_its_harmonic_on_a_rotation():
    c = fluids.rossby_haurwitz(3, 2, 0.5 - 0.25j, spin=0.1)
    assert (
        c[3, 2] == 0.5 - 0.25j and c[1, 0] == pytest.approx(0.2 * np.sqrt(4 * np.pi / 3)) and np.count_nonzero(c) == 2
    )
    for order in (0, 4):
        with pytest.raises(ArgumentError, match="order"):
            fluids.rossby_haurwitz(3, order, 1.0)
    assert fluids.rossby_haurwitz(3, 3, 1.0)[3, 3] == 1.0
