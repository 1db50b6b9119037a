"""What other sources say of the map's places: same, closed, of another kind, or missing.

Of a source whose content may not be kept (Google) only the id and our own decisions go on: a place it adds has the
category decided here, no name (one is made from the building's address), and no position but its building's door.
"""

from __future__ import annotations

import re
import unicodedata
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from difflib import SequenceMatcher

import numpy as np
import shapely

from vico.geo.places import FoundPlace
from vico.geometry import distance
from vico.world.model import Category, Dropped
from vico.worldgen.facts.named_places import NamedPlace
from vico.worldgen.places.kinds import meaning_of

# The farther apart two entries are, the more alike their names have to be: metres, likeness.
_ALIKE = ((15.0, 0.6), (40.0, 0.75), (80.0, 0.9))
_VAGUE = {"shop", "office", "craft", "healthcare", "company", "yes"}
_FORM_WORDS = "the der die das le la el ltd inc llc gmbh co kg oy oyj ab sa srl bv and und et"
_FORMS = frozenset(_FORM_WORDS.split())


@dataclass(frozen=True)
class Compared:
    """What comparing came to.

    Attributes
    ----------
    added
        Places the map lacks; without a name where the source's may not be kept.
    refined
        The map's places of a vague kind, by id, with the kind another source gives.
    closed
        Ids of the map's places that another source calls closed.
    dropped
        What the sources had and the world will not have, with the reason.
    """

    added: list[NamedPlace] = field(default_factory=list)
    refined: dict[str, NamedPlace] = field(default_factory=dict)
    closed: set[str] = field(default_factory=set)
    dropped: list[Dropped] = field(default_factory=list)


def compared(mapped: Sequence[NamedPlace], found: Sequence[FoundPlace]) -> Compared:
    """Compare the map's places with those of other sources.

    Parameters
    ----------
    mapped
        The map's places.
    found
        The others', of any number of sources; compared in the order of their ids.
    """
    result = Compared()
    known = _Known(mapped)
    for place in sorted(found, key=lambda p: p.id):
        meaning = meaning_of(place.source, place.kind, place.kinds)
        label = f"{place.kind} {place.name!r}" if place.may_be_kept else meaning[1] if meaning else "place"
        twin = known.like(place, None if meaning is None else meaning[0])
        if not place.open:
            if twin is not None:
                result.closed.add(twin.id)
            result.dropped.append(Dropped(id=place.id, reason=f"{label}: closed"))
        elif twin is not None:
            if meaning is not None and twin.kind in _VAGUE and meaning[1] not in _VAGUE:
                result.refined[twin.id] = replace(twin, category=meaning[0], kind=meaning[1])
            result.dropped.append(Dropped(id=place.id, reason=f"{label}: the same as {twin.id}"))
        elif meaning is None:
            result.dropped.append(Dropped(id=place.id, reason=f"{label}: nobody goes to such a thing"))
        elif not place.may_be_kept and meaning[0] in (Category.OPEN, Category.TRANSIT):
            result.dropped.append(Dropped(id=place.id, reason=f"{label}: only the map says where it is"))
        else:
            name = place.name if place.may_be_kept else ""
            named = NamedPlace(place.id, name, *meaning, np.array(place.xy), {}, None, exact=place.may_be_kept)
            result.added.append(named)
            known.add(replace(named, name=place.name))
    return result


class _Known:
    """Places to compare with, found by where they are."""

    def __init__(self, mapped: Sequence[NamedPlace]) -> None:
        self._mapped = list(mapped)
        self._tree = shapely.STRtree([m.area if m.area is not None else shapely.Point(m.xy) for m in mapped])
        self._added: dict[tuple[int, int], list[NamedPlace]] = defaultdict(list)

    def add(self, named: NamedPlace) -> None:
        self._added[_bin(named.xy[0], named.xy[1])].append(named)

    def like(self, place: FoundPlace, category: Category | None) -> NamedPlace | None:
        """Find the known place that is most likely the same, None if none is."""
        point = shapely.Point(place.xy)
        reach = _ALIKE[-1][0]
        hits = sorted(self._tree.query(point, predicate="dwithin", distance=reach).tolist())
        near = [(self._mapped[i], float(self._tree.geometries[i].distance(point))) for i in hits]
        i, j = _bin(*place.xy)
        for cell in [(a, b) for a in (i - 1, i, i + 1) for b in (j - 1, j, j + 1)]:
            near += [(named, distance(named.xy, place.xy)) for named in self._added.get(cell, [])]
        best: tuple[float, NamedPlace] | None = None
        for named, away in near:
            alike = likeness(place.name, named.name)
            least = next((least for within, least in _ALIKE if away <= within), 2.0)
            if category is not None and named.category is not category:
                least += 0.1
            if alike >= least and (best is None or alike - away / 200.0 > best[0]):
                best = (alike - away / 200.0, named)
        return None if best is None else best[1]


def _bin(x: float, y: float) -> tuple[int, int]:
    return int(x // _ALIKE[-1][0]), int(y // _ALIKE[-1][0])


def likeness(one: str, other: str) -> float:
    """How alike two names are, 0 to 1: letters without accents and case, words in any order, legal forms apart."""
    a, b = _words(one), _words(other)
    if not a or not b:
        return 1.0 if one.casefold() == other.casefold() else 0.0
    if set(a) == set(b):
        return 1.0
    short, long = sorted((set(a), set(b)), key=lambda words: (len(words), sorted(words)))
    inside = 0.85 if short <= long and sum(map(len, short)) >= 4 else 0.0
    return max(inside, SequenceMatcher(None, " ".join(a), " ".join(b), autojunk=False).ratio())


def _words(name: str) -> list[str]:
    plain = "".join(c for c in unicodedata.normalize("NFKD", name) if not unicodedata.combining(c)).casefold()
    words = re.findall(r"\w+", plain.replace("'", "").replace("’", ""))
    return [word for word in words if word not in _FORMS] or words
