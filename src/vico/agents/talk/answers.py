"""Answers of a resident: its knowledge at a moment, answers to questions, and the talker that gives them.

A resident tells from sight, from acquaintance, from what it heard, and of its own day, in the sentences of
``vico/data/agents/talk/answers.toml``. `Talker` listens, decides whether a message is meant for it, and answers: from
templates, or as a `Talk` says.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

from vico.agents.base import AgentState, Info, Observation
from vico.agents.day_plan import Stay
from vico.agents.talk.acquaintance import Acquaintance, Habit, calls_somebody_nearer, is_called, names_of
from vico.agents.talk.grammar import Question, activity_of, read_grammar, vocation_of
from vico.agents.talk.memory import HeardMessage, ResidentMemory, SeenPerson, Visit
from vico.agents.talk.sentences import (
    Claim,
    Sentences,
    claims_in,
    describe_way,
    place_named,
    read_sentences,
    round_distance,
)
from vico.clock import DAY, clock_of
from vico.world.public import PublicMap, PublicPlace

__all__ = [
    "BESIDE_WITHIN",
    "CONVERSATION_DISTANCE",
    "HEARING_RANGE",
    "KNOWN_WITHIN",
    "MOST_TOLD",
    "PATIENCE",
    "PATIENCE_FOR",
    "Hearsay",
    "Knowledge",
    "Moment",
    "Person",
    "Talk",
    "Talker",
    "TemplateTalk",
    "about_person",
    "answer_to",
    "moment_of",
    "person_of",
]
#: Places within so many metres are known to everybody who stands there, from the map; and what is beside a point.
KNOWN_WITHIN, BESIDE_WITHIN = 300.0, 60.0
# Somebody is in view this far, metres.
_IN_VIEW = 60.0
# What others said of somebody is believed if it is one of these.
_HEARSAY = ("saw_in", "saw_near", "told", "since")


@dataclass(frozen=True)
class Person:
    """Who a resident is, as it knows itself.

    Attributes
    ----------
    places
        Ids of places it knows well.
    gender
        ``female`` or ``male``; empty if nobody said.
    household
        Id, the same for those who live together; empty if nobody said.
    """

    agent: str
    name: str
    age: int
    occupation: str
    hobbies: tuple[str, ...] = ()
    places: frozenset[str] = frozenset()
    gender: str = ""
    household: str = ""

    @property
    def names(self) -> tuple[str, ...]:
        """What others call it."""
        return names_of(self.name, self.gender)


@dataclass(frozen=True)
class Moment:
    """Where one is, what one sees and is about.

    Attributes
    ----------
    time
        Seconds since midnight of the first day.
    position, stands
        ENU metres: on the ground, before the door for those indoors; and where one really stands.
    place
        Id of where one is; empty outdoors.
    view
        What is in view (`vico.sim.perception.InView`); None if one isn't told.
    errand
        Says what one is about, to follow "I'm ".
    """

    time: float
    position: tuple[float, float]
    stands: tuple[float, float]
    place: str
    view: Any
    errand: Callable[[], str]


def person_of(resident: Any) -> Person:
    """Return who a resident (as `vico.community.model.Resident`) is, as it knows itself; what it lacks is left out."""
    places = {getattr(resident, "home", None), getattr(resident, "workplace", None)}
    places |= {*getattr(resident, "known_places", ()), *(item.place for item in resident.schedule)}
    known = frozenset(place for place in places if place)
    gender, household = (str(getattr(resident, field, None) or "") for field in ("gender", "household"))
    hobbies = tuple(resident.hobbies)
    return Person(resident.id, resident.name, resident.age, resident.occupation, hobbies, known, gender, household)


def moment_of(observation: Observation, info: Info, public_map: PublicMap, errand: Callable[[], str]) -> Moment:
    """Return the moment that a resident observes."""
    state = observation["state"]
    x, y = (float(value) for value in observation["pose"][:2])
    inside = public_map.place_by_id.get(state["place"]) if state["room"] else None
    ground = (x, y) if inside is None else (inside.position[0], inside.position[1])
    return Moment(float(state["time"]), ground, (x, y), str(state["place"] or ""), info.get("in_view"), errand)


@dataclass(frozen=True)
class Hearsay:
    """What somebody said of where a person was."""

    heard: HeardMessage
    claim: Claim
    place: PublicPlace


@dataclass
class Knowledge:
    """All that a resident knows and remembers.

    Attributes
    ----------
    me
        Itself.
    public_map
        Of the city.
    known
        Whom it knows, by agent.
    names
        What people are called whom one sees: name of the person by agent. Used for those one knows, saw or hears only.
    memory
        Of the day.
    stays
        Its plan of the day.
    """

    me: Person
    public_map: PublicMap
    known: Mapping[str, Acquaintance]
    names: Mapping[str, str]
    memory: ResidentMemory
    stays: Sequence[Stay]

    def people_called(self, what: str, moment: Moment) -> list[str]:
        """Return the agents of people one knows, has seen or sees who go by a name, by their whole name if any does."""
        wanted = what.lower()
        seen = () if moment.view is None else moment.view.agents_within(_IN_VIEW)
        about = dict.fromkeys([*self.known, *self.memory.people, *seen])
        called = {agent: self.name_of(agent) for agent in about if agent != self.me.agent}
        whole = [agent for agent, name in called.items() if wanted in (name.lower(), agent.lower())]
        return whole or [agent for agent, name in called.items() if wanted in self._names_of(agent, name)]

    def _names_of(self, agent: str, name: str) -> set[str]:
        person = self.known.get(agent)
        return {one.lower() for one in names_of(name, "" if person is None else person.gender)}

    def name_of(self, agent: str) -> str:
        """Return the name of somebody one knows or sees."""
        person = self.known.get(agent)
        return person.name if person is not None else self.names.get(agent, agent.replace("_", " "))

    def name_and_gender(self, agent: str) -> tuple[str, str | None] | None:
        """Return both of somebody one knows or sees; the gender is None for strangers. None for who has no name."""
        person = self.known.get(agent)
        if person is not None:
            return person.name, person.gender
        return (self.names[agent], None) if agent in self.names else None

    def is_me(self, what: str) -> bool:
        """Whether somebody asks for oneself."""
        return what.lower() in {name.lower() for name in (*self.me.names, self.me.agent)}

    def in_view(self, agent: str, moment: Moment) -> tuple[float, float] | None:
        """Return where somebody stands whom one sees right now, ENU metres."""
        if moment.view is None:
            return None
        seen = next((body for body in moment.view.within(_IN_VIEW) if body.agent == agent), None)
        return None if seen is None else (float(seen.position[0]), float(seen.position[1]))

    def last_seen(self, agent: str) -> SeenPerson | None:
        """Return when and where somebody was seen last."""
        return self.memory.last_seen(agent)

    def hearsay(self, name: str) -> Hearsay | None:
        """Return the last that one heard of where somebody was, at a place that the map has."""
        for heard in reversed(self.memory.messages):
            for claim in claims_in(heard.text):
                about = claim.person or self.name_of(heard.speaker)
                place = place_named(self.public_map, claim.place) if claim.kind in _HEARSAY else None
                if place is not None and about.lower() == name.lower():
                    return Hearsay(heard, claim, place)
        return None

    def usual(self, agent: str, time: float) -> Habit | None:
        """Return where somebody usually is at a time, if one knows them that well."""
        person = self.known.get(agent)
        habit = None if person is None else person.usual_at(time % DAY)
        return habit if habit is not None and habit.place in self.public_map.place_by_id else None

    def home_of(self, agent: str) -> PublicPlace | None:
        """Return where somebody lives, if one knows."""
        person = self.known.get(agent)
        return None if person is None else self.public_map.place_by_id.get(person.home)

    def place_called(self, what: str, position: tuple[float, float]) -> PublicPlace | None:
        """Return the nearest place of a name or kind that one knows: near by, or where one or one's friends go."""
        bare = read_grammar().bare
        wanted = bare(what).lower()
        ids = {place.id for place in self.public_map.places_near(position, KNOWN_WITHIN)} | self._frequented_places
        known = [place for place in self.public_map.places if place.id in ids]
        found = [place for place in known if bare(place.name).lower() == wanted]
        found = found or [place for place in known if place.kind.replace("_", " ") == wanted]
        return min(found, key=lambda place: math.dist(place.position[:2], position), default=None)

    @cached_property
    def _frequented_places(self) -> set[str]:
        """Ids of places where one goes, or people whom one knows."""
        theirs = {habit.place for one in self.known.values() for habit in one.habits}
        return {*self.me.places, *theirs, *(one.home for one in self.known.values())}

    def beside(self, x: float, y: float) -> PublicPlace | None:
        """Return the nearest place that a point lies beside, of those with names of their own."""
        near = self.public_map.places_near((x, y), BESIDE_WITHIN)
        return next((place for place in near if place.name), None)

    def visits(self) -> list[tuple[Visit, Stay, PublicPlace]]:
        """Return where one has been, in order."""
        places = self.public_map.place_by_id
        return [
            (visit, self.stays[visit.stay], places[visit.place])
            for visit in self.memory.visits
            if visit.stay < len(self.stays) and visit.place in places
        ]

    def plans(self, time: float) -> list[tuple[Stay, float, PublicPlace]]:
        """Return the stays that are still to come today, each with its end, seconds of the day."""
        places = self.public_map.place_by_id
        ends = [*(stay.leave for stay in self.stays[1:]), DAY - 1.0]
        return [
            (stay, end, places[stay.place])
            for stay, end in zip(self.stays, ends, strict=True)
            if stay.due > time % DAY and stay.place in places
        ]


