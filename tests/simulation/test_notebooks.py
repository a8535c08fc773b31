"""In notebooks: the progress of a run as a line that is gone at its end; and the table of a run."""

from __future__ import annotations

import sys
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import coadjoint as co
from coadjoint.simulation.progress import Progress, notebook

BODY = co.System(co.SO3(), lambda xi: 0.5 * xi @ xi, name="ball")


def test_progress_is_a_line_in_the_cell_and_gone_at_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[str] = []

    def display(shown: dict[str, str], raw: bool, display_id: bool) -> Any:
        said.append(shown["text/plain"])
        return SimpleNamespace(update=lambda shown, raw: said.append(shown["text/plain"]))

    for shell, wanted in ((None, None), (SimpleNamespace(), None), (SimpleNamespace(kernel=1), display)):
        module = SimpleNamespace(get_ipython=lambda shell=shell: shell, display=SimpleNamespace(display=display))
        monkeypatch.setitem(sys.modules, "IPython", module)  # type: ignore[arg-type]
        assert notebook() is wanted
    with Progress(6_000_000, None, "top") as bar:
        bar.advance(100, 0.5)
        assert said == []
        bar.advance(2_999_900, 2.0)
    assert said == ["", "top: 3,000,000 of 6,000,000 (50%), 1.5e+06 steps/s", ""]
    with Progress(10, False, "top") as bar:
        bar.advance(5, 5.0)
    assert len(said) == 3


def test_a_run_is_a_table_of_pandas() -> None:
    of: dict[str, Any] = {"dt": 0.1, "steps": 2, "accuracy": False, "progress": False}
    run = co.simulate(BODY, BODY.state(xi=[0, 0, 1.0]), **of)
    table = run.to_dataframe()
    assert table.index.name == "time" and len(table) == 3
    np.testing.assert_array_equal(table["R_1_0"], run.dataset.R[:, 1, 0])
    np.testing.assert_array_equal(table["energy"], run.dataset.energy)
    fleet = co.simulate(BODY, BODY.state(xi=co.each([[0, 0, 1.0], [0, 1.0, 0]])), **of)
    assert fleet.to_dataframe().index.names == ["member", "time"]
    np.testing.assert_array_equal(fleet.to_dataframe().loc[1]["mu_1"], fleet.dataset.mu[1, :, 1])
