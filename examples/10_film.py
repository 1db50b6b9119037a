"""A day of a city in two minutes of film: seven scenes, each a recorded run of the same people with the same seed.

python examples/10_film.py --world out/demo/world --out out/film [--residents 50] [--scenes school,bus]

The morning street, a child on the way to school, a bus ride seen from inside, a shop, robots at work, rain at dusk, the
lit night. Each scene is simulated and recorded (`vico replay` opens the runs), then filmed from the recording with
`vico.viewer.run_film`. Two minutes of 1280 x 720 take a core about half an hour.
"""

import argparse
import math
from collections.abc import Callable, Iterator
from contextlib import closing, suppress
from dataclasses import dataclass, field, replace
from itertools import chain, pairwise
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import shapely
from PIL import Image, ImageDraw, ImageFont

from vico.agents.activities import Clerk
from vico.agents.indoor_walk import IndoorWalker
from vico.agents.schedule import Stay, followers_of, stays_of
from vico.agents.travel import Traveller
from vico.assets.shapes import box
from vico.clock import DAY, clock_of
from vico.community import Community, build_community
from vico.render.film import FilmWriter, read_film, write_film
from vico.runner.gather import FaultLog, Gatherer
from vico.runner.loop import Hook, Runner, Step
from vico.runner.recording import RecordedRun
from vico.seeds import rng
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.sim.people.placement import carries_umbrella, habit_of
from vico.sim.recording import read_run
from vico.sim.recording.recorder import Recorder
from vico.viewer.run_film import FilmSettings, RepeatedRun, film_frames
from vico.world.folder import read_world
from vico.world.public import PublicMap
from vico.world.walkable import CROSSING, ROADWAY
from vico.world.world import World

RATE = 25
ROBOTS = ("manipulator", "husky", "go2", "h1", "drone")
PASSENGERS, ROAD = 6, (CROSSING, ROADWAY)
SOON = 600  # seconds within which the bus of the ride is to come
SEARCH = 180  # seconds of a walk of which the best part is shown
MORNING = 1200  # seconds of a morning, likewise
CAMERA = 4.2  # metres that a camera may be away
PARCEL = (0.12, 0.18, 0.2)
AUTUMN = {"date": "2026-10-20", "utc_offset": 3.0}


class Enough(Exception):
    """A scene has been played."""


@dataclass
class Scene:
    """A part of the film.

    Attributes
    ----------
    caption
        What is written below it; ``{}`` is the name of who is followed.
    start
        Second of the day at which its run begins.
    follow, views
        Who is seen, and from where (`vico.viewer.follow_camera.VIEWS`): one shot each, equally long. `follow` may be
        told by how things are as the scene begins; of several, whoever has the best part is seen.
    seconds
        How long it is.
    begins
        Whether it may begin, asked in every second of the run.
    search, worth
        For how many seconds after that the best part is sought, and what makes a second of somebody worth seeing.
    config
        What its run has of its own.
    setup
        What is done before its first step.
    players
        Who acts beside the residents.
    """

    caption: str
    start: float
    follow: str | tuple[str, ...] | Callable[[Simulation], str]
    views: tuple[str, ...] = ("behind",)
    seconds: int = 17
    begins: Callable[[Simulation], bool] = lambda sim: sim.metrics.steps >= 10
    search: int = 0
    worth: Callable[[Simulation, str], float] = lambda sim, name: 0.0
    config: dict = field(default_factory=dict)
    setup: Callable[[Simulation], None] = lambda sim: None
    players: dict = field(default_factory=dict)


