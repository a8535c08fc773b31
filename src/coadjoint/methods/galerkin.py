"""Methods of order 2, 4, 6 and 8 in single steps: Galerkin's, of polynomial curves about the middle of the step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import jax
import jax.numpy as jnp

from coadjoint import checks
from coadjoint.arrays import Array, Scalar
from coadjoint.groups.group import Element
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.discrete import Node, Point, node
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.method import Method
from coadjoint.methods.quadrature import gauss, lobatto
from coadjoint.methods.step import Step


class _Node(NamedTuple):
    """The values at a node: p = ∂ℓ/∂Ω and r = ∂ℓ/∂Θ in the chart, and D/h, Δ, P = ∂_νℓ, κ/h in the middle's frame."""

    at: Node
    p: Array
    r: Array
    torque: Array
    source: Array
    P: Array
    force: Array


class _Curve(NamedTuple):
    """The curve of a step: Θ₀, Θ₁, τ(Θ₀), X = τ(Θ₀)⁻¹, x₀, x₁, the advected parameters at the middle, and the nodes."""

    first: Array
    last: Array
    start: Element
    back: Element
    x_first: Array
    x_last: Array
    a: Array
    nodes: list[_Node]


@dataclass(frozen=True)
class Galerkin(Method, Step):
    """Λ = ext h Σ b_i ℓ(ξ, n, ν, a)(c_i h) over curves of degree s, Gauss's nodes c_i: order 2s, symmetric.

    The curves are g(t) = ḡ τ(Θ(t)), q(t) = ḡ·x(t) with polynomials Θ, x of degree s and Θ(h/2) = 0, so that ḡ is the
    middle of the step. The unknowns are Ω_i = Θ̇(c_i h), V_i = ẋ(c_i h); at node i, with H_i = τ(Θ_i),
    ξ = dτ_{−Θ_i} Ω_i, n = H_i⁻¹x_i, ν = H_i⁻¹V_i, a = H_i⁻¹ā. Momenta in the middle's frame: μ̃₀ = Ad*_X μ_k with
    X = τ(Θ₀)⁻¹, π̃₀ = X*π_k, μ̃₁ = μ̃₀ + Σ b_i Ad*_{H_i⁻¹} D_i, π̃₁ = π̃₀ + Σ b_i H_i⁻*κ_i. Solve

        p_j + h Σ_i (b_i/b_j) α_ij r_i = (m_j/b_j) dτ*_{−Θ₀} μ_k + (1 − m_j/b_j) dτ*_{Θ₁} μ̃₁,
        H_i⁻*∂_νℓ_i = π̃₀ + Σ_j a_ij H_j⁻*κ_j,

    p = dτ*_{−Θ} ∂_ξℓ, r = ∂_Θ⟨∂_ξℓ, dτ_{−Θ} Ω⟩ + dτ*_{−Θ} D/h, a_ij = ∫₀^{c_i} L_j, m_j = ∫₀^½ L_j, α_ij = a_ij − m_j;
    then g_{k+1} = g_k X τ(Θ₁), μ_{k+1} = Ad*_{τ(Θ₁)} μ̃₁, π_{k+1} = τ(Θ₁)*π̃₁. degree: s, 1 to 4, by default 2; s = 1 is
    Midpoint. A record holds ξ and ν of the curve at the middle, the nodes' Ω, V in `memory`: (s (dim G + ambient),).

    On a curved Q ⊂ W the polynomial x of W goes through points X_j ∈ Q at Lobatto's s + 1 nodes, x = Σ X_j M_j, and Λ
    is stationary among these. With R_j = Σ_i b_i (M_j(c_i) H_i⁻*κ_i + M_j′(c_i) H_i⁻*∂_νℓ_i) the second line becomes

        π̃₀ + R₀ = 0 on T_{X₀}Q, R_j = 0 on T_{X_j}Q, 0 < j < s; then π̃₁ = R_s on T_{X_s}Q.

    Off its points x leaves Q by O(h^{s+1})(t − X's nodes), orthogonal to polynomials of degree s − 2: the order stays
    2s. X_j = τ(Θ₀)·ρ(n, hE_n y_j) with unknowns y_j; the step depends on neither ρ nor E.
    Raises ArgumentError for a velocity start and for actions that are not affine. (Marsden–West 2001, section 2.6;
    Hall–Leok 2017; the points on Q are this library's own.)
    """

    constrainable = False

    degree: int = 2

    def __post_init__(self):
        super().__post_init__()
        fits = type(self.degree) is int and self.degree in (1, 2, 3, 4)
        checks.expect(fits, self.degree, "degree", "1, 2, 3 or 4, for the orders 2, 4, 6 and 8")
        self._start_from_momenta()

    @property
    def order(self) -> int:
        return 2 * self.degree

    @property
    def symmetric(self) -> bool:
        return True

    @property
    def stages(self) -> tuple[tuple[Step, float], ...]:
        return ((self, 1.0),)

    @property
    def title(self) -> str:
        return f"Galerkin({self.difference_map!r}, degree={self.degree})"

    def remember(self, system: System, state: State) -> State:
        """Ω and V of the last step; at a start, constant velocities."""

        def constant(xi: Array, nu: Array):
            return jnp.concatenate([xi] * self.degree + [nu] * self.degree, axis=-1)

        return state.replace(memory=evaluate(constant, state.xi, state.nu))

    def blocks(self, system: System) -> tuple[int, ...]:
        of_g, of_q = super().blocks(system)
        return self.degree * of_g, self.degree * of_q

    def _velocities(self, system: System, z: Array) -> tuple[Array, Array]:
        """Ω (s, dim G) and V (s, ambient), or y (s, dim Q)."""
        split = self.blocks(system)[0]
        width = (z.shape[0] - split) // self.degree
        return z[:split].reshape(self.degree, -1), z[split:].reshape(self.degree, width)

    def record(self, system: System, state: State, h: Scalar, z: Array) -> State:
        """The velocities at the middle, where dτ = 1, and those of the nodes."""
        omega, v = self._velocities(system, z)
        if not system.additional.flat:
            v = self._through_points(system, state, h, omega, v)
        middle, memory = gauss(self.degree).middle, jnp.concatenate([jnp.ravel(omega), jnp.ravel(v)])
        return state.replace(xi=middle @ omega, nu=middle @ v, memory=memory)

    def _through_points(self, system: System, state: State, h: Scalar, omega: Array, y: Array) -> Array:
        """V of the polynomial through n and ρ(n, hE_n y_j), in the frame of the middle."""
        group, Q, _ = system.places
        start = self.difference_map.tau(group, -h * (gauss(self.degree).half @ omega))
        chords = [Q.difference(group, state.n, h * Q.tangent(group, state.n, at)) / h for at in y]
        return lobatto(self.degree).slope[:, 1:] @ jnp.stack([Q.push(group, start, state.n, d) for d in chords])

    def guess(self, system: System, state: State, h: Scalar) -> Array:
        """The curve of the last step, continued by its polynomials, in the frame of the new middle.

        With the old chart's Θ_i at the new nodes, ξ_i = dτ_{−Θ_i} Ω_i stays, and the new chart has dτ⁻¹_{−Θ_i} ξ_i.
        """
        group, Q, _ = system.places
        tau, rule = self.difference_map, gauss(self.degree)
        omega, v = (rule.ahead @ old for old in self._velocities(system, state.memory))
        theta = self._ends(system, state, h)[1] + h * (rule.until @ omega)
        xi = [tau.dtau(group, -at, old) for at, old in zip(theta, omega, strict=True)]
        theta = h * (rule.centred @ omega)
        omega = jnp.stack([tau.dtau_inverse(group, -at, own) for at, own in zip(theta, xi, strict=True)])
        turned = tau.tau(group, -self._ends(system, state, h)[1])
        if Q.flat:
            turned = group.compose(tau.tau(group, -h * (rule.half @ omega)), turned)
        v = jnp.stack([Q.push(group, turned, state.n, at) for at in v])
        if not Q.flat:
            v = jnp.stack([Q.coordinates(group, state.n, at) for at in lobatto(self.degree).reach @ v])
        return jnp.concatenate([jnp.ravel(omega), jnp.ravel(v)])

    def _ends(self, system: System, record: State, h: Scalar) -> tuple[Array, Array]:
        """Θ₀ and Θ₁."""
        rule, (omega, _) = gauss(self.degree), self._velocities(system, record.memory)
        return -h * (rule.half @ omega), h * (rule.half[::-1] @ omega)

    def _curve(self, system: System, record: State, h: Scalar) -> _Curve:
        group, Q, V = system.places
        rule, (omega, v) = gauss(self.degree), self._velocities(system, record.memory)
        first, last = self._ends(system, record, h)
        start = self.difference_map.tau(group, first)
        x_first, a = Q.act(group, start, record.n), V.act(group, start, record.a)
        theta, x = h * (rule.centred @ omega), x_first + h * (rule.until @ v)
        t = record.t + h * rule.c
        nodes = [self._node(system, record, theta[i], omega[i], x[i], v[i], a, t[i]) for i in range(self.degree)]
        return _Curve(first, last, start, group.inverse(start), x_first, x_first + h * (rule.b @ v), a, nodes)

    def _node(
        self, system: System, record: State, theta: Array, omega: Array, x: Array, v: Array, a: Array, t: Scalar
    ) -> _Node:
        group, Q, V = system.places
        tau = self.difference_map
        back = tau.tau(group, -theta)
        xi, pull = jax.vjp(lambda theta, omega: tau.dtau(group, -theta, omega), theta, omega)
        point = Point(xi, Q.act(group, back, x), Q.push(group, back, x, v), V.act(group, back, a), t)
        at = node(system, record, point)
        turning, p = pull(at.mu)
        return _Node(
            at=at,
            p=p,
            r=turning + pull(at.torque)[1],
            torque=group.Ad_dual(back, at.torque),
            source=group.Ad_dual(back, at.source),
            P=Q.pull(group, back, x, at.pi),
            force=Q.pull(group, back, x, at.force),
        )

    def _sum(self, curve: _Curve, name: str) -> Array:
        """Σ b_i of the values at the nodes."""
        return gauss(self.degree).b @ jnp.stack([getattr(at, name) for at in curve.nodes])

    def _momenta(self, system: System, record: State, h: Scalar, curve: _Curve) -> tuple[Array, Array, Array]:
        """π̃₀, μ̃₁, π̃₁."""
        group, Q, _ = system.places
        pi = Q.pull(group, curve.back, curve.x_first, record.pi)
        mu = group.Ad_dual(curve.back, record.mu)
        return pi, mu + h * self._sum(curve, "torque"), pi + h * self._sum(curve, "force")

    def _along_points(self, curve: _Curve, h: Scalar) -> Array:
        """R_j = ∂Λ/∂X_j, (s + 1, ambient)."""
        points, b = lobatto(self.degree), gauss(self.degree).b[:, None]
        P, force = (jnp.stack([getattr(at, name) for at in curve.nodes]) for name in ("P", "force"))
        return (b * points.slope).T @ P + h * ((b * points.value).T @ force)

    def _on_q(self, system: System, record: State, h: Scalar, curve: _Curve, pi: Array) -> list[Array]:
        """π̃₀ + R₀ and the R_j between the ends on the tangent spaces of Q, s of shape (dim Q,) in n's frame."""
        group, Q, _ = system.places
        slopes, v = self._along_points(curve, h), self._velocities(system, record.memory)[1]
        between = curve.x_first + h * (lobatto(self.degree).reach[:-1] @ v)
        rows = [pi + slopes[0], *(Q.project(group, x, R) for x, R in zip(between, slopes[1:-1], strict=True))]
        return [Q.coordinates(group, record.n, Q.pull(group, curve.start, record.n, row)) for row in rows]

    def equations(self, system: System, record: State, h: Scalar) -> Array:
        group, rule = system.group, gauss(self.degree)
        curve = self._curve(system, record, h)
        pi, mu, _ = self._momenta(system, record, h, curve)
        left = self.difference_map.dtau_dual(group, -curve.first, record.mu)
        right = self.difference_map.dtau_dual(group, curve.last, mu)
        p, r, P, force = (jnp.stack([getattr(at, name) for at in curve.nodes]) for name in ("p", "r", "P", "force"))
        share = (rule.half / rule.b)[:, None]
        of_g = p + h * ((rule.centred.T * rule.b / rule.b[:, None]) @ r) - share * left - (1 - share) * right
        if not system.additional.flat:
            return jnp.concatenate([jnp.ravel(of_g), *self._on_q(system, record, h, curve, pi)])
        return jnp.concatenate([jnp.ravel(of_g), jnp.ravel(P - pi - h * (rule.until @ force))])

    def advance(self, system: System, record: State, h: Scalar) -> State:
        group, Q, V = system.places
        curve = self._curve(system, record, h)
        _, mu, pi = self._momenta(system, record, h, curve)
        end = self.difference_map.tau(group, curve.last)
        back = group.inverse(end)
        n = Q.act(group, back, curve.x_last)
        legendre = pi if Q.flat else self._along_points(curve, h)[-1]
        return record.later(
            h,
            g=group.compose(record.g, group.compose(curve.back, end)),
            n=n,
            a=V.act(group, back, curve.a),
            mu=group.Ad_dual(end, mu),
            pi=Q.momentum(group, n, Q.pull(group, end, n, pi), Q.pull(group, end, n, legendre)),
        )

    def nodes(self, system: System, record: State, h: Scalar) -> list[tuple[float, Node]]:
        curve = self._curve(system, record, h)
        return [(float(b), at.at) for b, at in zip(gauss(self.degree).b, curve.nodes, strict=True)]

    def relative(self, system: System, record: State, h: Scalar) -> Element:
        group, tau = system.group, self.difference_map
        first, last = self._ends(system, record, h)
        return group.compose(group.inverse(tau.tau(group, first)), tau.tau(group, last))

    def chart(self, system: System, record: State, h: Scalar) -> Array | float:
        """The further of the two ends."""
        ends = [self.difference_map.chart(system.group, theta) for theta in self._ends(system, record, h)]
        return jnp.maximum(*ends)

    def sources(self, system: System, record: State, h: Scalar) -> tuple[Array, Array]:
        """Σ b_i h Δ_i, carried from the middle to the frame of node k."""
        curve = self._curve(system, record, h)
        start = self.difference_map.tau(system.group, curve.first)
        source = system.group.Ad_dual(start, h * self._sum(curve, "source"))
        return source, jnp.zeros_like(source)
