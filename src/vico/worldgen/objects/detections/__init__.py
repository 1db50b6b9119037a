"""Things that photos show: where they stand, and which of them the map knows already."""
