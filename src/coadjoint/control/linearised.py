"""A transcription as numbers: its steps, costs and constraints with their derivatives, in arrays of NumPy.

CasADi's functions are mapped over the steps and read and written through views of memory, which costs no conversion.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.control.library import casadi
from coadjoint.control.step_functions import StepColumns
from coadjoint.control.transcription import Transcription


class Tables:
    """A function of CasADi of `count` rows of arguments per call, with results (count, rows) or (count, rows, columns).

    Common subexpressions of its results are computed once (`cse`), which halves the operations of derivatives.
    """

    def __init__(self, function: Any, count: int):
        names = function.name_in()
        symbols = [casadi().SX.sym(name, function.size1_in(k)) for k, name in enumerate(names)]
        found = function.call(symbols, True, False)
        function = casadi().Function(function.name(), symbols, found, names, function.name_out(), {"cse": True})
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

    def __call__(self, *arguments: PyTree) -> list[np.ndarray]:
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
    """The steps of N stages linearised: δx_{k+1} = M w + c and δz_k = −(E w + e), of w = (y, v): directions, inputs."""

    M: np.ndarray
    c: np.ndarray
    E: np.ndarray
    e: np.ndarray


class LinearSteps:
    """The steps x_{k+1} = Φ(x, u, z), r(x, u, z) = 0, linearised, without z: r_z δz = −(r + r_w w).

    columns: ∂(x, u)/∂w as a function of CasADi, (x, u, p, h) → (nx + nu, m).
    """

    def __init__(self, transcription: Transcription, count: int, columns: PyTree):
        ca, equations = casadi(), transcription.functions.equations
        x, u, z, p, h = symbols = [ca.SX.sym(key, equations.size1_in(k)) for k, key in enumerate("xuzph")]
        r, after = equations(*symbols)
        both, W = ca.vertcat(x, u), columns(x, u, p, h)
        results = [ca.densify(r), ca.densify(after), ca.jacobian(r, both) @ W, ca.jacobian(r, z)]
        results += [ca.jacobian(after, both) @ W, ca.jacobian(after, z)]
        self._tables = Tables(ca.Function("linear_steps", symbols, results, list("xuzph"), list("abcdef")), count)
        self._shapes = [(count, *result.shape) for result in results]

    def __call__(self, x: np.ndarray, u: np.ndarray, z: np.ndarray, p: np.ndarray, h: float | np.ndarray) -> Steps:
        """The linear steps about N nodes (N, nx), whose c holds Φ alone: take off the next node.

        h: of all steps, or of each, (N, 1).
        """
        results = zip(self._tables(x, u, z, p, h), self._shapes, strict=True)
        r, after, rw, rz, aw, az = (found.reshape(shape) for found, shape in results)
        if not rz.size:
            return Steps(aw, after[:, :, 0], rw, r[:, :, 0])
        eliminated = np.linalg.solve(rz, np.concatenate([rw, r], axis=2))
        through = az @ eliminated
        M, c = aw - through[:, :, :-1], after[:, :, 0] - through[:, :, -1]
        return Steps(M, c, eliminated[:, :, :-1], eliminated[:, :, -1])


class Simulated:
    """One step with Newton's iteration for z, from any node: the prediction of the model."""

    MOST, CLOSE = 30, 1e-11

    def __init__(self, transcription: Transcription):
        equations = transcription.functions.equations
        results = ["residual", "next", "jac:residual:z"]
        self._tables = Tables(equations.factory("simulated", equations.name_in(), results), 1)
        self._nz = transcription.sizes[2]

    def __call__(
        self, x: np.ndarray, u: np.ndarray, z: np.ndarray, p: np.ndarray, h: float
    ) -> tuple[np.ndarray, np.ndarray] | None:
        """(x_{k+1}, z) from a guess of z; None if the iteration does not converge."""
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


def with_hessian(function: Any, name: str, columns: object) -> Any:
    """A number f(x, u, p, h) as a function to f, its gradient by w and Wᵀ f'' W, W = ∂(x, u)/∂w."""
    ca, (x, u, p, h), W = casadi(), *_of_node(function, columns)
    f = ca.densify(function(x, u, p, h))
    hessian, gradient = ca.hessian(f, ca.vertcat(x, u))
    results = [f, ca.densify(W.T @ gradient), W.T @ hessian @ W]
    return ca.Function(name, [x, u, p, h], results, list("xuph"), ["f", "gradient", "hessian"])


def expanded(transcription: Transcription, name: str, columns: object = None) -> Any:
    """`cost` or `final_cost` to second order by w (`with_hessian`); of squares |e|² with 2 JᵀJ of the Jacobian J of e.

    columns: W(x, u, p, h); by default w = (x, u).
    """
    functions, given = transcription.functions, getattr(transcription.problem, name)
    number = functions.cost if name == "cost" else functions.final
    if not hasattr(given, "residual"):
        return with_hessian(number, name, columns)
    ca, graph = casadi(), transcription.graph
    residual = graph.of_motion(given.residual, f"The squares of `{name}`")
    e = with_jacobian(StepColumns(graph, [], transcription.live).of_node("e", residual), name, columns)
    x, u, p, h = (ca.SX.sym(key, e.size1_in(k)) for k, key in enumerate("xuph"))
    value, J = e(x, u, p, h)
    results = [ca.densify(ca.sumsqr(value)), ca.densify(2 * J.T @ value), 2 * J.T @ J]
    return ca.Function(name, [x, u, p, h], results, list("xuph"), ["f", "gradient", "hessian"])


def with_jacobian(function: Any, name: str, columns: object) -> Any:
    """Numbers c(x, u, p, h), or of further arguments, as a function to c and its Jacobian by w."""
    ca, symbols, W = casadi(), *_of_node(function, columns)
    c = ca.densify(function(*symbols))
    results = [c, ca.jacobian(c, ca.vertcat(*symbols[:2])) @ W]
    return ca.Function(name, symbols, results, function.name_in(), ["c", "jacobian"])


def _of_node(function: Any, columns: PyTree) -> tuple[list[PyTree], Any]:
    """Symbols x, u, p, h and further ones of a function, and W."""
    ca = casadi()
    symbols = [ca.SX.sym(key, function.size1_in(k)) for k, key in enumerate(function.name_in())]
    x, u, p, h = symbols[:4]
    return symbols, ca.SX.eye(x.numel() + u.numel()) if columns is None else columns(x, u, p, h)
