"""Configuration of a run: a frozen record; change a copy with `dataclasses.replace`.

`find_by_name` finds agents, things and vehicles by what people call them: ``resident_3``, ``Ann Lee``, ``husky``.
"""

from __future__ import annotations

import math
import unicodedata
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from datetime import date as Date
from difflib import get_close_matches
from types import UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints

import numpy as np

from vico.clock import DAY
from vico.errors import InputError, some_of
from vico.render.cameras import Lens
from vico.render.frames import RenderQuality
from vico.render.viewers import RENDERERS, USUAL_OUTPUTS, check_outputs
from vico.sim.traffic.junctions import JunctionRule

__all__ = ["LIMITS", "NO_DAY", "PHYSICS_ENGINES", "SimConfig", "SimSettings", "check_types", "find_by_name"]
#: The day of runs whose world is without a community: midsummer, with light from early on.
NO_DAY = Date(2026, 6, 21)

#: As `vico.sim.physics.engine` has them, which is slow to import.
PHYSICS_ENGINES = ("mujoco", "genesis")

#: How many of whom one run may have: placing them takes seconds at most then, and a second of them takes less than
#: about a second to compute (100 robots 0.6 s, 5,000 pedestrians 0.25 s). Residents are as many as a community has.
LIMITS = {"robots": 100, "assistants": 1_000, "cars": 2_000, "cyclists": 1_000, "pedestrians": 5_000}


@dataclass(frozen=True, kw_only=True)
class SimSettings:
    """Settings that a simulation's configuration and an environment's spec share: who and what is there.

    Attributes
    ----------
    seed
        Decides whatever is left to chance; in a spec, the first episode.
    residents
        How many of the community's residents take part, in the community's order; None for all.
    assistants
        How many avatars under test, without home or schedule.
    assistant_places
        Where assistants start, by name: x, y (ENU metres) and yaw (radians); the others start where the seed says.
    robots
        Model names, such as ``("husky", "go2")``; robot ``i`` is the agent ``robot_i``.
    physics
        Engine that moves them: ``"mujoco"``, or ``"genesis"`` (an extra, see docs/physics.md).
    robot_places
        Where robots start, by name: x, y (ENU metres) and yaw (radians); the others start where the seed says.
    errands
        Whether robots that nobody controls go from place to place.
    oracle_grasp
        Whether robots' hands never lose what they closed on; see docs/robot_challenge.md.
    cars, cyclists, pedestrians
        How many vehicles and people that nobody plays.
    junctions
        Who may be in a junction: ``"one"``, ``"shared"``, ``"signals"`` or ``"both"``
        (`vico.sim.traffic.junctions.JunctionRule`).
    traffic
        Cars and pedestrians placed by hand, beside those: ``"none"``, or the content of a file of traffic
        (docs/traffic.md).
    transit
        Whether buses, trams and bicycles are there.
    image
        Side of the square pictures, pixels, of those whose lenses `cameras` does not give.
    outputs
        What pictures show, some of `vico.render.viewers.OUTPUTS`: colour, depth and segmentation, also normals,
        optical flow and classes.
    cameras
        Lenses that are not the usual one: records of `vico.render.cameras.Lens` by agent's name, by model for
        robots, or for all ``"residents"``, ``"assistants"`` or ``"robots"``; the first of these that is there holds.
    worn
        Files (.glb) of heads and bodies that people wear, by agent's name; docs/adding_people.md.
    quality
        How carefully pictures are made: ``"plain"``, ``"fine"``, or switches of `vico.render.frames.RenderQuality`.
    renderer
        What makes pictures: ``"cpu"``, or ``"gl"`` for OpenGL (extra ``gl``); they agree but for rounding.
    memory
        Of cities: gigabytes that the scenes of all who look may take, or the least that one takes; others are made anew
        when somebody looks from there again. Decides nothing else.
    date
        Of the first day, YYYY-MM-DD; None for the community's day, or `NO_DAY` where nobody has a schedule.
    utc_offset
        Hours that clocks are ahead of UTC there; None for the time zone of 15 degrees that the world lies in.
    weather
        A kind of weather (`vico.sim.environment.weather_kinds`), ``"changing"``, or the content of a weather file.
    events
        Of the city: ``"none"``, ``"changing"``, or the content of a file of events (docs/events.md).
    opening_hours
        Whether places keep the hours that the map says, on the community's date, or the run's without one.
    periods
        How often agents act and observe, seconds by agent's name; 1 s where nothing else is said. For robots also
        ``"model"``, which is the control period of the robot's model, and the name ``"robots"`` for all of them.
        People's are multiples of 0.1 s, robots' of 0.01 s.
    """

    seed: int = 0
    residents: int | None = None
    assistants: int = 0
    assistant_places: Mapping[str, Sequence[float]] = field(default_factory=dict)
    robots: tuple[str, ...] = ()
    physics: str = "mujoco"
    robot_places: Mapping[str, Sequence[float]] = field(default_factory=dict)
    errands: bool = False
    oracle_grasp: bool = False
    cars: int = 0
    cyclists: int = 0
    pedestrians: int = 0
    junctions: str = "one"
    traffic: str | Mapping[str, Any] = "none"
    transit: bool = True
    image: int = 256
    outputs: tuple[str, ...] = USUAL_OUTPUTS
    cameras: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    worn: Mapping[str, str] = field(default_factory=dict)
    quality: str | Mapping[str, bool] = "plain"
    renderer: str = "cpu"
    memory: float = 2.0
    date: str | None = None
    utc_offset: float | None = None
    weather: str | Mapping[str, Any] = "fair"
    events: str | Mapping[str, Any] = "none"
    opening_hours: bool = False
    periods: Mapping[str, float | str] = field(default_factory=dict)