class UntilPlayed(Hook):
    """Notes what the seconds of a scene are worth, and ends its run once it has been played, or an hour has passed."""

    def __init__(self, scene: Scene, sim: Simulation) -> None:
        self.scene, self.sim, self.begun = scene, sim, -1
        self.cast: tuple[str, ...] = ()
        self.worth: list[list[float]] = []

    def on_step(self, step: Step) -> None:
        """Look whether it begins or is over."""
        if self.begun < 0 and self.scene.begins(self.sim):
            follow = self.scene.follow if isinstance(self.scene.follow, (str, tuple)) else self.scene.follow(self.sim)
            self.begun, self.cast = step.number, (follow,) if isinstance(follow, str) else follow
        if self.begun < 0:
            return
        self.worth.append([self.scene.worth(self.sim, name) for name in self.cast])
        if step.number >= self.begun + self.scene.search + self.scene.seconds:
            raise Enough

    def best(self) -> tuple[int, str]:
        """Return the step at which the best part begins, and who is seen; -1 where the scene did not come about."""
        if len(self.worth) <= self.scene.seconds:
            return -1, ""
        parts = np.lib.stride_tricks.sliding_window_view(np.array(self.worth), self.scene.seconds + 1, axis=0)
        first, who = np.unravel_index(int(np.argmax(parts.sum(axis=-1))), parts.shape[:2])
        return self.begun + int(first), self.cast[who]


class Passenger:
    """An assistant who rides a bus from one stop to another."""

    def __init__(self, public_map: PublicMap, goal: tuple[float, float], seed: int, number: int) -> None:
        self.goal = goal
        self.traveller = Traveller(public_map, rng(seed, "passenger", number), modes=("bus",))

    def act(self, observation: dict, info: dict) -> dict:
        """Go on with the trip."""
        return self.traveller.towards(self.goal, observation, info) or {"type": "wait"}


class Shopkeeper:
    """An assistant who goes into a shop and stands behind its till."""

    def __init__(self, public_map: PublicMap, place: str, seed: int) -> None:
        self.place, door = place, public_map.place_by_id[place].entrance
        self.door = float(door[0]), float(door[1])
        self.traveller, self.walker = Traveller(public_map, rng(seed, "shopkeeper")), IndoorWalker()
        self.clerk = Clerk(self.walk)
        self.sim: Simulation | None = None

    def setup(self, sim: Simulation) -> None:
        """Stand before the shop's door."""
        self.sim = sim
        sim.scenario.place_agent("assistant_0", self.door)

    def walk(self, point: tuple[float, float, float], near: float, observation: dict, info: dict) -> dict | None:
        """Get on within the shop, which whoever works there knows."""
        indoor = self.sim.state.indoor
        room = indoor.index[observation["state"]["room"]]
        furniture = indoor.furniture[indoor.furniture_start[room] : indoor.furniture_start[room + 1]]
        known = SimpleNamespace(room=indoor.boxes[room], furniture=furniture)
        self.walker.notice(observation, info | {"in_view": known})
        return self.walker.towards(observation, point, near=near)

    def act(self, observation: dict, info: dict) -> dict:
        """Go in, and to the till."""
        if observation["state"]["place"] != self.place:
            return self.traveller.towards(self.door, observation, info) or {"type": "enter", "place": self.place}
        return self.clerk.towards(self.place, observation, info) or {"type": "wait"}


