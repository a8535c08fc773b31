"""Writes docs/theorems.md: every theorem, definition and displayed algorithm of both papers, with its residual.

Run as: PYTHONPATH=tests python tests/theory/theorem_table.py
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import NamedTuple

import theorem_residuals as m

PAGE = Path(__file__).parents[2] / "docs" / "theorems.md"


class Row(NamedTuple):
    """A numbered statement: what it says, the functions that compute it, the tests that check it, its residual."""

    number: str
    statement: str
    functions: tuple[str, ...]
    tests: tuple[str, ...]
    residual: Callable[[], float]


MAPS = "difference_maps/test_difference_maps.py::"
CONTINUOUS = "mechanics/test_continuous.py::"
FOUR = "theory/test_equivalences.py::test_the_four_statements_are_one_covector"
RUNS = "theory/test_equations.py::test_the_equations_of_theorems_6_and_7_hold_on_runs_of_every_rule"
GROUP_RUNS = "theory/test_equations.py::test_the_equations_of_both_papers_hold_on_runs_in_group_form"
FAMILY = "theory/test_continuous_equivalence.py::test_the_variation_of_the_action_is_the_euler_poincare_equations"
ALGORITHMS = "theory/test_algorithms.py::"
MISPRINTS = "methods/test_misprints.py::"
SCHEME = MISPRINTS + "test_left_rule_with_velocity_start_is_the_paper_s_scheme"
SEMIDIRECT = "groups/test_semidirect_product.py::"
BUNDLES = "mechanics/test_bundles.py::"
POINCARE = "theory/test_lagrange_poincare.py::"
VEHICLE = "truth/test_paper_run.py::"
ONE_MOTION = ALGORITHMS + "test_unreduced_reduced_and_reconstructed_algorithms_give_one_motion"
POISSON = ALGORITHMS + "test_euler_poincare_poisson_is_the_reduced_algorithm_with_a_parameter"


def rates(index: int) -> Callable[[], float]:
    return lambda: m.continuous_rates()[index]


def bundle(index: int) -> Callable[[], float]:
    return lambda: m.bundle()[index]


P = [
    Row("(P1)–(P2)", "a left-invariant Lagrangian is a function of the body velocity", ("mechanics.system.System",),
        (FAMILY,), m.vehicle_lagrangian),
    Row("(P3)–(P5)", "basic Euler–Poincaré equation μ̇ = ad\\*_ξμ; ad and its dual",
        ("mechanics.continuous.vector_field", "groups.group.LieGroup.ad_dual"),
        (FAMILY, "groups/test_group_axioms.py::test_duals_pair_as_they_must"), m.coadjoint_operator),
    Row("(P6)–(P9)", "Lie–Poisson form, reduced Legendre transform, ∂ℋ/∂μ = ξ",
        ("mechanics.poisson.vector_field", "mechanics.legendre.hamiltonian", "mechanics.continuous.energy"),
        ("mechanics/test_poisson.py::test_the_vector_field_of_the_energy_is_the_motion",
         CONTINUOUS + "test_gradients_of_the_reduced_hamiltonian"), rates(1)),
    Row("[Theorem 1](theorems/euler-poincare.md), (P10)–(P14)", "Euler–Poincaré equations with advected parameters",
        ("mechanics.continuous.vector_field", "spaces.space.Space.diamond"),
        (FAMILY, "spaces/test_actions.py::test_diamond_is_minus_the_transpose_of_the_infinitesimal_action"), m.diamond),
    Row("(P15)–(P19)", "reduction on G × Q with parameters; variations; the infinitesimal action",
        ("mechanics.system.System.state", "spaces.space.Space.infinitesimal", "spaces.space.Space.lifted"),
        (FAMILY, "spaces/test_actions.py::test_infinitesimal_action_is_the_derivative_along_the_exponential"),
        m.diamond),
    Row("(P20)–(P24)", "Euler–Poincaré equations with advected parameters and additional dynamics",
        ("mechanics.continuous.vector_field", "spaces.space.Space.lifted_diamond"),
        (FAMILY, CONTINUOUS + "test_accelerations_move_the_legendre_momenta_as_the_equations_say"), rates(1)),
    Row("[Theorem 2](theorems/kelvin-noether.md), (P25)–(P31)", "Kelvin–Noether: dI/dt = ⟨𝒦, ∂_aℓ⋄a⟩",
        ("mechanics.noether.KelvinNoether", "mechanics.noether.total_momentum"),
        (CONTINUOUS + "test_theorem_2_holds_at_every_state",
         CONTINUOUS + "test_theorem_2_and_energy_along_an_exact_solution"), rates(0)),
    Row("[Definition 3](theorems/difference-maps.md)", "group difference map: τ(0) = e, τ(ξ)⁻¹ = τ(−ξ)",
        ("difference_maps.difference_map.DifferenceMap.tau",
         "difference_maps.difference_map.DifferenceMap.require_fit"),
        (MAPS + "test_a_map_starts_at_the_identity_and_inverts_with_its_argument",), m.difference_map),
    Row("[Definition 4](theorems/difference-maps.md), (P32)–(P33)", "right-trivialised tangent dτ",
        ("difference_maps.difference_map.DifferenceMap.dtau",),
        (MAPS + "test_tangent_is_right_trivialised", MAPS + "test_tangent_intertwines"), m.tangent),
    Row("[Definition 5](theorems/difference-maps.md), (P34)–(P35)", "inverse right-trivialised tangent dτ⁻¹",
        ("difference_maps.difference_map.DifferenceMap.dtau_inverse",),
        (MAPS + "test_inverse_tangent_inverts_the_tangent", MAPS + "test_inverse_tangent_intertwines"),
        m.inverse_tangent),
    Row("(P36)–(P37)", "left-invariant discrete Lagrangian and its reduction",
        ("theory.reduction.reduce", "theory.reduction.invariance_defect", "theory.reduction.unreduce"),
        (ALGORITHMS + "test_a_lagrangian_that_is_not_invariant_is_refused", GROUP_RUNS), partial(m.equation, "P37")),
    Row("(P38)–(P40)", "F = τ(hξ) = g_k⁻¹g_{k+1}, n, s, a", ("theory.reduction.reduced_path",),
        (ALGORITHMS + "test_reduction_and_reconstruction_are_inverse", RUNS),
        partial(m.equation, "P38 F", "P38 s", "P39")),
    Row("(P41)", "reduced discrete action", ("theory.euler_poincare.reduced_action",), (FOUR,), m.equivalence),
    Row("[Theorem 6](theorems/discrete-euler-poincare.md), (P42)–(P44)",
        "discrete Euler–Poincaré equations with parameters and additional dynamics; their algorithm",
        ("theory.euler_poincare.discrete_euler_poincare", "theory.euler_poincare.discrete_euler_poincare_algorithm",
         "methods.GroupVariational"),
        (FOUR, RUNS, ONE_MOTION), partial(m.equation, "P42 μ", "P42 π", "P43", "P44")),
    Row("(P45)", "pointwise diamond", ("spaces.space.Space.diamond",),
        ("spaces/test_actions.py::test_diamond_is_minus_the_transpose_of_the_infinitesimal_action",), m.diamond),
    Row("(P46)", "τ\\*: T\\*_sQ → T\\*_nQ", ("spaces.space.Space.pull",),
        ("spaces/test_actions.py::test_pull_is_dual_to_push",),
        partial(m.equation, "P42 π")),
    Row("(P47)", "hδξ = dτ⁻¹_{−hξ}η⁺ − dτ⁻¹_{hξ}η", ("theory.euler_poincare.induced_variation",), (RUNS, FOUR),
        partial(m.equation, "P47")),
    Row("(P48)–(P49)", "induced variations of n, s, a; the action's derivative",
        ("theory.euler_poincare.induced_variation",), (FOUR,), m.equivalence),
    Row("[Theorem 7](theorems/kelvin-noether.md), (P50)–(P52)", "discrete Kelvin–Noether theorem",
        ("mechanics.noether.KelvinNoether.paper_quantity", "theory.equations.printed_equations"),
        (RUNS, "methods/test_discrete_equations.py::test_balance_of_theorem_7",
         "methods/test_unforced_steps.py::test_paper_quantity_satisfies_its_balance"),
        partial(m.equation, "P50", "P52")),
    Row("(P53)–(P56)", "SO(3), so(3) and ω ↦ ω^×", ("groups.SO3",),
        ("groups/test_group_axioms.py::test_closed_forms_equal_the_derivation_from_matrices",), m.coadjoint_operator),
    Row("(P57)–(P62)", "the vehicle's Lagrangian", ("models.underwater.paper_form.vehicle",),
        ("models/test_catalogue.py::test_the_entry_of_the_papers_vehicle_is_the_paper",
         "truth/test_underwater_forms.py::test_the_general_form_about_the_mass_centre_is_the_papers"),
        m.vehicle_lagrangian),
    Row("(P63)–(P65)", "the vehicle's continuous equations", ("mechanics.continuous.vector_field",),
        (CONTINUOUS + "test_equations_of_the_paper_s_vehicle",), m.vehicle_equations),
    Row("Lemma 8", "u^×v = u × v, u⋄v = u × v", ("spaces.Defining.diamond",),
        ("spaces/test_actions.py::test_diamond_of_vectors_under_rotations_is_the_cross_product",), m.cross_products),
    Row("(P66)–(P72)", "the vehicle's discrete Lagrangian", ("methods.LeftRectangle",), (SCHEME,),
        partial(m.scheme, "cayley")),
    Row("(P73), Remark 9 (P74)", "the vehicle's discrete equations, in s and in ν", ("methods.LeftRectangle",),
        (SCHEME, MISPRINTS + "test_s_as_the_unknown_loses_the_kelvin_noether_quantity_far_from_the_origin"),
        partial(m.scheme, "exponential")),
    Row("(P75)–(P78)", "the vehicle's discrete Kelvin–Noether quantity", ("mechanics.noether.spatial_momentum",),
        (VEHICLE + "test_both_maps_keep_the_kelvin_noether_quantity_the_balance_and_the_group",), m.vehicle),
    Row("(P79)–(P80)", "Cayley transform and (dCay⁻¹)\\*", ("difference_maps.Cayley",),
        (MAPS + "test_closed_form_equals_the_derivation_from_the_map_alone",), m.inverse_tangent),
    Row("(P81), (P88)", "algorithm: the scheme with the Cayley transform", ("methods.LeftRectangle",), (SCHEME,),
        partial(m.scheme, "cayley")),
    Row("Lemma 10, (P82)–(P87)", "identities of ω^× and Ĵ; (P83) with tr", ("groups.SO3.hat",),
        ("theory/test_table.py::test_every_residual_of_the_table_is_round_off",), m.skew_identities),
    Row("(P89)–(P90)", "f(ω) and its derivative, Cayley; 2(Jω)ωᵀ", ("methods.LeftRectangle",),
        (MISPRINTS + "test_jacobian_of_the_cayley_scheme",), partial(m.jacobian, "cayley")),
    Row("(P91)–(P95)", "Rodrigues' formula and (dexp⁻¹)\\*; α at θ = h‖ω‖", ("difference_maps.Exponential",),
        (MAPS + "test_closed_form_equals_the_derivation_from_the_map_alone",
         MISPRINTS + "test_printed_argument_of_alpha_destroys_the_kelvin_noether_quantity"), m.inverse_tangent),
    Row("(P96)–(P97)", "algorithm: the scheme with the exponential", ("methods.LeftRectangle",), (SCHEME,),
        partial(m.scheme, "exponential")),
    Row("(P98)–(P100)", "f(ω) and its derivative, exponential", ("methods.LeftRectangle",),
        (MISPRINTS + "test_jacobian_of_the_exponential_scheme",), partial(m.jacobian, "exponential")),
    Row("Tables 1–2, Figures 1–3", "the run of 500 s", ("report.reproduction.reproduce",),
        ("report/test_reproduction.py::test_the_paper_run_conserves_what_the_paper_says",
         VEHICLE + "test_the_start_is_that_of_table_2"), m.vehicle),
]  # fmt: skip

B = [
    Row("(B1)–(B3)", "semidirect product: multiplication, inverse, bracket", ("groups.SemidirectProduct",),
        (SEMIDIRECT + "test_product_inverse_and_bracket_are_those_of_the_definition",),
        partial(m.semidirect, "product")),
    Row("(B4)–(B6)", "adjoint and coadjoint actions, v⋄a", ("groups.SemidirectProduct",),
        (SEMIDIRECT + "test_adjoint_actions_and_their_duals_are_those_of_the_definition",),
        partial(m.semidirect, "adjoint")),
    Row("(B7)", "action of a discrete Lagrangian on S × S", ("theory.unreduced.action",), (FOUR,), m.equivalence),
    Row("(B8)", "discrete Euler–Lagrange equations", ("theory.unreduced.discrete_euler_lagrange",), (FOUR, GROUP_RUNS),
        partial(m.equation, "B8 g", "B8 q")),
    Row("(B9)–(B12)", "projection onto f, y, u⁺; reduced Lagrangian and action",
        ("theory.semidirect.semidirect_link", "theory.semidirect.semidirect_lagrangian",
         "theory.semidirect.semidirect_system"),
        (ALGORITHMS + "test_the_algorithm_of_the_semidirect_product_is_the_reduced_one",), m.reconstruction),
    Row("[Theorem 3.1](theorems/semidirect-products.md), (B13)",
        "four equivalent statements; discrete Euler–Poincaré equations",
        ("theory.semidirect.discrete_euler_poincare_semidirect",),
        (FOUR, ALGORITHMS + "test_the_algorithm_of_the_semidirect_product_is_the_reduced_one"),
        partial(m.equation, "B13 f", "B13 u")),
    Row("(B14)–(B15)", "induced variations and the derivative of the reduced action",
        ("theory.euler_poincare.induced_variation",), (FOUR,), m.equivalence),
    Row("(B16)", "algorithm: discrete Euler–Lagrange", ("theory.unreduced.discrete_euler_lagrange_algorithm",),
        (ONE_MOTION,), partial(m.equation, "B8 g", "B8 q")),
    Row("after (B16)", "algorithm: discrete Euler–Poincaré", ("theory.semidirect.semidirect_algorithm",),
        (ALGORITHMS + "test_the_algorithm_of_the_semidirect_product_is_the_reduced_one",),
        partial(m.equation, "B13 f", "B13 u")),
    Row("[Theorem 3.2](theorems/semidirect-products.md), (B17)", "reduction and reconstruction are inverse",
        ("theory.reduction.reduced_path", "theory.reduction.reconstruct"),
        (ALGORITHMS + "test_reduction_and_reconstruction_are_inverse", ONE_MOTION), m.reconstruction),
    Row("(B18)", "reduced Lagrangian with a parameter, at the left or the right end",
        ("theory.poisson.PoissonLagrangian", "theory.poisson.poisson_lagrangian", "theory.poisson.poisson_system"),
        (POISSON,), partial(m.equation, "B19")),
    Row("[Theorem 4.1](theorems/euler-poincare-poisson.md), (B19)", "Euler–Poincaré–Poisson equations; their algorithm",
        ("theory.poisson.discrete_euler_poincare_poisson", "theory.poisson.poisson_algorithm"),
        (POISSON, GROUP_RUNS), partial(m.equation, "B19")),
    Row("(B20)", "discrete Euler–Lagrange equations at fixed a₀",
        ("theory.unreduced.discrete_euler_lagrange",), (FOUR,),
        partial(m.equation, "B8 g")),
    Row("(B21)–(B23)", "induced variations; the principle of Lagrange–d'Alembert",
        ("theory.euler_poincare.induced_variation",), (FOUR,), m.equivalence),
    Row("(B24)", "Kelvin–Noether quantity I^B", ("theory.poisson.kelvin_noether_poisson",),
        (ALGORITHMS + "test_discrete_kelvin_noether_theorem_of_euler_poincare_poisson",), partial(m.equation, "B25")),
    Row("[Theorem 5.1](theorems/euler-poincare-poisson.md), (B25)–(B27)", "discrete Kelvin–Noether theorem, I^B = −I",
        ("theory.poisson.kelvin_noether_poisson",),
        (ALGORITHMS + "test_discrete_kelvin_noether_theorem_of_euler_poincare_poisson",), partial(m.equation, "B25")),
    Row("(B28)–(B31)", "discrete connection, its equivariance and local form",
        ("mechanics.discrete_connection.DiscreteConnection",
         "mechanics.discrete_connection.DiscreteConnection.from_form"),
        (BUNDLES + "test_a_discrete_connection_is_equivariant_and_its_global_form_gives_it_back",), bundle(4)),
    Row("(B32)–(B34)", "reduced variable σ and reduced Lagrangian on a principal bundle",
        ("mechanics.bundle.reduced", "theory.lagrange_poincare.ReducedLagrangian"),
        (BUNDLES + "test_sigma_is_e_exactly_on_horizontal_steps",), bundle(2)),
    Row("[Theorem 6.1](theorems/principal-bundles.md), (B35)–(B36)", "discrete equations on a principal bundle",
        ("theory.lagrange_poincare.lagrange_poincare_residual",),
        (POINCARE + "test_the_first_variation_of_the_action_is_the_residual_on_any_sequence",
         POINCARE + "test_the_residual_vanishes_on_the_motion_and_nowhere_near_it"), bundle(1)),
    Row("(B37)", "algorithm: discrete Euler–Lagrange on the bundle",
        ("theory.unreduced.discrete_euler_lagrange_algorithm",),
        (POINCARE + "test_the_reduced_algorithm_gives_the_unreduced_motion_whatever_the_connection",),
        partial(m.equation, "B8 g", "B8 q")),
    Row("after (B37)", "algorithm: discrete Euler–Poincaré on the bundle",
        ("theory.lagrange_poincare.lagrange_poincare",),
        (POINCARE + "test_the_reduced_algorithm_gives_the_unreduced_motion_whatever_the_connection",), bundle(1)),
    Row("[Theorem 6.2](theorems/principal-bundles.md)", "reduction and reconstruction on the bundle",
        ("mechanics.bundle.reduced", "mechanics.bundle.reconstructed"),
        (BUNDLES + "test_reduction_and_reconstruction_are_inverse",), bundle(0)),
    Row("last Remark", "with 𝒜 = e in the section, the equations of the product",
        ("theory.lagrange_poincare.lagrange_poincare_residual",),
        (POINCARE + "test_with_the_trivial_connection_they_are_the_equations_of_the_core",), bundle(3)),
]  # fmt: skip

HEAD = """# Theorems of both papers

