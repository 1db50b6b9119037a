"""Interventions in a run from outside, before its first step and later: data that decides it, like its seed.

::

    setup.json           calls of `vico.sim.loop.scenario.Scenario` before the first step, in order
    setup.glb            shapes of the objects that were added, a node a prototype
    interventions.jsonl  a line for each later intervention: after which step it was done, and what

None is there where nothing was done. A run with the same version, configuration, seed and lines has the same states.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, TypeAdapter, ValidationError

from vico.errors import InputError, SchemaError
from vico.geometry import distances
from vico.io.files import read_json, write_bytes, write_json
from vico.rules import EARSHOT, LONGEST_TEXT
from vico.sim.loop.scenario import AddedObject, GivenCash, HandedObject, PlacedAgent, Scenario
from vico.sim.recording.schema import INTERVENTIONS, SETUP, SETUP_SHAPES
from vico.world.glb import read_glb, write_glb
from vico.world.model import Record

if TYPE_CHECKING:
    from vico.sim.loop.simulation import Simulation
INTERVENTIONS_FILE = INTERVENTIONS

Action = dict[str, Any]
_Name = Annotated[str, Field(min_length=1, max_length=200)]
_Finite = Annotated[float, Field(allow_inf_nan=False, ge=-1e6, le=1e6)]
_Point = tuple[_Finite, _Finite]
_Point3 = tuple[_Finite, _Finite, _Finite]
_Radius = Annotated[float, Field(gt=0, le=2000)]
_Minutes = Annotated[float, Field(gt=0, le=100_000)]


class ChangeWeather(Record):
    """Let the weather become another kind over some seconds."""

    command: Literal["weather"] = "weather"
    kind: _Name
    over: Annotated[float, Field(ge=0, le=86_400)] = 300.0


class CloseRoad(Record):
    """Close a street, or the part of the nearest street around a point, to cars."""

    command: Literal["close_road"] = "close_road"
    street: str = Field(default="", max_length=200)
    position: _Point | None = None
    radius: _Radius = 15.0
    minutes: _Minutes = 60.0


class StartEvent(Record):
    """Start an event of the city (docs/events.md)."""

    command: Literal["event"] = "event"
    kind: _Name
    place: str = Field(default="", max_length=200)
    street: str = Field(default="", max_length=200)
    position: _Point | None = None
    radius: _Radius | None = None
    minutes: _Minutes = 60.0
    name: str = Field(default="", max_length=200)


class EndEvent(Record):
    """Let an event of the city be over."""

    command: Literal["end_event"] = "end_event"
    event: int


class DropThing(Record):
    """Lay a movable thing down: ``red bag``, a colour and a kind."""

    command: Literal["drop"] = "drop"
    kind: _Name
    position: _Point3


class Say(Record):
    """Say something to an agent: an agent's words, or a voice beside it."""

    command: Literal["say"] = "say"
    agent: _Name
    text: Annotated[str, Field(min_length=1, max_length=LONGEST_TEXT)]
    speaker: str = Field(default="", max_length=200, alias="from")


class SetGoal(Record):
    """Send a robot somewhere."""

    command: Literal["goal"] = "goal"
    agent: _Name
    position: _Point3 | None = None
    place: str = Field(default="", max_length=200)


class Perform(Record):
    """Have an agent do something in the next step, in place of what it would do."""

    command: Literal["perform"] = "perform"
    agent: _Name
    action: dict[str, Any]


Intervention = ChangeWeather | CloseRoad | StartEvent | EndEvent | DropThing | Say | SetGoal | Perform
_ANY: TypeAdapter[Intervention] = TypeAdapter(Annotated[Intervention, Field(discriminator="command")])
#: Names of what can be done.
COMMANDS = ("weather", "close_road", "event", "end_event", "drop", "say", "goal", "perform")


