"""Things out of words, pictures and meshes: cleaned, thinned, sized, credited, kept; models that are refused."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from command_line import vico
from vico.assets import object_generation as module
from vico.assets.mesh_cleaning import RawMesh, object_surface
from vico.assets.models.library import street_models
from vico.assets.object_generation import (
    GenerationRequest,
    Networks,
    ObjectEntry,
    check_licence,
    generate_from_mesh,
    generate_from_text,
    object_name,
    write_entry,
)
from vico.errors import InputError, MissingFileError, OutputExistsError, SchemaError, SourceError
from vico.io import diffusion
from vico.io.diffusion import ModelFolder, model_folder
from vico.world.objects import Objects
from vico.worldgen.objects.mapped_objects import thing_of
from vico.worldgen.objects.stage import models_of


def ball(sides: int = 40, *, inside_out: bool = False) -> RawMesh:
    """A ball twice as high as wide, red above, blue below, corners not joined, with a crumb beside it."""
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, sides + 1), np.linspace(0, np.pi, sides + 1), indexing="ij")
    grid = np.stack([np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), 2 * np.cos(v)], axis=-1)
    a, b, c, d = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
    corners = np.concatenate([np.stack(t, axis=2).reshape(-1, 3, 3) for t in ((a, c, b), (a, d, c))])
    crumb = np.array([[[3, 0, 0], [3.02, 0, 0], [3, 0.02, 0]]] * 2) + np.array([[[0, 0, 0]], [[0, 0, 0.02]]])
    points = np.concatenate([corners, crumb]).reshape(-1, 3)
    faces = np.arange(len(points)).reshape(-1, 3)
    colours = np.where(points[:, 2:] > 0, (220, 30, 30), (30, 30, 220)).astype(np.uint8)
    return RawMesh(points, faces[:, ::-1].copy() if inside_out else faces, colours)


@pytest.mark.parametrize("inside_out", [False, True])
def test_a_mesh_is_cleaned_thinned_and_stands_on_its_foot_at_its_size(inside_out: bool) -> None:
    surface = object_surface(ball(inside_out=inside_out), size=1.2, faces=300)
    assert 100 < len(surface.triangles) <= 300
    low, high = surface.positions.min(axis=0), surface.positions.max(axis=0)
    assert low[2] == 0.0
    assert high[2] == pytest.approx(1.2, abs=1e-6)
    assert high[:2] + low[:2] == pytest.approx([0.0, 0.0], abs=1e-6)
    assert high[0] - low[0] == pytest.approx(0.6, abs=0.03)  # the crumb 3 m away is gone
    outward = (surface.positions - [0, 0, 0.6]) * [4, 4, 1]
    assert (np.einsum("ij,ij->i", outward, surface.normals) > 0).all()
    reds = surface.colour[surface.positions[:, 2] > 0.75]
    assert (reds[:, 0] > reds[:, 2]).all()


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (lambda m: RawMesh(m.points * (1, 1, 0.001), m.faces, m.colours), "a flat sheet"),
        (lambda m: RawMesh(np.where(m.points > 1.9, np.nan, m.points), m.faces, m.colours), "no finite numbers"),
        (lambda m: RawMesh(m.points, m.faces[:2], m.colours), "2 triangles are no thing"),
        (lambda m: RawMesh(m.points, m.faces + len(m.points), m.colours), "points that it lacks"),
        (lambda m: RawMesh(m.points, m.faces[:, [0, 0, 1]], m.colours), "have an area"),
    ],
)
def test_degenerate_geometry_is_refused_with_the_reason(spoil: object, reason: str) -> None:
    with pytest.raises(InputError, match=reason):
        object_surface(spoil(ball(12)), size=1.0)  # type: ignore[operator]


def test_an_entry_is_found_by_its_tag_and_thanked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = generate_from_mesh(
        GenerationRequest("a red ball", 0.8, faces=200), ball(), digest="0" * 64, licence="CC-BY-4.0", credit='Jo "Doe"'
    )
    entry = ObjectEntry("red_ball", "ball", tags=("leisure=ball", "leisure=big ball"))
    write_entry(made, entry, tmp_path)
    with pytest.raises(OutputExistsError, match="--force"):
        write_entry(made, entry, tmp_path)
    monkeypatch.setenv("VICO_DATA", str(tmp_path))
    model = street_models()["red_ball"]
    assert (model.kind, model.size[2], model.triangles) == ("ball", 0.8, len(made.surface.triangles))
    assert model.credit is not None
    assert model.credit.words == 'Jo "Doe"'
    assert thing_of({"leisure": "big ball"}) == "red_ball"
    row = {"id": "n1", "entity": 20000, "kind": "ball", "group": "amenity", "prototype": "red_ball", "x": 0.0, "y": 0.0,
           "z": 0.0, "yaw": 0.0, "scale": 1.0, "size_x": 0.4, "size_y": 0.4, "size_z": 0.8, "solid": True,
           "room": ""}  # fmt: skip
    surfaces, (thanks,) = models_of(Objects.from_rows([row]), installed=False)
    assert (thanks.name, thanks.licence, thanks.attribution) == ("red_ball", "CC-BY-4.0", 'Jo "Doe"')
    assert len(surfaces["red_ball"][0].triangles) == model.triangles
    (tmp_path / "assets/models/outdoor/generated_red_ball.glb").write_bytes(b"glTF")
    again = tmp_path.with_name("again")
    tmp_path.rename(again)
    monkeypatch.setenv("VICO_DATA", str(again))
    with pytest.raises(SchemaError, match="another file than its sha256 says"):
        _ = street_models()["red_ball"].surfaces


def test_a_mesh_of_a_file_comes_in_by_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    import trimesh

    raw = ball(16)
    upright = raw.points[:, [0, 2, 1]] * (1, 1, -1)  # y up, as OBJ and GLB are
    trimesh.Trimesh(upright, raw.faces, vertex_colors=raw.colours, process=False).export(tmp_path / "ball.glb")
    data = str(tmp_path / "data")
    size = ("--size", "2", "--size-of", "longest", "--faces", "150", "--out", data)
    given = ("--mesh", str(tmp_path / "ball.glb"))
    assert vico("assets", "generate", "a ball", *size, *given) == 2
    assert "--licence and --credit" in capsys.readouterr().err
    assert vico("assets", "generate", "a ball", *size, *given, "--licence", "MIT", "--credit", "Jo", "--json") == 0
    made = json.loads(capsys.readouterr().out)
    assert made["name"] == "ball"
    assert made["size"][2] == 2.0
    assert made["triangles"] <= 150
    assert json.loads((tmp_path / "data/generated/ball.json").read_text())["prompt"] == "a ball"
    assert [object_name(words) for words in ("The red post box", "邮筒", "7 dwarfs")] == [
        "red_post_box", "thing_" + object_name("邮筒")[6:], object_name("7 dwarfs")]  # fmt: skip


def toy_folder(path: Path, *, weights: str = "model.safetensors", card: str = "---\nlicense: mit\n---\n") -> Path:
    part = path / "prior"
    part.mkdir(parents=True)
    (path / "model_index.json").write_text(json.dumps({"_class_name": "ShapEImg2ImgPipeline", "prior": ["d", "P"]}))
    (part / "config.json").write_text("{}")
    (part / weights).write_bytes(b"weights")
    if card:
        (path / "README.md").write_text(card)
    return path


def test_pickles_other_pipelines_and_names_of_nothing_are_refused_in_a_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(SchemaError, match=r"pytorch_model.bin alone, which can run code"):
        model_folder(toy_folder(tmp_path / "a", weights="pytorch_model.bin"))
    with pytest.raises(MissingFileError, match="no such folder"):
        model_folder(tmp_path / "nowhere")
    with pytest.raises(MissingFileError, match=r"holds no model_index.json"):
        model_folder(tmp_path)

    class Hub:
        @staticmethod
        def snapshot_download(name: str, **_: object) -> str:
            raise ConnectionError(f"no way to {name}")

    monkeypatch.setattr(diffusion.importlib, "import_module", lambda name: Hub)
    with pytest.raises(SourceError, match=r"the hub does not give it .*no way to jo/doe.*give a folder"):
        model_folder("jo/doe")


def test_a_model_is_known_by_its_files_and_its_licence(tmp_path: Path) -> None:
    first = model_folder(toy_folder(tmp_path / "a"))
    half = model_folder(toy_folder(tmp_path / "b", weights="model.fp16.safetensors", card=""))
    assert (first.licence, first.variant, half.licence, half.variant) == ("mit", None, "", "fp16")
    assert first.digest != half.digest
    (tmp_path / "a/prior/model.safetensors").write_bytes(b"others")
    assert model_folder(tmp_path / "a").digest != first.digest
    assert check_licence(first, accepted=False) == "mit"
    with pytest.raises(InputError, match=r"states no licence.*--accept-licence"):
        check_licence(half, accepted=False)
    stated = toy_folder(tmp_path / "c", card="---\nlicense: other\nlicense_name: 'stability-ai-community'\n---\n")
    with pytest.raises(InputError, match="licence is stability-ai-community"):
        check_licence(model_folder(stated), accepted=False)


class Counted:
    """Stands for both networks; counts how often it is asked."""

    asked = 0

    def __init__(self, *_: object, **__: object) -> None:
        type(self).asked += 1

    def picture(self, prompt: str, *, never: str, seed: int) -> np.ndarray:
        assert prompt.startswith("a ball, one single object")
        assert "text" in never
        return np.full((16, 16, 3), seed, np.uint8)

    def mesh(self, picture: np.ndarray, *, seed: int) -> RawMesh:
        assert (picture == seed).all()
        return ball(12)


def test_the_same_words_and_seed_ask_no_network_twice(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("VICO_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(module, "network_versions", lambda: {"torch": "1"})
    for name in ("DiffusionPicture", "ShapEMesh"):
        monkeypatch.setattr(module, name, Counted)
    model = ModelFolder(tmp_path, "jo/doe", "1" * 64, "ShapEImg2ImgPipeline", "mit", None)
    networks = Networks(model, model)

    def made(seed: int, **more: object) -> int:
        before = Counted.asked
        thing = generate_from_text(GenerationRequest("a ball", 1.0, seed, **more), networks)  # type: ignore[arg-type]
        assert thing.licence == "mit"
        assert "jo/doe (mit)" in thing.credit
        return Counted.asked - before

    assert [made(1), made(1), made(1, faces=100, turn=90.0), made(2)] == [2, 0, 0, 2]
    torn = next((tmp_path / "cache/generated").glob("mesh-*"))
    torn.write_bytes(torn.read_bytes()[:100])
    assert made(1) + made(2) == 1
