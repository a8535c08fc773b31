"""The quantities measured from a system's states, given their layout, and the local error of single steps of a run."""

from __future__ import annotations

from functools import lru_cache, partial
from typing import Any

import jax
import numpy as np

from coadjoint.arrays import Array, PyTree
from coadjoint.groups import Power
from coadjoint.groups.matrix_elements import MatrixCoordinates
from coadjoint.kernels.packing import Layout
from coadjoint.kernels.run.disk_cache import recalled
from coadjoint.kernels.trace.evaluate import Mapped, evaluate, tabulate
from coadjoint.mechanics.internal_state import HELD
from coadjoint.mechanics.state import Places, State
from coadjoint.methods.program import Constants
from coadjoint.methods.renewal import INPUTS_HELD
from coadjoint.methods.step_model import StepModel
from coadjoint.simulation.accuracy.local_error import (
    Bilinear,
    Frequencies,
    InternalPlaces,
    Numbers,
    PartsOfSteps,
    Ruler,
)
from coadjoint.simulation.plan import Plan


@lru_cache(maxsize=64)
def ruler_of(layout: Layout, places: Places) -> Ruler:
    """The ruler for states of a layout."""
    group, Q, _ = places
    at = layout.places
    names = () if at.g is None else group.leaf_names
    leaves = zip(names, jax.tree.leaves(at.g), strict=True)
    points, momenta = (Q.components(group, name) if Q.dim(group) else {} for name in ("q", "pi"))
    return Ruler(
        time=int(at.t),
        configuration=tuple((name, _flat(leaf)) for name, leaf in leaves),
        points=tuple((name, part.start, part.stop) for name, part in points.items()),
        momenta=tuple((name, part.start, part.stop) for name, part in momenta.items()),
        mu=_flat(at.mu),
        pi=_flat(at.pi),
        xi=_flat(at.xi),
        nu=_flat(at.nu),
        q=partial(_positions, layout, places) if points else None,
        turning=partial(turning, group),
    )


def _flat(leaf: PyTree) -> Numbers:
    return tuple(np.ravel(leaf).astype(int).tolist())


FEW = 24
"""The number of rows to which fewer are padded, so that the action is traced once for all of them."""


def _positions(layout: Layout, places: Places, rows: np.ndarray) -> np.ndarray:
    """q = g·n of every row."""
    states = layout.views(rows[:, : layout.size])
    return acting(places, states.g, states.n)


def acting(places: Places, g: object, n: np.ndarray) -> np.ndarray:
    """g·n of every row, (k, ambient)."""
    count = max(len(n), FEW)
    if len(n) < count:
        filled = np.minimum(np.arange(count), len(n) - 1)
        g, n, size = jax.tree.map(lambda leaf: leaf[filled], g), n[filled], len(n)
        return _acting(places, count)(g, n)[:size]
    return _acting(places, count)(g, n)


@lru_cache(maxsize=64)
def _acting(places: Places, rows: int) -> Any:
    """(g, n) ↦ g·n on rows, traced once."""
    group, Q, _ = places
    g = jax.tree.map(lambda leaf: np.zeros((rows, *leaf.shape)), evaluate(group.identity))
    return tabulate(Mapped(lambda g, n: Q.act(group, g, n)), g, np.zeros((rows, Q.ambient(group))))


def course_of(layout: Layout, rule: object) -> InternalPlaces:
    """The places of the internal state that the rule of a system advances; rule: None if the system has none."""
    at = layout.places
    if rule is None or at.internal_due is None:
        return InternalPlaces()
    of = at.internal, at.internal_mean, at.internal_end
    begin, mean, end = (tuple(following(place, rule)) for place in of)
    whole = [_flat(np.concatenate([np.ravel(x) for x in (*jax.tree.leaves(one), [])])) for one in of]
    jumping, jumping_end = (
        tuple(i for i in every if i not in set(some)) for every, some in ((whole[0], begin), (whole[2], end))
    )
    return InternalPlaces(int(at.internal_due), begin, mean, end, jumping, jumping_end, (*whole[1], *whole[2]))


def plain(ruler: Ruler, layout: Layout, places: Places) -> Ruler:
    """The ruler with functions of NumPy alone; without q where it is not linear in g and in n."""
    group = places.group
    copies, factor = (group.count, group.factor) if isinstance(group, Power) else (1, group)
    q = None if ruler.q is None else _bilinear(layout, places)
    return ruler._replace(q=q, turning=Frequencies(structure(factor), copies))


MOST = 4096
"""The most products of g and n for which the action is examined."""


