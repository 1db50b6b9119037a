"""Outlines and plans of buildings: what stands where, how high, under what roof."""