class Crew:
    """Robots that load a parcel: the manipulator picks it up and puts it on the Husky, which comes and drives off.

    The Go2 and the H1 come to see it, the drone comes last and hovers above.
    """

    def __init__(self) -> None:
        self.sim: Simulation | None = None
        self.spot = np.zeros(2)
        self.sent: dict[str, str] = {}

    def setup(self, sim: Simulation) -> None:
        """Lay the parcel before the manipulator."""
        self.sim, self.sent = sim, {}
        robots = sim.state.robots.bodies()
        yaw = float(robots.yaw[0])
        ahead = np.array([math.cos(yaw), math.sin(yaw), 0.0])
        self.parcel = int(
            sim.scenario.add_object(
                "parcel", "parcel", [box(PARCEL, (0, 0, PARCEL[2] / 2))], robots.position[0] + 1.2 * ahead, size=PARCEL
            )
        )
        self.spot = robots.position[0, :2] + 2.2 * ahead[:2]

    def act_as(self, name: str, order: Callable[[], dict | None]) -> "Robot":
        """Return a robot that is told what `order` says, once for each order."""
        return Robot(self, name, order)

    def has_come(self) -> bool:
        """Whether the Husky has come and stands: it is not to drive into what the arm holds."""
        speed = float(np.hypot(*self.sim.state.robots.bodies().velocity[1]))
        return self.near(1, 1.5) and speed < 0.02

    def begins(self, sim: Simulation) -> bool:
        """Whether the parcel has been picked up."""
        return self.holds()

    def near(self, robot: int, metres: float) -> bool:
        """Whether a robot is near the spot."""
        position = self.sim.state.robots.bodies().position[robot, :2]
        return bool(np.hypot(*(position - self.spot)) < metres)

    def holds(self) -> bool:
        """Whether the manipulator holds the parcel."""
        return self.sim.state.robots.in_hand(0) == self.parcel

    def beside(self, degrees: float, metres: float, height: float = 0.0) -> list[float]:
        """Return a point beside the spot where one can stand, ENU metres."""
        for turn in range(0, 360, 20):
            angle = math.radians(degrees + turn)
            point = self.spot + metres * np.array([math.cos(angle), math.sin(angle)])
            if self.sim.world.walkable.is_connected(point) and self.sim.world.walkable.clearance_at(point) > 0.6:
                break
        return [float(point[0]), float(point[1]), float(self.sim.world.height(point)) + height]

    def manipulator(self) -> dict | None:
        """Wait for the Husky; pick the parcel up, and put it on the deck."""
        if not self.has_come():
            return None
        if not self.holds() and "place" not in self.sent.get("manipulator", ""):
            return {"type": "pick", "object": self.parcel}
        return {"type": "place", "target": int(self.sim.state.robots.bodies().entity[1])}

    def husky(self) -> dict | None:
        """Come, and drive off with the parcel."""
        if "place" in self.sent.get("manipulator", "") and not self.holds():
            return {"type": "go_to", "target": self.beside(90.0, 15.0)}
        return {"type": "go_to", "target": self.beside(0.0, 0.4)}

    def players(self) -> dict:
        """Return who plays which robot."""
        orders = {
            "manipulator": self.manipulator,
            "husky": self.husky,
            "go2": lambda: {"type": "go_to", "target": self.beside(60.0, 3.5)},
            "h1": lambda: {"type": "go_to", "target": self.beside(-60.0, 3.5)},
            "drone": lambda: {"type": "fly_to", "target": self.beside(180.0, 4.0, 4.0)},
        }
        return {f"robot_{k}": self.act_as(name, orders[name]) for k, name in enumerate(ROBOTS)}


@dataclass
class Robot:
    """One of the crew: it is told an order when it is another one than before."""

    crew: Crew
    name: str
    order: Callable[[], dict | None]

    def act(self, observation: dict, info: dict) -> dict:
        """Return the order, or wait."""
        order = self.order()
        said = str(order)
        if order is None or self.crew.sent.get(self.name) == said:
            return {"type": "wait"}
        self.crew.sent[self.name] = said
        return order


def stays(resident, world: World) -> list[Stay]:
    """Return where somebody is to be by when."""
    return stays_of(resident.schedule, {place.id: place for place in world.places})


def way(resident, world: World, stay: Stay, before: str) -> float:
    """Return how far it is to a stay from the place of the one before, metres, as the crow flies."""
    places = {place.id: place for place in world.places}
    return math.dist(places[stay.place].position[:2], places[before].position[:2])


