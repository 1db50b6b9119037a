"""Sources of facts: frames, map data and elevation. Imports nothing else of ours."""
