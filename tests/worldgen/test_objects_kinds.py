"""What tags mean: models of mapped things, signs by their codes, trees by species, climate and size."""

import re
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from vico.assets.models.library import street_models
from vico.errors import SchemaError
from vico.geo.frame import LocalFrame
from vico.geo.osm import OsmArea, OsmData, OsmNode, OsmWay
from vico.world.heights import HeightField
from vico.world.objects import Objects
from vico.worldgen.objects import catalogue
from vico.worldgen.objects.mapped_objects import region, sign_of, thing_of
from vico.worldgen.objects.stage import Surroundings, objects_from_osm
from vico.worldgen.objects.trees import blue_noise_points, climate, tree_placement

NOTHING = shapely.Polygon()


def placed(
    nodes: list[OsmNode] | None = None,
    ways: list[OsmWay] | None = None,
    areas: list[OsmArea] | None = None,
    *,
    openings: shapely.Polygon = NOTHING,
    carriageway: shapely.Polygon = NOTHING,
    solids: list[shapely.Polygon] | None = None,
) -> Objects:
    osm = OsmData(LocalFrame(50.0, 10.0), 60.0, 60.0, nodes or [], ways or [], areas or [], [])
    objects, _ = objects_from_osm(osm, Surroundings(solids or [], carriageway, openings), height=HeightField.flat(60.0))
    return objects


def way(number: int, *points: tuple[float, float], **tags: str) -> OsmWay:
    line = np.array(points)
    return OsmWay(number, [1000 * number + k for k in range(len(line))], line, False, tags)


def test_every_file_of_ours_names_models_that_stand_outdoors() -> None:
    for read in (catalogue.kinds, catalogue.signs, catalogue.trees, catalogue.barriers):
        read()


def test_thirty_three_amenities_have_models() -> None:
    values = {value for key, models in catalogue.kinds().tables if key == "amenity" for value in models}
    assert len({value for value in values if thing_of({"amenity": value})}) >= 33


@pytest.mark.parametrize(
    ("tags", "name"),
    [
        ({"amenity": "bench", "backrest": "no", "material": "concrete"}, "bench_stone"),
        ({"amenity": "bicycle_parking", "capacity": "2"}, "bicycle_stand"),
        ({"amenity": "bicycle_parking", "capacity": "24"}, "bicycle_parking_large"),
        ({"amenity": "vending_machine", "vending": "parking_tickets"}, "parking_meter"),
        ({"amenity": "vending_machine", "vending": "excrement_bags"}, "dog_bin"),
        ({"amenity": "recycling", "recycling:glass_bottles": "yes"}, "recycling_glass"),
        ({"man_made": "surveillance", "camera:mount": "wall"}, None),
        ({"tourism": "artwork", "artwork_type": "mural"}, None),
        ({"tourism": "artwork", "artwork_type": "statue"}, "statue"),
        ({"historic": "memorial", "memorial": "stolperstein"}, None),
        ({"highway": "street_lamp", "lamp_mount": "wall_mounted"}, None),
        ({"highway": "elevator", "level": "-1;0"}, "elevator"),
        ({"highway": "elevator", "level": "-2;-1"}, None),
        ({"emergency": "fire_hydrant", "fire_hydrant:type": "underground"}, "hydrant_lid"),
        ({"emergency": "fire_hydrant", "fire_hydrant:type": "wall"}, None),
        ({"traffic_sign": "FI:361[30]"}, "sign_speed"),
        ({"amenity": "restaurant"}, None),
    ],
)
def test_tags_decide_the_model(tags: dict[str, str], name: str | None) -> None:
    assert thing_of(tags) == name


@pytest.mark.parametrize(
    ("code", "name"),
    [
        ("FI:231", "sign_give_way"), ("FI:511;FI:872", "sign_crossing"), ("FI:871[Lippuautomaatti]", None),
        ("DE:250,1022-10", "sign_ban"), ("DE:274-30", "sign_speed"), ("US:R1-1", "sign_stop"),
        ("GB:616", "sign_no_entry"), ("hazard", "sign_warning"), ("XX:1", None), ("", None), ("yes", None),
    ],
)  # fmt: skip
def test_signs_are_told_apart_by_their_codes(code: str, name: str | None) -> None:
    assert sign_of(code) == name


