"""Assistant tasks drawn from a real neighbourhood and the people who live there."""

from __future__ import annotations

import json

import numpy as np
import pytest

import toy_city
from assistant_by_hand import Truth
from vico.agents.assistant import METHODS
from vico.agents.talk.acquaintance import first_name
from vico.assets.models.movable import movable_colours, movable_kinds
from vico.challenges.assistant.evaluate import is_carried_home, is_delivered
from vico.challenges.assistant.generate import generate_task
from vico.challenges.assistant.tasks import (
    APART,
    CANDIDATES,
    CARRY_REACH,
    CATEGORIES,
    FREQUENTED_PLACES,
    OFF_MIDDLE,
    REACH,
    RESIDENTS,
    SEARCH_RADIUS,
    SOURCE_RADIUS,
    SUBTASKS,
    Category,
    Region,
    Subtask,
    Task,
    thresholds,
)
from vico.clock import seconds_of_day
from vico.community import build_community
from vico.community.model import Community
from vico.errors import EmptyInputError
from vico.world.world import World

Made = dict[tuple[Category, bool], Task]


@pytest.fixture(scope="module")
def people(helsinki: World) -> Community:
    """As many as Carry asks for; the other categories do with them, too."""
    return build_community(helsinki, residents=RESIDENTS["carry"], seed=0)


@pytest.fixture(scope="module")
def tasks(helsinki: World, people: Community) -> Made:
    """A task of each category in each setting."""
    return {
        (category, advanced): generate_task(helsinki, people, category, seed=1, advanced=advanced)
        for category in CATEGORIES
        for advanced in (False, True)
    }


def regions_of(subtask: Subtask) -> list[Region]:
    return [*subtask.sources, *([] if subtask.destination is None else [subtask.destination])]


def middles_of(task: Task) -> np.ndarray:
    return np.array([region.centre[:2] for subtask in task.subtasks for region in regions_of(subtask)])


@pytest.mark.parametrize("category", CATEGORIES)
def test_a_seed_is_a_task_and_a_second_assistant_changes_nothing_else(
    helsinki: World, people: Community, tasks: Made, category: Category
) -> None:
    task = tasks[category, False]
    two = generate_task(helsinki, people, category, seed=1, assistants=2)
    alone = two.model_copy(update={"assistants": two.assistants[:1]})
    assert alone.model_dump_json() == task.model_dump_json()  # the same bytes
    apart = np.hypot(*np.subtract(two.assistants[0].position, two.assistants[1].position))
    assert 0.0 < apart <= 6.0
    assert all(helsinki.walkable.is_connected(start.position) for start in two.assistants)


def test_another_seed_and_the_other_setting_are_other_tasks(helsinki: World, people: Community, tasks: Made) -> None:
    other = generate_task(helsinki, people, "search", seed=2)
    texts = {task.model_dump_json(exclude={"seed", "advanced"}) for task in (other, *tasks.values())}
    assert len(texts) == 1 + len(tasks)


def test_every_episode_has_six_subtasks_over_things_with_names_of_their_own(tasks: Made) -> None:
    for task in tasks.values():
        assert len(task.subtasks) == SUBTASKS
        assert len({thing.name for thing in task.objects}) == len(task.objects)
        assert sorted(i for s in task.subtasks for i in s.objects) == sorted(thing.id for thing in task.objects)
        assert all(thing.kind in movable_kinds() and thing.colour in movable_colours() for thing in task.objects)
        assert {len(s.objects) for s in task.subtasks} <= ({1} if task.category == "search" else {1, 2})


def test_choices_are_made_among_nine_or_as_many_as_there_are(tasks: Made) -> None:
    for task in tasks.values():
        kinds = {thing.id: thing.kind for thing in task.objects}
        for subtask in task.subtasks:
            assert len(subtask.candidates) == {"carry": 2, "delivery": 3, "search": 2}[task.category]
            assert all(1 <= len(names) <= CANDIDATES for names in subtask.candidates.values())
            (of_kinds,) = (
                names for names in subtask.candidates.values() if kinds[subtask.objects[0]] in names
            )  # fmt: skip
            assert len(set(of_kinds)) == CANDIDATES
            chosen = {kinds[i] for i in subtask.objects} | {subtask.person.name, *(r.name for r in regions_of(subtask))}
            assert all(chosen & set(names) for names in subtask.candidates.values())