# Most visits and plans that one tells of at a time; shorter visits are not worth it, seconds.
MOST_TOLD, _WORTH_TELLING = 4, 60.0
# Who stands so near a place is there already, metres.
_AT_PLACE = 3.0


def answer_to(question: Question, knows: Knowledge, moment: Moment) -> str:
    """Answer a question truly: from sight, acquaintance, hearsay, the map where one knows it, and one's own day.

    Returns
    -------
    str
        One or several sentences.
    """
    sentences = read_sentences()
    if question.kind in ("seen", "where", "way"):
        return _answer_about(question, knows, moment, sentences)
    if question.kind == "doing":
        return sentences.say("doing", errand=moment.errand())
    if question.kind == "did":
        return _answer_did(knows, sentences)
    if question.kind == "plans":
        return _answer_plans(knows, moment, sentences)
    return _answer_who(knows, sentences)


def _answer_about(question: Question, knows: Knowledge, moment: Moment, sentences: Sentences) -> str:
    """Answer a question about somebody or a place: "where is" may be about either."""
    if question.kind != "way":
        if knows.is_me(question.what):
            return sentences.say("myself", person=knows.me.name)
        people = knows.people_called(question.what, moment)
        if len(people) > 1:
            return sentences.say("which_person")
        if people:
            return about_person(people[0], knows, moment)
        if question.kind == "seen":
            return sentences.say("unknown_person")
    place = knows.place_called(question.what, moment.position)
    if place is None:
        return sentences.say("unknown_place")
    return _answer_place(place, question, knows, moment, sentences)


