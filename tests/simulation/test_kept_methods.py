"""A folder that does not keep the method or a function of its run asks for it again."""

from __future__ import annotations

import importlib

import pytest

import coadjoint as co
from coadjoint.errors import ArgumentError
from coadjoint.simulation.configuration import method_form, method_from, start_form, start_from

resume = importlib.import_module("coadjoint.simulation.resume")


class Own(co.Midpoint):
    """A method that no library has."""


def test_methods_of_the_library_are_kept_and_others_are_not():
    for method in (co.Midpoint(), co.Galerkin(co.Exponential(), degree=3), co.Suzuki4(co.methods.LeftRight())):
        assert method_from(method_form(method)) == method
    assert method_form(Own()) is None


@pytest.mark.parametrize(
    ("header", "sentence"),
    [
        ({"again": []}, "does not keep its method: give `method` again"),
        ({"again": ["until"]}, "begun with `until`, which its folder does not keep: give it again"),
    ],
)
def test_what_a_folder_does_not_keep_is_asked_for_again(header, sentence, monkeypatch, tmp_path):
    system = co.System(co.SO2(), lambda xi: 0.5 * xi @ xi)
    monkeypatch.setattr(resume, "run_manifest", lambda folder: None)
    monkeypatch.setattr(resume, "read_configuration", lambda manifest: ({"method": None, **header}, {}))
    with pytest.raises(ArgumentError, match=sentence):
        co.resume(tmp_path, system)


def test_a_start_is_kept_with_all_of_its_parts():
    system = co.System(co.SO3(), lambda xi, n, nu: 0.5 * xi @ xi + 0.5 * nu @ nu, additional=co.Defining())
    start = system.state(q=[1.0, 2.0, 3.0], xi=[0.1, 0.2, 0.3], qdot=[0.0, 1.0, 0.0])
    form, numbers = start_form(start)
    again = start_from(form, numbers, system)
    for name in ("g", "n", "mu", "pi", "xi", "nu", "t"):
        assert (getattr(again, name) == getattr(start, name)).all(), name
    with pytest.raises(ArgumentError, match="give `start` again"):
        start_from(None, {}, system)
