"""Bodies, people, things and rooms as arrays: where everything is, how far apart it is, and what it collides with."""
