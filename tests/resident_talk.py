"""A resident of the toy city who can be asked without a simulation."""

from __future__ import annotations

from typing import Any

import toy_city
from vico.agents.day_plan import Stay
from vico.agents.talk.acquaintance import Acquaintance, acquaintance_of
from vico.agents.talk.answers import Knowledge, Moment, Person, answer_to
from vico.agents.talk.grammar import Kind, Question
from vico.agents.talk.memory import ResidentMemory
from vico.world.public import PublicMap

NINE, TEN = 9 * 3600.0, 10 * 3600.0
CAFE, SHOP, PARK = toy_city.CAFE, toy_city.SHOP, toy_city.PARK
NAMES = {"resident_0": "Ada Berg", "resident_1": "Bo Dahl", "resident_2": "Cleo Ek", "assistant_0": "assistant 0"}
STAYS = [
    Stay(0.0, 0.0, "sleep", "sleep", "Sleep", CAFE),
    Stay(8 * 3600.0, 8.1 * 3600.0, "main", "work", "Sell hats: the new ones", SHOP),
    Stay(43200.0, 43920.0, "meal", "meal_out", "Eat soup", CAFE),
]


class View:
    """Bodies in view, nearest first, as `vico.sim.perception.InView` has them."""

    def __init__(self, *bodies: Any) -> None:
        self.bodies = bodies

    def within(self, reach: float) -> Any:
        return (body for body in self.bodies if body.distance <= reach)

    def agents_within(self, reach: float) -> Any:
        return (body.agent for body in self.within(reach) if body.agent)


class Body:
    def __init__(self, agent: str, x: float, y: float, kind: str = "resident") -> None:
        self.agent, self.kind, self.position, self.distance = agent, kind, (x, y, 0.0), 5.0


def knowing(*known: Acquaintance) -> Knowledge:
    public = PublicMap.from_world(toy_city.world())
    me = Person("resident_9", "Mia Holm", 40, "Baker", ("chess",), frozenset({SHOP}))
    memory = ResidentMemory(public.place_ids)
    return Knowledge(me, public, {one.agent: one for one in known}, NAMES, memory, STAYS)


def moment(time: float = TEN, place: str = "", view: Any = None) -> Moment:
    return Moment(time, (0.0, 3.0), (0.0, 3.0), place, view, lambda: "here to sell hats")


def ask(knows: Knowledge, kind: Kind, what: str = "", when: Moment | None = None) -> str:
    return answer_to(Question(kind, what), knows, when or moment())


def ada(kind: str) -> Acquaintance:
    return acquaintance_of(toy_city.community().residents[0], kind, "chess")
