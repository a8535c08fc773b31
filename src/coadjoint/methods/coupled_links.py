"""Links that act on each other as `coupling` of `co.Power` declares: their joints, and a check that they do."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array
from coadjoint.errors import ArgumentError, warn
from coadjoint.kernels.newton.coupled import Coupled
from coadjoint.kernels.run.disk_cache import evaluated
from coadjoint.kernels.trace.evaluate import evaluate, traced
from coadjoint.log import logger
from coadjoint.mechanics.state import State

if TYPE_CHECKING:
    from coadjoint.mechanics.system import System

_log = logger(__name__)
APART = 1e-9
"""The largest derivative at links that are not paired, relative to the largest of its equation: round-off."""

REACHES = (1.0, 1e-3)
"""The reaches of the random points; the second is used if derivatives at the first are not finite."""

WRITTEN = 1000
"""Links times the square of a link's unknowns, up to which native code takes a chain of joints: 12 links on SO(3)."""

LOOPED = 500
"""The same above which loops over links are preferred, whose code does not grow with the links: 7 links on SO(3)."""


@dataclass(frozen=True)
class Joined(Coupled):
    """Links with the multipliers of their joints, of which the round-off eps |n|/h grows with the square of N."""

    near, rests, multipliers = 1e-5, True, True

    @property
    def native(self) -> bool:
        return self.layout.width == 1 and self.count * sum(self.sizes) ** 2 <= WRITTEN

    @property
    def looped(self) -> bool:
        return self.count * sum(self.sizes) ** 2 > LOOPED

    @property
    def words(self) -> str:
        return super().words.partition(";")[0]


def require_coupling(system: System, equations: Callable[..., Array], state: State, how: Coupled) -> None:
    """Raise ArgumentError if an equation of a step has unknowns of a link that it is not paired with.

    equations: the residual of the step, a function of (system, state, h, z).

    At a random configuration and velocity about the state, J v of a random v is compared with that of the blocks, each
    equation relative to its own size. If no derivatives are finite, a warning says that nothing was checked.
    """
    if not system.verify or traced(state, system.parameters) or np.ndim(state.t):
        return
    random = np.random.default_rng(1826)
    m = how.count * sum(how.sizes)
    eta, z, v = 0.3 * random.normal(size=system.group.dim), random.normal(size=m), random.normal(size=m)
    h = np.float64(0.1)

    def residual(eta: Array, z: Array) -> Array:
        g = system.group.exp(eta)
        back = system.group.inverse(g)
        here = state.replace(a=system.advected.act(system.group, back, state.a), memory=None)
        return equations(system, here, h, z)

    def compared(eta: Array, z: Array, v: Array) -> tuple[Array]:
        along = jnp.concatenate([how.seeds(), v[None]])
        columns = jax.vmap(lambda v: jax.jvp(lambda z: residual(eta, z), (z,), (v,))[1])(along)
        lower, diagonal, upper = how.placed(columns[:-1])
        rows = how.in_blocks(v)
        nothing = jnp.zeros_like(rows[:1])
        found = (
            jnp.einsum("mij,mj->mi", lower, jnp.concatenate([nothing, rows[:-1]]))
            + jnp.einsum("mij,mj->mi", diagonal, rows)
            + jnp.einsum("mij,mj->mi", upper, jnp.concatenate([rows[1:], nothing]))
        )
        sizes = jnp.max(jnp.abs(jnp.stack([lower, diagonal, upper])), axis=(0, 3))
        away = how.by_links(columns[-1] - how.out_of_blocks(found))
        return (jnp.abs(away) / jnp.maximum(how.by_links(how.out_of_blocks(sizes)), jnp.finfo(float).tiny),)

    per_link = np.zeros(how.count)
    for reach in REACHES:
        eta, z = reach * eta, reach * z
        per_link = np.max(evaluated("coupling", compared, eta, z, v)[0], axis=1)
        if np.all(np.isfinite(per_link)):
            break
    if not np.all(np.isfinite(per_link)):
        warn(
            f"Whether `coupling` of {system.group!r} pairs all links that act on each other was not checked, because "
            "the equations have no derivatives at random points near the start; missing pairs cost iterations.",
            stacklevel=2,
        )
        return
    if np.max(per_link) <= APART:
        _log.info("%s: %s.", system.name, how.words)
        return
    link = int(np.argmax(per_link))

    def of_link(eta: Array, z: Array) -> Array:
        _, pull = jax.vjp(lambda z: residual(eta, z), z)
        weights = np.zeros((how.count, sum(how.sizes)))
        weights[link] = random.normal(size=sum(how.sizes))
        return how.by_links(pull(how.end_to_end(jnp.asarray(weights)))[0])

    seen = np.max(np.abs(evaluate(of_link, eta, z)), axis=1)
    near = {link, *(i for pair in how.pairs if link in pair for i in pair)}
    others = [i for i in range(how.count) if i not in near]
    other = max(others, key=lambda i: seen[i])
    raise ArgumentError(
        f"The links {min(link, other)} and {max(link, other)} act on each other, but `coupling` of {system.group!r} "
        'does not pair them: give their pair, as in coupling=[(0, 1), …], "ring" or "all".'
    )