class InterventionLine(Record):
    """A line of the file.

    Attributes
    ----------
    after
        Step after which it was done, before anybody acts in the next.
    """

    after: Annotated[int, Field(ge=0)]
    command: str
    arguments: dict[str, Any] = Field(default_factory=dict)

    @property
    def intervention(self) -> Intervention:
        """What was done."""
        return intervention_of(self.command, self.arguments)


def intervention_of(command: str, arguments: Mapping[str, Any]) -> Intervention:
    """Return what a command with its arguments asks for.

    Raises
    ------
    InputError
        If there is no such command, or an argument is not as it has to be.
    """
    if command not in COMMANDS:
        raise InputError(f"{command!r} is no command; there are {', '.join(COMMANDS)}")
    try:
        return _ANY.validate_python({**arguments, "command": command})
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"][1:]) or "arguments"
        raise InputError(f"{command}: {where}: {first['msg']}") from None


def intervene(sim: Simulation, wanted: Intervention) -> tuple[dict[str, Any], dict[str, Action]]:
    """Do something to a simulation between two steps.

    Returns
    -------
    tuple
        What to tell of it; and actions that agents do in the next step in place of their own, by name.

    Raises
    ------
    InputError
        If it cannot be done; nothing was changed then.
    """
    environment = sim.state.environment
    match wanted:
        case ChangeWeather(kind=kind, over=over):
            environment.change_weather(kind, over=over)
        case CloseRoad():
            return {"event": _close_road(sim, wanted)}, {}
        case StartEvent():
            return {"event": _start_event(sim, wanted)}, {}
        case EndEvent(event=number):
            environment.end_event(number)
        case DropThing(kind=kind, position=position):
            return {"entity": _drop(sim, kind, position)}, {}
        case Say():
            return {}, _say(sim, wanted)
        case SetGoal():
            return {}, _set_goal(sim, wanted)
        case Perform(agent=agent, action=action):
            _index(sim, agent)
            return {}, {agent: action}
    return {}, {}


def things_to_drop() -> list[str]:
    """Return what can be dropped: colours and kinds."""
    from vico.assets.models.movable import movable_colours, movable_kinds

    return [f"{colour} {kind}" for kind in movable_kinds() for colour in movable_colours()]


def read_interventions(path: Path) -> list[InterventionLine]:
    """Return the lines of a file of interventions, or of a run folder's; none where it has none.

    Raises
    ------
    SchemaError
        If a line is not as it has to be.
    """
    file = path / INTERVENTIONS_FILE if path.is_dir() else path
    if not file.exists() and path.is_dir():
        return []
    found = []
    for number, text in enumerate(file.read_bytes().split(b"\n")[:-1], 1):
        try:
            line = InterventionLine.model_validate_json(text)
            line.intervention  # noqa: B018 -- whether it is one
        except (ValidationError, InputError) as error:
            said = error.errors()[0]["msg"] if isinstance(error, ValidationError) else str(error)
            raise SchemaError(f"{file}: line {number}: {said}") from None
        found.append(line)
    if any(a.after > b.after for a, b in pairwise(found)):
        raise SchemaError(f"{file}: its lines are not in the order of their steps")
    return found


def append_intervention(run: Path, line: InterventionLine) -> None:
    """Add a line to the file of a run."""
    with (run / INTERVENTIONS_FILE).open("ab") as file:
        file.write(_json_line(line))


def write_interventions(run: Path, lines: Iterable[InterventionLine]) -> None:
    """Write the file of a run anew."""
    write_bytes(run / INTERVENTIONS_FILE, [_json_line(line) for line in lines])


def repeat_drops(sim: Simulation, lines: Sequence[InterventionLine]) -> None:
    """Have a fresh simulation hold the things that were dropped in one that is about to be restored into it."""
    for line in lines:
        wanted = line.intervention
        if isinstance(wanted, DropThing):
            _drop(sim, wanted.kind, wanted.position, anywhere=True)


