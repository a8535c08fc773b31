"""The fast heavy top of Brüls, Cardona and Arnold (2012) against its reference solution.

Run as: python examples/fast_heavy_top.py [duration in s: 0.2, 1 or 2]
It prints the error of the centre of mass for several methods and steps, with the order that two steps show.

A body with its point O fixed; its centre of mass is 1 m from O on the body's y axis, m = 15 kg, and it spins about that
axis at 150 rad/s. ℓ = ½ ω·J_O ω − mg x·a, with a the direction of up in the body.
"""

import sys

import numpy as np

import coadjoint as co

# The centre of mass at these times, by DOP853 at tolerances 1e-12 and 1e-13, which agree in all digits.
REFERENCE = {
    0.2: (0.605550561377, 0.598957681795, -0.523983027430),
    1.0: (0.173343964098, 0.640088592070, -0.748490791134),
    2.0: (-0.150416822746, -0.724165591637, -0.673022269560),
}
duration = float(sys.argv[1]) if len(sys.argv) > 1 else 2.0
if duration not in REFERENCE:
    sys.exit(f"The duration must be one of {', '.join(map(str, REFERENCE))} s, for which there is a reference.")

mass, center = 15.0, np.array([0.0, 1.0, 0.0])
about_center = np.diag([0.234375, 0.46875, 0.234375])
about_pivot = about_center + mass * (center @ center * np.eye(3) - np.outer(center, center))


def lagrangian(xi, a, p):
    return 0.5 * xi @ p.inertia @ xi - p.moment @ a


top = co.System(
    co.SO3(),
    lagrangian,
    advected=co.Defining(),
    parameters={"inertia": about_pivot, "moment": mass * 9.81 * center},
    name="fast heavy top",
)
start = top.state(xi=[0, 150, -4.61538], a0=[0, 0, 1])
methods = [
    co.Midpoint(co.Cayley()),
    co.Midpoint(co.Exponential()),
    co.methods.LeftRight(co.Cayley()),
    co.methods.LeftRight(co.Exponential()),
    co.Suzuki4(co.Midpoint(co.Cayley())),
]
print(f"{'method':<30} {'dt = 2e-4':>10} {'1e-4':>10} {'order':>6} {'steps/s':>12} {'momentum':>10}")
for method in methods:
    errors = []
    for dt in (2e-4, 1e-4):
        run = co.simulate(top, start, dt=dt, duration=duration, method=method, save_every=100)
        errors.append(np.linalg.norm(run.final.g @ center - REFERENCE[duration]))
    order = np.log2(errors[0] / errors[1])
    speed, momentum = run.good_steps / run.seconds, run.relative_change("kelvin_noether")
    print(f"{method.title:<30} {errors[0]:>10.1e} {errors[1]:>10.1e} {order:>6.2f} {speed:>12,.0f} {momentum:>10.0e}")
