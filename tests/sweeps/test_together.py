"""Members of catalogue models and factories step together where they differ in numbers alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import coadjoint as co
from coadjoint.runs.members import members
from coadjoint.sweeps.file import Sweep, of_tables, table_of
from coadjoint.sweeps.sweep import groups, probed
from coadjoint.sweeps.task import ensemble

TOP = """
[system]
model = "simo_wong_top"
[parameters]
inertia_about = "center_of_mass"
[run]
dt = 0.001
steps = 3
"""
FACTORY = '[system]\nfactory = "f.py:make"\n[run]\ndt = 0.01\nsteps = 3\n'
HEAD = "import coadjoint as co\nimport numpy as np\nK = 1.0\n"
COMPUTES = """
def make(c=1.0, k=2.0):
    stiff = np.sqrt(k) + (c if c > 1.1 else 0.0)
    s = co.System(co.SO3(), lambda xi, p: 0.5 * p.k * xi @ xi + 0.5 * p.c * xi[0] ** 2, parameters={"k": stiff, "c": c})
    return s, s.state(g=co.attitude.zyx(0, 0.1 * k, 0), xi=[0.3, 0.2 * c, 1.0])
"""
LOOKS = COMPUTES.replace("    return s, ", "    start = ") + "    return s, s.state(xi=2 * start.xi)\n"
ENCLOSES = """
def make(c=1.0, k=2.0):
    s = co.System(co.SO3(), lambda xi: 0.5 * k * xi @ xi + 0.5 * c * xi[0] ** 2)
    return s, s.state(xi=[0.3, 0.2, 1.0])
"""
CHANGES_A_GLOBAL = """
def make(c=1.0, k=2.0):
    global K
    K = c
    s = co.System(co.SO3(), lambda xi, p: 0.5 * p.k * xi @ xi + 0.5 * K * xi[0] ** 2, parameters={"k": k})
    return s, s.state(xi=[0.3, 0.2, 1.0])
"""


def swept(folder: Path, run: str, vary: dict, members: int = 6) -> Sweep:
    (folder / "r.toml").write_text(run)
    table = {"sweep": {"run": "r.toml", "sampling": "random", "members": members}, "vary": vary}
    return of_tables(table, table_of(folder / "r.toml", "run file"), folder / "r.toml", {})


def between(low: float, high: float) -> dict[str, float]:
    return {"from": low, "to": high}


TWO = {"parameters": {"c": between(1.0, 1.2), "k": between(2.0, 3.0)}}


def compared(sweep: Sweep) -> None:
    """Members that are put together are those that are made alone, to round-off of the start."""
    rows, all_of = sweep.rows(slice(0, sweep.members)), np.arange(sweep.members)
    made = ensemble(sweep, rows, all_of, True, 1).position
    for index in (0, sweep.members - 1):
        row = {name: values[index : index + 1] for name, values in rows.items()}
        alone = ensemble(sweep, row, all_of[:1], False, 1)
        np.testing.assert_allclose(made.state.mu[index], alone.position.state.mu[0], rtol=1e-14)
        np.testing.assert_allclose(made.state.g[index], alone.position.state.g[0], atol=1e-15)


@pytest.mark.parametrize(
    "vary",
    [
        {"parameters": {"mass": between(15.0, 25.0), "center_of_mass": [0.0, 0.0, between(0.8, 1.2)]}},
        pytest.param(
            {
                "parameters": {"mass": between(15.0, 25.0)},
                "initial": {"angular_velocity_rpm": [0, 0, between(300.0, 400.0)]},
            },
            marks=pytest.mark.long,
        ),
    ],
)
def test_members_of_a_catalogue_model_step_together_whatever_varies(tmp_path, vary):
    sweep = swept(tmp_path, TOP, vary)
    assert groups(sweep, probed(sweep)["quick"]) == (1, [])
    compared(sweep)


@pytest.mark.long
@pytest.mark.parametrize(
    "code", [pytest.param(COMPUTES, marks=pytest.mark.long), LOOKS], ids=["computes", "looks at its start"]
)
def test_a_factory_computes_with_plain_numbers_and_its_members_step_together(tmp_path, code):
    (tmp_path / "f.py").write_text(HEAD + code)
    sweep = swept(tmp_path, FACTORY, TWO)
    assert probed(sweep)["quick"]
    compared(sweep)


@pytest.mark.parametrize("code", [ENCLOSES, CHANGES_A_GLOBAL], ids=["encloses", "changes a global"])
def test_members_whose_functions_differ_do_not_step_together(tmp_path, code):
    (tmp_path / "f.py").write_text(HEAD + code)
    sweep = swept(tmp_path, FACTORY, TWO)
    assert not probed(sweep)["quick"]
    assert groups(sweep, False) == (6, ["parameters.c", "parameters.k"])


def test_numbers_in_which_members_differ_are_the_same_for_every_task(tmp_path):
    sweep = swept(tmp_path, TOP, {"parameters": {"mass": between(15.0, 25.0)}})
    file = sweep.run(sweep.rows(slice(0, 3)), True)
    assert members(file).varying == sweep.varying == {"[0].inertia", "[0].mass"}  # pyright: ignore[reportArgumentType]
    one = ensemble(sweep, sweep.rows(slice(2, 3)), np.array([2]), True, 1).position
    three = ensemble(sweep, sweep.rows(slice(0, 3)), np.arange(3), True, 1).position
    assert np.array_equal(one.state.mu[0], three.state.mu[2])


def test_lists_of_which_a_digest_is_kept_are_swept(tmp_path, monkeypatch):
    monkeypatch.setattr("coadjoint.sweeps.file.LISTED", 2)
    (tmp_path / "r.toml").write_text(TOP)
    masses = [15.0, 20.0, 25.0, 30.0]
    kept = {"store": tmp_path / "out", "figures": False, "progress": False}
    found = co.sweep(tmp_path / "r.toml", mass=co.each(masses), workers=1, task=2, variables=["xi"], **kept)
    assert found.dataset["parameters.mass"].values.tolist() == masses and found.failures == {}
