"""Whatever a schedule can hold is said of oneself as a person would say it."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from activity_texts import of_code, of_data
from vico.agents.talk.grammar import activity_of, read_verbs, vocation_of
from vico.errors import SchemaError

# Every verb that begins an activity of ours, and how it is said of oneself.
VERBS = {
    "advise": "advising", "analyse": "analysing", "answer": "answering", "attend": "attending", "bake": "baking",
    "be": "being", "book": "booking", "bring": "bringing", "browse": "browsing", "brush": "brushing",
    "build": "building",
    "buy": "buying", "call": "calling", "catalogue": "cataloguing", "change": "changing", "chat": "chatting",
    "check": "checking", "clean": "cleaning", "close": "closing", "collect": "collecting", "cook": "cooking",
    "cut": "cutting", "cycle": "cycling", "dance": "dancing", "deal": "dealing", "discuss": "discussing",
    "do": "doing",
    "draft": "drafting", "draw": "drawing", "dress": "dressing", "drill": "drilling", "eat": "eating",
    "edit": "editing",
    "enjoy": "enjoying", "feed": "feeding", "fetch": "fetching", "fill": "filling", "find": "finding",
    "finish": "finishing", "fit": "fitting", "follow": "following", "get": "getting", "give": "giving", "go": "going",
    "handle": "handling", "hang": "hanging", "have": "having", "help": "helping", "interview": "interviewing",
    "iron": "ironing", "keep": "keeping", "kick": "kicking", "knead": "kneading", "knit": "knitting", "lay": "laying",
    "lead": "leading", "leaf": "leafing", "learn": "learning", "leave": "leaving", "lie": "lying", "light": "lighting",
    "listen": "listening", "look": "looking", "make": "making", "measure": "measuring", "meet": "meeting",
    "mend": "mending", "mix": "mixing", "move": "moving", "open": "opening", "pack": "packing", "paint": "painting",
    "pay": "paying", "pick": "picking", "plan": "planning", "play": "playing", "post": "posting",
    "practise": "practising", "prepare": "preparing", "press": "pressing", "proofread": "proofreading",
    "prune": "pruning", "pull": "pulling", "put": "putting", "read": "reading", "rehearse": "rehearsing",
    "repair": "repairing", "rest": "resting", "restore": "restoring", "return": "returning", "revise": "revising",
    "ride": "riding", "rig": "rigging", "run": "running", "scroll": "scrolling", "see": "seeing", "sell": "selling",
    "serve": "serving", "share": "sharing", "shelve": "shelving", "show": "showing", "shower": "showering",
    "sing": "singing", "sit": "sitting", "sketch": "sketching", "sleep": "sleeping", "slice": "slicing",
    "solve": "solving", "sort": "sorting", "spend": "spending", "stay": "staying", "stroll": "strolling",
    "study": "studying",
    "sweep": "sweeping", "swim": "swimming", "take": "taking", "talk": "talking", "taste": "tasting",
    "teach": "teaching", "tend": "tending", "test": "testing", "tidy": "tidying", "tie": "tying", "train": "training",
    "translate": "translating", "treat": "treating", "true": "truing", "try": "trying", "vacuum": "vacuuming",
    "visit": "visiting", "wait": "waiting", "walk": "walking", "wander": "wandering", "wash": "washing",
    "watch": "watching", "water": "watering", "wind": "winding", "work": "working", "write": "writing",
}  # fmt: skip
TEXTS = [*of_data(), *of_code()]


def test_all_texts_are_looked_at() -> None:
    assert len(TEXTS) > 380
    for known in ("Sleep", "Chat a little longer", "Have a drink", "See Mia and Ben to school", "Treat patients"):
        assert known in TEXTS


def test_every_activity_begins_with_a_verb_that_is_turned_properly() -> None:
    odd = {}
    for text in TEXTS:
        verb = text.split(" ")[0].strip(",").lower()
        said, turned = activity_of(text), VERBS.get(verb, "?")
        doing = said.doing if verb != "be" else f"being {said.doing}"
        if not (doing.split(" ")[0].strip(",") == turned and said.going.startswith(f"to {verb}")):
            odd[text] = said
    assert odd == {}


def test_nothing_is_said_that_only_a_diary_says() -> None:
    odd = re.compile(
        r"\b(?:one's|oneself|each other|one another|together|side by side|the feet|[A-Z]\w+ing)\b|: |[?()]"
    )
    assert [text for text in TEXTS if odd.search(activity_of(text).doing)] == []


def test_verbs_in_a_row_are_turned_alike() -> None:
    """A verb after "and", "then" or a comma is turned if the first is; no text of ours has a noun there that is one."""
    left = {}
    for text in TEXTS:
        doing = activity_of(text).doing
        for joined in re.findall(r"(?:, | and | then )([a-z-]+)", doing):
            if joined in VERBS and joined not in ("rest", "study"):
                left[text] = doing
    assert left == {}


@pytest.mark.parametrize(
    ("words", "doing", "going"),
    [
        ("Chess table: play chess", "playing chess", "to play chess"),
        ("Play circle: Read a play", "reading a play", "to read a play"),
        ("Enjoy a cake at Cafe Engel: the new one", "enjoying a cake at Cafe Engel", "to enjoy a cake at Cafe Engel"),
        ("Be out and about", "out and about", "to be out and about"),
        ("Work on a plan of one's own", "working on a plan of my own", "to work on a plan of my own"),
        ("Speak each other's languages", "speaking the others' languages", "to speak the others' languages"),
        ("Train together", "training with the others", "to train with the others"),
        ("Play together with Ada", "playing with Ada", "to play with Ada"),
        ("Walk their dog", "walking my dog", "to walk my dog"),
        ("Wash and brush her teeth", "washing and brushing my teeth", "to wash and brush my teeth"),
        ("Visit her at home", "visiting her at home", "to visit her at home"),
        ("Help neighbours with their shopping", "helping neighbours with their shopping",
         "to help neighbours with their shopping"),
        ("Get ready to go out and play", "getting ready to go out and play", "to get ready to go out and play"),
        ("Open up, then write and review code", "opening up, then writing and reviewing code",
         "to open up, then write and review code"),
        ("Have tea and toast with jam", "having tea and toast with jam", "to have tea and toast with jam"),
        ("Have lunch with Ada and Mark", "having lunch with Ada and Mark", "to have lunch with Ada and Mark"),
        ("Quietly read in bed", "quietly reading in bed", "to quietly read in bed"),
        ("Untangle the nets", "untangling the nets", "to untangle the nets"),
        ("Shopping for groceries", "shopping for groceries", "to shop for groceries"),
        ("Reading, writing and painting", "reading, writing and painting", "to read, write and paint"),
        ("Do some yoga, then shower", "doing some yoga, then showering", "to do some yoga, then shower"),
        ("Do the dishes and rest", "doing the dishes and resting", "to do the dishes and rest"),
        ("Buy bread and water", "buying bread and water", "to buy bread and water"),
        ("Enjoy dinner together at home", "enjoying dinner with the others at home",
         "to enjoy dinner with the others at home"),
        ("I read a book", "reading a book", "to read a book"),
        ("Quick lunch", "here for a quick lunch", "for a quick lunch"),
        ("Design work at the studio", "here for the design work at the studio", "for the design work at the studio"),
        ("Breakfast with the family", "here for breakfast with the family", "for breakfast with the family"),
        ("Team meeting", "here for the team meeting", "for the team meeting"),
        ("Work shift", "here for the work shift", "for the work shift"),
        ("Give lessons", "giving lessons", "to give lessons"),
        ("Have lunch at Hotel St. George.", "having lunch at Hotel St. George", "to have lunch at Hotel St. George"),
        ("Read (quietly)?", "reading", "to read"),
        ("Abendessen kochen", "here for abendessen kochen", "for abendessen kochen"),
    ],
)  # fmt: skip
def test_activities_as_people_write_them(words: str, doing: str, going: str) -> None:
    said = activity_of(words)
    assert (said.doing, said.going) == (doing, going)


@pytest.mark.parametrize(
    ("occupation", "said"),
    [
        ("engineer", "an engineer"), ("UX designer", "a UX designer"), ("Retired", "retired"),
        ("retired tram driver", "a retired tram driver"), ("Retired from teaching", "retired from teaching"),
        ("self-employed electrician", "a self-employed electrician"), ("unemployed", "unemployed"),
        ("Accountant.", "an accountant"), ("student of law", "a student of law"), ("", ""),
    ],
)  # fmt: skip
def test_an_occupation_has_its_article(occupation: str, said: str) -> None:
    assert vocation_of(occupation) == said


def test_verbs_of_ones_own_are_added(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert activity_of("Yodel at dawn").doing == "here for yodel at dawn"
    (tmp_path / "agents/talk").mkdir(parents=True)
    (tmp_path / "agents/talk" / "verbs_mine.toml").write_text('verbs = ["yodel"]\n')
    monkeypatch.setenv("VICO_DATA", str(tmp_path))
    assert "yodel" in read_verbs().verbs
    assert activity_of("Yodel at dawn").doing == "yodeling at dawn"
    (tmp_path / "agents/talk" / "verbs_bad.toml").write_text('verbs = ["Yodel"]\n')
    monkeypatch.setenv("VICO_DATA", f"{tmp_path}/")
    with pytest.raises(SchemaError, match=r"verbs_bad.toml: verbs.0.*docs/talk.md"):
        read_verbs()