def roomiest(world: World) -> np.ndarray:
    """Return the point farthest from everything solid, off the roads and 100 m within the world."""
    room = np.where(np.isin(world.walkable.cls, ROAD), 0.0, world.walkable.clearance)
    margin = round(100.0 / world.walkable.cell)
    inner = np.minimum(room[margin:-margin, margin:-margin], 12.0)
    row, column = np.unravel_index(int(np.argmax(inner)), inner.shape)
    return world.walkable.centre_of(np.array([column + margin, row + margin]))


def anybody(resident, stay: Stay) -> bool:
    """Take whoever it is."""
    return True


def ways_between(
    community: Community, world: World, early: str, late: str, wanted: Callable
) -> list[tuple[float, str, Stay]]:
    """Return the walks that begin between two hours: how long, whose, and to which stay; the longest first."""
    first, last = (int(hour[:2]) * 3600 + int(hour[3:]) * 60 for hour in (early, late))
    found = []
    for resident in community.residents:
        days = stays(resident, world)
        for before, stay in pairwise(days):
            if first <= stay.leave <= last and stay.mode == "walk" and wanted(resident, stay):
                found.append((way(resident, world, stay, before.place), resident.id, stay))
    if not found:
        raise SystemExit(f"nobody of the community is on such a way between {early} and {late}; take more residents")
    return sorted(found, key=lambda one: (-one[0], one[1]))


def on_the_way(community: Community, world: World, early: str, late: str, wanted: Callable) -> tuple[str, Stay]:
    """Return who has the longest walk that begins between two hours, and to which stay."""
    _, name, stay = ways_between(community, world, early, late, wanted)[0]
    return name, stay


class Sunshine:
    """Says where the sun shines, from the heights of the houses."""

    def __init__(self, world: World) -> None:
        self.houses = [shapely.Polygon(house.footprint[0]) for house in world.buildings]
        self.tops = np.array([house.base + house.height for house in world.buildings])
        self.tree = shapely.STRtree(self.houses)

    def at(self, point: np.ndarray, sun: np.ndarray) -> bool:
        """Whether it shines on a point, ENU metres; `sun` is the unit vector to it."""
        flat = float(np.hypot(*sun[:2]))
        if sun[2] < 0.05:
            return False
        ray = shapely.LineString([point[:2], point[:2] + sun[:2] / flat * 80.0])
        here = shapely.Point(point[:2])
        return not any(
            self.tops[k] > point[2] + sun[2] / flat * here.distance(self.houses[k].intersection(ray))
            for k in self.tree.query(ray, "intersects")
        )


def liveliness(world: World) -> Callable[[Simulation, str], float]:
    """Return how much goes on around somebody outdoors: who moves near by, with room for a camera before and behind."""
    sunshine = Sunshine(world)

    def worth(sim: Simulation, name: str) -> float:
        people, bodies = sim.state.people, sim.state.obstacles()
        i = people.names.index(name)
        if people.room[i] >= 0 or people.vehicle[i] != 0:
            return -20.0
        offset = (bodies.position[:, :2] - people.position[i, :2])[bodies.entity != people.entity[i]]
        moves = np.hypot(*bodies.velocity.T)[bodies.entity != people.entity[i]] > 0.3
        away = np.hypot(*offset.T)
        lively = float((moves / (1.0 + away / 8.0))[away < 40.0].sum())
        heading = np.array([math.cos(people.yaw[i]), math.sin(people.yaw[i])])
        # Nobody is to walk through the camera, or to stand between it and whom it follows.
        for side in (-1.0, 1.0):
            along = np.clip(side * (offset @ heading), 0.8, CAMERA)
            near = np.hypot(*(offset - side * along[:, None] * heading).T)
            lively -= 1.5 * float(np.clip(1.2 - near, 0.0, 0.6).sum())
        # Steps along the very edge of a kerb go up and down; and who stands is no walk.
        aside = np.array([[heading[1], -heading[0]], [-heading[1], heading[0]]])
        if np.ptp(sim.world.height(people.position[i, :2] + 0.3 * aside)) > 0.05:
            lively -= 3.0
        # Beyond the edge of the world there is a bare plain.
        lively -= 0.03 * max(150.0 - float(sim.world.half - np.abs(people.position[i, :2]).max()), 0.0)
        if sunshine.at(people.position[i], sim.state.environment.sky.sun(float(sim.state.second))):
            lively += 2.0
        walks = float(np.hypot(*people.velocity[i])) > 0.5
        return lively if walks else lively - 2.0

    return worth