def about_person(agent: str, knows: Knowledge, moment: Moment) -> str:
    """Say where somebody is: in view; or where they were seen or said to be last, and usually are now."""
    sentences, name = read_sentences(), knows.name_of(agent)
    there = knows.in_view(agent, moment)
    if there is not None:
        return sentences.say("see", person=name, **_direction_fields(there, moment, sentences))
    said = []
    seen, told = knows.last_seen(agent), knows.hearsay(name)
    if seen is not None:
        said.append(_sighting_sentence(seen, name, knows, sentences))
    if told is not None and told.claim.time is not None and (seen is None or told.claim.time > seen.time % DAY):
        source, at = knows.name_of(told.heard.speaker), _clock_text(told.claim.time)
        said.append(sentences.say("told", source=source, person=name, place=told.place.name, time=at))
    said += _usual_sentences(agent, knows, moment, sentences, alone=not said)
    return " ".join(said) or sentences.say("not_seen", person=name)


def _sighting_sentence(seen: SeenPerson, name: str, knows: Knowledge, sentences: Sentences) -> str:
    place = knows.public_map.place_by_id.get(seen.place)
    if place is not None:
        return sentences.say("saw_in", person=name, place=place.name, time=_clock_text(seen.time))
    near = knows.beside(seen.x, seen.y)
    if near is not None:
        return sentences.say("saw_near", person=name, place=near.name, time=_clock_text(seen.time))
    return sentences.say("saw_away", person=name, time=_clock_text(seen.time))


