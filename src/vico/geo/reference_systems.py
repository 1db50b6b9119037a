"""Coordinates of files brought into the local frame, whatever name their reference system has."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pyproj import CRS, Transformer
from pyproj.exceptions import CRSError, ProjError

from vico.errors import SchemaError
from vico.geo.frame import LocalFrame

_EPSG = re.compile(r"EPSG[^0-9]*(?:[0-9.]*[:/])?:*([0-9]{4,6})", re.IGNORECASE)
_OGC = re.compile(r"(?:crs:EPSG|EPSG/0/|EPSG::|EPSG:)[:/]?(?:[0-9.]+[:/])?([0-9]{4,6})", re.IGNORECASE)
# Germany's surveys write ETRS89_UTM32*DE_DHHN2016_NH instead of a number.
_ADV = re.compile(r"ETRS89_UTM(3[123])", re.IGNORECASE)


_SAID = re.compile(r"(?P<path>.+)@(?P<crs>EPSG:[0-9]{4,6})", re.IGNORECASE)


def split_crs(given: str | Path) -> tuple[Path, str]:
    """Return a file and the reference system that is said after its name (``city.json@EPSG:7415``), empty if none."""
    found = _SAID.fullmatch(str(given))
    return (Path(found["path"]), found["crs"].upper()) if found else (Path(given), "")


def crs_named(name: str, where: str) -> tuple[CRS, bool]:
    """Return the reference system that a file names, and whether its geographic coordinates begin with latitude.

    Parameters
    ----------
    name
        Such as ``urn:ogc:def:crs:EPSG::25833``, ``https://www.opengis.net/def/crs/EPSG/0/7415``, ``EPSG:4326`` or
        ``urn:adv:crs:ETRS89_UTM32*DE_DHHN2016_NH``. Of a compound the horizontal part is meant.
    where
        File, and what in it, for errors.

    Raises
    ------
    SchemaError
        If it names none that is known.
    """
    adv = _ADV.search(name)
    found = _OGC.search(name) or _EPSG.search(name)
    code = int(f"258{adv[1]}") if adv else int(found[1]) if found else 0
    if not code:
        said = f"names {name[:80]!r}" if name else "names none"
        raise SchemaError(
            f"{where}: no EPSG code of its coordinates ({said}); say which after its name, as in "
            f"{Path(where).name}@EPSG:25833"
        )
    try:
        crs = CRS.from_epsg(code)
    except CRSError:
        raise SchemaError(f"{where}: EPSG:{code} is not a coordinate system known here") from None
    horizontal = crs.sub_crs_list[0] if crs.is_compound else crs
    # By the book latitude comes first; short names are used by those who put longitude first.
    by_the_book = "urn:" in name.lower() or "://" in name
    return horizontal, by_the_book and (horizontal.is_geographic or horizontal.is_geocentric)


class ToFrame:
    """Brings points of a file into a local frame.

    Parameters
    ----------
    name, where
        As `crs_named` takes them.
    frame
        The local frame.

    Raises
    ------
    SchemaError
        If the system is unknown.
    """

    def __init__(self, name: str, frame: LocalFrame, where: str) -> None:
        self._where = where
        self._crs, self._latitude_first = crs_named(name, where)
        try:
            self._transformer = Transformer.from_crs(self._crs, "EPSG:4326", always_xy=True)
        except ProjError as error:
            raise SchemaError(f"{where}: can't be brought to latitude and longitude ({error})") from None
        self._frame = frame

    def __call__(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return points, shape ``(n, 3)``, with ENU metres for their first two coordinates; far ones may be inf."""
        x, y = (points[:, 1], points[:, 0]) if self._latitude_first else (points[:, 0], points[:, 1])
        lon, lat = self._transformer.transform(x, y)
        return np.column_stack([self._frame.to_enu(lat, lon), points[:, 2]])
