"""`vico city build`, `info`, `check`, `export`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import tyro
from tyro.conf import Positional
from tyro.extras import SubcommandApp

from vico.cli.city_options import CityBuildOptions

_FLAT = tyro.conf.arg(name="")

city = SubcommandApp()


@city.command(name="build")
def city_build(options: Annotated[CityBuildOptions, _FLAT]) -> int:
    """Build a city of tiles that meet without a seam; each is a world of its own.

    A build that was stopped goes on where it was, and one with a changed map builds anew the tiles that changed.

    Example: vico city build --osm region.osm.pbf --center 60.1690,24.9435 --size 2000 --out city --workers 2
    """
    from vico.cli import city as verb

    return verb.build(options)


@city.command(name="info")
def city_info(path: Positional[Path], json: bool = False) -> int:
    """Say which tiles a city has, and what is in them.

    Example: vico city info city

    Args:
        path: City folder.
        json: Print JSON.
    """
    from vico.cli import city as verb

    return verb.info(path, json=json)


@city.command(name="check")
def city_check(path: Positional[Path], borders: bool = False, json: bool = False) -> int:
    """Check every tile of a city, and every border between two; exit 1 if anything is wrong.

    Example: vico city check city --borders

    Args:
        path: City folder.
        borders: Borders alone.
        json: Print JSON.
    """
    from vico.cli import city as verb

    return verb.check(path, tiles=not borders, json=json)


@city.command(name="export")
def city_export(
    path: Positional[Path], to: str, out: Path, rooms: bool = False, force: bool = False, json: bool = False
) -> int:
    """Write a city in another format: streets and places as one, meshes tile by tile.

    Example: vico city export city --to gltf --out city_gltf

    Args:
        path: City folder.
        to: gltf, usd, mjcf, geojson or xodr.
        out: Folder to make; refused if it exists, unless --force.
        rooms: With what lies indoors.
        force: Replace what this verb made there before; refused if the folder holds anything else.
        json: Print JSON.
    """
    from vico.cli import city as verb

    return verb.export(path, to, out=out, rooms=rooms, force=force, json=json)
