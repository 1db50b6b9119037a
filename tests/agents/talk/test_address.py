"""Children call grown-ups of other families by title and surname; who is called knows it, and nobody else does."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from resident_talk import Body, View, knowing, moment
from vico.agents.talk.acquaintance import Acquaintance, address_of, is_called, names_of, surname
from vico.agents.talk.answers import Talker
from vico.agents.talk.conversation import Conversation, Errand

READS = Errand("reading", leaves=False)
GOES = Errand("on my way home", leaves=True)


class Me:
    id, hobbies, household = "resident_1", ["chess"], ""

    def __init__(self, name: str, age: int, gender: str = "female", occupation: str = "engineer") -> None:
        self.name, self.age, self.gender, self.occupation = name, age, gender, occupation


def person(name: str = "Neha Dornfeldt", age: int = 40, kind: str = "neighbour", **more: Any) -> Acquaintance:
    return Acquaintance(more.pop("agent", "resident_2"), name, kind, more.pop("note", ""), age, **more)


@pytest.mark.parametrize(
    ("age", "other", "called"),
    [
        (10, person(gender="female"), "Ms Dornfeldt"),
        (17, person("Jan van der Berg", gender="male", kind="colleague"), "Mr van der Berg"),
        (10, person(), "Neha Dornfeldt"),
        (10, person("Cher", gender="female"), "Cher"),
        (10, person("Dr. Amina Patel", gender="female"), "Dr Patel"),
        (40, person("Dr. Amina Patel", gender="female"), "Amina"),
        (18, person(gender="female"), "Neha"),
        (10, person(age=17, gender="female"), "Neha"),
        (10, person(gender="female", household="household_1", kind="friend", note="flatmates"), "Neha"),
        (10, person(gender="female", kind="family", note="parent and child"), "Mum"),
        (10, person(gender="male", kind="family", note="father and son"), "Dad"),
        (10, person(kind="family", note="parent and child"), "Neha"),
        (45, person(age=70, gender="male", kind="family", note="parent and child"), "Dad"),
        (40, person(age=10, gender="male", kind="family", note="parent and child"), "Neha"),
        (10, person(age=70, gender="female", kind="family", note="grandparent and grandchild"), "Grandma"),
        (10, person(gender="male", kind="family", note="uncle and niece"), "Uncle Neha"),
        (10, person(gender="female", kind="family", note="cousins"), "Neha"),
        (30, person(age=60, gender="female", kind="family", note="mother-in-law"), "Neha"),
        (10, person(age=21, gender="female", kind="family", note="siblings"), "Neha"),
    ],
)
def test_what_people_call_each_other(age: int, other: Acquaintance, called: str) -> None:
    assert address_of(other, age=age, household="household_1") == called


def test_a_surname_has_its_particles() -> None:
    assert [surname(name) for name in ("Ann Berg", "Jan van der Berg", "Ana Maria Lopes", "Cher")] == [
        "Berg", "van der Berg", "Lopes", "",
    ]  # fmt: skip
    assert names_of("Ann Berg", "male") == ("Ann Berg", "Ann", "Mr Berg")


@pytest.mark.parametrize(
    ("text", "called"),
    [
        ("Good morning, Ms Berg!", True),
        ("Good morning, Ms. Berg! How are you?", True),
        ("Mrs Berg, wait!", True),
        ("Mr Berg, wait!", False),
        ("Ms Bergman, wait!", False),
        ("Hi Anna, all well? It is our annual meeting.", False),
        ("Hello Ann how are you", True),
        ("can you help me ann", True),
        ("Bo and Ann, come!", True),
        ("Ann Berg, wait!", True),
        ("Ann Holm, wait!", False),
        ("I'm having soup with Ann. And you?", False),
        ("I'm on my way to Hat Shop, to help Ann with a heavy cupboard.", False),
        ("At this hour Ann Berg is usually at Hat Shop, as far as I know.", False),
        ("Is that Ann's hat?", False),
        ("Excuse me, have you seen Ms Berg?", False),
        ("Ann, have you seen Ms Holm?", True),
    ],
)
def test_who_is_called_and_who_is_only_spoken_of(text: str, called: bool) -> None:
    assert is_called("Ann Berg", text, gender="female") is called


@pytest.mark.parametrize("text", ["Hello, Amina!", "Dr. Patel, wait!", "Amina Patel, wait!", "Ms Patel, wait!"])
def test_a_doctor_is_called_by_title_and_by_name(text: str) -> None:
    assert is_called("Dr. Amina Patel", text, gender="female")
    assert not is_called("Dr. Amina Patel", "Hello, Dr. Who!", gender="female")


def said(me: Me, other: Acquaintance, text: str, errand: Errand, *bodies: Body, at: tuple[float, float]) -> str | None:
    """Return what is answered to a text that the other one says at (0, 0)."""
    talk = Conversation(me, [other, *(b.person for b in bodies if hasattr(b, "person"))], np.random.default_rng(1))
    message = {"speaker": other.agent, "text": text, "time": 0.0, "position": (0.0, 0.0, 0.0)}
    observation: Any = {"state": {"time": 0.0}, "events": [message], "pose": np.array([*at, 0.0, 0.0, 0.0, 0.0])}
    talk.meet(other.agent, 0.0)
    for body in bodies:
        talk.meet(body.agent, 0.0)
    action = talk.line(observation, {"in_view": View(*bodies)}, lambda: errand)
    return None if action is None else str(action["text"])


def lines(me: Me, other: Acquaintance, text: str, errand: Errand) -> set[str]:
    """Return all that may be answered."""
    talk = Conversation(me, [other], np.random.default_rng(1))
    options = talk._answers if "?" in text else talk._last_words
    return set(options(other, errand, text))


def test_children_greet_by_surname_and_are_answered_by_first_name() -> None:
    child, elder = Me("Mia Holm", 9), person(gender="female")
    talk = Conversation(child, [elder], np.random.default_rng(1))
    greetings = talk._greetings(elder, 10 * 3600.0, READS, indoors=True)
    assert greetings
    assert all(", Ms Dornfeldt!" in line for line in greetings)
    text = "Good morning, Ms Dornfeldt! How are you?"
    answer = said(Me("Neha Dornfeldt", 40), person("Mia Holm", 9), text, READS, at=(1.0, 0.0))
    assert answer is not None
    assert "Mia" in answer
    assert said(Me("Neha Dornfeldt", 40, "male"), person("Mia Holm", 9), text, READS, at=(1.0, 0.0)) is None


def test_a_mother_answers_her_child_and_nobody_elses() -> None:
    mother = Me("Neha Dornfeldt", 40)
    child = person("Mia Dornfeldt", 9, kind="family", note="parent and child")
    assert said(mother, child, "Hi Mum! I'm reading.", READS, at=(1.0, 0.0)) is not None
    assert said(mother, person("Ben Holm", 9), "Hi Mum! I'm reading.", READS, at=(1.0, 0.0)) is None
    assert said(mother, child, "Hi Dad! I'm reading.", READS, at=(1.0, 0.0)) is None


def test_of_two_of_one_surname_the_nearer_one_answers() -> None:
    sister = Body("resident_3", 2.0, 0.0)
    sister.person = person("Uma Dornfeldt", 38, "family", agent="resident_3", gender="female")  # type: ignore[attr-defined]
    me, child, text = Me("Neha Dornfeldt", 40), person("Mia Holm", 9), "Good morning, Ms Dornfeldt!"
    assert said(me, child, text, READS, sister, at=(1.0, 0.0)) is not None
    assert said(me, child, text, READS, sister, at=(3.0, 0.0)) is None
    assert said(me, child, "Good morning, Neha!", READS, sister, at=(3.0, 0.0)) is not None


def test_only_who_goes_says_goodbye() -> None:
    me, other = Me("Ann Berg", 40), person("Bo Dahl", 40)
    for age in (9, 40):
        me.age = age
        both_stay = lines(me, other, "Fine, thanks, Ann. I'm reading.", READS)
        assert not [line for line in both_stay if "ye, " in line or "See you" in line or "Take care" in line]
    assert "See you later, Bo!" in lines(me, other, "Hi Ann! I'm on my way home.", READS)
    me.age = 40
    assert lines(me, other, "Fine, thanks, Ann.", GOES) == {"See you, Bo!", "Take care, Bo.", "Have a good one, Bo!"}
    assert lines(Me("Mia Holm", 9), person(gender="female"), "Bye, Mia!", GOES) == {
        "Goodbye, Ms Dornfeldt!", "Bye, Ms Dornfeldt!",
    }  # fmt: skip


def test_a_kind_word_at_the_end_is_not_answered() -> None:
    me, other = Me("Ann Berg", 40), person("Bo Dahl", 40)
    assert said(me, other, "Nice to see you, Ann!", READS, at=(1.0, 0.0)) is None
    assert lines(me, other, "Nice to see you, Ann!", READS) == {"Nice to see you, Bo!"}, "nobody goes"


def test_answers_fit_what_was_asked() -> None:
    child, mother = Me("Mia Holm", 9), person("Neha Holm", 40, "family", note="parent and child", gender="female")
    assert lines(child, mother, "Hello, Mia! Have you got everything for school?", READS) == {"Yes, Mum, everything!"}
    assert lines(child, mother, "Hello, Mia! How was school?", READS) == {"It was all right, Mum.", "Fine, Mum!"}
    assert all("Bo" in line and "reading" in line for line in lines(Me("A B", 40), person("Bo D"), "And you?", READS))


def test_who_is_spoken_to_is_you_and_a_father_is_dad() -> None:
    child = Me("Mia Holm", 9)
    father = person("Otto Holm", 40, "family", note="parent and child", gender="male", agent="resident_3")
    mother = person("Neha Holm", 40, "family", note="parent and child", gender="female")
    talk = Conversation(child, [mother, father], np.random.default_rng(1))
    meal = Errand("having soup with Neha and Otto", leaves=False)
    assert talk._errand_for(meal, mother).words == "having soup with you and Dad"
    assert talk._errand_for(meal, father).words == "having soup with Mum and you"


def test_the_life_of_an_engineer() -> None:
    other = person("Bo Dahl", 40)
    asked = "Hi Ann, how are you today?"
    assert "Busy as ever, Bo: the life of an engineer." in lines(Me("Ann Berg", 40), other, asked, READS)
    retired = lines(Me("Ann Berg", 70, occupation="retired"), other, asked, READS)
    assert not [line for line in retired if "life of" in line]


def test_a_question_to_ms_holm_is_answered_by_her() -> None:
    knows = knowing()
    talker = Talker(knows)
    ms, mr = ("Ms. Holm, who are you?", "Mr Holm, who are you?")
    knows.me = type(knows.me)("resident_9", "Mia Holm", 40, "baker", gender="female")
    talker = Talker(knows)

    def reply(text: str, *bodies: Body) -> Any:
        message = {"speaker": "assistant_0", "text": text, "time": 0.0, "position": (0.0, 0.0, 0.0)}
        return talker.reply({"events": [message]}, moment(view=View(*bodies)))  # type: ignore[typeddict-item]

    assert reply(ms) == ("assistant_0", "My name is Mia Holm, and I am a baker.")
    assert reply(mr) is None
    assert reply("Mia, who are you?", Body("resident_8", 0.5, 0.0)) is not None
    knows.names = {**knows.names, "resident_8": "Mia Berg"}
    assert reply("Mia, who are you?", Body("resident_8", 0.5, 0.0)) is None


def test_people_are_asked_for_by_surname() -> None:
    knows = knowing(person("Bo Dahl", 40, gender="male", agent="resident_1"))
    assert knows.people_called("Mr Dahl", moment()) == ["resident_1"]
    assert knows.people_called("Ms Dahl", moment()) == []
