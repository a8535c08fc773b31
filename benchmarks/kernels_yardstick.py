"""The vehicle by hand: the loop that a careful engineer would write in numba, as a yardstick for the native kernel.

The paper's underwater vehicle with diagonal mass and inertia, left rectangle rule, Cayley map. Everything is scalar and
analytic: ν from its linear equation once a step, Newton on ω with the closed-form Jacobian, inverted with one division,
and the kernels' stopping rule. `python -m benchmarks` sets everything else beside it.
"""

from __future__ import annotations

import numba
import numpy as np

from coadjoint.kernels.program import FLOOR, MAX_ITERATIONS, STALLED, TOLERANCE

# State: t, R by rows (9), n, a, mu, pi, omega, nu: 28 numbers. Parameters: M (3), J (3), mg − B, −B·r (3).


@numba.njit(fastmath={"contract", "nsz"}, error_model="numpy", cache=False, boundscheck=False)
def run(p, h, s, records, save_every, out):
    """Advance `s` in place by records·save_every steps; returns steps and Newton iterations."""
    m1, m2, m3, j1, j2, j3, weight, b1, b2, b3 = p
    t = s[0]
    r11, r12, r13, r21, r22, r23, r31, r32, r33 = s[1:10]
    n1, n2, n3, a1, a2, a3 = s[10:16]
    u1, u2, u3, p1, p2, p3 = s[16:22]
    w1, w2, w3, v1, v2, v3 = s[22:28]
    floor = FLOOR / abs(h)
    i1, i2, i3 = 1.0 / m1, 1.0 / m2, 1.0 / m3
    hh = 0.5 * h
    qq = 0.25 * h * h
    iterations = 0
    steps = 0
    for record in range(records):
        for step in range(save_every):
            # π + κ = M ν, κ = h (mg − B) a
            k1 = p1 + h * weight * a1
            k2 = p2 + h * weight * a2
            k3 = p3 + h * weight * a3
            d1 = k1 * i1 - v1
            d2 = k2 * i2 - v2
            d3 = k3 * i3 - v3
            change = max(abs(d1), abs(d2), abs(d3))
            v1 = k1 * i1
            v2 = k2 * i2
            v3 = k3 * i3
            largest = max(abs(v1), abs(v2), abs(v3))
            # μ + D, D = h (∂_aℓ × a + ∂_nℓ × n + Mν × ν)
            c1 = weight * n1 + b1
            c2 = weight * n2 + b2
            c3 = weight * n3 + b3
            l1 = u1 + h * (c2 * a3 - c3 * a2 + weight * (a2 * n3 - a3 * n2) + k2 * v3 - k3 * v2)
            l2 = u2 + h * (c3 * a1 - c1 * a3 + weight * (a3 * n1 - a1 * n3) + k3 * v1 - k1 * v3)
            l3 = u3 + h * (c1 * a2 - c2 * a1 + weight * (a1 * n2 - a2 * n1) + k1 * v2 - k2 * v1)
            settled = False
            before, near = 0.0, False
            for _ in range(MAX_ITERATIONS):
                x1 = j1 * w1
                x2 = j2 * w2
                x3 = j3 * w3
                e = qq * (w1 * x1 + w2 * x2 + w3 * x3)
                f1 = l1 - (x1 + hh * (w2 * x3 - w3 * x2) + e * w1)
                f2 = l2 - (x2 + hh * (w3 * x1 - w1 * x3) + e * w2)
                f3 = l3 - (x3 + hh * (w1 * x2 - w2 * x1) + e * w3)
                # J + (h/2)(ω^×J − (Jω)^×) + (h²/4)(2ω(Jω)ᵀ + (ω·Jω) I)
                g1 = 2.0 * qq * w1
                g2 = 2.0 * qq * w2
                g3 = 2.0 * qq * w3
                z11 = j1 + e + g1 * x1
                z12 = hh * (x3 - w3 * j2) + g1 * x2
                z13 = hh * (w2 * j3 - x2) + g1 * x3
                z21 = hh * (w3 * j1 - x3) + g2 * x1
                z22 = j2 + e + g2 * x2
                z23 = hh * (x1 - w1 * j3) + g2 * x3
                z31 = hh * (x2 - w2 * j1) + g3 * x1
                z32 = hh * (w1 * j2 - x1) + g3 * x2
                z33 = j3 + e + g3 * x3
                y11 = z22 * z33 - z23 * z32
                y12 = z23 * z31 - z21 * z33
                y13 = z21 * z32 - z22 * z31
                over = 1.0 / (z11 * y11 + z12 * y12 + z13 * y13)
                e1 = (y11 * f1 + (z13 * z32 - z12 * z33) * f2 + (z12 * z23 - z13 * z22) * f3) * over
                e2 = (y12 * f1 + (z11 * z33 - z13 * z31) * f2 + (z13 * z21 - z11 * z23) * f3) * over
                e3 = (y13 * f1 + (z12 * z31 - z11 * z32) * f2 + (z11 * z22 - z12 * z21) * f3) * over
                w1 += e1
                w2 += e2
                w3 += e3
                iterations += 1
                size, scale = max(abs(e1), abs(e2), abs(e3)), max(abs(w1), abs(w2), abs(w3))
                together = max(size, change) <= TOLERANCE * max(scale, largest) + floor
                stalled = together and near and size > STALLED * before
                if (size <= TOLERANCE * scale + floor or stalled) and change <= TOLERANCE * largest + floor:
                    settled = True
                    break
                change, before, near = 0.0, size, together
            if not settled:
                return steps, iterations
            if step == 0:
                out[record, 0] = t
                out[record, 1:10] = r11, r12, r13, r21, r22, r23, r31, r32, r33
                out[record, 10:16] = n1, n2, n3, a1, a2, a3
                out[record, 16:22] = u1, u2, u3, p1, p2, p3
                out[record, 22:28] = w1, w2, w3, v1, v2, v3
            # F = I + (x̂ + x̂²/2)/(1 + |x|²/4), x = hω
            x1 = h * w1
            x2 = h * w2
            x3 = h * w3
            s11 = x1 * x1
            s22 = x2 * x2
            s33 = x3 * x3
            over = 1.0 / (1.0 + 0.25 * (s11 + s22 + s33))
            f11 = 1.0 - 0.5 * (s22 + s33) * over
            f22 = 1.0 - 0.5 * (s11 + s33) * over
            f33 = 1.0 - 0.5 * (s11 + s22) * over
            f12 = (0.5 * x1 * x2 - x3) * over
            f21 = (0.5 * x1 * x2 + x3) * over
            f13 = (0.5 * x1 * x3 + x2) * over
            f31 = (0.5 * x1 * x3 - x2) * over
            f23 = (0.5 * x2 * x3 - x1) * over
            f32 = (0.5 * x2 * x3 + x1) * over
            r11, r12, r13 = _row(r11, r12, r13, f11, f12, f13, f21, f22, f23, f31, f32, f33)
            r21, r22, r23 = _row(r21, r22, r23, f11, f12, f13, f21, f22, f23, f31, f32, f33)
            r31, r32, r33 = _row(r31, r32, r33, f11, f12, f13, f21, f22, f23, f31, f32, f33)
            n1, n2, n3 = _row(n1 + h * v1, n2 + h * v2, n3 + h * v3, f11, f12, f13, f21, f22, f23, f31, f32, f33)
            a1, a2, a3 = _row(a1, a2, a3, f11, f12, f13, f21, f22, f23, f31, f32, f33)
            u1, u2, u3 = _row(l1, l2, l3, f11, f12, f13, f21, f22, f23, f31, f32, f33)
            p1, p2, p3 = _row(k1, k2, k3, f11, f12, f13, f21, f22, f23, f31, f32, f33)
            t += h
            steps += 1
    s[0] = t
    s[1:10] = r11, r12, r13, r21, r22, r23, r31, r32, r33
    s[10:16] = n1, n2, n3, a1, a2, a3
    s[16:22] = u1, u2, u3, p1, p2, p3
    s[22:28] = w1, w2, w3, v1, v2, v3
    return steps, iterations


@numba.njit(fastmath={"contract", "nsz"}, inline="always")
def _row(x, y, z, f11, f12, f13, f21, f22, f23, f31, f32, f33):
    """(x, y, z) F, which is also Fᵀ(x, y, z)."""
    return x * f11 + y * f21 + z * f31, x * f12 + y * f22 + z * f32, x * f13 + y * f23 + z * f33


def arguments(vehicle) -> tuple[float, ...]:
    """The yardstick's parameters from a vehicle with diagonal matrices."""
    moment = -float(vehicle.buoyancy) * np.asarray(vehicle.center)
    diagonals = (*np.diag(vehicle.mass), *np.diag(vehicle.inertia))
    return tuple(map(float, (*diagonals, vehicle.net_weight, *moment)))
