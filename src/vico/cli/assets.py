"""`vico assets`, `vico motion` and `vico llm serve`: packs, generated things, motions, a local language model.

Packs are bodies, robots and things that are read from the packages that ship them; everything works without. `vico
assets generate` makes a thing out of words, a picture or a mesh, as an entry of a folder of one's own data. `vico
motion` reads motions of other programs, and those of a recorded run.
"""

from __future__ import annotations

import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from tyro.conf import Positional
from tyro.extras import SubcommandApp

from vico.cli.console import print_json
from vico.cli.options import FLAT
from vico.errors import InputError

if TYPE_CHECKING:
    from vico.assets.motions import MotionClip
    from vico.assets.object_generation import GeneratedObject, GenerationRequest


def _print_progress(sentence: str) -> None:
    print(sentence, file=sys.stderr)


def _thing_rows() -> list[dict[str, object]]:
    """Return a row for each collection of things, or one that says there is none."""
    from vico.assets.furniture_pack import PACK, available_things, credits_of, read_things

    if not available_things():
        rest = "Things are our own models."
        return [
            {"pack": "things", "package": PACK, "version": "1.8", "installed": False, "licence": "", "credits": rest}
        ]
    return [
        {"pack": "things", "package": c.collection, "version": "1.8", "installed": True, "licence": c.licence,
         "credits": c.words}
        for c in credits_of(read_things()[0])
    ]  # fmt: skip


@dataclass(frozen=True)
class GenerateOptions:
    """What `vico assets generate` is asked for."""

    prompt: Positional[str]  # The thing, in words.
    size: float  # Metres: its height.
    out: Path  # Folder of your own data (VICO_DATA); made if it is not there.
    seed: int = 0  # Of the noise that picture and mesh start from.
    #: Of the model; made of the words without. One that there is already takes the other's place in worlds.
    name: str = ""
    kind: str = ""  # What it is, such as post_box; the name without.
    tag: tuple[str, ...] = ()  # Tags of the map: things mapped so look like this, as in amenity=post_box.
    passable: bool = False  # Bodies are not stopped by it.
    size_of: Literal["height", "longest"] = "height"  # What the size says: the height, or the longest side.
    turn: float = 0.0  # Degrees counter-clockwise, so that its front looks along +x.
    faces: int = 1500  # How many triangles it may have.
    text_to_image: str = ""  # Model that makes the picture: a folder, or a name on the hub.
    image_to_mesh: str = ""  # Model that makes the mesh, of ShapEImg2ImgPipeline: a folder, or a name on the hub.
    picture: Path | None = None  # A picture of the thing, instead of a model that makes one.
    mesh: Path | None = None  # A mesh of the thing (GLB, OBJ, PLY, STL, OFF), instead of both models.
    up: Literal["", "y", "z"] = ""  # Which axis of that mesh is up; y for GLB and OBJ, else z.
    licence: str = ""  # Of that mesh.
    credit: str = ""  # Whom to thank for that mesh.
    steps: int = 30  # Denoising steps of the picture.
    mesh_steps: int = 64  # Denoising steps of the mesh.
    cells: int = 128  # Cells a side of the grid that the mesh is read from.
    side: int = 512  # Pixels a side of the picture.
    device: Literal["cpu", "cuda"] = "cpu"  # Where the models run.
    accept_licence: bool = False  # Use models whatever their licence: you say that you may.
    force: bool = False  # Replace what has the name in the folder.
    json: bool = False  # Print the result as JSON.

    def __post_init__(self) -> None:
        if self.mesh is not None and (self.picture is not None or self.text_to_image or self.image_to_mesh):
            raise InputError("generate: --mesh stands for the picture and both models; leave those out")
        if self.mesh is not None and not (self.licence and self.credit):
            raise InputError(
                "generate: say with --licence and --credit under which licence the mesh is, and whose it is"
            )
        if self.picture is not None and self.text_to_image:
            raise InputError("generate: give --picture or --text-to-image, not both")


def _thing_of_mesh(mesh: Path, options: GenerateOptions, request: GenerationRequest) -> GeneratedObject:
    from vico.assets.mesh_cleaning import read_mesh_file
    from vico.assets.object_generation import generate_from_mesh
    from vico.io.files import sha256_of

    raw = read_mesh_file(mesh, up=options.up)
    return generate_from_mesh(request, raw, digest=sha256_of(mesh), licence=options.licence, credit=options.credit)


def _thing_of_words(options: GenerateOptions, request: GenerationRequest) -> GeneratedObject:
    from vico.assets.object_generation import Networks, generate_from_text, model_names, network_versions
    from vico.io.diffusion import model_folder

    network_versions()  # says what is missing before anything is fetched
    names = model_names()
    picture_model = None if options.picture is not None else model_folder(options.text_to_image or names.text_to_image)
    networks = Networks(
        picture_model,
        model_folder(options.image_to_mesh or names.image_to_mesh),
        steps=options.steps,
        mesh_steps=options.mesh_steps,
        cells=options.cells,
        side=options.side,
        device=options.device,
    )
    return generate_from_text(
        request, networks, picture=options.picture, accept_licence=options.accept_licence,
        say=lambda sentence: print(sentence, file=sys.stderr),
    )  # fmt: skip


