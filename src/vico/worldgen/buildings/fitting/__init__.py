"""Planned buildings nudged to a photogrammetry mesh: measured, raised, moved."""