def own(folder: Path, monkeypatch: pytest.MonkeyPatch, **files: str) -> Path:
    """Give a user's folder of data about objects."""
    (folder / "worldgen/objects").mkdir(parents=True)
    for name, text in files.items():
        (folder / "worldgen/objects" / f"{name}.toml").write_text(text)
    monkeypatch.setenv("VICO_DATA", str(folder))
    return folder / "worldgen/objects"


def test_a_users_kinds_go_before_ours(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    own(
        tmp_path, monkeypatch,
        kinds_mine='[tags.amenity]\nbench = "lounger"\npiano = "table_tennis"\n[tags.material]\nstone = "stone"\n',
        finer_mine='[[finer]]\nof = "lounger"\nwhen = { seats = { over = 3 } }\nmodel = "bench_stone"\n',
        signs_mine='[codes.NL]\nB7 = "sign_stop"\n[like]\nBE = "NL"\n',
    )  # fmt: skip
    assert thing_of({"amenity": "piano"}) == "table_tennis"
    assert thing_of({"amenity": "bench"}) == "lounger"
    assert thing_of({"amenity": "bench", "seats": "4"}) == "bench_stone"
    assert thing_of({"amenity": "waste_basket"}) == "waste_basket"
    assert sign_of("BE:B7") == "sign_stop"


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("kinds", '[tags.amenity]\npiano = "grand_piano"', r"tags\.amenity\.piano: no model 'grand_piano'"),
        ("finer", '[[finer]]\nof = "bench"\nwhen = { seats = { more = 3 } }\nmodel = ""', r"finer\.0\.when\.seats"),
        ("finer", '[[finer]]\nof = "bench"\nby = ["seats"]', r"finer\.0: .*either model, or by and models"),
        ("signs", '[like]\nBE = "NL"', r"like\.BE: 'NL' has no codes"),
        ("trees", '[names]\n"sakura" = "prunuss"', r"names\.sakura: no genus 'prunuss'"),
        ("barriers", '[lines]\nmoat = "water"', r"lines\.moat: no model 'water'"),
    ],
)
def test_a_wrong_entry_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, text: str, message: str
) -> None:
    folder = own(tmp_path, monkeypatch, **{f"{name}_mine": text})
    with pytest.raises(SchemaError, match=rf"{re.escape(str(folder))}/{name}_mine\.toml: {message}"):
        getattr(catalogue, "kinds" if name == "finer" else name)()


def test_the_page_s_examples_are_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = (Path(__file__).parents[2] / "docs" / "adding_an_object.md").read_text("utf-8")
    kinds, finer, standing, signs, trees = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)
    own(tmp_path, monkeypatch, kinds=kinds, finer=finer, standing=standing, signs=signs, trees=trees)
    models = tmp_path / "assets/models" / "outdoor"
    models.mkdir(parents=True)
    part = 'parts = [{ shape = "box", size = [0.7, 1.5, 1.3], at = [0, 0, 0.65], colour = [40, 30, 24] }]'
    models.joinpath("pianos.toml").write_text(
        f'group = "amenity"\n[model.street_piano]\n{part}\n[model.street_piano_white]\n{part}\n'
    )
    assert thing_of({"amenity": "piano"}) == "street_piano"
    assert thing_of({"amenity": "piano", "colour": "white"}) == "street_piano_white"
    assert thing_of({"musical_instrument": "organ"}) is None
    assert "street_piano" in catalogue.standing().facing_path
    assert sign_of("NL:B7") == "sign_stop"
    assert catalogue.trees().names["tilo"] == "tilia"
    assert catalogue.trees().mixes["mediterranean"].streets[0] == "tree_fruit"


