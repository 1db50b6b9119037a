"""What each building wears: materials and colours by what the map says, else by use, age, size, region and a draw."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from vico.worldgen.facades.catalogue import styles
from vico.worldgen.facades.families import family_of, picked, table_of
from vico.worldgen.facades.records import Family, GroundFloor, RegionalStyle, Rgb
from vico.worldgen.facades.tags import colour_of

_WHITE: Rgb = (255, 255, 255)
_PALE_STONE: Rgb = (226, 222, 216)
_BACK_PLASTER: Rgb = (238, 234, 226)
_BACK_BRICK: Rgb = (255, 250, 240)
_GATES, _LOBBY = "ground_gates", "ground_lobby"


@dataclass(frozen=True)
class FacadeStyle:
    """The materials and colours of one building.

    Attributes
    ----------
    wall, ground, blank, roof, back
        Materials of upper floors, ground floor, walls without windows, roof, and upper floors away from streets.
    bay
        Wished width of a bay, metres.
    tint, ground_tint, roof_tint, back_tint
        What multiplies their pictures.
    hall
        One row of windows from a low base to the eaves, as churches have.
    gable, gable_tint
        What a front shows above its eaves; "": as its blank walls.
    reach
        How far a pitched roof reaches out over the walls, metres.
    eaves
        The finish of what reaches out (`records.Finish`).
    flat_tint
        Colour of a flat roof's gravel or felt.
    """

    wall: str
    ground: str
    blank: str
    roof: str
    bay: float
    tint: Rgb
    ground_tint: Rgb
    roof_tint: Rgb
    back: str = "wall_plain"
    back_tint: Rgb = (255, 255, 255)
    hall: bool = False
    gable: str = ""
    gable_tint: Rgb = (255, 255, 255)
    reach: float = 0.0
    eaves: str = "eaves"
    flat_tint: Rgb = (150, 148, 146)


class _Draws(NamedTuple):
    """A building's own draws, 0..1, by what they decide first."""

    family: float
    tint: float
    ground_floor: float
    roof: float
    roof_tint: float
    age: float
    variant: float
    bay: float


def look_of(
    use: str, tags: Mapping[str, str], *, levels: int, area: float, region: str, random: np.random.Generator
) -> FacadeStyle:
    """Dress a building: by its material, architecture and colour tags, else by use, age, size and region, and a draw.

    `region` is what `catalogue.region_of` says; an unknown one counts as northern.
    """
    known, place = styles(), styles().region(region)
    draws = _Draws(*map(float, random.random(8)))
    wall = family_of(use, tags, levels=levels, area=area, region=region, draw=(draws.family, draws.age))
    family = known.families[wall]
    tint = _tint(family, tags, draws)
    ground = _ground_floor(family, use, levels, draws)
    roof, roof_tint = _roof(family, tags, place, draws)
    back, back_tint = _back(family, tint, area, place, draws)
    wooden = family.wooden_gable or draws.variant < place.wooden_gables.get(wall, 0.0)
    return FacadeStyle(
        wall,
        ground,
        family.blank or ("blank_brick" if back == "wall_back_brick" else "blank_plaster"),
        roof,
        family.bay * (0.92 + 0.2 * draws.bay),
        tint,
        _ground_tint(family, known.ground_floor(ground), tint, draws),
        roof_tint,
        back,
        back_tint,
        family.hall,
        gable="blank_boards" if wooden else "",
        gable_tint=_taken(known.wood, draws.bay) if wooden else _WHITE,
        reach=_reach(family, levels, place, draws),
        eaves="eaves_wood" if wooden or wall in place.wooden_eaves else "eaves",
        flat_tint=_taken(known.felt, draws.variant),
    )


def _taken(colours: Sequence[Rgb], draw: float) -> Rgb:
    return colours[int(draw * len(colours))]


def _palette(family: Family) -> Sequence[Rgb]:
    return family.tints or styles().plaster


def _tint(family: Family, tags: Mapping[str, str], draws: _Draws) -> Rgb:
    """Return the wall's colour: as tagged, else one of the family's."""
    given = colour_of(tags.get("building:colour", tags.get("building:color")))
    if given is None or not family.painted:
        return _taken(_palette(family), draws.tint)
    # The pictures are paler than white plaster; brick is red of its own, so only a brick's shade is taken over.
    return _mixed(_WHITE, _lifted(given), 0.5 if family.own_colour else 1.0)


