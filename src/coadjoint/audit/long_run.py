"""Conservation in long runs: the energy within a band without drift, or exactly, and the momenta to round-off.

The run is cut into intervals, with the means m_i of |E − E₀| relative to the size of the energy's terms. The *band* is
the largest error, the *drift* what the straight line through m_i gains over the run, less three standard errors,
relative to the mean of m_i: 2 for an error in proportion to time, 1 and more for one that grows as its square root,
near 0 for one that stays. A slow exchange of energy within the motion scatters m_i, but is not drift.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import jax
import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.audit.stepper import AuditStepper
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics import continuous
from coadjoint.mechanics.noether import isotropy_algebra, momentum_scale, spatial_momentum
from coadjoint.mechanics.reactions import node_rate, site
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System

INTERVALS = 20
EVERY = 20
"""Nodes are looked at after so many steps."""


class LongRun(NamedTuple):
    """Times (s), relative energy error at them, its band and drift, and the largest relative error of a momentum.

    `momentum_error` is NaN where no direction leaves all advected parameters alone. gap: the largest |φ|, |φ̇| and
    |A·(ξ, ν) − b|; 0 without constraints.

    times, energy_error: (nodes,).
    """

    times: np.ndarray
    energy_error: np.ndarray
    band: float
    drift: float
    momentum_error: float
    gap: float = 0.0


def long_run(stepper: AuditStepper, h: float, steps: int, discrete: bool) -> LongRun:
    """Watch energy and momenta over `steps` steps; `discrete`: the energy −∂_hΛ instead of Legendre's."""
    records = stepper.run(stepper.begin(h), h, steps // EVERY, EVERY).records
    values = evaluate(jax.vmap(_energy(stepper, h, discrete)), records)
    terms = np.abs(np.sum(records.mu * records.xi, axis=1)) + np.abs(np.sum(records.pi * records.nu, axis=1))
    size = abs(values[0]) + np.max(terms)
    error = np.where(stepper.method.holds(records), np.abs(values - values[0]), 0.0) / size
    kept = _momentum_error(stepper.system, stepper.start, records)
    return LongRun(np.asarray(records.t), error, float(error.max()), drift(error), kept, _gap(stepper.system, records))


def _gap(system: System, records: State) -> float:
    """The largest distance from a constraint, of places and of velocities, at records."""
    if not system.constraints:
        return 0.0

    def off(record: State):
        places = [one.value(system, site(record)) for one in system.constraints if one.holonomic]
        return [*places, node_rate(system, record)]

    return float(max(np.max(np.abs(part)) for part in evaluate(jax.vmap(off), records)))


def _energy(stepper: AuditStepper, h: float, discrete: bool) -> Callable[[State], PyTree]:
    """The energy of a record: Legendre's, or that of the first stage of the step that starts there."""
    system = stepper.system
    if not discrete:
        return partial(continuous.energy, system)
    step, fraction = stepper.method.recorded
    return lambda record: step.energy(system, record, np.float64(h * fraction))


def drift(error: np.ndarray) -> float:
    """What a line through the mean errors of the intervals gains for sure: less three standard errors, 0 at least.

    error: (nodes,).
    """
    means = np.array([part.mean() for part in np.array_split(error, INTERVALS)])
    if not means.any():
        return 0.0
    places = np.arange(INTERVALS) - (INTERVALS - 1) / 2
    slope = places @ means / (places @ places)
    rest = means - means.mean() - slope * places
    scatter = np.sqrt(rest @ rest / (INTERVALS - 2) / (places @ places))
    return float(max(slope - 3 * scatter, 0.0) * INTERVALS / means.mean())


def _momentum_error(system: System, start: State, records: State) -> float:
    """The largest change of ⟨c₀, Ad*_{g⁻¹}m⟩ for unit c₀ of the isotropy algebra, relative to |μ| + |π||n| in space.

    On a group with translations the momentum about the origin is compared with those about the body times 1 + |x|.
    """
    directions = isotropy_algebra(system, start)
    if not len(directions):
        return float("nan")

    def watch(s: State):
        reach = jax.numpy.max(jax.numpy.abs(system.group.matrix(s.g)))
        return spatial_momentum(system, s), momentum_scale(system, s) * reach

    momentum, scale = evaluate(jax.vmap(watch), records)
    along = momentum @ directions.T
    return float(np.max(np.abs(along - along[0])) / np.max(scale))