def test_a_tree_is_known_by_a_name_in_a_users_language(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    own(tmp_path, monkeypatch, trees_ja='[names]\n"桜" = "prunus"\n')
    assert wish(**{"species:ja": "桜"})[0] == "tree_fruit"


@given(st.text(max_size=30))
def test_no_sign_code_breaks_anything(code: str) -> None:
    name = sign_of(code)
    assert name is None or name in street_models()


def test_post_boxes_look_as_in_their_country() -> None:
    tags = {"amenity": "post_box"}
    places = {"uk": (51.5, -0.1), "us": (40.7, -74.0), "fi": (60.2, 24.9)}
    assert [region(OsmData(LocalFrame(*place), 50.0, 0.0, [], [], [], [])) for place in places.values()] == list(places)
    assert len({thing_of(tags, where=where) for where in places}) == 3


def wish(**tags: str) -> tuple[str, float]:
    found = tree_placement("n1", tags, np.zeros(2), 0, "temperate")
    return found.prototype, found.scale * street_models()[found.prototype].size[2]


def test_trees_are_of_their_species_in_many_languages() -> None:
    named = [
        wish(species="Quercus robur"), wish(genus="Populus"), wish(taxon="Picea abies"),
        wish(**{"species:fi": "koivu"}),
        wish(**{"species:de": "Winterlinde"}), wish(**{"species:en": "weeping willow"}), wish(leaf_type="needleleaved"),
    ]  # fmt: skip
    assert [name for name, _ in named[:6]] == [
        "tree_oak", "tree_poplar", "tree_spruce", "tree_birch", "tree_lime", "tree_willow",
    ]  # fmt: skip
    assert named[6][0] in catalogue.trees().needles


def test_trees_have_their_mapped_size() -> None:
    assert wish(species="Tilia cordata", height="14 m")[1] == pytest.approx(14.0, abs=0.1)
    name, tall = wish(diameter_crown="5")
    assert street_models()[name].size[0] * tall / street_models()[name].size[2] == pytest.approx(5.0, abs=0.1)
    assert wish(circumference="2.5")[1] > wish(circumference="0.5")[1]
    slim, broad = wish(height="15", diameter_crown="4")[0], wish(height="10", diameter_crown="9")[0]
    assert (slim, broad) == ("tree_poplar", "tree_maple") or slim != broad


def test_palms_grow_in_monaco_and_conifers_in_helsinki() -> None:
    flat = HeightField.flat(50.0)
    high = HeightField(np.full_like(flat.heights, 1000.0), flat.half)
    zones = [climate(LocalFrame(43.73, 7.42), flat), climate(LocalFrame(60.17, 24.94), flat),
             climate(LocalFrame(42.5, 1.53), high), climate(LocalFrame(40.7, -74.0), flat)]  # fmt: skip
    assert zones == ["mediterranean", "boreal", "alpine", "temperate"]
    planted = [
        {tree_placement(f"n{k}", {}, np.array([70.0 * k, 0.0]), 0, zone).prototype for k in range(60)} for zone in zones
    ]
    assert [any(name in catalogue.trees().palms for name in names) for names in planted] == [True, False, False, False]


def test_blue_noise_keeps_its_distance() -> None:
    ground = shapely.Point(0, 0).buffer(40.0)
    points = blue_noise_points(ground, 50.0, 500, np.random.default_rng(1))
    apart = np.linalg.norm(points[:, None] - points[None], axis=2)[np.triu_indices(len(points), 1)]
    assert 60 <= len(points) <= 101
    assert apart.min() >= 0.72 * np.sqrt(50.0)
    assert shapely.contains_xy(ground, points[:, 0], points[:, 1]).all()


def test_a_bare_park_is_planted_off_its_paths_and_a_mapped_one_is_not() -> None:
    park = OsmArea("w1", shapely.box(-50, -50, 50, 50), {"leisure": "park"})
    path = shapely.box(-50, -2, 50, 2)
    trees = placed(areas=[park], openings=path)
    trunks = trees.where(trees.kind == "tree")
    assert 20 <= len(trunks) <= 42
    assert shapely.distance(shapely.points(trunks.position[:, :2]), path).min() > 0.7
    mapped = [OsmNode(k, np.array([8.0 * (k % 6) - 20, 8.0 * (k // 6) - 20]), {"natural": "tree"}) for k in range(30)]
    assert len(placed(mapped, areas=[park])) == 30


def test_a_wall_is_whole_from_end_to_end_and_open_at_its_gate() -> None:
    wall = way(1, (-10.0, 0.0), (11.3, 0.0), barrier="wall", height="1.2")
    gate = OsmNode(1, np.array([0.0, 0.0]), {"barrier": "gate"})
    pieces = placed([gate], [wall])
    pieces = pieces.where(pieces.kind == "wall")
    covered = shapely.union_all(
        [shapely.box(x - s, -1, x + s, 1) for x, s in zip(pieces.x, 1.01 * pieces.scale, strict=True)]
    )
    line = shapely.LineString([(-9.9, 0), (11.2, 0)]).difference(shapely.Point(0, 0).buffer(1.5))
    assert shapely.difference(line, covered).length < 0.2
    assert not covered.contains(shapely.Point(0, 0))


def test_fences_and_hedges_differ_by_their_tags() -> None:
    lines = [
        way(1, (-20.0, 0.0), (0.0, 0.0), barrier="fence", fence_type="chain_link"),
        way(2, (-20.0, 5.0), (0.0, 5.0), barrier="fence", fence_type="wood"),
        way(3, (-20.0, 10.0), (0.0, 10.0), barrier="hedge", height="0.6"),
        way(4, (-20.0, 15.0), (0.0, 15.0), barrier="fence", height="2"),
    ]
    names = placed(ways=lines).prototype.tolist()
    assert sorted(set(names)) == ["fence_high", "fence_mesh", "fence_wood", "hedge_low"]


def test_a_hedge_mapped_as_an_area_fills_it() -> None:
    shape = shapely.box(0, 0, 12, 2)
    blocks = placed(areas=[OsmArea("w9", shape, {"barrier": "hedge", "area": "yes"})])
    assert set(blocks.prototype.tolist()) == {"hedge_block"}
    assert len(blocks) == 24


def test_a_market_has_stalls_and_a_flower_bed_flowers() -> None:
    square = OsmArea("w1", shapely.box(-30, -30, 0, 0), {"amenity": "marketplace"})
    bed = OsmArea("w2", shapely.box(10, 10, 16, 14), {"landuse": "flowerbed"})
    kinds = placed(areas=[square, bed]).kind.tolist()
    assert kinds.count("market_stall") >= 12
    assert kinds.count("flowers") >= 5


def test_a_bench_turns_its_back_to_the_street_and_faces_the_path() -> None:
    street, path = shapely.box(-60, -4, 60, 4), shapely.box(-60, 38, 60, 41)
    bench = [
        OsmNode(1, np.array([0.0, 6.0]), {"amenity": "bench"}),
        OsmNode(2, np.array([0.0, 36.5]), {"amenity": "bench"}),
    ]
    objects = placed(bench, carriageway=street, openings=path)
    np.testing.assert_allclose(objects.yaw, [np.pi / 2, np.pi / 2], atol=0.01)


def test_a_shelter_opens_to_the_street_and_a_sign_looks_along_it() -> None:
    street = shapely.box(-60, -4, 60, 4)
    nodes = [
        OsmNode(1, np.array([0.0, 7.0]), {"amenity": "shelter"}),
        OsmNode(2, np.array([20.0, 5.0]), {"traffic_sign": "stop"}),
    ]
    objects = placed(nodes, carriageway=street)
    assert np.sin(objects.yaw[0]) == pytest.approx(-1.0, abs=0.01)
    assert abs(np.cos(objects.yaw[1])) == pytest.approx(1.0, abs=0.01)


def test_what_vehicles_sweep_is_kept_free_beyond_the_carriageway() -> None:
    class Lanes:
        ids, inside, width = ["lane"], np.array([-1]), np.array([3.2])

        def __len__(self) -> int:
            return 1

        def line(self, lane: int) -> np.ndarray:
            return np.array([[-60.0, 0.0, 0.0], [60.0, 0.0, 0.0]])

    osm = OsmData(LocalFrame(50.0, 10.0), 60.0, 60.0, [OsmNode(1, np.zeros(2), {"amenity": "bench"})], [], [], [])
    objects, _ = objects_from_osm(osm, Surroundings(), height=HeightField.flat(60.0), lanes=Lanes())
    assert shapely.distance(shapely.Polygon(objects.feet()[0]), shapely.LineString([(-60, 0), (60, 0)])) > 1.2
