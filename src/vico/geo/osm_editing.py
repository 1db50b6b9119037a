"""OpenStreetMap XML of editors and of Overpass: objects that are deleted, drafts, answers that are not whole."""

from __future__ import annotations

import bz2
import gzip
import re
import zlib
from pathlib import Path
from typing import BinaryIO
from xml.etree.ElementTree import ParseError

import osmium
from defusedxml.common import DefusedXmlException
from defusedxml.ElementTree import iterparse

#: Numbers of drafts begin here: those of OpenStreetMap are two powers of ten below.
FIRST_DRAFT = 10**12

_KINDS = {"node": "n", "way": "w", "relation": "r"}
_MARK = re.compile(rb"""\b(?:action\s*=\s*["']delete|visible\s*=\s*["']false)""")
_BLOCK = 1 << 20  # bytes that are read at a time
_LONGEST_MARK = 64  # bytes
# Overpass says at the end of its answer why that is not whole.
_REMARK = re.compile(rb"<remark>(.*?)</remark>", re.DOTALL)
_NODE_WITH_PLACE = re.compile(rb"""<nd\s[^>]*\blat\s*=""")
_END = 4096


def own_id(number: int) -> int:
    """Return an object's id; of a draft (a negative one) a positive id that no object of OpenStreetMap has."""
    return number if number >= 0 else FIRST_DRAFT - number


def deleted_objects(path: Path) -> frozenset[tuple[str, int]]:
    """Return the objects that an editor marked for deletion in a file (``action="delete"``, ``visible="false"``).

    An editor keeps them in its file until it uploads it, JOSM with ``visible="true"``.

    Parameters
    ----------
    path
        An extract; only XML holds such marks.

    Returns
    -------
    frozenset
        Kind (``n``, ``w`` or ``r``) and id of each, as in the file.
    """
    if path.name.lower().endswith(".pbf"):
        return frozenset()
    try:
        with _open_unpacked(path) as file:
            if not _is_marked(file):
                return frozenset()
        found: set[tuple[str, int]] = set()
        with _open_unpacked(path) as file:
            elements = iterparse(file, events=("start", "end"), forbid_dtd=True)
            _, root = next(elements)
            for event, element in elements:
                if event == "end":
                    if element.tag in _KINDS:
                        root.clear()
                elif element.tag in _KINDS and (element.get("action") == "delete" or element.get("visible") == "false"):
                    found.add((_KINDS[element.tag], int(element.get("id", ""))))
    except (ParseError, DefusedXmlException, ValueError, OSError, EOFError, zlib.error, StopIteration):
        return frozenset()  # what reads the objects says what is wrong with the file
    return frozenset(found)


def overpass_remark(path: Path) -> str:
    """Return what Overpass says at the end of an answer in XML that it could not finish; empty if nothing."""
    if path.name.lower().endswith(".pbf"):
        return ""
    try:
        with _open_unpacked(path) as file:
            end = b""
            while block := file.read(_BLOCK):
                end = (end + block)[-_END:]
    except (OSError, EOFError, zlib.error):
        return ""  # what reads the objects says what is wrong with the file
    found = _REMARK.search(end)
    return " ".join(found[1].decode("utf-8", "replace").split())[:200] if found else ""


def places_in_ways(path: Path) -> bool:
    """Whether ways carry the places of their nodes themselves, as Overpass writes them for ``out geom``."""
    if path.name.lower().endswith(".pbf"):
        return False
    with _open_unpacked(path) as file:
        return _NODE_WITH_PLACE.search(file.read(_BLOCK)) is not None


def draft_places(path: Path) -> dict[int, tuple[float, float]]:
    """Return latitude and longitude of nodes with negative ids, by id; the reader of ways keeps none of these."""
    found = {}
    for node in osmium.FileProcessor(str(path), osmium.osm.NODE):
        if node.id < 0 and node.location.valid():
            found[node.id] = (node.location.lat, node.location.lon)
    return found


def _open_unpacked(path: Path) -> BinaryIO:
    name = path.name.lower()
    if name.endswith(".gz"):
        return gzip.open(path)  # type: ignore[return-value]
    return bz2.open(path) if name.endswith(".bz2") else path.open("rb")  # type: ignore[return-value]


def _is_marked(file: BinaryIO) -> bool:
    """Whether a mark is anywhere in a file; most have none, and needn't be parsed twice."""
    rest = b""
    while block := file.read(_BLOCK):
        block = rest + block
        if _MARK.search(block):
            return True
        rest = block[-_LONGEST_MARK:]
    return False
