"""Splines on SO(3): the smoothest turns through given attitudes at given times, from rest to rest.

Run as: python examples/attitude_splines.py [steps of each leg]
The cubic one has the least ∫ ½|ξ'|² dt of all motions R' = R ξ̂ through the attitudes; it is made of Riemannian cubics,
ξ''' = ξ'' × ξ. The other one, of the seventh order, has the least ∫ ½|ξ'''|² dt. Each leg is a phase. For the first one
the torque u on a ball of inertia 1 is ξ'; for the second one n = ξ' is a state of its own, with n'' = u. It prints the
costs, and by how much u at the end of a leg differs from that where the next begins; it writes attitude_splines.png."""

import sys
from itertools import pairwise

import matplotlib.pyplot as plt
import numpy as np

import coadjoint as co
from coadjoint.control import End, Input, Phases, Problem

steps = int(sys.argv[1]) if len(sys.argv) > 1 else 30
ANGLES = [(0.0, 0.0, 0.0), (1.0, 0.5, 0.0), (1.2, -0.4, 0.8), (2.5, 0.0, 1.2)]  # rad: yaw, pitch, roll, 1 s apart

cubic = co.System(co.SO3(), lambda xi: 0.5 * xi @ xi, forces=lambda motion: co.Force(torque=motion.inputs.u))
seventh = co.System(
    co.SO3(),
    lambda xi, n, nu: 0.5 * xi @ xi + 0.5 * nu @ nu,
    additional=co.Trivial(3),
    forces=lambda motion: co.Force(torque=motion.n, force=motion.inputs.u),
)


def spline(system, attitudes, steps, **rest):
    """The phases from attitude to attitude, 1 s each; rest: what else is zero at both ends."""
    ends = [End(g=R) for R in attitudes[1:-1]] + [End(g=attitudes[-1], xi=np.zeros(3), **rest)]
    start = {"q": np.zeros(3), "qdot": np.zeros(3)} if rest else {}
    legs = {
        f"leg {k + 1}": Problem(
            system,
            system.state(g=attitudes[k], **start),
            dt=1.0 / steps,
            steps=steps,
            inputs={"u": Input((3,))},
            cost=lambda motion: 0.5 * motion.inputs.u @ motion.inputs.u,
            end=end,
        )
        for k, end in enumerate(ends)
    }
    return Phases(legs).solve(guess="simulate")


attitudes = [co.attitude.zyx(*angles) for angles in ANGLES]
found = {
    "cubic": spline(cubic, attitudes, steps),
    "seventh order": spline(seventh, attitudes, steps, q=np.zeros(3), qdot=np.zeros(3)),
}
figure, axes = plt.subplots(3, 1, figsize=(7.2, 7.2), sharex=True, layout="constrained")
for (name, optimum), style in zip(found.items(), ("-", "--"), strict=True):
    u = [inputs["u"] for inputs in optimum.inputs.values()]
    gaps = [np.linalg.norm(1.5 * a[-1] - 0.5 * a[-2] - 1.5 * b[0] + 0.5 * b[1]) for a, b in pairwise(u)]
    print(f"{name}: ∫½|u|² {sum(optimum.costs.values()):.4f}, u differs by {max(gaps):.4f} where legs meet")
    R, xi = (np.concatenate([getattr(run.records, part) for run in optimum.runs.values()]) for part in ("g", "mu"))
    t = np.concatenate([run.records.t for run in optimum.runs.values()])
    middle = np.linspace(0.5 / steps, 3 - 0.5 / steps, 3 * steps)
    rows = u if name == "cubic" else [run.records.n for run in optimum.runs.values()]
    slope, times = np.concatenate(rows), middle if name == "cubic" else t
    angles = np.arctan2(R[:, 2, 1], R[:, 2, 2]), -np.arcsin(R[:, 2, 0]), np.arctan2(R[:, 1, 0], R[:, 0, 0])
    for k, label in enumerate(("roll", "pitch", "yaw")):
        axes[0].plot(t, angles[k], f"C{k}{style}", label=f"{label}, {name}")
        axes[1].plot(t, xi[:, k], f"C{k}{style}")
        axes[2].plot(times, slope[:, k], f"C{k}{style}")
for k in range(3):
    axes[0].plot(np.arange(4), np.array(ANGLES)[:, 2 - k], f"C{k}o")
axes[0].set(ylabel="angle (rad)")
axes[0].legend(frameon=False, ncols=2, fontsize="small")
axes[1].set(ylabel="ξ (rad/s)")
axes[2].set(xlabel="time (s)", ylabel="ξ' (rad/s²)")
figure.savefig("attitude_splines.png", dpi=110)
