"""Chains of ball joints that fall from the horizontal, and linkages: time of a step, error of the energy, set-up.

Run as: python -m benchmarks.joints [LINKS[,STEP] …], by default 2 10 10,0.001 50 50,0.001 128 1000; a line for each,
then those of linkages. N rods of 0.5 m and 1 kg hang from the origin, in maximal coordinates, SO(3)ᴺ × ℝ³ᴺ, for 5 s.
The error of the energy at every tenth step is relative to mgNl/2 of all N. With `mujoco` installed, the same chain runs
there in minimal coordinates, up to 128 links. Times are of one processor's core, without monitors.
"""

from __future__ import annotations

import sys
import time
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import jax.numpy as jnp
import numpy as np

import coadjoint as co
from coadjoint.models.multibody import Body, Joint, Mechanism

LENGTH, INERTIA, GRAVITY, DURATION = 0.5, np.diag([0.002, 0.021, 0.021]), 9.81, 5.0
END = np.array([LENGTH / 2, 0, 0])
INTEGRATORS = ("RK4", "implicitfast")
LONGEST = 128
"""The longest chain in MuJoCo: a step takes the cube of the links."""


def chain(count: int) -> co.System:
    """Rods on ball joints, each by its first end on the last end of the one before."""

    def lagrangian(xi, n, nu, a):
        return 0.5 * jnp.sum(xi * (xi @ INERTIA)) + 0.5 * jnp.sum(nu * nu) - GRAVITY * jnp.sum(n * a.z)

    def joints(n, a):
        g = jnp.stack([a.x, a.y, a.z], axis=1)
        first, last = jnp.einsum("ikj,ij->ik", g, n - END), jnp.einsum("ikj,ij->ik", g, n + END)
        return jnp.ravel(first - jnp.concatenate([jnp.zeros((1, 3)), last[:-1]]))

    return co.System(
        co.Power(co.SO3(), count, coupling="chain"),
        lagrangian,
        additional=co.Defining(),
        advected={name: co.Defining() for name in "xyz"},
        constraints={"joints": co.Holonomic(joints)},
    )


def level(system: co.System) -> co.State:
    """The chain at rest along the first axis."""
    count = system.group.count
    axes = {name: np.tile(e, (count, 1)) for name, e in zip("xyz", np.eye(3), strict=True)}
    q = [((i + 0.5) * LENGTH, 0, 0) for i in range(count)]
    return system.state(g=np.broadcast_to(np.eye(3), (count, 3, 3)), q=q, a0=axes)


def energies(records: co.State) -> np.ndarray:
    """½ Σ μ·J⁻¹μ + ½ Σ |π|² + Σ g n·z of each record, J."""
    spin, moving, n, up = (
        leaf.reshape(len(records.t), -1, 3)
        for leaf in (records.mu, records.pi, records.n, records.a[:, -records.n.shape[1] :])
    )
    turning = np.sum(spin * (spin / np.diag(INERTIA)), axis=(1, 2)) / 2
    return turning + np.sum(moving**2, axis=(1, 2)) / 2 + GRAVITY * np.sum(n * up, axis=(1, 2))


def line(who: str, count: int, step: float, took: float, energy: np.ndarray, ready: float) -> str:
    """What is printed about a run of `took` s after `ready` s."""
    error = np.abs(energy - energy[0]).max() / (GRAVITY * LENGTH * count**2 / 2)
    each = took / round(DURATION / step) * 1e6
    return f"{who:22} N = {count:4} h = {step:g}: {each:8.1f} µs a step, energy {error:.1e}, set-up {ready:.1f} s"


def fallen(count: int, step: float) -> str:
    """A line about the chain here."""
    began = time.process_time()
    system = chain(count)
    start = level(system)
    quiet = {"dt": step, "monitors": False, "accuracy": False}
    whole = {"steps": round(DURATION / step), "save_every": 10}
    co.simulate(system, start, steps=2, **quiet)
    ready = time.process_time()
    run = co.simulate(system, start, **whole, **quiet)
    all_of_it, took = time.process_time() - began, time.process_time() - ready
    if run.plan.backend != "native":  # XLA compiles again for other numbers of records
        ready = time.process_time()
        co.simulate(system, start, **whole, **quiet)
        took = time.process_time() - ready
    return line(f"coadjoint, {run.plan.backend}", count, step, took, energies(run.records), all_of_it - took)


def in_mujoco(count: int, step: float, integrator: str) -> str:
    """A line about the chain in MuJoCo, the energy of every tenth step outside of the time."""
    mujoco: Any = import_module("mujoco")

    link = "".join(
        f'<body pos="{LENGTH if i else 0} 0 0"><inertial pos="{END[0]} 0 0" mass="1" '
        f'diaginertia="{" ".join(map(str, np.diag(INERTIA)))}"/><joint type="ball"/>'
        for i in range(count)
    )
    began = time.process_time()
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="{step}" integrator="{integrator}" gravity="0 0 -{GRAVITY}"/><worldbody>{link}'
        f"{'</body>' * count}</worldbody></mujoco>"
    )
    model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    found, ready = [data.energy.sum()], time.process_time()
    for _ in range(round(DURATION / step) // 10):
        mujoco.mj_step(model, data, nstep=10)
        found.append(data.energy.sum())
    took = time.process_time() - ready
    return line(f"MuJoCo, {integrator}", count, step, took, np.array(found), ready - began)


def four_bar(step: float = 0.002) -> str:
    """A line about a linkage of three bars on four hinges, three of whose rows are redundant."""
    corners = np.array([(0, 0, 0), (0, 0, 0.3), (0.75, 0, 0.6), (0.9, 0, 0)])
    bars = {}
    for name, start, end in zip(("crank", "coupler", "rocker"), corners[:-1], corners[1:], strict=True):
        length = np.linalg.norm(end - start)
        along, across = (end - start) / length, np.array([0.0, 1.0, 0.0])
        frame = np.stack([along, across, np.cross(along, across)], axis=1)
        moments = (1e-3, length**2 / 12, length**2 / 12)
        bars[name] = Body(mass=1.0, inertia=moments, position=(start + end) / 2, rotation=frame)
    names = ["ground", *bars, "ground"]
    joints = {
        f"hinge_{k}": Joint("revolute", names[k], names[k + 1], at=corners[k], axis=(0, 1, 0))
        for k in range(len(corners))
    }
    began = time.process_time()
    linkage = Mechanism(bodies=bars, joints=joints)
    start = linkage.state(coordinates={"hinge_0": 0.4}, speeds={"hinge_0": 6.0})
    co.simulate(linkage.system, start, dt=step, steps=2, accuracy=False)
    ready = time.process_time()
    run = co.simulate(linkage.system, start, dt=step, steps=20_000, save_every=1000, accuracy=False)
    took = (time.process_time() - ready) / 20_000
    gap = run.extrema["constraint_gap"][1]
    return (
        f"four-bar linkage, {run.plan.backend}: {took * 1e6:.1f} µs a step, gap {gap:.1e}, set-up {ready - began:.1f} s"
    )


def main(given: list[str]) -> None:
    for one in given or ["2", "10", "10,0.001", "50", "50,0.001", "128", "1000"]:
        count, _, step = one.partition(",")
        case = int(count), float(step or 0.002)
        print(fallen(*case), flush=True)
        for integrator in INTEGRATORS if find_spec("mujoco") and case[0] <= LONGEST else ():
            print(in_mujoco(*case, integrator), flush=True)
    print(four_bar())


if __name__ == "__main__":
    main(sys.argv[1:])
