"""Who is in view of whom, by sight lines: the same whether pictures are rendered or not."""

from vico.sim.perception.in_view import OUTDOORS, SIGHT, AllInView, Eyes, InView, SeenBody, in_view, is_clear
from vico.sim.perception.opaque import OpaqueGrid, opaque_grid

__all__ = [
    "OUTDOORS",
    "SIGHT",
    "AllInView",
    "Eyes",
    "InView",
    "OpaqueGrid",
    "SeenBody",
    "in_view",
    "is_clear",
    "opaque_grid",
]