def _usual_sentences(agent: str, knows: Knowledge, moment: Moment, sentences: Sentences, *, alone: bool) -> list[str]:
    """Say where somebody usually is now; else, if there is nothing else to say, where they live."""
    habit = knows.usual(agent, moment.time)
    name = knows.name_of(agent)
    if habit is not None:
        place = knows.public_map.place_by_id[habit.place]
        return [sentences.say("usual_way" if habit.travels else "usual", person=name, place=place.name)]
    home = knows.home_of(agent) if alone else None
    return [] if home is None else [sentences.say("lives", person=name, place=home.name)]


def _answer_place(
    place: PublicPlace, question: Question, knows: Knowledge, moment: Moment, sentences: Sentences
) -> str:
    there = place.position[0], place.position[1]
    if moment.place == place.id or (not moment.place and math.dist(there, moment.position) < _AT_PLACE):
        return sentences.say("here", place=place.name)
    where = sentences.say("place", place=place.name, **_direction_fields(there, moment, sentences))
    if question.kind == "where":
        return where
    way = describe_way(knows.public_map, moment.position, place, sentences)
    if way is None:
        return f"{where} {sentences.say('no_way', place=place.name)}"
    return f"{where} {sentences.say('way', place=place.name, steps=way[0], metres=round_distance(way[1]))}"


def _direction_fields(point: tuple[float, float], moment: Moment, sentences: Sentences) -> dict[str, str | int]:
    east, north = point[0] - moment.position[0], point[1] - moment.position[1]
    return {"metres": round_distance(math.hypot(east, north)), "direction": sentences.direction(east, north)}


def _answer_did(knows: Knowledge, sentences: Sentences) -> str:
    said = []
    for visit, stay, place in knows.visits():
        activity = activity_of(stay.activity).about
        if visit.until is None:
            said.append(sentences.say("since", place=place.name, time=_clock_text(visit.since), activity=activity))
        elif visit.until - visit.since >= _WORTH_TELLING:
            times = {"time": _clock_text(visit.since), "until": _clock_text(visit.until)}
            said.append(sentences.say("did", place=place.name, activity=activity, **times))
    return " ".join(said[-MOST_TOLD:]) or sentences.say("did_nothing")


def _answer_plans(knows: Knowledge, moment: Moment, sentences: Sentences) -> str:
    said = [
        sentences.say(
            "plan",
            place=place.name,
            time=_clock_text(stay.due),
            until=_clock_text(end),
            activity=activity_of(stay.activity).about,
        )
        for stay, end, place in knows.plans(moment.time)[:MOST_TOLD]
    ]
    return " ".join(said) or sentences.say("no_plans")


def _answer_who(knows: Knowledge, sentences: Sentences) -> str:
    work = vocation_of(knows.me.occupation)
    if not work:
        return sentences.say("who_only", person=knows.me.name)
    return sentences.say("who", person=knows.me.name, occupation=work)


def _clock_text(time: float) -> str:
    return clock_of(int(time % DAY))[:5]


#: A question to nobody in particular is answered by the resident that stands nearest, within so many metres.
CONVERSATION_DISTANCE = 5.0
#: So many questions of one speaker are answered within so many seconds; then one has to go on.
PATIENCE, PATIENCE_FOR = 8, 600.0
# Answers carry this far, metres.
HEARING_RANGE = 8.0


class Talk(Protocol):
    """How a resident answers."""

    def reply(self, heard: HeardMessage, question: Question | None, knows: Knowledge, moment: Moment) -> str | None:
        """Return an answer to what was said to one; None leaves it to small talk.

        Parameters
        ----------
        question
            What is asked, if the grammar knows it.
        """


