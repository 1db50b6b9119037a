"""Answers to questions, from what a resident knows, in the sentences of ``vico/data/talk/answers.toml``."""

from __future__ import annotations

import math

from vico.agents.talk.directions import rounded, way_in_words
from vico.agents.talk.facts import Knowledge, Moment
from vico.agents.talk.grammar import Question
from vico.agents.talk.memory import SeenPerson
from vico.agents.talk.phrases import activity_of, vocation_of
from vico.agents.talk.sentences import Sentences, read_sentences
from vico.clock import DAY, clock_of
from vico.world.public import PublicPlace

# Most visits and plans that one tells of at a time; shorter visits are not worth it, seconds.
MOST_TOLD, _WORTH_TELLING = 4, 60.0
# Who stands so near a place is there already, metres.
_THERE = 3.0


def answer_to(question: Question, knows: Knowledge, moment: Moment) -> str:
    """Answer a question truly: from sight, acquaintance, hearsay, the map where one knows it, and one's own day.

    Returns
    -------
    str
        One or several sentences.
    """
    sentences = read_sentences()
    if question.kind in ("seen", "where", "way"):
        return _about(question, knows, moment, sentences)
    if question.kind == "doing":
        return sentences.say("doing", errand=moment.errand())
    if question.kind == "did":
        return _did(knows, sentences)
    if question.kind == "plans":
        return _plans(knows, moment, sentences)
    return _who(knows, sentences)


def _about(question: Question, knows: Knowledge, moment: Moment, sentences: Sentences) -> str:
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
    return _place(place, question, knows, moment, sentences)


def about_person(agent: str, knows: Knowledge, moment: Moment) -> str:
    """Say where somebody is: in view; or where they were seen or said to be last, and usually are now."""
    sentences, name = read_sentences(), knows.name_of(agent)
    there = knows.in_view(agent, moment)
    if there is not None:
        return sentences.say("see", person=name, **_towards(there, moment, sentences))
    said = []
    seen, told = knows.seen(agent), knows.hearsay(name)
    if seen is not None:
        said.append(_saw(seen, name, knows, sentences))
    if told is not None and told.claim.time is not None and (seen is None or told.claim.time > seen.time % DAY):
        source, at = knows.name_of(told.heard.speaker), _clock(told.claim.time)
        said.append(sentences.say("told", source=source, person=name, place=told.place.name, time=at))
    said += _usually(agent, knows, moment, sentences, alone=not said)
    return " ".join(said) or sentences.say("not_seen", person=name)


def _saw(seen: SeenPerson, name: str, knows: Knowledge, sentences: Sentences) -> str:
    place = knows.public_map.place_by_id.get(seen.place)
    if place is not None:
        return sentences.say("saw_in", person=name, place=place.name, time=_clock(seen.time))
    near = knows.beside(seen.x, seen.y)
    if near is not None:
        return sentences.say("saw_near", person=name, place=near.name, time=_clock(seen.time))
    return sentences.say("saw_away", person=name, time=_clock(seen.time))


def _usually(agent: str, knows: Knowledge, moment: Moment, sentences: Sentences, *, alone: bool) -> list[str]:
    """Say where somebody usually is now; else, if there is nothing else to say, where they live."""
    habit = knows.usual(agent, moment.time)
    name = knows.name_of(agent)
    if habit is not None:
        place = knows.public_map.place_by_id[habit.place]
        return [sentences.say("usual_way" if habit.travels else "usual", person=name, place=place.name)]
    home = knows.home_of(agent) if alone else None
    return [] if home is None else [sentences.say("lives", person=name, place=home.name)]


def _place(place: PublicPlace, question: Question, knows: Knowledge, moment: Moment, sentences: Sentences) -> str:
    there = place.position[0], place.position[1]
    if moment.place == place.id or (not moment.place and math.dist(there, moment.position) < _THERE):
        return sentences.say("here", place=place.name)
    where = sentences.say("place", place=place.name, **_towards(there, moment, sentences))
    if question.kind == "where":
        return where
    way = way_in_words(knows.public_map, moment.position, place, sentences)
    if way is None:
        return f"{where} {sentences.say('no_way', place=place.name)}"
    return f"{where} {sentences.say('way', place=place.name, steps=way[0], metres=rounded(way[1]))}"


def _towards(point: tuple[float, float], moment: Moment, sentences: Sentences) -> dict[str, str | int]:
    east, north = point[0] - moment.position[0], point[1] - moment.position[1]
    return {"metres": rounded(math.hypot(east, north)), "direction": sentences.direction(east, north)}


def _did(knows: Knowledge, sentences: Sentences) -> str:
    said = []
    for visit, stay, place in knows.visits():
        activity = activity_of(stay.activity).about
        if visit.until is None:
            said.append(sentences.say("since", place=place.name, time=_clock(visit.since), activity=activity))
        elif visit.until - visit.since >= _WORTH_TELLING:
            times = {"time": _clock(visit.since), "until": _clock(visit.until)}
            said.append(sentences.say("did", place=place.name, activity=activity, **times))
    return " ".join(said[-MOST_TOLD:]) or sentences.say("did_nothing")


def _plans(knows: Knowledge, moment: Moment, sentences: Sentences) -> str:
    said = [
        sentences.say(
            "plan",
            place=place.name,
            time=_clock(stay.due),
            until=_clock(end),
            activity=activity_of(stay.activity).about,
        )
        for stay, end, place in knows.plans(moment.time)[:MOST_TOLD]
    ]
    return " ".join(said) or sentences.say("no_plans")


def _who(knows: Knowledge, sentences: Sentences) -> str:
    work = vocation_of(knows.me.occupation)
    if not work:
        return sentences.say("who_only", person=knows.me.name)
    return sentences.say("who", person=knows.me.name, occupation=work)


def _clock(time: float) -> str:
    return clock_of(int(time % DAY))[:5]


__all__ = ["MOST_TOLD", "about_person", "answer_to"]
