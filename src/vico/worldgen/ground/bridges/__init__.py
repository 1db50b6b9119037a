"""Bridges above streets, the rails of bridges that are the ground, and the mouths of tunnels."""
