"""A scripted server that answers what the community's author asks, as a good model would, from what the prompt gives.

It shows that the path works. What it writes says nothing of any model.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from typing import Any

from http_server import Answer, Request
from llm_server import refuses, says

_DATA = re.compile(r'<data name="(\w+)">\n(.*?)\n</data>', re.DOTALL)
_LETTERS = "abcdefghijklmnopqrst"

#: Sees what is asked for (name of the record, data, body), and may answer instead of the script; None leaves it to it.
Twist = Callable[[str, dict[str, Any], dict[str, Any]], Answer | str | None]


def data_of(body: dict[str, Any]) -> dict[str, Any]:
    """What stands as data in the question (not in findings on it), by name."""
    return {name: json.loads(text) for name, text in _DATA.findall(body["messages"][1]["content"])}


class ScriptedAuthor:
    """A server's handler; `asked` keeps the bodies of all requests."""

    def __init__(self, twist: Twist | None = None) -> None:
        self.twist = twist
        self.asked: list[dict[str, Any]] = []

    def __call__(self, request: Request) -> Answer:
        body = json.loads(request.body)
        self.asked.append(body)
        record, data = _record_of(body), data_of(body)
        twisted = None if self.twist is None else self.twist(record, data, body)
        if twisted is not None:
            return says(twisted) if isinstance(twisted, str) else twisted
        writers = {"Characters": characters, "SocialNetwork": network, "DayPlan": day_plan}
        if record not in writers:
            return refuses(400, f"no such record: {record}")
        return says(json.dumps(writers[record](data), ensure_ascii=False))


def _record_of(body: dict[str, Any]) -> str:
    """The name of the record that is asked for: by its schema, or in words where a server refused that."""
    if "response_format" in body:
        return str(body["response_format"]["json_schema"]["name"])
    words = body["messages"][-1]["content"]
    return next(name for name in ("Characters", "SocialNetwork", "DayPlan") if f'"title":"{name}"' in words)


def in_letters(identifier: str) -> str:
    """A resident's number as letters, for a name."""
    return "".join(_LETTERS[int(digit)] for digit in identifier.rpartition("_")[2])


