"""A ruler as plain numbers, for the file of a stepper. Knows NumPy only."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from coadjoint.simulation.accuracy.metric import Numbers, Ruler
from coadjoint.simulation.accuracy.parts import InternalPlaces, PartsOfSteps, StepTaker


class Bilinear(NamedTuple):
    """q = g·n of rows by T, q_i = T_ijk (1, g)_j (1, n)_k."""

    tensor: np.ndarray
    g: Numbers
    n: Numbers

    def __call__(self, rows: np.ndarray) -> np.ndarray:
        one = np.ones((len(rows), 1))
        g, n = (np.concatenate([one, rows[:, list(numbers)]], axis=1) for numbers in (self.g, self.n))
        return np.einsum("ijk,rj,rk->ri", self.tensor, g, n)


class Frequencies(NamedTuple):
    """The largest frequency of ad_ξ by structure constants, [ξ, η]_i = c_ijk ξ_j η_k; of copies of a group its own."""

    constants: np.ndarray
    copies: int = 1

    def __call__(self, xi: np.ndarray) -> np.ndarray:
        if not self.constants.any():
            return np.zeros(len(xi))
        each = xi.reshape(len(xi) * self.copies, -1)
        ad = np.einsum("ijk,rj->rik", self.constants, each)
        return np.max(np.abs(np.linalg.eigvals(ad).imag), axis=1).reshape(len(xi), self.copies).max(axis=1)


def to_plain(parts: PartsOfSteps, ruler: Ruler) -> dict[str, Any]:
    """What `from_plain` needs, for JSON; ruler: one whose functions are those above."""
    found = {name: value for name, value in ruler._asdict().items() if name not in ("q", "turning")}
    for name in ("q", "turning"):
        made: Any = getattr(ruler, name)
        found[name] = None if made is None else [np.asarray(part).tolist() for part in made]
    return {"ruler": found, "course": list(parts.course), "order": parts.order}


def from_plain(given: Mapping[str, Any], probe: StepTaker) -> PartsOfSteps:
    """What compares steps that `probe` takes."""
    known = dict(given["ruler"])
    for name in ("configuration", "points", "momenta"):
        known[name] = tuple((one[0], *map(_numbers, one[1:])) for one in known[name])
    for name in ("mu", "pi", "xi", "nu"):
        known[name] = _numbers(known[name])
    q, (constants, copies) = known["q"], known["turning"]
    known["q"] = None if q is None else Bilinear(np.asarray(q[0], float), _numbers(q[1]), _numbers(q[2]))
    known["turning"] = Frequencies(np.asarray(constants, float), int(copies))
    due, *courses = given["course"]
    return PartsOfSteps(probe, Ruler(**known), InternalPlaces(due, *map(_numbers, courses)), int(given["order"]))


def _numbers(given: Any) -> Any:
    """Lists of a JSON file as tuples."""
    return tuple(int(i) for i in given) if isinstance(given, list) else int(given)
