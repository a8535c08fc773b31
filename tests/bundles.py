"""Random connections, motions and kinetic energies on M × G, on which the theorems on bundles are tested."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import coadjoint as co
from coadjoint.difference_maps import DifferenceMap
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.models import hopf
from systems import GROUPS, SEED, system_on

SIZE = 2
"""How many shape coordinates."""


def generator(*names: Any) -> np.random.Generator:
    """Random numbers of a test's own."""
    return np.random.default_rng([SEED, *(sum(map(ord, str(name))) for name in names)])


def difference_map(name: str) -> DifferenceMap:
    """Cayley's map where it fits the group, the exponential elsewhere."""
    try:
        co.Cayley().require_fit(GROUPS[name])
    except co.errors.GroupError:
        return co.Exponential()
    return co.Cayley()


def random_connection(name: str, index: int = 0, scale: float = 0.6) -> co.mechanics.DiscreteConnection:
    """Ω(x, x⁺) = τ(0.6 sin(C(x, x⁺, 1))): far from e also where x⁺ = x."""
    group = GROUPS[name]
    C = generator("connection", name, index).normal(scale=scale, size=(group.dim, 2 * SIZE + 1))

    def increment(x, x_next):
        return difference_map(name).tau(group, 0.6 * jnp.sin(C @ jnp.concatenate([x, x_next, jnp.ones(1)])))

    return co.mechanics.DiscreteConnection(group, SIZE, increment)


def smooth_connection(name: str) -> co.mechanics.Connection:
    """A(x) = sin(Cx + D), a connection with curvature."""
    group, random = GROUPS[name], generator("smooth", name)
    C, D = random.normal(size=(group.dim, SIZE, SIZE)), random.normal(size=(group.dim, SIZE))
    return co.mechanics.Connection(group, SIZE, lambda x: jnp.sin(C @ x + D))


def random_motion(name: str, steps: int, scale: float = 0.5) -> tuple[Any, np.ndarray]:
    """Elements (steps+1) and shapes (steps+1, m) that no equation ties together."""
    group, random = GROUPS[name], generator("motion", name)
    turns = scale * random.normal(size=(steps + 1, group.dim))
    g = evaluate(jax.vmap(lambda turn: difference_map(name).tau(group, turn)), turns)
    return g, scale * random.normal(size=(steps + 1, SIZE))


def random_system(name: str) -> tuple[co.System, co.State]:
    """A Lagrangian that is not quadratic, on M × G, and a start."""
    return system_on(GROUPS[name], co.Trivial(SIZE), None, False, f"bundle {name}")


def kinetic_system(name: str) -> co.System:
    """ℓ = ½ zᵀM(x)z − V(x) with z = (ξ, ẋ)."""
    group, random = GROUPS[name], generator("kinetic", name)
    count = group.dim + SIZE
    A, C = random.normal(size=(count, count)), random.normal(size=(count, SIZE))

    def lagrangian(xi, x, v, p):
        z = jnp.concatenate([xi, v])
        bent = p.A @ z + jnp.sin(p.C @ x) * z
        return 0.5 * bent @ bent / len(z) + z @ z - jnp.cos(x[0]) * jnp.cos(0.5 * x[1])

    return co.System(group, lagrangian, additional=co.Trivial(SIZE), parameters={"A": A, "C": C}, name=f"on {name}")


TURNED = co.spaces.Several({"direction": co.Sphere(co.Trivial(3)), "place": co.Defining()})
"""A curved shape, and a vector that turns."""


def turned_lagrangian(p, xi, x, v, a):
    """ℓ of arrays x = (direction, place) and v, (6,) each, that is not quadratic."""
    z, y = jnp.concatenate([xi, v]), jnp.concatenate([x, a])
    return 0.5 * z @ p["M"] @ z + jnp.sin(p["w"] @ jnp.concatenate([z, y])) + 0.1 * (z @ z) * jnp.cos(p["u"] @ y)


@cache
def turned_system(advected: bool = True, forces: Any = None) -> tuple[co.System, dict[str, np.ndarray]]:
    """A direction, a vector that turns and, if wanted, an advected parameter, on SO(3); and the numbers of its ℓ."""
    random = generator("turned")
    A = random.normal(size=(9, 9))
    numbers = {"M": A @ A.T / 9 + np.eye(9), "w": 0.4 * random.normal(size=18), "u": random.normal(size=9)}
    if not advected:
        numbers |= {"w": 0 * numbers["w"], "u": numbers["u"] * (np.arange(9) < 6)}

    def lagrangian(xi, x, v, *a):
        n, nu = (jnp.concatenate([y.direction, y.place]) for y in (x, v))
        return turned_lagrangian(numbers, xi, n, nu, a[0] if advected else jnp.zeros(3))

    spaces = {"additional": TURNED, "advected": co.Defining()} if advected else {"additional": TURNED}
    function = (lambda xi, x, v, a: lagrangian(xi, x, v, a)) if advected else (lambda xi, x, v: lagrangian(xi, x, v))
    return co.System(co.SO3(), function, **spaces, forces=forces), numbers


