"""Facades: whole bays, aligned storeys, cuts that keep meshes closed, doors where entrances are."""

import math

import numpy as np
import pytest

from vico.seeds import rng
from vico.worldgen.buildings.roofs import building_solid
from vico.worldgen.buildings.walls import cut_at_heights
from vico.worldgen.facades.facade_styles import colour_of, facade_style_of, family_of, region_of, styles, year_of
from vico.worldgen.facades.textures.materials import PAINTERS, material
from vico.worldgen.facades.textures.walls import BAYS, STOREYS
from vico.worldgen.facades.walls import bay_coordinates, bays, storey_coordinates
from vico.worldgen.facts.roofs import Roof


def test_a_wall_holds_a_whole_number_of_bays() -> None:
    length = rng(0, "walls").uniform(1.5, 80, 200)
    count = bays(length, np.full(200, 3.0))
    end = bay_coordinates(length, length, count) * BAYS
    assert np.allclose(end, np.round(end))
    assert (np.abs(length / count - 3.0) < 1.5).all()


def test_storeys_begin_and_end_on_whole_texture_rows() -> None:
    low, high, count = np.array([4.0]), np.array([17.0]), np.array([4.0])
    z = np.array([4.0, 7.25, 10.5, 13.75, 17.0])
    assert np.allclose(storey_coordinates(z, low, high, count) * STOREYS, [0, 1, 2, 3, 4])


def test_a_cut_leaves_every_edge_with_its_counterpart() -> None:
    import shapely

    solid = building_solid(shapely.box(-8, -5, 8, 5), 0.0, 6.0, Roof("gabled", 3.0)).to_mesh64()
    points = np.asarray(solid.vert_properties)[:, :3]
    faces = np.asarray(solid.tri_verts, np.int64)
    owner = np.zeros(len(faces), np.int64)
    for height in (3.5, 6.0, 7.7):
        points, faces, owner = cut_at_heights(points, faces, owner, np.array([height]))
        z = points[faces][..., 2] - height
        assert not ((z.max(axis=1) > 1e-3) & (z.min(axis=1) < -1e-3)).any()
    edges = {(int(a), int(b)) for face in faces for a, b in zip(face, np.roll(face, -1), strict=True)}
    assert len(edges) == 3 * len(faces)
    assert all((b, a) in edges for a, b in edges)


@pytest.mark.parametrize("name", sorted(PAINTERS))
def test_textures_have_sides_of_powers_of_two_and_something_to_see(name: str) -> None:
    texture = material(name).texture
    assert texture is not None
    assert all(math.log2(side).is_integer() for side in texture.shape[:2])
    assert texture.std() > 1.0


def test_textures_are_painted_alike_each_time() -> None:
    a, b = material("wall_classic", 5).texture, material("wall_classic", 5).texture
    c = material("wall_classic", 6).texture
    assert a is not None
    assert b is not None
    assert c is not None
    assert np.array_equal(a, b)
    assert not np.array_equal(a, c)


def test_a_city_needs_few_materials_but_has_many_families() -> None:
    assert len([name for name in PAINTERS if name.startswith("wall_") and "back" not in name]) >= 30
    known, uses = styles(), styles().uses
    elsewhere = [*uses.tower_of_homes, *uses.tower_of_offices, *uses.public, *uses.trade, *uses.works, *uses.church]
    for region in known.regions.values():
        ages = [getattr(region.streets, age) for age in type(region.streets).model_fields]
        worn = {name for shares in (*ages, region.towers, elsewhere) for name in shares}
        families = [known.families[name] for name in sorted(worn)]
        sheets = {
            sheet for family in families for sheet in (family.name, *family.ground_floors, family.blank, family.back)
        }
        assert len(sheets) <= 52, region.name


@pytest.mark.parametrize("name", sorted(n for n in PAINTERS if n.startswith("wall_") and "shed" not in n))
def test_some_windows_of_every_family_are_lit_at_night_and_most_of_the_wall_is_not(name: str) -> None:
    painted = material(name)
    assert painted.texture is not None
    assert painted.emission == 1.0
    glow = painted.texture[..., 3] / 255
    assert 0.002 < glow.mean() < 0.3
    # Bay by bay the windows differ: no two of a row look the same.
    bays_of_row = painted.texture[:128].reshape(128, BAYS, -1, 4).swapaxes(0, 1)
    assert len({bay.tobytes() for bay in bays_of_row}) == BAYS


def test_what_a_facade_looks_like_follows_its_neighbours_left_and_right() -> None:
    for name in ("wall_classic", "wall_timbered", "ground_shops"):
        texture = material(name).texture
        assert texture is not None
        seam = np.abs(texture[:, 0, :3].astype(int) - texture[:, -1, :3]).mean()
        assert seam < 30.0, name


