"""Samples that a recording takes from a simulation at a step, as rows of the tables.

Actions are kept as text: whatever an agent handed in, good or not, in a bounded line of JSON.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from vico.sim.bodies.arrays import OBJECT, Bodies
from vico.sim.environment.weather import NAMES as WEATHER
from vico.sim.people.placement import habit_of
from vico.sim.pictures.hands import hands_of_pedestrians
from vico.sim.pictures.people import looks_of_strangers, manner_of_pedestrian, pedestrian_motion
from vico.sim.recording.schema import TABLES, table_of, to_stored
from vico.sim.state.steps import Event

if TYPE_CHECKING:
    from vico.sim.loop.simulation import Simulation, StepResult
    from vico.sim.traffic import Traffic
#: An action whose JSON is longer is cut to its type, and says how long it was.
LONGEST_ACTION = 8192
_DEEPEST = 6
_STRICT = json.JSONEncoder(ensure_ascii=False, allow_nan=False)
_LONGEST_TEXT, _LONGEST_LIST = 2048, 512


def action_text(action: object) -> str:
    """Return an action as JSON: what JSON does not know is told in words, what is too large is cut."""
    try:
        # Most actions are small mappings of plain values: one call writes them.
        text = _STRICT.encode(action)
    except (TypeError, ValueError, RecursionError):
        text = json.dumps(_plain(action, 0), ensure_ascii=False)
    if len(text) <= LONGEST_ACTION:
        # Halves of surrogate pairs, which no file can hold, become question marks.
        return text.encode("utf-8", "replace").decode()
    kind = action.get("type") if isinstance(action, dict) else None
    return json.dumps({"type": kind if isinstance(kind, str) and len(kind) < 80 else None, "characters": len(text)})


def _plain(value: object, depth: int) -> Any:
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, np.ndarray) and value.size <= _LONGEST_LIST:
        value = value.tolist()
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, int):
        return value if abs(value) < 2**63 else "a whole number beyond 64 bits"
    if isinstance(value, float):
        return value if math.isfinite(value) else str(value)
    if isinstance(value, str):
        return value[:_LONGEST_TEXT]
    if isinstance(value, dict) and depth < _DEEPEST and len(value) <= _LONGEST_LIST:
        keys = [key[:80] if isinstance(key, str) else f"<{type(key).__name__}>" for key in value]
        return {key: _plain(item, depth + 1) for key, item in zip(keys, value.values(), strict=True)}
    if isinstance(value, list | tuple) and depth < _DEEPEST and len(value) <= _LONGEST_LIST:
        return [_plain(item, depth + 1) for item in value]
    # Not its repr: that is the agent's own code.
    return f"<{type(value).__name__}>"


Rows = Mapping[str, Any]
_SORTED = json.JSONEncoder(sort_keys=True)


class StepSamples:
    """Rows of the tables that wait to be written.

    Parameters
    ----------
    sim
        The simulation they are taken from.

    Attributes
    ----------
    steps
        Those that were taken and wait.
    latest
        Rows of the step that was taken last, by table, in quantities, not sorted; nobody may change them.
    """

    def __init__(self, sim: Simulation) -> None:
        self._sim = sim
        state = sim.state
        strangers = len(state.people) - len(sim.residents)
        pedestrians = len(state.traffic.walkers) if state.traffic is not None else 0
        looks = looks_of_strangers(sim.config.seed, strangers + pedestrians)[strangers:]
        self._stature = np.array([look.height for look in looks], np.float64)
        manners = [manner_of_pedestrian(k) for k in range(pedestrians)]
        self._habit = np.array([habit_of(sim.config.seed, manner) for manner in manners], np.float64)
        self.latest: dict[str, Rows] = {}
        self._begin()

    def _begin(self) -> None:
        self._rows: dict[str, list[Rows]] = {name: [] for name in TABLES}
        self.steps: list[int] = []

    def __len__(self) -> int:
        return len(self.steps)

    def take(self, bodies: Bodies, digest: str, result: StepResult | None, actions: Mapping[str, Any]) -> None:
        """Take what is to be told of a step.

        Parameters
        ----------
        bodies
            Of `everybody`.
        digest
            Hash of the state.
        result
            Of the step that led here; None before the first.
        actions
            What agents asked for in it, by name.
        """
        sim, step = self._sim, self._sim.metrics.steps
        self.steps.append(step)
        self.latest = {}
        self._add(
            "steps",
            {
                "step": [step],
                "hash": [digest],
                "time": [sim.state.second],
                "collisions": [sim.metrics.collisions],
                "refused": [sim.metrics.refused],
                "arrivals": [int(sim.punctuality.arrivals.sum())],
                "late": [int(sim.punctuality.late.sum())],
            },
        )
        self._add("weather", _weather(step, sim))
        self._add("bodies", _bodies(step, bodies, sim.state.traffic))
        self._add("people", self._people(step))
        leaves = sim.state.leaves
        self._add("doors", {"entrance": leaves.entrance, "step": np.full(len(leaves), step), "share": leaves.share})
        self._add("agents", _agents(step, sim, actions))
        if sim.state.robots is not None:
            robots, joints = _robots(step, sim)
            self._add("robots", robots)
            self._add("joints", joints)
        if result is not None and result.events:
            self._add("events", _events(step, result.events))

    def tables(self) -> dict[str, pa.Table]:
        """Return all rows as tables, and wait for others."""
        tables: dict[str, pa.Table] = {}
        for name, parts in self._rows.items():
            columns: dict[str, Any] = {}
            for key, column in TABLES[name].items():
                pieces = [part[key] for part in parts]
                if column.kind == pa.string():
                    columns[key] = [value for piece in pieces for value in piece]
                else:
                    columns[key] = to_stored(np.concatenate([np.zeros(0), *pieces]), column)
            tables[name] = table_of(name, columns)
        self._begin()
        return tables

    def _people(self, step: int) -> Rows:
        """Return the motion of everybody who has legs."""
        state, p = self._sim.state, self._sim.state.people
        before = p.clip_before, p.phase_before, p.pace_before, p.clip_time
        parts: list[tuple[NDArray[Any], ...]] = [(p.entity, p.clip, p.phase, p.pace, *before, p.hold, p.hold_share)]
        if state.traffic is not None:
            gait, walkers = state.traffic.gait, state.traffic.walkers
            motion = pedestrian_motion(gait, self._stature, state.second)
            placard = state.traffic.gatherings.placards(walkers.position)
            hands = hands_of_pedestrians(self._habit, state.environment.weather.rain, placard, gait.afoot)
            hold = np.where(hands.share > 0.0, hands.hold, 0)
            parts.append((walkers.entity, *motion[:-1], *motion.after[:4], hold, hands.share))
        names = (
            "entity", "clip", "phase", "pace", "clip_before", "phase_before", "pace_before", "clip_time", "hold",
            "hold_share",
        )  # fmt: skip
        rows = {name: np.concatenate(column) for name, column in zip(names, zip(*parts, strict=True), strict=True)}
        return rows | {"step": np.full(len(rows["entity"]), step)}

    def _add(self, name: str, rows: Rows) -> None:
        # Copies, for the state's arrays go on changing; they are scaled all at once when they are written.
        kept = {key: np.array(values) if isinstance(values, np.ndarray) else values for key, values in rows.items()}
        self._rows[name].append(kept)
        self.latest[name] = kept


def everybody(sim: Simulation) -> Bodies:
    """Return all bodies of a run, indoors and outdoors, movable objects among them."""
    state = sim.state
    people = state.people.bodies_of(np.arange(len(state.people)))
    owners = [s.bodies() for s in (state.robots, state.traffic, state.transit) if s is not None]
    if state.traffic is not None:
        owners.append(state.traffic.passengers)
    owners.append(state.things.bodies())
    objects = state.objects
    n = len(objects)
    movable = Bodies(
        objects.entity,
        np.full(n, OBJECT, np.int8),
        objects.position,
        objects.yaw,
        objects.size[:, 0] / 2,
        objects.size[:, 1] / 2,
        objects.size[:, 2],
        np.zeros((n, 2)),
    )
    return Bodies.joined([people, *owners, movable])


def _weather(step: int, sim: Simulation) -> Rows:
    sky = sim.state.environment
    weather = sky.weather
    now = {name: [getattr(weather, name)] for name in WEATHER}
    return now | {
        "step": [step],
        "wet": [sky.wet],
        "snow_cover": [sky.snow_cover],
        "ice": [sky.ice],
        "lamps": [sky.lamps],
    }


def _bodies(step: int, bodies: Bodies, traffic: Traffic | None) -> Rows:
    lights = np.zeros(len(bodies), np.uint8)
    if traffic is not None and len(traffic.lights):
        vehicles = traffic.bodies().entity[: len(traffic.lights)]
        # They are there in their own order.
        lights[np.isin(bodies.entity, vehicles)] = traffic.lights
    return {
        "entity": bodies.entity,
        "step": np.full(len(bodies), step),
        "x": bodies.position[:, 0],
        "y": bodies.position[:, 1],
        "z": bodies.position[:, 2],
        "yaw": (bodies.yaw + np.pi) % (2 * np.pi) - np.pi,
        "speed": np.hypot(bodies.velocity[:, 0], bodies.velocity[:, 1]),
        "lights": lights,
    }


def _agents(step: int, sim: Simulation, actions: Mapping[str, Any]) -> Rows:
    state, p, robots = sim.state, sim.state.people, sim.state.robots
    names = state.names
    rows: dict[str, Any] = {
        "entity": p.entity,
        "step": np.full(len(p), step),
        "status": p.status,
        "code": p.reason_code,
        "reason": p.reason,
        "pitch": p.pitch,
        "posture": p.posture,
        "room": p.room,
        "place": p.place,
        "vehicle": p.vehicle_entity,
        "held_left": p.held[:, 0],
        "held_right": p.held[:, 1],
        "cash": p.cash,
    }
    if robots is not None:
        own = {
            "entity": robots.bodies().entity,
            "status": robots.action_status,
            "code": robots.reason_code,
            "reason": robots.reason,
        }
        n = len(robots.names)
        # A robot has no posture, pocket or hand.
        rest = {key: np.zeros(n) for key in rows} | {"step": np.full(n, step)}
        rest |= {"room": robots.rooms, "place": np.append(state.indoor.place, -1)[robots.rooms]}
        rows = {key: np.concatenate([values, own.get(key, rest[key])]) for key, values in rows.items()}
    rows["reason"] = rows["reason"].tolist()
    return rows | {"action": [action_text(actions[name]) if name in actions else None for name in names]}


def _robots(step: int, sim: Simulation) -> tuple[Rows, Rows]:
    robots = sim.state.robots
    assert robots is not None
    entity = robots.bodies().entity
    pose, angles = robots.base_poses(), robots.joint_positions()
    counts = [len(a) for a in angles]
    keys = ("x", "y", "z", "qw", "qx", "qy", "qz")
    bases = {"entity": entity, "step": np.full(len(entity), step)} | {key: pose[:, k] for k, key in enumerate(keys)}
    joints = {
        "entity": np.repeat(entity, counts),
        "joint": np.concatenate([np.arange(n) for n in counts]),
        "step": np.full(sum(counts), step),
        "angle": np.concatenate(angles),
    }
    return bases, joints


def _events(step: int, events: Sequence[Event]) -> Rows:
    position = np.array([event.position for event in events], np.float64)
    return {
        "step": np.full(len(events), step),
        "time": [event.time for event in events],
        "kind": [event.kind for event in events],
        "agent": [event.agent for event in events],
        "text": [event.text.encode("utf-8", "replace").decode() for event in events],
        "x": position[:, 0],
        "y": position[:, 1],
        "z": position[:, 2],
        "data": [_SORTED.encode(event.data) for event in events],
    }
