"""Each wrong use of a chain, of a large group, of a fluid and of vortices is told in one sentence."""

from __future__ import annotations

from functools import cache
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import CoadjointError
from coadjoint.models import fluids, point_vortices, toda

ISOSPECTRAL = co.IsospectralMidpoint()


def power(count: int = 3, coupling: Any = "chain") -> co.Power:
    return co.Power(co.SO3(), count, coupling)


def joined(xi, a):
    return 0.5 * jnp.sum(xi**2) + jnp.sum(jnp.trace(a, axis1=1, axis2=2))


@cache
def chain() -> co.System:
    return co.System(power(), joined, advected=co.spaces.RelativePoses())


def long_chain(energy) -> co.Run:
    system = co.System(power(22), energy)
    start = system.state(xi=0.1 * np.sin(np.arange(66.0)).reshape(22, 3))
    return co.simulate(system, start, dt=0.01, steps=3, accuracy=False)


@cache
def lie_poisson() -> co.System:
    weights = np.linspace(1.0, 2.0, 9)
    return co.System(co.Un(3), hamiltonian=lambda mu: 0.5 * mu @ (weights * mu))


@cache
def magnetic() -> co.System:
    return co.System(co.Un(3), hamiltonian=lambda mu, a: 0.5 * mu @ mu + a @ mu, advected=co.Coadjoint())


@cache
def fluid() -> co.System:
    return fluids.euler(4)


def too_long_a_step() -> co.Run:
    system = lie_poisson()
    start = system.state(mu=10 * np.ones(9))
    return co.simulate(system, start, dt=30.0, steps=3, method=ISOSPECTRAL, monitors=False, accuracy=False)


def too_many_records() -> Any:
    start = fluids.start(fluid(), fluids.random_vorticity(1, 3))
    return co.trajectory(fluid(), start, dt=0.01, steps=10**9, method=ISOSPECTRAL)


