"""A person at the page: walks, picks up, puts down, is scored; over a real WebSocket with scripted keys."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import toy_city
from assistant_by_hand import OUTDOORS, subtask, task
from live_toy import live_toy
from person_at_keys import Person
from vico.agents.human import HumanAgent, Mailbox
from vico.challenges.assistant.challenge import PlayedByHand, play_task
from vico.challenges.records import EpisodeRecord
from vico.community.folder import digest_of
from vico.errors import InputError
from vico.runner.control import Control
from vico.sim.recording import read_run
from vico.viewer.human_evaluation import BrowserTheatre
from vico.viewer.play import PlayedAgent, parse_keys
from viewer_client import get_json, stream


@pytest.fixture
def person(tmp_path: Path) -> Iterator[Person]:
    """Somebody who plays an assistant in the toy city, at twice the usual pace."""
    player = PlayedAgent("assistant_0", HumanAgent(Mailbox()))
    control = Control(tmp_path / "run", speed=2.0)
    periods = {"assistant_0": 0.1}
    with (
        live_toy(tmp_path / "run", control=control, player=player, assistants=1, periods=periods) as toy,
        stream(toy.url) as client,
    ):
        yield Person(client)


def test_keys_walk_and_letting_go_stops(person: Person) -> None:
    person.hold()
    start = person.you()
    person.hold("forward")
    person.client.until(lambda s: (m := s.last("you")) and m["speed"] > 0.9)
    person.hold()
    person.client.until(lambda s: (m := s.last("you")) and m["speed"] == 0.0)
    end = person.client.last("you")
    assert end is not None
    assert math.dist(start["position"], end["position"]) > 0.1
    assert end["seq"] == 3


def test_keys_that_nobody_repeats_are_let_go(person: Person) -> None:
    person.hold("forward")
    person.client.until(lambda s: (m := s.last("you")) and m["speed"] > 0.9)
    person.client.until(lambda s: (m := s.last("you")) and m["speed"] == 0.0, 10.0)


def test_one_page_plays_until_it_leaves_or_falls_silent() -> None:
    now, seen = [0.0], list[bool]()
    player = PlayedAgent("assistant_0", HumanAgent(Mailbox(clock=lambda: now[0])), present=seen.append)
    forward = {"seq": 1, "down": ["forward"]}
    assert player.keys(1, forward)
    assert not player.keys(2, forward)
    with pytest.raises(InputError, match="another page"):
        player.do(2, {"type": "wait"}).result(0)
    now[0] = 6.0
    assert player.keys(2, {"seq": 0, "down": ["back"]})
    assert player.human.mailbox.take()[0].keys == {"back"}
    player.leave(1)
    assert player.owner() == 2
    player.leave(2)
    assert player.owner() is None
    assert player.human.mailbox.take()[0].idle
    assert seen == [True, True, False]


def test_refusals_come_back_in_words(person: Person) -> None:
    reply = person.do(type="pick", hand=1, object=5)
    assert not reply["ok"]
    assert reply["status"] == "refused"
    assert "nothing that can be carried" in reply["error"]
    assert person.do(type="communicate", text="Hello!")["ok"]
    assert not person.do(type="fly")["ok"]


@pytest.mark.parametrize(
    "message",
    [
        {"seq": -1},
        {"seq": 1, "down": ["jump"]},
        {"seq": 1, "down": "forward"},
        {"seq": 1, "yaw": "north"},
        {"seq": 1, "yaw": float("inf")},
        {"seq": 1, "axes": {"z": 1.0}},
        {"seq": 1, "axes": [1.0]},
        {"seq": True},
    ],
)
def test_keys_that_are_none_are_refused(message: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="has to"):
        parse_keys(message)


# Tasks.


def _play(
    tmp_path: Path, script: Callable[[str], None], *, waits: float = 10.0
) -> tuple[EpisodeRecord | BaseException, Path]:
    """Play a delivery from the lawn to a spot 12 m away, with a script at the keys."""
    world, people = toy_city.world(), toy_city.community()
    assert world.digest  # known from here on
    world.path = tmp_path
    place = OUTDOORS.model_copy(update={"centre": (-6.0, -10.0, 0.0)})
    helmet = task("delivery", [subtask([OUTDOORS], place)], world, steps=120).objects[0]
    lying = helmet.model_copy(update={"position": (3.0, -6.0, 0.0), "room": None})
    of = task("delivery", [subtask([OUTDOORS], place)], world, steps=120).model_copy(
        update={"community_digest": digest_of(people), "objects": [lying]}
    )
    theatre, addresses = BrowserTheatre(), list[str]()
    theatre.open(city=lambda world: None, announce=addresses.append, waits=waits)
    result: list[EpisodeRecord | BaseException] = []
    out = tmp_path / "episode"

    def perform() -> None:
        try:
            result.append(play_task(world, people, of, method=PlayedByHand("human", theatre), recording=out))
        except BaseException as error:
            result.append(error)

    thread = threading.Thread(target=perform)
    thread.start()
    try:
        while not addresses and thread.is_alive():
            time.sleep(0.05)
        if addresses:
            script(addresses[0])
    finally:
        thread.join(30.0)
    assert not thread.is_alive()
    return result[0], out


def test_a_delivery_by_hand_is_scored_like_any_other(tmp_path: Path) -> None:
    def script(url: str) -> None:
        assert get_json(url, "/api/run")["control"]["status"] == "paused"
        assert get_json(url, "/api/run")["you_play"] == "assistant_0"
        with stream(url) as client:
            person = Person(client)
            person.hold()
            assert not client.command("weather", kind="rain")["ok"]
            you = person.walk_to(3.0, -6.0, within=0.9)
            hint = person.client.until(
                lambda s: next((h for h in (s.last("you") or you)["hints"] if h["key"] == "B"), None)
            )
            assert hint["text"] == "pick up red helmet"
            assert person.do(**hint["action"])["ok"]
            you = person.you()
            assert "red helmet" in {held["name"] for held in you["held"] if held}
            assert you["task"]["subtasks"] == [{"index": 0, "text": "Cleo Ek asks.", "done": False}]
            person.walk_to(-6.0, -10.0, within=1.0)
            hand = next(k for k, held in enumerate(person.you()["held"]) if held)
            assert person.do(type="put", hand=hand)["ok"]
            # The episode ends with the report: nobody is left to say how it went.
            assert "over" in person.do(type="task_complete", index=0)["error"]

    record, out = _play(tmp_path, script)
    assert isinstance(record, EpisodeRecord), record
    assert record.metrics["SR"] == 100.0
    run = read_run(out)
    seconds = float(run.times[-1] - run.times[0])
    # Ten steps a second; the score counts seconds.
    assert run.last == round(10 * seconds)
    assert record.steps in (int(seconds), int(seconds) + 1)
    assert 3 <= record.metrics["Ts"] <= seconds + 1
    assert run.complete
    assert "assistant_0" in run.views
    assert any(event["kind"] == "task_complete" for event in run.events)


def test_an_episode_that_is_left_waits_and_is_then_not_played(tmp_path: Path) -> None:
    def script(url: str) -> None:
        with stream(url) as client:
            person = Person(client)
            person.hold("forward")
            person.you()
        time.sleep(0.5)
        step = get_json(url, "/api/run")["control"]["step"]
        time.sleep(0.3)
        assert get_json(url, "/api/run")["control"] | {"factor": 0} == {
            "paused": True, "speed": 1.0, "step": step, "status": "paused", "factor": 0,
            "can": ["pause", "resume", "stop", "bookmark", "bookmarks"],
        }  # fmt: skip

    result, _ = _play(tmp_path, script, waits=1.5)
    assert isinstance(result, InputError)
    assert "nobody played" in str(result)


def test_two_persons_or_no_page_are_refused(tmp_path: Path) -> None:
    world, people = toy_city.world(), toy_city.community()
    of = task("delivery", [subtask([OUTDOORS], OUTDOORS)], world, assistants=2)
    of = of.model_copy(update={"community_digest": digest_of(people)})
    with pytest.raises(InputError, match="one person plays one assistant"):
        play_task(world, people, of, method="human+human")
    with pytest.raises(InputError, match="at a page"):
        play_task(world, people, of, method="human+heuristic")
