"""Visibility of triangles in pixels: culling, rasterising, depth and entities."""