def _ground_floor(family: Family, use: str, levels: int, draws: _Draws) -> str:
    """Return the ground floor's picture: gates of works and garages, lobbies of high offices, else the family's."""
    if use in ("garage", "industrial") and not family.keeps_ground_floor:
        return _GATES
    if use in ("office", "hotel", "commercial") and levels >= 7 and draws.variant < 0.7:
        return _LOBBY
    return family.ground_floors[int(draws.ground_floor * len(family.ground_floors))]


def _ground_tint(family: Family, ground: GroundFloor, tint: Rgb, draws: _Draws) -> Rgb:
    """Return the ground floor's colour: its own, the wall's, or that of stone."""
    if ground.own_colour:
        return _WHITE
    if family.own_colour and not ground.as_wall:
        return _taken(styles().stone, draws.bay)
    return _mixed(_PALE_STONE, tint, 0.3) if ground.stone and draws.variant < 0.5 else tint


def _roof(family: Family, tags: Mapping[str, str], region: RegionalStyle, draws: _Draws) -> tuple[str, Rgb]:
    """Return what covers a pitched roof, and its colour."""
    known = styles()
    said = tags.get("roof:material", "")
    name = _roof_cover(said.lower(), region, draws.roof)
    if family.modern and not said:
        name = "roof_metal"
    shades = known.modern_roofs if family.modern else known.roofs[name].tints
    return name, colour_of(tags.get("roof:colour", tags.get("roof:color"))) or _taken(shades, draws.roof_tint)


def _roof_cover(said: str, region: RegionalStyle, draw: float) -> str:
    for name, cover in styles().roofs.items():
        if (cover.word and cover.word in said) or said in cover.materials:
            return name
    return picked(table_of(region.roofs), draw)


def _back(family: Family, tint: Rgb, area: float, region: RegionalStyle, draws: _Draws) -> tuple[str, Rgb]:
    """Return what upper floors away from streets show, plainer than fronts, and its colour."""
    if not family.back or area <= 120.0:
        return family.name, tint
    if family.back == "wall_back_brick" or draws.variant < region.brick_backs:
        return "wall_back_brick", _BACK_BRICK
    return "wall_back", _mixed(_BACK_PLASTER, tint, 0.5)


def _reach(family: Family, levels: int, region: RegionalStyle, draws: _Draws) -> float:
    """Return how far a pitched roof reaches out over the walls, metres."""
    if family.cornice == "always" or family.gable:
        return 0.0
    if family.hall or levels > 7:
        return 0.25
    return region.eaves * (0.8 + 0.4 * draws.ground_floor)


def told_apart(
    looks: Sequence[FacadeStyle], pairs: Sequence[tuple[int, int]], free: Sequence[bool]
) -> list[FacadeStyle]:
    """Give neighbours that would wear the same wall in the same colour different ones.

    Parameters
    ----------
    looks
        Of all buildings.
    pairs
        Neighbours, the earlier first, in order.
    free
        Whose colour the map does not say.
    """
    made = list(looks)
    known = styles().families
    for i, j in pairs:
        palette = _palette(known[made[j].wall])
        if made[i].wall != made[j].wall or made[i].tint != made[j].tint or not free[j] or made[j].tint not in palette:
            continue
        # Two steps on: neighbours in a palette are like each other.
        tint = palette[(palette.index(made[j].tint) + 2) % len(palette)]
        same = made[j].ground_tint == made[j].tint
        made[j] = replace(made[j], tint=tint, ground_tint=tint if same else made[j].ground_tint)
    return made


def _mixed(a: Rgb, b: Rgb, share: float) -> Rgb:
    r, g, b_ = (round(x + (y - x) * share) for x, y in zip(a, b, strict=True))
    return r, g, b_


def _lifted(colour: Rgb) -> Rgb:
    """Return a facade's tagged colour made up for the grey of the picture it multiplies."""
    r, g, b = (min(round(c * 1.18) + 6, 255) for c in colour)
    return r, g, b
