"""Synthetic photogrammetry: tilesets made of worlds that are known, for tests and benchmarks of what reads tilesets."""
