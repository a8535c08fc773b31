"""Semidirect products of a group with a representation of it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Protocol, cast, runtime_checkable

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array
from coadjoint.errors import GroupError, shown
from coadjoint.groups.group import Element, LieGroup, require_group, transpose
from coadjoint.groups.matrix_functions import exponential_minus_one
from coadjoint.groups.power import require_one_matrix
from coadjoint.groups.small_angle import cotangent_ratio, cubic_ratio, versine_ratio
from coadjoint.kernels.trace.evaluate import evaluate


@runtime_checkable
class LinearAction(Protocol):
    """What a semidirect product asks of a representation; every flat space of `coadjoint.spaces` has it."""

    @property
    def flat(self) -> bool: ...

    def require_fit(self, group: LieGroup) -> None: ...

    def ambient(self, group: LieGroup) -> int: ...

    def act(self, group: LieGroup, g: Element, x: Array) -> Array:
        """ρ(g)x, (ambient,), of x (ambient,)."""
        ...

    def pull(self, group: LieGroup, g: Element, x: Array, b: Array) -> Array:
        """g*b, (ambient,), of a covector b (ambient,)."""
        ...

    def infinitesimal(self, group: LieGroup, xi: Array, x: Array) -> Array:
        """ξ·x, (ambient,), of ξ (dim,) and x (ambient,)."""
        ...

    def diamond(self, group: LieGroup, b: Array, x: Array) -> Array:
        """b⋄x, (dim,), of b and x (ambient,)."""
        ...


@dataclass(frozen=True)
class SemidirectProduct(LieGroup):
    """S = G ⋉ V of a group and a representation of it; an element is (g, v), ξ the coordinates (ξ, u) end to end.

        SE3 = SemidirectProduct(SO3(), Defining())

    (g₁, v₁)(g₂, v₂) = (g₁g₂, v₁ + g₁v₂), (g, v)⁻¹ = (g⁻¹, −g⁻¹v), [(ξ, u), (η, w)] = ([ξ, η], ξ·w − η·u) (B1–B3);
    Ad_{(g,v)}(ξ, u) = (Ad_gξ, gu − (Ad_gξ)·v), Ad*_{(g,v)}(μ, β) = (Ad*_g(μ + β⋄v), g*β),
    ad*_{(ξ,u)}(μ, β) = (ad*_ξμ + β⋄u, L*_ξβ) (B4–B6).

    group: G. representation: a flat space with a linear action, such as co.Defining(). Matrices are [[g, v], [0, 1]]
    where the representation is by the matrices of the group themselves, else block-diagonal with those of g and [[ρ(g),
    v], [0, 1]]. Raises GroupError for a space that is curved or whose action is not linear.
    """

    group: LieGroup
    representation: Any

    def __post_init__(self):
        require_group(self.group, "The group of SemidirectProduct")
        require_one_matrix(self.group, "SemidirectProduct")
        V = self.representation
        try:
            acts = isinstance(V, LinearAction) and bool(V.flat) and bool(getattr(V, "affine", True))
        except Exception:  # Of a member that raises where it is only asked for.
            acts = False
        checks.expect(acts, V, "The space of SemidirectProduct", "a representation such as co.Defining()", GroupError)
        V.require_fit(self.group)
        if V.ambient(self.group) == 0:
            raise GroupError(f"SemidirectProduct needs a representation of dimension 1 or more, but got {shown(V)}.")
        origin = _moved(self, np.zeros(V.ambient(self.group)))
        if not np.max(np.abs(origin)) <= 1e-9:
            raise GroupError(
                f"SemidirectProduct needs a linear action, but {V!r} moves the origin by {np.max(np.abs(origin)):.1e}."
            )

    @property
    def dim(self) -> int:
        return self.group.dim + self.representation.ambient(self.group)

    @property
    def basis(self) -> np.ndarray:
        return _basis(self)

    @property
    def leaf_names(self) -> tuple[str, ...]:
        names = self.group.leaf_names
        depth = sum(name == "v" or name.startswith("v_") for name in names)
        return (*names, f"v_{depth + 1}" if depth else "v")

    def split(self, xi: Array) -> tuple[Array, Array]:
        """(ξ, u) or (μ, β) of a vector or covector (dim,)."""
        return xi[: self.group.dim], xi[self.group.dim :]

    def identity(self) -> Element:
        return self.group.identity(), jnp.zeros(self.representation.ambient(self.group))

    def compose(self, g: Element, h: Element) -> Element:
        return self.group.compose(g[0], h[0]), g[1] + self.representation.act(self.group, g[0], h[1])

    def inverse(self, g: Element) -> Element:
        back = self.group.inverse(g[0])
        return back, -self.representation.act(self.group, back, g[1])

    def matrix(self, g: Element) -> Array:
        extra, size = self._extra, self.matrix_size
        corner = self.group.matrix(g[0]) if not extra else _matrix_of_action(self, g[0])
        column = jnp.asarray(g[1])[:, None]
        lower = jnp.concatenate([jnp.concatenate([corner, column], axis=1), jnp.eye(column.shape[0] + 1)[-1:]])
        if not extra:
            return lower
        block = jnp.zeros((size, size)).at[:extra, :extra].set(self.group.matrix(g[0]))
        return block.at[extra:, extra:].set(lower)

    def from_matrix(self, matrix: Array) -> Element:
        extra = self._extra
        corner = matrix[:extra, :extra] if extra else matrix[:-1, :-1]
        return self.group.from_matrix(corner), matrix[extra:-1, -1]

    @property
    def _extra(self) -> int:
        """The size of the diagonal block of g before [[ρ(g), v], [0, 1]]; 0 where ρ(g) is g itself."""
        return 0 if _acts_by_itself(self) else self.group.matrix_size

    def tangent(self, xi: Array) -> Element:
        rotation, velocity = self.split(xi)
        return self.group.tangent(rotation), velocity

    def Ad(self, g: Element, xi: Array) -> Array:
        V, (eta, u) = self.representation, self.split(xi)
        turned = self.group.Ad(g[0], eta)
        shifted = V.act(self.group, g[0], u) - V.infinitesimal(self.group, turned, g[1])
        return jnp.concatenate([turned, shifted])

    def Ad_dual(self, g: Element, mu: Array) -> Array:
        V, (m, beta) = self.representation, self.split(mu)
        carried = self.group.Ad_dual(g[0], m + V.diamond(self.group, beta, g[1]))
        return jnp.concatenate([carried, V.pull(self.group, g[0], g[1], beta)])

    def ad(self, xi: Array, eta: Array) -> Array:
        V, (x, u), (y, w) = self.representation, self.split(xi), self.split(eta)
        moved = V.infinitesimal(self.group, x, w) - V.infinitesimal(self.group, y, u)
        return jnp.concatenate([self.group.ad(x, y), moved])

    def ad_dual(self, xi: Array, mu: Array) -> Array:
        V, (x, u), (m, beta) = self.representation, self.split(xi), self.split(mu)
        turned = self.group.ad_dual(x, m) + V.diamond(self.group, beta, u)
        return jnp.concatenate([turned, self.lifted_dual(x, beta)])

    def lifted_dual(self, xi: Array, beta: Array) -> Array:
        """L*_ξ β ∈ V*, (dim V,), with ⟨L*_ξ β, w⟩ = ⟨β, ξ·w⟩, for ξ (dim G,) of the acting group and β (dim V,)."""
        return transpose(lambda w: self.representation.infinitesimal(self.group, xi, w), beta.shape[0], beta)

    def exp(self, xi: Array) -> Element:
        """(exp ξ, φ(ξ)u) with φ(ξ) = ∫₀¹ exp(sξ) ds on V."""
        x, u = self.split(xi)
        if _turns(self):
            t = cast(Array, self.group.angle_squared(x))
            once = self.representation.infinitesimal(self.group, x, u)
            twice = self.representation.infinitesimal(self.group, x, once)
            return self.group.exp(x), u + versine_ratio(t) * once + cubic_ratio(t) * twice
        return self.group.exp(x), _mean(self, x, u[:, None])[:, 0]

    def _log(self, g: Element) -> Array:
        """(log g, φ(log g)⁻¹ v)."""
        x, v = self.group.log(g[0]), g[1]
        if _turns(self):
            once = self.representation.infinitesimal(self.group, x, v)
            twice = self.representation.infinitesimal(self.group, x, once)
            return jnp.concatenate(
                [x, v - 0.5 * once + cotangent_ratio(cast(Array, self.group.angle_squared(x))) * twice]
            )
        return jnp.concatenate([x, jnp.linalg.solve(_mean(self, x), v)])

    def angle_squared(self, xi: Array) -> Array | None:
        return self.group.angle_squared(self.split(xi)[0]) if _has_one_angle(self) else None

    def rotation_angle(self, xi: Array) -> Array | float:
        return self.group.rotation_angle(self.split(xi)[0])

    @property
    def constrained(self) -> bool:
        return self.group.constrained

    def project(self, g: Element) -> Element:
        return self.group.project(g[0]), g[1]

    def defect(self, g: Element) -> Array:
        return self.group.defect(g[0])

    def outside(self, g: Element) -> Array:
        return self.group.outside(g[0])

    def rotation(self, g: Element) -> Array | None:
        return self.group.rotation(g[0])


def _matrix_of_action(S: SemidirectProduct, g: Element) -> Array:
    """ρ(g) as a matrix."""
    size = S.representation.ambient(S.group)
    return jax.vmap(lambda v: S.representation.act(S.group, g, v), out_axes=1)(jnp.eye(size))


def _matrix_of_algebra(S: SemidirectProduct, xi: Array) -> Array:
    """v ↦ ξ·v as a matrix."""
    size = S.representation.ambient(S.group)
    return jax.vmap(lambda v: S.representation.infinitesimal(S.group, xi, v), out_axes=1)(jnp.eye(size))


def _mean(S: SemidirectProduct, xi: Array, columns: Array | None = None) -> Array:
    """φ(ξ) U with φ(ξ) = ∫₀¹ exp(sξ) ds on V, of columns U (dim V, m), by default 1."""
    X = _matrix_of_algebra(S, xi)
    U = jnp.eye(len(X)) if columns is None else columns
    size = len(X) + U.shape[1]
    slope = jnp.zeros((size, size)).at[: len(X), : len(X)].set(X).at[: len(X), len(X) :].set(U)
    return exponential_minus_one(slope)[: len(X), len(X) :]


def _random(S: SemidirectProduct) -> np.ndarray:
    """Coordinates of the acting group, away from anything special."""
    return np.random.default_rng(1744).normal(scale=0.5, size=S.group.dim)


def _moved(S: SemidirectProduct, v: np.ndarray) -> np.ndarray:
    return evaluate(lambda xi, v: S.representation.act(S.group, S.group.exp(xi), v), _random(S), v)


@lru_cache(maxsize=256)
def _acts_by_itself(S: SemidirectProduct) -> bool:
    """Whether ρ(g) is the matrix of g."""
    if S.representation.ambient(S.group) != S.group.matrix_size:
        return False

    def both(xi: Array):
        g = S.group.exp(xi)
        return _matrix_of_action(S, g), S.group.matrix(g)

    acting, own = evaluate(both, _random(S))
    return bool(np.max(np.abs(acting - own)) <= 1e-12 * np.max(np.abs(own)))


@lru_cache(maxsize=256)
def _basis(S: SemidirectProduct) -> np.ndarray:
    V, group, extra = S.representation.ambient(S.group), S.group, S._extra
    slopes = evaluate(jax.vmap(lambda xi: _matrix_of_algebra(S, xi)), np.eye(group.dim)) if extra else group.basis
    basis = np.zeros((S.dim, extra + V + 1, extra + V + 1))
    basis[: group.dim, :extra, :extra] = group.basis if extra else 0.0
    basis[: group.dim, extra:-1, extra:-1] = slopes
    basis[np.arange(group.dim, S.dim), extra + np.arange(V), -1] = 1.0
    return basis


@lru_cache(maxsize=256)
def _turns(S: SemidirectProduct) -> bool:
    """Whether A³ = −θ²A for A: v ↦ ξ·v, θ² the `angle_squared` of G: the condition of Rodrigues' formula."""
    xi = _random(S)
    t = evaluate(S.group.angle_squared, xi)
    if t is None:
        return False
    A = evaluate(lambda xi: _matrix_of_algebra(S, xi), xi)
    return bool(np.max(np.abs(A @ A @ A + t * A)) <= 1e-12 * max(1.0, np.max(np.abs(A)) ** 3))


@lru_cache(maxsize=256)
def _has_one_angle(S: SemidirectProduct) -> bool:
    """Whether ad²(ad² + θ²)² = 0 for the bracket of S, θ² the `angle_squared` of G."""
    t = evaluate(S.group.angle_squared, _random(S))
    if t is None:
        return False
    xi = np.random.default_rng(1745).normal(scale=0.5, size=S.dim)
    xi[: S.group.dim] = _random(S)
    ad = evaluate(lambda xi: jax.vmap(lambda eta: S.ad(xi, eta), out_axes=1)(jnp.eye(S.dim)), xi)
    turned = ad @ ad + t * np.eye(S.dim)
    return bool(np.max(np.abs(ad @ ad @ turned @ turned)) <= 1e-12 * max(1.0, np.max(np.abs(ad)) ** 6))
