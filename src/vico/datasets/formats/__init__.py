"""How a dataset lies on the disk: one module a format."""
