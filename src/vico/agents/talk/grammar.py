"""Questions that a message holds, and activities and occupations as one says them of oneself.

The forms of questions are data, ``vico/data/agents/talk/questions.toml``. Schedules say an activity as in a diary:
"Have dinner", "Chess table: play chess", "Wash, dress and brush teeth"; residents say "I'm having dinner", "to have
dinner", "I am an engineer". The verbs are data, ``vico/data/agents/talk/verbs.toml``.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Literal

from pydantic import Field

from vico.english import participle, uncapitalize, with_article
from vico.errors import SchemaError
from vico.io.data_files import DataRecord, cached_data, data_files, read_record

__all__ = [
    "ABOUT",
    "GUIDE",
    "Activity",
    "Grammar",
    "Kind",
    "Question",
    "QuestionForms",
    "Verbs",
    "activity_of",
    "read_grammar",
    "read_verbs",
    "vocation_of",
]
GUIDE = "docs/talk.md"
DATA_FOLDER = "agents/talk"

Kind = Literal["seen", "way", "where", "doing", "did", "plans", "who"]

#: Kinds of questions that are about somebody or something, which their forms name by ``{what}``.
ABOUT = ("seen", "way", "where")
# Longer messages are no questions, characters; and so long may be what is asked for.
_MAX_MESSAGE, _MAX_SUBJECT = 400, 100
# The dot of a title ends no sentence.
_TITLE = re.compile(r"\b(mrs?|ms|mx|dr|prof)\.(?=\s)", re.IGNORECASE)


class QuestionForms(DataRecord):
    """The forms of a kind of question."""

    kind: Kind
    about: Annotated[str, Field(min_length=1)]
    forms: Annotated[list[str], Field(min_length=1)]


class _QuestionFile(DataRecord):
    courtesies: list[str] = Field(default_factory=list)
    articles: list[str] = Field(default_factory=list)
    question: list[QuestionForms] = Field(default_factory=list)


@dataclass(frozen=True)
class Question:
    """What somebody wants to know.

    Attributes
    ----------
    what
        What it is about, as it was said; empty for questions about oneself.
    to
        Whom it is put to, as they were called; empty if nobody was.
    """

    kind: Kind
    what: str = ""
    to: str = ""


def _form_pattern(form: str) -> re.Pattern[str]:
    """Return what a form at the end of something said is known by."""
    words = [re.escape(part) for part in form.split("{what}")]
    return re.compile(r"(?:^|(?<=[\s,;:.!]))" + f"(?P<what>.{{1,{_MAX_SUBJECT}}}?)".join(words) + "$", re.IGNORECASE)


def _is_form(form: str, *, about: bool) -> bool:
    """Whether a form is written as it should be; `about`: it names what it is about."""
    words = form.replace("{what}", "", 1 if about else 0).strip()
    return bool(words) and form == form.lower() and ("{what}" in form) == about and not re.search(r"[{}?|()]", words)


@dataclass(frozen=True)
class Grammar:
    """All forms, ready to be looked for; see `read_grammar`."""

    questions: tuple[QuestionForms, ...]
    courtesies: tuple[str, ...]
    articles: tuple[str, ...]

    @cached_property
    def _patterns(self) -> list[tuple[Kind, re.Pattern[str]]]:
        return [(question.kind, _form_pattern(form)) for question in self.questions for form in question.forms]

    @cached_property
    def _courtesy(self) -> re.Pattern[str]:
        words = sorted(self.courtesies, key=len, reverse=True)
        return re.compile(rf"\b(?:{'|'.join(re.escape(word) for word in words)})\b", re.I)

    def question_in(self, text: str, *, names: tuple[str, ...] = ()) -> Question | None:
        """Return the question that a message ends in, or holds before a question mark; None if there is none.

        Parameters
        ----------
        names
            What whoever hears it is called: such a name may follow the question.
        """
        if len(text) > _MAX_MESSAGE:
            return None
        for said in " ".join(text.split()).split("?"):
            said = _TITLE.sub(r"\1", said)
            found = self._read(said, names)
            if found is not None:
                return found
        return None

    def _read(self, said: str, names: tuple[str, ...]) -> Question | None:
        asked, called = said.strip(" .,!;"), ""
        for name in (*names, *self.courtesies):
            head, comma, tail = asked.rpartition(",")
            if comma and tail.strip().lower() == name.lower():
                called = name if name in names else called
                asked = head.strip(" ,")
        for kind, pattern in self._patterns:
            match = pattern.search(asked)
            if match is not None:
                what = self.bare(match["what"]) if "what" in pattern.groupindex else ""
                return Question(kind, what, called or self._addressee(asked[: match.start()]))
        return None

    def bare(self, what: str) -> str:
        """Return what is asked for, or a name, without quotation marks and articles."""
        bare = what.strip(" \"'“”")
        article = max((one for one in self.articles if bare.lower().startswith(f"{one} ")), key=len, default="")
        return bare[len(article) :].strip(" \"'“”")

    def _addressee(self, before: str) -> str:
        """Return who is called before a question: up to three words that are no courtesy, as names are written."""
        last = re.split(r"[.!?]", before.rstrip(" ,;:.!"))[-1]
        words = re.sub(r"[,;:]", " ", self._courtesy.sub(" ", last)).split()
        named = before.rstrip().endswith((",", ":")) or all(word[0].isupper() for word in words)
        return " ".join(words) if len(words) <= 3 and named else ""


@cached_data
def read_grammar() -> Grammar:
    """Read all forms: the package's, then those of a user's own ``$VICO_DATA/agents/talk/questions*.toml``.

    Raises
    ------
    SchemaError
        If a file is damaged, or a form is not written as `docs/talk.md` says.
    """
    questions: list[QuestionForms] = []
    courtesies: list[str] = []
    articles: list[str] = []
    for path in data_files(DATA_FOLDER, "questions"):
        file = read_record(path, _QuestionFile, guide=GUIDE)
        for question in file.question:
            for form in question.forms:
                if not _is_form(form, about=question.kind in ABOUT):
                    raise SchemaError(
                        f"{path}: question {question.kind!r}: {form!r}; write small letters, with {{what}} once if it "
                        f"is one of {', '.join(ABOUT)}, and without otherwise; see {GUIDE}"
                    )
        questions += file.question
        courtesies += [word.lower() for word in file.courtesies]
        articles += [word.lower() for word in file.articles]
    return Grammar(tuple(questions), tuple(courtesies), tuple(articles))


# More of an activity is not said, characters.
_MAX_ACTIVITY = 80
# Before the second of two verbs: "wash and dress", "wash, dress", "open up, then serve".
_JOINING_WORDS = re.compile(r"(,? (?:and then|and|or|then|&) |, )")
_PARTICLES = frozenset([
    "about", "after", "ahead", "along", "around", "at", "away", "back", "by", "down", "for", "from", "in", "into",
    "off", "on", "onto", "out", "over", "past", "round", "through", "to", "together", "towards", "under", "up",
    "upon", "with", "without",
])  # fmt: skip
_DETERMINERS = frozenset([
    "a", "an", "another", "my", "one's", "our", "some", "that", "the", "this",
])  # fmt: skip
# Meals that take an article.
_OCCASION_ADJECTIVES = frozenset(
    ["big", "brief", "early", "hearty", "late", "light", "long", "packed", "quick", "short", "simple"]
)
# After these two things may be named: "have a meal and rest", "study music and dance".
_HAVING_VERBS = frozenset(["attend", "discuss", "enjoy", "have", "study", "take", "watch"])
_ADVERBS = frozenset([
    "also", "always", "just", "now", "often", "still",
])  # fmt: skip
# Schedules speak of anybody; of oneself one says it in the first person, and of those one is with as of others.
_OF_ONESELF = (
    (re.compile(r"\bof one's own\b"), "of my own"),
    (re.compile(r"\bone's\b"), "my"),
    (re.compile(r"\boneself\b"), "myself"),
    (re.compile(r"\byour\b"), "my"),
    (re.compile(r"\byourself\b"), "myself"),
    (re.compile(r"\b(?:each other|one another)'s\b"), "the others'"),
    (re.compile(r"\b(?:each other|one another)\b"), "the others"),
    (re.compile(r"\btogether with\b"), "with"),
    (re.compile(r"(?<=\w) together(?=$| (?:after|at|before|for|in|on|over)\b)"), " with the others"),
    (re.compile(r"\b(?:himself|herself|themselves|themself)\b"), "myself"),
)
# Right after the verb it is one's own: "walk their dog", but "help neighbours with their shopping".
_THEIR_PATTERN = re.compile(
    rf"^(\S+(?: (?:{'|'.join(sorted(_PARTICLES))}))*) (?:his|her|their) (?!(?:{'|'.join(sorted(_PARTICLES))})\b)"
)
_INFINITIVE = re.compile(r"\bto ([a-z-]+)")
# Occupations that take no article.
_STATES = re.compile(
    r"(?:semi-|early )?retired(?:$| from\b|,)|(?:un|self-)employed$|freelance$|freelancing|between |looking |on |in |"
    r"at |out of |not |studying |working |(?:a|an|the|my|one of) ",
    re.IGNORECASE,
)


_VerbWord = Annotated[str, Field(pattern=r"^[a-z]+(-[a-z]+)*$")]


class _VerbFile(DataRecord):
    verbs: list[_VerbWord] = Field(default_factory=list)
    nouns: list[_VerbWord] = Field(default_factory=list)
    dishes: list[_VerbWord] = Field(default_factory=list)
    occasions: list[_VerbWord] = Field(default_factory=list)


@dataclass(frozen=True)
class Verbs:
    """The words of ``verbs.toml``; see `read_verbs`.

    Attributes
    ----------
    verbs
        That activities begin with.
    nouns, dishes
        Those of them that are nouns, too, at the end of a list; of these, those that are nouns before "with" as well.
    occasions
        Words that make a noun of such a verb before them.
    """

    verbs: frozenset[str]
    nouns: frozenset[str]
    dishes: frozenset[str]
    occasions: frozenset[str]

    @cached_property
    def participles(self) -> Mapping[str, str]:
        """Verbs by their participles."""
        return {participle(verb): verb for verb in sorted(self.verbs)}


@cached_data
def read_verbs() -> Verbs:
    """Read the verbs: the package's, then those of a user's own ``$VICO_DATA/agents/talk/verbs*.toml``.

    Raises
    ------
    SchemaError
        If a file is damaged, or a word is not written in small letters.
    """
    files = [read_record(path, _VerbFile, guide=GUIDE) for path in data_files(DATA_FOLDER, "verbs")]
    fields = ("verbs", "nouns", "dishes", "occasions")
    verbs, nouns, dishes, occasions = (frozenset(w for file in files for w in getattr(file, field)) for field in fields)
    return Verbs(verbs, nouns | dishes, dishes, occasions)


@dataclass(frozen=True)
class Activity:
    """An activity in words for a sentence of one's own.

    Attributes
    ----------
    doing
        What follows "I'm" for who is there: "having dinner", "out and about", "here for the team meeting".
    going
        What follows "I'm on my way to PLACE, ": "to have dinner", "for the team meeting".
    """

    doing: str
    going: str

    @property
    def about(self) -> str:
        """What it is, without "I'm": "having dinner", "team meeting"."""
        return self.doing.removeprefix("here for ")


def activity_of(words: str) -> Activity:
    """Return a schedule's activity as one says it of oneself.

    Parameters
    ----------
    words
        "Have dinner", "Chess table: play chess", "Team meeting", "Shopping".
    """
    verbs = read_verbs()
    plain = uncapitalize(_without_group(words, verbs)) or "something"
    for pattern, mine in _OF_ONESELF:
        plain = pattern.sub(mine, plain)
    parts = _JOINING_WORDS.split(plain)
    if parts[0].split(" ", 1)[0] in verbs.participles:
        parts[::2] = [_infinitive(part, verbs) for part in parts[::2]]
    if not _begins_with_verb(parts[0], verbs):
        occasion = _occasion("".join(parts), verbs)
        return Activity(f"here for {occasion}", f"for {occasion}")
    doing, going, infinitive = "", "", False
    for k, part in enumerate(parts):
        follows = k > 0 and k % 2 == 0 and not infinitive
        if k == 0 or (follows and ("then" in parts[k - 1] or _is_verb(part, parts[k - 2], verbs))):
            part = _THEIR_PATTERN.sub(r"\1 my ", part)
            # "Get ready to go out and play": what follows an infinitive is one.
            found = _INFINITIVE.search(part)
            infinitive = found is not None and found[1] in verbs.verbs
            doing += _to_participle(part, verbs)
        else:
            doing += part
        going += part
    return Activity(doing.removeprefix("being "), f"to {going}")


def _infinitive(part: str, verbs: Verbs) -> str:
    first, space, rest = part.partition(" ")
    return f"{verbs.participles.get(first, first)}{space}{rest}"


def _occasion(words: str, verbs: Verbs) -> str:
    """Return an activity without a verb as one says it: "the team meeting", "a quick lunch", "breakfast"."""
    first, *_ = listed = words.split(" ")
    if first in _DETERMINERS:
        return words
    if first in _OCCASION_ADJECTIVES and not words.endswith("s"):
        return with_article(words)
    upto = next((k for k, word in enumerate(listed) if word in _PARTICLES or word == "and"), len(listed))
    return f"the {words}" if listed[max(0, upto - 1)] in verbs.occasions else words


def vocation_of(occupation: str) -> str:
    """Return what follows "I am": "an engineer", "a UX designer", "retired"; empty where there is none to say."""
    plain = " ".join(occupation.split()).strip(" .!,;:").replace("?", "")
    if not plain or _STATES.match(plain):
        return uncapitalize(plain)
    return with_article(uncapitalize(plain))


def _without_group(words: str, verbs: Verbs) -> str:
    """Return an activity without the name of the group that does it, and without what would break a sentence's form."""
    plain = re.sub(r"^(?:I am|I'm|I) (?=\w)", "", " ".join(words.split()))
    head, colon, tail = plain.rpartition(": ")
    # "Chess table: play chess"; but not "Enjoy a cake at Cafe Engel: the new one", nor "Work at M. A. D: Micro Design".
    if colon and (_begins_with_verb(tail, verbs) or not _begins_with_verb(head, verbs)):
        plain = tail
    plain = re.sub(r"\s*\([^)]*\)|[?()]", "", plain)
    plain = re.split(r"[!;:] |(?<=[a-z]{4})\. ", plain)[0].strip().rstrip(".!,;:")
    return plain if len(plain) <= _MAX_ACTIVITY else plain[:_MAX_ACTIVITY].rsplit(" ", 1)[0].rstrip(" ,;")