assets = SubcommandApp()


@assets.command(name="install")
def assets_install(
    what: Positional[Literal["people", "robots", "viewer", "things", "llm", "all"]] = "all",
    pack: Path | None = None,
    force: bool = False,
) -> int:
    """Fetch richer bodies, robots and furniture from the packages that ship them, and print their licences.

    Example: vico assets install people

    Args:
        what: Which pack. "llm" is a small language model (98 MB), which "all" leaves out.
        pack: For "things": a .deb of sweethome3d-furniture or a folder with its archives. Without it the one the
            system has, else what apt-get downloads.
        force: Fetch and prepare again.
    """
    from vico.assets.furniture_pack import fetch_things
    from vico.assets.packages import SMALL_LANGUAGE_MODEL, FetchError, fetch, small_language_model
    from vico.assets.people.anny import available, baked_file
    from vico.assets.people.bake import PEOPLE, bake
    from vico.assets.robots import robot_model, robot_names, robot_packages
    from vico.io.cache import cache_folder
    from vico.viewer.three import THREE, three_module

    began = time.perf_counter()
    if what in ("people", "all"):
        folder = fetch(PEOPLE, force=force, say=_print_progress)
        if force or not available():
            _print_progress("cutting and thinning the bodies")
            bake(folder, baked_file())
        _print_progress(f"people: {baked_file()} ({baked_file().stat().st_size / 1e6:.1f} MB)")
    if what in ("robots", "all"):
        for package in robot_packages():
            fetch(package, force=force, say=_print_progress)
        for name in robot_names():
            robot_model(name)
            _print_progress(f"robots: {name} is ready")
    if what in ("viewer", "all"):
        fetch(THREE, force=force, say=_print_progress)
        _print_progress(f"viewer: {three_module()}, for `vico view` and `vico live`")
    if what == "llm":
        fetch(SMALL_LANGUAGE_MODEL, force=force, say=_print_progress)
        _print_progress(f"llm: {small_language_model()}, for `vico llm serve`")
    if what in ("things", "all"):
        try:
            baked = fetch_things(pack, force=force, say=_print_progress)
            _print_progress(
                f"things: {baked} ({baked.stat().st_size / 1e6:.1f} MB), for `vico world build --things installed`"
            )
        except FetchError as error:
            if what == "things":
                raise
            _print_progress(f"{error}")  # a system's package: never a need
    _print_progress(f"done in {time.perf_counter() - began:.0f} s; all of it is in {cache_folder()}")
    return 0


@assets.command(name="status")
def assets_status() -> int:
    """Say which packs are installed, with their licences."""
    from rich.console import Console
    from rich.table import Table

    from vico.assets.packages import SMALL_LANGUAGE_MODEL, installed_folder
    from vico.assets.people.anny import available
    from vico.assets.people.bake import PEOPLE
    from vico.assets.robots import robot_packages
    from vico.viewer.three import THREE

    rows = [("people", PEOPLE, available())]
    rows.append(("llm", SMALL_LANGUAGE_MODEL, installed_folder(SMALL_LANGUAGE_MODEL) is not None))
    rows += [("robots", package, installed_folder(package) is not None) for package in robot_packages()]
    rows.append(("viewer", THREE, installed_folder(THREE) is not None))
    table = Table("pack", "package", "", "licence", "credits")
    for pack, package, ready in rows:
        state = "installed" if ready else "not installed"
        table.add_row(pack, f"{package.name} {package.version}", state, package.licence, package.credits)
    for row in _thing_rows():
        state = "installed" if row["installed"] else "not installed"
        table.add_row("things", str(row["package"]), state, str(row["licence"]), str(row["credits"]))
    Console().print(table)
    return 0


@assets.command(name="generate")
def assets_generate(options: Annotated[GenerateOptions, FLAT]) -> int:
    """Make a thing out of words: a picture of them, a mesh of the picture, a model of the mesh. The extra "diffusion".

    Example: vico assets generate "a red post box" --size 1.2 --tag amenity=post_box --out my-data

    Example: vico assets generate "a tent" --size 1.6 --text-to-image sd-turbo --image-to-mesh shap-e --out my-data

    Example: vico assets generate "a kiosk" --size 2.7 --mesh kiosk.glb --licence MIT --credit "Jo Doe" --out my-data
    """
    from vico.assets.object_generation import GenerationRequest, ObjectEntry, check_name_free, object_name, write_entry

    entry = ObjectEntry(options.name or object_name(options.prompt), options.kind, not options.passable, options.tag)
    check_name_free(entry, options.out, force=options.force)
    request = GenerationRequest(
        options.prompt, options.size, options.seed, along=options.size_of, turn=options.turn, faces=options.faces
    )
    thing = (
        _thing_of_words(options, request) if options.mesh is None else _thing_of_mesh(options.mesh, options, request)
    )
    model = write_entry(thing, entry, options.out, force=options.force)
    size = [round(float(v), 3) for v in thing.surface.positions.max(axis=0) - thing.surface.positions.min(axis=0)]
    result = {
        "name": entry.name, "model": str(model), "size": size, "triangles": len(thing.surface.triangles),
        "licence": thing.licence, "credit": thing.credit,
    }  # fmt: skip
    if options.json:
        print_json(result)
        return 0
    print(f"{entry.name}: {' x '.join(f'{v:g}' for v in size)} m, {len(thing.surface.triangles)} triangles, in {model}")
    print(f"{thing.credit}; licence {thing.licence}")
    print(f"export VICO_DATA={options.out.resolve()}   # worlds built from now on know {entry.name}")
    return 0


