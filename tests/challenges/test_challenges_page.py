"""The page on challenges says what the code does: thresholds, causes, methods, instructions and automata."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import toy_city
from assistant_by_hand import CAFE_TABLE, SHOP, subtask, task
from command_line import script
from vico.challenges.assistant import tasks as t
from vico.challenges.assistant.challenge import ASSISTANT
from vico.challenges.assistant.evaluate import CAUSES

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "challenges.md").read_text(encoding="utf-8")


def section(title: str) -> str:
    return PAGE.split(f"## {title}\n", 1)[1].split("\n## ", 1)[0]


def first_column(text: str) -> list[str]:
    return re.findall(r"^\| `([^`]+)` \|", text, re.MULTILINE)


def test_the_automata_are_drawn_as_they_are() -> None:
    done = script(ROOT / "scripts" / "draw_automata.py", "--check")
    assert (done.returncode, done.stdout) == (0, ""), done.stdout + done.stderr


def test_thresholds_are_those_of_the_code() -> None:
    usual, hard = t.STANDARD, t.ADVANCED
    people, same = t.RESIDENTS, "the same"
    rows = [
        ("subtasks, steps of an episode", f"{t.SUBTASKS}, {t.STEPS}", same),
        ("residents: Carry, Delivery, Search", f"{people['carry']}, {people['delivery']}, {people['search']}", same),
        ("Delivery outdoors: from the spot", f"{usual.destination_radius:g} m", f"{hard.destination_radius:g} m"),
        ("Carry: from the home's entrance, or inside", f"{usual.home_radius:g} m", f"{hard.home_radius:g} m"),
        ("indoors: from the surface that is named, over the ground", "anywhere in the place",
         f"{hard.surface_distance:g} m"),
        ("Search: pixels, distance", f"{usual.search_pixels}, {usual.search_distance:g} m",
         f"{hard.search_pixels}, {hard.search_distance:g} m"),
        ("source regions: Delivery and Search, Carry", f"{usual.regions}, {t.FREQUENTED_PLACES * usual.regions}",
         f"{hard.regions}, {t.FREQUENTED_PLACES * hard.regions}"),
        ("walk from the start, at most: Delivery and Search, Carry", f"{t.REACH:g} m, {t.CARRY_REACH:g} m", same),
        ("radius of regions outdoors: Delivery and Carry, Search", f"{t.SOURCE_RADIUS:g} m, {t.SEARCH_RADIUS:g} m",
         same),
        ("a destination lies from its source, at least", f"{t.APART:g} m", same),
        ("a thing lies from the middle of any region told, at least", f"{t.OFF_MIDDLE:g} m", same),
        ("followed: from the person, at most", f"{t.FOLLOW_DISTANCE:g} m", same),
        ("a message to who wants help carries", f"{t.CALL_DISTANCE:g} m", same),
        ("they hand over within, and wait for", f"{t.HAND_OVER_DISTANCE:g} m, {t.WAITS_FOR:g} s", same),
    ]  # fmt: skip
    table = PAGE.split("<!-- thresholds -->\n", 1)[1].split("\n<!-- /thresholds -->", 1)[0].splitlines()[2:]
    assert table == [f"| {what} | {standard} | {advanced} |" for what, standard, advanced in rows]


def test_causes_methods_and_fields_are_those_of_the_code() -> None:
    assert first_column(section("Why subtasks fail")) == list(CAUSES)
    assert set(ASSISTANT.methods) - {"llm"} <= set(first_column(section("Methods")))
    city = toy_city.world()
    (told,) = task("delivery", [subtask([SHOP], CAFE_TABLE)], city).instructions()
    page = section("Instructions of assistants")
    assert first_column(page) == list(told)
    assert all(f"`{field}`" in page for field in (*told["sources"][0], *told["destination"]["surface"]))


@pytest.mark.parametrize("category", ["carry", "delivery", "search"])
def test_metrics_are_those_of_the_code(category: str) -> None:
    page = section("Metrics")
    assert all(f"| {metric.label} |" in page for metric in ASSISTANT.metrics(category))
