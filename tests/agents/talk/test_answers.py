"""What is answered follows from sight, acquaintance, hearsay, the map and one's own day, and from nothing else."""

from __future__ import annotations

from dataclasses import replace

import pytest

from resident_talk import CAFE, NINE, SHOP, TEN, Body, View, ada, ask, knowing, moment
from vico.agents.talk.sentences import claims_in, read_sentences


def test_somebody_never_met_nor_heard_of_is_not_known_though_they_exist() -> None:
    for kind in ("seen", "where"):
        said = ask(knowing(), kind, "Ada Berg")  # type: ignore[arg-type]
        assert said in (read_sentences().say("unknown_person"), read_sentences().say("unknown_place"))
        assert claims_in(said) == []


def test_sight_indoors_and_outdoors() -> None:
    knows = knowing()
    knows.memory.see("resident_0", NINE, -6.0, 11.0, CAFE)
    assert ask(knows, "seen", "Ada Berg") == "I saw Ada Berg in Corner Café at 09:00."
    assert ask(knows, "where", "ada") == "I saw Ada Berg in Corner Café at 09:00."
    knows.memory.see("resident_0", NINE + 300, 1.0, -20.0, "")
    assert ask(knows, "seen", "Ada Berg") == "I saw Ada Berg outdoors, near South Green, at 09:05."


def test_who_is_in_view_is_pointed_out() -> None:
    said = ask(knowing(), "seen", "Bo Dahl", moment(view=View(Body("resident_1", 0.0, 43.0))))
    assert said == "I can see Bo Dahl from here, about 40 m to the north."


@pytest.mark.parametrize(
    ("kind", "said"),
    [
        ("friend", "At this hour Ada Berg is usually at Hat Shop, as far as I know."),
        ("family", "At this hour Ada Berg is usually at Hat Shop, as far as I know."),
        ("colleague", "At this hour Ada Berg is usually at Hat Shop, as far as I know."),
        ("neighbour", "I know that Ada Berg lives at Corner Café, but not where they are now."),
    ],
)
def test_acquaintance_tells_as_much_as_one_knows(kind: str, said: str) -> None:
    assert ask(knowing(ada(kind)), "seen", "Ada Berg") == said


def test_a_colleague_knows_nothing_of_the_night() -> None:
    said = ask(knowing(ada("colleague")), "seen", "Ada Berg", moment(3 * 3600.0))
    assert said == "I have not seen Ada Berg today, sorry."
    on_the_way = ask(knowing(ada("friend")), "seen", "Ada Berg", moment(8 * 3600.0 + 30))
    assert on_the_way == "At this hour Ada Berg is usually on the way to Hat Shop, as far as I know."


def test_hearsay_says_whose_it_is_and_later_sight_outweighs_it() -> None:
    knows = knowing(ada("neighbour"))
    said = read_sentences().say("saw_in", person="Ada Berg", place="South Green", time="09:30")
    heard = {"time": TEN - 60, "speaker": "resident_1", "text": f"Hi! {said}"}
    knows.memory.listen({"events": [heard]})
    assert ask(knows, "seen", "Ada Berg").startswith("Bo Dahl told me that Ada Berg was at South Green at 09:30.")
    knows.memory.see("resident_0", TEN - 30, -6.0, 11.0, CAFE)
    assert ask(knows, "seen", "Ada Berg") == "I saw Ada Berg in Corner Café at 09:59."


def test_hearsay_of_places_that_no_map_has_is_not_passed_on() -> None:
    knows = knowing(ada("neighbour"))
    said = read_sentences().say("saw_in", person="Ada Berg", place="Atlantis", time="09:30")
    knows.memory.listen({"events": [{"time": TEN, "speaker": "assistant_0", "text": said}]})
    assert "Atlantis" not in ask(knows, "seen", "Ada Berg")


def test_every_answer_about_a_person_has_a_source() -> None:
    """Over all that can be known of somebody: nothing known, nothing said; each claim has its own source."""
    for tie in ("", "friend", "colleague", "neighbour"):
        for seen in (False, True):
            for told in (False, True):
                knows = knowing(*([ada(tie)] if tie else []))
                if seen:
                    knows.memory.see("resident_0", NINE, -6.0, 11.0, CAFE)
                if told:
                    text = read_sentences().say("saw_in", person="Ada Berg", place="South Green", time="09:30")
                    knows.memory.listen({"events": [{"time": TEN, "speaker": "resident_1", "text": text}]})
                kinds = {claim.kind for claim in claims_in(ask(knows, "seen", "Ada Berg"))}
                assert ("saw_in" in kinds) == seen
                assert not kinds & {"see", "saw_near", "saw_away"}
                assert ("told" in kinds) == (told and (seen or tie != ""))
                assert not kinds & {"usual", "usual_way"} or tie in ("friend", "colleague")
                assert "lives" not in kinds or tie == "neighbour"


def test_two_of_one_name_are_asked_apart() -> None:
    knows = knowing(ada("friend"), replace(ada("friend"), agent="resident_5", name="Ada Holm"))
    assert ask(knows, "seen", "Ada") == read_sentences().say("which_person")
    assert "Ada Holm" in ask(knows, "seen", "Ada Holm")


def test_ways_and_places() -> None:
    knows = knowing()
    assert ask(knows, "where", "the Corner Café") == "You find Corner Café about 10 m to the west of here."
    assert ask(knows, "where", "cafe") == "You find Corner Café about 10 m to the west of here."
    way = ask(knows, "way", "South Green")
    place, steps = claims_in(way)
    assert (place.kind, place.place, place.metres, place.direction) == ("place", "South Green", 30, "south")
    assert (steps.kind, steps.place, steps.metres) == ("way", "South Green", 30)
    assert steps.text.startswith("go south along the path for about 30 m")
    assert ask(knows, "way", "Moon") == read_sentences().say("unknown_place")
    assert ask(knows, "where", "Hat Shop", moment(place=SHOP)) == "This is Hat Shop, you are there already."


def test_places_far_away_are_known_to_those_who_go_there(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vico.agents.talk.answers.KNOWN_WITHIN", 2.0)
    knows = knowing()
    assert ask(knows, "where", "Hat Shop").startswith("You find Hat Shop")
    assert ask(knows, "where", "Corner Café") == read_sentences().say("unknown_place")


def test_ones_own_day() -> None:
    knows = knowing()
    assert ask(knows, "did") == read_sentences().say("did_nothing")
    knows.memory.arrive(7 * 3600.0, 0, CAFE)
    knows.memory.arrive(29520.0, 1, SHOP)
    assert ask(knows, "did") == (
        "I was at Corner Café from 07:00 to 08:12 (sleeping). I have been at Hat Shop since 08:12 (selling hats)."
    )
    assert ask(knows, "plans") == "I'm going to be at Corner Café from 12:12 to 23:59 (eating soup)."
    assert ask(knows, "plans", when=moment(13 * 3600.0)) == "I have no more plans for today."
    assert ask(knows, "doing") == "I'm here to sell hats, as you see."
    assert ask(knows, "who") == "My name is Mia Holm, and I am a baker."
    assert ask(knows, "seen", "Mia") == "I am Mia Holm: here I am."