def business(sim: Simulation, name: str) -> float:
    """Return whether somebody indoors goes about something, and does not only stand there."""
    people = sim.state.people
    i = people.names.index(name)
    if people.room[i] < 0:
        return -20.0
    walks = float(np.hypot(*people.velocity[i])) > 0.3
    return float(walks or people.action_clip[i] >= 0)


def outdoors(name: str, seconds: int) -> Callable[[Simulation], bool]:
    """Return whether somebody has been outdoors for some seconds."""
    since = [0]

    def begins(sim: Simulation) -> bool:
        people = sim.state.people
        since[0] = since[0] + 1 if people.room[people.names.index(name)] < 0 else 0
        return since[0] >= seconds

    return begins


def arrived(name: str, place: str) -> Callable[[Simulation], bool]:
    """Return whether somebody is in a place."""
    return lambda sim: sim.state.people.place[sim.state.people.names.index(name)] == sim.state.place_index[place]


def longest_ride(public_map: PublicMap, second: float) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return where to wait, and where to go, for the longest ride in a bus that comes soon, all from one stop."""
    waits = {stop.id: (float(stop.wait[0]), float(stop.wait[1])) for stop in public_map.stops}
    best, found = 0.0, None
    for line in public_map.lines:
        for k, origin in enumerate(line.stops):
            goal = waits[line.stops[(k + len(line.stops) // 2) % len(line.stops)]]
            trip = public_map.trips.plan(waits[origin], goal, second, modes=("bus",), cash=20.0)
            for leg in trip.legs if trip is not None else ():
                lasts = leg.arrive - leg.depart
                if leg.mode == "bus" and leg.origin == origin and leg.depart < second + SOON and lasts > best:
                    best, found = lasts, (waits[origin], goal)
    if found is None:
        raise SystemExit("no bus of this world comes within ten minutes for a ride")
    return found


def rearmost(sim: Simulation) -> str:
    """Return which of the passengers sees most of the others: who sits farthest back."""
    people = sim.state.people
    aboard = [k for k in range(len(people) - PASSENGERS, len(people)) if people.vehicle[k] > 0]
    ahead = np.array([np.cos(people.yaw[aboard[0]]), np.sin(people.yaw[aboard[0]])])
    return people.names[min(aboard, key=lambda k: float(people.position[k, :2] @ ahead))]


def in_a_moving_bus(sim: Simulation) -> bool:
    """Return whether a bus is on its way with most of those who wanted to ride."""
    transit, ridden = sim.state.transit, sim.state.people.vehicle_entity[-PASSENGERS:]
    for bus in range(transit.traffic.buses):
        if int((ridden == transit.entity_of(bus)).sum()) > PASSENGERS // 2:
            return transit.stopped_at(bus) is None
    return False


def learns(who, stay: Stay) -> bool:
    """Take a child who goes to school."""
    return who.age < 14 and stay.tag == "study"


def shops(who, stay: Stay) -> bool:
    """Take who goes shopping alone."""
    return who.age >= 16 and stay.tag == "shop"


@dataclass
class Casting:
    """Finds who plays in the scenes of the film, each a method; a film shows them in their order here."""

    world: World
    community: Community
    seed: int

    def walk(
        self, early: str, late: str, caption: str, wanted=anybody, *, views=("front", "behind"), after=6, **config
    ) -> Scene:
        """Return a scene of somebody on the way."""
        name, stay = on_the_way(self.community, self.world, early, late, wanted)
        start = stay.leave - 20
        begins, worth = outdoors(name, after), liveliness(self.world)
        return Scene(caption, start, name, views, begins=begins, search=SEARCH, worth=worth, config=config)

    def street(self) -> Scene:
        """Return the morning, of whoever of those on the way walks where most goes on."""
        ways = ways_between(self.community, self.world, "08:30", "09:30", anybody)
        return Scene(
            "Morning: {} is on the way",
            9 * 3600,
            tuple(sorted({name for _, name, _ in ways})),
            ("front", "behind"),
            search=MORNING,
            worth=liveliness(self.world),
            config={"pedestrians": 360},
        )

    def school(self) -> Scene:
        """Return a child on the way to school."""
        return self.walk("06:30", "09:00", "{} goes to school", learns)

    def bus(self) -> Scene:
        """Return a ride, seen by who sits farthest back."""
        public_map = PublicMap.from_world(self.world)
        start = 9 * 3600
        here, goal = longest_ride(public_map, start)
        riders = {f"assistant_{k}": Passenger(public_map, goal, self.seed, k) for k in range(PASSENGERS)}

        def setup(sim: Simulation) -> None:
            for name in riders:
                sim.scenario.place_agent(name, here)
            sim.state.people.cash[-PASSENGERS:] = 20.0

        config = {"assistants": PASSENGERS}
        return Scene(
            "In the bus", start, rearmost, ("eyes",), begins=in_a_moving_bus, config=config, setup=setup,
            players=riders,
        )  # fmt: skip

    def shop(self) -> Scene:
        """Return somebody who shops."""
        scene = self.walk("08:00", "20:00", "{} shops", shops)
        _, stay = on_the_way(self.community, self.world, "08:00", "20:00", shops)
        keeper = Shopkeeper(PublicMap.from_world(self.world), stay.place, self.seed)
        return replace(
            scene,
            views=("behind", "front"),
            begins=arrived(scene.follow, stay.place),
            worth=business,
            config=scene.config | {"assistants": 1},
            setup=keeper.setup,
            players={"assistant_0": keeper},
        )

    def robots(self) -> Scene:
        """Return the crew at work, on the square of the world with the most room."""
        crew, middle = Crew(), roomiest(self.world)
        around = {
            "robot_0": (0, 0, 0),
            "robot_1": (9, 1, 3),
            "robot_2": (7, 7, -2),
            "robot_3": (6, -7, 2),
            "robot_4": (-6, 5, 0),
        }
        places = {name: (middle[0] + x, middle[1] + y, yaw) for name, (x, y, yaw) in around.items()}
        config = {"robots": ROBOTS, "robot_places": places}
        return Scene(
            "Robots at work",
            11 * 3600,
            "robot_0",
            ("orbit",),
            20,
            crew.begins,
            config=config,
            setup=crew.setup,
            players=crew.players(),
        )

    def rain(self) -> Scene:
        """Return an evening in the rain, of somebody who has an umbrella along."""

        def is_careful(who, stay: Stay) -> bool:
            return bool(carries_umbrella(np.array(habit_of(self.seed, who.id))))

        return self.walk("17:20", "18:10", "Rain at dusk", is_careful, after=20, weather="rain", **AUTUMN)

    def night(self) -> Scene:
        """Return somebody on the way home at night."""
        return self.walk("19:00", "22:00", "The lit night", after=60, weather="clear", **AUTUMN)


SCENES = ("street", "school", "bus", "shop", "robots", "rain", "night")


def play(scene: Scene, out: Path, world: World, community: Community, seed: int) -> tuple[RepeatedRun, int, str]:
    """Simulate and record a scene; return it, the step at which it begins, and who is followed."""
    options = {"cars": 80, "pedestrians": 200, "junctions": "signals", **scene.config}
    config = SimConfig(seed=seed, start=int(scene.start) % DAY, observe=(), **options)
    sim = Simulation(world, community, config)
    scene.setup(sim)
    followers = followers_of(community, PublicMap.from_world(world), seed=seed)
    faults, played = FaultLog(), UntilPlayed(scene, sim)
    agents = Gatherer(followers | scene.players, trusted=[*followers, *scene.players])
    with closing(agents), Recorder(out, sim, sources={}, wanted=3600) as recorder:
        with suppress(Enough):
            Runner(sim, agents, hooks=[RecordedRun(recorder, faults), played], faults=faults).run(3600)
        recorder.close()
    first, follow = played.best()
    if first < 0:
        raise SystemExit(f"{scene.caption!r} did not come about within an hour; take another seed, or more residents")
    return RepeatedRun(read_run(out), world, community, setup=scene.setup), first, follow


def shots(repeated: RepeatedRun, scene: Scene, first: int, options: argparse.Namespace) -> Iterator[np.ndarray]:
    """Yield the frames of a scene, one shot after the other."""
    width, height = (int(side) for side in options.size.split("x"))
    cuts = np.linspace(first, first + scene.seconds, len(scene.views) + 1).round().astype(int).tolist()
    for view, (begin, end) in zip(scene.views, pairwise(cuts), strict=True):
        settings = FilmSettings(
            follow=scene.follow, view=view, width=width, height=height, rate=options.rate, samples=options.samples
        )
        yield from film_frames(repeated, settings, first=begin, last=end)


def captioned(frames: Iterator[np.ndarray], scene: Scene, second: float, rate: int) -> Iterator[np.ndarray]:
    """Write what is seen, and when, into the lower left corner."""
    for number, frame in enumerate(frames):
        picture = Image.fromarray(frame)
        draw, height = ImageDraw.Draw(picture), frame.shape[0]
        text = f"{clock_of(int(second + number / rate) % DAY)[:5]}   {scene.caption}"
        draw.text(
            (height // 24, height - height // 12), text, (255, 255, 255), ImageFont.load_default(height // 26),
            stroke_width=max(height // 360, 1), stroke_fill=(0, 0, 0),
        )  # fmt: skip
        yield np.asarray(picture)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--world", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--residents", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--size", default="1280x720")
    parser.add_argument("--rate", type=int, default=RATE, help="frames a second")
    parser.add_argument("--samples", type=int, default=2, help="rays a pixel, along each side")
    parser.add_argument("--scenes", default=",".join(SCENES), help="which, separated by commas")
    arguments = parser.parse_args()

    world = read_world(arguments.world)
    community = build_community(world, residents=arguments.residents, seed=arguments.seed)
    casting = Casting(world, community, arguments.seed)
    arguments.out.mkdir(parents=True, exist_ok=True)
    names = arguments.scenes.split(",")
    for name in names:
        if (arguments.out / f"{name}.mp4").exists():
            print(f"{name}: is there already, and kept", flush=True)
            continue
        scene = getattr(casting, name)()
        repeated, first, follow = play(scene, arguments.out / name, world, community, arguments.seed)
        called = {resident.id: resident.name for resident in community.residents}.get(follow, follow)
        scene = replace(scene, follow=follow, caption=scene.caption.format(called))
        with FilmWriter(arguments.out / f"{name}.mp4", rate=arguments.rate, crf=18, threads=2) as film:
            for frame in captioned(
                shots(repeated, scene, first, arguments), scene, float(repeated.run.times[first]), arguments.rate
            ):
                film.add(frame)
        print(f"{name}: {scene.caption}, from step {first} of {arguments.out / name}", flush=True)
    parts = [arguments.out / f"{name}.mp4" for name in names]
    count = write_film(
        arguments.out / "film.mp4", chain.from_iterable(map(read_film, parts)), rate=arguments.rate, crf=20
    )
    print(f"{arguments.out / 'film.mp4'}: {count / arguments.rate:.0f} s")


if __name__ == "__main__":
    main()
