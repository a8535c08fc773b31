"""Resolution of a controller's plans and of an estimator's motions by their steps, judged at a sample of calls."""

from __future__ import annotations

import jax
import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.control.linearised import Simulated
from coadjoint.control.transcription import Transcription
from coadjoint.errors import warn
from coadjoint.simulation.accuracy.local_error import InternalPlaces, Numbers, PartsOfSteps, Ruler
from coadjoint.simulation.accuracy.ruler import acting
from coadjoint.simulation.accuracy.verdict import SampledSteps

NODES = 8
"""The number of judged steps of a motion, evenly among all."""


class JudgedMotions:
    """A judge of some motions of a transcription, which warns once.

    A row is (x, u, t) of a node, and its step that of the program, with inputs that are held over it or
    linear, whose last numbers are those a step later.
    """

    def __init__(self, transcription: Transcription, simulated: Simulated):
        self._transcription, self._simulated = transcription, simulated
        self._nx = transcription.sizes[0]
        self._linear = [(one.begin, one.end) for one in transcription.columns if one.begin != one.end]
        parts = PartsOfSteps(self._step, _ruler(transcription), InternalPlaces(), transcription.problem.method.order)
        self._sample: SampledSteps | None = SampledSteps(parts, ())

    def judge(self, t: float, x: np.ndarray, u: np.ndarray, z: np.ndarray, p: np.ndarray) -> None:
        """Judge steps of a motion x (n + 1, nx), u (n, nu), z (n, nz) from t on, if it belongs to the sample.

        p: its parameters.
        """
        sample, self._p, h = self._sample, p, self._transcription.problem.dt
        if sample is None or not len(u) or not sample.parts.ruler.mu:
            return
        due, sample.count = sample.due(), sample.count + 1
        if due:
            some = np.unique(np.linspace(0, len(u) - 1, NODES).astype(int))
            self._z = z[some]
            times = t + h * some[:, None]
            if sentence := sample.judge(np.concatenate([x[some], u[some], times], axis=1), h):
                warn(sentence, stacklevel=3)
            if sentence or sample.over:
                self._sample = None

    def _step(
        self, rows: np.ndarray, h: np.ndarray, steps: int = 1, members: PyTree = None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        after, code = rows.copy(), np.zeros(len(rows), int)
        for i, row in enumerate(rows):
            x, u, z = row[: self._nx], row[self._nx : -1], self._z[min(i, len(self._z) - 1)]
            slope = np.zeros_like(u)
            for begin, end in self._linear:
                slope[begin] = slope[end] = (u[end] - u[begin]) / self._transcription.problem.dt
            for _ in range(steps):
                part = u.copy()
                for begin, end in self._linear:
                    part[end] = u[begin] + h[i] * slope[begin]
                found = self._simulated(x, part, z, self._p, float(h[i]))
                if found is None:
                    code[i] = 1
                    break
                (x, z), u = found, u + h[i] * slope
            after[i, : self._nx], after[i, self._nx : -1], after[i, -1] = x, u, row[-1] + steps * h[i]
        return after, rows, code


def _ruler(transcription: Transcription) -> Ruler:
    """The measured parts of x: the parts of the state all of whose numbers it holds.

    Momenta stand for velocities, which x does not have; the turn of a step is not judged.
    """
    graph, begun, live = transcription.graph, transcription.beginning, transcription.live
    size = len(graph.names())
    at = graph.filled(begun.state, np.arange(size))
    where = {place: k for k, place in enumerate(live)}

    def places(leaf: PyTree) -> Numbers:
        found = [where.get(int(i)) for i in np.ravel(leaf)]
        return () if None in found else tuple(k for k in found if k is not None)

    group, Q, _ = begun.system.places
    named = zip(group.leaf_names, jax.tree.leaves(at.g), strict=True)
    configuration = tuple((name, numbers) for name, leaf in named if (numbers := places(leaf)))
    g = [places(leaf) for leaf in jax.tree.leaves(at.g)]
    n, mu, pi = (places(part) for part in (at.n, at.mu, at.pi))
    points = Q.components(group, "q") if Q.dim(group) and n and all(g) else {}
    momenta = Q.components(group, "pi") if Q.dim(group) and pi else {}

    def positions(rows: np.ndarray) -> np.ndarray:
        leaves = [rows[:, list(one)].reshape(len(rows), *np.shape(leaf))
                  for one, leaf in zip(g, jax.tree.leaves(at.g), strict=True)]  # fmt: skip
        element = jax.tree.unflatten(jax.tree.structure(at.g), leaves)
        return acting(begun.system.places, element, rows[:, list(n)])

    return Ruler(
        time=-1,
        configuration=configuration,
        points=tuple((name, part.start, part.stop) for name, part in points.items()),
        momenta=tuple((name, part.start, part.stop) for name, part in momenta.items()),
        mu=mu,
        pi=pi,
        xi=mu,
        nu=pi,
        q=positions if points else None,
        turning=lambda xi: np.zeros(len(xi)),
    )
