"""Descriptions of links and joints in XML: elements with their places, poses and inertias, and URDF."""
