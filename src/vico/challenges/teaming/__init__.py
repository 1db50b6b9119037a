"""Human-robot teaming: a humanoid, a quadruped and a drone at small tasks with a person or another robot."""
