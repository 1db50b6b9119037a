"""Files of buildings of any format, told apart by their names."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from vico.errors import InputError
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
    files = [split_crs(one) for one in given]
    names = [path.name for path, _ in files]
    if doubled := sorted({name for name in names if names.count(name) > 1}):
        raise InputError(f"buildings: {', '.join(doubled)} is given twice; rename one, so that each has a name")
    return [_read(path, frame, half, crs) for path, crs in files]


def _read(path: Path, frame: LocalFrame, half: float, crs: str) -> FoundBuildings:
    if path.is_dir():
        return read_overture_buildings(path, frame, half, crs)
    for endings, read in _READERS:
        if path.name.lower().endswith(endings):
            return read(path, frame, half, crs)
    raise InputError(
        f"{path}: not a file of buildings by its name; it must end in .json or .jsonl (CityJSON), .gml or .xml "
        "(CityGML) or .parquet (Overture)"
    )
