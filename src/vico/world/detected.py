"""What a world knows of the things that detections placed: ``detections.json``, in worlds built with detections."""

from __future__ import annotations

from typing import Literal

from vico.world.model import Point2, Record
from vico.world.records import read_records
from vico.world.world import World

FILE = "detections.json"


class DetectedObject(Record):
    """A thing that photos show, and what became of it.

    Attributes
    ----------
    object
        Id of the object in the world.
    name
        Class of the detections.
    model
        Of the object; "" for what the map knows already.
    seen_at
        Where photos show it, ENU metres.
    photos
        Ids of the photos.
    score
        Mean of the detections.
    spread
        How far the photos' rays pass it, root of the mean square, metres; None where one photo or the file placed it.
    how
        ``triangulated``, ``on the ground`` (by one photo) or ``located`` (the file told its place).
    decision
        ``new``: the map lacks it; ``map wins``: it stands where the map has it; ``moved``: where photos show it.
    off_map
        How far the map has it from there, metres; None for a new one.
    """

    object: str
    name: str
    model: str
    seen_at: Point2
    photos: tuple[str, ...]
    score: float
    spread: float | None
    how: Literal["triangulated", "on the ground", "located"]
    decision: Literal["new", "map wins", "moved"]
    off_map: float | None


def detected_objects(world: World) -> list[DetectedObject]:
    """Return what detections placed in a world; nothing for a world that was built without.

    Raises
    ------
    SchemaError
        If the file is damaged.
    """
    path = world.file(FILE)
    return read_records(path, DetectedObject) if path.exists() else []
