"""The catalogue: cheap to list, complete, and exact about names."""

from __future__ import annotations

import inspect
import subprocess
import sys
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

import coadjoint as co
from coadjoint import models
from coadjoint.extensions import import_string
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.models import CatalogueEntry, catalogue, manakov, pseudo_rigid, rotor, spherical_pendulum

ENTRIES = list(catalogue.values())


def values(system: co.System) -> Any:
    return system.parameters


def entry_name(entry: CatalogueEntry) -> str:
    return entry.name


def test_listing_names_and_descriptions_imports_no_jax():
    listing = (
        "import sys, coadjoint.models as m\n"
        "lines = [f'{e.name} {e.description} {dict(e.parameters)} {dict(e.initial)}' for e in m.catalogue.values()]\n"
        "assert len(lines) >= 7 and m.TABLE_1['mass'] == 123.8\n"
        "assert not {'jax', 'numpy', 'scipy'} & set(sys.modules), 'a listing imported numerics'\n"
    )
    subprocess.run([sys.executable, "-c", listing], check=True)


@pytest.mark.parametrize("entry", ENTRIES, ids=entry_name)
def test_defaults_name_every_argument_of_the_model(entry: CatalogueEntry):
    for path, defaults, skipped in ((entry.maker, entry.parameters, 0), (entry.starter, entry.initial, 1)):
        assert set(defaults) == set(list(inspect.signature(import_string(path)).parameters)[skipped:]), path


@pytest.mark.cases(1)
@pytest.mark.parametrize("entry", ENTRIES, ids=entry_name)
def test_every_model_runs_from_its_defaults_and_keeps_its_invariants(entry: CatalogueEntry):
    system = entry.make()
    start = entry.start(system)
    assert system.check(start, regular=entry.method == "Midpoint") == []
    method = getattr(co, entry.method)()
    run = co.simulate(system, start, dt=entry.dt, duration=entry.duration, save_every=100, method=method)
    print(run)
    if system.forces is not None:
        assert run.summary()["energy_budget_error_max"] <= 1e-6
    else:
        assert run.relative_change("energy") <= 1e-3
        if "kelvin_noether" in run.dataset:  # what sees its frame against the ground has none
            assert run.relative_change("kelvin_noether") <= 1e-10
    assert run.largest("balance") <= 1e-15 * (10 + cancellation(run.records))
    # Matrices have none; the isotropy algebra of the vehicle on SE(3) mixes momenta and a moment.
    bare = {name for name, variable in run.dataset.data_vars.items() if "units" not in variable.attrs}
    assert {name.partition("_")[0] for name in bare} <= {"R", "group", "kelvin"}, bare


def cancellation(records: co.State) -> float:
    """How far |π||n|, whose round-off m = μ − π⋄n carries, exceeds |μ| + |π⋄n|, to which the balance is relative."""
    if records.n.shape[1] != 3:
        return 0.0
    pi, n, mu = records.pi, records.n, records.mu
    total = np.linalg.norm(mu, axis=1) + np.linalg.norm(np.cross(pi, n), axis=1)
    return float(np.max(np.linalg.norm(pi, axis=1) * np.linalg.norm(n, axis=1) / total))


def test_the_entry_of_the_papers_vehicle_is_the_paper():
    entry = catalogue["underwater_vehicle"]
    made, paper = entry.make(), models.paper_vehicle()
    for name, value in values(paper).asdict().items():
        assert np.array_equal(values(made).asdict()[name], value), name
    found, expected = entry.start(made), models.paper_start(paper)
    for name in ("g", "n", "nu", "xi", "a", "mu", "pi"):
        assert np.max(np.abs(getattr(found, name) - getattr(expected, name))) <= 1e-14, name


def test_parameters_replace_defaults():
    entry = catalogue["heavy_top"]
    assert values(entry.make(mass=3.0)).mass == 3.0 and values(entry.make()).mass == 15.0
    R = co.attitude.zyx(0.1, 0.2, 0.3)
    start = entry.start(entry.make(), rotation=R, angular_velocity=[1.0, 2.0, 3.0])
    assert np.array_equal(start.g, R) and np.array_equal(start.xi, [1.0, 2.0, 3.0])


def test_one_way_to_state_the_attitude_replaces_another():
    entry = catalogue["underwater_vehicle"]
    start = entry.start(entry.make(), euler_zyx=(0.1, 0.2, 0.3), euler_rates=(0.4, 0.5, 0.6))
    assert np.max(np.abs(start.g - co.attitude.zyx(0.1, 0.2, 0.3))) <= 1e-15
    assert np.max(np.abs(start.xi - co.attitude.zyx_angular_velocity(0.1, 0.2, 0.3, (0.4, 0.5, 0.6)))) <= 1e-15
    kept = entry.start(entry.make(), euler_zyx=(0.1, 0.2, 0.3))
    assert np.max(np.abs(kept.xi - np.radians([10, 0, 20]))) <= 1e-15


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda e: e.make(mas=3.0), "Model `heavy_top` has no parameter `mas`: did you mean `mass`?"),
        (lambda e: e.start(e.make(), angular_velocty=(0, 0, 1)), "did you mean `angular_velocity`?"),
        (lambda e: e.start(e.make(), height=3.0), "has no initial value `height`: it knows angular_velocity, "),
    ],
)
def test_a_name_that_does_not_exist_is_answered_by_the_nearest(call, says):
    with pytest.raises(co.errors.ArgumentError) as caught:
        call(catalogue["heavy_top"])
    assert says in str(caught.value)


def test_defaults_cannot_be_changed_in_place():
    with pytest.raises(TypeError):
        catalogue["heavy_top"].parameters["mass"] = 1.0  # type: ignore[index]


def test_watched_momenta_are_those_of_their_equations():
    state: Any = SimpleNamespace(
        mu=np.array([1.0, 2.0, -2.0]), a=np.array([0, 0, 1.0]), n=np.eye(3)[0], pi=np.eye(3)[1]
    )
    assert rotor.momentum_squared(state) == 9.0 and spherical_pendulum.pendulum_momentum(state) == 1.0
    assert pseudo_rigid._along(state, way=np.array([3.0, 1.0, 1.0])) == 3.0


@pytest.mark.parametrize(("power", "of_z", "expected"), [(2, 0, -2 * 9.0), (2, 1, 0.0), (2, 2, 1 + 16 + 81.0)])
def test_integrals_of_a_body_in_n_dimensions_are_coefficients_of_powers(power, of_z, expected):
    """tr(M + zJ²)² = tr M² + 2z tr MJ² + z² tr J⁴, of which tr MJ² = 0."""
    p: Any = SimpleNamespace(moments=np.array([1.0, 2.0, 3.0]))
    mu = np.array([1.0, 2.0, -2.0])
    found = evaluate(lambda mu: manakov.integral(cast(Any, SimpleNamespace(mu=mu)), p, power=power, of_z=of_z), mu)
    assert found == pytest.approx(expected, abs=1e-12)
