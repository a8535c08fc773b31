"""What fits in memory is made, and what does not is refused with its size."""

import jax.numpy as jnp
import pytest

import coadjoint as co
from coadjoint.errors import ArgumentError


def energy(xi):
    return 0.5 * jnp.sum(xi**2)


@pytest.mark.parametrize("coupling", ["chain", "ring", "all", [(0, 1)]], ids=str)
@pytest.mark.parametrize("factor", [co.SO3(), co.Translation(0), co.Translation(100), co.Un(64), co.SUn(32)], ids=str)
def test_links_that_fit_are_taken(monkeypatch, factor, coupling):
    monkeypatch.setattr("coadjoint.memory.installed", lambda: 1e9)
    for given in ({"lagrangian": energy}, {"hamiltonian": energy}):
        if factor.dim < 1000 or "hamiltonian" in given:
            co.System(co.Power(factor, 3, coupling), verify=False, **given)


@pytest.mark.parametrize(
    "coupling",
    ["chain", "ring", "all", pytest.param([(0, i) for i in range(1, 2000)], marks=pytest.mark.long)],
    ids=["a", "b", "c", "star"],
)
def test_links_that_do_not_fit_are_refused_with_the_number_that_does(monkeypatch, coupling):
    monkeypatch.setattr("coadjoint.memory.installed", lambda: 2e7)
    with pytest.raises(
        ArgumentError, match=r"2000 links on SO3\(\) would take .* GB: take up to (\d+) links"
    ) as caught:
        co.System(co.Power(co.SO3(), 2000, coupling), energy)
    fits = int(str(caught.value).split("take up to ")[1].split()[0])
    if isinstance(coupling, str):
        co.System(co.Power(co.SO3(), fits, coupling), energy, verify=False)
        with pytest.raises(ArgumentError, match="would take"):
            co.System(co.Power(co.SO3(), fits + 1, coupling), energy, verify=False)
    co.System(co.Power(co.SO3(), 2000, coupling), hamiltonian=energy, verify=False)  # fixed points hold no Jacobian
