"""The dimensions of the numbers of waters, densities and profiles."""

from __future__ import annotations

from coadjoint import units as u

DIMENSIONS = {
    **dict.fromkeys(("velocity", "mean", "amplitudes", "deviation", "velocities"), u.SPEED),
    **dict.fromkeys(("reach", "bottom", "roughness", "scale", "depths"), u.LENGTH),
    **dict.fromkeys(("correlation_time", "times"), u.TIME),
    "phases": u.ANGLE,
}
"""Of some of the fields, by their names."""
