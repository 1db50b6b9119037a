"""Photos taken in the street: one model of a posed photo, and a module for each source of them."""
