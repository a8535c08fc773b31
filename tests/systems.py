"""Random systems with symmetry on which the theorems are tested, over many groups and spaces.

A random Lagrangian couples ξ, n, ν and a beyond quadratic terms and is regular for all velocities:

    ℓ = ½ zᵀMz + 1/20 (r·z)⁴ + Σ_i c_i sin(w_i·(z, y)) + 1/10 |z|² cos(u·y),   z = (ξ, ν), y = (n, a),

with M ≥ 2 and the Hessian of the last two sums in z under 1.7. Any function of body variables is left-invariant.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import coadjoint as co
from coadjoint.difference_maps import DifferenceMap
from coadjoint.groups import LieGroup
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.spaces import Several, Space

SEED = 20260117


def _skew_basis(size: int) -> list[np.ndarray]:
    basis = []
    for i in range(size):
        for j in range(i):
            e = np.zeros((size, size))
            e[i, j], e[j, i] = 1.0, -1.0
            basis.append(e)
    return basis


def _unit_determinant(g):
    return jnp.linalg.det(g) - 1


def _orthogonal(g):
    return g.T @ g - jnp.eye(g.shape[0])


def _unit_upper_triangular(g):
    return jnp.concatenate([g[jnp.tril_indices(3, -1)], jnp.diag(g) - 1])


SL2 = co.MatrixGroup([[[1, 0], [0, -1]], [[0, 1], [0, 0]], [[0, 0], [1, 0]]], _unit_determinant, name="SL2")
HEISENBERG = co.MatrixGroup(
    [
        [[0, 1, 0], [0, 0, 0], [0, 0, 0]],
        [[0, 0, 0], [0, 0, 1], [0, 0, 0]],
        [[0, 0, 1], [0, 0, 0], [0, 0, 0]],
    ],
    _unit_upper_triangular,
    name="Heisenberg",
)
SO4 = co.MatrixGroup(_skew_basis(4), _orthogonal, name="SO4")

GROUPS: dict[str, LieGroup] = {
    "SO2": co.SO2(),
    "SO3": co.SO3(),
    "SE2": co.SE2(),
    "SE3": co.SE3(),
    "R3": co.Translation(3),
    "SO3xSE2": co.DirectProduct(co.SO3(), co.SE2()),
    "SL2": SL2,
    "Heisenberg": HEISENBERG,
    "SO4": SO4,
    "quaternions": co.groups.UnitQuaternion(),
    "SU2": co.groups.SU2(),
    "SOn4": co.SOn(4),
    "SLn3": co.groups.SLn(3),
    "GLn2": co.groups.GLn(2),
    "Un2": co.Un(2),
    "SUn3": co.SUn(3),
    "Sp1": co.groups.Sp(1),
    "Sp2": co.groups.Sp(2),
    "H2": co.groups.Heisenberg(2),
    "opposite": co.groups.Opposite(co.SE2()),
    "SO3_R3": co.SemidirectProduct(co.SO3(), co.Defining()),
    "SL2_dual": co.SemidirectProduct(SL2, co.spaces.Dual()),
    "nested": co.DirectProduct(
        co.SemidirectProduct(co.SemidirectProduct(co.SO2(), co.Defining()), co.spaces.Adjoint()), co.Translation(1)
    ),
}


@dataclass(frozen=True)
class Bent(DifferenceMap):
    """τ(ξ) = cay((1 + |ξ|²/10) ξ): a difference map that gives nothing but τ, so that all else is derived."""

    def _tau(self, group: LieGroup, xi):
        return co.Cayley().tau(group, (1 + 0.1 * (xi @ xi)) * xi)


MAPS: dict[str, DifferenceMap] = {
    "cayley": co.Cayley(),
    "exponential": co.Exponential(),
    "squared": co.difference_maps.Squared(co.Cayley()),
    "bent": Bent(),
    "pade": co.difference_maps.Pade(2),
    "second kind": co.difference_maps.SecondKind(),
}

RULES: dict[str, Any] = {
    "left": co.LeftRectangle,
    "right": co.RightRectangle,
    "midpoint": co.Midpoint,
    "trapezoidal": co.Trapezoidal,
    "pair": co.methods.LeftRight,
}

ALL_RULES: dict[str, Any] = {**RULES, "simpson": co.Simpson}
"""With the rules that are not crossed with everything."""


@dataclass(frozen=True)
class World:
    """A group with the spaces it acts on."""

    group: LieGroup
    additional: Any = None
    advected: Any = None


def _frame(x):
    return jnp.stack([x.e @ x.e - 1, x.f @ x.f - 1, x.e @ x.f])


FRAMES = co.spaces.Submanifold(_frame, co.spaces.Several({"e": co.Defining(), "f": co.Defining()}))
"""Pairs of orthonormal vectors: a Stiefel manifold."""


def moebius(g, z):
    """z = x + iy ↦ (az + b)/(cz + d)."""
    (a, b), (c, d) = g
    x, y = z
    size = (c * x + d) ** 2 + (c * y) ** 2
    return jnp.stack([(a * x + b) * (c * x + d) + a * c * y**2, y]) / size


HALF_PLANE = co.spaces.Action(moebius, dim=2, domain=lambda z: z[1])
"""The upper half plane, on which SL(2) acts by Möbius maps."""

WORLDS: dict[str, World] = {
    "SO3 alone": World(co.SO3()),
    "SO3": World(co.SO3(), co.Defining(), {"down": co.Defining(), "spin": co.spaces.Adjoint()}),
    "SE3": World(
        co.SE3(),
        {"buoy": co.spaces.Points(), "fill": co.Trivial(1)},
        {"plane": co.spaces.Dual(), "field": co.Coadjoint()},
    ),
    "SE2": World(co.SE2(), co.spaces.Points(), {"twist": co.spaces.Adjoint(), "row": co.Defining()}),
    "SL2": World(SL2, co.Defining(), co.spaces.Dual()),
    "Heisenberg": World(HEISENBERG, co.Coadjoint(), co.spaces.Adjoint()),
    "SO4": World(SO4, None, co.Defining()),
    "SO2": World(co.SO2(), co.Trivial(2), None),
    "R3": World(co.Translation(3), co.Trivial(1), co.spaces.Dual()),
    "SO3xSE2": World(GROUPS["SO3xSE2"], co.Defining(), co.Coadjoint()),
    "SO3 on a sphere": World(co.SO3(), co.Sphere(), co.Defining()),
    "SL2_dual": World(GROUPS["SL2_dual"], co.spaces.Points(), co.spaces.Dual()),
    "curved and flat": World(
        co.SO3(),
        {"frame": FRAMES, "shape": co.Trivial(1)},
        {"down": co.Sphere(), "spin": co.spaces.Adjoint()},
    ),
}


LARGE = {"SL2_dual": ("cayley", "right"), "curved and flat": ("cayley", "midpoint")}
"""Worlds whose steps take long to trace, with the one map and rule that short runs of the tests take."""


def pairwise_cases() -> list[tuple[str, str, str]]:
    """(world, map, rule) such that every two of them meet: each world with each rule, the maps in turn."""
    maps, worlds = list(MAPS), [world for world in WORLDS if world not in LARGE]
    every = [(world, maps[(i + j) % len(maps)], rule) for i, world in enumerate(worlds) for j, rule in enumerate(RULES)]
    return every + [(world, *case) for world, case in LARGE.items()]


def all_cases() -> list[tuple[str, str, str]]:
    """Every (world, map, rule)."""
    return [(world, tau, rule) for world in WORLDS for tau in MAPS for rule in RULES]


def generator(*words: object) -> np.random.Generator:
    """A random generator of its own for every purpose, from SEED and words."""
    return np.random.default_rng([SEED, zlib.crc32(repr(words).encode())])


def flat(value: Any) -> Any:
    """A point as one array, whether it came as an array, as an element or by names."""
    return jnp.concatenate([jnp.ravel(leaf) for leaf in jax.tree.leaves(value)])


def element(group: LieGroup, random: np.random.Generator, scale: float = 0.7) -> Any:
    """A random group element."""
    eta, chi = random.normal(scale=scale, size=(2, group.dim))
    return evaluate(lambda eta, chi: group.compose(group.exp(eta), group.exp(chi)), eta, chi)


def point(space: Space, group: LieGroup, random: np.random.Generator) -> Any:
    """A random point of a space as a user would give it."""
    if isinstance(space, Several):
        return {name: point(s, group, random) for name, s in zip(space.names, space.factors, strict=True)}
    x = random.normal(size=space.ambient(group))
    if isinstance(space, co.spaces.GroupItself):
        return element(group, random)
    if isinstance(space, co.spaces.Action):
        return space.sample(group, random)
    if isinstance(space, co.spaces.Submanifold):
        found = evaluate(lambda x: space.view(group, _nearest(space, group, x)), x)
        return found if isinstance(found, np.ndarray) else found.asdict()
    return x if space.flat else x / np.linalg.norm(x)


def _nearest(space: co.spaces.Submanifold, group: LieGroup, x):
    """The point of Q that Gauss–Newton leads to."""
    for _ in range(30):
        rows = space.normals(group, x)
        x = x - rows.T @ jnp.linalg.solve(rows @ rows.T, space.equations(group, x))
    return x


def velocity(space: Space, group: LieGroup, at: Any, random: np.random.Generator) -> Any:
    """A random tangent vector at a point, likewise."""
    if isinstance(space, Several):
        return {n: velocity(s, group, at[n], random) for n, s in zip(space.names, space.factors, strict=True)}
    v = 0.7 * random.normal(size=space.ambient(group))
    x = space.point(group, at, "at")
    found = evaluate(lambda x, v: space.view(group, space.tangent(group, x, space.coordinates(group, x, v))), x, v)
    return found.asdict() if hasattr(found, "asdict") else found


@lru_cache(maxsize=256)
def random_system(world: str, forced: bool = False) -> tuple[co.System, co.State]:
    """A random system and start; forced, with dissipation and forces of ξ, n, ν, a, t, and ℓ depending on t."""
    setting = WORLDS[world]
    return system_on(setting.group, setting.additional, setting.advected, forced, world)


def system_on(group, additional, advected, forced: bool, name: str) -> tuple[co.System, co.State]:
    """The random system of these spaces, and a random start."""
    random = generator("system", name, forced)
    bare = co.System(group, lambda *_: 0.0, additional=additional, advected=advected)
    Q, V = bare.additional, bare.advected
    velocities, places = group.dim + Q.ambient(group), Q.ambient(group) + V.ambient(group)
    system = co.System(
        group,
        _lagrangian(Q.ambient(group) > 0, V.ambient(group) > 0, forced),
        additional=additional,
        advected=advected,
        parameters=_parameters(velocities, places, group.dim, random),
        forces=_forces(group.dim) if forced else None,
    )
    q = point(Q, group, random) if Q.ambient(group) else None
    start = system.state(
        g=element(group, random),
        q=q,
        qdot=velocity(Q, group, q, random) if Q.ambient(group) else None,
        xi=0.7 * random.normal(size=group.dim),
        a0=point(V, group, random) if V.ambient(group) else None,
        t=0.3,
    )
    return system, start


def _parameters(velocities: int, places: int, dim: int, random: np.random.Generator) -> Mapping[str, Any]:
    A = random.normal(size=(velocities, velocities))
    w = random.normal(size=(4, velocities + places))
    w /= np.linalg.norm(w, axis=1, keepdims=True)
    r = random.normal(size=velocities)
    u = random.normal(size=places)
    every = velocities + places
    return {
        "M": 2 * np.eye(velocities) + A @ A.T / velocities,
        "w": w * [[0.7], [1.0], [0.5], [0.8]],
        "c": [0.6, -0.5, 0.8, 0.4],
        "r": r / np.linalg.norm(r),
        "u": u / max(np.linalg.norm(u), 1.0),
        "drag": np.diag(random.uniform(0.1, 0.4, size=velocities)),
        "push": 0.3 * random.normal(size=(velocities, 2)),
        "feel": random.normal(size=(2, every)) / np.sqrt(every),
    }


def _lagrangian(has_q: bool, has_a: bool, timed: bool):
    """ℓ of the module's docstring; with t, one more term sin t · c₀ (r·z)."""

    def lagrangian(xi, *rest, t):
        p = rest[-1]
        n, nu = rest[:2] if has_q else (jnp.zeros(0), jnp.zeros(0))
        a = rest[-2] if has_a else jnp.zeros(0)
        z, y = jnp.concatenate([xi, flat(nu)]), jnp.concatenate([flat(n), flat(a)])
        coupled = p.c @ jnp.sin(p.w @ jnp.concatenate([z, y])) + 0.1 * (z @ z) * jnp.cos(p.u @ y)
        driven = jnp.sin(t) * (p.r @ z) if timed else 0.0
        return 0.5 * z @ p.M @ z + 0.05 * (p.r @ z) ** 4 + coupled + driven

    return lagrangian


def _forces(dim: int):
    """(T, f) = −drag z + push sin(feel (z, y) + t)."""

    def forces(motion, p):
        z = jnp.concatenate([motion.xi, flat(motion.nu)])
        y = jnp.concatenate([flat(motion.n), flat(motion.a)])
        total = -p.drag @ z + p.push @ jnp.sin(p.feel @ jnp.concatenate([z, y]) + motion.t)
        return co.Force(torque=total[:dim], force=total[dim:])

    return forces
