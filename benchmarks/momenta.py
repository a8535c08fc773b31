"""Lie–Poisson systems on SO(n) and U(N) by momenta, beside the same steps in NumPy.

Run as: python -m benchmarks.momenta [FAMILY:SIZE …]; it prints the table of processor time a step on one core, with
ℋ = ½ Σ w_i μ_i² by automatic differentiation, ε‖P̃‖ = 0.079, tolerance 1e-14. Of the family `fluid` it prints steps of
co.models.fluids.euler from random vorticity of degrees up to 10, with the largest change of an eigenvalue, what a
gradient takes, and the same steps by quflow where that is installed.
"""

from __future__ import annotations

import importlib
import os
import sys
import time
from collections.abc import Callable
from importlib.util import find_spec
from types import ModuleType
from typing import Any

import jax
import numpy as np

import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.models import fluids
from coadjoint.models.fluids.euler import hbar
from coadjoint.models.fluids.laplacian import inverse_laplacian

ALL = ("so:20", "so:50", "u:8", "u:32", "u:64", "u:128")
FLUIDS = tuple(f"fluid:{size}" for size in (8, 32, 64, 128, 256, 512))
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


def fluid(size: int) -> tuple[co.System, co.State, float]:
    """The fluid, its start and the step h = 2ħε."""
    system = fluids.euler(size)
    start = fluids.start(system, fluids.random_vorticity(1, min(10, size - 1)))
    P = matrix(system, evaluate(lambda mu: inverse_laplacian(size, mu), start.mu))
    epsilon = 0.079 / float(np.linalg.norm(P, 2))
    return system, start, 2 * epsilon * hbar(size)


def matrix(system: co.System, mu: np.ndarray) -> np.ndarray:
    """The matrix (N, N) of coordinates on U(N)."""
    group: Any = system.group
    A, B = evaluate(group.parts, mu)
    return np.asarray(A) + 1j * np.asarray(B)


def spectrum(W: np.ndarray) -> np.ndarray:
    """The eigenvalues of −iW, in order."""
    return np.linalg.eigvalsh(-1j * W)


def by_quflow(W: np.ndarray, h: float, steps: int) -> tuple[float, float] | None:
    """Seconds a step of quflow and the largest change of an eigenvalue; None where it is not installed.

    It may be installed without ducc0, which its harmonics need and its steps do not.
    """
    if find_spec("quflow") is None:
        return None
    if find_spec("ducc0") is None:
        sys.modules.setdefault("ducc0", ModuleType("ducc0"))
    integrate = importlib.import_module("quflow.integrators.isospectral").isomp_fixedpoint
    tolerance = 1e-14 * 0.079 * float(np.linalg.norm(W, np.inf))  # its residual is of what a step adds to W

    def run(count: int) -> np.ndarray:
        return integrate(W.copy(), h, steps=count, maxit=100, tol=tolerance, compsum=True)

    change = np.max(np.abs(spectrum(run(steps)) - spectrum(W)))
    return seconds_a_step(run, steps), float(change)


def gradient(system: co.System, start: co.State, h: float, steps: int) -> float:
    """What a gradient takes of the time of the trajectory, in one function of the start, compiled."""

    def value(mu):
        found = co.trajectory(system, start.replace(mu=mu), dt=h, steps=steps, method=co.IsospectralMidpoint())
        return mu @ found.final.mu

    took = []
    with co.float64():
        for function in (jax.jit(value), jax.jit(jax.grad(value))):
            jax.block_until_ready(function(start.mu))
            began = time.process_time()
            jax.block_until_ready(function(start.mu))
            took.append(time.process_time() - began)
    return took[1] / took[0]


def fluid_row(size: int) -> str:
    """The row of a fluid: ms a step, change of the spectrum, gradient over forward, and quflow's ms and spectrum."""
    system, start, h = fluid(size)
    steps = max(5000 // size, 5)

    def library(count: int) -> np.ndarray:
        method = co.IsospectralMidpoint()
        return co.trajectory(system, start, dt=h, steps=count, save_every=count, method=method).final.mu

    W = matrix(system, start.mu)
    change = np.max(np.abs(spectrum(matrix(system, library(steps))) - spectrum(W)))
    theirs = by_quflow(W, h, steps)
    other = "– | –" if theirs is None else f"{1e3 * theirs[0]:.3g} | {theirs[1]:.0e}"
    ratio = gradient(system, start, h, 5) if size <= 256 else np.nan
    return f"| fluid, N = {size} | {1e3 * seconds_a_step(library, steps):.3g} | {change:.0e} | {ratio:.2g} | {other} |"


def main() -> None:
    os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false")
    os.environ.setdefault("PJRT_NPROC", "1")  # one thread: small operations cost less than their way to another
    print("| group | ms/step | by NumPy | difference |\n|---|--:|--:|--:|")
    for one in [given for given in sys.argv[1:] or ALL if not given.startswith("fluid:")]:
        family, size = one.split(":")
        ours, theirs, apart = row(family, int(size), max(20_000 // int(size), 20))
        print(f"| {family}({size}) | {1e3 * ours:.3g} | {1e3 * theirs:.3g} | {apart:.0e} |", flush=True)
    print("\n| fluid | ms/step | spectrum | gradient/forward | by quflow | spectrum |\n|---|--:|--:|--:|--:|--:|")
    for one in [given for given in sys.argv[1:] or FLUIDS if given.startswith("fluid:")]:
        print(fluid_row(int(one.split(":")[1])), flush=True)


if __name__ == "__main__":
    main()
