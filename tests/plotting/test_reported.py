"""Figures of a report: which come first, and captions that need no library."""

from __future__ import annotations

import pytest

from coadjoint.errors import ArgumentError
from coadjoint.plotting.plots import figure_names
from coadjoint.plotting.report_figures import caption, chosen, svgs
from made_runs import VEHICLE, dataset


def test_of_a_vehicle_the_mission_comes_first_and_the_certificate_last():
    found = chosen([dataset()])
    assert found[:4] == ["mission", "track", "depth", "speeds"]
    assert found[-3:] == ["budget", "kelvin_noether", "group_defect"]


def test_of_a_body_the_motion_comes_first():
    found = chosen([dataset(energy_budget=None, **VEHICLE)])
    motion = ["trajectory", "attitude", "velocities", "momenta"]
    assert found == [*motion, "energy", "kelvin_noether", "inputs", "group_defect"]


def test_where_forces_act_the_budget_takes_the_place_of_the_energy():
    found = chosen([dataset(**VEHICLE)])
    assert "budget" in found and "energy" not in found
    assert "energy" not in chosen([dataset(), dataset(50)])


@pytest.mark.parametrize("name", figure_names(films=False))
def test_captions_name_no_arguments(name):
    for run in (dataset(), dataset(energy_budget=None, **VEHICLE)):
        told = caption(name, [run])
        assert told.endswith(".") and "`" not in told and "Theorem" not in told and "  " not in told


def test_the_caption_tells_which_way_z_points_and_what_a_change_of_energy_is():
    assert "points down" in caption("trajectory", [dataset()])
    assert "points down" not in caption("trajectory", [dataset(**VEHICLE)])
    assert "Forces act" in caption("energy", [dataset()])
    assert "no force acts" in caption("energy", [dataset(energy_budget=None)])
    assert "Forces act" in caption("energy", [dataset(energy_budget=None), dataset()])


def test_a_figure_that_is_none_is_refused():
    with pytest.raises(ArgumentError, match="no figure `energie`"):
        svgs([dataset()], ["energie"])
