"""Monitors return what they declare: the names, single numbers, and values in the declared unit."""

from __future__ import annotations

import numpy as np

import coadjoint as co
from coadjoint.simulation.monitors import watched

SIZE = 1024.0


def monitored(size: float) -> dict[str, np.ndarray]:
    """The monitors of a braked body; ℓ and forces `size` times as large, as in another unit of mass, move it alike."""
    system = co.System(
        co.SO3(),
        lambda xi, a: size * (0.5 * xi @ (np.array([1.0, 2.0, 3.0]) * xi) - a[2]),
        advected=co.Defining(),
        forces={"drag": lambda motion: co.Force(-0.1 * size * motion.xi)},
    )
    start = system.state(xi=[0.3, 0.2, -0.2], a0=[0, 0, 1])
    return dict(co.simulate(system, start, dt=0.05, steps=3).monitors)


def test_monitors_return_what_they_declare_in_the_declared_unit():
    declared, one, large = watched(), monitored(1.0), monitored(SIZE)
    assert {*one} >= {"energy", "discrete_energy", "work_drag", "energy_budget", "group_defect"}
    for name, values in one.items():
        found = next((it for it in declared if name == it.name), None)
        found = found or next(it for it in declared if name.startswith(f"{it.name}_"))  # as `work` of `work_drag`
        assert found.meaning
        assert values.ndim == 1 or name.startswith("kelvin_noether")
        measures_mass = found.name in ("energy", "kelvin_noether") or found.like or found.line in ("change", "budget")
        scale = SIZE if measures_mass else 1.0
        np.testing.assert_allclose(large[name], scale * values, rtol=1e-12, atol=1e-13 * scale, err_msg=name)
