"""Places that the map lacks: one model of a found place, and a module for each source of them."""
