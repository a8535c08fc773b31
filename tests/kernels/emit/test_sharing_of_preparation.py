"""What `prepare` computes stands once in the expressions of a step, for equations, records, certificates, monitors."""

from __future__ import annotations

from dataclasses import dataclass

import jax.numpy as jnp
from vehicle import PAPER, VehicleProgram, start

from coadjoint.kernels.emit.plan import plan
from coadjoint.kernels.expressions.expression import reachable


@dataclass(frozen=True)
class Prepared(VehicleProgram):
    """A preparation whose terms the equations collect: (p x)(q y) = (p q)(x y)."""

    def prepare(self, p, s, h):
        return s._replace(mu=s.mu + jnp.sin((p.net_weight * s.a) * (p.buoyancy * s.n)))


def test_certificates_and_monitors_share_with_the_equations_what_prepare_computes():
    planned = plan(Prepared(), PAPER, start(0.05), (2,) * 23, observed=True)
    (stage,) = planned.stages
    equations, observed = [*stage.residual, *stage.after], [*planned.certificates.values(), *planned.monitors]
    sines = [node for node in reachable([*equations, *observed, *planned.record]) if node.op == "sin"]
    assert len(sines) == 3
    for roots in (equations, observed, planned.record):
        assert set(sines) <= set(reachable(roots))
