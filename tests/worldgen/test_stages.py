"""Stages: what has the same inputs is not made again, what changed is, and one can be run alone."""

from __future__ import annotations

import gc
import json
import shutil
import weakref
from collections.abc import Callable
from pathlib import Path

import pytest

from command_line import vico
from vico.errors import InputError, MissingFileError
from vico.world.folder import read_world
from vico.world.world import World
from vico.worldgen import construction, recipe
from vico.worldgen.batch import read_place_table
from vico.worldgen.ground.terrain import flat_terrain
from vico.worldgen.pipeline import build_world, rebuild_world
from vico.worldgen.request import BuildOptions
from vico.worldgen.stages import Stages

EXTRACT = Path(__file__).parents[2] / "src" / "vico" / "data" / "helsinki.osm.pbf"
CENTRE = {"lat": 60.1690, "lon": 24.9435}


def double(values: list[int], *, by: int = 2) -> list[int]:
    return [value * by for value in values]


def test_a_stage_with_the_same_inputs_is_read_not_run(tmp_path: Path) -> None:
    first = Stages(tmp_path)
    assert first.run("double", double, [1, 2], by=2) == [2, 4]
    assert first.kept == []
    second = Stages(tmp_path)
    assert second.run("double", double, [1, 2], by=2) == [2, 4]
    assert second.kept == ["double"]


@pytest.mark.parametrize(("values", "by"), [([1, 3], 2), ([1, 2], 3)])
def test_a_stage_with_other_inputs_is_run(tmp_path: Path, values: list[int], by: int) -> None:
    Stages(tmp_path).run("double", double, [1, 2], by=2)
    other = Stages(tmp_path)
    assert other.run("double", double, values, by=by) == double(values, by=by)
    assert other.kept == []


def test_a_later_stage_is_kept_when_an_earlier_one_gives_the_same_again(tmp_path: Path) -> None:
    for again in ((), ("first",)):
        stages = Stages(tmp_path, again=again)
        value = stages.run("first", double, [1, 2])
        assert stages.run("second", double, value) == [4, 8]
    assert stages.kept == ["second"]


def test_what_nobody_needs_any_more_is_let_go(tmp_path: Path) -> None:
    stages = Stages(tmp_path)
    height = stages.run("terrain", flat_terrain, half=50.0)
    held = weakref.ref(height)
    del height
    gc.collect()
    assert held() is None


def test_a_torn_product_is_made_anew(tmp_path: Path) -> None:
    Stages(tmp_path).run("double", double, [1, 2])
    file = tmp_path / "double.stage"
    file.write_bytes(file.read_bytes()[:-3])
    stages = Stages(tmp_path)
    assert stages.run("double", double, [1, 2]) == [2, 4]
    assert stages.kept == []


