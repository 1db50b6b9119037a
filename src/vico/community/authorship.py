"""Who wrote what of a community that a language model had a part in: item by item, and why where the model did not."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from enum import StrEnum

from vico.world.model import Record


class Origin(StrEnum):
    """Why an item is whose it is; all but the first are the procedural author's."""

    WRITTEN = "written by the model"
    NOT_ASKED = "not asked of the model"
    NO_ANSWER = "no answer"
    UNUSABLE = "no usable reply"
    NOT_GROUNDED = "not grounded"


class AuthoredItem(Record):
    """An item of a community, and whose it is.

    Attributes
    ----------
    item
        ``resident_3.character``, ``resident_3.groups``, ``resident_3.schedule`` or ``relations``.
    origin
        Whose it is and why.
    detail
        More of why, such as what the validator found in the last draft; a sentence at most.
    moved
        Of a schedule that the model wrote: by how many minutes the start or end of a stay was moved at most, so that
        the ways between them take as long as they do.
    """

    item: str
    origin: Origin
    detail: str = ""
    moved: int = 0


class Authorship(Record):
    """Who wrote what.

    Attributes
    ----------
    model
        Name of the language model.
    prompts
        SHA-256 of each prompt it was asked with, by name.
    """

    model: str
    prompts: dict[str, str]
    items: list[AuthoredItem]

    @property
    def counts(self) -> Mapping[str, Mapping[Origin, int]]:
        """How many items of each kind (character, groups, schedule, relations) have which origin."""
        found: dict[str, Counter[Origin]] = {}
        for one in self.items:
            found.setdefault(one.item.rpartition(".")[2], Counter())[one.origin] += 1
        return found

    @property
    def written(self) -> int:
        """How many items are the model's."""
        return sum(one.origin is Origin.WRITTEN for one in self.items)

    @property
    def fallen_back(self) -> list[AuthoredItem]:
        """Return the items that the model was to write and did not."""
        return [one for one in self.items if one.origin not in (Origin.WRITTEN, Origin.NOT_ASKED)]
