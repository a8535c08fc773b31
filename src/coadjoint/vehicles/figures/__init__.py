"""Figures and animations of vehicles: where they go, how they move, what their actuators do."""
