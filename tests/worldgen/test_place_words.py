"""Which tags make a place, and how it is called, are data that anybody may add to."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from vico.errors import SchemaError
from vico.world.model import Category
from vico.worldgen.facts import named_places
from vico.worldgen.facts.named_places import category_of
from vico.worldgen.places.stage import meaning_of

PAGE = Path(__file__).parents[2] / "docs" / "adding_a_place.md"


@pytest.fixture
def own_data(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A user's folder of data about places."""
    (tmp_path / "worldgen/places").mkdir(parents=True)
    monkeypatch.setenv("VICO_DATA", str(tmp_path))
    return tmp_path / "worldgen/places"


def test_the_page_s_examples_add_a_kind_of_place_with_german_names(own_data: Path) -> None:
    for name, text in zip(
        ("categories", "words", "names"),
        re.findall(r"```toml\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL),
        strict=True,
    ):
        (own_data / f"{name}_mine.toml").write_text(text)
    kind = "bicycle_repair_workshop"
    assert category_of({"amenity": kind}, is_area=False) == (Category.STORE, kind)
    assert category_of({"club": "chess"}, is_area=False) == (Category.ENTERTAINMENT, "chess")
    assert category_of({"amenity": "cafe"}, is_area=False) == (Category.FOOD, "cafe")
    assert meaning_of("overture", "bicycle_coop") == (Category.STORE, kind)
    assert meaning_of("google", "bicycle_parking_lot") is None
    assert meaning_of("overture", "holz_werkstatt") == (Category.STORE, "repair")
    names = named_places.place_names()
    assert names.describe(names.of(kind), street="Gasse") == "Fahrradwerkstatt in der Gasse"
    assert names.describe(names.home, where="Gasse 3") == "Wohnungen, Gasse 3"
    assert names.of("ice_cream") == "Ice cream"


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("categories", "[tags.amenity]\nshopping = ['mall']", r"tags\.amenity\.shopping"),
        ("words", "[words.store]\nrepair = 'bike'", r"words\.store\.repair"),
        ("names", "on_street = '{what} at {place}'", r"on_street: nothing fills \{place\}; gaps"),
        ("names", "home = '{what'", r"home: "),
    ],
)  # fmt: skip
def test_a_wrong_entry_is_told(own_data: Path, name: str, text: str, message: str) -> None:
    path = own_data / f"{name}_mine.toml"
    path.write_text(text)
    reads = {
        "categories": named_places.categories,
        "words": named_places.source_words,
        "names": named_places.place_names,
    }
    with pytest.raises(SchemaError, match=rf"{re.escape(str(path))}: {message}"):
        reads[name]()
