"""The judge of assistant episodes: reports are final, successes may be lost again, and who is followed home."""

from __future__ import annotations

import pytest

import toy_city
from assistant_by_hand import (
    CAFE,
    CLEO,
    FAR,
    GREEN,
    IN_CAFE,
    OUTDOORS,
    SHOP,
    WHO,
    Story,
    subtask,
    task,
)
from vico.world.world import World

RED, BLUE = "red helmet", "blue helmet"


@pytest.fixture(scope="module")
def city() -> World:
    return toy_city.world()


@pytest.fixture
def errands(city: World) -> Story:
    """Two errands: the red and the blue helmet are to come from the shop to the green."""
    return Story(
        task("delivery", [subtask([SHOP], OUTDOORS, index=k, objects=[f"object_{k}"]) for k in range(2)], city), city
    )


def escort(city: World, *, objects: tuple[str, ...] = ("object_0",)) -> Story:
    """Cleo is to be followed from the green to the café."""
    return Story(task("carry", [subtask([OUTDOORS], CAFE, objects=objects)], city), city)


def test_what_nobody_reports_is_judged_as_it_stands_at_the_end(errands: Story) -> None:
    errands.step()
    assert errands.judge.final() == [False, False]
    errands.truth.put(BLUE, GREEN)
    errands.step()
    assert errands.judge.final() == [False, True]
    assert errands.judge.since == [None, 2]
    assert not errands.judge.over


def test_a_report_is_final_when_it_was_wrong(errands: Story) -> None:
    errands.report(0)
    errands.truth.put(RED, GREEN)
    errands.step()
    errands.report(0)
    assert errands.judge.final() == [False, False]
    assert errands.judge.reported_at == [1, None]


def test_a_report_is_final_when_it_was_right(errands: Story) -> None:
    errands.truth.put(RED, GREEN)
    errands.report(0)
    errands.truth.holders[RED] = "resident_0"  # somebody takes it away afterwards
    errands.step(times=3)
    assert errands.judge.final() == [True, False]
    assert errands.judge.since[0] == 1


def test_a_report_that_the_simulation_refused_is_none(errands: Story) -> None:
    errands.report(0, status="refused")
    assert errands.judge.verdicts == [None, None]


def test_residents_report_nothing(errands: Story) -> None:
    errands.names.append("resident_0")
    errands.truth.put(RED, GREEN)
    errands.report(0, who="resident_0")
    assert errands.judge.verdicts == [None, None]


def test_a_success_that_is_lost_again_counts_from_when_it_came_back(errands: Story) -> None:
    errands.truth.put(RED, GREEN)
    errands.step()
    errands.truth.holders[RED] = WHO
    errands.step()
    assert errands.judge.final() == [False, False]
    del errands.truth.holders[RED]
    errands.step(times=2)
    assert errands.judge.final() == [True, False]
    assert errands.judge.since[0] == 3


def test_all_things_have_to_be_there(city: World) -> None:
    story = Story(task("delivery", [subtask([SHOP], OUTDOORS, objects=["object_0", "object_1"])], city), city)
    story.truth.put(RED, GREEN)
    story.step()
    assert story.judge.final() == [False]
    story.truth.put(BLUE, GREEN)
    story.step()
    assert story.judge.final() == [True]


def test_it_is_over_when_everything_was_reported(errands: Story) -> None:
    errands.report(0)
    assert not errands.judge.over
    errands.report(7)  # no such errand
    errands.report(-1)
    assert not errands.judge.over
    errands.report(1)
    assert errands.judge.over


def test_search_is_judged_by_the_picture_at_the_report(city: World) -> None:
    found = [subtask([SHOP], None, index=k, objects=[f"object_{k}"]) for k in range(3)]
    story = Story(task("search", found, city), city)
    story.truth.put(WHO, (6.0, 11.0, toy_city.FLOOR), "r_shop")
    story.step(sees={RED: 300})  # seen, not reported
    story.report(0)  # reported, no longer in view
    story.report(1, sees={BLUE: 20})
    assert story.judge.final() == [False, True, False]
    assert story.judge.since == [None, 3, None]


