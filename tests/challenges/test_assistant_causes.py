"""Every cause of failure, reached by an episode that is told step by step."""

from __future__ import annotations

from collections.abc import Callable

import pytest

import toy_city
from assistant_by_hand import (
    CAFE,
    CAFE_TABLE,
    CLEO,
    FAR,
    GREEN,
    IN_CAFE,
    IN_SHOP,
    OUTDOORS,
    SHOP,
    WHO,
    Story,
    entity_of,
    subtask,
    task,
)
from vico.challenges.assistant.evaluate import CAUSES
from vico.world.world import World

RED = "red helmet"
WALK = {"type": "move_forward", "distance": 2.0}
TURN = {"type": "turn_left", "degrees": 88.0}
PICK = {"type": "pick", "hand": 0, "object": entity_of(RED)}
SPEAK = {"type": "communicate", "text": "Hello Cleo!"}
LONG = 200


@pytest.fixture(scope="module")
def city() -> World:
    return toy_city.world()


def delivery(city: World) -> Story:
    return Story(task("delivery", [subtask([SHOP], OUTDOORS)], city, steps=LONG), city)


def search(city: World) -> Story:
    return Story(task("search", [subtask([SHOP], None)], city, steps=LONG), city)


def carry(city: World) -> Story:
    return Story(task("carry", [subtask([OUTDOORS, SHOP], CAFE)], city, steps=LONG), city)


def go(story: Story, at: tuple[float, float, float], room: str | None = None) -> None:
    """Have the assistant somewhere else, which takes a step."""
    story.truth.put(WHO, at, room)
    story.step(WALK)


def walk_about(story: Story, *, until: int = LONG) -> None:
    """Have the assistant walk from here to there, far from everything, to the end."""
    while story.number < until:
        story.truth.put(WHO, (FAR[0] + 3.0 * (story.number % 5), FAR[1], 0.0))
        story.step(WALK)


def idles_far_away(story: Story) -> None:
    story.step(times=LONG)


def walks_to_the_end(story: Story) -> None:
    walk_about(story)


def pushes_against_a_wall(story: Story) -> None:
    story.step(WALK, times=LONG)


def looks_through_the_source_in_vain(story: Story) -> None:
    go(story, IN_SHOP, "r_shop")
    story.step(TURN, times=5)
    walk_about(story)


def is_in_the_source_at_the_end(story: Story) -> None:
    walk_about(story, until=LONG - 3)
    go(story, IN_SHOP, "r_shop")
    story.step(TURN, times=2)


def reports_what_was_not_seen(story: Story) -> None:
    go(story, IN_SHOP, "r_shop")
    story.report()


def sees_it_and_goes_on(story: Story) -> None:
    go(story, (6.0, 11.0, toy_city.FLOOR), "r_shop")
    story.step(TURN, sees={RED: 20})
    walk_about(story)


def sees_it_just_before_the_end(story: Story) -> None:
    walk_about(story, until=LONG - 3)
    go(story, (6.0, 11.0, toy_city.FLOOR), "r_shop")
    story.step(TURN, sees={RED: 20})


def is_refused(story: Story) -> None:
    go(story, (6.0, 11.0, toy_city.FLOOR), "r_shop")
    story.step(PICK, sees={RED: 40}, status="refused")
    walk_about(story)


def takes_it(story: Story) -> None:
    go(story, IN_SHOP, "r_shop")
    story.step(PICK, status="refused")
    story.truth.holders[RED] = WHO
    story.step(PICK)


def carries_it_to_the_end(story: Story) -> None:
    takes_it(story)
    walk_about(story)


def reports_with_it_in_hand(story: Story) -> None:
    takes_it(story)
    story.report()


def puts_it_down_on_the_way(story: Story) -> None:
    takes_it(story)
    story.truth.put(RED, FAR)
    story.step({"type": "put", "hand": 0})
    walk_about(story)


def puts_it_down_a_little_off(story: Story) -> None:
    takes_it(story)
    story.truth.put(RED, (GREEN[0] + 3.5, GREEN[1], GREEN[2]))
    story.step({"type": "put", "hand": 0})
    story.report()


