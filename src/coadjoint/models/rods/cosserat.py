"""Geometrically exact rods that bend, twist, shear and stretch: Cosserat rods on SE(3)ᴺ and SE(2)ᴺ."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, PyTree
from coadjoint.checks import array, float64
from coadjoint.errors import ArgumentError
from coadjoint.kernels.float64 import float64 as float64_scope
from coadjoint.kernels.trace.evaluate import evaluate, traced
from coadjoint.mechanics.members import Quantity
from coadjoint.mechanics.parameters import Parameters
from coadjoint.mechanics.state import Force
from coadjoint.mechanics.system import System
from coadjoint.memory import most_that_fit, require_room
from coadjoint.models.quantities import checked, not_negative, number, positive, positive_pair, vector
from coadjoint.models.rods.sections import RodLayout
from coadjoint.models.rods.strains import logarithm, straight
from coadjoint.spaces import Dual, RelativePoses
from coadjoint.spaces.relative_poses import GROUND

STIFF = 1e6
"""EA and GA where they are left out, in units of EI/L²: a penalty for stretch and shear, which stay below 1e-5 under
loads up to that of buckling."""

SEEN = (0.1, 1.0, 10.0)
"""s, when it is looked whether a motion is one of poses."""
ROUND_OFF = 1e-6
"""How far a motion may be from a pose, also where it is computed in float32."""

OF_AN_ELEMENT = {False: 2.0e5, True: 2.5e4}
"""Bytes that a step holds, at least, for each element in space and in a plane: 234 and 30 kB were measured."""

UNITS = {
    "xi": "rad/s, m/s",
    "xi_spatial": "rad/s, m/s",
    "mu": "kg m²/s, kg m/s",
    "a": "1, m",
    "x": "m",
    "energy": "J",
    "discrete_energy": "J",
}
"""The components of a section share an array, the angular ones first."""


def cosserat(
    *,
    elements: PyTree,
    length: Quantity,
    EI: object,
    GJ: object,
    mass: Quantity,
    inertia: Quantity,
    EA: object = None,
    GA: object = None,
    rest_curvature: object = (0.0, 0.0, 0.0),
    ends: str = "free",
    gravity: Quantity = 0.0,
    load: object = None,
    moment: object = None,
    motion: Callable[[PyTree], PyTree] | None = None,
) -> System:
    """A Cosserat rod of M elements between rigid sections, on SE(3)ᴺ with the relative poses of sections advected.

        ℓ(ξ, a) = ½ Σ_i s_i ξ_i·𝕄ξ_i − ½ Σ_e l_e (ε_e − ε⁰_e)·ℂ(ε_e − ε⁰_e) + Σ_i s_i m g x_i·d + F·x_N

    ε_e = (κ, γ) = log(g_i⁻¹g_j)/l_e is the strain of the element from section i to j: curvature with the twist first,
    rad/m, and stretch with the two shears; it is constant along an element, so that a rod under an end couple is a
    circle at any M. ℂ = diag(GJ, EI₂, EI₃, EA, GA₂, GA₃), 𝕄 = diag(inertia, m, m, m), s_i half the length of the
    elements adjacent to a section. The first axis of a section is the rod's tangent. Errors fall as 1/M².

    elements: M. length: of the rod, m, or of each element, (M,). EI: bending stiffness, N m², about the second and the
    third axis, or one number. GJ: of torsion, N m². EA, GA: of stretch and shear, N, GA one number or two; left out,
    they are 1e6 EI/L² with the larger EI: a rod that hardly stretches and shears, by penalty. mass: per length, kg/m.
    inertia: ρJ, ρI₂, ρI₃, of a section about its axes per length, (3,), kg m. rest_curvature: κ without load, (3,), or
    (M, 3) by elements, rad/m. ends: "free"; "clamped", the first; "both clamped"; "ring", the last joined to the first.
    gravity: g, m/s², along `down` of `start`. load: a force F in space at the last section, (3,), N. moment: a couple
    there about its own axes, (3,), N m; it turns with the section and has no energy. motion: t ↦ (R, x), the pose of
    the clamped first end relative to the start, (1, 0) at t = 0, in jax.numpy: a driven end.

    Parameters: length, EI, GJ, EA, GA, mass, inertia, rest_curvature [, gravity] [, load] [, moment].
    Raises ArgumentError for what no rod can have. Source: Simo, Comput. Methods Appl. Mech. Eng. 49 (1985);
    Sonneville, Cardona and Brüls, ibid. 268 (2014), for the helicoidal element.
    """
    given = {"EI": EI, "GJ": GJ, "EA": EA, "GA": GA, "mass": mass, "inertia": inertia}
    return _rod(RodLayout(elements, ends), length, given, rest_curvature, (gravity, load, moment, motion))


def planar(
    *,
    elements: PyTree,
    length: Quantity,
    EI: object,
    mass: Quantity,
    inertia: Quantity,
    EA: object = None,
    GA: object = None,
    rest_curvature: object = 0.0,
    ends: str = "free",
    gravity: Quantity = 0.0,
    load: object = None,
    moment: object = None,
    motion: Callable[[PyTree], PyTree] | None = None,
) -> System:
    """The rod of `cosserat` in a plane, on SE(2)ᴺ: ε = (κ, γ₁, γ₂), ℂ = diag(EI, EA, GA), 𝕄 = diag(inertia, m, m).

    elements: M. length: of the rod, m, or of each element, (M,). EI: bending stiffness, N m². EA, GA: of stretch and
    shear, N; left out, 1e6 EI/L² as a penalty. mass: per length, kg/m. inertia: ρI per length, kg m. rest_curvature:
    one number or (M,), rad/m. ends: as of `cosserat`. gravity: g, m/s². load: a force at the last section, (2,), N.
    moment: a couple there, one number, N m. motion: t ↦ (R, x) of the clamped first end, (2, 2) and (2,).
    Raises ArgumentError for what no rod can have.
    """
    given = {"EI": EI, "EA": EA, "GA": GA, "mass": mass, "inertia": inertia}
    return _rod(RodLayout(elements, ends, True), length, given, rest_curvature, (gravity, load, moment, motion))


def stiffness(p: PyTree) -> Array:
    """The diagonal of ℂ, (6,) or in the plane (3,), of the parameters of a rod; N m² and N."""
    turning = [jnp.reshape(p.GJ, 1), p.EI] if hasattr(p, "GJ") else [jnp.reshape(p.EI, 1)]
    return jnp.concatenate([*turning, jnp.reshape(p.EA, 1), jnp.reshape(p.GA, -1)])


def inertia_per_length(p: PyTree) -> Array:
    """The diagonal of 𝕄, (6,) or in the plane (3,), of the parameters of a rod; kg m and kg/m."""
    turning = jnp.reshape(p.inertia, -1)
    return jnp.concatenate([turning, jnp.broadcast_to(p.mass, 3 if turning.shape[0] == 3 else 2)])


def strains(layout: RodLayout, poses: PyTree, p: PyTree, end: PyTree = None) -> Array:
    """ε, shape (M, d), of relative poses of the elements; `end`: the pose to which a driven end has moved."""
    R, x = poses
    if end is not None:
        A, y = end
        R = jnp.concatenate([(A.T @ R[0])[None], R[1:]])
        x = jnp.concatenate([(A.T @ (x[0] - y))[None], x[1:]])
    return logarithm((R, x)) / p.length[:, None]


def elastic_energy(layout: RodLayout, poses: object, p: PyTree, end: PyTree = None) -> Array:
    """½ Σ l (ε − ε⁰)·ℂ(ε − ε⁰), J, one number."""
    curvature = jnp.reshape(p.rest_curvature, (len(p.length), -1))
    tangent = straight(layout.planar)[curvature.shape[1] :]
    rest = jnp.concatenate([curvature, jnp.broadcast_to(tangent, (len(curvature), len(tangent)))], axis=1)
    strain = strains(layout, poses, p, end) - rest
    return 0.5 * jnp.sum(p.length[:, None] * stiffness(p) * strain**2)


def _rod(
    layout: RodLayout, length: Quantity, given: dict[str, PyTree], rest: PyTree, outside: tuple[PyTree, ...]
) -> System:
    gravity, load, moment, motion = outside
    needed = OF_AN_ELEMENT[layout.planar] * layout.elements
    fits = most_that_fit(layout.elements, needed, 1)
    require_room(f"A rod of {layout.elements} elements", needed, f"take up to {fits} elements")
    checks = _checks(layout)
    size = 2 if layout.planar else 3
    lengths = checks["length"](length, "length")
    bending = checked({"EI": checks["EI"]}, {"EI": given["EI"]})["EI"]
    stiff = STIFF * np.max(bending) / np.sum(lengths) ** 2
    values = {"length": lengths, **given, "rest_curvature": rest}
    values |= {name: stiff for name in ("EA", "GA") if given[name] is None}
    acting = {"gravity": gravity if gravity != 0 else None, "load": load, "moment": moment}
    values |= {name: value for name, value in acting.items() if value is not None}
    _require_end(layout, load, moment, motion)
    spaces = {"joint": RelativePoses(layout.pairs)}
    spaces |= {"down": Dual()} if "gravity" in values else {}
    spaces |= {"tip": RelativePoses(((GROUND, layout.sections - 1),))} if load is not None else {}

    def lagrangian(xi, a, p, *, t):
        shares = layout.shares(p.length)
        energy = 0.5 * jnp.sum(shares[:, None] * inertia_per_length(p) * xi**2)
        energy -= elastic_energy(layout, a.joint, p, None if motion is None else motion(t))
        if hasattr(p, "gravity"):
            energy += p.mass * p.gravity * shares @ a.down[:, size]
        return energy + p.load @ a.tip[1][0] if hasattr(p, "load") else energy

    def end_couple(motion, p):
        turning = motion.xi.shape[1] - size
        return Force(torque=jnp.zeros_like(motion.xi).at[-1, :turning].set(p.moment))

    return System(
        layout.group,
        lagrangian if motion is not None else lambda xi, a, p: lagrangian(xi, a, p, t=0.0),
        advected=spaces,
        parameters=Parameters(**checked(checks, values)),
        forces={"moment": end_couple} if moment is not None else None,
        checks=partial(checked, checks),
        units=UNITS,
        name="planar rod" if layout.planar else "Cosserat rod",
    )


def _checks(layout: RodLayout) -> dict[str, Callable[[PyTree, str], PyTree]]:
    """What each parameter of a rod is kept as, or ArgumentError, by name."""
    three = not layout.planar

    def lengths(value: object, name: str) -> Array:
        found = float64(value, f"Argument `{name}`")
        if np.shape(found) == ():
            return np.full(layout.elements, positive(found, name) / layout.elements)
        for one in vector(found, name, layout.elements):
            positive(one, name)
        return found

    def pair(value: object, name: str) -> Array:
        found = float64(value, f"Argument `{name}`")
        both = jnp.broadcast_to if traced(found) else np.broadcast_to
        return positive_pair(both(found, 2) if np.shape(found) == () else found, name)

    def bodies(value: object, name: str) -> Array:
        for one in vector(value, name):
            positive(one, name)
        return float64(value, name)

    def curvature(value: object, name: str) -> Array:
        one, all_ = ((3,), (layout.elements, 3)) if three else ((), (layout.elements,))
        found = array(value, name, one, all_)
        return jnp.broadcast_to(found, all_) if traced(found) else np.broadcast_to(found, all_)

    size = 3 if three else 2
    scalars = dict.fromkeys(("EA", "mass", "GJ") if three else ("EA", "mass", "EI", "GA", "inertia"), positive)
    others = {"EI": pair, "GA": pair, "inertia": bodies} if three else {}
    acting = {
        "gravity": not_negative,
        "load": lambda value, name: vector(value, name, size),
        "moment": (lambda value, name: vector(value, name)) if three else number,
    }
    return {**scalars, **others, **acting, "length": lengths, "rest_curvature": curvature}


def _require_end(layout: RodLayout, load: object, moment: object, motion: PyTree) -> None:
    if layout.ends in ("both clamped", "ring") and (load is not None or moment is not None):
        raise ArgumentError(f"A rod with ends {layout.ends!r} has no free end for a `load` or a `moment`.")
    if motion is None:
        return
    if layout.ends not in ("clamped", "both clamped"):
        raise ArgumentError(f"Argument `motion` moves a clamped first end, but this rod has ends {layout.ends!r}.")
    size, found, why = 2 if layout.planar else 3, None, ""
    try:
        with float64_scope():
            pose = jax.eval_shape(motion, 0.0)
        parts = pose if isinstance(pose, (tuple, list)) else (pose,)
        found = [getattr(part, "shape", type(part).__name__) for part in parts]
    except jax.errors.TracerArrayConversionError:
        why = "but uses NumPy on t"
    except Exception as error:
        why = f"but ends in {type(error).__name__}: {error}".splitlines()[0].rstrip(".")
    if found != [(size, size), (size,)]:
        raise ArgumentError(
            "Argument `motion` must be a function of the time t, in jax.numpy, to a pose (R, x) of shapes "
            f"({size}, {size}) and ({size},), {why or f'but has shapes {found}'}."
        )
    _require_pose(motion, size)


def _require_pose(motion: Callable[[PyTree], PyTree], size: int) -> None:
    """Raise ArgumentError where a motion does not begin at (1, 0), or is seen to leave the rotations."""
    try:
        R, x = map(np.asarray, evaluate(motion, 0.0))
    except jax.errors.TracerArrayConversionError:  # it holds a number that JAX traces, which a run refuses
        return
    if not (np.all(np.isfinite(R)) and np.all(np.isfinite(x))):
        raise ArgumentError(f"Argument `motion` must be finite, but at t = 0 R is {R.tolist()} and x {x.tolist()}.")
    if not max(np.max(np.abs(R - np.eye(size))), np.max(np.abs(x))) <= ROUND_OFF:
        raise ArgumentError(
            "Argument `motion` must be (1, 0) at t = 0, because it is relative to the pose of the end at the start, "
            "but there R "
            f"is {R.tolist()} and x {x.tolist()}: give R(0)ᵀR and R(0)ᵀ(x − x(0))."
        )
    for t in SEEN:
        R = np.asarray(evaluate(motion, t)[0])
        if not np.all(np.isfinite(R)):  # a motion may end with the run, which checks its own times
            continue
        if np.max(np.abs(R @ R.T - np.eye(size))) > ROUND_OFF or np.linalg.det(R) < 0:
            raise ArgumentError(f"The R of `motion` must be a rotation, but at t = {t:g} s it is {R.tolist()}.")