A row for every numbered theorem, definition and displayed algorithm of the papers that [errata](errata.md) names, and
for the numbered equations between them. Functions stand under `coadjoint.`, tests under `tests/`.
The residual is that of the corrected statement on random data, relative to the largest term in it; "round-off" is
1e-16 times the number of operations that it takes. Where print and library differ, [errata](errata.md) says why.

This page is written by `PYTHONPATH=tests python tests/theory/theorem_table.py`. A test imports every function, looks
for every test, measures every residual anew and sees that no number is left out.
`coadjoint.theory.printed_equations(run)` measures the discrete equations on a run of your own.
"""


def link(test: str) -> str:
    """A test as its name in words that leads to its file."""
    file, name = test.split("::")
    return f"[{name.removeprefix('test_').replace('_', ' ')}](../tests/{file})"


def table(rows: list[Row]) -> str:
    lines = ["| | Statement | Computed by | Tested by | Residual |", "|---|---|---|---|---|"]
    for row in rows:
        functions, tests = ", ".join(f"`{name}`" for name in row.functions), ", ".join(map(link, row.tests))
        lines.append(f"| {row.number} | {row.statement} | {functions} | {tests} | {row.residual():.0e} |")
    return "\n".join(lines)


def page() -> str:
    titles = "## P: advected parameters and additional dynamics", "## B: semidirect products and principal bundles"
    return "\n\n".join([HEAD.rstrip(), titles[0], table(P), titles[1], table(B)]) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
