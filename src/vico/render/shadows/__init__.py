"""Shadows: maps of the static scene, and shadows of moving bodies."""
