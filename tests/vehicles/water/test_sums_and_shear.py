"""Currents that add up or change with depth, stratified water and the lift of a sheared current, in NumPy."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.spatial.transform import Rotation

import coadjoint as co
from coadjoint.errors import ArgumentError
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.spaces.named import Named
from coadjoint_vehicles.model import energies
from coadjoint_vehicles.water import (
    DensityTable,
    GaussMarkovCurrent,
    PowerLaw,
    Sea,
    Sheared,
    TidalCurrent,
    UniformWater,
    density,
    gauss_markov,
    sea,
)

TABLE = DensityTable([1.0, 3.0, 4.0], [1020.0, 1024.0, 1030.0])


@pytest.fixture
def eager(monkeypatch):
    for module in (density, gauss_markov, sea):
        monkeypatch.setattr(module, "jnp", np)


def test_a_table_of_densities_is_linear_between_its_rows_and_its_head_is_the_integral(eager):
    own = Named(depths=np.array(TABLE.depths), densities=np.array(TABLE.densities))
    for depth in (0.5, 1.7, 3.4, 6.0):
        expected = float(np.interp(depth, own.depths, own.densities))
        assert TABLE.density(np.float64(depth), own) == pytest.approx(expected, rel=1e-14)
        head, _ = quad(lambda z: np.interp(z, own.depths, own.densities), 0, depth, points=[1.0, 3.0, 4.0])
        assert TABLE.pressure_head(np.float64(depth), own) == pytest.approx(head, rel=1e-12)


def test_a_linear_density_has_the_head_of_its_integral_and_is_that_of_the_surface_above_it(eager):
    own = Named(surface=1025.0, gradient=0.2)
    linear = density.LinearDensity(1025.0, 0.2)
    for depth in (-1.0, 0.0, 5.0):
        expected = 1025.0 * depth + 0.1 * max(depth, 0.0) ** 2
        assert linear.pressure_head(np.float64(depth), own) == pytest.approx(expected)


GUSTS = GaussMarkovCurrent((0.1, 0.2, 0.0), 60.0)
TIDE = TidalCurrent(["M2"], [[0.5, 0.0, 0.0]])


def test_a_sea_is_steady_where_all_currents_are_and_timed_where_one_is():
    calm, tidal = Sea(a=UniformWater((1, 0, 0))), Sea(a=UniformWater((1, 0, 0)), tide=TIDE)
    assert (calm.steady, calm.timed, tidal.steady, tidal.timed) == (True, False, TIDE.steady, True)
    for surface in (UniformWater((1, 0, 0)), TIDE):
        sheared = Sheared(surface, PowerLaw(40.0))
        assert (sheared.steady, sheared.timed) == (surface.steady, surface.timed) and not sheared.uniform
        assert repr(sheared) == f"Sheared({surface!r}, {sheared.profile!r})"
    assert not TIDE.steady and not UniformWater((1, 0, 0)).timed


@pytest.mark.parametrize("seed", [5, co.each([5, 6])])
def test_random_currents_of_a_sea_have_seeds_of_their_own(seed, monkeypatch):
    monkeypatch.setattr(GaussMarkovCurrent, "start", lambda self: {"random": getattr(self.seed, "values", self.seed)})
    made = Sea(a=GUSTS, still=UniformWater((1, 0, 0)), b=GaussMarkovCurrent((0.1, 0.2, 0.0), 60.0, seed=1)).seeded(seed)
    own = [made.currents[name].seed for name in "ab"]
    numbers = [np.asarray(getattr(one, "values", one)).tolist() for one in own]
    assert numbers == ([10, 11] if seed == 5 else [[10, 12], [11, 13]])
    assert made.currents["still"].start() == {} and list(made.currents) == ["a", "still", "b"]


def test_a_gust_decays_by_its_correlation_time_and_is_stirred_to_its_deviation(eager, monkeypatch):
    monkeypatch.setattr(gauss_markov, "normal", lambda random, count: (np.array([1.0, -2.0, 0.5]), random + 1))
    monkeypatch.setattr(gauss_markov, "jumped", lambda random: 10 * random)
    own, begun = Named(correlation_time=4.0), Named(z=np.array([0.3, 0.2, -0.1]), random=6)
    after = GUSTS.advance(begun, 2.0, own)
    kept = np.exp(-0.5)
    np.testing.assert_allclose(after["z"], kept * begun.z + np.sqrt(1 - kept**2) * np.array([1.0, -2.0, 0.5]))
    assert after["random"] == 70
    twice = Sea(a=GUSTS, still=UniformWater((1, 0, 0))).advance(Named(a=begun), 2.0, Named(a=own))
    assert list(twice) == ["a"] and twice["a"]["random"] == 70
    surface = SimpleNamespace(advance=lambda internal, h, own: (internal, h, own))
    sheared = cast(Any, SimpleNamespace(surface=surface))
    assert Sheared.advance(sheared, cast(Any, "m"), 0.5, cast(Any, SimpleNamespace(surface="own"))) == ("m", 0.5, "own")


def test_water_without_density_says_what_is_missing():
    still = UniformWater((0, 0, 0))
    assert still.seeded(3) is still and still.advance(Named(), 0.1, Named()) == {}
    for ask in (still.density, still.pressure_head):
        with pytest.raises(ArgumentError, match=ask.__name__):
            ask(np.zeros(()), Named())


def test_a_sheared_current_lifts_displaced_water_across_its_vorticity():
    """−ρV (∇ × c) × ν_r at b, of c = A q with any A: ∇ × c is twice the axial vector of A."""
    A = np.array([[0.1, 0.4, -0.2], [0.3, -0.1, 0.5], [0.6, -0.7, 0.0]])
    R = Rotation.from_euler("ZYX", [0.4, 0.3, -0.2]).as_matrix()
    n, nu, xi, b = (
        np.array([1.0, 2.0, 3.0]),
        np.array([0.5, -0.2, 0.1]),
        np.array([0.1, 0.3, -0.4]),
        np.array([0.2, 0.0, -0.1]),
    )
    water = SimpleNamespace(start=dict, current=lambda q, t, memory, own: A @ q)
    p = Named(water=Named(), fluid_density=1000.0, volume=0.02, center_of_buoyancy=b)

    def lift(n, nu, xi):
        motion = SimpleNamespace(
            n=n, a=SimpleNamespace(down=R[2], north=R[0]), t=0.0, internal=Named(), nu=nu, xi=xi, inputs=None
        )
        found = energies.shear(cast(Any, water), (), cast(Any, motion), p)
        return found.torque, found.force

    torque, force = evaluate(lift, n, nu, xi)
    curl = np.array([A[2, 1] - A[1, 2], A[0, 2] - A[2, 0], A[1, 0] - A[0, 1]])
    through = nu + np.cross(xi, b) - R.T @ A @ R @ (n + b)
    expected = -1000.0 * 0.02 * np.cross(R.T @ curl, through)
    np.testing.assert_allclose(force, expected, rtol=1e-12)
    np.testing.assert_allclose(torque, np.cross(b, expected), rtol=1e-12)
