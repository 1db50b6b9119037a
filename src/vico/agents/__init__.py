"""Agents: schedule followers and planners. They see observations and public maps, never the simulation."""
