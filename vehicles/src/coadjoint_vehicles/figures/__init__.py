"""Figures and animations of vehicles: their tracks, their motions, their actuators."""
