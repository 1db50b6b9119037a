"""Roofs: their solids by shape, and the eaves and dormers on them."""
