"""The axioms of a user-defined difference map: Dτ(0) = 1, and closed forms that equal the derivation from τ."""

from __future__ import annotations

from functools import lru_cache

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array
from coadjoint.difference_maps.difference_map import DifferenceMap
from coadjoint.errors import GroupError
from coadjoint.groups.axioms import in_units
from coadjoint.groups.group import LieGroup
from coadjoint.groups.overrides import (
    Identity,
    in_words,
    overrides,
    own,
    parts,
    require_agreement,
    require_given,
    require_hashable,
    stamp,
)
from coadjoint.kernels.trace.evaluate import evaluate


def require_own_map(difference_map: DifferenceMap, group: LieGroup) -> None:
    """Raise GroupError where a map, or a group under it, that does not ship has a wrong form of a member."""
    inner = (*parts(difference_map, DifferenceMap), difference_map)
    if any(own(piece, DifferenceMap) for piece in inner) or any(
        own(p, LieGroup) for p in (*parts(group, LieGroup), group)
    ):
        for piece in inner:
            require_hashable(piece)
            require_map(piece, group, stamp(piece, DifferenceMap), stamp(group, LieGroup))


@lru_cache(maxsize=256)
def require_map(difference_map: DifferenceMap, group: LieGroup, *stamps: object) -> None:
    """Raise GroupError unless τ is a difference map on the group and its own forms equal the derived ones.

    At random ξ inside the chart, relative 1e-9; `stamps` distinguish objects that compare equal.
    """
    if not overrides(difference_map, DifferenceMap, "tau"):
        require_given(difference_map, DifferenceMap, ("_tau",))
    where = f" on {group!r}"
    with in_words(f"`{_given(difference_map, 'tau')}` of {difference_map!r}{where}"):
        DifferenceMap.require_fit(difference_map, group)
    require_agreement(
        difference_map, where, lambda *point: _identities(difference_map, group, *point), _points(difference_map, group)
    )


def _given(difference_map: DifferenceMap, name: str) -> str:
    """Which of a public member and the private one behind it a class gives."""
    return name if overrides(difference_map, DifferenceMap, name) else f"_{name}"


def _points(difference_map: DifferenceMap, group: LieGroup) -> list[tuple[np.ndarray, ...]]:
    """(ξ, χ, μ) with ξ at parts of the way to the end of the chart."""
    random, sizes = np.random.default_rng(1791), group.basis_sizes()
    found = []
    for part in (0.1, 0.3, 0.6):
        xi, chi, mu = random.normal(size=(3, group.dim))
        xi = xi / sizes / np.linalg.norm(xi)
        with in_words(f"`chart` of {difference_map!r}"):
            reach = evaluate(lambda xi: jnp.asarray(difference_map.chart(group, xi), dtype=float), xi)
        if np.shape(reach) != () or not 0 <= reach < np.inf:
            raise GroupError(
                f"`chart` of {difference_map!r} must measure how far ξ lies in its chart, from 0 at ξ = 0 to 1 at the "
                f"boundary, but is {np.asarray(reach).tolist()}."
            )
        found.append((xi * part * min(2.0, 1 / max(float(reach), 1e-300)), chi / sizes, mu * sizes))
    return found


def _identities(tau: DifferenceMap, group: LieGroup, xi: Array, chi: Array, mu: Array) -> list[Identity]:
    def tangent(xi: Array, chi: Array) -> Array:
        return group.vee(DifferenceMap._tangent(tau, group, xi, chi))

    D = jax.vmap(lambda chi: tangent(xi, chi), out_axes=1)(jnp.eye(group.dim))
    vector, zero = in_units(group)[0], jnp.zeros(group.dim)
    forms = [
        *_tangents(tau, group, xi, chi, D),
        *_duals(tau, group, xi, mu, D),
        *(
            Identity(name, "τ⁻¹(τ(ξ)) = ξ", lambda: vector(tau.inverse(group, tau.tau(group, xi))), lambda: vector(xi))
            for name in ("inverse", "_inverse")
        ),
        Identity("chart", "0 at ξ = 0", lambda: 1 + jnp.asarray(tau.chart(group, zero)), lambda: np.ones(())),
    ]
    axioms = [
        *_of_tau(tau, group, xi),
        Identity(_given(tau, "tau"), "Dτ(0) = 1", lambda: vector(tangent(zero, chi)), lambda: vector(chi)),
    ]
    return axioms + [form for form in forms if overrides(tau, DifferenceMap, form.member)]


def _of_tau(tau: DifferenceMap, group: LieGroup, xi: Array) -> list[Identity]:
    """Values of τ."""
    name, zero, one = _given(tau, "tau"), jnp.zeros(group.dim), np.eye(group.matrix_size)
    return [
        Identity(name, "τ(0) = e", lambda: group.matrix(tau.tau(group, zero)), lambda: one),
        Identity(
            name,
            "τ(ξ)τ(−ξ) = e",
            lambda: group.matrix(group.compose(tau.tau(group, xi), tau.tau(group, -xi))),
            lambda: one,
        ),
    ]


def _tangents(tau: DifferenceMap, group: LieGroup, xi: Array, chi: Array, D: Array) -> list[Identity]:
    """Forms of dτ_ξ, whose matrix is D."""
    vector, zero, name = in_units(group)[0], jnp.zeros(group.dim), _given(tau, "dtau")
    return [
        Identity(name, "Dτ(ξ)·χ = (dτ_ξ χ) τ(ξ)", lambda: vector(tau.dtau(group, xi, chi)), lambda: vector(D @ chi)),
        Identity(name, "dτ_0 = 1", lambda: vector(tau.dtau(group, zero, chi)), lambda: vector(chi)),
        Identity(
            "dtau_inverse",
            "dτ_ξ dτ⁻¹_ξ χ = χ",
            lambda: vector(tau.dtau_inverse(group, xi, chi)),
            lambda: vector(jnp.linalg.solve(D, chi)),
        ),
        Identity("_tangent_matrix", "the matrix of dτ_ξ", lambda: tau._tangent_matrix(group, xi), lambda: D),
        Identity(
            "_tangent",
            "Dτ(ξ)·χ τ(ξ)⁻¹",
            lambda: tau._tangent(group, xi, chi),
            lambda: DifferenceMap._tangent(tau, group, xi, chi),
        ),
    ]


def _duals(tau: DifferenceMap, group: LieGroup, xi: Array, mu: Array, D: Array) -> list[Identity]:
    """Forms of the duals of dτ_ξ and dτ⁻¹_ξ."""
    covector, zero, name = in_units(group)[1], jnp.zeros(group.dim), _given(tau, "dtau_inverse_dual")
    return [
        Identity(
            "dtau_dual",
            "⟨dτ*_ξ μ, χ⟩ = ⟨μ, dτ_ξ χ⟩",
            lambda: covector(tau.dtau_dual(group, xi, mu)),
            lambda: covector(D.T @ mu),
        ),
        Identity(
            name,
            "⟨(dτ⁻¹_ξ)*μ, dτ_ξ χ⟩ = ⟨μ, χ⟩",
            lambda: covector(tau.dtau_inverse_dual(group, xi, mu)),
            lambda: covector(jnp.linalg.solve(D.T, mu)),
        ),
        Identity(name, "dτ⁻¹_0 = 1", lambda: covector(tau.dtau_inverse_dual(group, zero, mu)), lambda: covector(mu)),
    ]
