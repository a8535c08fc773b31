"""Vehicles as data, and the craft that they make with a pilot in their water."""
