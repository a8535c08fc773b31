"""Viscosity, drag and stirring alone, in closed form by degrees, and Strang's splitting around a step."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import pytest

from coadjoint.errors import ArgumentError
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.methods import IsospectralMidpoint
from coadjoint.models import fluids
from coadjoint.models.fluids.damping import DampedMidpoint

N, T = 5, 0.7
FLUID = fluids.euler(N, rotation=0.6)
C = fluids.random_vorticity(1, 4)
FORCE = fluids.random_vorticity(2, 2)
DEGREES = np.arange(5)[:, None]


def after(method: DampedMidpoint, t: float = T) -> Any:
    """c_lm of the fluid after damping and stirring alone."""
    start = fluids.start(FLUID, C)
    return fluids.vorticity(FLUID, evaluate(partial(method._settled, FLUID), start, np.array(t)))


def test_drag_alone_lets_all_degrees_decay_alike():
    assert after(DampedMidpoint(drag=0.3)) == pytest.approx(np.exp(-0.3 * T) * C, abs=1e-13)


@pytest.mark.parametrize("drag", [0.0, 0.2])
def test_a_degree_decays_at_its_own_rate_and_a_rotation_feels_no_viscosity(drag):
    rate = 0.05 * (DEGREES * (DEGREES + 1) - 2) + drag
    assert after(DampedMidpoint(viscosity=0.05, drag=drag)) == pytest.approx(np.exp(-rate * T) * C, abs=1e-13)


@pytest.mark.parametrize("drag", [0.0, 0.2])
def test_stirring_adds_what_has_not_decayed_yet(drag):
    """c(t) = e^{λt} c(0) + f (e^{λt} − 1)/λ, and c(0) + ft where λ = 0."""
    rate = -0.05 * (DEGREES * (DEGREES + 1) - 2) - drag
    gain = np.where(rate == 0, T, np.expm1(rate * T) / np.where(rate == 0, 1.0, rate))
    force = np.zeros((5, 5), complex)
    force[:3, :3] = FORCE
    found = after(DampedMidpoint(viscosity=0.05, drag=drag, stirring=FORCE))
    assert found == pytest.approx(np.exp(rate * T) * C + gain * force, abs=1e-13)


def test_a_step_is_half_of_it_a_step_of_the_fluid_and_half_of_it_again(monkeypatch):
    asked = []
    monkeypatch.setattr(IsospectralMidpoint, "advance", lambda self, system, record, h: asked.append(h) or record)
    monkeypatch.setattr(IsospectralMidpoint, "balance", lambda self, system, inner, h, end: inner.mu - end.mu)
    method, start = DampedMidpoint(drag=0.3), fluids.start(FLUID, C)
    end = evaluate(partial(method.advance, FLUID), start, np.array(T))
    assert fluids.vorticity(FLUID, end) == pytest.approx(np.exp(-0.3 * T) * C, abs=1e-13) and len(asked) == 1
    assert np.max(np.abs(evaluate(lambda s, h: method.balance(FLUID, s, h, s), start, np.array(T)))) == 0.0


def test_the_highest_degree_decays_fastest_and_claims_are_those_of_what_is_damped():
    assert DampedMidpoint(viscosity=0.05, drag=0.2).damping_rate(FLUID) == pytest.approx(0.05 * (5 * 4 - 2) + 0.2)
    assert DampedMidpoint(drag=0.2).damping_rate(fluids.euler(2)) == 0.2
    assert DampedMidpoint().claims == IsospectralMidpoint().claims
    for damped in (DampedMidpoint(drag=0.1), DampedMidpoint(viscosity=0.1), DampedMidpoint(stirring=FORCE)):
        claims = damped.claims
        assert (claims.symplectic, claims.momentum, claims.energy) == (False, False, "changed")
    assert DampedMidpoint(viscosity=0.5, stirring=FORCE).title == "DampedMidpoint(viscosity=0.5, stirring)"


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"viscosity": -1e-9}, "`viscosity` must be a finite number from 0"),
        ({"drag": np.inf}, "`drag` must be a finite number from 0"),
        ({"drag": True}, "`drag` must be a finite number from 0"),
        ({"stirring": np.diag([1.0 + 0j, 0.0])}, "with c_00 = 0"),
    ],
)
def test_what_damps_nothing_is_refused(given, sentence):
    with pytest.raises(ArgumentError, match=sentence):
        DampedMidpoint(**given)


def test_a_fluid_that_carries_a_function_or_is_too_large_is_refused():
    with pytest.raises(ArgumentError, match="take a fluid that carries nothing"):
        DampedMidpoint(drag=0.1).require_fit(fluids.boussinesq(4))
    with pytest.raises(ArgumentError, match="take N up to 406, or drag alone"):
        DampedMidpoint(viscosity=0.1).require_fit(fluids.euler(407))
    DampedMidpoint(drag=0.1).require_fit(FLUID)
