"""Challenges: tasks and their evaluation; one folder a challenge, one runner, one results table."""
