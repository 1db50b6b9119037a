"""What facades can look like, by region, age and use: data of ``vico/data/facades``, read once.

`styles` is all of it; `records` describes the fields of the files, and docs/adding_a_facade.md how to add to them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
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
    TagValues,
    Uses,
    UsesFile,
)
from vico.worldgen.facades.textures.block_walls import UPPER_FLOORS
from vico.worldgen.facades.textures.ground_floors import GROUNDS


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
    roofs, signs = _files("roofs", RoofsFile), _files("signs", SignsFile)
    _check_pictures(families)
    _check_named_families(regions, uses, {family.name for family in _gathered(families, lambda file: file.family)})
    return FacadeStyles(
        plaster=_gathered(families, lambda file: file.plaster),
        stone=_gathered(families, lambda file: file.stone),
        families=_by_name(_gathered(families, lambda file: file.family)),
        ground_floors=_by_name(_gathered(families, lambda file: file.ground_floor)),
        blank_walls=_by_name(_gathered(families, lambda file: file.blank_wall)),
        regions=_by_name(_gathered(regions, lambda file: file.region)),
        uses=[file.uses for _, file in uses if file.uses is not None][-1],
        materials=_families_by_value(_gathered(uses, lambda file: file.material)),
        architectures=_families_by_value(_gathered(uses, lambda file: file.architecture)),
        wood=_gathered(roofs, lambda file: file.wood),
        felt=_gathered(roofs, lambda file: file.felt),
        modern_roofs=_gathered(roofs, lambda file: file.modern),
        roofs=_by_name(_gathered(roofs, lambda file: file.roof)),
        colours=dict(_gathered(_files("colours", ColoursFile), lambda file: file.named.items())),
        finishes=_by_name(_gathered(_files("finishes", FinishesFile), lambda file: file.finish)),
        trades=_by_name(_gathered(signs, lambda file: file.trade)),
    )


def region_of(lat: float, lon: float) -> str:
    """Return the name of the region whose building customs are to be expected at a place."""
    return next(region.name for region in reversed(list(styles().regions.values())) if region.holds(lat, lon))


class _Named(Protocol):
    @property
    def name(self) -> str: ...


N = TypeVar("N", bound=_Named)
R = TypeVar("R", bound=DataRecord)
T = TypeVar("T")


def _files(kind: str, record: type[R]) -> list[tuple[Path, R]]:
    return [(path, read_record(path, record)) for path in data_files(ROOM, kind)]


def _by_name(entries: Iterable[N]) -> dict[str, N]:
    """Return entries by name; a later one of the same name comes in the place of the earlier, at the end."""
    found: dict[str, N] = {}
    for entry in entries:
        found.pop(entry.name, None)
        found[entry.name] = entry
    return found


def _gathered(files: Iterable[tuple[Path, R]], entries: Callable[[R], Iterable[T]]) -> tuple[T, ...]:
    """Return the entries of all files, in their order."""
    return tuple(entry for _, file in files for entry in entries(file))


def _families_by_value(entries: Iterable[TagValues]) -> dict[str, Shares]:
    return {value: entry.families for entry in entries for value in entry.values}


def _check_pictures(files: Iterable[tuple[Path, FamiliesFile]]) -> None:
    for path, file in files:
        for k, family in enumerate(file.family):
            _check_painted(f"{path}: family.{k}.picture", family.picture or family.name, UPPER_FLOORS)
            for floor in family.ground_floors:
                _check_painted(f"{path}: family.{k}.ground_floors", floor, GROUNDS)


def _check_painted(where: str, name: str, painted: Iterable[str]) -> None:
    if name not in painted:
        raise SchemaError(f"{where}: nothing paints {name!r}; there are {', '.join(sorted(painted))}")


def _check_named_families(
    regions: Iterable[tuple[Path, RegionsFile]], uses: Iterable[tuple[Path, UsesFile]], known: set[str]
) -> None:
    for path, places in regions:
        for where, shares in _shares_of_regions(places):
            _check_shares(path, where, shares, known)
    for path, use in uses:
        for where, shares in _shares_of_uses(use):
            _check_shares(path, where, shares, known)


def _check_shares(path: Path, where: str, shares: Shares, known: set[str]) -> None:
    for name in shares:
        if name not in known:
            raise SchemaError(f"{path}: {where}: no family {name!r}; there are {', '.join(sorted(known))}")


def _shares_of_regions(file: RegionsFile) -> Iterator[tuple[str, Shares]]:
    for k, region in enumerate(file.region):
        for age in StreetMix.model_fields:
            yield f"region.{k}.streets.{age}", getattr(region.streets, age)
        yield f"region.{k}.towers", region.towers
        yield f"region.{k}.office_towers", region.office_towers
        for value, shares in region.materials.items():
            yield f"region.{k}.materials.{value}", shares
        yield f"region.{k}.wooden_gables", region.wooden_gables


def _shares_of_uses(file: UsesFile) -> Iterator[tuple[str, Shares]]:
    if file.uses is not None:
        for use in Uses.model_fields:
            yield f"uses.{use}", getattr(file.uses, use)
    for name, entries in (("material", file.material), ("architecture", file.architecture)):
        for k, entry in enumerate(entries):
            yield f"{name}.{k}.families", entry.families
