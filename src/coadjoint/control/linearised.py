"""A transcription as numbers: its steps, costs and constraints with their derivatives, in arrays of NumPy.

CasADi's functions are mapped over the steps and read and written through views of memory, which costs no conversion.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from coadjoint.control.library import casadi
from coadjoint.control.transcription import Transcription, functions_of


class Tables:
    """A function of CasADi of `count` rows of arguments at once, with results (count, rows) or (count, rows, columns).

    results: names as CasADi's `factory` takes them, where "jac:next:x" is a Jacobian; by default the function's own.
    """

    def __init__(self, function: Any, count: int, results: list[str] | None = None):
        names = function.name_in()
        if results is not None:
            function = function.factory(f"{function.name()}_tables", names, results)
        self.names, self.count = names, count
        sparsities = [function.sparsity_out(k) for k in range(function.n_out())]
        mapped = function.map(count) if count > 1 else function
        self._buffer, self._evaluate = mapped.buffer()
        self._arguments = [np.zeros((count, function.size1_in(k))) for k in range(function.n_in())]
        self._results = [np.zeros((count, sparsity.nnz())) for sparsity in sparsities]
        self._places = [_places(sparsity) for sparsity in sparsities]
        self._dense = [np.zeros((count, *_shape(sparsity))) for sparsity in sparsities]
        for k, array in enumerate(self._arguments):
            if array.size:
                self._buffer.set_arg(k, view(array))
        for k, array in enumerate(self._results):
            if array.size:
                self._buffer.set_res(k, view(array))

    def __call__(self, *arguments: Any) -> list[np.ndarray]:
        """The results, which the next call overwrites."""
        for array, value in zip(self._arguments, arguments, strict=True):
            array[:] = value
        self._evaluate()
        for dense, places, found in zip(self._dense, self._places, self._results, strict=True):
            dense.reshape(self.count, -1)[:, places] = found
        return self._dense


def view(array: np.ndarray) -> memoryview:
    """The memory of a contiguous array, which CasADi reads and writes."""
    return array.reshape(-1).data


def _shape(sparsity: Any) -> tuple[int, ...]:
    return (sparsity.size1(),) if sparsity.size2() == 1 else (sparsity.size1(), sparsity.size2())


def _places(sparsity: Any) -> np.ndarray:
    rows, columns = np.array(sparsity.row(), int), np.array(sparsity.get_col(), int)
    return rows * sparsity.size2() + columns


class Steps(NamedTuple):
    """δx_{k+1} = A δx_k + B δu_k + c of N steps, and δz_k = −(E δx_k + F δu_k + e)."""

    A: np.ndarray
    B: np.ndarray
    c: np.ndarray
    E: np.ndarray
    F: np.ndarray
    e: np.ndarray


class LinearSteps:
    """The steps x_{k+1} = Φ(x, u, z), r(x, u, z) = 0, linearised, without z: r_z δz = −(r + r_x δx + r_u δu)."""

    def __init__(self, transcription: Transcription, count: int):
        equations = transcription.functions.equations
        jacobians = [f"jac:{of}:{by}" for of in ("residual", "next") for by in "xuz"]
        self._tables = Tables(equations, count, ["residual", "next", *jacobians])
        self._sizes, self._count = transcription.sizes, count

    def __call__(
        self, x: np.ndarray, u: np.ndarray, z: np.ndarray, p: np.ndarray, h: float
    ) -> tuple[np.ndarray, Steps]:
        """Φ at N nodes (N, nx), and the linear steps, whose c holds Φ alone: take off the next node."""
        nx, nu, nz, _ = self._sizes
        found = self._tables(x, u, z, p, h)
        r, after, (rx, ru, rz, ax, au, az) = found[0], found[1], (self._matrix(k, found) for k in range(2, 8))
        if not nz:
            none = np.zeros((self._count, 0, 1))
            return after, Steps(ax, au, after, none.repeat(nx, 2), none.repeat(nu, 2), none[..., 0])
        together = np.concatenate([rx, ru, r[:, :, None]], axis=2)
        eliminated = np.linalg.solve(rz, together)
        through = az @ eliminated
        A, B, c = ax - through[:, :, :nx], au - through[:, :, nx:-1], after - through[:, :, -1]
        return after, Steps(A, B, c, eliminated[:, :, :nx], eliminated[:, :, nx:-1], eliminated[:, :, -1])

    def _matrix(self, k: int, found: list[np.ndarray]) -> np.ndarray:
        """The k-th result with both axes, one of which has length 1 or 0 at times."""
        nx, nu, nz, _ = self._sizes
        rows, columns = (nz, nx)[(k - 2) // 3], (nx, nu, nz)[(k - 2) % 3]
        return found[k].reshape(self._count, rows, columns)


class Simulated:
    """One step with Newton's iteration for z, from any node: where the model goes."""

    MOST, CLOSE = 30, 1e-11

    def __init__(self, transcription: Transcription):
        functions = transcription.functions.equations
        self._tables = Tables(functions, 1, ["residual", "next", "jac:residual:z"])
        self._nz = transcription.sizes[2]

    def __call__(
        self, x: np.ndarray, u: np.ndarray, z: np.ndarray, p: np.ndarray, h: float
    ) -> tuple[np.ndarray, np.ndarray] | None:
        """(x_{k+1}, z) from a guess of z; None where the iteration does not converge."""
        for _ in range(self.MOST):
            r, after, jacobian = self._tables(x, u, z, p, h)
            if not (np.all(np.isfinite(after)) and np.all(np.isfinite(r))):
                return None
            if not self._nz:
                return after[0].copy(), z
            try:
                change = np.linalg.solve(jacobian.reshape(self._nz, self._nz), r[0])
            except np.linalg.LinAlgError:
                return None
            if np.max(np.abs(change)) <= self.CLOSE * (1.0 + np.max(np.abs(z))):
                return after[0].copy(), z
            z = z - change
        return None


