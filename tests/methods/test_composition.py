"""Compositions: the order is that of the conditions on the coefficients; adjoints undo steps; refusals."""

from __future__ import annotations

import jax
import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.methods import order_conditions
from coadjoint.methods.order_conditions import composed_order
from stepping import Stepper
from systems import MAPS, RULES, random_system

SCHEMES = {
    co.Suzuki4: (4, 5),
    co.methods.Yoshida4: (4, 3),
    co.methods.KahanLi6: (6, 9),
    co.methods.SofroniouSpaletta6: (6, 13),
    co.methods.KahanLi8: (8, 17),
    co.methods.SofroniouSpaletta8: (8, 21),
    co.methods.SofroniouSpaletta10: (10, 35),
}


@pytest.mark.parametrize("scheme", SCHEMES, ids=lambda scheme: scheme.__name__)
def test_published_coefficients_meet_the_conditions_of_their_order(scheme):
    method = scheme(co.Midpoint())
    assert (method.order, len(method.substeps)) == SCHEMES[scheme]
    assert sum(method.substeps) == pytest.approx(1, abs=1e-14)


@pytest.mark.parametrize("scheme", SCHEMES, ids=lambda scheme: scheme.__name__)
@pytest.mark.parametrize("place", [0, 1])
def test_a_wrong_ninth_digit_of_a_coefficient_costs_the_order(scheme, place):
    gamma = list(scheme(co.Midpoint()).substeps)
    place = min(place, len(gamma) // 2 - 1)
    for i, sign in ((place, 1), (-1 - place, 1), (len(gamma) // 2, -2)):
        gamma[i] += sign * 1e-9
    assert composed_order(tuple(gamma), 2) == 2


@pytest.mark.parametrize("scheme", SCHEMES, ids=lambda scheme: scheme.__name__)
def test_all_sixteen_digits_of_published_coefficients_meet_the_conditions(scheme):
    """The conditions to round-off: one coefficient off by 1e-10 leaves 2e-14 at order 10, and 1e-10 below."""
    method = scheme(co.Midpoint())
    words = [word for degree in range(3, method.order, 2) for word in order_conditions._words(degree, 2)]
    assert max(order_conditions._error(word, method.substeps) for word in words) < 1e-15


def matrix_order(coefficients, base):
    """The order measured with exp(hA + h^{p+1}B + h^{p+3}C) of random matrices."""
    random = np.random.default_rng(20261121)
    letters = [random.normal(size=(4, 4)) / 2 for _ in range(3)]

    def step(h):
        import scipy.linalg

        powers = (1, base + 1, base + 3)
        return scipy.linalg.expm(sum(np.sign(h) ** k * abs(h) ** k * X for k, X in zip(powers, letters, strict=True)))

    def error(h):
        import scipy.linalg

        product = np.eye(4)
        for gamma in coefficients:
            product = product @ step(gamma * h)
        return np.max(np.abs(product - scipy.linalg.expm(h * letters[0])))

    return np.log2(error(0.2) / error(0.1)) - 1


@pytest.mark.parametrize("base", [2, 4])
def test_the_order_found_is_the_order_of_matrix_exponentials(base):
    """Triple jumps of every kind, and the scheme's own order where the base's error terms do not commute."""
    for power in (3, 5):
        gamma = 1 / (2 - 2 ** (1 / power))
        coefficients = (gamma, 1 - 2 * gamma, gamma)
        assert matrix_order(coefficients, base) == pytest.approx(composed_order(coefficients, base), abs=0.35)
    assert matrix_order((0.5, 0.5), base) == pytest.approx(composed_order((0.5, 0.5), base), abs=0.35)
    kahan_li = co.methods.KahanLi6(co.Midpoint()).substeps
    assert matrix_order(kahan_li, 2) == pytest.approx(6, abs=0.35)


def test_a_composition_of_a_composition_has_the_product_of_the_substeps():
    inner = co.Suzuki4(co.methods.LeftRight())
    gamma = 1 / (2 - 2 ** (1 / 5))
    outer = co.methods.Composition(inner, (gamma, 1 - 2 * gamma, gamma), order=6)
    assert (outer.order, len(outer.substeps), len(outer.stages)) == (6, 15, 30)
    assert sum(fraction for _, fraction in outer.stages) == pytest.approx(1)


def difference(system, one, other):
    """Of two states, the largest, relative to 1 + the size."""
    parts = [(evaluate(system.group.matrix, one.g), evaluate(system.group.matrix, other.g))]
    parts += [(getattr(one, name), getattr(other, name)) for name in ("n", "a", "mu", "pi", "t")]
    return max(np.max(np.abs(x - y), initial=0.0) / (1 + np.max(np.abs(y), initial=0.0)) for x, y in parts)


def with_left_rectangle(system):
    """The system with the left rectangle as a discrete Lagrangian."""
    Q = system.additional

    def discrete(xi, *rest, t):
        *rest, h = rest
        if Q.ambient(system.group):
            n, s, *rest = rest
            rest = [n, (s - n) / h, *rest]
        return h * system.lagrangian(xi, *rest, t=t)

    return co.System(
        system.group, discrete_lagrangian=discrete, additional=Q, advected=system.advected,
        parameters=system.parameters, forces=system.forces,
    )  # fmt: skip


ADJOINTS = [
    ("SO3 on a sphere", "cayley", "left", True, False),
    ("SE3", "exponential", "right", True, False),
    ("SE2", "bent", "left", True, False),
    ("SO3 on a sphere", "exponential", "left", True, True),
    ("SL2", "cayley", "left", False, True),
    ("R3", "exponential", "left", True, True),
]


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize(("world", "tau", "rule", "forced", "given"), ADJOINTS)
def test_the_adjoint_undoes_a_step_backwards(world, tau, rule, forced, given):
    """Φ*_h ∘ Φ₋ₕ = id, with forces too; `given`: of a discrete Lagrangian."""
    system, start = random_system(world, forced)
    method = RULES[rule](MAPS[tau])
    if given:
        system, method = with_left_rectangle(system), co.Variational(MAPS[tau])
        start = start.replace(from_velocities=False)
    state = method.begin(system, start, -0.1)
    there = Stepper(system, method).leaps(state, -0.1)[-1].after
    back = Stepper(system, method.adjoint).leaps(there, 0.1)[-1].after
    assert difference(system, back, state) < 1e-12
    assert method.adjoint.adjoint == method


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("name", ["SO3", "SE2"])
def test_the_adjoint_of_the_left_rule_given_as_a_discrete_lagrangian_is_the_right_rule(name):
    system, start = random_system(name, True)
    start = start.replace(from_velocities=False)
    (ours,) = Stepper(with_left_rectangle(system), co.methods.AdjointVariational(co.Cayley())).run(start, 0.1, 1)
    (theirs,) = Stepper(system, co.RightRectangle(co.Cayley())).run(start, 0.1, 1)
    assert difference(system, ours.after, theirs.after) < 1e-12
    values = [
        evaluate(lambda record, h, step=leap.step, own=own: step.discrete_lagrangian(own, record, h), leap.record, 0.1)
        for leap, own in ((ours, with_left_rectangle(system)), (theirs, system))
    ]
    assert values[0] == pytest.approx(values[1], rel=1e-13)


def test_symmetrised_right_rectangle_is_the_left_right_pair():
    assert co.methods.Symmetrised(co.RightRectangle(co.Cayley())).stages == co.methods.LeftRight(co.Cayley()).stages
    assert co.methods.Symmetrised(co.Variational()).order == 2
    assert co.methods.Symmetrised(co.Midpoint()).order == 2


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("backend", ["native", pytest.param("xla", marks=pytest.mark.long)])
def test_a_composed_run_keeps_momentum_and_its_order_of_energy(backend):
    """The vehicle over 20 s; twice the steps bring the energy error down by 2⁶."""
    entry = co.models.catalogue["underwater_vehicle"]
    system = entry.make()
    start = entry.start(system, angular_velocity=(1.0, 0.3, 2.0))
    method = co.methods.KahanLi6(co.methods.LeftRight())
    coarse, fine = (
        co.simulate(system, start, dt=dt, duration=20.0, method=method, progress=False, backend=backend)
        for dt in (0.4, 0.2)
    )
    assert coarse.relative_change("energy") / fine.relative_change("energy") > 2**5
    for run in (coarse, fine):
        assert run.relative_change("kelvin_noether") < 2e-13
        assert run.largest("newton_residual") < 1e-14


@pytest.mark.long
def test_the_gradient_of_a_composed_run_is_that_of_differences():
    entry = co.models.catalogue["heavy_top"]
    system = entry.make()
    start = entry.start(system)
    method = co.methods.KahanLi6(co.methods.LeftRight(co.Exponential()))

    def last(mass):
        return co.trajectory(system.replace(mass=mass), start, dt=0.02, steps=20, method=method).final.mu[0]

    mass = float(system.parameters.mass)
    with co.float64():
        slope = jax.grad(last)(mass)
    step = 1e-4 * mass
    assert slope == pytest.approx((last(mass + step) - last(mass - step)) / (2 * step), rel=1e-6)


GAMMA = 1 / (2 - 2 ** (1 / 3))
REFUSED = {
    "inconsistent": (
        lambda: co.methods.Composition(co.Midpoint(), (0.5, 0.4, 0.5)),
        "must add up to 1, .* adds up to 1.4",
    ),
    "one-sided": (lambda: co.methods.Composition(co.Midpoint(), (0.5, 0.3, 0.2)), "must read the same backwards"),
    "order": (
        lambda: co.methods.Composition(co.Midpoint(), (GAMMA, 1 - 2 * GAMMA, GAMMA), order=6),
        "must give order 6 over a base of order 2, but gives 4",
    ),
    "zero": (lambda: co.methods.Composition(co.Midpoint(), (0.5, 0.0, 0.5)), "numbers other than 0"),
    "empty": (lambda: co.methods.Composition(co.Midpoint(), ()), "numbers other than 0"),
    "table": (lambda: co.methods.Composition(co.Midpoint(), [[0.5], [0.5]]), "row of numbers"),
    "words": (lambda: co.methods.Composition(co.Midpoint(), "half"), "`coefficients`"),
    "nan": (lambda: co.methods.Composition(co.Midpoint(), (np.nan, 1.0, np.nan)), "`coefficients`"),
    "not symmetric": (lambda: co.methods.KahanLi6(co.LeftRectangle()), "symmetric method of order 2"),
    "not symmetric either": (lambda: co.methods.Composition(co.LeftRectangle(), (0.5, 0.5)), "co.methods.Symmetrised"),
    "no method": (lambda: co.methods.Composition(co.Cayley(), (0.5, 0.5)), "must be a method"),
    "order 4 in a scheme for 2": (lambda: co.methods.KahanLi8(co.Suzuki4(co.Midpoint())), "of order 2"),
    "no adjoint": (lambda: co.methods.Symmetrised(co.methods.GroupVariational()), "adjoint of GroupVariational"),
    "symmetrised nothing": (lambda: co.methods.Symmetrised(None), "must be a method"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_coefficients_and_bases_that_make_no_sense_are_refused(case):
    make, sentence = REFUSED[case]
    with pytest.raises(co.errors.ArgumentError, match=sentence):
        make()
