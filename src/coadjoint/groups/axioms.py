"""The axioms of a Lie group, and the equations that its members must satisfy given its basis and its matrices."""

from __future__ import annotations

from functools import lru_cache

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, PyTree
from coadjoint.errors import GroupError
from coadjoint.groups.algebra import require_algebra
from coadjoint.groups.group import Element, LieGroup
from coadjoint.groups.overrides import Identity, in_words, overrides, require_agreement, require_given
from coadjoint.kernels.trace.evaluate import evaluate

GIVEN = ("basis", "identity", "compose", "inverse", "matrix", "from_matrix", "tangent")
_DISTURBED = 1e-4


@lru_cache(maxsize=256)
def require_group(group: LieGroup, stamp: object = None) -> None:
    """Raise GroupError unless the group satisfies the axioms and its own forms equal the derived ones.

    At random ξ, η with |ξ̂| from 0.3 to 1.8, relative 1e-9. `stamp` distinguishes groups that compare equal.
    """
    require_given(group, LieGroup, GIVEN)
    _require_shapes(group)
    require_agreement(group, "", lambda *point: _identities(group, *point), points(group))


def points(group: LieGroup) -> list[tuple[np.ndarray, ...]]:
    """(ξ, η, μ, e^ξ̂, e^η̂, disturbance) at three sizes: ξ̂ and η̂ on both sides of where formulas for small angles end.

    ξ, η, μ: (dim,); the exponentials: (N, N); the disturbance of the entries of an element: (N²,).
    """
    import scipy.linalg  # a tenth of the set-up time

    random, sizes = np.random.default_rng(1874), _sizes(group)
    found = []
    for size in (0.3, 0.9, 1.8):
        xi, eta, mu = random.normal(size=(3, group.dim))
        xi, eta = (x / sizes * size / _norm(group, x / sizes) for x in (xi, eta))
        matrices = (scipy.linalg.expm(np.tensordot(x, group.basis, axes=1)) for x in (xi, eta))
        found.append((xi, eta, mu * sizes, *matrices, random.normal(size=group.matrix_size**2)))
    return found


def in_units(group: LieGroup) -> tuple[PyTree, PyTree]:
    """Vectors and covectors in the unit of the basis: functions of each that make all coordinates count alike."""
    sizes = _sizes(group)
    return (lambda vector: vector * sizes), (lambda covector: covector / sizes)


def _sizes(group: LieGroup) -> np.ndarray:
    sizes = LieGroup.basis_sizes(group)
    return np.where(sizes > 0, sizes, 1.0)


def _norm(group: LieGroup, xi: np.ndarray) -> float:
    return float(np.linalg.norm(np.tensordot(xi, group.basis, axes=1), 2)) if group.dim else 1.0


def _require_shapes(group: LieGroup) -> None:
    """Raise GroupError unless the basis spans an algebra and names and sizes fit it."""
    kind = type(group).__name__
    with in_words(f"`basis` of {kind}"):
        basis = np.asarray(group.basis)
    if basis.dtype.kind not in "fiu":
        raise GroupError(f"The basis of {kind} must be real matrices, shape (dim, N, N), but is of {basis.dtype}.")
    require_algebra(basis, kind)
    if (group.dim, group.matrix_size) != basis.shape[:2]:
        raise GroupError(
            f"{kind} must have dim and matrix_size {basis.shape[:2]} as its basis has, but has "
            f"{(group.dim, group.matrix_size)}."
        )
    with in_words(f"`identity` of {kind}"):
        leaves = jax.tree.leaves(evaluate(group.identity))
    if len(group.leaf_names) != len(leaves) or not all(isinstance(name, str) for name in group.leaf_names):
        raise GroupError(
            f"{kind} must name the {len(leaves)} arrays of an element in `leaf_names`, but names {group.leaf_names!r}."
        )


def _identities(group: LieGroup, xi: Array, eta: Array, mu: Array, M: Array, N: Array, noise: Array) -> list[Identity]:
    X, g, h = LieGroup.hat(group, xi), group.from_matrix(M), group.from_matrix(N)
    e, matrix, one = group.identity(), group.matrix, np.eye(group.matrix_size)
    sizes = _sizes(group)
    axioms = [
        Identity("matrix` and `from_matrix", "matrix(from_matrix(M)) = M at M = e^ξ̂", lambda: matrix(g), lambda: M),
        Identity("hat", "ξ̂ = Σ ξ_k e_k", lambda: group.hat(xi), lambda: X),
        Identity("vee", "(ξ̂)ᵛ = ξ", lambda: group.vee(X) * sizes, lambda: xi * sizes),
        Identity("identity", "matrix(identity()) = 1", lambda: matrix(e), lambda: one),
        Identity("identity", "identity() = from_matrix(1)", lambda: e, lambda: group.from_matrix(one)),
        Identity("compose", "matrix(gh) = matrix(g) matrix(h)", lambda: matrix(group.compose(g, h)), lambda: M @ N),
        Identity("compose", "ge = g", lambda: group.compose(g, e), lambda: g),
        Identity("inverse", "matrix(g⁻¹) = matrix(g)⁻¹", lambda: matrix(group.inverse(g)), lambda: jnp.linalg.inv(M)),
        Identity(
            "tangent",
            "D matrix(e)·tangent(ξ) = Σ ξ_k e_k",
            lambda: jax.jvp(matrix, (e,), (group.tangent(xi),))[1],
            lambda: X,
        ),
    ]
    return axioms + _closed_forms(group, xi, eta, mu, M, h) + _of_elements(group, xi, g, h, noise)