class TemplateTalk:
    """Answers questions of the grammar in the sentences of ``answers.toml``."""

    def reply(self, heard: HeardMessage, question: Question | None, knows: Knowledge, moment: Moment) -> str | None:
        """Return the answer; None for what is no question that the grammar knows."""
        return None if question is None else answer_to(question, knows, moment)


class Talker:
    """Remembers what a resident sees and hears, and answers what it is asked.

    Parameters
    ----------
    knows
        What the resident knows.
    talk
        How it answers.
    """

    def __init__(self, knows: Knowledge, talk: Talk | None = None) -> None:
        self.knows = knows
        self._talk: Talk = talk or TemplateTalk()
        self._names = [name.lower() for name in knows.me.names]
        # By speaker: how many questions were answered since when.
        self._answered: dict[str, tuple[int, float]] = {}

    def state(self) -> AgentState:
        """Return what it remembers."""
        answered = {speaker: [count, since] for speaker, (count, since) in self._answered.items()}
        return {"memory": self.knows.memory.state(), "answered": answered}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Remember what `state` returned."""
        self.knows.memory.restore(state["memory"])
        self._answered = {str(who): (int(count), float(since)) for who, (count, since) in state["answered"].items()}

    def notice(self, observation: Observation, info: Info) -> None:
        """Remember what is seen and heard; to be called whenever the resident is asked what it does."""
        self.knows.memory.look(observation, info)
        if observation["events"]:
            self.knows.memory.listen(observation)

    def reply(self, observation: Observation, moment: Moment) -> tuple[str, str] | None:
        """Return who is answered and what one says; None where nothing was asked of one."""
        for message in observation["events"]:
            said = self._reply(message, moment)
            if said is not None:
                return str(message["speaker"]), said
        return None

    def _reply(self, message: Mapping[str, Any], moment: Moment) -> str | None:
        text, speaker = str(message["text"]), str(message["speaker"])
        question = read_grammar().question_in(text, names=self.knows.me.names)
        if not self._is_meant(text, question, message, moment):
            return None
        count, since = self._answered.get(speaker, (0, moment.time))
        if moment.time - since > PATIENCE_FOR:
            count, since = 0, moment.time
        if count > PATIENCE:
            return None
        if count == PATIENCE:
            said: str | None = read_sentences().say("busy")
        else:
            heard = HeardMessage(float(message["time"]), speaker, text)
            said = self._talk.reply(heard, question, self.knows, moment)
        if said is not None:
            self._answered.pop(speaker, None)
            self._answered[speaker] = count + 1, since
        return said

    def _is_meant(self, text: str, question: Question | None, message: Mapping[str, Any], moment: Moment) -> bool:
        """Whether one is asked: by name, for oneself, or because one stands nearest to who asks nobody by name."""
        me = self.knows.me
        if question is None:
            called = "?" in text and is_called(me.name, text, gender=me.gender)
            return called and not self._calls_another(message, moment)
        if question.what and self.knows.is_me(question.what):
            return True
        if question.to.lower() in self._names:
            return not self._calls_another(message, moment)
        return not question.to and self._stands_nearest(message, moment)

    def _calls_another(self, message: Mapping[str, Any], moment: Moment) -> bool:
        """Whether another of the same name is meant, who stands nearer to who speaks."""
        bodies = () if moment.view is None else moment.view.within(2 * HEARING_RANGE)
        return calls_somebody_nearer(message, moment.stands, bodies, self.knows.name_and_gender)

    def _stands_nearest(self, message: Mapping[str, Any], moment: Moment) -> bool:
        if moment.view is None:
            return False
        x, y = (float(value) for value in message["position"][:2])
        away = math.hypot(x - moment.stands[0], y - moment.stands[1])
        if away > CONVERSATION_DISTANCE:
            return False
        others = (body for body in moment.view.within(2 * CONVERSATION_DISTANCE) if body.kind == "resident")
        return not any(
            body.agent != message["speaker"] and math.hypot(x - body.position[0], y - body.position[1]) < away
            for body in others
        )
