"""The added mass of a vehicle file: a matrix, an ellipsoid, a slender body, or a file of a panel program."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np

from coadjoint import units as u
from coadjoint.arrays import Array
from coadjoint.errors import ArgumentError, FileError
from coadjoint.extending import keep_beside
from coadjoint_vehicles import axes as border
from coadjoint_vehicles.files.table import Section, axes_of
from coadjoint_vehicles.hydrodynamics.added_mass import added_mass_about

FORMS = ("matrix", "semi_axes", "stations", "wamit", "capytaine")
PANEL_AXES = ("z_up", "z_down")
NOTICED, REFUSED = 1e-9, 0.05
"""|M_ij − M_ji|/√(M_ii M_jj) from which an asymmetry is reported, and from which it is too large for rounding."""
POWER = 3 + np.add.outer([0, 0, 0, 1, 1, 1], [0, 0, 0, 1, 1, 1])


def read_added_mass(section: Section, axes: border.Axes, density: float, length: float | None, folder: Path) -> Array:
    """M_A about the body origin, (6, 6), in forward, starboard, down, SI units.

    `matrix`: (6, 6) or its diagonal, unit "SI", or "prime": M = ½ρL^k M′ with k = 3, 4, 5. `semi_axes`: Lamb's
    ellipsoid. `stations` with half breadths: strips. `wamit`, `capytaine`: files. `about`: the point of the body that
    the moments refer to, by default the origin.
    """
    given = [form for form in FORMS if form in section]
    if len(given) != 1:
        found = " and ".join(f"`{form}`" for form in given) or "none of them"
        raise section.fail(f"needs one of {', '.join(f'`{form}`' for form in FORMS)}, but has {found}.")
    form = given[0]
    if form not in ("wamit", "capytaine"):  # there `axes` are those of the panel program
        axes = axes_of(section, axes)
    about = np.zeros(3)
    if "about" in section:
        about = border.body_vector(section.vector("about", u.LENGTH), axes)
    if form == "matrix":
        found = border.twist_matrix(_matrix(section, density, length), axes)
    elif form in ("wamit", "capytaine"):
        found = _file(section, form, density, folder)
    else:
        with np.errstate(all="ignore"):
            found = _ellipsoid(section, density) if form == "semi_axes" else _strips(section, density)
    section.done()
    if not np.all(np.isfinite(found)):
        raise section.fail(f"{form} give no finite added mass: check that the sizes are those of one body.")
    return added_mass_about(found, -about) if np.any(about) else found


def _matrix(section: Section, density: float, length: float | None) -> Array:
    value, unit = section.quantity("matrix", None, special=("prime",))
    found = np.asarray(value, dtype=float) if isinstance(value, list) else np.zeros(0)
    if found.shape not in ((6,), (6, 6)):
        raise section.fail(
            "matrix must be six numbers, or six rows of six, in the order surge, sway, heave, roll, pitch, yaw, but "
            f"has the shape {'×'.join(map(str, found.shape)) if found.size else 'of one number'}."
        )
    full = np.diag(found) if found.ndim == 1 else found
    if unit == "prime":
        if length is None:
            raise section.fail('matrix has the unit "prime", for which [body] needs a `length`.')
        full = 0.5 * density * length**POWER * full
    diagonal = np.diag(full)
    if np.any(diagonal < 0):
        worst = int(np.argmin(diagonal))
        hint = "change the sign of all: added mass is positive here, X_u̇ = −5 kg is 5 kg"
        if np.any(diagonal > 0):
            hint = "the kinetic energy of water is positive"
        raise section.fail(f"matrix has {diagonal[worst]:g} on its diagonal, row {worst + 1}: {hint}.")
    return _symmetric(section, full)


def _symmetric(section: Section, full: np.ndarray) -> Array:
    size = np.sqrt(np.maximum(np.diag(full), 1e-3 * np.max(np.diag(full), initial=0.0)))
    skew = np.abs(full - full.T) / np.maximum(np.outer(size, size), 1e-300)
    i, j = np.unravel_index(np.argmax(skew), skew.shape)
    i, j = min(i, j), max(i, j)
    if skew[i, j] <= NOTICED:
        return 0.5 * (full + full.T)
    sentence = (
        f"matrix is not symmetric: row {i + 1}, column {j + 1} is {full[i, j]:g}, but row {j + 1}, column {i + 1} is "
        f"{full[j, i]:g}"
    )
    if skew[i, j] > REFUSED:
        raise section.fail(f"{sentence}; the added mass of every body is, so that one of them is wrong.")
    section.book.warn(f"{section.title} {sentence}; the mean of both is taken.")
    return 0.5 * (full + full.T)


def _ellipsoid(section: Section, density: float) -> Array:
    from coadjoint_vehicles.hydrodynamics.ellipsoids import ellipsoid_added_mass

    axes = section.vector("semi_axes", u.LENGTH)
    if min(axes) <= 0:
        raise section.fail(f"semi_axes must be positive, but are {axes}.")
    return ellipsoid_added_mass(axes, density)


def _strips(section: Section, density: float) -> Array:
    from coadjoint_vehicles.hydrodynamics.slender_bodies import slender_body_added_mass

    stations, _ = section.quantity("stations", u.LENGTH)
    half_breadth, _ = section.quantity("half_breadth", u.LENGTH)
    more = {
        key: section.quantity(key, u.LENGTH)[0]
        for key in ("half_height", "horizontal_fins", "vertical_fins")
        if key in section
    }
    try:
        return slender_body_added_mass(stations, half_breadth, fluid_density=density, **more)
    except ArgumentError as error:
        raise section.fail(f"cannot be computed from its strips: {error}") from error


def _file(section: Section, form: str, density: float, folder: Path) -> Array:
    """Added mass from a file of a panel program, whose warnings become those of the vehicle."""
    from coadjoint_vehicles.hydrodynamics.capytaine import capytaine_added_mass
    from coadjoint_vehicles.hydrodynamics.wamit import wamit_added_mass

    name = section.text(form)
    path = folder / name
    if path.is_file():
        keep_beside(Path(section.book.path), name, path)
    panel_axes = section.text("axes", None, PANEL_AXES)
    origin = section.vector("origin", u.LENGTH) if "origin" in section else (0.0, 0.0, 0.0)
    try:
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            if form == "wamit":
                mark = None
                if "infinite_frequency" in section:
                    mark = section.text("infinite_frequency", None, ("zero", "negative"))
                found = wamit_added_mass(
                    path,
                    length=section.positive("ulen", u.LENGTH),
                    fluid_density=density,
                    axes=panel_axes,
                    origin=origin,
                    infinite_frequency=mark,  # pyright: ignore[reportArgumentType]
                )
            else:
                found = capytaine_added_mass(
                    path,
                    axes=panel_axes,
                    origin=origin,
                    fluid_density=density,
                    frequency=section.text("frequency", "infinite", ("infinite", "highest")),  # pyright: ignore
                )
    except (FileError, ArgumentError) as error:
        if str(error).startswith(section.book.path):
            raise
        raise section.fail(f"{form}: {error}") from error
    for warning in told:
        section.book.warn(f"{section.title} {warning.message}")
    return found
