"""Where facts come from: frames, map data and elevation. Imports nothing else of ours."""
