"""Things that stand outdoors: trees, lamps, benches, barriers."""
