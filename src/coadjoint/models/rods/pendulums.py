"""Chains of rigid bodies on ball joints: pendulums on SO(3)ᴺ, and of points on massless rods on (S²)ᴺ."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.errors import ArgumentError
from coadjoint.groups import SO3, Power, Translation
from coadjoint.mechanics.members import Quantity
from coadjoint.mechanics.parameters import Parameters
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.models.quantities import checked, direction, not_negative
from coadjoint.models.rods.strains import rotation_vector
from coadjoint.spaces import Defining, RelativePoses, Sphere, Trivial
from coadjoint.spaces.relative_poses import GROUND

UNITS = {"xi": "rad/s", "xi_spatial": "rad/s", "mu": "kg m²/s", "a": "1", "energy": "J", "discrete_energy": "J"}
POINTS = {**UNITS, "n": "1", "nu": "1/s", "q": "1", "qdot": "1/s", "pi": "kg m²/s"}


def pendulums(
    *,
    links: object,
    length: Quantity,
    mass: Quantity,
    inertia: Quantity,
    center: Quantity | None = None,
    stiffness: Quantity = 0.0,
    gravity: Quantity = 9.81,
) -> System:
    """N rigid bodies on ball joints, the first hung from a fixed point, on SO(3)ᴺ with the constraints in ℓ.

        ℓ = ½ Σ_i m_i |v_i|² + ½ Σ_i ω_i·J_iω_i + Σ_i m_i g x_i·d − ½ k Σ_i |log R_{i−1}ᵀR_i|²,
        v_i = Σ_{j<i} l_j R_j(ω_j × e₁) + c_i R_i(ω_i × e₁)

    The joints of a link lie on its first axis. All links are coupled by their masses, so that a step costs N³. With
    k = EI/l a chain is a rod that does not stretch or shear at all; the spring of the first link turns it to the space
    frame (a clamped end), and all others to the link before.

    links: N. length: from joint to joint, m, one number or (N,). mass: of a link, kg, likewise. inertia: about its mass
    centre, (3,) or (N, 3), kg m²; that about the first axis must be positive. center: c, of the mass centre from the
    joint that it hangs from, m, by default in the middle. stiffness: k, N m. gravity: g, m/s².
    Parameters: length, mass, inertia, center, stiffness, gravity. Raises ArgumentError for what no body can have.
    """
    links = checks.whole(links, "links")
    rules = _checks(links, 3)
    given = {"length": length, "mass": mass, "inertia": inertia, "stiffness": stiffness, "gravity": gravity}
    center = 0.5 * np.asarray(rules["length"](length, "length")) if center is None else center
    pairs = tuple((GROUND, i) for i in range(links))

    def lagrangian(xi, a, p):
        R = a.frame
        turning = jnp.stack([jnp.zeros_like(xi[:, 0]), xi[:, 2], -xi[:, 1]], axis=1)  # ω × e₁
        w = jnp.einsum("nij,nj->ni", R, turning)
        kinetic = 0.5 * jnp.sum(p.inertia * xi**2) + _kinetic(w, p)
        bent = jnp.einsum("nji,njk->nik", jnp.concatenate([jnp.eye(3)[None], R[:-1]]), R)
        springs = 0.5 * p.stiffness * jnp.sum(rotation_vector(bent) ** 2)
        return kinetic - springs + _heights(a.down[:, 0], p)

    return System(
        Power(SO3(), links, "all"),
        lagrangian,
        advected={"frame": RelativePoses(pairs), "down": Defining()},
        parameters=Parameters(**checked(rules, {**given, "center": center})),
        checks=partial(checked, rules),
        units=UNITS,
        name="chain of pendulums",
    )


def pendulums_start(
    chain: System,
    *,
    rotation: Quantity | None = None,
    angular_velocity: Quantity = (0.0, 0.0, 0.0),
    down: Quantity = (1.0, 0.0, 0.0),
) -> State:
    """The state of a chain of `pendulums`, by default hanging at rest along the first axis of space, which points down.

    rotation: R of all links or of each, (3, 3) or (N, 3, 3), by default the identity. angular_velocity: in the links'
    frames, (3,) or (N, 3), rad/s. down: the direction of gravity, (3,). Raises ArgumentError for other shapes.
    """
    N = getattr(chain.group, "count", 0)
    R = np.eye(3) if rotation is None else checks.array(rotation, "rotation", (3, 3), (N, 3, 3))
    omega = checks.array(angular_velocity, "angular_velocity", (3,), (N, 3))
    g = np.broadcast_to(R, (N, 3, 3)).copy()
    a0 = {"frame": None, "down": direction(down, "down")}
    return chain.state(g=g, xi=np.broadcast_to(omega, (N, 3)).copy(), a0=a0)


def points(*, links: object, length: Quantity, mass: Quantity, gravity: Quantity = 9.81) -> System:
    """N points on massless rods, one hung from the other, on (S²)ᴺ: q_i is the direction of rod i.

        ℓ = ½ Σ_i m_i |Σ_{j≤i} l_j ν_j|² − Σ_i m_i g e_z·x_i,   x_i = Σ_{j≤i} l_j n_j

    There is no group, so n = q; gravity points along −z. All are coupled by their masses.

    links: N. length: of a rod, m, one number or (N,). mass: of a point, kg, likewise. gravity: g, m/s².
    Parameters: length, mass, gravity. Raises ArgumentError for what no chain can have.
    """
    links = checks.whole(links, "links")
    rules = _checks(links, 0)
    values = checked(rules, {"length": length, "mass": mass, "gravity": gravity})

    def lagrangian(xi, n, nu, p):
        places, moving = (jnp.cumsum(p.length[:, None] * one, axis=0) for one in (n, nu))
        return 0.5 * jnp.sum(p.mass[:, None] * moving**2) - p.gravity * p.mass @ places[:, 2]

    return System(
        Power(Translation(0), links, "all"),
        lagrangian,
        additional=Sphere(Trivial(3)),
        parameters=Parameters(**values),
        checks=partial(checked, rules),
        units=POINTS,
        name="chain of points",
    )


def points_start(chain: System, *, directions: object = (0.0, 0.0, -1.0), rates: object = (0.0, 0.0, 0.0)) -> State:
    """The state of a chain of `points`, by default hanging at rest.

    directions: q_i ∈ S² of the rods, (3,) or (N, 3). rates: q̇_i, tangent to the sphere, (3,) or (N, 3), 1/s.
    Raises ArgumentError for other shapes.
    """
    N = getattr(chain.group, "count", 0)
    found = []
    for name, value in (("directions", directions), ("rates", rates)):
        given = checks.array(value, name, (3,), (N, 3))
        found.append(np.broadcast_to(given, (N, 3)).copy())
    return chain.state(q=found[0], qdot=found[1])


def _kinetic(w: Array, p: PyTree) -> Scalar:
    """½ Σ m |v|² of mass centres, of the rates w (N, 3) of the links' directions."""
    reached = jnp.cumsum(p.length[:, None] * w, axis=0) - p.length[:, None] * w
    v = reached + p.center[:, None] * w
    return 0.5 * jnp.sum(p.mass[:, None] * v**2)


def _heights(along: object, p: PyTree) -> Array:
    """Σ m g x·d, of d·R e₁ (N,) of the links."""
    reached = jnp.cumsum(p.length * along) - p.length * along
    return p.gravity * p.mass @ (reached + p.center * along)


def _checks(count: int, axes: int) -> dict[str, Callable[[PyTree, str], PyTree]]:
    def each(shape: tuple[int, ...], least: float) -> Callable[[PyTree, str], PyTree]:
        def check(value: object, name: str) -> PyTree:
            found = checks.array(value, name, shape, (count, *shape))
            low = np.min(found)
            if low < 0 or (least and low <= 0):
                raise ArgumentError(f"Argument `{name}` must be positive, but is {low:g}.")
            return np.broadcast_to(found, (count, *shape)).copy()

        return check

    common = {"length": each((), 1.0), "mass": each((), 1.0), "gravity": not_negative}
    return {**common, "inertia": each((axes,), 0.0), "center": each((), 0.0), "stiffness": not_negative}
