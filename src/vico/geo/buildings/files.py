"""Files of buildings of any format, told apart by their names."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from vico.errors import InputError, MissingFileError
from vico.geo.buildings.city_gml import read_citygml
from vico.geo.buildings.city_json import read_cityjson
from vico.geo.buildings.model import FoundBuildings
from vico.geo.buildings.overture import read_overture_buildings
from vico.geo.frame import LocalFrame
from vico.geo.reference_systems import split_crs

_READERS = (
    ((".json", ".jsonl"), read_cityjson),
    ((".gml", ".xml", ".citygml"), read_citygml),
    ((".parquet", ".geoparquet"), read_overture_buildings),
)
_ENDINGS = tuple(ending for endings, _ in _READERS for ending in endings)


def read_buildings(given: Sequence[str | Path], frame: LocalFrame, half: float) -> list[FoundBuildings]:
    """Read the buildings that files have in the square of half side `half` metres around the frame's origin.

    Parameters
    ----------
    given
        CityJSON (``.json``, or ``.jsonl`` with a feature a line), CityGML (``.gml``, ``.xml``), Overture's GeoParquet
        (``.parquet``, or a folder of such). A model that does not say its reference system is given with it:
        ``city.json@EPSG:7415``.

    Returns
    -------
    list of FoundBuildings
        One each, in their order.

    Raises
    ------
    InputError
        If a file is of another kind by its name, or given twice.
    MissingFileError, SchemaError
        As the readers raise them.
    """
    return [_read(path, frame, half, crs) for path, crs in checked_files(given)]


def checked_files(given: Sequence[str | Path]) -> list[tuple[Path, str]]:
    """Return files and the reference systems said of them, after a look at their names, before anything is read.

    Raises
    ------
    InputError, MissingFileError
        If a file is of another kind by its name, given twice, or not there.
    """
    files = [split_crs(one) for one in given]
    names = [path.name for path, _ in files]
    if doubled := sorted({name for name in names if names.count(name) > 1}):
        raise InputError(f"buildings: {', '.join(doubled)} is given twice; rename one, so that each has a name")
    for path, _ in files:
        if not path.is_dir() and not path.name.lower().endswith(_ENDINGS):
            raise InputError(
                f"{path}: not a file of buildings by its name; it must end in .json or .jsonl (CityJSON), .gml or .xml "
                "(CityGML) or .parquet (Overture)"
            )
        if not path.exists():
            raise MissingFileError(f"{path}: no such file; give CityJSON, CityGML or Overture's GeoParquet")
    return files


def _read(path: Path, frame: LocalFrame, half: float, crs: str) -> FoundBuildings:
    if path.is_dir():
        return read_overture_buildings(path, frame, half, crs)
    read = next(read for endings, read in _READERS if path.name.lower().endswith(endings))
    return read(path, frame, half, crs)
