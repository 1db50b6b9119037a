"""Worlds: their model, their folder, and the look-ups that all rooms share. No generation code."""
