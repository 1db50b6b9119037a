"""What the words of other sources of places mean: our category, and OpenStreetMap's word for the kind.

Words are Google's place types (tables A and B of the new API, and the legacy ones) and Overture's categories of both
taxonomies. Overture has some two thousand: those that differ from their group are listed in ``data/places/words.toml``,
the rest follow from their wider words, their endings, or are offices.
"""

from __future__ import annotations

from collections.abc import Sequence

from vico.world.model import Category
from vico.worldgen.facts.named_places import source_words


def meaning_of(source: str, kind: str, wider: Sequence[str] = ()) -> tuple[Category, str] | None:
    """Our category and kind of a place that a source calls so; None for what nobody goes to.

    Parameters
    ----------
    source
        ``overture`` or ``google``.
    kind, wider
        Its own word, and wider ones, the nearest first.
    """
    listed = source_words()
    if kind in listed.words:
        meaning = listed.words[kind]
        # Google's "point_of_interest" says nothing, but a second word may.
        if meaning is not None or source != "google":
            return meaning
    for ending in listed.endings:
        if kind.endswith(ending.endings):
            return ending.category, ending.kind
    for word in wider:
        known = listed.words.get(word)
        if known is not None:
            return known
    return (Category.OFFICE, "company") if source == "overture" and kind not in listed.words else None
