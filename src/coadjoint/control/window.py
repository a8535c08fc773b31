"""The steps of a horizon of measurements, their costs and the measurements, expanded about a motion.

By directions y of the nodes and changes δu of the inputs, y_{k+1} = A_k y_k + B_k δu_k + c_k; the Hessians are those of
the costs alone, and of the misfits JᵀJ (Gauss–Newton).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from coadjoint.control.arrival_cost import Arrival, Part, Quadratic, cleaned, least_to, require_finite
from coadjoint.control.library import casadi
from coadjoint.control.linearised import LinearSteps, Steps, Tables, with_hessian, with_jacobian
from coadjoint.control.tangents import Tangents
from coadjoint.control.transcription import Transcription


class HorizonMotion(NamedTuple):
    """Nodes x (n + 1, nx), inputs u (n, nu) and unknowns z (n, nz) of n steps; n may be 0."""

    x: np.ndarray
    u: np.ndarray
    z: np.ndarray

    @property
    def steps(self) -> int:
        """n."""
        return len(self.u)


class SeenAtNode(NamedTuple):
    """The measurements at a node: name → the numbers of its value (size,) and 1/σ (m,), 0 if missing."""

    values: dict[str, np.ndarray]
    weights: dict[str, np.ndarray]


class Expanded(NamedTuple):
    """A horizon about a motion: its steps, the directions T (n + 1, nx, width) and their inverses, the costs of both
    ends of each step and of the measurements at each node, H and g by (y, δu)."""

    steps: Steps
    A: np.ndarray
    B: np.ndarray
    c: np.ndarray
    T: np.ndarray
    inverse: np.ndarray
    begins: list[Quadratic]
    ends: list[Quadratic]
    seen: list[Quadratic]


class Window:
    """A transcription's functions for up to `most` steps. free: the unknown inputs."""

    def __init__(self, transcription: Transcription, most: int, free: np.ndarray):
        functions, problem = transcription.functions, transcription.problem
        self.transcription, self.most, self.free, self.h = transcription, most, free, problem.dt
        self.nx, self.nu, self.nz, count = transcription.sizes
        self.p = transcription.numbers(np.zeros(count))
        self.tangents = Tangents(transcription)
        one = casadi().SX.eye(self.nx + self.nu)
        self._linear = LinearSteps(transcription, most, lambda *_: one)
        self._cost = Tables(with_hessian(functions.cost, "cost", None), 2 * most)
        self._seen = {name: Tables(with_jacobian(f, "seen", None), most + 1) for name, f in functions.measured.items()}

    def padded(self, motion: HorizonMotion) -> HorizonMotion:
        """Padded with the last row, up to the most steps."""
        more = self.most - motion.steps
        u = motion.u if motion.steps else np.zeros((1, self.nu))
        z = motion.z if motion.steps else np.zeros((1, self.nz))
        rows = [np.concatenate([rows, rows[-1:].repeat(n, 0)]) for rows, n in
                ((motion.x, more), (u, self.most - len(u)), (z, self.most - len(z)))]  # fmt: skip
        return HorizonMotion(*rows)

    def expanded(self, motion: HorizonMotion, seen: list[SeenAtNode]) -> Expanded:
        """The horizon about a motion, and the measurements at its nodes."""
        n, p, h = motion.steps, self.p, self.h
        x, u, z = self.padded(motion)
        steps = Steps(*(array[:n] for array in self._linear(x[:-1], u, z, p, h)))
        T, inverse = self.directions(x, u)
        onto, by_state, by_input = inverse[1 : n + 1], steps.M[:, :, : self.nx], steps.M[:, :, self.nx :]
        A = cleaned(onto @ by_state @ T[:n], onto, by_state, T[:n])
        B = cleaned(onto @ by_input, onto, by_input)
        c = (inverse[1 : n + 1] @ (steps.c - x[1 : n + 1])[:, :, None])[:, :, 0]
        _, gradient, hessian = self._cost(np.concatenate([x[:-1], x[1:]]), np.concatenate([u, u]), p, h)
        m = self.nx + self.nu
        H, g = 0.5 * h * hessian.reshape(-1, m, m), 0.5 * h * gradient
        begins = [self._by_directions(T[k], H[k], g[k]) for k in range(n)]
        ends = [self._by_directions(T[k + 1], H[self.most + k], g[self.most + k]) for k in range(n)]
        return Expanded(steps, A, B, c, T[: n + 1], inverse[: n + 1], begins, ends, self._misfits(x, u, T, seen))

    def directions(self, x: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """T and its inverse at nodes x of inputs u, padded."""
        return self.tangents.matrices(x, u, self.transcription.given, self.h)

    def moved(self, motion: HorizonMotion, y: np.ndarray) -> np.ndarray:
        """The nodes after changes y (n + 1, width), on the group."""
        padded, changes = self.padded(motion), np.zeros((self.most + 1, y.shape[1]))
        changes[: len(y)] = y
        return self.tangents.moved_by(padded.x, changes, padded.u, self.transcription.given, self.h)[: len(y)].copy()

    def of_disturbances(self) -> np.ndarray:
        """The Hessian of the cost by the unknown inputs, at the start and their guesses."""
        u = np.zeros(self.nu)
        for one in self.transcription.columns:
            u[one.begin] = np.ravel(one.given.guess)
        x = self.transcription.graph.numbers(self.transcription.beginning.state)
        rows = np.tile(x, (2 * self.most, 1)), np.tile(u, (2 * self.most, 1))
        m, free = self.nx + self.nu, self.nx + self.free
        return self._cost(*rows, self.p, self.h)[2][0].reshape(m, m)[np.ix_(free, free)]

    def _by_directions(self, T: np.ndarray, H: np.ndarray, g: np.ndarray) -> Quadratic:
        """A cost of (x, u) by (y, δu), whose negative curvature is left out."""
        W = np.zeros((self.nx + self.nu, T.shape[1] + self.nu))
        W[: self.nx, : T.shape[1]], W[self.nx :, T.shape[1] :] = T, np.eye(self.nu)
        return Quadratic.of_hessian(W.T @ H @ W, W.T @ g)

    def _misfits(self, x: np.ndarray, u: np.ndarray, T: np.ndarray, seen: list[SeenAtNode]) -> list[Quadratic]:
        width, m = T.shape[2], self.nx + self.nu
        found = [[np.zeros((0, width + self.nu + 1))] for _ in seen]
        at = u[np.clip(np.arange(self.most + 1), 0, max(len(seen) - 2, 0))]
        for name, table in self._seen.items():
            data = self.transcription.data[name]
            y = np.tile(data.space.origin, (self.most + 1, 1))
            for k, one in enumerate(seen):
                y[k] = one.values.get(name, y[k])
            off, jacobian = table(x, at, self.p, self.h, y)
            loss = self.transcription.problem.measured[name].loss
            jacobian = jacobian.reshape(self.most + 1, off.shape[1], m)
            for k, one in enumerate(seen):
                if name not in one.values:
                    continue
                of_x, of_u = jacobian[k, :, : self.nx], jacobian[k, :, self.nx :]
                rows = [cleaned(of_x @ T[k], of_x, T[k]), of_u, off[k][:, None]]
                known = one.weights[name] > 0
                stacked = np.concatenate(rows, axis=1)[known] * one.weights[name][known, None]
                if loss is not None:
                    stacked *= np.sqrt(loss.weight(np.sum(stacked[:, -1] ** 2), data.space.dim))
                found[k].append(stacked)
        joined = [np.concatenate(rows) for rows in found]
        return [Quadratic.of_root(rows[:, :-1], rows[:, -1]) for rows in joined]

    def begun(self, e: Expanded, motion: HorizonMotion, arrival: Arrival, steps: int) -> tuple[np.ndarray, np.ndarray]:
        """y_0 = a + G v at the first node, with v = (θ, δu_0, …) of some steps, of the unknown inputs."""
        E = arrival.inverse @ e.T[0]
        gap = arrival.offset - arrival.inverse @ (motion.x[0] - arrival.node)
        G = np.zeros((E.shape[0], arrival.K.shape[1] + steps * len(self.free)))
        G[:, : arrival.K.shape[1]] = np.linalg.solve(E, arrival.K)
        return np.linalg.solve(E, gap), G

    def joined(
        self, e: Expanded, motion: HorizonMotion, arrival: Arrival, steps: int, last: bool
    ) -> tuple[Quadratic, list]:
        """The cost of v over some steps, and each node's (a, G); last: with the measurements at the last node."""
        a, G = self.begun(e, motion, arrival, steps)
        m, nf, nv = arrival.K.shape[1], len(self.free), G.shape[1]
        parts = [Part(arrival.cost, np.eye(m, nv), np.zeros(m))]
        nodes, U = [(a, G)], np.zeros((self.nu, nv))
        still = np.zeros(self.nu)
        for k in range(steps):
            U = np.zeros((self.nu, nv))
            U[self.free, m + k * nf + np.arange(nf)] = 1.0
            rows, offset = np.concatenate([G, U]), np.concatenate([a, still])
            parts += [Part(e.begins[k], rows, offset), Part(e.seen[k], rows, offset)]
            a, G = e.A[k] @ a + e.c[k], cleaned(e.A[k] @ G, e.A[k], G) + e.B[k] @ U
            parts.append(Part(e.ends[k], np.concatenate([G, U]), np.concatenate([a, still])))
            nodes.append((a, G))
        if last:
            parts.append(Part(e.seen[steps], np.concatenate([G, U]), np.concatenate([a, still])))
        cost = Quadratic.of_parts(nv, parts)
        require_finite(*cost, G)
        return cost, nodes

    def passed_on(self, motion: HorizonMotion, seen: list[SeenAtNode], arrival: Arrival) -> Arrival:
        """The arrival cost of the second node, with the information of the first one, its step and its measurements."""
        motion, seen = HorizonMotion(motion.x[:2], motion.u[:1], motion.z[:1]), seen[:2]
        e = self.expanded(motion, seen)
        cost, nodes = self.joined(e, motion, arrival, 1, False)
        a, G = nodes[1]
        K, left = least_to(cost, G)
        return Arrival(motion.x[1].copy(), e.inverse[1].copy(), a, K, left)
