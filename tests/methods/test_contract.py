"""What a method and its stages must give: abstract members, and F of every stage of every shipped method."""

from __future__ import annotations

import pytest

import coadjoint as co
from coadjoint.audit.shipped import SHIPPED
from coadjoint.methods import Step


@pytest.mark.parametrize("left_out", ["order", "stages", "equations", "advance", "sources"])
def test_a_method_without_one_of_its_five_members_cannot_be_made(left_out: str) -> None:
    given = {name: getattr(co.LeftRectangle, name) for name in ("order", "stages", "equations", "advance", "sources")}
    del given[left_out]
    with pytest.raises(TypeError, match=left_out):
        type("Incomplete", (co.Method, Step), given)()


@pytest.mark.parametrize("shipped", SHIPPED, ids=lambda shipped: shipped.name)
def test_every_stage_of_a_shipped_method_gives_its_increment_and_its_energy(shipped) -> None:
    for stage, _ in shipped.make(co.Cayley()).stages:
        assert {"increment", "relative"} & overridden(stage), "F is not given"
        assert {"nodes", "energy"} & overridden(stage), "the discrete energy is not given"


def overridden(stage: Step) -> set[str]:
    """The members that the class of a stage, or one between it and `Step`, gives itself."""
    between = type(stage).__mro__[: type(stage).__mro__.index(Step)]
    return {name for kind in between for name in vars(kind)}
