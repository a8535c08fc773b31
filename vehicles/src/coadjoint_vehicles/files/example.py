"""A commented vehicle file to start from."""

from __future__ import annotations

EXAMPLE = """# A vehicle of your own: change the numbers, then `coadjoint vehicles show THIS.toml`, and
# `coadjoint vehicles mission THIS.toml > dive.toml`. `coadjoint keys` lists all keys.

[vehicle]
name = "Mine"
description = "a neutral torpedo without fins"  # for lists
axes = "FRD"  # of all vectors: forward, starboard, down; or "FLU"

[sources]
GUESS = "Numbers to replace: give each one the key of the source that it is from."

[body]  # the hull with flooded water, without what parts hold
mass = { value = 31.0, unit = "kg", source = "GUESS" }
inertia = { value = [0.11, 4.03, 4.03], unit = "kg m^2", source = "GUESS" }  # or three rows of three
inertia_about = "center_of_mass"  # or "origin"
center_of_mass = { value = [0, 0, 20], unit = "mm", source = "GUESS" }
center_of_buoyancy = { value = [0, 0, 0], unit = "mm", source = "GUESS" }  # above the mass centre: it rights itself
neutral = true  # or volume = …, or buoyancy = …
fluid_density = { value = 1026, unit = "kg/m^3", source = "GUESS" }
length = { value = 1.6, unit = "m", source = "GUESS" }
diameter = { value = 190, unit = "mm", source = "GUESS" }

[added_mass]  # or semi_axes of an ellipsoid, stations of strips, or a file of WAMIT
matrix = { value = [0.84, 29.4, 29.4, 0.03, 3.43, 3.43], unit = "SI", source = "GUESS" }

[[part]]  # drag, linear and quadratic, surge to yaw
kind = "damping"
name = "damping"
linear = { value = [1.6, 3.0, 3.0, 0.6, 10.8, 7.5], unit = "SI", source = "GUESS" }

# Fins and thrusters are further parts: `coadjoint vehicles show remus_100 --toml` has a rudder, stern planes and a
# propeller, `coadjoint vehicles show bluerov2_heavy_blue --toml` eight thrusters. With them comes a controller:
# [controller]
# kind = "cruise"
"""
