"""Rows that others have published, to stand beside ours: data with a strict loader.

A file ``published_NAME.toml`` in ``vico/data/challenges``, or in the folder ``challenges`` of ``$VICO_DATA``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from pydantic import Field, StrictBool, StrictFloat, StrictInt

from vico.challenges.records import Setting
from vico.io.data_files import DataRecord, cached_data, data_files, read_record

_PREFIX = "published_"
_GUIDE = "docs/evaluation.md"
#: Instead of a category: whichever the challenge has.
_ANY = "*"


class _PublishedRow(DataRecord):
    challenge: str
    setting: dict[str, StrictBool | StrictInt | StrictFloat | str] = Field(default_factory=dict)
    method: str
    values: dict[str, dict[str, float]] = Field(min_length=1)
    average: float | None = None


class _PublishedFile(DataRecord):
    about: str
    rows: tuple[_PublishedRow, ...] = Field(min_length=1)


@dataclass(frozen=True)
class Published:
    """A row of somebody else's table.

    Attributes
    ----------
    source
        Name of the file it is from.
    about
        What was published.
    setting
        Of it; what it does not name fits every one.
    values
        By category and metric.
    average
        Of the first metric over all categories, where it was given.
    """

    source: str
    about: str
    challenge: str
    setting: Setting
    method: str
    values: Mapping[str, Mapping[str, float]]
    average: float | None

    @property
    def label(self) -> str:
        """How a table names it: whose it is, and the method."""
        return f"{self.source}: {self.method}"

    def of(self, category: str) -> Mapping[str, float]:
        """Return its values in a category, by metric."""
        return self.values.get(category) or self.values.get(_ANY, {})


@cached_data
def _all() -> list[Published]:
    rows = []
    for path in data_files("challenges", _PREFIX):
        found = read_record(path, _PublishedFile, guide=_GUIDE)
        source = path.stem.removeprefix(_PREFIX)
        rows += [
            Published(source, found.about, row.challenge, row.setting, row.method, row.values, row.average)
            for row in found.rows
        ]
    return rows


def published_rows(challenge: str, setting: Setting) -> list[Published]:
    """Return what was published of a challenge in a setting; what only one of the two names keeps none away.

    Raises
    ------
    SchemaError
        If a file is not as it should be.
    """
    return [
        row
        for row in _all()
        if row.challenge == challenge and all(setting.get(name, value) == value for name, value in row.setting.items())
    ]