def _json_line(line: InterventionLine) -> bytes:
    return json.dumps(line.model_dump(mode="json"), ensure_ascii=False, sort_keys=True).encode() + b"\n"


def _close_road(sim: Simulation, wanted: CloseRoad) -> int:
    street, region = wanted.street, None
    if wanted.position is not None:
        named, middle = _street_near(sim, wanted.position)
        street, region = street or named, (*(wanted.position if street else middle), wanted.radius)
    if not street:
        raise InputError("close_road: which one? give street or position")
    start = sim.state.environment.start_event
    return start("road_works", street=street, region=region, minutes=wanted.minutes)


def _start_event(sim: Simulation, wanted: StartEvent) -> int:
    from vico.sim.environment.city_events import kind_of_event

    region, kind = None, kind_of_event(wanted.kind)
    if wanted.position is not None:
        region = (*wanted.position, wanted.radius or kind.radius)
    street = wanted.street
    if region is not None and not street and "street" in kind.where and "region" not in kind.where:
        street, middle = _street_near(sim, (region[0], region[1]))
        region = (*middle, region[2])
    start = sim.state.environment.start_event
    return start(
        wanted.kind, place=wanted.place, street=street, region=region, minutes=wanted.minutes, name=wanted.name
    )


def _street_near(sim: Simulation, position: tuple[float, float]) -> tuple[str, tuple[float, float]]:
    """Return the id of the street nearest to a point, and the point of it that is nearest.

    Raises
    ------
    InputError
        If there is no street.
    """
    best, found = math.inf, None
    for road in sim.world.roads.roads:
        if road.closed or len(road.line) < 2:
            continue
        point = _nearest(np.asarray(road.line, np.float64)[:, :2], np.asarray(position, np.float64))
        away = math.hypot(point[0] - position[0], point[1] - position[1])
        if away < best:
            best, found = away, (road.id, point)
    if found is None:
        raise InputError("close_road: there is no street in this world")
    return found


def _nearest(line: NDArray[np.float64], point: NDArray[np.float64]) -> tuple[float, float]:
    """Return the point of a line that is nearest to another one."""
    a, b = line[:-1], line[1:]
    share = ((point - a) * (b - a)).sum(axis=1) / np.maximum(((b - a) ** 2).sum(axis=1), 1e-9)
    feet = a + np.clip(share, 0.0, 1.0)[:, None] * (b - a)
    x, y = feet[np.argmin(distances(feet, point))].tolist()
    return x, y


def _drop(sim: Simulation, kind: str, position: tuple[float, float, float], *, anywhere: bool = False) -> int:
    from vico.assets.models.movable import movable_colours, movable_kinds, movable_prototype, movable_surfaces

    colour, _, name = kind.partition(" ")
    if name not in movable_kinds() or colour not in movable_colours():
        raise InputError(f"drop: there is no {kind!r}; give a colour ({', '.join(movable_colours())}) and a thing")
    taken = set(sim.state.objects.names)
    called = next(text for k in range(len(taken) + 1) if (text := kind if not k else f"{kind} {k + 1}") not in taken)
    prototype, shape, size = movable_prototype(name, colour), movable_surfaces(name, colour), movable_kinds()[name].size
    if anywhere:
        # Where it lies is in the state that is restored.
        objects = sim.state.objects
        entity = objects.add(called, prototype, np.asarray(position), -1, np.asarray(size, np.float64), 0.0)
        sim.state.shapes[prototype] = list(shape)
        sim.state.entities[entity] = {"kind": "object", "name": called}
        return entity
    room = _room_at(sim, position)
    ground = position if room else (*position[:2], max(float(sim.world.height(position[:2])), position[2]))
    return sim.scenario.add_object(called, prototype, shape, ground, room=room, size=size)


