"""A small town that needs no build: blocks of houses, streets, and forty places of many kinds."""

from __future__ import annotations

import numpy as np

from vico.world.heights import HeightField
from vico.world.model import Building, Category, Manifest, Origin, Place
from vico.world.transit import Transit
from vico.world.walkable import BLOCKED, OPEN, ROADWAY, SIDEWALK, WalkableMap
from vico.world.world import World

HALF = 120.0

# Name, category, kind, opening hours.
PLACES: tuple[tuple[str, str, str, str | None], ...] = (
    *((f"Apartments, Lime Street {k}", "accommodation", "apartments", None) for k in range(1, 15, 2)),
    ("Hotel Anchor", "accommodation", "hotel", "24/7"),
    ("Corner Cafe", "food", "cafe", "Mo-Fr 07:00-19:00; Sa 09:00-17:00"),
    ("Bean There", "food", "cafe", None),
    ("Trattoria Lume", "food", "restaurant", "Mo-Su 11:00-23:00"),
    ("Noodle House", "food", "restaurant", None),
    ("The Old Oar", "food", "pub", "Mo-Th 15:00-24:00; Fr-Sa 15:00-02:00"),
    ("Fry Bar", "food", "fast_food", None),
    ("Lime Bakery", "store", "bakery", "Mo-Sa 06:30-18:00; Su off"),
    ("Daily Market", "store", "supermarket", "Mo-Su 07:00-22:00"),
    ("Paper Moon Books", "store", "books", "Mo-Fr 10:00-18:00"),
    ("Needle and Thread", "store", "tailor", None),
    ("Bloom", "store", "florist", None),
    ("Spokes", "store", "bicycle", None),
    ("Town Pharmacy", "store", "pharmacy", "Mo-Fr 08:00-20:00"),
    ("Cut Above", "store", "hairdresser", None),
    ("Northlight Software", "office", "company", None),
    ("Harbour Architects", "office", "architect", None),
    ("Lind Law", "office", "lawyer", None),
    ("Savings Bank", "office", "bank", "Mo-Fr 09:30-16:30"),
    ("Lime Street Clinic", "office", "clinic", None),
    ("Town Library", "office", "library", "Mo-Fr 09:00-20:00"),
    ("Institute of Arts", "office", "university", None),
    ("Town Museum", "entertainment", "museum", "Tu-Su 10:00-18:00"),
    ("Lumen Cinema", "entertainment", "cinema", None),
    ("Iron Hall", "entertainment", "fitness_centre", None),
    ("Linden Park", "open", "park", None),
    ("Market Square", "open", "square", None),
    ("Lime Street", "transit", "bus_stop", None),
)


def make_world(places: tuple[tuple[str, str, str, str | None], ...] = PLACES, name: str = "toytown") -> World:
    n = int(HALF * 4)
    cls = np.full((n, n), OPEN, np.uint8)
    for i in range(0, n, 96):
        cls[i : i + 16, :] = np.where(cls[i : i + 16, :] == ROADWAY, ROADWAY, SIDEWALK)
        cls[:, i : i + 16] = SIDEWALK
        for j in range(0, n, 96):
            cls[i + 16 : i + 88, j + 16 : j + 88] = BLOCKED
    for i in range(0, n, 96):
        cls[i + 4 : i + 12, :] = ROADWAY
        cls[:, i + 4 : i + 12] = ROADWAY
    walkable = WalkableMap(cls, HALF)
    free = np.argwhere((cls == SIDEWALK) & walkable.connected)[:, ::-1]
    spots = walkable.centre_of(free[np.linspace(200, len(free) - 200, len(places)).astype(int)])
    order = np.random.default_rng(5).permutation(len(places))
    records, buildings = [], []
    for k, (title, category, kind, hours) in enumerate(places):
        x, y = (float(v) for v in spots[order[k]])
        inside = category not in ("open", "transit")
        if inside:
            ring = [(x, y), (x + 4, y), (x + 4, y + 4), (x, y + 4)]
            buildings.append(
                Building(
                    id=f"w{k}", entity=1000 + k, name=None, use="other", footprint=[ring], base=0.0, height=9.0,
                    levels=3, roof_shape="flat", colour="#cccccc", accessible=True,
                )
            )  # fmt: skip
        records.append(
            Place(
                id=f"n{k}", name=title, category=Category(category), kind=kind, building=f"w{k}" if inside else None,
                entrance=None, position=(x, y, 0.0), opening_hours=hours,
            )
        )  # fmt: skip
    manifest = Manifest(
        producer="test", name=name, origin=Origin(lat=60.0, lon=25.0), half=HALF, bbox=(24.9, 59.9, 25.1, 60.1), seed=0,
        sources=[], stages=[], counts={}, places_by_type={}, files={},
    )  # fmt: skip
    transit = Transit(stops=[], lines=[], bike_stations=[], origin={})
    return World(
        manifest, height=HeightField.flat(HALF), buildings=buildings, places=records, walkable=walkable, transit=transit
    )