def turned_start(advected: bool = True, forces: Any = None) -> co.State:
    """A state of that system."""
    given = {"a0": [0.3, -0.6, 0.7]} if advected else {}
    return turned_system(advected, forces)[0].state(
        q={"direction": [0.6, 0.0, 0.8], "place": [0.3, -0.2, 0.5]},
        qdot={"direction": [0.0, 0.7, 0.0], "place": [0.2, 0.5, -0.4]}, xi=[0.3, 0.5, -0.4], **given,
    )  # fmt: skip


def turned_motion(steps: int) -> tuple[np.ndarray, np.ndarray]:
    """Elements and shapes (steps+1, 6) that no equation ties together."""
    x = np.array([0.6, 0.0, 0.8, 0.3, -0.2, 0.5]) + 0.1 * generator("shapes").normal(size=(steps + 1, 6))
    x[:, :3] /= np.linalg.norm(x[:, :3], axis=1, keepdims=True)
    return random_motion("SO3", steps, scale=0.15)[0], x


def turned_connection(index: int = 0) -> co.mechanics.DiscreteConnection:
    """Ω(x, x⁺) = τ(0.6 sin(C(x, x⁺, 1))) over these shapes."""
    C = generator("turned connection", index).normal(scale=0.6, size=(3, 13))

    def increment(x, x_next):
        return co.Cayley().tau(co.SO3(), 0.6 * jnp.sin(C @ jnp.concatenate([x, x_next, jnp.ones(1)])))

    return co.mechanics.DiscreteConnection(co.SO3(), 6, increment, shapes=TURNED)


def monopole(mass: float, fibre: float, weight: float = 0.0):
    """ℓ of a particle on S² of this mass, in the field of a monopole and its weight, by points of S³ (Kaluza–Klein)."""

    def lagrangian(p, v):
        along = hopf.connection_form(p)[0] @ v * jnp.sqrt(p @ p)
        return 2 * mass * (v @ v - along**2) + 0.5 * fibre * along**2 - weight * hopf.direction(p)[2]

    return lagrangian


SKEW = np.array([[0.5, -0.3], [0.8, 0.2], [-0.4, 0.9]])
"""χ(x) = exp(SKEW x) of `skew_bundle`."""


def skew_bundle() -> co.mechanics.PrincipalBundle:
    """SO(3) × ℝ² → ℝ², points (R, x), by the sections (1, x) for x₀ < 1 and (exp(SKEW x), x) for x₀ > −1."""
    P = co.spaces.Submanifold(
        lambda p: (lambda R: (R.T @ R - jnp.eye(3))[np.triu_indices(3)])(jnp.reshape(p[:9], (3, 3))), Attitudes()
    )

    def section(rates):
        return lambda x: jnp.concatenate([jnp.ravel(co.SO3().exp(jnp.asarray(rates) @ x)), x])

    Section = co.mechanics.Section
    return co.mechanics.PrincipalBundle(
        co.SO3(), P, co.Trivial(2), lambda p: p[9:], lambda p, q: attitude(q) @ attitude(p).T,
        (Section(section(0 * SKEW), lambda x: 1 - x[0]), Section(section(SKEW), lambda x: 1 + x[0])),
    )  # fmt: skip


@dataclass(frozen=True)
class Attitudes(co.spaces.Representation):
    """Matrices R and two numbers x, (11,): g·(R, x) = (gR, x)."""

    def ambient(self, group: Any) -> int:
        return 11

    def act(self, group: Any, g: Any, x: Any) -> Any:
        return jnp.concatenate([jnp.ravel(g @ attitude(x)), x[9:]])


def attitude(p: Any) -> Any:
    return jnp.reshape(p[:9], (3, 3))


def skew_connection():
    """𝒜(p)v = (ṘRᵀ)ᵛ + R A(x)ẋ and 𝒜(p, p⁺) = R⁺Ω(x, x⁺)⁻¹Rᵀ of `skew_bundle`."""

    def smooth(p):
        R, x = attitude(p), p[9:]
        A = jnp.stack([jnp.stack([0.3 * x[1], 0 * x[0]]), jnp.array([0.0, 0.2]), jnp.stack([0 * x[0], jnp.sin(x[0])])])

        def along(v):
            W = attitude(v) @ R.T
            return 0.5 * co.SO3().vee(W - W.T) + R @ A @ v[9:]

        return jax.vmap(along)(jnp.eye(11)).T

    def discrete(p, q):
        x = jnp.append(p[9:], 0.5)
        return attitude(q) @ co.SO3().exp(0.3 * (q[9] - p[9]) * x).T @ attitude(p).T

    return smooth, discrete


def skew_lagrangian(p, v):
    """½tr(ṘᵀṘ D) coupled with ẋ, of (R, x): invariant under R ↦ gR, and not under R ↦ Rg."""
    R, S = attitude(p), attitude(v)
    D = jnp.diag(jnp.array([1.0, 2.0, 3.0])) + 0.3 * p[9] * jnp.ones((3, 3))
    return 0.5 * jnp.trace(S @ D @ S.T) + v[9:] @ v[9:] + 0.4 * (R.T @ S)[0, 1] * v[10] - jnp.cos(p[10])


def largest(tree: Any) -> float:
    """The largest entry in size of a PyTree."""
    return max(float(np.max(np.abs(leaf), initial=0.0)) for leaf in jax.tree.leaves(tree))


def apart(left: Any, right: Any) -> float:
    """The largest difference of two PyTrees."""
    return largest(jax.tree.map(lambda a, b: np.asarray(a) - np.asarray(b), left, right))
