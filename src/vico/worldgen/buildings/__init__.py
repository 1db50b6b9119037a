"""Buildings: outlines from the map, heights by rule, roofs of every shape, watertight solids."""
