"""Parameters of members with normal deviations: numbers, shares, symmetric matrices, and seeds."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import ArgumentError
from coadjoint.sections import read
from coadjoint_vehicles.missions.perturb import PerturbSection, _deviation, _varied, seeds

MEMBERS = 4000
P = SimpleNamespace(
    mass=2.0, inertia=np.diag([1.0, 2.0, 3.0]), offset=np.array([1.0, -4.0]), rudder=SimpleNamespace(area=0.5)
)


def drawn(**deviations: Any) -> dict[str, Any]:
    return _varied(deviations, P, MEMBERS, np.random.default_rng(3))


def test_members_have_the_mean_and_the_deviation():
    found = drawn(mass=0.1, offset=[0.1, 0.2], rudder={"area": "10 %"})
    mass, offset = (np.asarray(found[name].values) for name in ("mass", "offset"))
    assert mass.mean() == pytest.approx(2.0, abs=0.01) and mass.std() == pytest.approx(0.1, rel=0.05)
    assert offset.mean(axis=0) == pytest.approx([1.0, -4.0], abs=0.02)
    assert offset.std(axis=0) == pytest.approx([0.1, 0.2], rel=0.05)
    assert abs(np.corrcoef(offset.T)[0, 1]) < 0.06
    assert np.asarray(found["rudder"]["area"].values).std() == pytest.approx(0.05, rel=0.05)


def test_a_symmetric_matrix_stays_symmetric_with_one_deviation_for_each_pair():
    inertia = np.asarray(drawn(inertia=0.1)["inertia"].values)
    assert np.array_equal(inertia, inertia.swapaxes(1, 2))
    assert (inertia - P.inertia).std(axis=0) == pytest.approx(np.full((3, 3), 0.1), rel=0.06)
    assert len(np.unique(inertia[0])) == 6


def test_a_share_is_of_the_size_of_the_parameter():
    assert _deviation("offset", "50 %", P.offset).tolist() == [0.5, 2.0]
    assert _deviation("offset", 0.25, P.offset).tolist() == [0.25, 0.25]
    assert _deviation("offset", 0.0, P.offset).tolist() == [0.0, 0.0]
    for wrong in ("a lot", "x %", [1.0, 2.0, 3.0], -0.1, np.inf):
        with pytest.raises(ArgumentError, match=r"\[perturb\] offset must"):
            _deviation("offset", wrong, P.offset)


def test_each_member_has_a_seed_of_its_own():
    def drawn(members: int, **given: Any) -> Any:
        return seeds(read(PerturbSection, "perturb", given), members)

    assert drawn(1, seed=5) is None
    assert np.asarray(drawn(3, seed=2).values).tolist() == [6, 7, 8]
    own = co.each([4, 9])
    assert drawn(2, seed=own) is own and np.asarray(drawn(2).values).tolist() == [0, 1]
    for wrong in (-1, 1.0, True, "1"):
        with pytest.raises(ArgumentError, match="seed must be a whole number from 0"):
            drawn(2, seed=wrong)
