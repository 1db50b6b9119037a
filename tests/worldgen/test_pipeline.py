"""The build as a whole: whole or not at all, the same bytes from the same input, one sentence for bad input."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from vico.errors import EmptyInputError, InputError, MissingFileError, OutputExistsError
from vico.world.folder import read_world
from vico.world.world import World
from vico.worldgen import recipe
from vico.worldgen.pipeline import build_world, extract_centre
from vico.worldgen.request import BuildOptions, Sources

EXTRACT = Path(__file__).parents[2] / "src" / "vico" / "data" / "helsinki.osm.pbf"
CENTRE = {"lat": 60.1690, "lon": 24.9435}


def test_the_same_input_and_seed_give_the_same_bytes(corner_path: Path, tmp_path: Path) -> None:
    again = build_world(EXTRACT, **CENTRE, half=60, seed=0, out=tmp_path / "w", options=BuildOptions(previews=False))
    assert again.files == read_world(corner_path).manifest.files
    assert (tmp_path / "w" / "world.json").read_bytes() == (corner_path / "world.json").read_bytes()


def test_another_seed_gives_another_world(corner: World, tmp_path: Path) -> None:
    other = build_world(EXTRACT, **CENTRE, half=60, seed=4, out=tmp_path / "w", options=BuildOptions(previews=False))
    assert other.files["meshes/buildings.glb"] != corner.manifest.files["meshes/buildings.glb"]


def test_an_existing_folder_is_refused_and_left_alone(helsinki_path: Path) -> None:
    before = (helsinki_path / "world.json").read_bytes()
    with pytest.raises(OutputExistsError, match="--force"):
        build_world(EXTRACT, **CENTRE, half=60, out=helsinki_path, options=BuildOptions(previews=False))
    assert (helsinki_path / "world.json").read_bytes() == before


def test_force_replaces_the_folder_and_what_a_killed_build_left(begun: Callable[..., None], tmp_path: Path) -> None:
    out = tmp_path / "world"
    begun(out)
    build_world(EXTRACT, **CENTRE, half=60, out=out, options=BuildOptions(previews=True, keep_stages=False))
    assert (out / "previews").is_dir()
    partial = tmp_path / "world.partial"
    begun(out)
    (partial / "rubbish").write_text("left by a killed build")
    build_world(EXTRACT, **CENTRE, half=60, out=out, force=True, options=BuildOptions(previews=False))
    assert sorted(p.name for p in tmp_path.iterdir()) == ["world"]
    assert not (out / "previews").exists()


def test_an_interrupted_build_leaves_no_world_but_its_finished_stages(
    begun: Callable[..., None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(recipe, "places_from_osm", interrupt)
    begun(tmp_path / "world", "places")
    with pytest.raises(KeyboardInterrupt):
        build_world(EXTRACT, **CENTRE, half=60, out=tmp_path / "world", options=BuildOptions(previews=False))
    assert not (tmp_path / "world").exists()
    left = {p.name for p in (tmp_path / "world.partial").iterdir()}
    assert {"terrain.npz", "roads.json", "roads.net.xml", "walkable.npz"} <= left
    with pytest.raises(MissingFileError, match="no finished world"):
        read_world(tmp_path / "world.partial")


def test_stages_are_reported_in_order_with_their_counts(helsinki: World) -> None:
    names = [stage.name for stage in helsinki.manifest.stages]
    assert names[0] == "map"
    assert {"buildings", "roads", "transit", "objects", "walkable", "places", "indoor"} <= set(names)
    assert all(stage.counts for stage in helsinki.manifest.stages)


def test_what_was_left_out_has_a_reason(helsinki: World) -> None:
    dropped = [entry for stage in helsinki.manifest.stages for entry in stage.dropped]
    assert dropped
    assert all(entry.id and entry.reason for entry in dropped)


def test_no_file_holds_a_time_or_a_path_of_this_machine(helsinki_path: Path, tmp_path: Path) -> None:
    manifest = json.loads((helsinki_path / "world.json").read_text())
    assert str(helsinki_path) not in (helsinki_path / "roads.net.xml").read_text()
    assert "build.json" not in manifest["files"]


def test_a_place_without_buildings_is_refused_and_nothing_is_left(tmp_path: Path) -> None:
    with pytest.raises(EmptyInputError):
        build_world(EXTRACT, lat=10.0, lon=10.0, half=60, out=tmp_path / "world", options=BuildOptions(previews=False))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("half", [0.0, -5.0, float("nan"), 1e6])
def test_a_radius_that_makes_no_sense_is_refused(tmp_path: Path, half: float) -> None:
    with pytest.raises(InputError, match="radius"):
        build_world(EXTRACT, **CENTRE, half=half, out=tmp_path / "world", options=BuildOptions(previews=False))


def test_the_middle_of_the_packaged_extract_is_central_helsinki() -> None:
    lat, lon = extract_centre(EXTRACT)
    assert lat == pytest.approx(60.169, abs=0.01)
    assert lon == pytest.approx(24.9435, abs=0.02)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "lat", "lon", "dem"),
    [
        ("monaco", 43.73384, 7.41813, "dem_srtm.tif"),
        ("nyc_les", 40.72103, -73.98768, None),
        ("berlin_mitte", 52.5093, 13.39295, None),
    ],
)
def test_other_cities_build_and_pass_the_check(
    shared_data: Path, tmp_path: Path, name: str, lat: float, lon: float, dem: str | None
) -> None:
    from vico.world.check import check_world

    folder = shared_data / "places" / name
    out = tmp_path / name
    sources = Sources(folder / f"{name}.osm.pbf", dem=(folder / dem,) if dem else ())
    build_world(sources, lat=lat, lon=lon, half=300, out=out, options=BuildOptions(previews=False))
    assert check_world(read_world(out)) == []
