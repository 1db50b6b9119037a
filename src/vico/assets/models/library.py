"""The library of models: files are read strictly and only parsed once; shapes are made when they are first asked for.

All of it is data, and the files of a user's own (docs/adding_a_model.md): ``data/assets/models/indoor/*.toml`` holds
furniture and the small things that lie on it, ``data/assets/models/outdoor/*.toml`` what stands outdoors, at life size,
and ``data/assets/models/in_hand/*.toml`` what people hold while they eat, drink, march or keep dry. The origin of a
model in hand is where the fist holds it, not the middle of its foot. Plants grow by rule and chance: a list of their
leaves would be longer than the rule and say less. They stay code. So do the lenses of traffic signals, lit and unlit,
in the frame of the model `traffic_signals`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from vico.assets.models.model import Model, ModelCredit, Seat, Top
from vico.assets.models.parts import Palette, Scope, surfaces_of
from vico.assets.models.plants import plant_models
from vico.assets.models.schema import Assembly, MeshEntry, ModelEntry, ModelFile, Parts
from vico.assets.shapes import Colour, box
from vico.assets.vehicle_parts import one_surface
from vico.errors import InputError, MissingFileError, SchemaError
from vico.io.data_files import cached_data, data_files, own_files, read_record
from vico.io.files import sha256_of
from vico.world.glb import read_glb
from vico.world.mesh import Material, Surface, merge_surfaces

GUIDE = "docs/adding_a_model.md"


def read_models(path: Path) -> dict[str, Model]:
    """Read the models of a file, by name.

    Raises
    ------
    MissingFileError, SchemaError
        As `read_record`; also for a model that is like one that the file lacks. Colours and assemblies that it lacks
        are found when the surfaces are first asked for.
    """
    return models_of(read_record(path, ModelFile, guide=GUIDE), str(path), folder=path.parent)


def read_all(paths: Iterable[Path]) -> dict[str, Model]:
    """Read the models of several files; one read later replaces its namesake.

    The order is that in which worlds list their prototypes.
    """
    return {name: model for path in paths for name, model in read_models(path).items()}


def models_of(file: ModelFile, where: str, *, folder: Path | None = None) -> dict[str, Model]:
    """Make the models of a file that was read; `where` names it in errors, meshes lie in `folder`."""
    return {name: _model(name, entry, file, where, folder) for name, entry in file.model.items()}


def _model(name: str, entry: ModelEntry, file: ModelFile, where: str, folder: Path | None) -> Model:
    here = f"{where}: model.{name}"
    base = entry
    if entry.like is not None:
        found = file.model.get(entry.like)
        if found is None or found.like is not None:
            raise SchemaError(f"{here}.like: the file has no model {entry.like!r} with parts of its own; see {GUIDE}")
        base = found
        unknown = sorted(set(entry.colours) - set(base.colours))
        if unknown:
            raise SchemaError(f"{here}.colours: {entry.like!r} has no colour {unknown[0]!r} to change; see {GUIDE}")
    build: Callable[[], list[Surface]]
    if base.mesh is not None and folder is not None:
        build = _MeshReader(here, base.mesh, folder)
    elif base.parts is not None:
        build = _Builder(here, base.parts, {**file.colours, **base.colours, **entry.colours}, file.assembly)
    else:  # the schema sees to it
        raise SchemaError(f"{here}: neither parts nor like; see {GUIDE}")
    mesh = base.mesh
    top, seat = entry.top or base.top, entry.seat or base.seat
    solid = next((given for given in (entry.solid, base.solid) if given is not None), file.solid)
    return Model(
        name,
        entry.kind or base.kind or (entry.like or name),
        entry.group or base.group or file.group,
        build,
        solid,
        entry.foot or base.foot,
        None if top is None else Top(top.kind, top.height, top.size, top.centre),
        None if seat is None else Seat(seat.kind == "lie", seat.height, seat.size, seat.centre),
        None if mesh is None else ModelCredit(mesh.licence, mesh.credit, mesh.sha256),
    )


class _MeshReader:
    """Reads the surfaces of one entry from the file beside it."""

    def __init__(self, here: str, mesh: MeshEntry, folder: Path) -> None:
        self._here, self._mesh, self._path = here, mesh, folder / mesh.file

    def __call__(self) -> list[Surface]:
        if not self._path.is_file():
            raise MissingFileError(f"{self._here}.mesh: {self._path} is not there; put it beside the entry")
        if sha256_of(self._path) != self._mesh.sha256:
            raise SchemaError(
                f"{self._here}.mesh: {self._path} is another file than its sha256 says; generate it again"
            )
        surfaces = [surface for group in read_glb(self._path).values() for surface in group]
        if not surfaces:
            raise SchemaError(f"{self._here}.mesh: {self._path} holds no triangles; generate it again")
        return surfaces


class _Builder:
    """Makes the surfaces of one entry."""

    def __init__(self, here: str, parts: Parts, colours: Palette, assemblies: dict[str, Assembly]) -> None:
        self._here, self._parts, self._scope = here, parts, Scope(colours, assemblies)

    def __call__(self) -> list[Surface]:
        try:
            return merge_surfaces(surfaces_of(self._parts, self._scope))
        except InputError as error:
            raise SchemaError(f"{self._here}: {error}; see {GUIDE}") from None


INDOOR = "assets/models/indoor"
_INDOOR_ORDER = ("furniture", "homes", "shops", "public", "small_things")


@cached_data
def furniture_models() -> dict[str, Model]:
    """Return the models of furniture by name: ours and the user's, which may replace ours."""
    return read_all(data_files(INDOOR, first=_INDOOR_ORDER))


