"""What facades can look like, by region, age and use: data of ``vico/data/facades``, read once.

`styles` is all of it; `records` describes the fields of the files, and docs/adding_a_facade.md how to add to them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, TypeVar

from vico.errors import SchemaError
from vico.io.data_files import DataRecord, cached_data, data_files, read_record
from vico.worldgen.facades.records import (
    ROOM,
    BlankWall,
    ColoursFile,
    FamiliesFile,
    Family,
    Finish,
    FinishesFile,
    GroundFloor,
    RegionalStyle,
    RegionsFile,
    Rgb,
    RoofCover,
    RoofsFile,
    Shares,
    SignsFile,
    SignTrade,
    StreetMix,
    Uses,
    UsesFile,
)
from vico.worldgen.facades.textures.ground_floors import GROUNDS
from vico.worldgen.facades.textures.walls import WALLS


@dataclass(frozen=True)
class FacadeStyles:
    """All that the files say, by name; fields as of the files' records."""

    plaster: tuple[Rgb, ...]
    stone: tuple[Rgb, ...]
    families: Mapping[str, Family]
    ground_floors: Mapping[str, GroundFloor]
    blank_walls: Mapping[str, BlankWall]
    regions: Mapping[str, RegionalStyle]
    uses: Uses
    materials: Mapping[str, Shares]
    architectures: Mapping[str, Shares]
    wood: tuple[Rgb, ...]
    felt: tuple[Rgb, ...]
    modern_roofs: tuple[Rgb, ...]
    roofs: Mapping[str, RoofCover]
    colours: Mapping[str, Rgb]
    finishes: Mapping[str, Finish]
    trades: Mapping[str, SignTrade]

    def region(self, name: str) -> RegionalStyle:
        """Return the region of that name; an unknown one is like the first."""
        return self.regions.get(name) or next(iter(self.regions.values()))

    def ground_floor(self, name: str) -> GroundFloor:
        """Return how a ground floor is tinted."""
        return self.ground_floors.get(name) or GroundFloor(name=name)


@cached_data
def styles() -> FacadeStyles:
    """Return what facades can look like: the package's data and the user's (``$VICO_DATA/facades``).

    Raises
    ------
    InputError
        If the variable names no folder.
    SchemaError
        If a file can't be used; the message says which, where, and what is wrong.
    """
    families, regions, uses = _files("families", FamiliesFile), _files("regions", RegionsFile), _files("uses", UsesFile)
    roofs, signs = [file for _, file in _files("roofs", RoofsFile)], [file for _, file in _files("signs", SignsFile)]
    known = {family.name for _, file in families for family in file.family}
    for path, file in families:
        _check_families(path, file)
    for path, place in regions:
        for where, shares in _shares_of_regions(place):
            _check_shares(path, where, shares, known)
    for path, use in uses:
        for where, shares in _shares_of_uses(use):
            _check_shares(path, where, shares, known)
    said = [use for _, use in uses]
    return FacadeStyles(
        plaster=tuple(tint for _, file in families for tint in file.plaster),
        stone=tuple(tint for _, file in families for tint in file.stone),
        families=_by_name(family for _, file in families for family in file.family),
        ground_floors=_by_name(floor for _, file in families for floor in file.ground_floor),
        blank_walls=_by_name(wall for _, file in families for wall in file.blank_wall),
        regions=_by_name(region for _, file in regions for region in file.region),
        uses=[file.uses for file in said if file.uses is not None][-1],
        materials={value: entry.families for file in said for entry in file.material for value in entry.values},
        architectures={value: entry.families for file in said for entry in file.architecture for value in entry.values},
        wood=tuple(tint for file in roofs for tint in file.wood),
        felt=tuple(tint for file in roofs for tint in file.felt),
        modern_roofs=tuple(tint for file in roofs for tint in file.modern),
        roofs=_by_name(roof for file in roofs for roof in file.roof),
        colours={name: rgb for _, file in _files("colours", ColoursFile) for name, rgb in file.named.items()},
        finishes=_by_name(finish for _, file in _files("finishes", FinishesFile) for finish in file.finish),
        trades=_by_name(trade for file in signs for trade in file.trade),
    )


def region_of(lat: float, lon: float) -> str:
    """Return the name of the region whose building customs are to be expected at a place."""
    return next(region.name for region in reversed(list(styles().regions.values())) if region.holds(lat, lon))


class _Named(Protocol):
    @property
    def name(self) -> str: ...


N = TypeVar("N", bound=_Named)
R = TypeVar("R", bound=DataRecord)


def _files(kind: str, record: type[R]) -> list[tuple[Path, R]]:
    return [(path, read_record(path, record)) for path in data_files(ROOM, kind)]


def _by_name(entries: Iterable[N]) -> dict[str, N]:
    """Return entries by name; a later one of the same name comes in the place of the earlier, at the end."""
    found: dict[str, N] = {}
    for entry in entries:
        found.pop(entry.name, None)
        found[entry.name] = entry
    return found


def _check_families(path: Path, file: FamiliesFile) -> None:
    for k, family in enumerate(file.family):
        picture = family.picture or family.name
        if picture not in WALLS:
            raise SchemaError(
                f"{path}: family.{k}.picture: nothing paints {picture!r}; there are {', '.join(sorted(WALLS))}"
            )
        for floor in family.ground_floors:
            if floor not in GROUNDS:
                raise SchemaError(
                    f"{path}: family.{k}.ground_floors: nothing paints {floor!r}; there are "
                    f"{', '.join(sorted(GROUNDS))}"
                )


def _check_shares(path: Path, where: str, shares: Shares, known: set[str]) -> None:
    for name in shares:
        if name not in known:
            raise SchemaError(f"{path}: {where}: no family {name!r}; there are {', '.join(sorted(known))}")


def _shares_of_regions(file: RegionsFile) -> Iterator[tuple[str, Shares]]:
    for k, region in enumerate(file.region):
        for age in StreetMix.model_fields:
            yield f"region.{k}.streets.{age}", getattr(region.streets, age)
        yield f"region.{k}.towers", region.towers
        yield f"region.{k}.wooden_gables", region.wooden_gables


def _shares_of_uses(file: UsesFile) -> Iterator[tuple[str, Shares]]:
    if file.uses is not None:
        for use in Uses.model_fields:
            yield f"uses.{use}", getattr(file.uses, use)
    for name, entries in (("material", file.material), ("architecture", file.architecture)):
        for k, entry in enumerate(entries):
            yield f"{name}.{k}.families", entry.families