def _room_at(sim: Simulation, position: tuple[float, float, float]) -> str:
    """Return the id of the room that a point is in; "" outdoors."""
    for room in sim.world.rooms:
        dx, dy, dz = (a - b for a, b in zip(position, room.centre, strict=True))
        c, s = math.cos(room.yaw), math.sin(room.yaw)
        inside = abs(c * dx + s * dy) <= room.size[0] / 2 and abs(c * dy - s * dx) <= room.size[1] / 2
        if inside and -0.3 <= dz <= room.size[2]:
            return room.id
    return ""


def _say(sim: Simulation, wanted: Say) -> dict[str, Action]:
    index = _index(sim, wanted.agent)
    if wanted.speaker:
        _index(sim, wanted.speaker)
        return {wanted.speaker: {"type": "communicate", "text": wanted.text, "range": EARSHOT}}
    people, robots = sim.state.people, sim.state.robots
    if index < len(people):
        position = people.position[index]
    else:
        assert robots is not None
        position = robots.bodies().position[index - len(people)]
    sim.state.events.say_later("a voice", wanted.text, position, [wanted.agent])
    return {}


def _set_goal(sim: Simulation, wanted: SetGoal) -> dict[str, Action]:
    index, robots = _index(sim, wanted.agent), sim.state.robots
    robot = index - len(sim.state.people)
    if robots is None or robot < 0:
        raise InputError(f"goal: {wanted.agent} is no robot; people choose where they go, talk to them instead")
    target = wanted.position
    if wanted.place:
        place = sim.world.place_by_id.get(wanted.place)
        named = place or next((p for p in sim.world.places if p.name == wanted.place), None)
        if named is None:
            raise InputError(f"goal: no place is called {wanted.place!r}")
        target = named.position
    if target is None:
        raise InputError("goal: where to? give position or place")
    kind = "fly_to" if robots.flies(robot) else "go_to"
    return {wanted.agent: {"type": kind, "target": list(target)}}


def _index(sim: Simulation, agent: str) -> int:
    if agent not in sim.agents:
        raise InputError(f"nobody is called {agent!r}")
    return sim.agents.index(agent)


_SCHEMA, _VERSION = "vico.setup", 1


class _Setup(Record):
    """``setup.json``."""

    schema_name: Literal["vico.setup"]
    version: Literal[1]
    calls: list[Annotated[AddedObject | HandedObject | PlacedAgent | GivenCash, Field(discriminator="call")]]


def write_setup(out: Path, sim: Simulation) -> None:
    """Keep what was done to a simulation so far; nothing is written if that is nothing.

    Parameters
    ----------
    out
        Run folder.
    """
    calls = sim.scenario.calls
    if not calls:
        return
    shown = {call.prototype for call in calls if isinstance(call, AddedObject | HandedObject)}
    if shown:
        write_glb(out / SETUP_SHAPES, {name: sim.shapes[name] for name in sorted(shown)})
    content = {"schema_name": _SCHEMA, "version": _VERSION, "calls": [call.model_dump(mode="json") for call in calls]}
    write_json(out / SETUP, content)


def repeat_setup(path: Path, scenario: Scenario) -> None:
    """Do to a fresh simulation what a run folder says was done to the recorded one.

    Parameters
    ----------
    path
        Run folder; one without `setup.json` says that nothing was done.

    Raises
    ------
    SchemaError
        If the files are damaged.
    InputError
        If something can't be done: it is another simulation than the recorded one.
    """
    if not (path / SETUP).exists():
        return
    try:
        calls = _Setup.model_validate(read_json(path / SETUP)).calls
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "the whole file"
        raise SchemaError(f"{path / SETUP}: {where}: {first['msg']}; record the run anew") from None
    shapes = read_glb(path / SETUP_SHAPES) if (path / SETUP_SHAPES).exists() else {}
    for call in calls:
        if isinstance(call, AddedObject | HandedObject) and call.prototype not in shapes:
            raise SchemaError(f"{path / SETUP_SHAPES}: has no shape {call.prototype!r}; record the run anew")
        scenario.repeat(call, shapes)
