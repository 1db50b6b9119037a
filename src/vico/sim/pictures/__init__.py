"""Pictures of a simulation: the world's meshes once, everything that moves anew in every step."""
