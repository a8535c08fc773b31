"""The page of an audit, with its figures, as files."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure
from PIL import Image

from coadjoint.audit.audit import (
    DRIFT_WITHIN,
    ON_CONSTRAINTS,
    ORDER_WITHIN,
    REVERSIBLE_WITHIN,
    ROUND_OFF,
    SYMPLECTIC_WITHIN,
    WANDERING,
)
from coadjoint.audit.figures import energy_figure, order_figure
from coadjoint.audit.findings import Audit
from coadjoint.audit.systems import PROBLEMS, QUICK
from coadjoint.audit.tables import OVER_MAPS, markdown, rows, summary
from coadjoint.errors import rephrased
from coadjoint.plotting.style import save
from coadjoint.report.summary import to_json, versions

PAGE, NUMBERS = "audit.md", "audit.json"
DOTS = 120
"""An inch, in the figures: enough for a screen."""
ORDERS, ENERGY = "audit_orders.png", "audit_energy.png"


def write(audit: Audit, folder: Path, command: str) -> list[Path]:
    """audit.md, audit.json and figures/*.png in `folder`; raises FileError where that cannot be written."""
    figures = folder / "figures"
    with rephrased(f"The folder {folder} cannot be written to"):
        figures.mkdir(parents=True, exist_ok=True)
        made = [_drawn(order_figure(audit), figures / ORDERS)]
        if any(cell.long_run is not None for cell in audit.cells):
            made.append(_drawn(energy_figure(audit), figures / ENERGY))
        (folder / NUMBERS).write_text(to_json({**summary(audit), "versions": versions()}), encoding="utf-8")
        names = [path.name for path in made]
        (folder / PAGE).write_text(text(audit, command, names), encoding="utf-8")
    return [folder / PAGE, folder / NUMBERS, *made]


def _drawn(figure: Figure, path: Path) -> Path:
    """The figure as a small file: 200 colours are enough for lines on white."""
    save(figure, path, DOTS)
    with Image.open(path) as picture:
        picture.convert("RGB").quantize(200).save(path, optimize=True)
    return path


def text(audit: Audit, command: str, figures: list[str]) -> str:
    """The page in Markdown."""
    systems = list(dict.fromkeys(cell.system for cell in audit.cells))
    described = "\n".join(f"- **{name}**: {_described(name)}" for name in systems)
    verdict = (
        "Every claim was shown."
        if audit.passed
        else "Not every claim was shown:\n\n" + "\n".join(f"- {failure}" for failure in audit.failures)
    )
    shown = "\n\n".join(f"![{_CAPTIONS[name]}](figures/{name})\n\n{_CAPTIONS[name]}" for name in figures)
    refused = "\n".join(f"- {sentence}" for sentence in audit.refusals)
    refused = f"What methods do not support:\n\n{refused}\n\n" if refused else ""
    return _PAGE.format(
        refused=refused, quick=", ".join(QUICK),
        command=command, numbers=NUMBERS, verdict=verdict, systems=described,
        table=markdown(OVER_MAPS, rows(audit, by_map=False)),
        order=ORDER_WITHIN, symplectic=SYMPLECTIC_WITHIN,
        reversible=REVERSIBLE_WITHIN, drift=DRIFT_WITHIN, round_off=ROUND_OFF, wandering=WANDERING,
        on_constraints=ON_CONSTRAINTS, figures=shown,
    )  # fmt: skip


def _described(name: str) -> str:
    return (PROBLEMS[name].make.__doc__ or "").strip() if name in PROBLEMS else "a system of your own."


_CAPTIONS = {
    ORDERS: "Error at the end against the step, over the Cayley map where it was audited; filled marks were fitted.",
    ENERGY: "Largest relative energy error in each fiftieth of the long runs, over the same map.",
}

_PAGE = """# Audit: claims of the methods and measurements

After this page you know how each method keeps its claims. `{command}` writes it. {verdict}

Every method runs on every system over the difference maps that fit. `Pade` and `SecondKind` run on four systems
({quick}) with the methods up to order 2. On SE(3) Galerkin's method of
order 8, and over the exponential its others, are too large for native code and were not measured, as is that of order 8
on the curved Q.
Methods for Lagrangians that are linear in the velocities run on *predators* and *guiding centre*, and no others do.

`{numbers}` has each map and system. The columns are the map, or the number of maps, the claimed order, the least and
greatest measured, and the worst over maps and systems of

- *symplectic*: the change of the two-form ω(δ₁, δ₂) over one step, relative to the sizes of its terms; within
  {symplectic:.0e}. The tangents are differences of order 8 of steps along curves.
- *reversible*: the distance from the start after ten steps of h and ten of −h, relative to the state; within
  {reversible:.0e}. Only for symmetric methods.
- *momentum*: the largest change of ⟨c₀, Ad*_g⁻¹ m⟩ over the long run, for every c₀ that fixes the advected parameters,
  relative to |μ| + |π||n|; within {round_off:.1e} for each stage of each step.
- *energy band*: the largest |E − E₀| of the long run, relative to the size of the energy's terms.
- *drift*: the gain of a line through the means of |E − E₀| over twenty intervals, less three standard errors, relative
  to their mean; at most {drift:g} where the band is above round-off. An error proportional to time gives 2, one that
  grows as its square root above 1. For exact energy the band itself is within {wandering:.1e} times the square root of
  the number of stages. `EnergyMomentum` with one point claims this for quadratic ℋ only.
- *gap*: the largest |φ|, |φ̇| and |A·(ξ, ν) − b| at the nodes of the long runs of the constrained systems; within
  {on_constraints:.0e}.

Constrained systems are run over the Cayley map. Their two-form lives on T*N and is a row of [theorems](theorems.md). On
Suslov's body momentum is not conserved, and a band of the energy is asked of reversible methods of one stage alone: its
motion ends in a family of equilibria, along which compositions drift by the error of a step.

Orders are slopes of log error over log h by least squares, within {order:g} of the claim. Steps are halved, for order 6
divided by √2 and from 7 on by its root. The four finest errors above round-off are
fitted. Orders over 8 are measured with the Cayley map on four systems, and none over 4 on the curved one: elsewhere
round-off hides them.

{table}

{refused}## Systems

{systems}

On the free rigid body every quadrature rule is its own adjoint, so an odd order must come out one higher. With forces,
order and reversibility are measured; on the steered top, with an actuator and a sampled controller, the order is that
of the method, 2 at most.

## Figures

{figures}
"""
