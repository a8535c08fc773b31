"""Lie–Poisson systems on SO(n) and U(N) by momenta, beside the same steps in NumPy.

Run as: python -m benchmarks.momenta [FAMILY:SIZE …]; it prints the table of processor time a step on one core, with
ℋ = ½ Σ w_i μ_i² by automatic differentiation, ε‖P̃‖ = 0.079, tolerance 1e-14.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np

import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate

ALL = ("so:20", "so:50", "u:8", "u:32", "u:64", "u:128")
"""Groups and sizes."""


def problem(family: str, size: int) -> tuple[co.System, co.State, float, np.ndarray]:
    """The system, its start, the step, and the weights of ℋ."""
    group = co.SOn(size) if family == "so" else co.Un(size)
    weights = np.linspace(0.5, 1.5, group.dim)
    system = co.System(group, hamiltonian=lambda mu: 0.5 * mu @ (weights * mu))
    mu = np.random.default_rng(size).normal(size=group.dim)
    velocity = evaluate(group.hat, weights * mu)
    return system, system.state(mu=mu), float(0.158 / np.linalg.norm(velocity, 2)), weights


def by_numpy(group: Any, weights: np.ndarray, mu: np.ndarray, h: float, steps: int) -> np.ndarray:
    """The same steps with complex or real matrices and LAPACK: μ after them."""
    real = isinstance(group, co.SOn)

    def matrix(x: np.ndarray) -> np.ndarray:
        if real:
            lower = np.zeros((group.size, group.size))
            lower[below] = x
            return lower - lower.T
        rows = x.reshape(group.size, group.size) * np.sqrt(0.5)
        A, B = np.triu(rows, 1), np.tril(rows, -1)
        return A - A.T + 1j * (B + B.T) + 1j * np.diag(x[:: group.size + 1])

    def coordinates(M: Any) -> np.ndarray:
        if real:
            return M[below]
        rows = np.sqrt(2) * (np.triu(np.real(M), 1) + np.tril(np.imag(M), -1)) + np.diag(np.imag(np.diag(M)))
        return rows.ravel()

    below, one = np.triu_indices(group.size, 1)[::-1], np.eye(group.size)
    W, last = matrix(mu), []
    for _ in range(steps):
        middle = 3 * last[0] - 3 * last[1] + last[2] if len(last) == 3 else W
        for _ in range(100):
            P = -0.5 * h * matrix(weights * coordinates(middle))
            Z = P @ middle
            before, middle = middle, W + Z - np.conj(Z).T + Z @ P
            if np.max(np.abs(middle - before)) <= 1e-14 * np.max(np.abs(middle)):
                break
        P = -0.5 * h * matrix(weights * coordinates(middle))
        C = np.linalg.solve(one - P, one + P)
        W, last = C @ W @ np.conj(C).T, [middle, *last[:2]]
    return coordinates(W)


def seconds_a_step(run: Callable[[int], Any], steps: int) -> float:
    """Processor time a step, of which what a call takes before its first one drops out."""
    took = {}
    for count in (steps, 2 * steps):
        run(count)
        began = time.process_time()
        run(count)
        took[count] = time.process_time() - began
    return (took[2 * steps] - took[steps]) / steps


def row(family: str, size: int, steps: int) -> tuple[float, float, float]:
    """Seconds a step of the library and of NumPy, and the largest difference of their momenta, relative."""
    system, start, h, weights = problem(family, size)
    group: Any = system.group

    def library(count: int) -> np.ndarray:
        options = {"method": co.IsospectralMidpoint(), "save_every": count}
        return co.trajectory(system, start, dt=h, steps=count, **options).final.mu

    def numpy(count: int) -> np.ndarray:
        return by_numpy(group, weights, start.mu, h, count)

    apart = np.max(np.abs(library(steps) - numpy(steps))) / np.max(np.abs(start.mu))
    return seconds_a_step(library, steps), seconds_a_step(numpy, steps), float(apart)


def main() -> None:
    os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false")
    print("| group | ms/step | by NumPy | difference |\n|---|--:|--:|--:|")
    for one in sys.argv[1:] or ALL:
        family, size = one.split(":")
        ours, theirs, apart = row(family, int(size), max(20_000 // int(size), 20))
        print(f"| {family}({size}) | {1e3 * ours:.3g} | {1e3 * theirs:.3g} | {apart:.0e} |", flush=True)


if __name__ == "__main__":
    main()