def _begins_with_verb(words: str, verbs: Verbs) -> bool:
    """Whether an activity begins with a verb, or with an adverb and a verb."""
    first, second = [*(word.strip(",.").lower() for word in words.split(" ", 2)), "", ""][:2]
    if first in verbs.verbs:
        return not (first in verbs.nouns and second in verbs.occasions) and (first, second) != (
            "visit",
            "to",
        )
    if _is_adverb(first, verbs):
        return second in verbs.verbs
    # Any other word before an article is a verb: "Untangle the nets".
    return first.isalpha() and second in _DETERMINERS and first not in _PARTICLES | _DETERMINERS


def _is_adverb(word: str, verbs: Verbs) -> bool:
    return word in _ADVERBS or (word.endswith("ly") and word not in verbs.verbs)


def _is_verb(part: str, before: str, verbs: Verbs) -> bool:
    """Whether what follows "and" begins with a verb; `before` is what comes before."""
    first, second, *_ = [*part.split(" "), "", ""]
    if _is_adverb(first, verbs) and second in verbs.verbs:
        return True
    if first not in verbs.verbs:
        return False
    # After verbs without an object: "wash and dress", "get up and walk".
    bare = all(word in verbs.verbs or word in _PARTICLES for word in before.split(" "))
    if bare or first not in verbs.nouns or second in _DETERMINERS:
        return True
    if first in verbs.dishes:
        return bool(second) and second not in _PARTICLES
    return bool(second) or before.split(" ", 1)[0] not in _HAVING_VERBS


def _to_participle(part: str, verbs: Verbs) -> str:
    """Put the verb that words begin with into its participle."""
    first, space, rest = part.partition(" ")
    if _is_adverb(first, verbs):
        return f"{first} {_to_participle(rest, verbs)}"
    return f"{participle(first)}{space}{rest}"