def test_a_tagged_colour_tints_the_wall() -> None:
    red = facade_style_of(
        "residential", {"building:colour": "#ff0000"}, levels=4, area=300, region="northern", random=rng(0, "a")
    )
    assert red.tint[0] > 250
    assert red.tint[1] < 140


@pytest.mark.parametrize(
    ("text", "expected"),
    [("#abc", (170, 187, 204)), ("#102030", (16, 32, 48)), ("White", (250, 250, 248)), ("#12", None), (None, None)],
)
def test_colours_of_tags_are_read(text: str | None, expected: tuple[int, int, int] | None) -> None:
    assert colour_of(text) == expected


def test_material_tags_decide_the_wall() -> None:
    look = facade_style_of(
        "office", {"building:material": "brick"}, levels=4, area=300, region="northern", random=rng(0, "a")
    )
    assert look.wall == "wall_brick"


@pytest.mark.parametrize(
    ("text", "year"),
    [
        ("1887", 1887),
        ("~1900", 1900),
        ("1960s", 1960),
        ("C19", 1850),
        ("before 1800", 1800),
        ("soon", None),
        (None, None),
    ],
)
def test_start_dates_are_read(text: str | None, year: int | None) -> None:
    assert year_of(text) == year


@pytest.mark.parametrize(
    ("use", "tags", "levels", "region", "family"),
    [
        ("residential", {"building:material": "timber_framing"}, 3, "german", "wall_timbered"),
        ("residential", {"building:material": "wood"}, 2, "nordic", "wall_boards"),
        ("religious", {"building": "church"}, 1, "british", "wall_church"),
        ("residential", {"building:architecture": "brutalist"}, 6, "northern", "wall_slab"),
        ("industrial", {"start_date": "1905"}, 3, "northern", "wall_loft"),
    ],
)
def test_tags_decide_the_family(use: str, tags: dict[str, str], levels: int, region: str, family: str) -> None:
    assert family_of(use, tags, levels=levels, area=300.0, region=region, draw=(0.9, 0.5)) == family


def test_towers_of_offices_are_of_glass_or_panels_or_of_their_region() -> None:
    random = rng(0, "towers")
    for region in ("northern", "southern", "american", "british", "german", "nordic", "elsewhere"):
        seen = {
            family_of("office", {}, levels=30, area=1500.0, region=region, draw=tuple(random.random(2)))
            for _ in range(40)
        }
        known = {"wall_glass", "wall_fins", "wall_ribbon", "wall_grid"}
        assert seen <= known | ({"wall_set_back"} if region == "american" else set())
        assert len(seen) > 1


def test_every_family_has_all_its_materials_in_every_region() -> None:
    random = rng(0, "looks")
    for k in range(600):
        region = ("northern", "southern", "american", "british", "german", "nordic")[k % 6]
        use = ("residential", "office", "retail", "hotel", "industrial", "civic", "religious", "garage")[k % 8]
        look = facade_style_of(
            use, {}, levels=int(random.integers(1, 20)), area=float(random.uniform(20, 900)), region=region,
            random=rng(k, "look"),
        )  # fmt: skip
        assert {look.wall, look.ground, look.blank, look.roof, look.back} <= set(PAINTERS)
        assert 2.0 < look.bay < 6.0


def test_regions_are_told_apart() -> None:
    places = {
        (60.17, 24.94): "finnish", (59.33, 18.06): "swedish", (51.51, -0.1): "british", (49.41, 8.7): "german",
        (52.52, 13.4): "east_german", (43.73, 7.42): "riviera", (40.72, -73.99): "northeastern",
        (42.33, -83.05): "american", (50.85, 4.35): "low_countries", (52.37, 4.9): "low_countries",
        (48.86, 2.35): "french", (47.49, 11.1): "alpine", (42.51, 1.52): "pyrenean", (40.42, -3.7): "spanish",
        (38.71, -9.14): "portuguese", (41.9, 12.48): "italian", (45.46, 9.19): "italian", (48.14, 11.58): "german",
        (55.75, 37.62): "eastern", (52.23, 21.01): "eastern", (35.68, 139.75): "japanese", (50.94, 6.96): "german",
        (53.55, 10.0): "german", (-33.87, 151.2): "northern", (48.41, 15.6): "danubian", (48.21, 16.37): "danubian",
        (47.8, 13.04): "danubian", (47.27, 11.39): "alpine", (48.14, 17.11): "danubian",
    }  # fmt: skip
    assert {at: region_of(*at) for at in places} == places
