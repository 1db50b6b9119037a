"""The state of a simulation: what never changes, what does, the log of a step, and the hash of it all."""