def test_things_lie_inside_their_source_and_can_be_walked_to(helsinki: World, tasks: Made) -> None:
    for (category, _), task in tasks.items():
        things = {thing.id: thing for thing in task.objects}
        for subtask in task.subtasks if category != "carry" else []:
            source = subtask.true_source
            for thing in (things[i] for i in subtask.objects):
                assert thing.holder is None
                if source.kind == "outdoor":
                    assert thing.room is None
                    radius = SEARCH_RADIUS if category == "search" else SOURCE_RADIUS
                    assert np.hypot(*np.subtract(thing.position[:2], source.centre[:2])) <= radius == source.radius
                    assert helsinki.walkable.is_connected(thing.position[:2]), thing.name
                    continue
                assert thing.room is not None
                room = helsinki.room_by_id[thing.room]
                assert room.place == source.place
                c, s = np.cos(room.yaw), np.sin(room.yaw)
                x, y = np.subtract(thing.position[:2], room.centre[:2])
                assert (np.abs([c * x + s * y, c * y - s * x]) <= np.asarray(room.size[:2]) / 2).all()


@pytest.mark.parametrize("category", CATEGORIES)
def test_places_are_within_a_walk_of_the_start(helsinki: World, tasks: Made, category: Category) -> None:
    reach = CARRY_REACH if category == "carry" else REACH
    for task in (tasks[category, False], tasks[category, True]):
        field = helsinki.router.distance_field(np.asarray(task.assistants[0].position))
        walkable = helsinki.walkable
        for subtask in task.subtasks:
            for region in regions_of(subtask):
                ix, iy = np.clip(walkable.cell_of(np.asarray(region.centre[:2])), 0, walkable.n - 1)
                assert field[iy, ix] <= reach, region.name


def test_whoever_asks_knows_the_places(helsinki: World, people: Community, tasks: Made) -> None:
    for task in tasks.values():
        for subtask in task.subtasks:
            who = people.resident_by_id[subtask.person.agent]
            assert subtask.person.name == who.name
            known = {who.home, *who.known_places, *(item.place for item in who.schedule if item.place)}
            told = {region.place for region in regions_of(subtask) if region.place is not None}
            assert told <= known
            near = np.array([helsinki.place_by_id[place].position[:2] for place in known])
            for region in regions_of(subtask):
                if region.kind == "outdoor":
                    assert np.hypot(*(near - region.centre[:2]).T).min() <= 40.0


@pytest.mark.parametrize("category", CATEGORIES)
def test_the_advanced_setting_names_three_times_as_many_regions_and_surfaces(
    helsinki: World, tasks: Made, category: Category
) -> None:
    usual, advanced = tasks[category, False], tasks[category, True]
    base = FREQUENTED_PLACES if category == "carry" else 1
    assert {len(s.sources) for s in usual.subtasks} == {base}
    assert {len(s.sources) for s in advanced.subtasks} == {3 * base}
    assert all(region.surface is None for s in usual.subtasks for region in regions_of(s))
    indoors = [s.destination for s in advanced.subtasks if s.destination is not None and s.destination.place]
    assert indoors or category == "search"
    for region in indoors:
        if region.surface is None:  # a place with nothing but floors to put things on
            rooms = [room for room in helsinki.rooms if room.place == region.place]
            assert {one.kind for room in rooms for one in room.containers} <= {"floor"}
            continue
        room = helsinki.room_by_id[region.surface.room]
        assert room.place == region.place
        (surface,) = (one for one in room.containers if one.entity == region.surface.entity)
        assert surface.kind == region.surface.kind != "floor"
    for subtask in advanced.subtasks:
        centres = [region.centre for region in subtask.sources]
        # Shops of one house have one middle.
        assert len({(region.place, region.centre) for region in subtask.sources}) == len(centres)
        if category == "delivery":
            assert subtask.destination is not None
            assert subtask.destination.centre not in centres


