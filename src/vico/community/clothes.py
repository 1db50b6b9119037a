"""Clothes of trades, read from ``vico/data/community/clothes.toml`` and files ``clothes*.toml`` of a user's own."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vico.community.model import Bag, Bottom, Hat, Over, Shoes, Top
from vico.errors import SchemaError
from vico.io.data_files import DataRecord, cached_data, data_files, read_record

Rgb = tuple[int, int, int]
Colours = tuple[Rgb, ...]
_GUIDE = "docs/adding_people.md"


class TradeClothes(DataRecord):
    """What is worn at some trades, as the fields of an appearance; of several values one is drawn.

    Attributes
    ----------
    trades
        Occupations, or their beginnings or ends: ``student`` is also a student of law.
    """

    trades: tuple[str, ...]
    top: tuple[Top, ...] = ()
    top_colour: Colours | str = ()
    under_colour: Colours | str = ()
    bottom: tuple[Bottom, ...] = ()
    bottom_colour: Colours | str = ()
    shoes: tuple[Shoes, ...] = ()
    shoes_colour: Colours | str = ()
    hat: Hat = "none"
    hat_colour: Colours | str = ()
    over: Over = "none"
    over_colour: Colours | str = ()
    bag: Bag = "none"
    bag_colour: Colours | str = ()

    def colours(self, field: str) -> Colours:
        """Return the colours of a field; none where it is as they like."""
        found = getattr(self, field)
        assert not isinstance(found, str)
        return tuple(found)


class _File(DataRecord):
    colours: Mapping[str, Colours] = {}
    clothes: tuple[TradeClothes, ...] = ()


@cached_data
def trade_clothes() -> tuple[TradeClothes, ...]:
    """Return the clothes of trades, in the order of the files.

    Raises
    ------
    SchemaError
        If a colour is no sRGB, or names a set that is not there.
    """
    named: dict[str, Colours] = {}
    found = []
    for path in data_files("community", "clothes"):
        file = read_record(path, _File, guide=_GUIDE)
        named |= file.colours
        found += [_with_colours(path, entry, named) for entry in file.clothes]
    return tuple(found)


def clothes_of(occupation: str) -> TradeClothes | None:
    """Return what is worn at an occupation; None where everybody dresses as they like. The last entry counts."""
    words = occupation.lower()
    if words.startswith(("retired ", "former ")):
        return None
    fitting = [
        entry
        for entry in trade_clothes()
        if any(words == t or words.endswith(f" {t}") or words.startswith(f"{t} of ") for t in entry.trades)
    ]
    return fitting[-1] if fitting else None


def _with_colours(path: Path, entry: TradeClothes, named: Mapping[str, Colours]) -> TradeClothes:
    """Put colours in the place of the names of sets ("@navy")."""
    found: dict[str, Any] = {}
    for field in TradeClothes.model_fields:
        if not field.endswith("_colour"):
            continue
        value = getattr(entry, field)
        if isinstance(value, str):
            if not value.startswith("@") or value[1:] not in named:
                known = ", ".join(f"@{name}" for name in named) or "none"
                raise SchemaError(f"{path}: {field}: no set of colours is called {value!r}; there are {known}")
            value = named[value[1:]]
        if any(not 0 <= channel <= 255 for colour in value for channel in colour):
            raise SchemaError(f"{path}: {field} of {entry.trades[0]}: channels are 0..255")
        found[field] = value
    return entry.model_copy(update=found)
