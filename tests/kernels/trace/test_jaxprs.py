"""What is known of JAX's jaxprs holds for the JAX that is installed, and what is not known goes to XLA."""

from __future__ import annotations

import re
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from vehicle import PAPER, LeftRectangle, VehicleProgram, start

import coadjoint
from coadjoint.errors import ArgumentError
from coadjoint.kernels.run import backend
from coadjoint.kernels.trace import jaxprs, structured
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.kernels.trace.tracer import Tracer, flat
from coadjoint.kernels.untraceable import UnknownVersion

scan = jax.lax.scan

SEED = 31
print(f"seed {SEED}")
_random = np.random.default_rng(SEED)
A, B = _random.normal(size=(4, 4)), _random.normal(size=4)


def test_two_files_know_the_inside_of_jax():
    inside = re.compile(r"jax\.(extend|core|interpreters|_src)\b|from jax import .*\b(extend|core|interpreters)\b")
    root = Path(coadjoint.__file__).parent
    knowing = {str(path.relative_to(root)) for path in root.rglob("*.py") if inside.search(path.read_text("utf-8"))}
    assert knowing - {"before_jax.py"} == {"kernels/trace/jaxprs.py", "kernels/trace/primitives.py"}


def test_a_setting_of_jax_that_changes_traces_changes_their_context():
    plain = jaxprs.trace_context()
    with jax.default_matmul_precision("highest"):
        assert jaxprs.trace_context() != plain
    assert jaxprs.trace_context() == plain


@jax.custom_jvp
def own_tangent(x, y):
    return jnp.sin(x) * y


own_tangent.defjvp(lambda p, t: (own_tangent(*p), jnp.cos(p[0]) * p[1] * t[0] + jnp.sin(p[0]) * t[1]))


@jax.custom_vjp
def own_pullback(x, y):
    return jnp.sin(x) @ y


own_pullback.defvjp(lambda x, y: (own_pullback(x, y), (x, y)), lambda r, c: (jnp.outer(c, r[1]), jnp.sin(r[0]).T @ c))


def matvec(a):
    return lambda x: a @ x


CONTROL = {
    "jit": jax.jit(lambda a, b: (a @ b, b)),
    "remat": jax.checkpoint(lambda a, b: jnp.sin(a) @ b),
    "custom_jvp_call": lambda a, b: own_tangent(a, b),
    "custom_jvp_call under grad": lambda a, b: jax.grad(lambda x: own_tangent(x, b).sum())(a),
    "custom_vjp_call": lambda a, b: own_pullback(a, b),
    "custom_vjp_call under grad": lambda a, b: jax.grad(lambda x: own_pullback(x, b).sum())(a),
    "composite": lambda a, b: jax.lax.composite(lambda x, y: jnp.sin(x) @ y, "own.sine")(a, b),
    "cond": lambda a, b: jax.lax.cond(b[0] > 0, lambda x: (x @ a, x), lambda x: (x, a @ x), b),
    "switch": lambda a, b: jax.lax.switch(2, [lambda x: x, lambda x: 2 * x, lambda x: a @ x], b),
    "platform_index": lambda a, b: jax.lax.platform_dependent(b, cpu=lambda x: 3 * x, default=lambda x: x),
    "scan": lambda a, b: scan(lambda c, x: ({"u": c["u"] + x @ b, "v": 2 * c["v"]}, (c["u"], x[0])), CARRY, a),
    "scan in reverse": lambda a, b: scan(lambda c, x: (c * x + b, (x, c)), b, a, reverse=True),
    "scan without slices": lambda a, b: scan(lambda c, _: (a @ c, c[0]), b, None, length=3),
    "scan without carry": lambda a, b: scan(lambda c, x: (c, x * b), None, a),
    "scan without results": lambda a, b: scan(lambda c, x: (c + x, None), b, a),
    "scan of nothing": lambda a, b: scan(lambda c, x: (c + x, (x, c)), b, a[:0]),
    "scan under grad": lambda a, b: jax.grad(lambda x: scan(lambda c, y: (c * jnp.sin(y), c), x, a)[0].sum())(b),
    "scan under vmap": lambda a, b: jax.vmap(lambda x: scan(lambda c, y: (c + x * y, c), x, b))(a),
    "while": lambda a, b: jax.lax.while_loop(lambda c: c[0] < 3, lambda c: (c[0] + 1, a @ c[1], c[2]), (0, b, a)),
    "while with both constants": lambda a, b: jax.lax.while_loop(
        lambda c: c[0] < 2 + 0 * jnp.arange(4)[1], lambda c: (c[0] + 1, a @ c[1] + b), (0, b)
    ),
    "custom_linear_solve": lambda a, b: jax.lax.custom_linear_solve(
        matvec(a), b, lambda _, x: jnp.linalg.solve(a, x), lambda _, x: jnp.linalg.solve(a.T, x)
    ),
    "custom_root": lambda a, b: jax.lax.custom_root(
        lambda x: a @ x - b,
        b,
        lambda _, x: jnp.linalg.solve(a, b),
        lambda g, y: jnp.linalg.solve(jax.jacobian(g)(y), y),
    ),
    "custom_root under grad": lambda a, b: jax.grad(lambda c: CONTROL["custom_root"](a, c).sum())(b),
    "solve": lambda a, b: jnp.linalg.solve(a, b),
    "solve under grad": lambda a, b: jax.grad(lambda x: jnp.linalg.solve(x, b).sum())(a),
    "determinant": lambda a, b: jnp.stack([jnp.linalg.det(a[:n, :n]) for n in (2, 3, 4)]),
    "interpolation": lambda a, b: jnp.interp(b, jnp.array([-1.0, 0.0, 1.0]), jnp.array([3.0, 4.0, -2.0])),
}
"""Every primitive that holds a jaxpr, with results whose shapes tell their order."""
CARRY = {"u": np.float64(1.5), "v": np.arange(3.0)}


