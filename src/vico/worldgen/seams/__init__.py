"""Where the tiles of a city meet: heights, streets and the drawn ground of neighbours made one."""
