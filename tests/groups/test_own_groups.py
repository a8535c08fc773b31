"""A group of one's own is compared with what its basis and its matrices say, before anything is computed with it."""

from __future__ import annotations

import weakref
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.groups import LieGroup
from coadjoint.groups.axioms import require_group
from coadjoint.groups.overrides import _ships, members, stamp
from own_members import (
    NEARLY,
    broken,
    changed,
    flipped,
    nothing,
    result_scaled,
    scaled,
    sentence_of,
    shifted,
    short,
    swapped,
    text,
    transposed,
)
from systems import GROUPS

ERRORS = {
    "identity": (result_scaled, text),
    "compose": (swapped, result_scaled, short),
    "inverse": (nothing, result_scaled, broken),
    "matrix": (transposed, result_scaled, short),
    "from_matrix": (transposed, result_scaled),
    "tangent": (flipped, scaled, transposed),
    "basis_sizes": (result_scaled,),
    "view": (scaled, flipped),
    "hat": (flipped, scaled, transposed, short),
    "vee": (scaled, flipped, broken),
    "Ad": (scaled, flipped, lambda right, self, g, xi: right(self, self.inverse(g), xi)),
    "Ad_dual": (scaled, lambda right, self, g, mu: self.Ad(g, mu)),
    "ad": (scaled, flipped, text),
    "ad_dual": (scaled, lambda right, self, xi, mu: self.ad(xi, mu)),
    "exp": (scaled, flipped, short),
    "log": (scaled, flipped),
    "_log": (scaled, short),
    "angle_squared": (scaled, lambda right, self, xi: right(self, xi) * 4),
    "rotation_angle": (
        lambda right, self, xi: -right(self, xi),
        lambda right, self, xi: jnp.arccos(jnp.cos(right(self, 2 * xi))),
        lambda right, self, xi: jnp.nan * right(self, xi),
    ),
    "project": (result_scaled, lambda right, self, g: g),
    "defect": (shifted, lambda right, self, g: jnp.nan * right(self, g)),
    "outside": (shifted,),
    "rotation": (transposed, result_scaled),
}
EXEMPT = {
    "basis": "what all else is compared with; its own axioms are tested by name",
    "dim": "tested by name",
    "matrix_size": "tested by name",
    "leaf_names": "tested by name",
    "constrained": "chooses which members there are",
}
CASES = [(name, error) for name, errors in ERRORS.items() for error in errors]


def system(group, **more) -> co.System:
    return co.System(group, lambda xi: 0.5 * xi @ xi, **more)


def test_every_member_that_a_group_may_override_is_tested_here():
    assert set(ERRORS) | set(EXEMPT) == set(members(LieGroup))


@pytest.mark.cases(16)
@pytest.mark.parametrize(("name", "error"), CASES, ids=lambda value: getattr(value, "__name__", value))
def test_a_wrong_member_of_a_group_is_named(name, error):
    message = sentence_of(lambda: system(changed(co.SO3, name, error)))
    assert "Wrong" in message and f"`{name}`" in message


@pytest.mark.cases(3)
@pytest.mark.parametrize("base", [co.SE3, co.groups.UnitQuaternion], ids=lambda base: base.__name__)
@pytest.mark.parametrize("name", ["compose", "inverse", "Ad", "Ad_dual", "exp", "project"])
def test_a_wrong_member_is_named_where_elements_are_no_matrices(base, name):
    error = ERRORS[name][0]
    assert f"`{name}` of Wrong()" in sentence_of(lambda: system(changed(base, name, error)))


def test_the_sentence_tells_class_member_deviation_and_remedy():
    assert sentence_of(lambda: system(changed(co.SO3, "Ad", scaled))) == (
        "`Ad` of Wrong() must satisfy Ad_g ξ = (g ξ̂ g⁻¹)ᵛ, but at random points it is off by 1.0e-08 of its size: "
        "mend it, leave it out where it would be derived, or give verify=False to co.System."
    )


def test_a_wrong_group_may_be_used_by_who_asks_for_it():
    group = changed(co.SO3, "Ad", scaled)
    assert system(group, verify=False).group is group


@pytest.mark.cases(3)
@pytest.mark.parametrize("name", GROUPS)
def test_groups_that_ship_satisfy_what_is_asked_of_others(name):
    require_group(GROUPS[name])


@pytest.mark.long
def test_groups_that_ship_pay_nothing(monkeypatch):
    monkeypatch.setattr("coadjoint.spaces.axioms.require_group", lambda *_: pytest.fail("compared"))
    monkeypatch.setattr("coadjoint.spaces.axioms.require_space", lambda *_: pytest.fail("compared"))
    for name in ("SE3", "SO3xSE2", "SO3_R3"):
        co.System(GROUPS[name], lambda xi, a: 0.5 * xi @ xi, advected={"x": co.Defining(), "m": co.Coadjoint()})