def _closed_forms(group: LieGroup, xi: Array, eta: Array, mu: Array, M: Array, g: Element) -> list[Identity]:
    """What the base derives from basis and matrices."""
    vector, covector = in_units(group)
    derived = LieGroup
    every = [
        Identity("exp", "matrix(exp ξ) = e^ξ̂", lambda: group.matrix(group.exp(xi)), lambda: M),
        *(
            Identity(name, "log(exp ξ) = ξ", lambda: vector(group.log(group.exp(xi))), lambda: vector(xi))
            for name in ("log", "_log")
        ),
        Identity(
            "Ad", "Ad_g ξ = (g ξ̂ g⁻¹)ᵛ", lambda: vector(group.Ad(g, xi)), lambda: vector(derived.Ad(group, g, xi))
        ),
        Identity(
            "Ad_dual",
            "⟨Ad*_g μ, ξ⟩ = ⟨μ, Ad_g ξ⟩",
            lambda: covector(group.Ad_dual(g, mu)),
            lambda: covector(derived.Ad_dual(group, g, mu)),
        ),
        Identity(
            "ad",
            "ad_ξ η = (ξ̂η̂ − η̂ξ̂)ᵛ",
            lambda: vector(group.ad(xi, eta)),
            lambda: vector(derived.ad(group, xi, eta)),
        ),
        Identity(
            "ad_dual",
            "⟨ad*_ξ μ, η⟩ = ⟨μ, ad_ξ η⟩",
            lambda: covector(group.ad_dual(xi, mu)),
            lambda: covector(derived.ad_dual(group, xi, mu)),
        ),
        Identity(
            "basis_sizes",
            "that they are the largest entries of the matrices of the basis",
            group.basis_sizes,
            lambda: derived.basis_sizes(group),
        ),
        Identity("view", "that it has the numbers of ξ in their order", lambda: jnp.ravel(group.view(xi)), lambda: xi),
        Identity(
            "rotation_angle",
            "that the angle of ξ is twice that of ξ/2",
            lambda: jnp.asarray(group.rotation_angle(xi)),
            lambda: 2 * jnp.abs(jnp.asarray(group.rotation_angle(0.5 * xi))),
        ),
    ]
    if overrides(group, LieGroup, "angle_squared") and group.angle_squared(xi) is not None:
        says = "ad²(ad² + θ²)² = 0 and tr ad² = −2kθ² with an integer k, for ad = ad_ξ of unit size"
        every.append(Identity("angle_squared", says, lambda: _spectrum(group, xi), lambda: np.ones(group.dim**2 + 1)))
    return [identity for identity in every if overrides(group, LieGroup, identity.member)]


def _spectrum(group: LieGroup, xi: Array) -> Array:
    """1 + A²(A² + θ²)² and 1 + tr A² + 2kθ², for A = ad_ξ in the unit of A; the trace determines θ² to first order."""
    vector, _ = in_units(group)
    units = jnp.eye(group.dim) / vector(jnp.ones(group.dim))
    A = jax.vmap(lambda chi: vector(LieGroup.ad(group, xi, chi)), out_axes=1)(units)
    size = jnp.sqrt(jnp.sum(A * A))
    size = jnp.where(size > 0, size, 1.0)
    A, t = A / size, jnp.asarray(group.angle_squared(xi)) / size**2
    turned, trace = A @ A + t * jnp.eye(group.dim), jnp.trace(A @ A)
    count = jnp.round(-trace / jnp.where(t > 0, 2 * t, 1.0))
    return 1 + jnp.concatenate([jnp.ravel(A @ A @ turned @ turned), (trace + 2 * count * t)[None]])


def _of_elements(group: LieGroup, xi: Array, g: Element, h: Element, noise: Array) -> list[Identity]:
    """Projection, defect and attitude."""
    found = []
    if overrides(group, LieGroup, "rotation") and group.rotation(g) is not None:

        def R(k: Element) -> Array:
            return jnp.asarray(group.rotation(k))

        says = "R(gh) = R(g)R(h) and RᵀR = 1"
        both = Identity(
            "rotation", says, lambda: (R(group.compose(g, h)), R(g).T @ R(g)), lambda: (R(g) @ R(h), np.eye(3))
        )
        found.append(both)
    zero = {
        name: Identity(name, f"{name}(g) = 0", lambda n=name: 1 + getattr(group, n)(g), lambda: jnp.ones(()))
        for name in ("defect", "outside")
    }
    if not group.constrained:
        return [*found, zero["outside"]]

    def left() -> Array:
        ends = np.cumsum([0, *(leaf.size for leaf in jax.tree.leaves(g))])
        leaves, structure = jax.tree.flatten(g)
        moved = [
            x + _DISTURBED * jnp.resize(noise, (ends[-1],))[a:b].reshape(x.shape)
            for x, a, b in zip(leaves, ends[:-1], ends[1:], strict=True)
        ]
        disturbed = jax.tree.unflatten(structure, moved)
        before, after = group.defect(disturbed), group.defect(group.project(disturbed))
        return 1 + jnp.maximum(after - 0.01 * before, 0.0)

    return [
        *found,
        *zero.values(),
        Identity("project", "project(g) = g on the group", lambda: group.project(g), lambda: g),
        Identity("project", "that it removes 99 % of a defect of 1e-4", left, lambda: jnp.ones(())),
    ]