IN_HAND = "assets/models/in_hand"


@cached_data
def in_hand_models() -> dict[str, Model]:
    """Return the models by name: ours and the user's, which may replace ours."""
    return read_all(data_files(IN_HAND))


@cached_data
def placards() -> list[str]:
    """Return the names of the placards there are."""
    return [name for name, model in in_hand_models().items() if model.kind == "placard"]


@cached_data
def umbrellas() -> list[str]:
    """Return the names of the umbrellas there are."""
    return [name for name, model in in_hand_models().items() if model.kind == "umbrella"]


OUTDOOR = "assets/models/outdoor"
_OUTDOOR_ORDER = ("street", "squares", "traffic", "playgrounds", "barriers")


@cached_data
def street_models() -> dict[str, Model]:
    """Return the models of all that stands outdoors by name: ours and the user's, which may replace ours."""
    own = own_files(OUTDOOR)
    packaged = [path for path in data_files(OUTDOOR, first=_OUTDOOR_ORDER) if path not in own]
    return read_all(packaged) | {plant.name: plant for plant in plant_models()} | read_all(own)


# Lenses of a signal, metres: as the model's, and just before them.
_LENS_RADIUS = 0.105
_LENS_SIDES = 10
_LENS_FRONT = 0.302
_LENS_HIGHEST = 3.26
_LENS_STEP = 0.31
# Those of its walking part, metres.
_WALK_FRONT = 0.362
_WALK_HIGHEST = 2.37
_WALK_STEP = 0.24
_WALK_HALF = 0.08
_LIT: dict[str, Colour] = {"red": (255, 62, 48), "amber": (255, 190, 40), "green": (70, 250, 150)}
_UNLIT: dict[str, Colour] = {"red": (52, 16, 14), "amber": (48, 38, 12), "green": (12, 40, 26)}
_SHINING = Material("signal", emission=1.0)


def _round_lens(z: float, colour: Colour) -> Surface:
    """Make a disc that faces +x."""
    angles = np.linspace(0, 2 * np.pi, _LENS_SIDES, endpoint=False)
    ring = np.column_stack(
        [np.full(_LENS_SIDES, _LENS_FRONT), np.cos(angles) * _LENS_RADIUS, z + np.sin(angles) * _LENS_RADIUS]
    )
    return Surface.from_triangles(ring, np.array([(0, i, i + 1) for i in range(1, _LENS_SIDES - 1)]), colour=colour)


def _walk_lens(z: float, colour: Colour) -> Surface:
    """Make a square that faces +y."""
    h = _WALK_HALF
    corners = np.array([(h, z - h), (-h, z - h), (-h, z + h), (h, z + h)])
    points = np.column_stack([corners[:, 0], np.full(4, _WALK_FRONT), corners[:, 1]])
    return Surface.from_triangles(points, np.array([(0, 1, 2), (0, 2, 3)]), colour=colour)


def _signal_lenses(light: str, lenses: dict[str, Surface], unlit: dict[str, Surface]) -> list[Surface]:
    """Return lenses with one of them lit ("dark": none)."""
    parts = [one_surface([surface for name, surface in unlit.items() if name != light])]
    return parts + [replace(surface, material=_SHINING) for name, surface in lenses.items() if name == light]


@cache
def signal_prototypes() -> dict[str, list[Surface]]:
    """Lenses by prototype's name: ``signal_red`` and ``walk_red`` and the like, ``_dark`` for none lit; a post."""
    heights = {name: _LENS_HIGHEST - k * _LENS_STEP for k, name in enumerate(_LIT)}
    walks = {name: _WALK_HIGHEST - k * _WALK_STEP for k, name in enumerate(("red", "green"))}
    lit = {name: _round_lens(z, _LIT[name]) for name, z in heights.items()}
    unlit = {name: _round_lens(z, _UNLIT[name]) for name, z in heights.items()}
    walk_lit = {name: _walk_lens(z, _LIT[name]) for name, z in walks.items()}
    walk_unlit = {name: _walk_lens(z, _UNLIT[name]) for name, z in walks.items()}
    found = {f"signal_{light}": _signal_lenses(light, lit, unlit) for light in (*_LIT, "dark")}
    found |= {f"walk_{light}": _signal_lenses(light, walk_lit, walk_unlit) for light in ("red", "green", "dark")}
    post = [
        box((0.1, 0.1, 3.4), (0, 0, 1.7), colour=(58, 60, 60)),
        box((0.2, 0.32, 0.96), (0.18, 0, 2.95), colour=(24, 25, 26)),
        box((0.02, 0.44, 1.1), (0.08, 0, 2.95), colour=(36, 38, 40)),
    ]
    return found | {"signal_post": [one_surface(post)]}
