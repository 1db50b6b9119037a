"""Agents of the influence challenge: main agents that court members, and the members themselves."""
