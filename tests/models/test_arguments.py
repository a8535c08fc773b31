"""What no body can have is refused before a run, with one sentence that says how to mend it."""

from __future__ import annotations

from typing import Any

import jax
import numpy as np
import pytest

import coadjoint as co
from coadjoint import models
from coadjoint.models import heavy_top, paper_form, rigid_body
from coadjoint_vehicles import hydrodynamics

VEHICLE = {**models.TABLE_1}
GENERAL = {"mass": 30.0, "inertia": (1.0, 2.0, 2.0), "added_mass": np.diag([1.0, 2.0, 3.0, 0.1, 0.2, 0.3])}
TOP = {"mass": 1.0, "center_of_mass": (0, 0, 1), "inertia": (2, 2, 1)}
SKEWED = [[5.0, 0.1, 0.0], [0.0, 5.0, 0.0], [0.0, 0.0, 6.0]]
SINGULAR = [[1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
INDEFINITE = [[1.0, 2.0, 0.0], [2.0, 1.0, 0.0], [0.0, 0.0, 1.0]]


def vehicle(**changes):
    return paper_form.vehicle(**{**VEHICLE, **changes})


def general(**changes):
    return models.general_vehicle(**{**GENERAL, **changes})


def top(**changes):
    return heavy_top.make(**{**TOP, **changes})


def values(system: co.System) -> Any:
    return system.parameters


def tilted(A, entry=(0, 3), by=0.5):
    A = np.array(A)
    A[entry] += by
    return A


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: vehicle(mass=0.0), "Argument `mass` must be positive, but is 0."),
        (lambda: vehicle(mass=-3), "Argument `mass` must be positive, but is -3."),
        (lambda: vehicle(mass=[1, 2]), "Argument `mass` must be one number, but has shape (2,)."),
        (lambda: vehicle(mass=float("nan")), "Argument `mass` must be finite, but is nan."),
        (lambda: vehicle(mass="heavy"), "Argument `mass` must be a number or an array of numbers, but is 'heavy'."),
        (
            lambda: vehicle(inertia=SKEWED),
            "`inertia` must be symmetric, but differs from its transpose by 0.1",
        ),
        (lambda: vehicle(inertia=SINGULAR), "Argument `inertia` must be positive definite, but is singular"),
        (lambda: vehicle(inertia=(1, 1, 0)), "it gives no inertia along [0.0, 0.0, 1.0]."),
        (
            lambda: vehicle(inertia=INDEFINITE),
            "`inertia` must be positive definite, but has the eigenvalue -1",
        ),
        (lambda: vehicle(inertia=(1, 2)), "must have shape (3, 3) or (3,), but has shape (2,)."),
        (lambda: vehicle(added_mass=SKEWED), "use (added_mass + added_mass.T) / 2 if that is what you mean."),
        (lambda: vehicle(added_mass=INDEFINITE), "Argument `added_mass` must have no negative eigenvalue, but has -1"),
        (lambda: vehicle(added_mass=np.zeros((6, 6))), "but has shape (6, 6)."),
        (lambda: vehicle(buoyancy=-1.0), "Argument `buoyancy` must be at least 0, but is -1."),
        (lambda: vehicle(gravity=-9.81), "Argument `gravity` must be at least 0, but is -9.81."),
        (lambda: vehicle(center_of_buoyancy=0.1), "`center_of_buoyancy` must have shape (3,), but has shape ()."),
        (lambda: vehicle(mass=np.float32(3.1)), "Argument `mass` must be float64, but is float32"),
        (lambda: general(added_mass=tilted(GENERAL["added_mass"])), "Argument `added_mass` must be symmetric"),
        (
            lambda: general(added_mass=-GENERAL["added_mass"]),
            "added mass is positive here, the negative of",
        ),
        (lambda: general(inertia=SINGULAR), "Argument `inertia` must be positive definite, but is singular"),
        (lambda: models.se3_vehicle(**{**GENERAL, "mass": -1.0}), "Argument `mass` must be positive"),
        (lambda: top(inertia=INDEFINITE), "Argument `inertia` must be positive definite"),
        (
            lambda: top(inertia_about="centre"),
            'must be "pivot" or "center_of_mass", but is \'centre\'.',
        ),
        (lambda: rigid_body.make(inertia=SKEWED), "Argument `inertia` must be symmetric"),
        (lambda: hydrodynamics.ellipsoid(semi_axes=(1, 0, 1)), "Argument `semi_axes` must be positive"),
        (lambda: hydrodynamics.ellipsoid_added_mass((1, 1, 1), -5), "Argument `fluid_density` must be positive"),
    ],
)
def test_a_body_that_cannot_be_is_refused_in_one_sentence(make, says):
    with pytest.raises(co.errors.ArgumentError) as caught:
        make()
    assert says in str(caught.value) and str(caught.value).endswith(".") and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"rotation": np.diag([1, 1, -1])}, "the determinant is −1"),
        ({"rotation": 2 * np.eye(3)}, "must lie in SO3()"),
        ({"rotation": np.eye(2)}, "Argument `rotation` must have shape (3, 3), but has shape (2, 2)."),
        ({"rotation": np.eye(3), "euler_zyx": (0, 0, 0)}, "Give one of `rotation` and `euler_zyx`, not both."),
        ({"euler_rates": (0, 0, 1)}, "Argument `euler_rates` needs `euler_zxz` or `euler_zyx`"),
        ({"euler_zxz": (0, 0)}, "Argument `euler_zxz` must have shape (3,), but has shape (2,)."),
        ({"angular_velocity": (0, 0)}, "Argument `angular_velocity` must have shape (3,)"),
        ({"angular_velocity": (0, 0, 1), "euler_zxz": (0, 0, 0), "euler_rates": (0, 0, 1)}, "Give one of"),
        ({"position": (0, 0)}, "Argument `position` must have shape (3,), but has shape (2,)."),
        ({"velocity": (0, np.inf, 0)}, "Argument `velocity` must be finite"),
        ({"down": (0, 0, -9.81)}, "Argument `down` must be a unit vector, but has length 9.81; divide by it."),
    ],
)
def test_a_start_that_cannot_be_is_refused_in_one_sentence(changes, says):
    for begin, make in ((paper_form.start, paper_form.vehicle), (models.se3_start, None)):
        system = make(**VEHICLE) if make else models.se3_vehicle(**GENERAL)
        with pytest.raises(co.errors.ArgumentError) as caught:
            begin(system, **changes)
        assert says.replace("SO3", "SE3" if make is None else "SO3") in str(caught.value)