def test_a_verdict_is_kept_and_a_change_of_the_class_is_seen():
    calls = []

    class Own(co.SO3):
        def Ad(self, g, xi):
            calls.append(1)
            return g @ xi

    system(Own())
    before = len(calls)
    assert before > 0
    system(Own())
    assert len(calls) == before
    Own.Ad = lambda self, g, xi: g.T @ xi  # type: ignore[method-assign]
    assert "`Ad`" in sentence_of(lambda: system(Own()))


def test_a_basis_that_is_changed_in_place_is_compared_again():
    class Own(co.SO3):
        basis = np.array(co.SO3().basis)  # type: ignore[assignment]

    system(Own())
    Own.basis[0] *= 2
    assert "`hat`" in sentence_of(lambda: system(Own()))


def test_a_stamp_keeps_what_it_knows_by_where_it_is():
    """Else a new member may come to stand where one was that is gone, and pass for it."""

    class Member:
        __hash__ = None  # type: ignore[assignment]

        def __eq__(self, other):
            return True

    Own = type("Own", (co.SO3,), {"Ad": Member()})
    gone, first = weakref.ref(Own.Ad), stamp(Own(), LieGroup)
    assert stamp(Own(), LieGroup) == first and hash(stamp(Own(), LieGroup)) == hash(first)
    Own.Ad = Member()
    assert stamp(Own(), LieGroup) != first
    assert gone() is not None


def test_a_wrong_group_is_found_inside_products():
    wrong = changed(co.SO3, "Ad_dual", scaled)
    for group in (co.DirectProduct(co.SO2(), wrong), co.SemidirectProduct(wrong, co.Defining())):
        assert "`Ad_dual` of Wrong()" in sentence_of(lambda group=group: system(group))


def test_a_subclass_of_a_matrix_group_does_not_pass_as_its_equal():
    basis = np.array(co.SO3().basis)

    class Own(co.MatrixGroup):
        def ad(self, xi, eta):
            return jnp.cross(eta, xi)

    right = co.MatrixGroup(basis)
    system(right)
    assert Own(basis) == right
    assert "`ad`" in sentence_of(lambda: system(Own(basis)))


def test_members_that_a_group_lacks_are_named():
    class Bare(LieGroup):
        basis = np.array(co.SO3().basis)

    assert "must give `identity`" in sentence_of(lambda: system(Bare()))


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"basis": property(lambda self: co.SO3().basis[:2])}, "closed under the bracket"),
        ({"basis": property(lambda self: 1j * co.SO3().basis)}, "real matrices"),
        ({"basis": property(lambda self: np.full((3, 3, 3), np.nan))}, "finite"),
        ({"dim": 4}, "dim and matrix_size"),
        ({"matrix_size": 4}, "dim and matrix_size"),
        ({"leaf_names": ("R", "x")}, "`leaf_names`"),
        ({"__hash__": None}, "must be hashable"),
    ],
)
def test_a_group_whose_sizes_do_not_fit_is_refused(changes, says):
    assert says in sentence_of(lambda: system(type("Odd", (co.SO3,), changes)()))


def test_a_basis_in_small_units_hides_nothing():
    @dataclass(frozen=True)
    class Small(co.SO3):
        factor: float = 1.0

        @property
        def basis(self):
            return 1e-9 * co.SO3().basis

        def hat(self, xi):
            return 1e-9 * co.SO3().hat(xi)

        def vee(self, matrix):
            return 1e9 * co.SO3().vee(matrix)

        def ad(self, xi, eta):
            return 1e-9 * self.factor * jnp.cross(xi, eta)

        def ad_dual(self, xi, mu):
            return 1e-9 * self.factor * jnp.cross(mu, xi)

        def exp(self, xi):
            return co.SO3().exp(1e-9 * xi)

        def _log(self, g):
            return 1e9 * co.SO3().log(g)

        def angle_squared(self, xi):
            return 1e-18 * (xi @ xi)

        def rotation_angle(self, xi):
            return 1e-9 * jnp.sqrt(xi @ xi)

    system(Small())
    assert "`ad`" in sentence_of(lambda: system(Small(NEARLY)))


def test_a_plain_value_ships_where_its_class_does():
    value, other = (1, 2), (3, 4)
    shipped = type("Shipped", (), {"size": value, "other": 0, "__module__": "coadjoint.groups"})
    own = type("Own", (shipped,), {"more": other, "__module__": "mine"})
    assert _ships(value, shipped) and _ships(value, own) and not _ships(other, own)
    assert _ships(LieGroup.exp, own) and not _ships(lambda self: None, shipped)
