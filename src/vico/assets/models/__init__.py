"""Models of things that worlds are furnished with: read from data files, or grown by an algorithm (plants, fences)."""