def test_a_stopped_build_goes_on_and_gives_the_same_world(
    corner: World, begun: Callable[..., None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ran: list[str] = []

    def stop(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    real = construction.buildings_from_plans

    def counted(*inputs: object, **options: object) -> object:
        ran.append("buildings")
        return real(*inputs, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(construction, "buildings_from_plans", counted)
    begun(tmp_path / "w", "buildings", "indoor")
    with monkeypatch.context() as patch:
        patch.setattr(recipe, "furnish", stop)
        with pytest.raises(KeyboardInterrupt):
            build_world(EXTRACT, **CENTRE, half=60, out=tmp_path / "w", options=BuildOptions(previews=False))
    resumed = build_world(EXTRACT, **CENTRE, half=60, out=tmp_path / "w", options=BuildOptions(previews=False))
    assert ran == ["buildings"]
    assert resumed.files == corner.manifest.files
    assert resumed == corner.manifest


def test_one_stage_runs_alone_and_changes_nothing_else(
    corner: World, corner_path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copytree(corner_path, tmp_path / "w", symlinks=True)
    ran: list[str] = []
    for name in ("buildings_from_plans", "objects_from_osm", "ground_from_osm", "furnish"):
        room = next(room for room in (construction, construction, recipe) if hasattr(room, name))
        real = getattr(room, name)

        def counted(*inputs: object, name: str = name, real: object = real, **options: object) -> object:
            ran.append(name)
            return real(*inputs, **options)  # type: ignore[operator]

        monkeypatch.setattr(room, name, counted)
    again = rebuild_world(tmp_path / "w", ["objects"])
    assert ran == ["objects_from_osm"]
    assert again.files == corner.manifest.files
    with pytest.raises(InputError, match=r"'objectz'.*buildings.*objects"):
        rebuild_world(tmp_path / "w", ["objectz"])


def test_a_stage_is_not_run_alone_when_its_sources_are_gone(begun: Callable[..., None], tmp_path: Path) -> None:
    extract = tmp_path / "map.osm.pbf"
    extract.write_bytes(EXTRACT.read_bytes())
    begun(tmp_path / "w")
    build_world(extract, **CENTRE, half=60, out=tmp_path / "w", options=BuildOptions(previews=False))
    extract.unlink()
    with pytest.raises(MissingFileError, match="it is gone"):
        rebuild_world(tmp_path / "w", ["objects"])
    assert read_world(tmp_path / "w").buildings


def test_the_report_tells_counts_reasons_and_licences(helsinki_path: Path) -> None:
    page = (helsinki_path / "report.html").read_text()
    manifest = read_world(helsinki_path).manifest
    assert "map.png" in page
    assert "ODbL-1.0" in page
    assert "OpenStreetMap contributors" in page
    assert f"<b>{manifest.counts['places']:,}</b>" in page
    dropped = next(d for stage in manifest.stages for d in stage.dropped)
    assert dropped.id in page
    assert "http" not in page.replace("https://www.openstreetmap.org", "")


def test_many_places_are_built_side_by_side_and_a_bad_one_stops_nobody(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "map.osm.pbf").write_bytes(EXTRACT.read_bytes())
    (tmp_path / "places.csv").write_text(
        "name,lat,lon,radius,osm\nnorth,60.1692,24.9435,60,map.osm.pbf\nsea,10,10,60,\nsouth,60.1690,24.9437,60,\n"
    )
    words = ("world", "build-many", tmp_path / "places.csv", "--out", tmp_path / "worlds", "--workers", 2, "--json")
    assert vico(*words) == 1
    outcomes = json.loads(capsys.readouterr().out)["places"]
    assert [(o["name"], o["state"]) for o in outcomes] == [("north", "built"), ("sea", "failed"), ("south", "built")]
    assert "no map data" in outcomes[1]["reason"]
    assert read_world(tmp_path / "worlds" / "south").buildings
    assert not (tmp_path / "worlds" / "sea").exists()
    assert vico(*words) == 1
    assert [o["state"] for o in json.loads(capsys.readouterr().out)["places"]] == ["kept", "failed", "kept"]


def test_a_table_names_layouts_and_things_beside_it(tmp_path: Path) -> None:
    (tmp_path / "places.csv").write_text("name,lat,lon,layouts,things\na,1,2,plans,installed\nb,3,4,,\n")
    first, second = read_place_table(tmp_path / "places.csv").rows
    assert (first.layouts, first.things) == (str(tmp_path / "plans"), "installed")
    assert (second.layouts, second.things) == ("", "")


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "lacks name, lat, lon"),
        ("name,lat,lon\n", "holds no place"),
        ("name,lat,lon\n../x,1,2\n", "can't be a folder's name"),
        ("name,lat,lon\na,one,2\n", "latitude 'one' is no number of degrees"),
        ("name,lat,lon\na,91,2\n", "not on Earth"),
        ("name,lat,lon\na,100,20\n", "latitude and longitude look exchanged"),
        ("name,lat,lon\na,52,1000,11,6000\n", "decimal commas must be quoted"),
        ("name,lat,lon,raduis\na,1,2,60\n", "did you mean radius"),
        ("name,lat,lon,things\na,1,2,gold\n", "give procedural or installed"),
    ],
)
def test_a_bad_table_is_one_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, why: str) -> None:
    (tmp_path / "places.csv").write_text(text)
    assert vico("world", "build-many", tmp_path / "places.csv", "--out", tmp_path / "worlds") == 2
    assert why in capsys.readouterr().err
