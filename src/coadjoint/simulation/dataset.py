"""A run as a labelled xarray dataset."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import jax
import numpy as np
import xarray

from coadjoint.groups import attitude
from coadjoint.mechanics.state import State
from coadjoint.spaces import Space

if TYPE_CHECKING:
    from coadjoint.simulation.run import Run

_MEANINGS = {
    "n": "n = g⁻¹q, body frame",
    "nu": "ν = g⁻¹q̇ of the step that starts at the node, body frame",
    "xi": "ξ = g⁻¹ġ of the step that starts at the node, body frame",
    "xi_spatial": "Ad_g ξ, space frame",
    "q": "q = g·n, space frame",
    "qdot": "q̇ = g·ν, space frame",
    "a": "a = g⁻¹a₀, advected",
    "mu": "μ = ∂ℓ/∂ξ, body frame",
    "pi": "π = ∂ℓ/∂ν, body frame",
    "energy": "Legendre energy of (μ, π)",
    "discrete_energy": "E = −∂Λ/∂h, with the discrete velocities",
    "kelvin_noether": "Kelvin–Noether quantities",
    "group_defect": "distance of g from its group",
    "euler_angles": "yaw, pitch, roll (ZYX)",
}


def dataset(run: Run) -> xarray.Dataset:
    """The records of a run: states, q, body and spatial velocities, Euler angles and monitors over `time`."""
    records, system = run.records, run.system
    group, Q, V = system.places
    units = {"time": "s", "euler_angles": "rad", **dict(system.units)}
    variables: dict[str, tuple[tuple[str, ...], Any]] = {}
    leaves = jax.tree.leaves(records.g)
    for name, leaf in zip(group.leaf_names, leaves, strict=True):
        variables[name] = (("time", *(f"{name}_{axis}" for axis in range(leaf.ndim - 1))), leaf)
    derived = records.each(_derived)
    for name in ("xi", "mu"):
        variables[name] = (("time", "algebra"), getattr(records, name))
    variables["xi_spatial"] = (("time", "algebra"), derived.pop("xi_spatial"))
    for space, pairs in ((Q, {"n": records.n, "nu": records.nu, "pi": records.pi, **derived}), (V, {"a": records.a})):
        for name, values in pairs.items():
            variables.update(_parts(space, group, name, values))
    if records.inputs is not None:
        for path, leaf in jax.tree_util.tree_leaves_with_path(records.inputs):
            name = "inputs" + jax.tree_util.keystr(path).replace(".", "_").replace("[", "_").replace("]", "")
            variables[name] = (("time", *(f"{name}_{axis}" for axis in range(leaf.ndim - 1))), leaf)
    rotation = records.each(lambda s: group.rotation(s.g))
    if rotation is not None:
        variables["euler_angles"] = (("time", "angle"), np.stack(attitude.zyx_angles(rotation), axis=-1))
    for name, values in run.monitors.items():
        variables[name] = (("time", "quantity") if values.ndim > 1 else ("time",), values)
    made = xarray.Dataset(
        variables,
        coords={"time": run.start.t + run.dt * run.steps_saved, "step": ("time", run.steps_saved)},
        attrs=_attributes(run),
    )
    if "angle" in made.dims:
        made = made.assign_coords(angle=["yaw", "pitch", "roll"])
    for name in (*made.data_vars, "time"):
        base = str(name).split("_")[0] if str(name) not in _MEANINGS else str(name)
        if str(name) in units or base in units:
            made[name].attrs["units"] = units.get(str(name), units.get(base))
        if base in _MEANINGS:
            made[name].attrs["long_name"] = _MEANINGS[base]
    return made


def _derived(state: State) -> dict[str, Any]:
    group, Q, _ = state.places
    return {
        "xi_spatial": group.Ad(state.g, state.xi),
        "q": Q.act(group, state.g, state.n),
        "qdot": Q.push(group, state.g, state.n, state.nu),
    }


def _parts(space: Space, group: Any, name: str, values: np.ndarray) -> dict[str, tuple[tuple[str, ...], Any]]:
    if values.shape[-1] == 0:
        return {}
    parts = space.components(group, name)
    dims = {part: f"{'additional' if name != 'a' else 'advected'}{part[len(name) :]}" for part in parts}
    return {part: (("time", dims[part]), values[..., span]) for part, span in parts.items()}


def _attributes(run: Run) -> dict[str, Any]:
    found = {key: value for key, value in run.summary().items() if value is not None}
    lows = {f"{name}_lowest": np.ravel(low) for name, (low, _) in run.extrema.items()}
    highs = {f"{name}_highest": np.ravel(high) for name, (_, high) in run.extrema.items()}
    return {"group": repr(run.system.group), "card": str(run), **found, **lows, **highs}
