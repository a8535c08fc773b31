"""Mechanisms of the tests: a body on each kind of joint, and linkages with closed forms."""

from __future__ import annotations

import numpy as np

from coadjoint.models.multibody import Body, Joint, Mechanism

MASS, MOMENTS, ARM, PITCH = 1.3, (0.10, 0.12, 0.05), 0.5, 0.4


def rod(**placed) -> Body:
    return Body(mass=MASS, inertia=MOMENTS, **placed)


def pendulum(**options) -> Mechanism:
    """A rod hung from a hinge, ARM above its centre, that turns about y."""
    hinge = Joint("revolute", "ground", "rod", at=(0, 0, 0), axis=(0, 1, 0), **options)
    return Mechanism(bodies={"rod": rod(position=(0, 0, -ARM))}, joints={"hinge": hinge})


JOINTS = {
    "fixed": {},
    "revolute": {"axis": (0, 1, 0)},
    "prismatic": {"axis": (0, 0, 2), "stiffness": 30.0},
    "cylindrical": {"axis": (0, 0, 1)},
    "planar": {"axis": (0, 1, 0)},
    "spherical": {},
    "universal": {"axis": (1, 0, 0), "across": (0, 1, 0)},
    "distance": {"to": (0, 0, -ARM)},
    "screw": {"axis": (0, 0, 1), "pitch": PITCH},
}
"""Of each kind between the ground and a body, but for those that need more than one body or velocities."""
FREEDOMS = dict(zip(JOINTS, (0, 1, 1, 2, 3, 3, 2, 5, 1), strict=True))


def bar(start, end) -> dict:
    """A slender bar between two points, its mass 1 kg, along the first axis of its frame."""
    start, end = np.array(start, float), np.array(end, float)
    length = np.linalg.norm(end - start)
    along = (end - start) / length
    across = np.eye(3)[np.argmin(np.abs(along))]
    across = np.cross(along, across) / np.linalg.norm(np.cross(along, across))
    frame = np.stack([along, across, np.cross(along, across)], axis=1)
    J = length**2 / 12
    return {"mass": 1.0, "inertia": (1e-3, J + 1e-3, J + 1e-3), "position": (start + end) / 2, "rotation": frame}


CORNERS = {"A": (0.0, 0.0, 0.0), "B": (0.0, 0.0, 0.3), "C": (0.75, 0.0, 0.6), "D": (0.9, 0.0, 0.0)}


def four_bar(**options) -> Mechanism:
    """A crank, a coupler and a rocker on four hinges about y: a loop with three redundant rows."""
    A, B, C, D = CORNERS.values()
    hinge = {"axis": (0, 1, 0)}
    return Mechanism(
        bodies={"crank": Body(**bar(A, B)), "coupler": Body(**bar(B, C)), "rocker": Body(**bar(C, D))},
        joints={
            "A": Joint("revolute", "ground", "crank", at=A, **hinge, **options),
            "B": Joint("revolute", "crank", "coupler", at=B, **hinge),
            "C": Joint("revolute", "coupler", "rocker", at=C, **hinge),
            "D": Joint("revolute", "ground", "rocker", at=D, **hinge),
        },
    )


FLAT = {5e-4: (0.3284465114, 0.9445225721), 2.5e-4: (0.3284552113, 0.9445195467), 1.25e-4: (0.3284573768, 0.9445187937)}
"""B0 of the double four-bar linkage after 10 s by steps of a generalised-alpha method: numbers that the model
`fourBarMechanismIftomm` of Exudyn states, x and y in m."""


def double_four_bar() -> Mechanism:
    """Two four-bar windows of five bars of 1 m and 1 kg, upright at first: A02 of IFToMM's library with N = 2.

    Where all bars lie flat, the rows lose rank: González, Dopico, Lugrís and Cuadrado, Multibody System Dynamics 16
    (2006) 179.
    """

    def link(start, end):
        return Body(**{**bar(start, end), "inertia": (1e-3, 1 / 12, 1 / 12)})

    hinge = {"axis": (0, 0, 1)}
    bodies, joints = {}, {}
    for i in range(3):
        bodies[f"rocker_{i}"] = link((i, 0, 0), (i, 1, 0))
        joints[f"A{i}"] = Joint("revolute", "ground", f"rocker_{i}", at=(i, 0, 0), **hinge)
    for i in range(2):
        bodies[f"coupler_{i}"] = link((i, 1, 0), (i + 1, 1, 0))
        joints[f"B{i}"] = Joint("revolute", f"rocker_{i}", f"coupler_{i}", at=(i, 1, 0), **hinge)
        joints[f"C{i}"] = Joint("revolute", f"coupler_{i}", f"rocker_{i + 1}", at=(i + 1, 1, 0), **hinge)
    return Mechanism(bodies=bodies, joints=joints, gravity=(0, -9.81, 0))


HEXAGON = np.array([(1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 1, 1), (0, 0, 1), (1, 0, 1)], float)
"""The corners of a closed path along the edges of a cube."""


def bricard() -> Mechanism:
    """Bricard's linkage: five bars and the ground on six hinges, each at right angles to both of its bars."""
    names = ["ground", *(f"bar_{k}" for k in range(1, 6))]
    bodies = {name: Body(**bar(HEXAGON[k], HEXAGON[(k + 1) % 6])) for k, name in enumerate(names) if k}
    joints = {}
    for k in range(6):
        before, after = HEXAGON[k] - HEXAGON[k - 1], HEXAGON[(k + 1) % 6] - HEXAGON[k]
        axis = np.cross(before, after)
        joints[f"hinge_{k}"] = Joint("revolute", names[k - 1], names[k], at=HEXAGON[k], axis=axis)
    return Mechanism(bodies=bodies, joints=joints)


