"""The model of process noise: an unmodelled force, or parameters, that vary randomly."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError, nearest
from coadjoint.groups import SO3
from coadjoint.identification.channels import is_vehicle
from coadjoint.identification.unknowns import _arrays, _parsed
from coadjoint.mechanics.copies import replaced
from coadjoint.mechanics.forces import Forces
from coadjoint.mechanics.parameters import Parameters
from coadjoint.mechanics.state import Force
from coadjoint.mechanics.system import System

NAME = "process_noise"
"""The name of the parameter and of the force that a system is given."""

AXES = ("X", "Y", "Z", "K", "M", "N")
GROUPS = {"force": AXES[:3], "torque": AXES[3:]}


class Moved(NamedTuple):
    """`labels`: of the components. `places`, `component`: the numbers of the parameters, and the component that moves
    each."""

    labels: tuple[str, ...]
    places: np.ndarray
    component: np.ndarray


def _on_rotations(motion: PyTree, p: PyTree) -> Force:
    return Force(torque=p.process_noise[3:], force=p.process_noise[:3])


def _on_poses(motion: PyTree, p: PyTree) -> Force:
    return Force(torque=jnp.concatenate([p.process_noise[3:], p.process_noise[:3]]))


def wandering(system: System, names: Sequence[str]) -> tuple[System, Moved | None]:
    """The system, with an additional force where one is named, and the moved parameters; raises ArgumentError."""
    checks.expect(not isinstance(names, str), names, "process_noise", f"a list of names, such as [{names!r}]")
    if not names or system.parameters is None:
        return system, None
    own = _arrays(system.parameters)
    asked = [one for name in names for one in ((name,) if name in own else GROUPS.get(name, (name,)))]
    pushed = [name for name in asked if name in AXES and (name not in names or name not in own)]
    if clash := [name for name in pushed if name in own]:
        raise ArgumentError(
            f"Argument `process_noise` names a force along `{clash[0]}`, but the system has a parameter of that name: "
            "name that, or the other components one by one."
        )
    if pushed:
        system = _pushed(system)
    assert system.parameters is not None
    known = _arrays(system.parameters)
    found: dict[str, int] = {}
    for name in asked:
        found |= {name: known[NAME][0] + AXES.index(name)} if name in pushed else _entries(name, known)
    return system, Moved(tuple(found), np.array(list(found.values())), np.arange(len(found)))


def without(system: System) -> System:
    """The system without the additional force."""
    parameters = system.parameters
    if parameters is None or NAME not in parameters:
        return system
    forces = system.forces
    assert forces is not None
    names = tuple(name for name in forces.names if name != NAME)
    rest = Forces(names, forces.functions[: len(names)]) if names else None
    numbers = {name: value for name, value in parameters.asdict().items() if name != NAME}
    return replaced(system, parameters=Parameters(**numbers), forces=rest)


def _pushed(system: System) -> System:
    """The system with a force and a torque in the body, of six numbers that are zero."""
    if not is_vehicle(system):
        raise ArgumentError(
            "Argument `process_noise` names a force, but the system is not a vehicle on SO(3) × ℝ³ or SE(3): give it a "
            "parameter that acts as one, and name that."
        )
    old, p = system.forces, system.parameters
    assert p is not None
    if NAME in p:
        raise ArgumentError(f"The system has a parameter `{NAME}`, which identification needs for itself: rename it.")
    own = _on_rotations if isinstance(system.group, SO3) else _on_poses
    forces = Forces((*(old.names if old else ()), NAME), (*(old.functions if old else ()), own))
    return replaced(system, forces=forces, parameters=Parameters(**p.asdict(), **{NAME: np.zeros(6)}))


def _entries(name: str, known: dict[str, tuple[int, np.ndarray]]) -> dict[str, int]:
    """The numbers that a name stands for, by their labels; raises ArgumentError."""
    if not isinstance(name, str) or name.partition("[")[0] not in known:
        near = nearest(name, [*known, *GROUPS, *AXES], 0.0)
        raise ArgumentError(f"There is no `{name}` that process noise could move; the nearest is `{near}`.")
    places = _places(name, known)
    if len(places) == 1:
        return {name: places[0]}
    return {f"{name}[{i}]": place for i, place in enumerate(places)}


def _places(name: str, known: dict[str, tuple[int, np.ndarray]]) -> list[int]:
    parameter, index = _parsed(name, known)
    first, array = known[parameter]
    if array.ndim > 1:
        raise ArgumentError(f"Process noise acts on numbers and lists, but `{parameter}` has shape {array.shape}.")
    return list(range(first, first + array.size)) if index is None else [first + (index[0] if index else 0)]
