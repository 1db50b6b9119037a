"""Names of what a city has as a whole, beside its tiles; all lies in the folder `WHOLE`."""

WHOLE = "whole"

#: Ground: smooth heights; edges of kerbs and their like with what lies below and above them; decks and stairs.
SMOOTH, EDGE, LOW, HIGH, LEVELS = "smooth.npy", "edge.npy", "low.npy", "high.npy", "levels.npz"
#: Streets: roads, lanes, transit.
ROADS, NET, XODR, TRANSIT = "roads.json", "roads.net.xml", "roads.xodr", "transit.json"
#: Where people walk: surfaces, room to walls, what can be reached, what it costs to walk there, gates between tiles,
#: the steps of the walks from gate to gate.
SURFACES, ROOM, REACHED, COST = "surfaces.npy", "room.npy", "reached.npy", "cost.npy"
GATES, STEPS = "gates.npz", "steps.npy"
