"""Which question a message holds, by forms that are data: ``vico/data/talk/questions.toml``."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Literal

from pydantic import Field

from vico.errors import SchemaError
from vico.io.data_files import DataRecord, cached_data, data_files, read_record

GUIDE = "docs/talk.md"
ROOM = "talk"

Kind = Literal["seen", "way", "where", "doing", "did", "plans", "who"]

#: Kinds of questions that are about somebody or something, which their forms name by ``{what}``.
ABOUT = ("seen", "way", "where")
# Longer messages are no questions, characters; and so long may be what is asked for.
_MOST, _MOST_WHAT = 400, 100
# The dot of a title ends no sentence.
_TITLE = re.compile(r"\b(mrs?|ms|mx|dr|prof)\.(?=\s)", re.IGNORECASE)


class QuestionForms(DataRecord):
    """The forms of a kind of question."""

    kind: Kind
    about: Annotated[str, Field(min_length=1)]
    forms: Annotated[list[str], Field(min_length=1)]


class _File(DataRecord):
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


def _pattern(form: str) -> re.Pattern[str]:
    """Return what a form at the end of something said is known by."""
    words = [re.escape(part) for part in form.split("{what}")]
    return re.compile(r"(?:^|(?<=[\s,;:.!]))" + f"(?P<what>.{{1,{_MOST_WHAT}}}?)".join(words) + "$", re.IGNORECASE)


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
        return [(question.kind, _pattern(form)) for question in self.questions for form in question.forms]

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
        if len(text) > _MOST:
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
    """Read all forms: the package's, then those of a user's own ``$VICO_DATA/talk/questions*.toml``.

    Raises
    ------
    SchemaError
        If a file is damaged, or a form is not written as `docs/talk.md` says.
    """
    questions: list[QuestionForms] = []
    courtesies: list[str] = []
    articles: list[str] = []
    for path in data_files(ROOM, "questions"):
        file = read_record(path, _File, guide=GUIDE)
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


__all__ = ["ABOUT", "GUIDE", "Grammar", "Kind", "Question", "QuestionForms", "read_grammar"]
