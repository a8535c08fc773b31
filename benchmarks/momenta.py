"""Lie–Poisson systems on SO(n) and U(N) by momenta, beside the same steps in NumPy.

Run as: python -m benchmarks.momenta [FAMILY:SIZE …]; it prints the table of processor time a step on one core, with
ℋ = ½ Σ w_i μ_i² by automatic differentiation, ε‖P̃‖ = 0.079, tolerance 1e-14. Of the family `fluid` it prints steps of
co.models.fluids.euler from random vorticity of degrees up to 10, and the same steps by quflow where that is installed,
in turns, each with the largest change of an eigenvalue, relative to the largest one; of `gradient` what the gradient of
a number at the end of such steps takes.
"""

from __future__ import annotations

import argparse
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
FLUIDS = (
    *(f"fluid:{size}" for size in (8, 32, 64, 128, 256, 512)),
    *(f"gradient:{size}" for size in (8, 32, 64, 128, 256)),
)
"""Groups and sizes."""

ALONE = {
    **dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"),
    "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false",
    "PJRT_NPROC": "1",
}
"""One thread each for BLAS, numba and XLA: small operations cost less than their way to another."""


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


def quflow_steps() -> Callable[..., np.ndarray] | None:
    """The isospectral midpoint rule of quflow, isomp_fixedpoint; None where that is not installed.

    It may be installed without ducc0, which its harmonics need and its steps do not.
    """
    if find_spec("quflow") is None:
        return None
    if "ducc0" not in sys.modules and find_spec("ducc0") is None:
        sys.modules["ducc0"] = ModuleType("ducc0")
    return importlib.import_module("quflow.integrators.isospectral").isomp_fixedpoint


def taking_turns(contenders: dict[str, Callable[[int], Any]], steps: int, rounds: int) -> dict[str, list[float]]:
    """Seconds a step of every contender in every round."""
    found: dict[str, list[float]] = {name: [] for name in contenders}
    for _ in range(rounds):
        for name, run in contenders.items():
            found[name].append(seconds_a_step(run, steps))
    return found


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


def fluid_rows(size: int, rounds: int = 2) -> list[str]:
    """The rows of a fluid, of the library and of quflow: tolerance, ms/step, over the library, change of spectrum.

    quflow sums with compensation, to a tolerance of what a step adds to W, its own first, ε_machine h/ħ ‖W‖.
    """
    system, start, h = fluid(size)
    steps, W = max(5000 // size, 10), matrix(system, start.mu)

    def library(count: int) -> np.ndarray:
        method = co.IsospectralMidpoint()
        return matrix(system, co.trajectory(system, start, dt=h, steps=count, save_every=count, method=method).final.mu)

    contenders, integrate = {"1e-14": library}, quflow_steps()
    if integrate is not None:
        norm = float(np.linalg.norm(W, np.inf))
        for name, tolerance in {"its own": "auto", "1e-14 of W": 1e-14 * norm}.items():
            options = {"maxit": 100, "tol": tolerance, "compsum": True}
            contenders[f"quflow, {name}"] = lambda count, options=options: integrate(
                W.copy(), h, steps=count, **options
            )
    times, before = taking_turns(contenders, steps, rounds), spectrum(W)
    rows = []
    for name, run in contenders.items():
        ratio = np.median(np.array(times[name]) / times["1e-14"])
        change = np.max(np.abs(spectrum(run(2 * steps)) - before)) / np.max(np.abs(before))
        rows.append(f"| fluid, N = {size} | {name} | {1e3 * min(times[name]):.3g} | {ratio:.2f} | {change:.1e} |")
    return rows


def gradient_row(size: int) -> str:
    """What a gradient of 5 steps of a fluid takes, over the steps."""
    return f"| fluid, N = {size} | {gradient(*fluid(size), 5):.2g} |"


def _part(text: str) -> str:
    family, _, size = text.partition(":")
    if family not in ("so", "u", "fluid", "gradient") or not size.isdigit():
        raise argparse.ArgumentTypeError(f"must be so, u, fluid or gradient with a size, as fluid:64, but is {text}")
    return text


def main() -> None:
    if any(os.environ.get(name) != value for name, value in ALONE.items()):  # what is read at imports: begin again
        command = [sys.executable, "-m", "benchmarks.momenta", *sys.argv[1:]]
        os.execve(sys.executable, command, {**os.environ, **ALONE})
    parser = argparse.ArgumentParser(prog="python -m benchmarks.momenta", description=(__doc__ or "").split("\n")[0])
    parser.add_argument("parts", nargs="*", metavar="FAMILY:SIZE", type=_part, help=f"by default {' '.join(ALL)} …")
    given = parser.parse_args().parts or [*ALL, *FLUIDS]
    print("| group | ms/step | by NumPy | difference |\n|---|--:|--:|--:|")
    for family, size in (one.split(":") for one in given if not one.startswith(("fluid:", "gradient:"))):
        ours, theirs, apart = row(family, int(size), max(20_000 // int(size), 20))
        print(f"| {family}({size}) | {1e3 * ours:.3g} | {1e3 * theirs:.3g} | {apart:.0e} |", flush=True)
    print("\n| fluid | tolerance | ms/step | relative | spectrum |\n|---|---|--:|--:|--:|")
    for size in (int(one.removeprefix("fluid:")) for one in given if one.startswith("fluid:")):
        print(*fluid_rows(size), sep="\n", flush=True)
    print("\n| fluid | gradient/forward |\n|---|--:|")
    for size in (int(one.removeprefix("gradient:")) for one in given if one.startswith("gradient:")):
        print(gradient_row(size), flush=True)


if __name__ == "__main__":
    main()
