"""Facades are data: a region of one's own, a family of one's own, and what is said of mistakes."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from vico.errors import SchemaError
from vico.seeds import rng
from vico.worldgen.facades.facade_styles import RULES, House, facade_style_of, region_of, styles
from vico.worldgen.facades.textures.materials import PAINTERS, material
from vico.worldgen.stages import code_digest

PAGE = Path(__file__).parents[2] / "docs" / "adding_a_facade.md"
LISBON = (38.711, -9.139)


@pytest.fixture
def own_data(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of data beside the package's."""
    (tmp_path / "worldgen/facades").mkdir(parents=True)
    monkeypatch.setenv("VICO_DATA", str(tmp_path))
    return tmp_path / "worldgen/facades"


def examples() -> list[str]:
    return re.findall(r"```toml\n(.*?)```", PAGE.read_text(), re.S)


def test_a_region_of_ones_own_lines_its_streets_with_its_own_family(own_data: Path) -> None:
    region, family = examples()
    (own_data / "regions_portugal.toml").write_text(region)
    (own_data / "families_portugal.toml").write_text(family)
    assert region_of(*LISBON) == "portuguese"
    assert region_of(41.9, 12.5) == "italian"
    looks = [
        facade_style_of(
            "residential", {"start_date": "1890"}, levels=5, area=500.0, region="portuguese", random=rng(k, "look")
        )
        for k in range(200)
    ]
    tiled = [look for look in looks if look.wall == "wall_tiled"]
    assert 0.5 < len(tiled) / len(looks) < 0.7
    assert {look.tint for look in tiled} == {(206, 222, 236), (222, 236, 226), (246, 240, 214), (214, 226, 240)}
    painted = material("wall_tiled").texture
    assert painted is not None
    assert painted.shape == material("wall_shuttered").texture.shape
    assert not np.array_equal(painted, material("wall_shuttered").texture)


def test_without_data_of_ones_own_the_package_s_regions_stand() -> None:
    assert region_of(*LISBON) == "portuguese"
    assert "wall_tiled" not in styles().families


def test_worlds_know_by_which_data_they_were_made(own_data: Path) -> None:
    without = code_digest()
    (own_data / "colours.toml").write_text("[named]\nlilac = [200, 162, 200]\n")
    code_digest.__globals__["_code_digest"].cache_clear()
    assert code_digest() != without


@pytest.mark.parametrize(
    ("file", "text", "said"),
    [
        ("regions_x.toml", "[[region]]\nname = 'x'\ncolor = 1\n", r"regions_x\.toml: region\.0"),
        (
            "families_x.toml",
            "[[family]]\nname = 'wall_x'\nground_floors = ['ground_plain']\n",
            "nothing paints 'wall_x'",
        ),
        ("families_x.toml", "[[family]]\nname = 'wall_brick'\nground_floors = ['cellar']\n", "nothing paints 'cellar'"),
        (
            "uses_x.toml",
            "[[material]]\nvalues = ['cork']\nfamilies = { wall_cork = 1.0 }\n",
            r"material\.0\.families: no family 'wall_cork'",
        ),
        (
            "colours_x.toml",
            "[named]\npuce = [300, 0, 0]\n",
            r"named\.puce\.0: input should be less than or equal to 255",
        ),
    ],
)
def test_a_mistake_is_said_with_file_and_field(own_data: Path, file: str, text: str, said: str) -> None:
    (own_data / file).write_text(text)
    with pytest.raises(SchemaError, match=said):
        styles()


def test_everything_that_the_data_name_is_painted() -> None:
    known = styles()
    for family in known.families.values():
        assert {family.picture or family.name, *family.ground_floors} <= set(PAINTERS)
        assert {family.blank or "blank_plaster", family.back or family.name} <= set(PAINTERS)
        assert set(family.cornice_finishes) <= set(known.finishes)
    for finish in known.finishes.values():
        assert {finish.side, finish.under, finish.cover or "roof_tiles", finish.picture or finish.side} <= set(PAINTERS)
    assert {name for region in known.regions.values() for name in region.roofs} <= set(known.roofs) <= set(PAINTERS)
    assert set(known.blank_walls) == {name for name in PAINTERS if name.startswith("blank_")}
    assert {name for region in known.regions.values() for name in region.wooden_eaves} <= set(known.families)


def test_every_place_has_a_region_and_every_building_a_family() -> None:
    random = rng(0, "places")
    known = styles()
    for lat, lon in random.uniform((-89.0, -179.0), (89.0, 179.0), (200, 2)):
        region = known.region(region_of(float(lat), float(lon)))
        house = House("other", {}, 3, 300.0, region, known, float(random.random()))
        assert RULES[-1](house)


def test_a_window_s_frame_is_of_the_colour_that_the_data_say(own_data: Path) -> None:
    (own_data / "windows_green.toml").write_text("[[window]]\nname = 'french'\nrows = 3\nframe = [20, 120, 40]\n")
    green = []
    for name in ("wall_french", "wall_classic"):
        texture = material(name).texture
        assert texture is not None
        green.append(int(((texture[..., 1] > 100) & (texture[..., 0] < 40)).sum()))
    assert green[0] > 1000
    assert green[1] == 0
