"""Where the light is blocked: maps of the static scene, and shadows of what moves."""
