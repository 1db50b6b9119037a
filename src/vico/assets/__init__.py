"""Bodies, robots and things: our procedural ones, and richer ones read from the packages that ship them."""
