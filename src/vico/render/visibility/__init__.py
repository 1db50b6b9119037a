"""Which triangle is seen in which pixel: culling, rasterising, depth and entities."""
