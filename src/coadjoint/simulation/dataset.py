"""A run as labelled arrays."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import jax
import numpy as np

from coadjoint.arrays import Array
from coadjoint.groups import LieGroup, Power, attitude
from coadjoint.labelled import Labelled
from coadjoint.mechanics import reactions
from coadjoint.mechanics.internal_rule import InternalRule, declared
from coadjoint.mechanics.invariance import group_of, is_right
from coadjoint.mechanics.quantities import meaning
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.rattle import kept
from coadjoint.simulation.deferred import Deferred, after, of_each
from coadjoint.simulation.derived import Derivation, derivation, known_at_nodes, times
from coadjoint.simulation.monitors import Monitor, watched
from coadjoint.simulation.result import Result
from coadjoint.spaces import Space
from coadjoint.texts import Table

_MEANINGS = {
    "n": "n = g⁻¹q, body frame",
    "nu": "ν = g⁻¹q̇ at the node, of its momenta, body frame",
    "nu_step": "ν = g⁻¹q̇ of the step that starts at the node, body frame",
    "xi": "ξ = g⁻¹ġ at the node, of its momenta, body frame",
    "xi_step": "ξ = g⁻¹ġ of the step that starts at the node, body frame",
    "xi_spatial": "Ad_g ξ, space frame",
    "q": "q = g·n, space frame",
    "qdot": "q̇ = g·ν, space frame",
    "a": "a = g⁻¹a₀, advected",
    "mu": "μ = ∂ℓ/∂ξ, body frame",
    "pi": "π = ∂ℓ/∂ν, body frame",
    "euler_angles": "yaw, pitch, roll (ZYX)",
}
_MEANINGS_RIGHT = {
    "n": "n = g·q, space frame",
    "nu": "ν = g·q̇ at the node, of its momenta, space frame",
    "nu_step": "ν = g·q̇ of the step that starts at the node, space frame",
    "xi": "ξ = ġg⁻¹ at the node, of its momenta, space frame",
    "xi_step": "ξ = ġg⁻¹ of the step that starts at the node, space frame",
    "xi_body": "Ad_{g⁻¹} ξ, body frame",
    "q": "q = g⁻¹n, body frame",
    "qdot": "q̇ = g⁻¹ν, body frame",
    "a": "a = g·a₀, advected",
    "mu": "μ = ∂ℓ/∂ξ, space frame",
    "pi": "π = ∂ℓ/∂ν, space frame",
    "euler_angles": _MEANINGS["euler_angles"],
}
"""The meanings of the variables of right-invariant systems."""


def _told(system: System) -> dict[str, str]:
    """The meaning of each variable."""
    if not is_right(system.places):
        return _MEANINGS | {one.name: one.meaning for one in watched()}
    return _MEANINGS_RIGHT | {one.name: one.meaning.replace("body frame", "space frame") for one in watched()}


def _seen_from_there(system: System) -> str:
    """The name of the velocity in the other frame, Ad_g ξ of left-invariant systems."""
    return "xi_body" if is_right(system.places) else "xi_spatial"


def reserved(system: System) -> set[str]:
    """Names of variables that every dataset of the system has, or may have."""
    group, Q, V = system.places
    of_Q = ("n", "nu", "nu_step", "pi", "q", "qdot")
    parts = [Q.components(group, name) for name in of_Q] + [V.components(group, "a")]
    parts += [[f"reaction_{one.name}", f"reaction_step_{one.name}"] for one in system.constraints]
    always = {"time", "step", "member", "code", "steps_done", "balance", "newton_residual", *group.leaf_names}
    return always.union(_told(system), *parts)


ANGLES = ["yaw", "pitch", "roll"]
"""The names of Euler angles."""

Variables = dict[str, tuple[tuple[str, ...], Any]]


def dataset(run: Result) -> Labelled:
    """The records of a run: states, q, body and spatial velocities, Euler angles and monitors over `time`.

    The variables of an ensemble have a first dimension `member`, and are NaN where a member has failed.
    """
    derive, lead = derivation(run.plan.program), () if run.members is None else ("member",)
    if run.members is None:
        records, derive = run._deferred_records, partial(derive, run.system.parameters)
        found = variables(run.system, records, run._deferred_monitors, derive)
    else:
        records = run.records
        found = member_variables(run.system, records, run.monitors, derive, members_of(records, 0))
    coordinates = {
        "time": ("time", times(run.plan.program, run.start, run.plan.h, run.steps_saved, records)),
        "step": ("time", run.steps_saved),
        **member_coordinates(run),
    }
    known = meanings(found, run.system)
    rows = {name: ((*lead, *dims), values) for name, (dims, values) in found.items()} | coordinates
    return labelled({name: (*row, known.get(name, {})) for name, row in rows.items()}, {*coordinates}, attributes(run))


def outline(run: Result) -> Labelled:
    """The variables that a run will have, from its first record with monitors of 0; of an ensemble those of one member.

    They use the parameters of all members, like its dataset: a variable known for one member may be unknown for all.
    """
    _, state = run.one
    monitors = (made for made in run.plan.program.observed if isinstance(made, Monitor))
    observed = {one.name: np.zeros(1) for made in monitors for one in made.watched}
    records = jax.tree.map(lambda leaf: np.asarray(leaf)[None], state)
    derive = partial(derivation(run.plan.program), run.system.parameters)
    return Labelled(variables(run.system, records, observed, derive), attrs={"system": run.system.name})


def member_coordinates(run: Result) -> Variables:
    """The number of each member, how many good steps it did, and how its last one ended; none of a single run."""
    if run.members is None:
        return {}
    return coordinates_of(run.position.steps_done, run.position.codes)


def coordinates_of(steps_done: np.ndarray, codes: np.ndarray) -> Variables:
    """Those of members by these, (members,) each."""
    numbers = {"member": np.arange(len(codes)), "steps_done": steps_done, "code": codes}
    return {name: (("member",), values) for name, values in numbers.items()}


def member_variables(
    system: System,
    records: State,
    monitors: Mapping[str, np.ndarray],
    derive: Derivation,
    members: np.ndarray,
) -> Variables:
    """As `variables`, for records with two leading axes, of members and nodes; NaN where a member has failed.

    The dimensions are those of one member. members: the member of each record, with the same axes.
    """
    leading = np.shape(records.t)
    good = np.isfinite(records.t).ravel()

    def rows(values: np.ndarray) -> np.ndarray:
        return values.reshape(good.size, *values.shape[2:])[good]

    def spread(values: np.ndarray) -> np.ndarray:
        whole = np.full((good.size, *values.shape[1:]), np.nan)
        whole[good] = values
        return whole.reshape(*leading, *values.shape[1:])

    of_good = {name: rows(values) for name, values in monitors.items()}
    of_rows = partial(derive, system.parameters, members=rows(members))
    found = variables(system, jax.tree.map(rows, records), of_good, of_rows)
    return {name: (dims, spread(values)) for name, (dims, values) in found.items()}


def members_of(records: State, axis: int) -> np.ndarray:
    """The member of each record, of which they are an axis, in the shape of the leading axes."""
    shape = np.shape(records.t)
    return np.broadcast_to(np.expand_dims(np.arange(shape[axis]), 1 - axis), shape)


def variables(
    system: System,
    records: State,
    monitors: Mapping[str, np.ndarray | Deferred],
    derive: Callable[[State], Table],
) -> Variables:
    """Dimensions and values of every variable, one row per record; `derive` returns the values of a `Derivation`.

    Where records and monitors are deferred, so are the variables.

    ξ and ν belong to the nodes, `xi_step` and `nu_step` to the steps; where the velocities of the nodes are unknown, ξ
    and ν belong to the steps. Quantities without components, such as ξ on the group {e}, are left out.
    """
    group, Q, V = system.places
    found: Variables = {}
    leaves = () if records.g is None else zip(group.leaf_names, jax.tree.leaves(records.g), strict=True)
    links = ("link",) if isinstance(group, Power) else ()
    for name, leaf in leaves:
        own = range(leaf.ndim - 1 - len(links))
        found[name] = (("time", *links, *(f"{name}_{axis}" for axis in own)), leaf)
    more = {"xi": records.xi, "nu": records.nu, **derive(records)}
    rotation, known = more.pop("rotation", None), known_at_nodes(system, records)
    for name, values in (("xi", more.pop("xi")), ("mu", records.mu), *([("xi_step", records.xi)] if known else [])):
        found[name] = _coordinates(group, values)
    more |= {"nu_step": records.nu} if known else {}
    memory = kept(records)
    of_steps = more.pop("step_reactions", None if memory is None else memory.step)
    found.update(_reactions(system, more.pop("reactions", None), of_steps))
    if "xi_there" in more:
        found[_seen_from_there(system)] = _coordinates(group, more.pop("xi_there"))
    for space, pairs in ((Q, {"n": records.n, "nu": more.pop("nu"), "pi": records.pi, **more}), (V, {"a": records.a})):
        for name, values in pairs.items():
            found.update(_parts(space, group, name, values))
    inputs = of_each(system.inputs_at, records.t, records.inputs) if system.inputs else records.inputs
    for kind, values in (("inputs", inputs), ("internal", records.internal)):
        for path, leaf in jax.tree_util.tree_leaves_with_path(values):
            name = kind + jax.tree_util.keystr(path).replace(".", "_").replace("[", "_").replace("]", "")
            found[name] = (("time", *(f"{name}_{axis}" for axis in range(leaf.ndim - 1))), leaf)
    found.update(reported(system, records))
    if rotation is not None:
        found["euler_angles"] = (("time", "angle"), after(rotation, (*rotation.shape[:-2], 3), _zyx_angles))
    axes = {one.name: one.axis for one in watched()}
    for name, values in monitors.items():
        found[name] = (("time", axes.get(name, "quantity"))[: values.ndim], values)
    return {name: (dims, values) for name, (dims, values) in found.items() if 0 not in np.shape(values)[1:]}


def _reactions(system: System, at_nodes: np.ndarray | None, of_steps: np.ndarray | None) -> Variables:
    """λ of every constraint at the nodes, and those of the steps that start there, (records, rows)."""
    found: Variables = {}
    for one, part in reactions.parts(system):
        for name, values in (("reaction", at_nodes), ("reaction_step", of_steps)):
            if values is not None:
                found[f"{name}_{one.name}"] = (("time", f"{one.name}_row"), values[:, part])
    return found


def reported(system: System, records: State) -> Variables:
    """The values that the rule of the internal state reports for every record in addition to that state."""
    if not isinstance(system.internal, InternalRule):
        return {}
    report = system.internal.report

    def one(s: State) -> Table:
        return report(system.motion_at(s, s.inputs), system.parameters)

    found = of_each(one, records)
    return {name: (("time", *(f"{name}_{axis}" for axis in range(x.ndim - 1))), x) for name, x in found.items()}


def _zyx_angles(rotation: np.ndarray) -> np.ndarray:
    return np.stack(attitude.zyx_angles(rotation), axis=-1)


def meanings(made: Mapping[Any, Any], system: System) -> dict[str, Table]:
    """Unit and meaning of each variable, where known, and the limits of an internal state."""
    units = {"time": "s", "euler_angles": "rad", **dict(system.units)}
    units = {one.name: one.unit or units[one.like] for one in watched() if one.unit or one.like in units} | units
    found: dict[str, Table] = {}
    own, known = dict(system.quantities), _told(system)
    if not any(str(name).startswith(("xi_step", "nu_step")) for name in made):  # ξ and ν are those of steps
        known |= {name: known[f"{name}_step"] for name in ("xi", "nu")}
    for name in (*map(str, made), "time"):
        of_step = next((step for step in ("xi_step", "nu_step") if name.startswith(step)), None)
        base = of_step or (name if name in known or name in own else name.split("_")[0])
        unit = units.get(name, units.get(base if of_step is None else base.removesuffix("_step")))
        attrs = {"units": unit, "long_name": meaning(own[name]) if name in own else known.get(base)}
        found[name] = {key: value for key, value in attrs.items() if value is not None}
    for one in system.constraints:
        for name, text in (("reaction", "at the node, of φ̈ = 0"), ("reaction_step", "of the step, of first order")):
            if (variable := f"{name}_{one.name}") in found:
                found[variable]["long_name"] = f"multipliers λ of the constraint `{one.name}` {text}"
    for name, ends in declared(system.internal).limits(system.parameters).items():
        if (variable := f"internal_{name}") in found:
            found[variable] |= {key: end for key, end in zip(("low", "high"), ends, strict=True) if end is not None}
    return found


def labelled(variables: Mapping[str, object], coordinates: set[str], attributes: Table) -> Labelled:
    """The variables, of which some are coordinates, with named angles."""
    made = Labelled(variables, coordinates, attributes)
    return made.assign(angle=("angle", ANGLES)) if "angle" in made.sizes else made


def _coordinates(group: LieGroup, values: Array) -> tuple[tuple[str, ...], Array]:
    """Vectors or covectors of the algebra, (records, dim), by coordinates; of a power by links and coordinates."""
    if isinstance(group, Power):
        return ("time", "link", "algebra"), values.reshape(values.shape[0], group.count, group.factor.dim)
    return ("time", "algebra"), values


def _parts(space: Space, group: Any, name: str, values: Array) -> dict[str, tuple[tuple[str, ...], Any]]:
    if values.shape[-1] == 0:
        return {}
    parts = space.components(group, name)
    dims = {part: f"{'additional' if name != 'a' else 'advected'}{part[len(name) :]}" for part in parts}
    return {part: (("time", dims[part]), values[..., span]) for part, span in parts.items()}


def attributes(run: Result) -> Table:
    """The certificate of a run as the attributes of its dataset."""
    found = {key: value for key, value in run.summary().items() if value is not None}
    found |= {f"events_{name}": count for name, count in found.pop("events", {}).items()}
    limits = {} if run.members is not None else run.extrema
    lows = {f"{name}_lowest": np.ravel(low) for name, (low, _) in limits.items()}
    highs = {f"{name}_highest": np.ravel(high) for name, (_, high) in limits.items()}
    return {**_place(run.system), **run.certificate.asdict(), **found, **lows, **highs}


def _place(system: System) -> dict[str, str]:
    """The group, and "right" where a system is right-invariant."""
    return {"group": repr(group_of(system.places)), **({"invariance": "right"} if is_right(system.places) else {})}