def test_carry_is_not_done_before_the_person_arrived(city: World) -> None:
    story = escort(city)
    story.truth.put(RED, IN_CAFE, "r_cafe")
    story.step(times=4)
    assert story.judge.final() == [False]
    story.truth.put(CLEO.agent, IN_CAFE, "r_back")
    story.step()
    assert story.judge.final() == [True]
    assert story.judge.since == [5]
    # And it stays arrived: people go out again.
    story.truth.put(CLEO.agent, FAR)
    story.step()
    assert story.judge.final() == [True]


def test_arriving_with_the_things_still_in_hand_is_no_arrival_after_a_hand_over(city: World) -> None:
    story = escort(city)
    story.truth.put(CLEO.agent, IN_CAFE, "r_cafe")
    story.step(times=3)
    assert story.judge.escorts[0].handed_at is None
    assert story.judge.escorts[0].arrived_at is None


def test_following_by_its_derivation(city: World) -> None:
    story = escort(city)
    story.truth.put(CLEO.agent, GREEN)
    story.truth.put(WHO, GREEN)
    story.step(times=9)  # near, and nothing handed over: no frame of following
    story.truth.holders[RED] = WHO
    story.step(times=4)  # 10..13: handed over at 10, near
    story.truth.put(WHO, (GREEN[0] + 5.01, GREEN[1], GREEN[2]))
    story.step(times=3)  # 14..16: too far
    story.truth.put(WHO, (GREEN[0] + 4.99, GREEN[1], GREEN[2]))
    story.step(times=2)  # 17, 18: near again
    story.truth.put(CLEO.agent, IN_CAFE, "r_cafe")
    story.step()  # 19: at home, the assistant is not
    story.truth.put(WHO, IN_CAFE, "r_cafe")
    story.step(times=5)  # near again, too late to count
    assert (story.judge.escorts[0].handed_at, story.judge.escorts[0].arrived_at) == (10, 19)
    # 6 frames of 200, and 6 of the 10 from 10 to 19.
    assert story.judge.following(200) == (pytest.approx(3.0), pytest.approx(60.0))


def test_whoever_hands_nothing_over_counts_nothing_and_who_never_arrives_to_the_end(city: World) -> None:
    both = [subtask([OUTDOORS], CAFE, index=k, objects=[f"object_{k}"]) for k in range(1)]
    story = Story(task("carry", both, city), city)
    story.step(times=5)
    assert story.judge.following(200) == (0.0, 0.0)
    story.truth.put(CLEO.agent, GREEN)
    story.truth.put(WHO, GREEN)
    story.truth.holders[RED] = WHO
    story.step(times=15)  # from 6 to 20, and never home
    assert story.judge.following(20) == (pytest.approx(75.0), pytest.approx(100.0))
    assert story.judge.following(200)[1] == pytest.approx(100 * 15 / 195)


def test_either_of_two_assistants_may_follow(city: World) -> None:
    story = Story(task("carry", [subtask([OUTDOORS], CAFE)], city, assistants=2), city)
    story.truth.put(CLEO.agent, GREEN)
    story.truth.holders[RED] = WHO
    story.truth.put("assistant_1", GREEN)
    story.step(times=2)
    assert story.judge.escorts[0].followed == 2


def test_both_things_are_handed_over_before_one_is_followed(city: World) -> None:
    story = escort(city, objects=("object_0", "object_1"))
    story.truth.holders |= {RED: WHO, BLUE: CLEO.agent}
    story.step()
    assert story.judge.escorts[0].handed_at is None
    story.truth.holders[BLUE] = WHO
    story.step()
    assert story.judge.escorts[0].handed_at == 2
