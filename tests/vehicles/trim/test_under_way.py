"""The linearised motion that gains are proposed from is that of the library's own equations."""

from __future__ import annotations

import numpy as np
import pytest

import coadjoint_vehicles as vehicles
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.spaces.named import named
from coadjoint.stability import Reduced
from coadjoint_vehicles import Craft
from coadjoint_vehicles.trim.under_way import coadjoint, under_way

ROWS = [6, 7, 8, 0, 1, 2]
"""π and μ among y = (μ, n, π, a)."""


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("name", ["remus_100", "nps_auv_ii"])
def test_mass_and_damping_are_those_of_stability_at_the_trim(name):
    vehicle = vehicles.load(name)
    motion = under_way(vehicle, 1.0)
    craft, places, begin = Craft(vehicle), {}, 0
    commands = motion.level.rest.copy()
    commands[motion.acting] = motion.trim
    for part in vehicle.commanded:
        assert part.command is not None
        end = begin + int(np.prod(part.command.shape, dtype=int))
        places[part.name], begin = commands[begin:end].reshape(part.command.shape), end
    state = craft.start(speed=1.0).replace(internal=named(places))
    slopes = Reduced(craft.system, state).slopes(state)
    moving = [6, 7, 8, 0, 1, 2]  # δν, δξ among z = (δξ, δn, δν, η)
    np.testing.assert_allclose(motion.mass, slopes.y_z[np.ix_(ROWS, moving)], atol=1e-12)
    np.testing.assert_allclose(motion.damping, slopes.rate_z[np.ix_(ROWS, moving)], rtol=1e-12, atol=1e-10)


def test_coriolis_terms_of_a_mass_matrix_do_no_work_and_are_kirchhoffs():
    random = np.random.default_rng(5)
    A, V = random.normal(size=(6, 6)), random.normal(size=6)
    M = A @ A.T
    (p, pi), v, w = np.split(M @ V, 2), V[:3], V[3:]
    found = evaluate(coadjoint, M, V)
    np.testing.assert_allclose(found, [*np.cross(p, w), *(np.cross(pi, w) + np.cross(p, v))], rtol=1e-12)
    assert abs(found @ V) < 1e-11
