"""Options with which XLA compiles functions of a program."""

from types import SimpleNamespace

import jax.numpy as jnp
import pytest

from coadjoint.kernels.newton.coupled import Coupled
from coadjoint.kernels.newton.fixed_point import FixedPoint
from coadjoint.kernels.newton.solver import Dense
from coadjoint.kernels.run import compiled

LINKS, FIELDS, BODY = Coupled(3, (3,), ((0, 1), (1, 2))), [FixedPoint(rows=(k, 1)) for k in (1, 2)], Dense()


def program(*structures):
    return SimpleNamespace(stages=tuple(SimpleNamespace(structure=structure) for structure in structures))


class Counted:
    """A program whose function is traced anew for each set of options."""

    def __init__(self, *structures):
        self.stages = program(*structures).stages


def test_steps_of_links_and_of_one_field_alone_have_options(monkeypatch):
    monkeypatch.setattr(compiled, "_known", lambda: True)
    assert compiled._options(program(BODY)) == compiled._options(program(FIELDS[1])) == ()
    assert compiled._options(program(BODY, LINKS)) == compiled._options(program(FIELDS[0])) == compiled.MANY_SMALL


@pytest.fixture
def asked_anew():
    compiled._known.cache_clear()
    yield
    compiled._known.cache_clear()


def test_options_that_this_xla_does_not_know_are_left_out(monkeypatch, asked_anew):
    monkeypatch.setattr(compiled, "MANY_SMALL", (("xla_no_such_option", False),))

    @compiled.compiled("factor")
    def scaled(program, x, *, factor):
        return factor * x

    assert scaled(Counted(LINKS), jnp.ones(2), factor=3).tolist() == [3.0, 3.0]
