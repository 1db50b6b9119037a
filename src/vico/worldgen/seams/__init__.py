"""Seams between the tiles of a city: heights, streets and the drawn ground of neighbours made one."""
