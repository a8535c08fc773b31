"""Casimir functions of a group and its advected parameters: every motion conserves them, whatever ℋ is."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations_with_replacement

import jax
import jax.numpy as jnp
import numpy as np
import scipy.sparse
import scipy.sparse.csgraph

from coadjoint.arrays import Array
from coadjoint.errors import warn
from coadjoint.groups import LieGroup
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.spaces import Space

DEGREE = 4
"""The highest degree of the polynomials that are computed."""

MONOMIALS = 1500
"""More monomials than these are not computed: so(5) with a vector reaches degree 3 or 4."""

KERNEL = 1e-9
"""An eigenvalue up to this fraction of the largest counts as zero."""


@dataclass(frozen=True)
class Casimir:
    """A polynomial C(m, a) with {C, k} = 0 for every k, m = μ − π⋄n: ad*_{∂C/∂m} m = ∂C/∂a⋄a and (∂C/∂m)·a = 0.

    `exponents`: a row of powers of (m, a) for each term; `coefficients`. Called with a state, it is its value there;
    printed, its formula.
    """

    exponents: tuple[tuple[int, ...], ...]
    coefficients: tuple[float, ...]
    dim: int

    def polynomial(self, y: Array) -> Array:
        """C, one number, at y = (m, a), (dim G + dim V*,)."""
        terms = []
        for c, powers in zip(self.coefficients, self.exponents, strict=True):
            term = jnp.asarray(c)
            for i, power in enumerate(powers):
                for _ in range(power):
                    term = term * y[i]
            terms.append(term)
        return sum(terms[1:], terms[0])

    def __call__(self, state: State) -> Array:
        m = state.mu - state.places.additional.diamond(state.places.group, state.pi, state.n)
        return self.polynomial(jnp.concatenate([m, state.a]))

    def __str__(self) -> str:
        def name(i: int) -> str:
            return f"m{i}" if i < self.dim else f"a{i - self.dim}"

        def term(c: float, powers: tuple[int, ...]) -> str:
            factors = [f"{name(i)}^{p}" if p > 1 else name(i) for i, p in enumerate(powers) if p]
            sign = "−" if c < 0 else "+"
            return f"{sign} {'' if abs(c) == 1 else f'{abs(c):.6g} '}{' '.join(factors)}"

        text = " ".join(term(c, p) for c, p in zip(self.coefficients, self.exponents, strict=True))
        return text.removeprefix("+ ")


def casimirs(system: System) -> dict[str, Casimir]:
    """The polynomial Casimir functions of a system; runs of `system.watching(co.mechanics.casimirs(system))` observe
    them.

    system: of it only the group and the advected parameters matter. Returns names and functions of a state, a basis of
    those that generate all others up to degree 4. They are found from the structure constants of 𝔤 and its action on V:
    C is a Casimir where it is constant along m ↦ ad*_ξ m, a ↦ −ξ·a and along m ↦ w⋄a, for every ξ ∈ 𝔤 and w ∈ V.
    Unforced steps move (m, a) by Ad*_F (m + w⋄a), F⁻¹a and so conserve all of them, whatever the step.
    Casimirs other than polynomials of degree ≤ 4 are not found, and a degree with more than 1500 monomials is not
    computed: a warning lists the degrees that are missing for this reason, as the quartic one of so(6), sl(4) and
    sp(6).
    """
    found, stopped = _casimirs(system.group, system.advected)
    if stopped:
        warn(
            f"Casimir functions of degree {stopped} and more were not looked for: {system.group!r} with its advected "
            f"parameters has more independent ones than the {len(found)} found, and too many monomials.",
            stacklevel=2,
        )
    return {f"casimir_{i}": c for i, c in enumerate(found, start=1)}


@lru_cache(maxsize=64)
def _casimirs(group: LieGroup, V: Space) -> tuple[tuple[Casimir, ...], int | None]:
    """The functions, and the degree that was too large to compute while some were still missing."""
    return kept_by(_fields(group, V), group.dim)


def kept_by(fields: np.ndarray, dim: int) -> tuple[tuple[Casimir, ...], int | None]:
    """The polynomials that affine vector fields X_j(y) = A_j (y, 1), (j, size, size + 1), all keep.

    Also the degree that was too large to compute while some were still missing. dim: how many of y are called m.
    """
    size, expected = fields.shape[1], _corank(fields)
    found: list[tuple[np.ndarray, np.ndarray]] = []
    independent, stopped = 0, None
    for degree in range(1, DEGREE + 1):
        monomials = _monomials(size, degree)
        if independent >= expected:
            break
        if len(monomials) > MONOMIALS:
            stopped = degree
            break
        kernel = _invariants(fields, monomials)
        known = _products(found, monomials, degree)
        for row in _echelon(kernel, known):
            found.append((monomials, row))
            independent = _independent(found)
    return tuple(_tidy(monomials, row, dim) for monomials, row in found), stopped


def _fields(group: LieGroup, V: Space) -> np.ndarray:
    """The generators as affine vector fields X_j(y) = A_j (y, 1) on y = (m, a), shape (j, size, size + 1)."""
    dim, room = group.dim, V.ambient(group)

    def generators(y: Array) -> Array:
        m, a = y[:dim], y[dim:]
        turned = jax.vmap(lambda e: jnp.concatenate([group.ad_dual(e, m), -V.infinitesimal(group, e, a)]))(jnp.eye(dim))
        pushed = jax.vmap(lambda w: jnp.concatenate([V.diamond(group, w, a), jnp.zeros(room)]))(jnp.eye(room))
        return jnp.concatenate([turned, pushed])

    nothing = np.zeros(dim + room)
    slope, value = evaluate(lambda y: (jax.jacfwd(generators)(y), generators(y)), nothing)
    return np.concatenate([slope, value[:, :, None]], axis=-1)


def _corank(fields: np.ndarray) -> int:
    """The dimension minus the generic rank of the fields: how many independent Casimir functions there are."""
    y = np.append(np.random.default_rng(3).normal(size=fields.shape[1]), 1.0)
    return fields.shape[1] - int(np.linalg.matrix_rank(fields @ y, tol=1e-9))


def _monomials(size: int, degree: int) -> np.ndarray:
    """The powers of all monomials of degree 1…degree, the later degrees last."""
    if size == 0:
        return np.zeros((0, 0), int)
    return np.array([powers for d in range(1, degree + 1) for powers in _of_degree(size, d)]).reshape(-1, size)


def _of_degree(size: int, degree: int) -> Iterator[np.ndarray]:
    for chosen in combinations_with_replacement(range(size), degree):
        yield np.bincount(chosen, minlength=size)


def _invariants(fields: np.ndarray, monomials: np.ndarray) -> np.ndarray:
    """A basis of the polynomials with X_j C = 0 for every j: the kernel of Σ_j D_jᵀD_j, D_j = X_j on monomials.

    Monomials that no D_jᵀD_j connects belong to different blocks, solved one by one.
    """
    count = len(monomials)
    gram = scipy.sparse.csr_array((count, count))
    for field in fields:
        D = _derivation(field, monomials)
        gram = gram + D.T @ D
    blocks, block_of = scipy.sparse.csgraph.connected_components(gram, directed=False)
    largest = max(float(np.max(np.abs(gram.data), initial=0.0)), 1e-300)
    rows = []
    for block in range(blocks):
        members = np.flatnonzero(block_of == block)
        eigenvalues, vectors = np.linalg.eigh(gram[members][:, members].toarray())
        kernel = vectors[:, eigenvalues <= KERNEL * largest].T
        rows.append(np.zeros((len(kernel), count)))
        rows[-1][:, members] = kernel
    return np.concatenate(rows)


def _derivation(field: np.ndarray, monomials: np.ndarray) -> scipy.sparse.csr_array:
    """y^α ↦ Σ_i α_i y^{α−e_i} X_i(y) as a matrix; its last row is the constant term."""
    count, size = monomials.shape
    digits = np.append((int(monomials.max()) + 1) ** np.arange(size), 0)
    keys = np.append(monomials @ digits[:size], 0)
    order = np.argsort(keys)
    D = scipy.sparse.coo_array((count + 1, count)).tocsr()
    for i, k in np.argwhere(field):
        columns = np.flatnonzero(monomials[:, i])
        targets = order[np.searchsorted(keys, keys[columns] - digits[i] + digits[k], sorter=order)]
        D = D + scipy.sparse.csr_array((monomials[columns, i] * field[i, k], (targets, columns)), shape=D.shape)
    return D


def _products(found: list[tuple[np.ndarray, np.ndarray]], monomials: np.ndarray, degree: int) -> np.ndarray:
    """Products of the Casimirs found so far, up to the degree, as rows over the monomials."""
    index = {tuple(powers): i for i, powers in enumerate(monomials)}
    polynomials = [{tuple(p): c for p, c in zip(powers, row, strict=True) if c} for powers, row in found]
    rows = []
    for count in range(1, degree + 1):
        for chosen in combinations_with_replacement(polynomials, count):
            product: dict[tuple[int, ...], float] = {(0,) * monomials.shape[1]: 1.0}
            for factor in chosen:
                product = _times(product, factor)
            if all(p in index for p in product):
                rows.append(np.zeros(len(monomials)))
                for powers, c in product.items():
                    rows[-1][index[powers]] = c
    return np.array(rows).reshape(-1, len(monomials))


def _times(p: dict[tuple[int, ...], float], q: dict[tuple[int, ...], float]) -> dict[tuple[int, ...], float]:
    found: dict[tuple[int, ...], float] = {}
    for a, x in p.items():
        for b, y in q.items():
            powers = tuple(i + j for i, j in zip(a, b, strict=True))
            found[powers] = found.get(powers, 0.0) + x * y
    return found


def _echelon(kernel: np.ndarray, known: np.ndarray) -> list[np.ndarray]:
    """The rows of the kernel's reduced echelon form that neither the known rows nor those before them span."""
    rows, basis = [], known
    for row in _reduced(kernel):
        longer = np.vstack([basis, row])
        if np.linalg.matrix_rank(longer, tol=1e-7) > np.linalg.matrix_rank(basis, tol=1e-7):
            rows.append(row)
            basis = longer
    return rows


