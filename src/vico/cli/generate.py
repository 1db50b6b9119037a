"""`vico assets generate`: a thing out of words, a picture or a mesh, as an entry of a folder of one's own data."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from tyro.conf import Positional

from vico.cli.output import print_json
from vico.errors import InputError

if TYPE_CHECKING:
    from vico.assets.object_generation import GeneratedObject, GenerationRequest


@dataclass(frozen=True)
class GenerateOptions:
    """What `vico assets generate` is asked for.

    Attributes
    ----------
    prompt
        The thing, in words.
    size
        Metres: its height.
    out
        Folder of your own data (VICO_DATA); made if it is not there.
    seed
        Of the noise that picture and mesh start from.
    name
        Of the model; made of the words without. One that there is already takes the other's place in worlds.
    kind
        What it is, such as post_box; the name without.
    tag
        Tags of the map: things mapped so look like this, as in amenity=post_box.
    passable
        Bodies are not stopped by it.
    size_of
        What the size says: the height, or the longest side.
    turn
        Degrees counter-clockwise, so that its front looks along +x.
    faces
        How many triangles it may have.
    text_to_image
        Model that makes the picture: a folder, or a name on the hub.
    image_to_mesh
        Model that makes the mesh, of ShapEImg2ImgPipeline: a folder, or a name on the hub.
    picture
        A picture of the thing, instead of a model that makes one.
    mesh
        A mesh of the thing (GLB, OBJ, PLY, STL, OFF), instead of both models.
    up
        Which axis of that mesh is up; y for GLB and OBJ, else z.
    licence
        Of that mesh.
    credit
        Whom to thank for that mesh.
    steps
        Denoising steps of the picture.
    mesh_steps
        Denoising steps of the mesh.
    cells
        Cells a side of the grid that the mesh is read from.
    side
        Pixels a side of the picture.
    device
        Where the models run.
    accept_licence
        Use models whatever their licence: you say that you may.
    force
        Replace what has the name in the folder.
    json
        Print the result as JSON.
    """

    prompt: Positional[str]
    size: float
    out: Path
    seed: int = 0
    name: str = ""
    kind: str = ""
    tag: tuple[str, ...] = ()
    passable: bool = False
    size_of: Literal["height", "longest"] = "height"
    turn: float = 0.0
    faces: int = 1500
    text_to_image: str = ""
    image_to_mesh: str = ""
    picture: Path | None = None
    mesh: Path | None = None
    up: Literal["", "y", "z"] = ""
    licence: str = ""
    credit: str = ""
    steps: int = 30
    mesh_steps: int = 64
    cells: int = 128
    side: int = 512
    device: Literal["cpu", "cuda"] = "cpu"
    accept_licence: bool = False
    force: bool = False
    json: bool = False

    def __post_init__(self) -> None:
        if self.mesh is not None and (self.picture is not None or self.text_to_image or self.image_to_mesh):
            raise InputError("generate: --mesh stands for the picture and both models; leave those out")
        if self.mesh is not None and not (self.licence and self.credit):
            raise InputError(
                "generate: say with --licence and --credit under which licence the mesh is, and whose it is"
            )
        if self.picture is not None and self.text_to_image:
            raise InputError("generate: give --picture or --text-to-image, not both")


def generate(options: GenerateOptions) -> int:
    """Make the thing and write it; say where it is and how worlds come to show it."""
    from vico.assets.object_generation import GenerationRequest, ObjectEntry, check_name_free, object_name, write_entry

    entry = ObjectEntry(options.name or object_name(options.prompt), options.kind, not options.passable, options.tag)
    check_name_free(entry, options.out, force=options.force)
    request = GenerationRequest(
        options.prompt, options.size, options.seed, along=options.size_of, turn=options.turn, faces=options.faces
    )
    thing = _of_words(options, request) if options.mesh is None else _of_mesh(options.mesh, options, request)
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


def _of_mesh(mesh: Path, options: GenerateOptions, request: GenerationRequest) -> GeneratedObject:
    from vico.assets.mesh_cleaning import read_mesh_file
    from vico.assets.object_generation import generate_from_mesh
    from vico.io.files import sha256_of

    raw = read_mesh_file(mesh, up=options.up)
    return generate_from_mesh(request, raw, digest=sha256_of(mesh), licence=options.licence, credit=options.credit)


def _of_words(options: GenerateOptions, request: GenerationRequest) -> GeneratedObject:
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
