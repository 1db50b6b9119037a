"""Reading files of models: strict, and only parsed once; shapes are made when they are first asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

from vico.assets.models.model import Model, ModelCredit, Seat, Top
from vico.assets.models.parts import Palette, Scope, surfaces_of
from vico.assets.models.schema import Assembly, MeshEntry, ModelEntry, ModelFile, Parts
from vico.errors import InputError, MissingFileError, SchemaError
from vico.io.data_files import read_record
from vico.io.files import sha256_of
from vico.world.glb import read_glb
from vico.world.mesh import Surface, merge_surfaces

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