def test_a_body_of_revolution_may_have_no_added_mass_in_roll():
    assert values(general(added_mass=(1.0, 2.0, 2.0, 0.0, 0.3, 0.3))).added_mass[3, 3] == 0.0
    assert np.array_equal(values(vehicle(added_mass=(0, 0, 0))).added_mass, np.zeros((3, 3)))


def test_a_vehicle_without_a_stated_buoyancy_is_neutral_to_the_last_digit():
    p = values(paper_form.vehicle(mass=123.8, added_mass=(1, 1, 1), inertia=(1, 1, 1)))
    assert p.mass * p.gravity - p.buoyancy == 0.0


def test_inertia_about_the_mass_centre_is_moved_to_the_pivot_by_steiner():
    r, m = np.array([0.3, -0.2, 0.5]), 2.0
    moved = values(top(mass=m, center_of_mass=r, inertia_about="center_of_mass")).inertia
    hat = np.array([[0, -r[2], r[1]], [r[2], 0, -r[0]], [-r[1], r[0], 0]])
    assert np.max(np.abs(moved - (np.diag([2, 2, 1]) - m * hat @ hat))) <= 1e-15


@pytest.mark.long
def test_a_model_made_inside_grad_is_differentiated_through_its_checks():
    def depth(mass):
        system = vehicle(mass=mass)
        start = paper_form.start(system, velocity=(0, 0, 0.5))
        return co.trajectory(system, start, dt=0.05, steps=20).final.q[2]

    with co.float64():
        slope = jax.grad(depth)(123.8)
    # On an even keel: q_z = v t + ½ t² (mg − B)/(m + A₃₃).
    expected = 0.5 * (9.81 * (123.8 + 75) - (123.8 * 9.81 - 1215.8)) / (123.8 + 75) ** 2
    assert float(slope) == pytest.approx(expected, rel=1e-9)
