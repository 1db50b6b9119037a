"""What offline main agents can say: lines by value, hobby and group, read from ``vico/data/influence/lines*.toml``."""

from __future__ import annotations

from pydantic import Field

from vico.errors import EmptyInputError
from vico.io.data_files import DataRecord, cached_data, data_files, read_record

GUIDE = "docs/influence.md"


class ValueLines(DataRecord):
    """Lines about a value: of who shares it with the listener, and of who knows that they hold it."""

    name: str
    shared: tuple[str, ...]
    theirs: tuple[str, ...]


class TopicLines(DataRecord):
    """Lines about any hobby, or any group."""

    shared: tuple[str, ...] = ()
    theirs: tuple[str, ...] = ()
    own: tuple[str, ...] = ()


class EndingLines(DataRecord):
    """How a message ends, by what the listener is like."""

    outgoing: tuple[str, ...] = ()
    open: tuple[str, ...] = ()
    careful: tuple[str, ...] = ()
    anxious: tuple[str, ...] = ()
    reserved: tuple[str, ...] = ()
    plain: tuple[str, ...] = ()


class KindWords(DataRecord):
    """Friendly words that fit everybody."""

    general: tuple[str, ...] = ()


class Lines(DataRecord):
    """A file of lines; those of a user add to those of the package."""

    openings: tuple[str, ...] = ()
    value: tuple[ValueLines, ...] = ()
    hobby: TopicLines = TopicLines()
    group: TopicLines = TopicLines()
    endings: EndingLines = EndingLines()
    kind_words: KindWords = Field(default_factory=KindWords)

    @property
    def values(self) -> dict[str, ValueLines]:
        """Lines by value."""
        return {value.name: value for value in self.value}


@cached_data
def lines() -> Lines:
    """Return all lines there are.

    Raises
    ------
    SchemaError
        If a file is not as it should be.
    EmptyInputError
        If nothing is there to open a conversation with.
    """
    files = [read_record(path, Lines, guide=GUIDE) for path in data_files("influence", "lines")]
    found = Lines(
        openings=tuple(line for file in files for line in file.openings),
        value=tuple(value for file in files for value in file.value),
        hobby=_joined([file.hobby for file in files]),
        group=_joined([file.group for file in files]),
        endings=EndingLines(
            **{
                name: tuple(line for f in files for line in getattr(f.endings, name))
                for name in EndingLines.model_fields
            }
        ),
        kind_words=KindWords(general=tuple(line for file in files for line in file.kind_words.general)),
    )
    if not (found.openings and found.kind_words.general and found.endings.plain):
        raise EmptyInputError(f"influence lines: openings, kind words or plain endings are missing; see {GUIDE}")
    return found


def _joined(parts: list[TopicLines]) -> TopicLines:
    return TopicLines(**{name: tuple(s for p in parts for s in getattr(p, name)) for name in TopicLines.model_fields})
