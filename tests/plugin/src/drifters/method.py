"""The trapezoidal rule on a group alone."""

from __future__ import annotations

from dataclasses import dataclass

from coadjoint.extending import FullStep, Point, node
from coadjoint.methods import Method


@dataclass(frozen=True)
class Ends(Method, FullStep):
    """Λ = ½hℓ(ξ, a) + ½hℓ(ξ, F⁻¹a) with F = τ(hξ), of order 2."""

    @property
    def order(self):
        return 2

    @property
    def symmetric(self):
        return True

    @property
    def stages(self):
        return ((self, 1.0),)

    def ends(self, system, record, h):
        group, _, V = system.places
        F = self.relative(system, record, h)
        a = V.act(group, group.inverse(F), record.a)
        first = Point(record.xi, record.n, record.nu, record.a, record.t)
        last = Point(record.xi, record.n, record.nu, a, record.t + h)
        return F, last, node(system, record, first), node(system, record, last)

    def nodes(self, system, record, h):
        _, _, begin, end = self.ends(system, record, h)
        return [(0.5, begin), (0.5, end)]

    def equations(self, system, record, h):
        _, _, begin, end = self.ends(system, record, h)
        momentum = self.difference_map.dtau_inverse_dual(system.group, h * record.xi, 0.5 * (begin.mu + end.mu))
        return momentum - record.mu - 0.5 * h * begin.torque

    def advance(self, system, record, h):
        F, last, begin, end = self.ends(system, record, h)
        mu = system.group.Ad_dual(F, record.mu + 0.5 * h * begin.torque) + 0.5 * h * end.torque
        return record.later(h, g=system.group.compose(record.g, F), n=record.n, a=last.a, mu=mu, pi=record.pi)

    def sources(self, system, record, h):
        _, _, begin, end = self.ends(system, record, h)
        return 0.5 * h * begin.source, 0.5 * h * end.source