@pytest.mark.cases(3)
@pytest.mark.parametrize("name", CONTROL)
def test_a_primitive_with_a_body_does_as_jax_does(name, monkeypatch):
    theirs = by_jax(CONTROL[name])
    monkeypatch.setattr("coadjoint.kernels.trace.evaluate.compiled", refused)
    assert_same(evaluate(CONTROL[name], A, B), theirs)
    assert_same(evaluated(Tracer(), CONTROL[name]), theirs)


def refused(function):
    raise AssertionError("a primitive without a rule here went to XLA")


def by_jax(function):
    with jax.enable_x64(True):
        return jax.jit(function)(A, B)


def evaluated(tracer, function):
    """The numbers of the expressions of function(A, B), all arguments symbols."""
    from test_tracer import values

    symbols = tracer.symbols("x", (A, B))
    found = tracer.trace(function, *symbols)
    given = dict(zip(flat(symbols), [*A.ravel(), *B], strict=True))
    return jax.tree.map(lambda leaf: values(list(leaf.reshape(-1)), given).reshape(leaf.shape), found)


def assert_same(ours, theirs):
    assert jax.tree.structure(ours) == jax.tree.structure(theirs)
    for x, y in zip(jax.tree.leaves(ours), jax.tree.leaves(theirs), strict=True):
        assert np.shape(x) == np.shape(y)
        np.testing.assert_allclose(x, y, rtol=1e-11, atol=1e-12)


def test_what_a_function_depends_on_is_seen_through_calls_and_loops():
    def function(a, b, c, d):
        total, _ = scan(lambda s, x: (s + x @ b, None), 0.0, a)
        return jax.jit(lambda x, y: x)(total, c) + 0 * d.shape[0]

    assert jaxprs.depends(function, A, B, 1.0, B) == [True, True, False, False]


class Scanning(LeftRectangle):
    """A step that needs a scan."""

    def guess(self, p, s, h):
        return scan(lambda c, _: (c, None), super().guess(p, s, h), None, length=2)[0]


def renamed(monkeypatch, primitive, old, new):
    """A JAX in which a parameter of a primitive has another name; `old` None adds one."""
    made = jaxprs.EquationParameters.__init__

    def init(self, name, given):
        given = dict(given)
        if name == primitive:
            given[new] = given.pop(old) if old else "something"
        made(self, name, given)

    monkeypatch.setattr(jaxprs.EquationParameters, "__init__", init)


@pytest.mark.parametrize("old", ["length", "reverse", None])
def test_a_parameter_that_jax_renames_or_adds_is_told_and_the_program_runs_by_xla(monkeypatch, old):
    renamed(monkeypatch, "scan", old, f"new_{old}")
    program = VehicleProgram((Scanning(),))
    told = rf"`scan` cannot be traced: JAX {re.escape(jax.__version__)} gives it .*`.*{old}`.* runs by XLA"
    with pytest.warns(match=told):
        assert backend.choose(program, PAPER, start(0.01), True, "auto") == "xla"
    with pytest.raises(ArgumentError, match="`scan` cannot be traced"):
        backend.choose(program, PAPER, start(0.01), True, "native")
    assert_same(evaluate(CONTROL["scan"], A, B), by_jax(CONTROL["scan"]))


@pytest.mark.parametrize(
    ("name", "primitive", "old"),
    [
        ("cond", "cond", "branches"),
        ("while", "while", "body_jaxpr"),
        ("solve", "custom_linear_solve", "jaxprs"),
        ("jit", "dot_general", "dimension_numbers"),
    ],
)
def test_a_renamed_parameter_is_never_a_key_error(monkeypatch, name, primitive, old):
    renamed(monkeypatch, primitive, old, "new")
    with pytest.raises(UnknownVersion, match=f"`{primitive}` .* JAX {re.escape(jax.__version__)} .*`(new|{old})`"):
        evaluated(Tracer(), CONTROL[name])


def test_a_body_with_another_number_of_values_is_told(monkeypatch):
    variables = jaxprs.variables

    def fewer(jaxpr):
        found = variables(jaxpr)
        return jaxprs.Variables(found.constants, found.inputs[1:], found.outputs)

    (equation,) = jaxprs.equations(jaxprs.jaxpr_of(CONTROL["scan in reverse"], A, B)[0])
    monkeypatch.setattr(structured, "variables", fewer)
    with pytest.raises(UnknownVersion, match=r"`scan` cannot be traced: JAX .* values where its body has"):
        structured.scan(equation)
