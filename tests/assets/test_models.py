"""Models as data: read strictly, built from labelled parts, and as large as they were modelled."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from vico.assets.interior import RISE
from vico.assets.models.library import furniture_models, read_models, street_models
from vico.assets.models.movable import movable_kinds, movable_surfaces
from vico.assets.models.parts import HERE, copies_of
from vico.assets.models.schema import BoxPart, GroupPart
from vico.errors import InputError, SchemaError
from vico.io.data_files import PACKAGED
from vico.world.model import LANDING

DATA = PACKAGED / "assets" / "models"
GUIDE = Path(__file__).parents[2] / "docs" / "adding_a_model.md"
# Extents along x, y, z in metres, read off the models when they became data.
SIZES = {
    "bed_double": (2.1, 1.64, 0.95), "chair": (0.435, 0.42, 0.91), "gondola": (0.9, 2.44, 1.6),
    "reception_desk": (1.0, 2.7, 1.15), "wine_bottle": (0.072, 0.072, 0.29),
}  # fmt: skip


def file_with(tmp_path: Path, model: str, *, head: str = 'group = "amenity"') -> Path:
    path = tmp_path / "mine.toml"
    path.write_text(f"{head}\n[colours]\noak = [176, 136, 92]\n{model}\n")
    return path


def box(**placed: object) -> BoxPart:
    return BoxPart.model_validate_json(json.dumps({"shape": "box", "size": [1, 1, 1], "colour": "oak", **placed}))


def places(part: BoxPart | GroupPart) -> list[list[float]]:
    return [[round(float(v), 6) for v in copy.offset] for copy in copies_of(part, HERE)]


def test_the_example_of_the_guide_is_a_model(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ours = set(street_models())
    examples = re.findall(r"```toml\n(.*?)```", GUIDE.read_text("utf-8"), re.DOTALL)
    folder = tmp_path / "assets/models" / "outdoor"
    folder.mkdir(parents=True)
    (folder / "benches.toml").write_text(examples[0])
    monkeypatch.setenv("VICO_DATA", str(tmp_path))
    found = street_models()
    park = found["park_bench"]
    assert park.size == pytest.approx((0.53, 1.6, 0.82), abs=0.001)
    assert park.kind == "bench"
    assert park.foot == (0.5, 1.6)
    white = found["park_bench_white"]
    assert white.size == park.size
    assert not np.array_equal(white.surfaces[0].colour, park.surfaces[0].colour)
    assert set(found) - ours == {"park_bench", "park_bench_white"}


@pytest.mark.parametrize(("name", "size"), SIZES.items())
def test_a_piece_of_furniture_keeps_its_size(name: str, size: tuple[float, float, float]) -> None:
    assert furniture_models()[name].size == pytest.approx(size, abs=0.005)


def test_the_wall_of_a_staircase_is_as_high_and_long_as_the_stairs() -> None:
    low, high = furniture_models()["stair_wall"].bounds
    assert high[2] == pytest.approx(RISE + 1.045, abs=0.001)
    assert high[0] - low[0] == pytest.approx(4.5 - LANDING, abs=0.001)


def test_every_colour_and_assembly_of_our_files_is_known() -> None:
    for models in (street_models(), furniture_models()):
        for name, model in models.items():
            assert model.triangles > 0, name


def test_names_are_unique_over_all_files() -> None:
    names = [name for path in sorted(DATA.glob("*/*.toml")) for name in read_models(path)]
    # A vending machine and a turnstile stand outdoors and indoors; a mug stands on tables and is held in hands.
    indoor = set(furniture_models())
    elsewhere = set(street_models()) | set(read_models(DATA / "in_hand" / "in_hand.toml"))
    assert {name for name in names if names.count(name) > 1} <= indoor & elsewhere
    for folder in ("indoor", "outdoor", "in_hand"):
        here = [name for path in sorted((DATA / folder).glob("*.toml")) for name in read_models(path)]
        assert len(here) == len(set(here))


def test_copies_stand_mirrored_listed_and_repeated() -> None:
    assert places(box(at=[1, 2, 0], mirror="xy")) == [[1, 2, 0], [1, -2, 0], [-1, 2, 0], [-1, -2, 0]]
    assert places(box(at=[[0, 0, 0], [5, 0, 0]], repeat=2, step=[0, 1, 0])) == [
        [0, 0, 0], [0, 1, 0], [5, 0, 0], [5, 1, 0],
    ]  # fmt: skip
    assert places(box(at=[1, 0, 0], repeat=4, turn=90)) == [[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]]


def test_a_list_of_colours_goes_round_the_copies(tmp_path: Path) -> None:
    part = '{ shape = "box", size = [1, 1, 1], repeat = 3, step = [0, 2, 0], colour = ["oak", [9, 9, 9]] }'
    (surface,) = read_models(file_with(tmp_path, f"[model.m]\nparts = [{part}]"))["m"].surfaces
    assert surface.colour[::36].tolist() == [[176, 136, 92], [9, 9, 9], [176, 136, 92]]


@pytest.mark.parametrize(
    ("model", "message"),
    [
        ('[model.m]\nparts = [{ shape = "bux", size = [1, 1, 1], colour = "oak" }]', "model.m.parts.0.*box"),
        ('[model.m]\nparts = [{ shape = "box", size = [1, 1], colour = "oak" }]', "model.m.parts.0.box.size"),
        ('[model.m]\nparts = [{ shape = "box", sise = [1, 1, 1], colour = "oak" }]', "model.m.parts.0.box"),
        ('[model.m]\nparts = [{ shape = "box", size = [1, nan, 1], colour = "oak" }]', "parts.0.box.size.1"),
        ('[model.m]\nparts = [{ shape = "box", size = [1, -0.1, 1], colour = "oak" }]', "parts.0.box.size.1"),
        ('[model.m]\nparts = [{ shape = "box", size = [1, 0, 1], colour = "oak" }]', "parts.0.box.size.1"),
        ('[model.m]\nkind = "bench"', "model.m: .*either its parts, its mesh, or the model it is like"),
        ('[model.m]\nlike = "n"', "no model 'n'"),
        ("[model.m\n", "not valid TOML"),
    ],
)
def test_a_wrong_entry_is_refused_by_name(tmp_path: Path, model: str, message: str) -> None:
    path = file_with(tmp_path, model)
    with pytest.raises(SchemaError, match=message) as found:
        read_models(path)
    assert str(path) in str(found.value)


@pytest.mark.parametrize(
    ("model", "message"),
    [
        ('parts = [{ shape = "box", size = [1, 1, 1], colour = "ork" }]', "model.m: no colour is called 'ork'"),
        ('parts = [{ shape = "assembly", name = "wheel" }]', "no assembly is called 'wheel'"),
        ('colours = { a = "b", b = "a" }\nparts = [{ shape = "box", size = [1, 1, 1], colour = "a" }]', "after itself"),
    ],
)
def test_a_name_that_the_file_lacks_is_refused_when_the_model_is_made(tmp_path: Path, model: str, message: str) -> None:
    made = read_models(file_with(tmp_path, f"[model.m]\n{model}"))["m"]
    with pytest.raises(SchemaError, match=message):
        _ = made.surfaces


def test_an_assembly_in_itself_is_refused(tmp_path: Path) -> None:
    use = 'parts = [{ shape = "assembly", name = "a" }]'
    text = f"[assembly.a]\n{use}\n[model.m]\n{use}"
    with pytest.raises(SchemaError, match="deep in each other"):
        _ = read_models(file_with(tmp_path, text))["m"].surfaces


def test_a_folder_that_is_not_there_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("VICO_DATA", str(tmp_path / "nowhere"))
    with pytest.raises(InputError, match="nowhere"):
        street_models()


def test_a_thing_to_carry_of_a_users_own_comes_in_our_colours_and_theirs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "assets/models").mkdir(parents=True)
    (tmp_path / "assets/models" / "movable_kasse.toml").write_text(
        """
        [paints]
        tuerkis = [40, 170, 170]
        [object.einkaufskorb]
        sentence = "ein Einkaufskorb in {colour}"
        size = [0.3, 0.4, 0.3]
        parts = [{ shape = "box", size = [0.3, 0.4, 0.3], at = [0, 0, 0.15], colour = "paint" }]
        """
    )
    monkeypatch.setenv("VICO_DATA", str(tmp_path))
    assert {"einkaufskorb", "backpack"} <= set(movable_kinds())
    (surface,) = movable_surfaces("einkaufskorb", "tuerkis")
    assert surface.colour[0].tolist() == [40, 170, 170]
    assert movable_kinds()["einkaufskorb"].described("tuerkis") == "ein Einkaufskorb in tuerkis"
