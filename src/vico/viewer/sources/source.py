"""A run as the viewer's server tells of it: head, moments, events, metrics, cast, signals, relations, and search.

What traffic signals show follows from the time of day. Relations are those of the run's community.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from vico.community.folder import read_community
from vico.errors import InputError, MissingFileError, VicoError
from vico.io.files import read_json
from vico.rules import ActionStatus, code_name
from vico.runner.recording import bookmarks_of
from vico.sim.animation.motions import CLIPS
from vico.sim.bodies.arrays import KINDS
from vico.sim.bodies.state_arrays import Posture
from vico.sim.environment import weather_kinds
from vico.sim.environment.city_events import event_kinds
from vico.sim.environment.environment import Sky
from vico.sim.recording.interventions import read_interventions
from vico.sim.recording.manifest import CastMember, read_manifest
from vico.sim.recording.schema import AGENTS, TABLES
from vico.sim.state.base import SimulationBase
from vico.sim.traffic import JunctionRule, TrafficNetwork
from vico.sim.traffic.signals import SignalClock, SignalDay, SignalHeads
from vico.sim.traffic.state import AMBER, GREEN, RED
from vico.viewer.sources.frames import Frame, Skylight, frames_between
from vico.viewer.sources.tables import Columns, RecordedTables, StepTables, Timeline
from vico.world.folder import is_world, read_world
from vico.world.heights import HeightField
from vico.world.world import World

_LETTERS = {GREEN: "g", AMBER: "a", RED: "r"}


def signals_of(world: World, junctions: str, seed: int) -> dict[str, Any]:
    """Return what ``/api/signals`` tells; no heads where the run's traffic obeys no signals.

    Parameters
    ----------
    junctions, seed
        As in the run's `vico.sim.config.SimConfig`.
    """
    dark = [name for name, kind in event_kinds().items() if kind.dark]
    found: dict[str, Any] = {"cycles": [], "heads": []}
    if JunctionRule(junctions).has_signals and len(world.lanes):
        found = heads_on(SimulationBase.of(world).streets, world.height, seed)
    return found | {"dark_events": dark}


def heads_on(streets: TrafficNetwork, height: HeightField, seed: int) -> dict[str, Any]:
    """Return the heads of all signals, and the cycles of what they show."""
    clock = SignalClock(streets.lanes, streets.walks, seed)
    placed = SignalHeads(streets.lanes, streets.walks, streets.poles, height).placed
    days: list[tuple[str, SignalDay | None]] = [("signal", clock.day_of_lane(lane)) for lane in placed.lane.tolist()]
    days += [("walk", clock.day_of_walkway(way)) for way in placed.walkway.tolist()]
    days += [("signal_post", None)] * (len(placed.transforms) - len(days))
    cycles: dict[str, int] = {}
    heads = []
    for (kind, day), transform in zip(days, placed.transforms.astype(np.float64), strict=True):
        head: dict[str, Any] = {"kind": kind, "at": np.round(transform[:3, 3], 3).tolist()}
        head["yaw"] = round(math.atan2(transform[1, 0], transform[0, 0]), 4)
        head["scale"] = round(float(transform[2, 2]), 4)
        if day is not None:
            text = "".join(_LETTERS.get(light, "-") for light in day.light.tolist())
            head["cycle"] = cycles.setdefault(text, len(cycles))
            head["junction"] = [round(value, 2) for value in day.position]
        heads.append(head)
    return {"cycles": list(cycles), "heads": heads}


def relations_of(path: Path, manifest: Mapping[str, Any]) -> dict[str, list[dict[str, Any]]]:
    """Return whom each resident knows, the nearest first, by the resident's id; empty where the community is gone.

    Each entry has ``name``, ``kind``, ``note`` and ``strength`` as `vico.community.model.Relation` describes them.
    """
    told = (manifest.get("community") or {}).get("path")
    if not told:
        return {}
    try:
        community = read_community(Path(os.path.normpath(path / told)))
    except (VicoError, OSError):
        # A recording is shown without its community as well.
        return {}
    names = {resident.id: resident.name for resident in community.residents}
    found: dict[str, list[dict[str, Any]]] = {}
    for relation in sorted(community.relations, key=lambda r: -r.strength):
        for one, other in (relation.between, relation.between[::-1]):
            entry = {"name": names.get(other, other), "kind": str(relation.kind.value), "note": relation.note}
            found.setdefault(one, []).append(entry | {"strength": relation.strength})
    return found


PROTOCOL = 1

_POSTURES = [posture.name.lower() for posture in Posture]
_STATUSES = [status.name.lower() for status in ActionStatus]
# Steps in which events are looked for at once, and how many in all.
_SEARCHED, _SEARCHED_IN_ALL = 600, 36_000


class Source:
    """A run, recorded or going on.

    Parameters
    ----------
    path
        Its folder.
    tables
        Its steps.
    world
        Where it happens; None where that is not there any more.
    live
        Whether it goes on in this process.
    """

    def __init__(self, path: Path, tables: StepTables, world: World | None, *, live: bool) -> None:
        self.path, self.tables, self.world, self.live = path, tables, world, live
        self.agents: list[dict[str, Any]] = read_json(path / AGENTS)["agents"]
        self.manifest = read_manifest(path)
        self.names = {agent["entity"]: agent["name"] for agent in self.agents}
        self.timeline = Timeline(tables)
        self.skylight = Skylight(_sky_of_run(world, self.manifest["config"]))
        #: Gives the plans that agents publish now; only a run that goes on has any.
        self.plans: Callable[[Sequence[str]], Mapping[str, Any]] = lambda names: {}

    @classmethod
    def of_run(cls, path: Path, *, world: Path | None = None) -> Source:
        """Return the source of a run folder.

        Parameters
        ----------
        world
            Folder of the world, where it is no longer where the run says.

        Raises
        ------
        MissingFileError, SchemaError, EmptyInputError
            If it is no run, is damaged or empty, or a world that was named is not there.
        """
        from vico.sim.recording import read_run

        run = read_run(path)
        folder = world or run.source("world")
        there = is_world(folder)
        if world is not None and not there:
            raise MissingFileError(f"{world}: holds no world; give its folder with --world")
        return cls(path, RecordedTables(run), read_world(folder) if there else None, live=False)

    @property
    def last(self) -> int:
        """The newest step."""
        return self.tables.last

    def refresh(self) -> bool:
        """Look for what was recorded meanwhile; return whether there is more."""
        grown = isinstance(self.tables, RecordedTables) and self.tables.refresh()
        self.manifest = read_manifest(self.path)
        return grown

    def frames(self, first: int, last: int, every: int = 1) -> Iterator[Frame]:
        """Yield the frames of some steps; see `frames_between`."""
        return frames_between(self.tables, self.skylight, first, last, every)

    def head(self) -> dict[str, Any]:
        """Return what ``/api/run`` tells of the run, but for control and play."""
        manifest, config = self.manifest, self.manifest["config"]
        return {
            "protocol": PROTOCOL,
            "run": {
                "path": str(self.path),
                "name": self.path.name,
                "identity": manifest["identity"],
                "seed": manifest["seed"],
                "status": manifest["status"],
                "wanted_steps": manifest["wanted_steps"],
                "first": 0,
                "last": self.last,
                "start": manifest["start"],
                "date": config["date"],
                "utc_offset": None if self.skylight.over is None else self.skylight.over.utc_offset,
                "branch_of": manifest.get("branch_of"),
            },
            "live": self.live,
            "pieces": self.timeline.pieces(),
            "world": None if self.world is None else _world_record(self.world),
            "agents": [self._agent(agent) for agent in self.agents],
            "clips": list(CLIPS),
            "kinds": list(KINDS),
            "postures": _POSTURES,
            "statuses": _STATUSES,
            "weather_kinds": list(weather_kinds()),
            "event_kinds": list(event_kinds()),
            "outputs": list(config["outputs"]),
            "bookmarks": bookmarks_of(self.path),
            "interventions": [line.model_dump(mode="json") for line in read_interventions(self.path)],
        }

    def cast(self, since: int | None = None) -> dict[str, Any]:
        """Return what ``/api/cast`` tells."""
        cast = self.tables.cast().values()
        told = [
            asdict(m) | {"size": list(m.size), "intervals": [list(interval) for interval in m.intervals]}
            for m in cast
            if since is None or _changed_since(m, since)
        ]
        return {"step": self.last, "cast": told}

    def moment(self, step: int, agent: str = "") -> dict[str, Any]:
        """Return what ``/api/moment`` tells of a step.

        Raises
        ------
        InputError
            If the step is not there, or nobody is called so.
        """
        wanted = [a for a in self.agents if not agent or a["name"] == agent]
        if not wanted:
            raise InputError(f"nobody is called {agent!r}")
        head = self.tables.rows_between("steps", step, step)
        if not len(head["step"]):
            raise InputError(f"step {step} is not there")
        events = self.events(step, step)["events"]
        rows = _rows(self.tables.rows_between("agents", step, step), "agents")
        motions = {row["entity"]: row for row in _rows(self.tables.rows_between("people", step, step), "people")}
        joints = self.tables.rows_between("joints", step, step)
        names = [a["name"] for a in wanted]
        plans = self.plans(names) if step == self.last else {}
        about = {row["entity"]: row for row in rows}
        found = {
            a["name"]: self._agent_state(about[a["entity"]], motions.get(a["entity"]), joints, events)
            | {"plan": plans.get(a["name"])}
            for a in wanted
            if a["entity"] in about
        }
        counts = {key: int(head[key][0]) for key in ("collisions", "refused", "arrivals", "late")}
        moment = {"step": step, "time": float(head["time"][0]), "hash": str(head["hash"][0])}
        return moment | {"agents": found, "counts": counts, "events": events}

    def events(self, first: int, last: int, limit: int = 1000) -> dict[str, Any]:
        """Return what ``/api/events`` tells of some steps."""
        table = self.tables.rows_between("events", first, last)
        rows = _rows({key: values[:limit] for key, values in table.items()}, "events")
        for row in rows:
            row["data"] = json.loads(row["data"])
        return {"events": rows, "more": len(table["step"]) > limit}

    @cached_property
    def signals(self) -> dict[str, Any]:
        """What ``/api/signals`` tells."""
        if self.world is None:
            return {"cycles": [], "heads": [], "dark_events": []}
        return signals_of(self.world, self.manifest["config"]["junctions"], self.manifest["seed"])

    def metrics(self, first: int, last: int, points: int = 500) -> dict[str, Any]:
        """Return what ``/api/metrics`` tells."""
        return self.timeline.metrics(first, last, points)

    def search(self, text: str, limit: int = 20) -> dict[str, Any]:
        """Return what ``/api/search`` finds: people, places, bodies, then what was said and what happened."""
        wanted = text.strip().casefold()
        hits: list[dict[str, Any]] = []
        if wanted:
            for hit in self._findable():
                if wanted in hit["name"].casefold() or wanted in hit["text"].casefold():
                    hits.append(hit)
                if len(hits) >= limit:
                    return {"hits": hits}
            hits += self._events_with(wanted, limit - len(hits))
        return {"hits": hits}

    def _findable(self) -> Iterator[dict[str, Any]]:
        for agent in self.agents:
            person = agent["person"] or {}
            text = f"{person['name']}, {person['occupation']}" if person else agent["kind"]
            yield _hit("agent", agent["name"], text, entity=agent["entity"])
        for place in [] if self.world is None else self.world.places:
            yield _hit("place", place.id, place.name or place.kind, position=list(place.position))
        for member in self.tables.cast().values():
            if member.agent is None:
                yield _hit("body", member.name, member.model or member.kind, entity=member.entity)

    def _events_with(self, wanted: str, limit: int) -> list[dict[str, Any]]:
        """Return the newest events whose text holds some words."""
        found: list[dict[str, Any]] = []
        entities = {name: entity for entity, name in self.names.items()}
        end, oldest = self.last, max(self.last - _SEARCHED_IN_ALL, 0)
        while end >= oldest and len(found) < limit:
            first = max(end - _SEARCHED + 1, 0)
            for row in reversed(_rows(self.tables.rows_between("events", first, end), "events")):
                if row["kind"] not in ("refused", "collision") and wanted in row["text"].casefold():
                    place = [row["x"], row["y"], row["z"]]
                    entity = entities.get(row["agent"])
                    found.append(_hit("event", row["agent"], row["text"], entity, row["step"], place))
            end = first - 1
        return found[:limit]

    @cached_property
    def _relations(self) -> dict[str, list[dict[str, Any]]]:
        return relations_of(self.path, self.manifest)

    def _agent(self, agent: Mapping[str, Any]) -> dict[str, Any]:
        config, name = self.manifest["config"], agent["name"]
        observe = config["observe"]
        told = dict(agent) | {"sees": observe is None or name in observe, "period": self._period(agent)}
        if agent["kind"] == "robot":
            told["model"] = config["robots"][int(name.removeprefix("robot_"))]
        if agent.get("resident") in self._relations:
            told["relations"] = self._relations[agent["resident"]]
        return told

    def _period(self, agent: Mapping[str, Any]) -> float | None:
        """Return the seconds between what an agent does; None where its model alone knows."""
        periods = self.manifest["config"]["periods"]
        usual = periods.get("robots", 1.0) if agent["kind"] == "robot" else 1.0
        period = periods.get(agent["name"], usual)
        return float(period) if isinstance(period, int | float) else None

    def _agent_state(
        self, row: dict[str, Any], motion: dict[str, Any] | None, joints: Columns, events: Sequence[dict[str, Any]]
    ) -> dict[str, Any]:
        name, mine = self.names[row["entity"]], joints["entity"] == row["entity"]
        cast = self.tables.cast()
        touched = [e["data"].get("entity", 0) for e in events if e["kind"] == "collision" and e["agent"] == name]
        return {
            "action": None if row["action"] is None else json.loads(row["action"]),
            "status": _STATUSES[row["status"]],
            "code": code_name(row["code"]),
            "reason": row["reason"],
            "posture": _POSTURES[row["posture"]],
            "room": row["room"],
            "place": row["place"],
            "vehicle": _entity(row["vehicle"], cast),
            "held": [_entity(row["held_left"], cast), _entity(row["held_right"], cast)],
            "cash": round(row["cash"], 2),
            "clip": "" if motion is None else CLIPS[motion["clip"]],
            "joints": [round(float(a), 4) for a in joints["angle"][mine] * TABLES["joints"]["angle"].unit],
            "contacts": [_entity(entity, cast) for entity in touched if entity > 0],
        }


def _sky_of_run(world: World | None, config: Mapping[str, Any]) -> Sky | None:
    if world is None:
        return None
    origin = world.manifest.origin
    return Sky.over(origin.lat, origin.lon, config["date"], config["utc_offset"])


def _world_record(world: World) -> dict[str, Any]:
    manifest = world.manifest
    places = {place.id: index for index, place in enumerate(world.places)}
    return {
        "name": manifest.name,
        "lat": manifest.origin.lat,
        "lon": manifest.origin.lon,
        "radius": manifest.half,
        "digest": world.digest,
        "places": [
            dict(zip(("x", "y", "z"), place.position, strict=True))
            | {"index": index, "id": place.id, "name": place.name, "kind": place.kind}
            for index, place in enumerate(world.places)
        ],
        "rooms": [
            {
                "index": index,
                "name": room.id,
                "kind": room.kind,
                "place": places.get(room.place, -1),
                "centre": list(room.centre),
                "size": list(room.size),
                "yaw": room.yaw,
            }
            for index, room in enumerate(world.rooms)
        ],
    }


def _changed_since(member: CastMember, since: int) -> bool:
    """Whether a body came or went after a step."""
    first, until = member.intervals[-1]
    return first > since or (until is not None and until > since)


def _entity(entity: int, cast: Mapping[int, CastMember]) -> dict[str, Any] | None:
    if entity <= 0:
        return None
    return {"entity": entity, "name": cast[entity].name if entity in cast else str(entity)}


def _rows(columns: Columns, table: str) -> list[dict[str, Any]]:
    """Return rows as dicts of plain values, in quantities."""
    values = {}
    for key, column in TABLES[table].items():
        if column.unit:
            values[key] = [round(value, 4) for value in (columns[key] * column.unit).tolist()]
        else:
            values[key] = np.asarray(columns[key]).tolist()
    return [dict(zip(values, row, strict=True)) for row in zip(*values.values(), strict=True)]


def _hit(
    what: str,
    name: str,
    text: str,
    entity: int | None = None,
    step: int | None = None,
    position: Sequence[float] | None = None,
) -> dict[str, Any]:
    return {"what": what, "name": name, "text": text, "entity": entity, "step": step, "position": position}