def _reduced(rows: np.ndarray) -> np.ndarray:
    """The reduced echelon form of full-rank rows, by Gauss and Jordan with the largest pivot of a column."""
    rows, i = rows.copy(), 0
    for column in range(rows.shape[1]):
        if i == len(rows):
            break
        pivot = i + int(np.argmax(np.abs(rows[i:, column])))
        if abs(rows[pivot, column]) <= 1e-7:
            continue
        rows[[i, pivot]] = rows[[pivot, i]]
        rows[i] /= rows[i, column]
        others = np.arange(len(rows)) != i
        rows[others] -= np.outer(rows[others, column], rows[i])
        i += 1
    return rows


def _independent(found: list[tuple[np.ndarray, np.ndarray]]) -> int:
    """The rank of the gradients at a random point."""
    y = np.random.default_rng(5).normal(size=found[0][0].shape[1])
    rows = []
    for powers, row in found:
        lowered = (powers[:, None, :] - np.eye(len(y), dtype=int)).clip(0)
        rows.append(row @ (powers * np.prod(y**lowered, axis=2)))
    return int(np.linalg.matrix_rank(np.array(rows), tol=1e-9))


def _tidy(monomials: np.ndarray, row: np.ndarray, dim: int) -> Casimir:
    """The polynomial without round-off in its coefficients: multiples of 1/12 are exact."""
    nearest = np.round(row * 12) / 12
    clean = np.where(np.abs(row - nearest) <= 1e-8, nearest, row)
    kept = np.flatnonzero(clean)
    return Casimir(tuple(tuple(int(p) for p in monomials[i]) for i in kept), tuple(float(clean[i]) for i in kept), dim)
