"""The card of an identification: a table of parameters with their intervals, and what is doubtful."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from coadjoint.identification.result import Identification


def card(found: Identification) -> str:
    """What `print(found)` shows."""
    log = found.log
    width = max(9, *map(len, (*found.estimates, *found.process_noise)))
    lines = [
        f"Identification of {found.system.name}",
        f"  log       {len(log)} samples over {log.duration:g} s, {len(found.simulated)} columns",
        f"  fit       {found.segments} segments, dt = {found.dt:g} s, {found.iterations} iterations",
        "",
        f"  {'parameter':<{width}}  {'estimate':>11}  {f'{found.level:.0%} interval':^25}  {'before':>11}",
    ]
    for name, e in found.estimates.items():
        lines.append(f"  {name:<{width}}  {e.value:>11.5g}  {e.low:>11.5g} .. {e.high:<10.5g}  {e.prior:>11.5g}")
    lines += ["", f"  {'column':<{width}}  {'noise':>11}   {'':<10}  lag-one correlation"]
    for name, sigma in found.noise.items():
        unit = log.units.get(name, "")
        known = "given" if name in found.assumed else "estimated"
        time = found.correlation_times.get(name, 0.0)
        after = f"   over {time:.3g} s" if time else ""
        value, unit = (np.degrees(sigma), unit.replace("rad", "deg")) if unit.startswith("rad") else (sigma, unit)
        lines.append(f"  {name:<{width}}  {value:>11.4g} {unit:<6} {known:<10} {found.whiteness[name]:>6.2f}{after}")
    if found.process_noise:
        interval = f"{found.level:.0%} interval"
        lines += ["", f"  {'wanders':<{width}}  {'deviation':>11}  {interval:^25}  correlation time"]
    for name, one in found.process_noise.items():
        low, high = (f"{value:.4g} {one.unit}".rstrip() for value in one.deviation_interval)
        time = "{:.3g} s, {:.3g} .. {:.3g} s".format(one.correlation_time, *one.correlation_time_interval)
        value = f"{one.deviation:.4g} {one.unit}".rstrip()
        lines.append(f"  {name:<{width}}  {value:>11}  {low:>11} .. {high:<10}  {time}")
    for warning in found.warnings:
        lines += ["", *textwrap.wrap(warning, 100, initial_indent="  ! ", subsequent_indent="    ")]
    return "\n".join(lines)
