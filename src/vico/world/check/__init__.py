"""Checks of a finished world: `check_world` runs the rules, which lie in a module for each kind of thing."""

from vico.world.check.world import check_whole, check_world
from vico.world.model import WorldFinding

__all__ = ["WorldFinding", "check_whole", "check_world"]
