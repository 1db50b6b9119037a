"""Rooms: floor plans, furniture, small things, layouts of a library or a language model."""
