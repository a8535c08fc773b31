"""The fit of a log: rounds of least squares, each with the noise of the previous one, on sufficiently fine steps."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from coadjoint.errors import ArgumentError, CoadjointError
from coadjoint.identification.coloured import LONGEST, SHORTEST, Channel, Neighbours, correlation_time, whitened
from coadjoint.identification.fit import Fit
from coadjoint.identification.least_squares import Estimates, Solution, freedom, least_squares, step
from coadjoint.identification.problem import Setting
from coadjoint.identification.sampling import FEWEST_STEPS
from coadjoint.identification.smoothing import noise as rough_noise
from coadjoint.losses import Loss

ATTEMPTS = 3
"""The number of searches, each from the parameters at which the previous one got stuck."""

ROUNDS, SAME = 20, 0.01
"""The largest number of estimates of noise from residuals, and the relative change at which they end."""

QUIETEST = 1e-8
"""The least noise that is estimated, in parts of the largest number of a column, or of 1: a log without noise holds
round-off."""

SAME_TIME = 0.02
"""Likewise of correlation times."""

SAME_WEIGHT = 0.05
"""The largest change of the root of a weight in the last round."""

SHIFT = 0.1
"""The intended largest shift of a parameter by the step size, in standard errors; twice that is accepted."""

LEAST_SEGMENT = 2.5
"""s, below which segments are not shortened."""

SEGMENT = 10.0
"""The length of segments, s, where none is given."""

SHORT = (2.0, 6.0)
"""The length of segments, s, with which the search begins if the requested ones are at least twice as long."""

FAR = 10.0
"""The multiple of its size, or the logarithm, by which a parameter may move until it counts as lost."""

MISSED = 5.0
"""The multiple of the noise between neighbouring samples from which on a residual is not noise."""

FINEST = 16
"""The most parts into which a step is cut."""


class Fitted(NamedTuple):
    """The solution of least squares, and its problem; `sigma` by channel, `estimated` those that were not given."""

    fit: Fit
    solution: Solution
    sigma: np.ndarray
    estimated: np.ndarray
    trips: int
    shift: np.ndarray
    """The approximate shift of each parameter by the step size, in standard errors; empty if it was not requested."""
    unsettled: dict[str, float]
    """The parts of the noise that still changed in the last round of least squares, with their relative changes."""


def fitted(asked: Setting, segment: float | Literal["auto"] | None, given: dict[str, float]) -> Fitted:
    """The fit; unless the step is fixed, on one that shifts no parameter by much more than SHIFT standard errors.

    segment: s; "auto" is SEGMENT, or one run where a segment would hand what depends on the motion to the next. Where
    "auto" finds no solution, segments of a quarter are tried: over a long time an unstable motion loses its start.

    The rule is of an order r, so from h to h/2 parameters shift by 1 − 2⁻ʳ of their shift at h.
    """
    log, names = asked.log, asked.channels.names
    sigma = np.array([given.get(name) or rough_noise(log, name) for name in names])
    open_ = np.array([name not in given for name in names])
    h, left = asked.longest, FINEST
    shooting = asked.shooting(h, SEGMENT if segment == "auto" else segment, "new")
    auto = segment == "auto"
    if segment == "auto":
        segment = None if shooting.handed else SEGMENT
        shooting = shooting if segment else asked.shooting(h, segment, "new")
    fit = Fit(shooting, asked, sigma)
    place, trips = fit.at(_begun(asked, h, segment, sigma, np.zeros(fit.count))), 0
    fit.find_process_noise(place)
    if asked.step is None:
        parts = _parts(_shift(fit, place, asked, segment), left)
        left //= parts
        fit = fit.finer(segment, parts)
    attempt = 1
    while True:
        found = _rounds(fit, place, open_, trips, attempt == ATTEMPTS)
        if not found.solution.converged:
            if attempt == ATTEMPTS:
                raise CoadjointError(lost(fit, found.solution, found.trips))
            # Starts that went astray, and the noise estimated from them, are dropped; parameters are kept.
            fit.sigma, attempt, trips = sigma, attempt + 1, found.trips
            fit.times = np.zeros(len(sigma))
            stuck = found.solution.place.shared
            near = np.where(np.abs(stuck) > FAR, 0.0, stuck)
            if auto and segment is not None and segment > LEAST_SEGMENT:
                segment = segment / 4
                fit = Fit(asked.shooting(fit.shooting.samples.h, segment, "new"), asked, sigma)
            place = fit.at(_begun(asked, fit.shooting.samples.h, segment, sigma, near))
            fit.wander = None
            fit.find_process_noise(place)
            continue
        if asked.step is not None and asked.step == log.step:
            return found
        found = found._replace(shift=_shift(found.fit, found.solution.place, asked, segment))
        parts = _parts(found.shift / 2, left)
        if asked.step is not None or parts < 2:
            return found
        left //= parts
        fit, place, trips = found.fit.finer(segment, parts), found.solution.place, found.trips


def _begun(asked: Setting, h: float, segment: float | None, sigma: np.ndarray, shared: np.ndarray) -> np.ndarray:
    """The start of the search for parameters: the rough end of one from `shared` on short segments, then on longer
    ones.

    Over a short time a simulation cannot go far astray, even with wrong parameters.
    """
    longest = asked.log.duration if segment is None else segment
    shortest = max(8 * asked.log.interval, (FEWEST_STEPS + 1) * h)
    lengths = [length for length in SHORT if shortest <= length <= longest / 2]
    for length in lengths if asked.holds_starts else ():
        fit = Fit(asked.shooting(h, length), asked, sigma, held=True)
        place = fit.at(shared)
        fit.settle(place)
        solution = least_squares(fit, place, fit.accepted, roughly=True, blind=fit.blind)
        if solution is not None and np.max(np.abs(solution.place.shared)) < FAR:
            shared = solution.place.shared
    return shared


def _parts(shift: np.ndarray, most: int) -> int:
    """The number of parts of a step that shifts parameters by so many standard errors."""
    worst = float(np.max(np.where(np.isfinite(shift), shift, 0.0), initial=0.0))
    return max(1, min(int(np.ceil(np.sqrt(worst / SHIFT))), most))


def _shift(fit: Fit, place: Estimates, asked: Setting, segment: float | None) -> np.ndarray:
    """The shift of each parameter by the step size, in standard errors: the effect of halving the step, by one
    Gauss–Newton step, over 1 − 2⁻ʳ."""
    fit.settle(place)
    finer = fit.finer(segment, 2)
    finer.settle(place)
    there, here = finer.residual(place), fit.residual(place)
    if there is None or here is None:
        return np.full(len(place.shared), np.nan)
    moved, _, errors = step(fit.jacobian(place, here[1]), there[0] - here[0], fit.own, 0.0)
    share = 1 - 0.5**asked.method.order
    return np.abs(moved) / np.where(errors > 0, errors, np.inf) / share


def _rounds(fit: Fit, place: Estimates, open_: np.ndarray, trips: int, final: bool) -> Fitted:
    """Rounds of least squares, each with the noise found by the previous one; unless it is the `final` attempt, no
    round continues from one that got stuck, whose residuals are not noise."""
    solution, unsettled = None, {}
    for _ in range(ROUNDS):
        fit.settle(place)
        solution = least_squares(fit, place, fit.accepted, blind=fit.blind)
        if solution is None:
            raise ArgumentError(
                "The simulation fails already with the parameters of the system: check axes and units of the "
                "log, start from better ones, or take shorter segments or a smaller `dt`."
            )
        place, trips = solution.place, trips + solution.trips
        if not (solution.converged or final):
            return Fitted(fit, solution, fit.sigma, open_, trips, np.zeros(0), unsettled)
        unsettled = _judge_noise(fit, solution, open_)
        if not unsettled:
            break
    again = fit.residual(place)
    assert again is not None and solution is not None
    J, loss = fit.jacobian(place, again[1]), fit.asked.loss
    J = J if loss is None else np.sqrt(loss.information) * J
    found = solution._replace(residual=again[0], jacobian=J)
    return Fitted(fit, found, fit.sigma, open_, trips, np.zeros(0), unsettled)


def _judge_noise(fit: Fit, solution: Solution, open_: np.ndarray) -> dict[str, float]:
    """Give the fit the noise of a solution: σ, correlation times, process noise. Returns the parts that changed by more
    than SAME and SAME_TIME, with their relative changes."""
    names, sigma, times = fit.shooting.channels.names, fit.sigma, fit.times
    loss, weights = fit.asked.loss, fit.weights
    fit.sigma = np.where(open_, _estimated(solution, fit, fit.own, loss), sigma)
    if loss is not None:
        z = solution.residual[:, : fit.there[0].size].reshape(fit.there.shape) / np.sqrt(weights)
        fit.weights = loss.weight((z * sigma / fit.sigma) ** 2, 1)
    fit.times = _correlation_times(fit, solution.place)
    parts = np.abs(fit.sigma / sigma - 1), np.abs(fit.times - times) / np.maximum(times, 1e-300)
    found = {f"noise of {n}": float(part) for n, part in zip(names, parts[0], strict=True) if part > SAME}
    found |= {
        f"correlation time of {n}": float(part) for n, part in zip(names, parts[1], strict=True) if part > SAME_TIME
    }
    if (moved := float(np.max(np.abs(np.sqrt(fit.weights) - np.sqrt(weights)), initial=0.0))) > SAME_WEIGHT:
        found["weights of the loss"] = moved
    wandered = fit.find_process_noise(solution.place)
    return found | ({"process noise": wandered} if wandered > SAME_TIME else {})


def _correlation_times(fit: Fit, place: Estimates) -> np.ndarray:
    """Correlation times of the channels with coloured noise, s; 0 for the others."""
    times = fit.times.copy()
    found = fit.predict(place) if fit.sensing.coloured else None
    if found is None:
        return times
    off, slopes, d = fit.differences(found, place.shared), fit.slopes(place, found), fit.own
    parts = whitened(slopes, fit.near, times) / fit.sigma
    each = np.einsum("snac,snbc->csab", parts, parts)
    rows = fit.jacobian(place, found)[:, parts.shape[1] * parts.shape[3] :]
    driving = rows.swapaxes(1, 2) @ rows
    shortest = SHORTEST * fit.log.interval
    longest = LONGEST * fit.log.duration / fit.shooting.runs
    J = np.concatenate([parts.swapaxes(2, 3).reshape(fit.shooting.runs, -1, parts.shape[2]), rows], axis=1)
    free = np.maximum(freedom(J, fit.there, d), 1.0)
    for c in fit.sensing.coloured:
        near = Neighbours(fit.near.before[..., c], fit.near.between[..., c])
        one = Channel(off[..., c], slopes[..., c], near, float(free[c]))
        times[c] = correlation_time(one, each.sum(axis=0) - each[c] + driving, d, shortest, longest)
    return times


def _far(fit: Fit, solution: Solution) -> list[str]:
    """The parameters that ran away."""
    pairs = zip(fit.each, solution.place.shared, strict=True)
    return [unknown.label for unknown, x in pairs if abs(x) > FAR]


def lost(fit: Fit, solution: Solution, trips: int) -> str:
    """The error that explains why no estimate was found."""
    doubts = " ".join(fit.log.doubts)
    if far := _far(fit, solution):
        return (
            f"Least squares ran away with {', '.join(far)}: the log hardly excites that, or the search began too far "
            "away, or the log is in other axes or units; leave it at a known value, or start from better ones."
            + (f" {doubts}" if doubts else "")
        )
    said = f"Least squares did not converge in {trips} iterations"
    if bound := fit.sensing.at_bound(fit.split(solution.place.shared)[1]):
        return (
            f"{said}, and the bound longest_delay={fit.sensing.longest:g} s stopped {' and '.join(bound)}: give a "
            "larger one."
        )
    if doubts:
        return f"{said}. {doubts}"
    missed = _missed(fit, solution)
    if (handed := fit.shooting.handed) and not missed:
        names = ", ".join(f"`{name}`" for name in handed)
        return (
            f"{said}: the internal state {names} depends on the motion, so that the effect of a parameter on it is not "
            "followed from one segment into the next; take the log as one run, segment=None or --segment 0."
        )
    if missed:
        as_one_run = ", or, because internal states depend on the motion, segment=None" if handed else ""
        return (
            f"{said}, and the simulation still misses {', '.join(missed)} by far more than the noise between "
            "neighbouring samples: check axes and units of these columns, start from better parameters, or take "
            f"shorter segments{as_one_run}; missing parts of the model, such as a current or a failed thruster, must "
            "be "
            "estimated as well."
        )
    return (
        f"{said}, although the simulation meets every column up to its noise: the log does not separate the "
        "parameters; estimate fewer, or take a log in which commands change more."
    )


def _missed(fit: Fit, solution: Solution) -> list[str]:
    """The columns that the simulation misses by far."""
    r = solution.residual[:, : fit.there[0].size].reshape(fit.there.shape) * fit.sigma
    rms = np.sqrt(np.sum(r**2, axis=(0, 1)) / np.maximum(fit.there.sum(axis=(0, 1)), 1))
    names = fit.shooting.channels.names
    return [f"{n} ({off:.3g})" for n, off in zip(names, rms, strict=True) if off > MISSED * rough_noise(fit.log, n)]


def _estimated(solution: Solution, problem: Fit, d: int, loss: Loss | None = None) -> np.ndarray:
    """σ̂² = Σ r²/(N − degrees of freedom of the fit) of each channel, or the scale of a loss, at least the possible
    round-off."""
    squares = solution.residual[:, : problem.there[0].size].reshape(problem.there.shape) ** 2
    if loss is not None:
        both = (squares / problem.weights).T, problem.weights.T
        squares = loss.scale(*(part.reshape(len(part), -1) for part in both))
    else:
        squares = np.sum(squares, axis=(0, 1))
    size = np.max(np.abs(problem.values), axis=(0, 1), initial=1.0)
    found = problem.sigma * np.sqrt(squares / np.maximum(freedom(solution.jacobian, problem.there, d), 1.0))
    return np.maximum(found, QUIETEST * size)