def check_types(settings: SimSettings, owner: str) -> None:
    """Make sure that the fields of settings are of their kinds; names that are one text become a tuple.

    Parameters
    ----------
    owner
        What the settings are of, for errors.

    Raises
    ------
    InputError
        If one is not.
    """
    for name, hint in get_type_hints(type(settings)).items():
        value = getattr(settings, name)
        kinds = set(get_args(hint)) if get_origin(hint) in (Union, UnionType) else {hint}
        if isinstance(value, np.generic):
            value = value.item()
        if hint == tuple[str, ...] and isinstance(value, str):
            value = tuple(part.strip() for part in value.split(",") if part.strip())
        if str in kinds and name == "date" and isinstance(value, Date):
            value = value.isoformat()
        if hint == tuple[str, ...]:
            if not isinstance(value, tuple | list) or not all(isinstance(one, str) for one in value):
                raise InputError(f"{owner}: {name} is {value!r}; it has to be names, as in ('husky', 'go2')")
            value = tuple(value)
        elif kinds <= _PLAIN.keys() and not any(_is_plain(value, kind) for kind in kinds):
            words = " or ".join(_PLAIN[kind] for kind in sorted(kinds, key=lambda kind: kind.__name__))
            raise InputError(f"{owner}: {name} is {value!r}; it has to be {words}")
        object.__setattr__(settings, name, value)


_PLAIN: dict[Any, str] = {
    bool: "True or False",
    int: "a whole number, such as 30",
    float: "a number, such as 0.5",
    str: "text",
    type(None): "None",
}


def _is_plain(value: Any, kind: Any) -> bool:
    if isinstance(value, bool) or kind is bool:
        return isinstance(value, bool) and kind is bool
    return isinstance(value, int | float) if kind is float else isinstance(value, kind)