def with_hessian(function: Any, name: str) -> Any:
    """A number f(x, u, p, h) as a function to f, its gradient and its Hessian by (x, u)."""
    ca = casadi()
    x, u, p, h = (ca.SX.sym(key, function.size1_in(k)) for k, key in enumerate("xuph"))
    both = ca.vertcat(x, u)
    f = ca.densify(function(x, u, p, h))
    hessian, gradient = ca.hessian(f, both)
    return ca.Function(name, [x, u, p, h], [f, gradient, hessian], list("xuph"), ["f", "gradient", "hessian"])


def expanded(transcription: Transcription, name: str) -> Any:
    """`cost` or `final_cost` to second order; of squares |e|² the Hessian is 2 JᵀJ with the Jacobian J of e."""
    functions, given = transcription.functions, getattr(transcription.problem, name)
    whole = functions.cost if name == "cost" else functions.final
    if not hasattr(given, "residual"):
        return with_hessian(whole, name)
    ca, graph = casadi(), transcription.graph
    residual = graph.of_motion(given.residual, f"The squares of `{name}`")
    e = with_jacobian(functions_of(graph, [], transcription.live, residual, [], [], [], [], {}).cost, name)
    x, u, p, h = (ca.SX.sym(key, e.size1_in(k)) for k, key in enumerate("xuph"))
    value, J = e(x, u, p, h)
    results = [ca.densify(ca.sumsqr(value)), ca.densify(2 * J.T @ value), 2 * J.T @ J]
    return ca.Function(name, [x, u, p, h], results, list("xuph"), ["f", "gradient", "hessian"])


def with_jacobian(function: Any, name: str) -> Any:
    """Numbers c(x, u, p, h) as a function to c and its Jacobian by (x, u)."""
    ca = casadi()
    x, u, p, h = (ca.SX.sym(key, function.size1_in(k)) for k, key in enumerate("xuph"))
    c = ca.densify(function(x, u, p, h))
    return ca.Function(name, [x, u, p, h], [c, ca.jacobian(c, ca.vertcat(x, u))], list("xuph"), ["c", "jacobian"])
