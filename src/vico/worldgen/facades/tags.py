"""What tags of the map say of a facade: colours and years."""

from __future__ import annotations

import re

from vico.worldgen.facades.catalogue import styles
from vico.worldgen.facades.records import Rgb


def colour_of(tag: str | None) -> Rgb | None:
    """Return an OSM colour (``#rgb``, ``#rrggbb`` or a common name); None where it is none of these."""
    if not tag:
        return None
    text = tag.strip().lower().split(";")[0].replace(" ", "").replace("_", "")
    if text.startswith("#"):
        digits = text[1:]
        if len(digits) == 3:
            digits = "".join(2 * c for c in digits)
        if len(digits) == 6 and all(c in "0123456789abcdef" for c in digits):
            return int(digits[:2], 16), int(digits[2:4], 16), int(digits[4:], 16)
    return styles().colours.get(text)


def year_of(text: str | None) -> int | None:
    """Return the year a ``start_date`` means: ``1887``, ``~1900``, ``1960s``, ``C19``, ``before 1800``; else None."""
    if not text:
        return None
    century = re.search(r"\bC(\d{1,2})\b", text.strip())
    if century:
        return int(century.group(1)) * 100 - 50
    year = re.search(r"(?<!\d)(1\d{3}|20\d{2})(?!\d{2})", text)
    return int(year.group(1)) if year else None
