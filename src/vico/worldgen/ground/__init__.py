"""The ground: its heights, its kerbs, stairs and bridges, what it is paved with and where people can walk."""