other: Any = 2.5
CHAINS = {
    "more links than there is memory": (
        lambda: co.System(co.Power(co.SO3(), 10**9), lambda xi: 0.5 * jnp.sum(xi**2)),
        r"A step of 1000000000 links on SO3\(\) would take 1.62e\+04 GB of memory, .* GB: take up to \d+ links",
    ),
    "more pairs than there is memory": (
        lambda: co.System(power(10**7, "all"), lambda xi: 0.5 * jnp.sum(xi**2)),
        r"A step of 10000000 links on SO3.* GB: take up to \d+ links",
    ),
    "velocities of two links": (
        lambda: chain().state(xi=np.zeros((2, 3))),
        r"`xi` of 3 links must have shape \(3, 3\), a row a link, or \(9,\), but has shape \(2, 3\)",
    ),
    "velocities of one link": (lambda: chain().state(xi=np.zeros(3)), r"`xi` must have shape \(9,\)"),
    "one pose": (lambda: chain().state(g=np.eye(3)), r"arrays of shape \(3, 3, 3\), but has shape \(3, 3\)"),
    "poses that are none": (lambda: chain().state(g=np.tile(2 * np.eye(3), (3, 1, 1))), "`g` must lie in Power"),
    "velocities that are none": (lambda: chain().state(xi=np.full((3, 3), np.nan)), "`xi` must be finite"),
    "one pose between links": (
        lambda: chain().state(a0=np.eye(3)),
        r"an element of SO3\(\) for each of 2 pairs, or be left out for e",
    ),
    "a pose between links that is none": (
        lambda: chain().state(a0=np.tile(2 * np.eye(3), (2, 1, 1))),
        r"The pose of the pair \(0, 1\) in `a0` must be an element of SO3\(\), but is off by",
    ),
    "no pairs": (lambda: co.spaces.RelativePoses([]), r"must be pairs of links such as .*, but is \[\]"),
    "no number of links": (
        lambda: co.Power(co.SO3(), other),
        "`count` of Power must be a whole number from 1, but is 2.5",
    ),
    "no group": (lambda: co.Power(co.SO3, 2), "`factor` of Power must be a Lie group such as SO3()"),
    "a power of a power": (lambda: co.Power(power(), 2), "must not be a power itself"),
    "no coupling": (lambda: power(3, "star"), '"chain", "ring", "all" or pairs of links, but is \'star\''),
    "a coupling out of range": (lambda: power(3, [(0, 3)]), r"pair \(0, 3\) of `coupling` must be .* from 0 to 2"),
    "a link coupled to itself": (lambda: power(3, [(1, 1)]), "of different ones"),
    "triples as coupling": (lambda: power(3, [(0, 1, 2)]), "must be a list of pairs of links"),
    "poses of links that are not there": (
        lambda: co.System(power(), joined, advected=co.spaces.RelativePoses([(0, 5)])),
        r"pair \(0, 5\) of RelativePoses must be of two links from 0 to 2, or −1 for the ground",
    ),
    "an energy of links that are not coupled": (
        lambda: long_chain(lambda xi: 0.5 * jnp.sum(xi**2) + 0.2 * xi[0] @ xi[9]),
        "The links 0 and 9 act on each other, but `coupling` of .* does not pair them: give their pair",
    ),
    "a link without mass": (
        lambda: long_chain(lambda xi: 0.5 * jnp.sum(xi[:-1] ** 2)),
        "the mass matrix of link 21 is singular",
    ),
    "an energy that is no number": (
        lambda: co.System(power(), lambda xi: 0.5 * xi**2).state(xi=np.zeros((3, 3))),
        r"must return one number, but returns \(3, 3\)",
    ),
}
GROUPS = {
    "no size": (lambda: co.SUn(other), "`size` of SUn must be a whole number from 2, but is 2.5"),
    "a matrix as momentum": (lambda: lie_poisson().state(mu=np.eye(3)), r"`mu` must have shape \(9,\)"),
    "a complex momentum": (lambda: lie_poisson().state(mu=1j * np.arange(9.0)), "`mu` must be .* numbers.*complex128"),
    "a matrix that is not unitary": (
        lambda: lie_poisson().state(g=(2 * np.eye(3), np.zeros((3, 3))), mu=np.zeros(9)),
        r"`g` must lie in Un\(size=3\), but the defining equations fail by",
    ),
    "a complex matrix": (
        lambda: lie_poisson().state(g=np.eye(3) + 0j, mu=np.zeros(9)),
        r"`g` must be an element of Un\(size=3\), arrays real \(3, 3\), imaginary \(3, 3\)",
    ),
    "Θ of another length": (
        lambda: magnetic().state(mu=np.zeros(9), a0=np.zeros(8)),
        r"`a0` must have shape \(9,\), but has shape \(8,\)",
    ),
    "no Θ": (lambda: magnetic().state(mu=np.zeros(9)), "give `a0`, 9 numbers in all"),
    "too long a step": (
        too_long_a_step,
        r"take a smaller dt: the iteration needs h‖ξ‖ below about 0.8, and a step of .* s is solved there.*Hamiltonian",
    ),
    "g by Cayley where it does not fit": (
        lambda: co.IsospectralMidpoint(carry_g=True).require_fit(co.System(co.SUn(3), hamiltonian=lambda mu: mu @ mu)),
        "does not map the algebra of SUn.size=3. into the group: leave out carry_g=True, or take co.Un",
    ),
    "a group that has no isospectral steps": (
        lambda: ISOSPECTRAL.require_fit(co.System(co.SE3(), hamiltonian=lambda mu: mu @ mu)),
        r"needs co.SOn, co.SO3, co.Un or co.SUn, or copies of one, but got SE3\(\): use co.HamiltonianMidpoint",
    ),
    "no bracket of Θ": (
        lambda: ISOSPECTRAL.require_fit(co.System(co.SO3(), hamiltonian=lambda mu, a: mu @ a, advected=co.Defining())),
        "advected parameters that move as the momentum does",
    ),
    "too many records": (too_many_records, "records of this trajectory would take .* GB of memory: raise save_every"),
    "a lattice of too many particles": (lambda: toda.lattice(particles=40), "a whole number from 2 to 12, but is 40"),
}
FLUIDS = {
    "no size": (lambda: fluids.euler(1), "`size` must be a whole number from 2, but is 1"),
    "too large": (lambda: fluids.euler(200_000), "at N = 200000 would take .* GB of memory, and this machine has"),
    "too large with a field": (lambda: fluids.magnetohydrodynamics(200_000), "would take .* GB of memory"),
    "too fine a grid": (
        lambda: fluids.on_grid(np.zeros((4, 4)), 10**6, 10**6),
        "A grid of 1000000 × 1000000 points would take .* GB of memory, and this machine has",
    ),
    "too much viscosity": (
        lambda: fluids.DampedMidpoint(viscosity=1e-3).require_fit(fluids.euler(500)),
        "at N = 500 would take 1 GB: take N up to 406, or drag alone",
    ),
    "degrees that are too high": (
        lambda: fluids.start(fluid(), fluids.random_vorticity(1, 8)),
        r"L up to N = 4, degrees up to 3, but has shape \(9, 9\): leave out the higher degrees, or take a larger N",
    ),
    "a function that is not real": (
        lambda: fluids.start(fluid(), 1j * np.array([[0, 0], [1, 0]])),
        "must be real for m = 0, because the function is",
    ),
    "an order above its degree": (
        lambda: fluids.start(fluid(), np.array([[0, 1], [0, 0]])),
        r"must be 0 where m > l, but c\[0, 1\] is 1\+0j: its first index is l",
    ),
    "a mean": (lambda: fluids.start(fluid(), np.diag([1.0, 0.0])), "must have mean 0, but c_00 is 1"),
    "another system": (lambda: fluids.vorticity(chain(), other), "must be a fluid of co.models.fluids"),
    "a run instead of records": (
        lambda: fluids.vorticity(fluid(), chain()),
        "`records` must be a state of this fluid, or states with leading axes, as run.final and run.records, but is",
    ),
    "records of another size": (
        lambda: fluids.vorticity(fluid(), fluids.start(fluids.euler(3), np.zeros((2, 2)))),
        r"as run.final and run.records, μ with 16 numbers, but μ has shape \(9,\)",
    ),
    "what another fluid carries": (
        lambda: fluids.carried(fluids.boussinesq(4), fluids.start(fluids.euler(3), np.zeros((2, 2)))),
        r"μ with 16 numbers, but μ has shape \(9,\)",
    ),
    "a start without what is carried": (
        lambda: fluids.start(fluids.boussinesq(4), np.zeros((2, 2))),
        r"A buoyant fluid on a sphere carries a function: start it by fluids.carrying_start\(",
    ),
    "no method": (
        lambda: co.simulate(fluid(), fluids.start(fluid(), np.zeros((2, 2))), dt=0.1, steps=1),
        "must be regular, .* along one of 16 numbers, .* or with co.IsospectralMidpoint.. for fluids",
    ),
    "vortices that degrees do not hold": (
        lambda: fluids.vortices(20, [(0, 0)], [1.0], 1e-3),
        "need degrees up to some 4/r = 4e.03, but those up to 20 hold 0.00022 of them",
    ),
    "a start of several rotations": (
        lambda: fluids.start(fluid().replace(rotation=co.each([0.0, 1.0])), np.zeros((2, 2))),
        "has several rotations: take one member",
    ),
    "a rotation that is no number": (
        lambda: fluids.boussinesq(4).replace(rotation=np.ones(3)),
        r"`rotation` must be one number, but has shape \(3,\)",
    ),
    "poses of no pairs": (
        lambda: co.System(co.Power(co.SO3(), 1), lambda xi, a: jnp.sum(xi**2), advected=co.spaces.RelativePoses()),
        r"couples no two links, so that RelativePoses has no pairs: give `pairs`, as \[\(-1, 0\)\]",
    ),
    "coordinates of another size": (
        lambda: fluids.coefficients_of(4, np.zeros(15)),
        r"`momentum` must be finite real numbers, the 16 coordinates on U\(4\) last, but is .*, of shape \(15,\)",
    ),
    "coordinates that are not finite": (
        lambda: fluids.coefficients_of(2, np.full(4, np.nan)),
        "`momentum` must be finite real numbers",
    ),
    "complex coordinates": (lambda: fluids.coefficients_of(2, 1j * np.ones(4)), "must be finite real numbers"),
    "no stirring": (lambda: fluids.DampedMidpoint(stirring=1.0), "`stirring` must be finite numbers c_lm"),
    "vortices by degrees": (
        lambda: fluids.vortices(20, [(0, 180)], [1.0], 0.5),
        "longitudes from −2π to 2π, rad",
    ),
    "vortices larger than the sphere": (
        lambda: fluids.vortices(20, [(0, 0)], [1.0], 1e200),
        r"`radius` must be a finite number up to 3.14159, but is 1e\+200",
    ),
    "a system instead of a run": (lambda: fluids.fields(fluid(), chain()), "`run` must be one run of co.simulate"),
}
VORTICES = {
    "two at one place": (
        lambda: point_vortices.plane_start(
            point_vortices.plane(circulations=[1.0, 2.0, 3.0]), positions=[[0, 1], [2, 3], [2, 3]]
        ),
        "but 2 and 3 are at one place",
    ),
    "too many": (
        lambda: point_vortices.plane(circulations=np.ones(10**6)),
        "A step of point vortices at N = 1000000 would take .* GB of memory",
    ),
}


WRONG = {
    f"{of}: {name}": case
    for of, cases in (("chain", CHAINS), ("group", GROUPS), ("fluid", FLUIDS), ("vortices", VORTICES))
    for name, case in cases.items()
}


@pytest.mark.parametrize(("call", "says"), WRONG.values(), ids=WRONG)
def test_a_wrong_use_is_told_in_a_sentence(call, says):
    with pytest.raises(CoadjointError, match=says) as caught:
        call()
    assert len(str(caught.value)) < 400 and "\n" not in str(caught.value)
