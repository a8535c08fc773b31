"""A difference map of one's own is compared with what τ alone says, before a step is taken with it."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.difference_maps import DifferenceMap
from coadjoint.difference_maps.axioms import _points, require_map
from coadjoint.difference_maps.difference_map import _measured
from coadjoint.errors import GroupError
from coadjoint.groups.overrides import members
from coadjoint.kernels.trace.evaluate import evaluate
from own_members import broken, changed, flipped, result_scaled, scaled, sentence_of, short
from systems import GROUPS, MAPS

ERRORS = {
    "_tau": (
        lambda right, self, group, xi: right(self, group, 2 * xi),
        lambda right, self, group, xi: right(self, group, (1 + 1e-8) * xi),
        broken,
    ),
    "tau": (scaled,),
    "_dtau": (scaled, flipped, short),
    "dtau": (scaled,),
    "_dtau_inverse_dual": (scaled, lambda right, self, group, xi, mu: right(self, group, -xi, mu)),
    "dtau_inverse_dual": (scaled,),
    "dtau_dual": (scaled, lambda right, self, group, xi, mu: self.dtau(group, xi, mu)),
    "dtau_inverse": (scaled, flipped),
    "inverse": (result_scaled,),
    "_inverse": (result_scaled, lambda right, self, group, g: -right(self, group, g)),
    "_tangent": (result_scaled,),
    "_tangent_matrix": (result_scaled,),
    "chart": (lambda right, self, group, xi: jnp.nan, lambda right, self, group, xi: xi, broken),
}
UNFIT_PAIRS = {(group, tau) for group in ("SLn3", "SUn3") for tau in ("cayley", "squared", "bent", "pade")}
EXEMPT = {"require_fit": "a test itself; that of the base is applied beside it"}
CASES = [(name, error) for name, errors in ERRORS.items() for error in errors]


def begin(difference_map, group=None, **more):
    system = co.System(co.SO3() if group is None else group, lambda xi: 0.5 * xi @ xi, **more)
    return co.Midpoint(difference_map).begin(system, system.state(), 0.1)


def test_every_member_that_a_map_may_override_is_tested_here():
    assert set(ERRORS) | set(EXEMPT) == set(members(DifferenceMap))


@pytest.mark.cases(2)
@pytest.mark.parametrize("base", [co.Cayley, co.Exponential], ids=lambda base: base.__name__)
@pytest.mark.parametrize(("name", "error"), CASES, ids=lambda value: getattr(value, "__name__", value))
def test_a_wrong_member_of_a_map_is_named(base, name, error):
    message = sentence_of(lambda: begin(changed(base, name, error)))
    assert f"`{name}` of Wrong()" in message


@pytest.mark.parametrize("error", [*ERRORS["chart"][:2], lambda *_: jnp.inf, lambda *_: -0.5])
def test_a_chart_that_is_no_distance_is_named(error):
    with pytest.raises(GroupError, match=r"`chart` of Wrong\(\) must measure how far"):
        _points(changed(co.Cayley, "chart", error), co.SO3())


def test_a_map_whose_derivative_at_zero_is_not_one_is_refused():
    """τ(ξ) = exp(2ξ) is inverted by its argument and stays in the group; ξ would be half the velocity."""

    class Twice(DifferenceMap):
        def _tau(self, group, xi):
            return group.exp(2 * xi)

    assert sentence_of(lambda: begin(Twice())).startswith("`_tau` of Twice on SO3() must satisfy Dτ(0) = 1, but")


def test_a_fit_of_ones_own_does_not_replace_that_of_the_base():
    class Lopsided(DifferenceMap):
        def require_fit(self, group):
            pass

        def _tau(self, group, xi):
            return group.exp((1 + 0.3 * jnp.sum(xi)) * xi)

    assert "is not a group difference map" in sentence_of(lambda: begin(Lopsided()))
    assert _measured(Lopsided(), co.Translation(2))["asymmetry"] > 1e-2  # though most of its matrix is that of e


def test_a_map_that_lacks_tau_is_told():
    class Bare(DifferenceMap):
        def require_fit(self, group):
            pass

    assert "must give `_tau`" in sentence_of(lambda: begin(Bare()))


def test_a_wrong_map_may_be_used_by_who_asks_for_it():
    begin(changed(co.Cayley, "_dtau", scaled), verify=False)


def test_a_wrong_map_is_found_inside_its_square():
    assert "`_dtau` of Wrong()" in sentence_of(
        lambda: begin(co.difference_maps.Squared(changed(co.Cayley, "_dtau", scaled)))
    )


def test_a_form_that_ships_does_not_fit_a_subclass_of_its_group():
    class Halved(co.Translation):
        basis = property(lambda self: 0.5 * co.Translation(self.size).basis)
        tangent = exp = staticmethod(lambda xi: 0.5 * xi)
        vee = staticmethod(lambda matrix: 2 * matrix[:-1, -1])
        _log = staticmethod(lambda g: 2 * g)

    group = Halved(2)
    co.System(group, lambda xi: 0.5 * xi @ xi)
    assert "`_tau` of Cayley() on" in sentence_of(lambda: begin(co.Cayley(), group))


@pytest.mark.cases(3)
@pytest.mark.parametrize("tau", MAPS)
@pytest.mark.parametrize("group", ["SO2", "SO3", "SE3", "SL2"])
def test_maps_that_ship_satisfy_what_is_asked_of_others(tau, group):
    require_map(MAPS[tau], GROUPS[group])


@pytest.mark.long
@pytest.mark.parametrize("tau", MAPS)
@pytest.mark.parametrize("group", GROUPS)
def test_every_map_that_ships_satisfies_it_on_every_group_that_it_fits(tau, group):
    if (group, tau) in UNFIT_PAIRS:
        pytest.skip("refused by `require_fit`")
    require_map(MAPS[tau], GROUPS[group])


def test_maps_that_ship_pay_nothing(monkeypatch):
    monkeypatch.setattr("coadjoint.difference_maps.axioms.require_map", lambda *_: pytest.fail("compared"))
    for name in ("cayley", "exponential", "squared", "pade"):
        begin(MAPS[name])


class Sometimes(DifferenceMap):
    """The exponential, but for half of all ξ, where it leaves the group."""

    def _tau(self, group, xi):
        return group.exp(xi) * jnp.where(xi[0] > 0, 1.0 + 1e-3 * xi[1], 1.0)


def test_a_map_that_leaves_the_group_for_some_elements_alone_does_not_fit():
    with pytest.raises(co.errors.GroupError, match="leaves the algebra by"):
        Sometimes().require_fit(co.SO3())


@pytest.mark.parametrize("tau", [co.Cayley(), co.Exponential()], ids=repr)
def test_a_map_on_an_opposite_group_is_that_on_the_group_and_so_is_its_inverse(tau):
    group, xi = co.SO3(), np.array([0.3, -0.2, 0.5])
    opposite = co.groups.Opposite(group)
    found, known, back = evaluate(
        lambda xi: (tau.tau(opposite, xi), tau.tau(group, xi), tau.inverse(opposite, tau.tau(group, xi))), xi
    )
    np.testing.assert_array_equal(found, known)
    np.testing.assert_allclose(back, xi, atol=1e-14)