def test_deliveries_go_somewhere_else(tasks: Made) -> None:
    for advanced in (False, True):
        for subtask in tasks["delivery", advanced].subtasks:
            assert subtask.destination is not None
            apart = np.hypot(*np.subtract(subtask.true_source.centre[:2], subtask.destination.centre[:2]))
            assert apart > APART


def test_carry_asks_for_six_people_who_are_out(helsinki: World, people: Community, tasks: Made) -> None:
    for advanced in (False, True):
        task = tasks["carry", advanced]
        assert len({subtask.person.agent for subtask in task.subtasks}) == SUBTASKS
        holders = {thing.id: thing.holder for thing in task.objects}
        now = seconds_of_day(task.start + ":00")
        for subtask in task.subtasks:
            who = people.resident_by_id[subtask.person.agent]
            assert subtask.destination is not None
            assert subtask.destination.place == who.home
            assert who.home not in {region.place for region in subtask.sources}
            assert {holders[i] for i in subtask.objects} == {who.id}
            assert subtask.person.looks in subtask.text
            # At the start, or on the way then, they are expected where the right source is.
            during = [i for i in who.schedule if seconds_of_day(i.start) < now + 750 and seconds_of_day(i.end) > now]
            assert during
            assert who.home not in {item.place for item in during}
            place = next(helsinki.place_by_id[item.place] for item in during if item.place)
            source = subtask.true_source
            near = np.hypot(*np.subtract(place.position[:2], source.centre[:2])) < 1.0
            assert source.place == place.id or (source.place is None and near)
            # So are the others that are told, as far as the day has some within reach.
            day = [helsinki.place_by_id[item.place] for item in who.schedule if item.place]
            told = [
                any(r.place == one.id or np.allclose(r.centre[:2], one.position[:2]) for one in day)
                for r in subtask.sources
            ]
            assert sum(told) >= min(2, len({one.id for one in day} - {who.home}))


def renamed(people: Community, names: dict[str, str]) -> Community:
    """Return a community some of whose people have other names, by id."""
    residents = [who.model_copy(update={"name": names[who.id]}) if who.id in names else who for who in people.residents]
    return people.model_copy(update={"residents": residents})


def asked_for(task: Task) -> list[str]:
    return [subtask.person.agent for subtask in task.subtasks]


def test_nobody_who_needs_a_hand_is_called_like_another(helsinki: World, people: Community, tasks: Made) -> None:
    before = tasks["carry", False]
    first, _, third = asked_for(before)[:3]
    called = people.resident_by_id[first].name.split()[0]
    task = generate_task(helsinki, renamed(people, {third: f"{called.upper()} Other"}), "carry", seed=1)
    assert third not in asked_for(task)
    assert asked_for(task)[:2] == asked_for(before)[:2]  # only from there on is anything drawn anew
    assert len({first_name(subtask.person.name) for subtask in task.subtasks}) == SUBTASKS


def test_names_change_no_task_in_which_nobody_is_called_like_another(
    helsinki: World, people: Community, tasks: Made
) -> None:
    before = tasks["carry", False]
    first, last = asked_for(before)[0], asked_for(before)[-1]
    candidates = before.subtasks[-1].candidates["Who needs a hand?"]
    other = next(who for who in people.residents if who.name in candidates and who.id not in asked_for(before))
    called = people.resident_by_id[first].name.split()[0]
    task = generate_task(helsinki, renamed(people, {other.id: f"{called} Other"}), "carry", seed=1)
    assert asked_for(task) == asked_for(before)
    assert last == asked_for(task)[-1]
    differs = {"community_digest": True, "subtasks": {"__all__": {"candidates"}}}
    assert task.model_dump(exclude=differs) == before.model_dump(exclude=differs)


