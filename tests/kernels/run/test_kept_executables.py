"""Executables of XLA on disk: found without a trace, bitwise the same, and only those that another process can run."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.run.compiled import Compiled
from coadjoint.mechanics.identity import version
from coadjoint.methods.program import as_read
from coadjoint.simulation.problem import SimulationProblem


@dataclass(frozen=True)
class _Known:
    """A program as far as its identity and its structure are asked for."""

    identity: str | None = "known"
    stages: tuple[object, ...] = ()


Known: Any = _Known


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("COADJOINT_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def kept(folder):
    return [path for path in folder.glob("*.code") if not path.read_bytes()[32:].startswith(b"{")]


def chain(program, x, *, count):
    for _ in range(count):
        x = jnp.sin(x["a"]), x["a"] / 3
        x = {"a": x[0] + x[1]}
    return x


def never(program, x, *, count):
    raise AssertionError("It is traced again.")


never.__qualname__ = chain.__qualname__
X = {"a": np.linspace(0, 1, 5)}


def test_another_process_finds_it_without_a_trace_and_gives_the_same_bits(cache):
    with jax.enable_x64(True):
        first = Compiled(chain, ("count",))(Known(), X, count=3)
        assert len(kept(cache)) == 1
        again = Compiled(never, ("count",))(Known(), X, count=3)
        plain = jax.jit(chain, static_argnames=("program", "count"))(Known(), X, count=3)
    assert np.array_equal(again["a"], first["a"]) and np.array_equal(plain["a"], first["a"])


@pytest.mark.parametrize(
    ("program", "x", "count"),
    [(Known("other"), X, 3), (Known(), {"b": X["a"]}, 3), (Known(), {"a": X["a"][:2]}, 3), (Known(), X, 2),
     (Known(), {"a": np.arange(5)}, 3)],
)  # fmt: skip
def test_another_program_or_other_arguments_are_not_taken_for_it(program, x, count):
    with jax.enable_x64(True):
        Compiled(chain, ("count",))(Known(), X, count=3)
        with pytest.raises(AssertionError, match="traced again"):
            Compiled(never, ("count",))(program, x, count=count)


def test_a_damaged_file_is_compiled_again(cache):
    with jax.enable_x64(True):
        first = Compiled(chain, ("count",))(Known(), X, count=3)
        (path,) = kept(cache)
        content = bytearray(path.read_bytes())
        content[-1] ^= 1
        path.write_bytes(content)
        assert np.array_equal(Compiled(chain, ("count",))(Known(), X, count=3)["a"], first["a"])
        assert path.read_bytes() != bytes(content)


def test_a_program_without_identity_is_not_kept(cache):
    with jax.enable_x64(True):
        Compiled(chain, ("count",))(Known(None), X, count=3)
    assert not kept(cache)


def test_a_function_that_calls_python_is_not_kept(cache):
    def called(program, x, *, count):
        return jax.pure_callback(lambda y: count * np.asarray(y), jax.ShapeDtypeStruct((5,), np.float64), x["a"])

    with jax.enable_x64(True):
        found = Compiled(called, ("count",))(Known(), X, count=3)
    assert np.array_equal(found, 3 * X["a"])
    assert not kept(cache)


SOLVE = """
import jax, jax.numpy as jnp, numpy as np
from coadjoint.kernels.run.compiled import Compiled
from coadjoint.models.fluids.laplacian import inverse_laplacian
from test_kept_executables import Known
def solve(program, A, b):
    return {}
with jax.enable_x64(True):
    found = Compiled(solve, ())(Known(), np.diag([1.0, 2.0, 3.0]) + 0.1, np.ones(3))
print(np.asarray(found).tobytes().hex())
"""


@pytest.mark.long
@pytest.mark.parametrize(
    ("value", "files"),
    [("jnp.linalg.solve(A, b) + jnp.linalg.eigvalsh(A)", 1), ("inverse_laplacian(3, A.reshape(-1))", 2)],
    ids=["LAPACK", "machine code"],
)
def test_functions_outside_of_it_are_there_in_a_process_that_has_lowered_nothing(cache, value, files):
    folder, program = __file__.rpartition("/")[0], SOLVE.format(value)
    said = [
        subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=folder).stdout
        for _ in range(2)
    ]
    assert len(kept(cache)) == files
    assert said[0] == said[1]


def body(strength):
    return co.System(co.SO3(), lambda xi: 0.5 * strength[0] * xi @ (jnp.array([1.0, 2.0, 3.0]) * xi), name="body")


@pytest.mark.long
def test_a_run_by_xla_finds_what_the_same_system_compiled_and_nothing_of_another(cache, monkeypatch):
    strength = [1.0]

    def ended():
        system = body(strength)
        start = system.state(xi=[0.3, 1.0, -0.2])
        return co.simulate(system, start, dt=0.05, steps=5, backend="xla", progress=False, accuracy=False).records.mu

    first = ended()
    assert len(kept(cache)) == 1
    monkeypatch.setattr(Compiled, "_made", None)
    assert np.array_equal(ended(), first)
    monkeypatch.undo()
    strength[0] = 2.0
    monkeypatch.setenv("COADJOINT_CACHE", str(cache))
    assert not np.array_equal(ended(), first)
    assert len(kept(cache)) == 2


def test_a_program_of_a_user_has_an_identity_only_where_it_was_just_read():
    system = body([1.0])
    run = SimulationProblem(system, system.state(xi=[0.3, 1.0, -0.2]), co.Midpoint(), 0.05, 5).set_up()
    program = run.plan.program
    assert program.identity is None
    with as_read(version(system, run.position.state)):
        assert program.identity is not None
