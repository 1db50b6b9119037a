"""Cars and pedestrians placed by hand, with their routes: what a file of traffic lists."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import ConfigDict, Field

from vico.assets.vehicles import CAR_KINDS
from vico.errors import InputError
from vico.io.data_files import DataRecord, record_of

#: No traffic placed by hand.
NO_TRAFFIC = "none"
_GUIDE = "docs/traffic.md"
_MODELS = [f"{kind}_{colour}" for kind, colours in CAR_KINDS.items() for colour in colours]

Point = tuple[float, float]


class PlacedCar(DataRecord):
    """A car that starts at a place.

    Attributes
    ----------
    at
        Where its front is, ENU metres: the nearest lane within 10 m counts.
    route
        Points whose streets it drives over, one after the other, ENU metres; beyond the last it drives as others do.
    model
        A kind of car and its paint, such as ``sedan_black``; "" leaves it to the seed.
    """

    model_config = ConfigDict(allow_inf_nan=False)

    at: Point
    route: tuple[Point, ...] = ()
    model: str = ""


class PlacedWalker(DataRecord):
    """A pedestrian that starts at a place.

    Attributes
    ----------
    at
        ENU metres: the nearest sidewalk within 10 m counts.
    route
        Points whose sidewalks it walks over, one after the other, ENU metres; then it goes on as others do.
    speed
        Metres a second it prefers; None leaves it to the seed.
    """

    model_config = ConfigDict(allow_inf_nan=False)

    at: Point
    route: tuple[Point, ...] = ()
    speed: float | None = Field(default=None, ge=0.5, le=2.5)


class PlacedTraffic(DataRecord):
    """What a file of traffic lists."""

    cars: tuple[PlacedCar, ...] = Field(default=(), max_length=1000)
    pedestrians: tuple[PlacedWalker, ...] = Field(default=(), max_length=1000)


def placed_traffic(wanted: str | Mapping[str, Any], *, source: str = "traffic") -> PlacedTraffic:
    """Return traffic placed by hand; docs/traffic.md describes it.

    Parameters
    ----------
    wanted
        ``"none"``, or the content of a file of traffic.

    Raises
    ------
    SchemaError
        If it is not of that form.
    InputError
        If it names a model that is not known.
    """
    if isinstance(wanted, str):
        if wanted != NO_TRAFFIC:
            raise InputError(f"{source}: {wanted!r} is not known; take {NO_TRAFFIC}, or a file of traffic (.json)")
        return PlacedTraffic()
    found = record_of(wanted, PlacedTraffic, source=source, guide=_GUIDE)
    for k, car in enumerate(found.cars):
        if car.model and car.model not in _MODELS:
            raise InputError(f"{source}: cars.{k}: no model {car.model!r}; there are {', '.join(_MODELS)}")
    return found
