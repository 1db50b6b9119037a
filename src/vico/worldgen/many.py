"""Many worlds side by side: a task each for processes of this machine or a Ray cluster."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from vico.errors import VicoError
from vico.io.stores import FolderStore, Store, store_at
from vico.jobs import Answer, Service, Task, open_executor
from vico.jobs.shared import check_seen, seen_by_all
from vico.world.folder import fetch_manifest, read_world
from vico.world.world import stage_seconds
from vico.worldgen.pipeline import build_world
from vico.worldgen.place_tables import PlaceRow
from vico.worldgen.sources import Sources


@dataclass(frozen=True)
class Outcome:
    """What became of a place: built, kept (it was there), or failed with a reason."""

    name: str
    state: str
    buildings: int = 0
    places: int = 0
    seconds: float = 0.0
    reason: str = ""
    flat: bool = False


Locate = Callable[[float, float, float], Path]
#: Called with each outcome as it comes, how many there are by now, and how many there will be.
Finished = Callable[[Outcome, int, int], None]


def build_many(
    rows: Sequence[PlaceRow],
    out: Path | Store,
    *,
    locate: Locate,
    workers: int = 1,
    force: bool = False,
    ray: str | None = None,
    finished: Finished | None = None,
) -> list[Outcome]:
    """Build every place into a folder of `out`; a world that is there and whole is kept, one that fails is told.

    Parameters
    ----------
    rows
        The places.
    out
        Parent folder of the worlds, or a store.
    locate
        Finds a map for a place without a file: latitude, longitude, half side to a path. A function of a module, as
        other processes must find it.
    workers
        How many processes side by side; with one, all is done in this process.
    force
        Build worlds anew that are there.
    ray
        Hand the places to a Ray cluster instead: its address, or ``auto``; see `vico.jobs.open_executor`.
    finished
        Told of each outcome as it comes, how many there are by now, and how many there will be.

    Returns
    -------
    list of Outcome
        In the order of the rows.

    Raises
    ------
    InputError
        If `workers` is no number of processes, or there is no such cluster.
    MissingExtraError
        If `ray` is asked for and not installed.
    """
    store = FolderStore(out) if isinstance(out, Path) else out
    outcomes: dict[int, Outcome] = {}

    def done(index: int, answer: Answer) -> None:
        name = rows[index].name
        content = answer.content or asdict(Outcome(name, "failed", reason=answer.reason))
        outcomes[index] = Outcome(**content)
        if finished is not None:
            finished(outcomes[index], len(outcomes), len(rows))

    if ray is None:
        workers = min(workers, max(1, len(rows)))
    options = {"out": str(store), "locate": f"{locate.__module__}:{locate.__qualname__}", "force": force}
    with open_executor(workers=workers, ray=ray) as executor, seen_by_all(store, executor) as seen:
        service = Service("vico.worldgen.many:builder", {**options, "seen": seen})
        executor.run(service, [Task(asdict(row)) for row in rows], done=done)
    return [outcomes[index] for index in range(len(rows))]


def builder(options: Mapping[str, Any], _: object) -> Callable[[Mapping[str, Any]], dict[str, Any]]:
    """Return what builds a place, of the fields of a `PlaceRow`, and returns the fields of an `Outcome`."""
    store = store_at(options["out"])
    check_seen(store, options["seen"])
    module, _, name = options["locate"].partition(":")
    locate: Locate = getattr(importlib.import_module(module), name)

    def build(content: Mapping[str, Any]) -> dict[str, Any]:
        return asdict(build_one(PlaceRow(**content), store=store, locate=locate, force=options["force"]))

    return build


def build_one(row: PlaceRow, *, store: Store, locate: Locate, force: bool) -> Outcome:
    """Build one place; bad input becomes an outcome, so that it does not end the others."""
    try:
        if not force and store.has(f"{row.name}/world.json"):
            return _kept(row, store)
        sources = Sources(
            osm=Path(row.osm) if row.osm else locate(row.lat, row.lon, row.radius),
            dem=tuple(Path(p) for p in row.dem.split(";") if p),
            tiles=row.tiles or None,
            photos=row.photos or None,
            places=tuple(p for p in row.places.split(";") if p),
            gtfs=tuple(Path(p) for p in row.gtfs.split(";") if p),
            layouts=Path(row.layouts) if row.layouts else None,
            installed_things=row.things == "installed",
            buildings=tuple(p for p in row.buildings.split(";") if p),
            precedence=Path(row.precedence) if row.precedence else None,
        )
        with store.new_folder(row.name, last="world.json") as folder:
            build_world(
                sources,
                lat=row.lat,
                lon=row.lon,
                half=row.radius,
                seed=row.seed,
                out=folder,
                force=force,
            )
            world = read_world(folder)
            counts, seconds = world.manifest.counts, sum(stage_seconds(world).values())
    except (VicoError, OSError) as error:
        return Outcome(row.name, "failed", reason=str(error))
    flat = world.manifest.is_flat
    return Outcome(row.name, "built", counts["buildings"], counts["places"], round(seconds, 2), flat=flat)


def _kept(row: PlaceRow, store: Store) -> Outcome:
    """Return the outcome of a world that is there."""
    there = store.folder / row.name if isinstance(store, FolderStore) else fetch_manifest(f"{store}/{row.name}")
    counts = read_world(there).manifest.counts
    return Outcome(row.name, "kept", counts["buildings"], counts["places"])
