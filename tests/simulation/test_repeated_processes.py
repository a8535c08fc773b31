"""What a second process of the same run finds on disk, it does not trace, and it begins as the first did."""

from __future__ import annotations

import numpy as np
import pytest

from coadjoint.kernels.run import disk_cache
from coadjoint.kernels.trace import evaluate as tracing
from coadjoint.mechanics import start
from coadjoint.methods.midpoint import Midpoint
from coadjoint.models import catalogue, rods
from coadjoint.simulation.accuracy import ruler
from coadjoint.spaces import space


def name_of(function):
    return function.__name__ if hasattr(function, "__name__") else name_of(function.function)


@pytest.fixture(autouse=True)
def traced(tmp_path, monkeypatch):
    """The names of functions that are traced."""
    monkeypatch.setenv("COADJOINT_CACHE", str(tmp_path / "cache"))
    names, program_of, require_scalar = [], tracing.program_of, start.require_scalar
    monkeypatch.setattr(tracing, "program_of", lambda f, *more: (names.append(name_of(f)), program_of(f, *more))[1])
    monkeypatch.setattr(start, "require_scalar", lambda *args: (names.append("energy"), require_scalar(*args))[1])
    return names


def forget():
    """Be like another process."""
    for known in (space.require_action, space._require_affine):
        known.cache_clear()
    disk_cache._asked.clear()
    ruler._structures.clear()


@pytest.fixture
def begun(traced):
    """A start of the heavy top and the functions traced for it, as in a process of its own."""

    def begin(**initial):
        forget()
        traced.clear()
        top = catalogue["heavy_top"].make()
        state = start.momentum_start(top, catalogue["heavy_top"].start(top, **initial))
        return state, ruler.structure(top.group), list(traced)

    return begin


def test_a_second_process_begins_to_the_bit_as_the_first_and_traces_no_function_of_the_system(begun):
    (first, structure, traced), (second, again, later) = begun(), begun()
    assert {"energy", "moving", "momenta"} <= set(traced) and set(later) <= {"identity"}
    for name in ("t", "g", "n", "a", "mu", "pi", "xi", "nu"):
        assert np.array_equal(getattr(first, name), getattr(second, name)), name
    assert np.array_equal(structure, again)


def test_another_velocity_begins_with_its_own_momenta(begun):
    begun()
    state, _, traced = begun(angular_velocity=(0.0, 1.0, 2.0))
    assert {"moving", "momenta"} <= set(traced) and "measure" not in traced
    assert np.array_equal(state.xi, [0.0, 1.0, 2.0])


def test_a_loop_over_starts_does_not_fill_the_cache(begun, tmp_path, monkeypatch):
    monkeypatch.setattr(disk_cache, "FEW", 2)
    begun()
    top = catalogue["heavy_top"].make()
    before = len(list((tmp_path / "cache").iterdir()))
    for k in range(4):
        catalogue["heavy_top"].start(top, angular_velocity=(float(k), 0.0, 0.0))
    assert len(list((tmp_path / "cache").iterdir())) == before + 1


@pytest.mark.long
def test_the_pairs_of_links_are_checked_once(traced):
    def begin():
        forget()
        traced.clear()
        rod = rods.planar(elements=2, length=1.0, EI=1.0, EA=400.0, GA=200.0, mass=1.0, inertia=0.01)
        return Midpoint().begin(rod, rods.planar_start(rod, curvature=0.1), 0.01)

    begin()
    assert "compared" in traced
    begin()
    assert "compared" not in traced and "energy" not in traced