motion = SubcommandApp()


@motion.command(name="import")
def motion_import(
    path: Positional[Path],
    out: Path,
    animation: str = "",
    sheet: Path | None = None,
    force: bool = False,
    json: bool = False,
) -> int:
    """Read a motion of a BVH, AMASS (.npz) or glTF file, and write it on our skeleton.

    Example: vico motion import 01_01.bvh --out jump.motion --sheet jump.png

    Example: vico motion import dance.glb --animation samba --out samba.npz

    Args:
        path: The file; a .motion of ours can be turned into SMPL-X.
        out: File to write: .motion (ours) or .npz (SMPL-X, as AMASS has it).
        animation: Name of one of a glTF file's animations; the first without.
        sheet: Draw the motion into this picture.
        force: Replace files that are there.
        json: Print what was read as JSON.
    """
    from vico.assets.motions import import_motion, read_gltf_motion

    clip = read_gltf_motion(path, animation=animation) if animation else import_motion(path)
    return _write_motion(clip, path, out=out, sheet=sheet, force=force, json=json)


@motion.command(name="of-run")
def motion_of_run(
    run: Positional[Path], agent: str, out: Path, sheet: Path | None = None, force: bool = False, json: bool = False
) -> int:
    """Write how one person moved in a recorded run, a frame a step.

    Example: vico motion of-run out/run --agent resident_0 --out resident_0.npz

    Args:
        run: Run folder.
        agent: The person's name.
        out: File to write: .motion (ours) or .npz (SMPL-X, as AMASS has it).
        sheet: Draw the motion into this picture.
        force: Replace files that are there.
        json: Print what was written as JSON.
    """
    from vico.sim.recording.run import motion_of, read_run

    return _write_motion(motion_of(read_run(run), agent), run, out=out, sheet=sheet, force=force, json=json)


def _write_motion(clip: MotionClip, source: Path, *, out: Path, sheet: Path | None, force: bool, json: bool) -> int:
    """Write a clip in the format of the file's name, draw it where asked, and print what it is."""
    import numpy as np
    from PIL import Image

    from vico.assets.motions import smplx_of
    from vico.cli.console import check_output, print_json, print_table
    from vico.errors import InputError
    from vico.io.files import new_file
    from vico.viewer.motion_sheet import motion_sheet

    if out.suffix not in (".motion", ".npz"):
        raise InputError(f"motion: {out}: write .motion (ours) or .npz (SMPL-X, as AMASS has it)")
    for path in (out, *([sheet] if sheet else [])):
        check_output(path, source, force=force)
    if out.suffix == ".motion":
        clip.write(out)
    else:
        with new_file(out) as path, path.open("wb") as file:
            np.savez_compressed(file, allow_pickle=False, **smplx_of(clip))
    if sheet is not None:
        with new_file(sheet) as path:
            Image.fromarray(motion_sheet(clip)).save(path, format="PNG")
    told = {"name": clip.name, "frames": len(clip), "rate": round(clip.rate, 3), "seconds": round(clip.seconds, 3)}
    if json:
        print_json(told)
    else:
        print_table(str(out), told)
    return 0


language_model = SubcommandApp()


@language_model.command(name="serve")
def llm_serve(model: Path | None = None, context: int = 8192, threads: int = 1, port: int = 0) -> int:
    """Serve a language model on this machine, and print the variables that name it. Needs the extra "llm".

    Example: vico llm serve

    Example: vico llm serve --model qwen2.5-7b-instruct-q4_k_m.gguf --threads 8

    Args:
        model: Weights in GGUF. Without it the small ones of `vico assets install llm`, which only show that all works.
        context: Longest question and answer together, tokens.
        threads: Processor threads; beside other work, one is the fastest.
        port: Of 127.0.0.1; 0 takes a free one.
    """
    from vico.assets.packages import small_language_model
    from vico.llm.local import serve_model

    path = model or small_language_model()
    with serve_model(path, context=context, threads=threads, port=port) as base:
        print(f"export VICO_LLM_BASE_URL={base} VICO_LLM_MODEL={path.stem}", flush=True)
        print("Serving on this machine only, until Ctrl-C.", flush=True)
        try:
            threading.Event().wait()
        except KeyboardInterrupt:
            print("Stopped.")
    return 0
