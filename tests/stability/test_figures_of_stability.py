"""The growth rates and the root locus that a figure of stability draws."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from coadjoint.errors import ArgumentError
from coadjoint.stability.figure import stability_figure


def motion(*eigenvalues: complex) -> Any:
    return SimpleNamespace(modes=[SimpleNamespace(eigenvalue=complex(root)) for root in eigenvalues])


def points(drawn: Any) -> list[list[float]]:
    return np.asarray(drawn.get_offsets()).tolist()


def test_real_and_oscillating_modes_are_told_apart_and_the_locus_has_both_of_a_pair():
    figure = stability_figure([1.0, 2.0], [motion(-0.5, 0.1 + 2j), motion(0.2)], "speed")
    growth, plane = figure.axes[:2]
    real, oscillating = growth.collections
    assert points(real) == [[1.0, -0.5], [2.0, 0.2]] and points(oscillating) == [[1.0, 0.1]]
    assert len(real.get_facecolor()) and not len(oscillating.get_facecolor())
    assert [text.get_text() for text in growth.get_legend().get_texts()] == ["real", "oscillating"]
    above, below = plane.collections
    assert points(above) == [[-0.5, 0.0], [0.1, 2.0], [0.2, 0.0]] and points(below)[1] == [0.1, -2.0]
    assert above.get_array().tolist() == [1.0, 1.0, 2.0]
    assert (growth.get_xlabel(), plane.get_xlabel(), len(figure.axes)) == ("speed", "Re λ (1/s)", 3)
    assert growth.lines[0].get_ydata()[0] == 0 and plane.lines[0].get_xdata()[0] == 0


def test_one_value_needs_no_bar_of_colours_and_others_than_motions_are_refused():
    assert len(stability_figure([1.0], [motion(-0.5)]).axes) == 2
    for values, found in (([], []), ([1.0, 2.0], [motion(-0.5)])):
        with pytest.raises(ArgumentError, match=f"as many values as motions, got {len(values)}, {len(found)}"):
            stability_figure(values, found)