@dataclass(frozen=True, kw_only=True)
class SimConfig(SimSettings):
    """Everything that decides a run beside the world and the community.

    Attributes
    ----------
    start
        Second of the day at which the run starts.
    observe
        Agents whose views are rendered; None for all, ``()`` for none. The rest of the observation is always given.
    """

    start: int = 8 * 3600
    observe: tuple[str, ...] | None = None

    def on_day(self, day: Date | None) -> SimConfig:
        """Return the configuration with a date: its own, else a community's day, else `NO_DAY`."""
        return self if self.date is not None else replace(self, date=(day or NO_DAY).isoformat())

    def __post_init__(self) -> None:
        check_types(self, "simulation")
        for name in ("seed", "assistants", "cars", "cyclists", "pedestrians", "residents"):
            value = getattr(self, name)
            if value is not None and value < 0:
                raise InputError(f"simulation: {name} is {value}; it has to be 0 or more")
        for name, limit in LIMITS.items():
            asked = len(self.robots) if name == "robots" else getattr(self, name)
            if asked > limit:
                raise InputError(
                    f"simulation: {asked:,} {name} are more than a run can have; ask for {limit:,} at most"
                )
        if self.junctions not in list(JunctionRule):
            raise InputError(f"simulation: junctions is {self.junctions!r}; take {', '.join(JunctionRule)}")
        if self.physics not in PHYSICS_ENGINES:
            raise InputError(f"simulation: no physics {self.physics!r}; choose among {', '.join(PHYSICS_ENGINES)}")
        if not 0 <= self.start < DAY:
            raise InputError(f"simulation: start is second {self.start} of the day; it has to be 0..{DAY - 1}")
        if not 16 <= self.image <= 1024:
            raise InputError(f"simulation: images of {self.image} pixels are out of range; take 16..1024, such as 256")
        object.__setattr__(self, "outputs", check_outputs(self.outputs))
        for name in ("assistant_places", "robot_places"):
            object.__setattr__(self, name, _checked_places(name, getattr(self, name)))
        RenderQuality.of(self.quality)
        if self.renderer not in RENDERERS:
            raise InputError(f"simulation: renderer {self.renderer!r}; it has to be one of {', '.join(RENDERERS)}")
        if not 0.0 < self.memory < math.inf:
            raise InputError(f"simulation: memory is {self.memory}; give gigabytes, such as 2")
        for record in self.cameras.values():
            Lens.of(record, side=self.image)

    def record(self) -> dict[str, Any]:
        """Return the configuration as it goes into `run.json`."""
        return asdict(self)


def _checked_places(field_name: str, places: Any) -> dict[str, tuple[float, ...]]:
    """Return where somebody is to start, as floats: equal places are equal configurations."""
    if not isinstance(places, Mapping):
        example = f'{{"{field_name.removesuffix("_places")}_0": [x, y, yaw]}}'
        raise InputError(f"{field_name}: give a table of places by name, such as {example}")
    found: dict[str, tuple[float, ...]] = {}
    for name, values in places.items():
        try:
            place = tuple(float(value) for value in values)
        except (TypeError, ValueError):
            place = ()
        if len(place) != 3 or not all(math.isfinite(value) for value in place):
            raise InputError(f"{field_name}: {name}: {values!r}; give x, y (ENU metres) and yaw (radians)")
        found[str(name)] = place
    return found


def find_by_name(text: str, names: Mapping[str, str], *, option: str) -> str:
    """Return the key of what somebody calls by its key, by its name, or by words of its name.

    Capitals, accents, and underscores or spaces between words make no difference.

    Parameters
    ----------
    names
        Names as people know them, such as that of a person, by the key that the simulation knows, such as
        ``resident_3``.
    option
        Of which the text is, for the sentence of an error, such as ``film: --follow``.

    Raises
    ------
    InputError
        If nothing is called so, or several things are.
    """
    if text in names:
        return text
    wanted = _words(text)
    by_words: dict[str, list[tuple[str, ...]]] = {key: [_words(key), _words(name)] for key, name in names.items()}
    found = [key for key, called in by_words.items() if wanted in called]
    if not found and wanted:
        found = [key for key, called in by_words.items() if set(wanted) <= set(called[1])]
    if len(found) == 1:
        return found[0]
    if found:
        several = [_both(key, names[key]) for key in found]
        raise InputError(f"{option}: {len(found)} are called {text!r}: {some_of(several)}; say which")
    spelt = {" ".join(words): key for key, called in by_words.items() for words in called}
    near = get_close_matches(" ".join(wanted), spelt, n=1) or get_close_matches(" ".join(wanted[:1]), spelt, n=1)
    if near:
        key = spelt[near[0]]
        raise InputError(f"{option}: nobody is called {text!r}; did you mean {_both(key, names[key])}?")
    raise InputError(
        f"{option}: nobody is called {text!r}; there are {some_of([_both(*one) for one in names.items()])}"
    )


def _words(text: str) -> tuple[str, ...]:
    """Return the words of a name, without capitals and accents."""
    letters = unicodedata.normalize("NFKD", text.casefold())
    plain = "".join(letter for letter in letters if not unicodedata.combining(letter))
    return tuple(plain.replace("_", " ").split())


def _both(key: str, name: str) -> str:
    """Return a name with its key, where they are not the same words."""
    return key if _words(key) == _words(name) else f"{name} ({key})"