def gears(first: int, second: int, **options) -> Mechanism:
    """Two wheels on parallel shafts, whose teeth mesh."""
    shaft = {"axis": (0, 0, 1)}
    return Mechanism(
        bodies={"small": rod(), "large": rod(position=(1, 0, 0))},
        joints={
            "one": Joint("revolute", "ground", "small", at=(0, 0, 0), **shaft, **options),
            "two": Joint("revolute", "ground", "large", at=(1, 0, 0), **shaft),
            "mesh": Joint("gear", "one", "two", teeth=(first, second)),
        },
    )


def shafts(bend: float) -> Mechanism:
    """Two shafts that cross at an angle, rad, with a universal joint between them."""
    output = np.array([np.cos(bend), np.sin(bend), 0])
    return Mechanism(
        bodies={"input": rod(position=(-1, 0, 0)), "output": rod(position=output)},
        joints={
            "drive": Joint("revolute", "ground", "input", at=(-1, 0, 0), axis=(1, 0, 0)),
            "cross": Joint("universal", "input", "output", at=(0, 0, 0), axis=(0, 1, 0), across=(0, 0, 1)),
            "driven": Joint("revolute", "ground", "output", at=output, axis=output),
        },
    )


RADIUS, LEAN, TURNING = 0.3, 1.2, 1.5
THIN, THICK = 2.0 * RADIUS**2 / 4, 2.0 * RADIUS**2 / 2


def disk() -> Mechanism:
    """A disk of 2 kg that leans by LEAN from the vertical of its axis, on the plane z = 0 at the origin."""
    R = np.array([[1, 0, 0], [0, np.cos(LEAN), -np.sin(LEAN)], [0, np.sin(LEAN), np.cos(LEAN)]])
    center = R @ [0, RADIUS, 0]
    body = Body(mass=2.0, inertia=(THIN, THIN, THICK), position=center, rotation=R)
    wheel = Joint("rolling", "ground", "disk", at=center, axis=R[:, 2], radius=RADIUS, normal=(0, 0, 1))
    return Mechanism(bodies={"disk": body}, joints={"wheel": wheel})


CRANK = {"rr": 0.007, "ra": 0.00092, "d": 0.028, "da": 0.0115}
ANDREWS = {  # β, Θ, γ, Φ, δ, Ω, ε, rad, at the start and at 0.03 s
    "start": (
        -0.0617138900142764496, 0.0, 0.455279819163070380, 0.222668390165885885, 0.487364979543842550,
        -0.222668390165885885, 1.23054744454982119,
    ),
    "end": (
        15.81077119629904, -15.75637105984298, 0.04082224013073101, -0.5347301163226948, 0.5244099658805304,
        0.5347301163226948, 1.048080741042263,
    ),
}  # fmt: skip


def andrews() -> Mechanism:
    """Andrews' squeezer: seven bodies on ten hinges in the plane, a spring and a motor, without gravity.

    Numbers: Schiehlen, Multibody Systems Handbook (1990); the reference at 0.03 s is that of the Test Set for Initial
    Value Problem Solvers (Mazzia and Magherini, Bari), by PSIDE with tolerances of 1e-14.
    """
    beta, theta, gamma, phi, delta, omega, epsilon = ANDREWS["start"]

    def ray(length, angle):
        return length * np.array([np.cos(angle), np.sin(angle), 0.0])

    def side(length, angle):
        return length * np.array([np.sin(angle), -np.cos(angle), 0.0])

    O, A, B, C = np.zeros(3), np.array([-0.06934, -0.00227, 0]), np.array([-0.03635, 0.03273, 0]), [0.014, 0.072, 0]
    pin = ray(CRANK["rr"], beta)
    P = pin - ray(CRANK["d"], beta + theta)
    E, F = A + ray(0.04, delta), A + side(0.04, epsilon)
    masses = (0.04325, 0.00365, 0.02373, 0.00706, 0.07050, 0.00706, 0.05498)
    moments = (2.194e-6, 4.410e-7, 5.255e-6, 5.667e-7, 1.169e-5, 5.667e-7, 1.912e-5)
    centers = (
        ray(CRANK["ra"], beta),
        pin - ray(CRANK["da"], beta + theta),
        B + side(0.01874, gamma) + ray(0.01043, gamma),
        E + side(0.02 - 0.01421, phi + delta),
        A + ray(0.02308, delta) - side(0.00916, delta),
        F + ray(0.02 - 0.01421, omega + epsilon),
        A + side(0.01228, epsilon) - ray(0.00449, epsilon),
    )
    bodies = {
        f"K{k + 1}": Body(mass=m, inertia=(J, J, J), position=x)
        for k, (m, J, x) in enumerate(zip(masses, moments, centers, strict=True))
    }
    ends = {
        "crank": ("ground", "K1", O), "pin": ("K1", "K2", pin), "B": ("ground", "K3", B), "P3": ("K2", "K3", P),
        "P4": ("K2", "K4", P), "P6": ("K2", "K6", P), "E": ("K5", "K4", E), "A5": ("ground", "K5", A),
        "F": ("K7", "K6", F), "A7": ("ground", "K7", A),
    }  # fmt: skip
    joints = {
        key: Joint("revolute", one, other, at=at, axis=(0, 0, 1), motor=True if key == "crank" else None)
        for key, (one, other, at) in ends.items()
    }
    D = B + ray(0.02, gamma) + side(0.018, gamma)
    joints["spring"] = Joint("strut", "ground", "K3", at=C, to=D, stiffness=4530.0, rest=0.07785)
    return Mechanism(bodies=bodies, joints=joints, gravity=(0, 0, 0))