def _bilinear(layout: Layout, places: Places) -> Bilinear | None:
    """g·n by its values at all pairs of basis vectors, compared with that of a random element."""
    group, Q, _ = places
    at, leaves = layout.places, jax.tree.leaves(evaluate(group.identity))
    g, n = (_flat(np.concatenate([np.ravel(x) for x in jax.tree.leaves(part)])) for part in (at.g, at.n))
    if (len(g) + 1) * (len(n) + 1) > MOST:
        return None
    ends = np.cumsum([0, *(int(np.prod(leaf.shape)) for leaf in leaves)])

    def act(g: PyTree, n: Array) -> Any:
        parts = [g[a:b].reshape(leaf.shape) for a, b, leaf in zip(ends, ends[1:], leaves, strict=False)]
        return Q.act(group, jax.tree.unflatten(jax.tree.structure(at.g), parts), n)

    pairs = [np.concatenate([np.zeros((1, size)), np.eye(size)]) for size in (len(g), len(n))]
    found = np.asarray(evaluate(jax.vmap(lambda g: jax.vmap(lambda n: act(g, n))(pairs[1])), pairs[0]))
    linear, constant = found - found[:1, :1], found[0, 0]
    products = linear - linear[:1] - linear[:, :1]
    tensor = products.copy()
    tensor[:, 0], tensor[0, :] = linear[:, 0], linear[0, :]
    tensor[0, 0] = constant
    made = Bilinear(np.transpose(tensor, (2, 0, 1)), g, n)
    random = np.random.default_rng(1)
    element = evaluate(group.exp, random.normal(size=group.dim))
    row = random.normal(size=layout.size)
    row[list(g)] = np.concatenate([np.ravel(leaf) for leaf in jax.tree.leaves(element)])
    true = evaluate(lambda g, n: Q.act(group, g, n), element, row[list(n)])
    return made if np.all(np.isfinite(made.tensor)) and np.allclose(made(row[None])[0], true, atol=1e-9) else None


def following(places: PyTree, rule: Any) -> list[int]:
    """The numbers of an internal state that follow the motion or a command, rather than jump at nodes.

    The numbers that `co.mechanics.sampled` advances jump, and so do those that the rule names in its attribute
    `jumping`, such as noise.
    """
    jumping = set(getattr(rule, "jumping", ()))
    found: list[int] = []

    def visit(tree: PyTree, name: str) -> None:
        if hasattr(tree, "asdict"):
            parts = tree.asdict()
            if parts.keys() >= HELD:
                return
            for key, part in parts.items():
                if name or key not in jumping:
                    visit(part, f"{name}.{key}")
        elif tree is not None:
            found.extend(int(i) for i in np.ravel(tree))

    visit(places, "")
    return found


def turning(group: object, xi: np.ndarray) -> np.ndarray:
    """The largest frequency of ad_ξ, rad/s, of every row: |ω| for rotations and rigid motions."""
    if isinstance(group, MatrixCoordinates) and not group.dense:
        return np.array([_spread(evaluate(group.hat, row)) for row in xi])
    if isinstance(group, Power):
        links = np.reshape(xi, (len(xi) * group.count, group.factor.dim))
        return turning(group.factor, links).reshape(len(xi), group.count).max(axis=1)
    return Frequencies(structure(group))(xi)


def _spread(matrix: np.ndarray) -> float:
    """The largest difference of the imaginary parts of two eigenvalues: eigenvalues of ad_ξ are differences of ξ̂'s."""
    return float(np.ptp(np.linalg.eigvals(matrix).imag))


_structures: dict[Any, np.ndarray] = {}


def structure(group: Any) -> np.ndarray:
    """c with [ξ, η]_i = c_ijk ξ_j η_k."""
    if group not in _structures:
        dim, eye = group.dim, np.eye(group.dim)
        pairs = np.repeat(eye, dim, axis=0), np.tile(eye, (dim, 1))
        rows = recalled(("structure", group), lambda: {"rows": evaluate(jax.vmap(group.ad), *pairs)})["rows"]
        _structures[group] = np.transpose(np.reshape(rows, (dim, dim, dim)), (2, 0, 1))
    return _structures[group]


def steps_of(plan: Plan, state: State, constants: Constants | None = None) -> StepModel:
    """The steps of a plan, whose kernel they use. state: of one member. constants: by default those of the plan."""
    return StepModel(
        plan.program, plan.constants if constants is None else constants, state, backend=plan.backend,
        monitors=plan.watches, axes=plan.axes, count=plan.members or 1,
    )  # fmt: skip


class Doubling(PartsOfSteps):
    """Judges steps of a plan from records, whose inputs are held over a step."""

    probe: StepModel

    def __init__(self, plan: Plan, state: State):
        self.plan, constants = plan, plan.constants
        if constants.renewal is not None:
            constants = Constants(constants.system, constants.monitors, INPUTS_HELD)
        probe = steps_of(plan, state, constants)
        method, system = plan.program.method, plan.program.skeleton
        self.places = probe.layout.places
        memory = jax.tree.leaves(self.places.memory) if method.variable else []
        numbers = [int(i) for leaf in memory for i in np.ravel(leaf)]
        course = course_of(probe.layout, system.internal)
        super().__init__(probe, ruler_of(probe.layout, state.places), course, method.order, numbers)
