"""A space of one's own is compared with what its action says, before anything is computed with it."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import GroupError
from coadjoint.groups.overrides import members
from coadjoint.spaces import Representation, Space
from coadjoint.spaces.axioms import require_space
from own_members import NEARLY, broken, changed, flipped, result_scaled, scaled, sentence_of, short, text
from systems import FRAMES, GROUPS, WORLDS


def swapped_last(right, self, group, *given):
    return right(self, group, *given[:-2], given[-1], given[-2])


FLAT_ERRORS = {
    "act": (result_scaled, short, broken),
    "push": (scaled, flipped, short),
    "pull": (scaled, flipped, lambda right, self, group, g, x, b: self.push(group, g, x, b)),
    "infinitesimal": (scaled, flipped, text),
    "lifted": (scaled, flipped),
    "diamond": (scaled, flipped, swapped_last),
    "lifted_diamond": (scaled, flipped),
    "tangent": (scaled,),
    "coordinates": (scaled,),
    "difference": (scaled,),
    "project": (scaled,),
    "momentum": (lambda right, self, group, x, transported, legendre: legendre,),
    "defect": (lambda right, self, group, x: 1e-8,),
    "dim": (lambda right, self, group: 2,),
}
CURVED_ERRORS = {
    "act": (lambda right, self, group, g, x: right(self, group, g, x) * (1 + 1e-3 * (1 - x @ x)) * NEARLY,),
    "tangent": (result_scaled, lambda right, self, group, x, y: jnp.eye(3)[:, :2] @ y, short),
    "coordinates": (result_scaled, flipped),
    "difference": (scaled, lambda right, self, group, x, u: u, lambda right, self, group, x, u: 0 * u),
    "project": (result_scaled, lambda right, self, group, x, b: b),
    "momentum": (result_scaled, lambda right, self, group, x, transported, legendre: legendre),
    "dim": (lambda right, self, group: 3,),
}
EXEMPT = {
    "flat": "chooses what is compared",
    "affine": "chooses what is compared",
    "sample": "a point to test at",
    "at_start": "chooses what a start may leave out",
    "ambient": "the length of all arrays: what does not fit it is told by shape",
    "require_fit": "a test itself",
    "view": "how the user's functions see a point",
    "point": "checks what a user gives",
    "velocity": "checks what a user gives",
    "given": "what `point` makes a point of",
    "components": "names of a dataset",
}


def cases(errors):
    return [(name, error) for name, several in errors.items() for error in several]


def on(space, group=None, **more):
    """The system with ℓ = ½|ξ|² + ½|ν|² on this space."""
    return co.System(
        co.SO3() if group is None else group, lambda xi, n, nu: 0.5 * xi @ xi + 0.5 * nu @ nu, additional=space, **more
    )


def test_every_member_that_a_space_may_override_is_tested_here():
    assert set(FLAT_ERRORS) | set(CURVED_ERRORS) | set(EXEMPT) == set(members(Space))


@pytest.mark.cases(14)
@pytest.mark.parametrize(("name", "error"), cases(FLAT_ERRORS), ids=lambda value: getattr(value, "__name__", value))
def test_a_wrong_member_of_a_flat_space_is_named(name, error):
    message = sentence_of(lambda: on(changed(co.Defining, name, error)))
    assert "Wrong() on SO3()" in message or "Wrong() must carry a left action" in message
    assert name == "act" or f"`{name}`" in message


@pytest.mark.cases(2)
@pytest.mark.parametrize(("name", "error"), cases(CURVED_ERRORS), ids=lambda value: getattr(value, "__name__", value))
def test_a_wrong_member_of_a_curved_space_is_named(name, error):
    message = sentence_of(lambda: on(changed(co.Sphere, name, error)))
    assert "Wrong" in message
    assert name == "act" or f"`{name}`" in message


def test_the_sentence_tells_class_member_deviation_and_remedy():
    assert sentence_of(lambda: on(changed(co.Defining, "diamond", flipped))) == (
        "`diamond` of Wrong() on SO3() must satisfy ⟨b⋄x, ξ⟩ = −⟨b, ξ·x⟩, but at random points it is off by 2.0e+00 of "
        "its size: mend it, leave it out where it would be derived, or give verify=False to co.System."
    )


@pytest.mark.long
def test_a_flipped_diamond_spoils_the_motion_and_shows_nowhere_on_the_card():
    """What the comparison is for: without it the card stands at round-off."""

    def top(xi, a):
        return 0.5 * xi @ (np.array([2.0, 2.0, 1.0]) * xi) - 3.0 * a[2]

    def energy(space, verify):
        system = co.System(co.SO3(), top, advected=space, verify=verify)
        start = system.state(g=co.attitude.zyx(0, 0, 0.3), xi=[0, 0, 1.0], a0=[0, 0, 1])
        run = co.simulate(system, start, dt=0.01, steps=200)
        return run.summary()["kelvin_noether_error_max"], run.relative_change("energy")

    wrong = changed(co.Defining, "diamond", flipped)
    kelvin_noether, lost = energy(wrong, False)
    assert kelvin_noether < 1e-13 and lost > 1e-3
    assert energy(co.Defining(), True)[1] < 0.01 * lost
    assert "`diamond`" in sentence_of(lambda: energy(wrong, True))


def test_a_form_that_ships_does_not_fit_an_action_of_ones_own():
    class Turned(co.Defining):
        def act(self, group, g, x):
            R = jnp.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
            return R @ (group.matrix(g) @ (R.T @ x))

    assert "`infinitesimal` of" in sentence_of(lambda: on(Turned()))


def test_wrong_spaces_are_found_inside_others():
    wrong = changed(co.Defining, "diamond", flipped)
    assert "`diamond` of Wrong()" in sentence_of(lambda: on({"e": wrong, "shape": co.Trivial(1)}))
    assert "`diamond` of Wrong()" in sentence_of(lambda: on(co.Sphere(wrong)))
    group = co.SemidirectProduct(co.SO3(), wrong)
    assert "`diamond` of Wrong()" in sentence_of(lambda: co.System(group, lambda xi: 0.5 * xi @ xi))


def test_a_wrong_space_may_be_used_by_who_asks_for_it():
    on(changed(co.Defining, "diamond", flipped), verify=False)


def test_an_action_of_a_special_group_does_not_pass_for_one_of_its_subclass():
    class Halved(co.SO3):
        """SO(3) in the basis of half the generators; `Defining` has a closed form for SO(3) itself."""

        basis = property(lambda self: 0.5 * co.SO3().basis)
        hat = staticmethod(lambda xi: co.SO3().hat(0.5 * xi))
        vee = staticmethod(lambda matrix: 2 * co.SO3().vee(matrix))
        ad = staticmethod(lambda xi, eta: 0.5 * jnp.cross(xi, eta))
        ad_dual = staticmethod(lambda xi, mu: 0.5 * jnp.cross(mu, xi))
        exp = staticmethod(lambda xi: co.SO3().exp(0.5 * xi))
        _log = staticmethod(lambda g: 2 * co.SO3()._log(g))
        angle_squared = staticmethod(lambda xi: 0.25 * (xi @ xi))
        rotation_angle = staticmethod(lambda xi: 0.5 * jnp.sqrt(xi @ xi))

    co.System(Halved(), lambda xi: 0.5 * xi @ xi)
    assert "`infinitesimal` of Defining() on" in sentence_of(lambda: on(co.Defining(), Halved()))


@pytest.mark.cases(2)
@pytest.mark.parametrize("name", WORLDS)
def test_spaces_that_ship_satisfy_what_is_asked_of_others(name):
    world = WORLDS[name]
    bare = co.System(world.group, lambda *_: 0.0, additional=world.additional, advected=world.advected)
    for space in (bare.additional, bare.advected):
        require_space(space, world.group)


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("space", "group"),
    [
        (co.spaces.GroupItself(), "SO3"),
        (co.spaces.GroupItself("conjugation"), "SE2"),
        (FRAMES, "SO3"),
        (co.spaces.Submanifold(lambda m: m @ m - 4, co.Coadjoint()), "SO3"),
        (co.spaces.Submanifold(lambda m: m @ m - 1e12, co.Coadjoint()), "SO3"),
        (co.spaces.Points(), "SE3"),
        (co.spaces.Points(), "SO3_R3"),
    ],
    ids=["multiplication", "conjugation", "frames", "small orbit", "large orbit", "points SE3", "points SO3_R3"],
)
def test_other_spaces_that_ship_satisfy_it_too(space, group):
    require_space(space, GROUPS[group])


def test_right_members_of_a_curved_space_are_taken():
    require_space(co.Sphere(), co.SO3())


def test_a_curved_space_without_a_point_that_can_be_found_is_told():
    space = changed(co.Sphere, "defect", lambda right, self, group, x: 1 + x @ x)
    assert "No point of Wrong" in sentence_of(lambda: on(space))


def test_what_a_space_lacks_is_named():
    class Bare(Space):
        def ambient(self, group):
            return 3

    class Bent(Representation):
        flat = False
        ambient = staticmethod(lambda group: 3)
        act = staticmethod(lambda group, g, x: group.matrix(g) @ x)

    assert "must give `act`" in sentence_of(lambda: on(Bare()))
    assert "must give `dim`" in sentence_of(lambda: on(Bent()))


def test_random_points_of_the_comparison_lie_in_the_space():
    from coadjoint.spaces.axioms import _points

    for _, _, x, *_ in _points(FRAMES, co.SO3()):
        np.testing.assert_allclose([x[:3] @ x[:3], x[3:] @ x[3:], x[:3] @ x[3:]], [1, 1, 0], atol=1e-11)


def test_errors_are_those_of_the_group_and_its_space():
    with pytest.raises(GroupError):
        on(changed(co.Defining, "push", scaled))


class Careful(type(co.Defining())):
    """A flat space whose own members are right, and look at what they are given."""

    def dim(self, group):
        return group.matrix_size

    def tangent(self, group, x, y):
        return y + 0 * x[: group.matrix_size]

    def coordinates(self, group, x, b):
        return b + 0 * x[: group.matrix_size]

    def difference(self, group, x, u):
        return u + 0 * x[: group.matrix_size]

    def project(self, group, x, b):
        return b + 0 * x[: group.matrix_size]

    def momentum(self, group, x, transported, legendre):
        return transported + 0 * x[: group.matrix_size]

    def defect(self, group, x):
        return 0.0 * x[group.matrix_size - 1]


def test_right_members_of_a_flat_space_are_taken():
    require_space(Careful(), co.SO3())
