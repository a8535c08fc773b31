"""What has an identity is the library's; whatever it holds changes it, and what nothing is known of has none."""

from __future__ import annotations

import functools
import shutil
import subprocess
import sys
import types
from pathlib import Path

import jax
import numpy as np
import pytest

import coadjoint as co
import coadjoint_vehicles
from coadjoint.kernels.program import StatusFlag
from coadjoint.kernels.trace import library
from coadjoint.kernels.trace.identity import Shapes, Traced, identity
from coadjoint.mechanics.identity import parts
from coadjoint.mechanics.inputs import Inputs
from coadjoint.models import catalogue
from coadjoint_vehicles.missions.mission_section import arrival
from coadjoint_vehicles.parts.fin import Fin
from coadjoint_vehicles.water.surface_bottom import at_bottom


def test_equal_objects_of_the_library_have_one_identity_and_others_another():
    assert identity(co.Suzuki4(co.Midpoint()), co.SE3()) == identity(co.Suzuki4(co.Midpoint()), co.SE3())
    different = [
        co.Midpoint(),
        co.Midpoint(co.Exponential()),
        co.LeftRectangle(co.Cayley()),
        co.SO3(),
        co.Held([0.0, 1.0], [1.0, 2.0]),
        co.Held([0.0, 1.0], [1.0, 2.5]),
        co.Linear([0.0, 1.0], [1.0, 2.0]),
        at_bottom(10.0),
        at_bottom(11.0),
        *({0}, {0, 1}, functools.partial(at_bottom, 1.0), functools.partial(at_bottom, 2.0)),
        *(co.Midpoint().require_fit, co.LeftRectangle().require_fit, StatusFlag.DUE, StatusFlag.FAILED),
        *(np, np.linalg, np.sin, np.cos),
        *(0, 0.0, -0.0, False, None, "0", b"0", (0,), [0], {0: 0}, np.zeros(1), np.zeros((1, 1)), np.zeros(1, int)),
    ]
    digests = [identity(one).digest for one in different]
    assert len(set(digests)) == len(digests)


def test_an_array_that_changes_in_place_is_another():
    table = np.zeros(3)
    before = identity([table])
    table[1] = 1e-300
    assert identity([table]) != before


def test_what_a_trace_computes_has_none():
    found = []
    jax.make_jaxpr(lambda x: found.append(identity([2.0, x])))(1.0)
    assert found == [None]


def test_what_was_worked_out_of_an_object_does_not_count():
    held = co.Held([0.0, 1.0], [1.0, 2.0])
    before = identity(held)
    held(0.5)
    assert "_constants" in vars(held)
    assert identity(held) == before


class Own:
    """Of somebody else."""


@functools.wraps(at_bottom)
def disguised(*args):
    return at_bottom(*args)


@pytest.mark.parametrize(
    "value",
    [Own(), Own, lambda x: x, disguised, np.random.default_rng(1), open, np.array([Own()]), Inputs(None, (Own(),))],
    ids=["object", "class", "function", "disguised", "generator", "builtin", "array of objects", "within"],
)
def test_what_is_not_known_has_no_identity(value):
    assert identity(value) is None


def test_an_end_at_the_last_way_point_has_an_identity_with_its_numbers():
    controllers = [
        types.SimpleNamespace(way_points=np.array([[0.0, 0, 0], [60.0, 0, 3]]), acceptance=reach) for reach in (3, 4)
    ]
    first, second = (identity(arrival(controller)) for controller in controllers)
    assert first is not None and first.library_only
    assert first != second
    assert identity(pytest) is None


def test_a_class_of_somebody_else_that_inherits_has_none():
    class Part(Fin):
        pass

    assert identity(co.Midpoint()) is not None
    assert identity(object.__new__(Part)) is None


def test_a_function_that_is_traced_counts_by_its_code_and_makes_the_identity_partial():
    def function(x, strength):
        return strength * x

    def other(x, strength):
        return strength + x

    assert identity(Traced(at_bottom(10.0))).library_only
    assert not identity(Traced(function)).library_only
    assert identity(Traced(function)).digest != identity(Traced(other)).digest


def test_of_shapes_numbers_do_not_count():
    trees = [{"a": np.zeros(3)}, {"a": np.ones(3)}, {"a": np.zeros(4)}, {"b": np.zeros(3)}]
    first, second, longer, named = (identity(Shapes(tree)) for tree in trees)
    assert first == second
    assert len({first, longer, named}) == 3


def test_what_is_replaced_in_memory_is_not_noticed_by_the_digest_of_the_library(monkeypatch):
    before = library.library()
    monkeypatch.setattr("coadjoint.kernels.program.TOLERANCE", 1e-3)
    assert before is not None and library.library() == before


SEEN = """
import sys
sys.path.insert(0, sys.argv[1])
from pathlib import Path
from coadjoint.kernels.trace.identity import identity
from coadjoint.kernels.trace.library import ROOT, edited, library
from coadjoint.mechanics.identity import parts
from coadjoint.models import catalogue
print(identity(parts(catalogue["heavy_top"].make())).digest)
print(library(), edited())
Path(ROOT, "kernels", "program.py").touch()
print(library(), edited())
"""


@pytest.mark.long
def test_identities_are_those_of_other_processes_and_edited_files_make_another_library(tmp_path):
    for package in (library.ROOT, Path(coadjoint_vehicles.__file__).parent):
        shutil.copytree(package, tmp_path / package.name, ignore=shutil.ignore_patterns("__pycache__"))

    def seen():
        command = [sys.executable, "-B", "-c", SEEN, str(tmp_path)]
        own, *told = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
        assert own == identity(parts(catalogue["heavy_top"].make())).digest
        assert told[1::2] == ["False", "True"], "what is written while the process runs is seen"
        assert told[0] == told[2], "what runs is what was read"
        return told[0]

    first = seen()
    for file in ("coadjoint/methods/midpoint.py", "coadjoint_vehicles/files/data/remus_100.toml"):
        path = Path(tmp_path, file)
        path.write_text(path.read_text() + "\n#\n")
        before, first = first, seen()
        assert first not in (before, "None")