def test_carry_needs_six_first_names(helsinki: World, people: Community) -> None:
    alike = renamed(people, {who.id: f"Kim {who.name.split()[-1]}" for who in people.residents})
    with pytest.raises(EmptyInputError, match=r"carry: at no time of day are 6 people out .*, 1 at most; use a larger"):
        generate_task(helsinki, alike, "carry", seed=1)
    # Six are enough, wherever they are drawn: all others are called like one of them.
    named = asked_for(generate_task(helsinki, people, "carry", seed=1))
    like = renamed(
        people, {who.id: f"Kim {who.name.split()[-1]}" for who in people.residents if who.id not in named[:-1]}
    )
    task = generate_task(helsinki, like, "carry", seed=1)
    assert len({first_name(subtask.person.name) for subtask in task.subtasks}) == SUBTASKS


def test_nothing_is_done_yet(helsinki: World, tasks: Made) -> None:
    for (category, advanced), task in tasks.items():
        truth, limits = Truth(helsinki), thresholds(advanced=advanced)
        names = {thing.id: thing.name for thing in task.objects}
        for thing in task.objects:
            truth.put(thing.name, thing.position, thing.room)
            if thing.holder is not None:
                truth.holders[thing.name] = thing.holder
        for subtask in task.subtasks if category != "search" else []:
            assert subtask.destination is not None
            rule = is_delivered if category == "delivery" else is_carried_home
            assert not any(rule(names[i], subtask.destination, truth, helsinki, limits) for i in subtask.objects)


def test_instructions_tell_no_position_of_any_thing(tasks: Made) -> None:
    for task in tasks.values():
        told = json.dumps(task.instructions())
        for thing in task.objects:
            if thing.holder is None:
                assert np.hypot(*(middles_of(task) - thing.position[:2]).T).min() >= OFF_MIDDLE
                assert "{}, {}".format(*thing.position[:2]) not in told
            rooms = {one.destination.surface.room for one in task.subtasks
                     if one.destination is not None and one.destination.surface is not None}  # fmt: skip
            assert thing.room is None or thing.room in rooms or f'"{thing.room}"' not in told


@pytest.mark.parametrize("category", ["delivery", "search"])
def test_the_chooser_decides(helsinki: World, people: Community, category: Category) -> None:
    asked: list[int] = []

    def last(question: str, candidates: object) -> int:
        asked.append(len(candidates))  # type: ignore[arg-type]
        return asked[-1] - 1

    task = generate_task(helsinki, people, category, seed=0, chooser=last)
    assert len(asked) == SUBTASKS * (3 if category == "delivery" else 2)
    assert max(asked) == CANDIDATES
    chosen = [names[-1] for subtask in task.subtasks for names in subtask.candidates.values()]
    kinds = [next(t.kind for t in task.objects if t.id == s.objects[0]) for s in task.subtasks]
    assert set(kinds) <= set(chosen)
    assert all(s.true_source.name in chosen for s in task.subtasks)


def test_a_chooser_who_names_none_of_them_is_refused(helsinki: World, people: Community) -> None:
    with pytest.raises(ValueError, match=r"chooser: 99 is none of \d candidates"):
        generate_task(helsinki, people, "search", seed=0, chooser=lambda question, candidates: 99)


def test_a_world_with_too_few_places_and_one_with_too_few_people_say_so(helsinki: World, people: Community) -> None:
    with pytest.raises(EmptyInputError, match=r"nobody knows 3 places .* within a walk of 160 m .* use a larger world"):
        generate_task(toy_city.world(), toy_city.community(), "delivery", seed=0)
    five = people.model_copy(update={"residents": people.residents[:5]})
    with pytest.raises(EmptyInputError, match=r"carry: at no time of day are 6 people out within 350 m .*, [0-5] at"):
        generate_task(helsinki, five, "carry", seed=0)


def test_methods_are_those_of_the_page() -> None:
    assert {"random", "heuristic", "mcts", "ours"} <= set(METHODS)