def characters(data: dict[str, Any]) -> dict[str, Any]:
    """People of a household: who may choose works at the first place that employs somebody, or is retired."""
    found = []
    offers = [place for place in data["workplaces"] if place["employs"]]
    for k, person in enumerate(data["people"]):
        settled = person["settled"]
        if settled is not None:
            occupation, workplace = settled["occupation"], settled["workplace"]
        elif person["age"] >= 63 or not offers:
            occupation, workplace = "retired lighthouse keeper", None
        else:
            place = offers[(len(offers) // 2 + k) % len(offers)]
            occupation, workplace = place["employs"][0].replace("...", "design"), place["name"]
        name = f"{'Ada' if person['gender'] == 'female' else 'Ode'} Script{in_letters(person['id'])}"
        where = f" at {workplace}" if workplace else ""
        found.append(
            {
                "id": person["id"],
                "name": name,
                "occupation": occupation,
                "workplace": workplace,
                "values": ["benevolence", "self-direction", "security"],
                "personality": {
                    "openness": 70, "conscientiousness": 50, "extraversion": 40, "agreeableness": 80,
                    "neuroticism": 20, "traits": ["patient", "wry"],
                },
                "hobbies": ["kite repair", "street maps"],
                "lifestyle": "Walks where others ride, and knows every bench.",
                "biography": f"{name}, {person['age']}, is {occupation}{where}. Kites fill the hall cupboard.",
            }
        )  # fmt: skip
    return {"characters": found}


def network(data: dict[str, Any]) -> dict[str, Any]:
    """Groups of four by the order of people, of late workers in the morning, at places that are open then; no ties.

    A late worker who is the only one meets somebody in the morning who is at no workplace.
    """
    late = [p["id"] for p in data["people"] if p["at_work"] and p["at_work"][-5:] > "19:00"]
    people = [p["id"] for p in data["people"] if p["id"] not in late]
    idle = [p["id"] for p in data["people"] if not p["at_work"]]
    if len(late) == 1 and len(people) > 2 and idle:
        people.remove(idle[-1])
        late.append(idle[-1])
    if len(late) == 1 or len(people) == 1:
        people, late = people + late, []
    found = [*_groups(data, people, 19 * 60 + 30), *_groups(data, late, 10 * 60)]
    return {"groups": found, "ties": []}


def _groups(data: dict[str, Any], people: list[str], start: int) -> list[dict[str, Any]]:
    places = [p for p in data["places"] if any(_covers(p, start, start + 60))] or data["places"]
    parts = [people[k : k + 4] for k in range(0, len(people), 4)]
    if len(parts) > 1 and len(parts[-1]) == 1:
        last = parts.pop()
        parts[-1] += last
    return [
        {
            "name": f"Kite menders {in_letters(members[0])}",
            "description": "They mend kites and tell each other where the wind was.",
            "activity": "Mend kites",
            "place": places[k % len(places)]["name"],
            "members": members,
            "start_time": _clock(start),
            "end_time": _clock(start + 60),
        }
        for k, members in enumerate(parts)
    ]


def _covers(place: dict[str, Any], start: int, end: int) -> list[bool]:
    spans = re.findall(r"(\d\d):(\d\d)-(\d\d):(\d\d)", place["open"])
    return [int(a) * 60 + int(b) <= start and end <= int(c) * 60 + int(d) for a, b, c, d in spans]


def day_plan(data: dict[str, Any]) -> dict[str, Any]:
    """Sleep, breakfast, work while it is open, what stands, and home."""
    who = data["character"]
    places = {place["name"]: place for place in data["places"]}
    fixed = sorted(
        (_minute(a["start_time"]), _minute(a["end_time"]), "main", a["activity"], a["place"])
        for a in data["appointments"]
    )
    stays = list(fixed)
    if who["workplace"] is not None and not any(stay[4] == who["workplace"] for stay in fixed):
        spans = re.findall(r"(\d\d):(\d\d)-(\d\d):(\d\d)", places[who["workplace"]]["open"])
        hours = [tuple(map(int, span)) for span in spans] or [(9, 0, 17, 0)]
        a, b, c, d = max(hours, key=lambda h: h[2] * 60 + h[3] - h[0] * 60 - h[1])
        start = max(a * 60 + b, 9 * 60)
        end = min(c * 60 + d, start + 8 * 60, 22 * 60)
        for low, high in _free(start, end, [(f[0] - 45, f[1] + 45) for f in fixed]):
            stays.append((low, high, "main", f"Be {who['occupation']}", who["workplace"]))
    return {"schedule": _line(sorted(stays), who["home"], places)}


def _free(start: int, end: int, taken: list[tuple[int, int]]) -> list[tuple[int, int]]:
    found, at = [], start
    for low, high in sorted(taken):
        if low - at >= 60:
            found.append((at, min(low, end)))
        at = max(at, high)
    return [(a, b) for a, b in [*found, (at, end)] if b - a >= 60]


def _line(stays: list[tuple[int, int, str, str, str]], home: str, places: dict[str, Any]) -> list[dict[str, Any]]:
    items: list[dict[str, Any]] = []
    at = 0

    def add(kind: str, start: int, end: int, words: str, place: str | None) -> None:
        building = places[place]["building"] if place is not None else None
        items.append(
            {"type": kind, "activity": words, "place": place, "building": building,
             "start_time": _clock(start), "end_time": _clock(end)}
        )  # fmt: skip

    here = home
    for start, end, kind, words, place in stays:
        way = 0 if place == here else max(3, int((places[place]["minutes_on_foot_from_home"] or 0) * 0.8))
        if here == home and at < 7 * 60:
            add("sleep", 0, 6 * 60 + 30, "Sleep on the left side", home)
            at = 6 * 60 + 30
            if start - way - at >= 20:
                add("meal", at, start - way, "Eat porridge at the window", home)
                at = start - way
            else:
                items[-1]["end_time"] = _clock(start - way)
                at = start - way
        elif here != home and start - at > 60:
            back = max(3, places[here]["minutes_on_foot_from_home"] or 0)
            add("commute", at, at + back, "Go home", None)
            add("main", at + back, start - way, "Sort kite paper", home)
            at, here = start - way, home
        elif start - way > at:
            items[-1]["end_time"] = _clock(start - way)
            at = start - way
        if way:
            add("commute", at, start, f"Go to {place}", None)
        add(kind, start, end, words, place)
        at, here = end, place
    if not items:
        add("sleep", 0, 7 * 60, "Sleep on the left side", home)
        at = 7 * 60
    if here != home:
        way = max(3, places[here]["minutes_on_foot_from_home"] or 0)
        add("commute", at, at + way, "Go home", None)
        at += way
    if at < 22 * 60:
        add("main", at, 22 * 60 + 30, "Paint a kite", home)
        at = 22 * 60 + 30
    add("sleep", at, 24 * 60, "Sleep on the left side", home)
    return items


def _minute(clock: str) -> int:
    return 24 * 60 if clock == "23:59:59" else int(clock[:2]) * 60 + int(clock[3:5])


def _clock(minute: int) -> str:
    return "23:59:59" if minute >= 24 * 60 else f"{minute // 60:02d}:{minute % 60:02d}:00"
