"""How the equations of a stage are solved is stated by the stage: XLA runs that, native code what is dense."""

from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
import pytest
from equations import Equations, Still

from coadjoint.errors import ArgumentError
from coadjoint.kernels.newton.solver import Root, parts_of, sizes_of
from coadjoint.kernels.program import Code
from coadjoint.kernels.run import backend, xla
from coadjoint.kernels.trace.evaluate import evaluate

MATRIX, RIGHT = np.array([[2.0, 1.0], [1.0, 3.0]]), np.array([3.0, 5.0])


@dataclass(frozen=True)
class Inverse:
    """A structure that knows the inverse, and carries the number of steps over."""

    native = False
    many_small = False

    def root(self, residual, guess, h, blocks, carried=()):
        unknowns = jnp.asarray(np.linalg.inv(MATRIX) @ RIGHT)
        return Root(unknowns, jnp.asarray(7), jnp.asarray(int(Code.CONVERGED)), carried + 1.0)


@dataclass(frozen=True)
class Counted(Equations):
    """The state's right side ends with what is carried over."""

    structure: Inverse = Inverse()

    def guess(self, p, s, h):
        return 0.0 * s[:-1]

    def carried(self, s):
        return s[-1]

    def carry(self, after, carried):
        return after.at[-1].set(carried)


def test_each_block_of_unknowns_has_the_size_of_its_largest_entry():
    vector = np.array([1.0, -3.0, 2.0, 0.5, -0.25])
    assert evaluate(lambda x: sizes_of(x, parts_of((2, 0, 3))), vector).tolist() == [3.0, 2.0]
    assert evaluate(lambda x: sizes_of(x, parts_of(())), vector).tolist() == [3.0]


def test_a_step_is_solved_by_the_structure_that_its_stage_states_and_carries_what_that_leaves():
    chunk = xla.run(Still((Counted(0.0),)), MATRIX, np.append(RIGHT, 0.0), 0.1, 3, 1)
    assert chunk.iterations == 21
    assert np.max(np.abs(MATRIX @ chunk.records[0] - RIGHT)) < 1e-14
    assert chunk.final[-1] == 3.0


def test_what_is_not_dense_runs_by_xla_without_a_warning_and_native_code_refuses_it(recwarn):
    program, given = Still((Counted(0.0),)), (MATRIX, np.append(RIGHT, 0.0))
    assert backend.choose(program, *given, True, "auto") == "xla"
    assert not recwarn.list
    with pytest.raises(ArgumentError, match=r"structure, which native code does not know. Use backend=\"xla\""):
        backend.choose(program, *given, True, "native")
