"""The loop of a simulation: how a run starts, its steps and sub-steps, and what it reports of itself."""
