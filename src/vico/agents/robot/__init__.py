"""Robots that work with an arm: what they know of their body, see around it, and do with things."""