@pytest.mark.parametrize(
    ("happens", "cause"),
    [
        (idles_far_away, "never got there"),
        (walks_to_the_end, "out of time"),
        (pushes_against_a_wall, "blocked"),
        (looks_through_the_source_in_vain, "not seen"),
        (is_in_the_source_at_the_end, "out of time"),
        (reports_what_was_not_seen, "not seen"),
        (sees_it_and_goes_on, "not recognised"),
        (sees_it_just_before_the_end, "out of time"),
        (is_refused, "refused pick"),
        (carries_it_to_the_end, "out of time"),
        (reports_with_it_in_hand, "wrong place"),
        (puts_it_down_on_the_way, "dropped"),
        (puts_it_down_a_little_off, "wrong place"),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_why_a_delivery_failed(city: World, happens: Callable[[Story], None], cause: str) -> None:
    story = delivery(city)
    happens(story)
    assert story.cause() == cause


@pytest.mark.parametrize(
    ("happens", "cause"),
    [
        (idles_far_away, "never got there"),
        (walks_to_the_end, "out of time"),
        (pushes_against_a_wall, "blocked"),
        (looks_through_the_source_in_vain, "not seen"),
        (is_in_the_source_at_the_end, "out of time"),
        (reports_what_was_not_seen, "wrong place"),
        (sees_it_and_goes_on, "not recognised"),
        (sees_it_just_before_the_end, "out of time"),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_why_a_search_failed(city: World, happens: Callable[[Story], None], cause: str) -> None:
    story = search(city)
    happens(story)
    assert story.cause() == cause


def comes_to_the_haunt_in_vain(story: Story) -> None:
    go(story, GREEN)
    walk_about(story)


def sees_the_person_and_goes_on(story: Story) -> None:
    story.truth.put(CLEO.agent, GREEN)
    go(story, GREEN)
    story.step(TURN, sees={CLEO.agent: 50})
    walk_about(story)


def speaks_and_is_handed_nothing(story: Story) -> None:
    story.truth.put(CLEO.agent, GREEN)
    go(story, GREEN)
    story.step(SPEAK, sees={CLEO.agent: 50})
    walk_about(story)


def is_handed_it(story: Story) -> None:
    story.truth.put(CLEO.agent, GREEN)
    go(story, GREEN)
    story.step(SPEAK, sees={CLEO.agent: 50})
    story.truth.holders[RED] = WHO
    story.step()


def follows_to_the_end(story: Story) -> None:
    is_handed_it(story)
    walk_about(story)


def gives_up_the_person(story: Story) -> None:
    is_handed_it(story)
    story.step(times=LONG)


def comes_home_with_it_in_hand_at_the_end(story: Story) -> None:
    is_handed_it(story)
    story.truth.put(CLEO.agent, IN_CAFE, "r_cafe")
    walk_about(story)


def puts_it_down_far_from_home(story: Story) -> None:
    is_handed_it(story)
    story.truth.put(RED, FAR)
    story.step({"type": "put", "hand": 0})
    story.truth.put(CLEO.agent, IN_CAFE, "r_cafe")
    walk_about(story)


@pytest.mark.parametrize(
    ("happens", "cause"),
    [
        (idles_far_away, "never got there"),
        (walks_to_the_end, "out of time"),
        (pushes_against_a_wall, "blocked"),
        (comes_to_the_haunt_in_vain, "not seen"),
        (sees_the_person_and_goes_on, "not recognised"),
        (speaks_and_is_handed_nothing, "person lost"),
        (follows_to_the_end, "out of time"),
        (gives_up_the_person, "person lost"),
        (comes_home_with_it_in_hand_at_the_end, "out of time"),
        (puts_it_down_far_from_home, "dropped"),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_why_carrying_failed(city: World, happens: Callable[[Story], None], cause: str) -> None:
    story = carry(city)
    happens(story)
    assert story.cause() == cause


def test_one_of_two_things_is_a_person_lost(city: World) -> None:
    story = Story(task("carry", [subtask([OUTDOORS], CAFE, objects=["object_0", "object_1"])], city), city)
    story.truth.holders["blue helmet"] = CLEO.agent
    is_handed_it(story)
    walk_about(story)
    assert story.cause() == "person lost"


def test_beside_the_wrong_surface_is_the_wrong_place(city: World) -> None:
    story = Story(task("delivery", [subtask([SHOP], CAFE_TABLE)], city, advanced=True), city)
    takes_it(story)
    story.truth.put(RED, (0.0, 11.0, toy_city.FLOOR), "r_back")
    story.step({"type": "put", "hand": 0})
    story.report()
    assert story.cause() == "wrong place"


def test_what_is_seen_from_afar_is_not_seen(city: World) -> None:
    story = search(city)
    story.truth.put(RED, GREEN)
    go(story, (GREEN[0] + 10.5, GREEN[1], 0.0))
    story.step(TURN, sees={RED: 300})
    assert story.chronicle.stories[0].seen == {}
    go(story, (GREEN[0] + 9.5, GREEN[1], 0.0))
    story.step(TURN, sees={RED: 19})
    assert story.chronicle.stories[0].seen == {}
    story.step(TURN, sees={RED: 20})
    assert story.chronicle.stories[0].seen == {RED: story.number}


def test_the_tests_above_reach_every_cause() -> None:
    reached = {
        cause
        for test in (test_why_a_delivery_failed, test_why_a_search_failed, test_why_carrying_failed)
        for mark in test.pytestmark  # type: ignore[attr-defined]
        for _, cause in mark.args[1]
    }
    assert reached == set(CAUSES)
