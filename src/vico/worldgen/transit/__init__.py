"""Public transport: lines, stops, routes on the lane graph, timetables, bicycle stations."""
