"""Splits: which episodes are for training and which are kept apart, by world, by person, or one by one."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from vico.errors import InputError

By = Literal["world", "person", "episode"]
TRAIN, VALIDATION, TEST = "train", "validation", "test"
#: In the order in which a dataset holds them.
SPLITS = (TRAIN, VALIDATION, TEST)


@dataclass(frozen=True)
class SplitRule:
    """How episodes are split.

    Attributes
    ----------
    by
        What is never in two splits: a world, a person, or only an episode itself. A person is whoever acts (residents)
        or asks (tasks); episodes that share a person stay together.
    test, validation
        Share of the episodes, at least, 0..1; 0 for none.
    seed
        Decides which.
    """

    by: By = "episode"
    test: float = 0.1
    validation: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        if not (self.test >= 0.0 and self.validation >= 0.0 and self.test + self.validation < 1.0):
            raise InputError(
                f"splits: test {self.test:g} and validation {self.validation:g}; give shares from 0, together below 1"
            )


@dataclass(frozen=True)
class Member:
    """What decides in which split an episode is.

    Attributes
    ----------
    name
        Of the episode, unique.
    world
        Digest of its world.
    persons
        Who acts or asks in it.
    """

    name: str
    world: str
    persons: Sequence[str]


def assign(members: Sequence[Member], rule: SplitRule) -> list[str]:
    """Return the split of each episode.

    Raises
    ------
    InputError
        If there are too few groups that have nothing in common.
    """
    wanted = [(TEST, rule.test), (VALIDATION, rule.validation)]
    parts = [(split, share) for split, share in wanted if share > 0.0]
    groups = _groups(members, rule.by)
    if len(groups) < len(parts) + 1:
        raise InputError(
            f"splits: by {rule.by} there {'is one group' if len(groups) == 1 else f'are {len(groups)} groups'} of "
            f"episodes that share no {rule.by}, and {len(parts) + 1} are needed; take more worlds or persons, "
            "--split-by episode, or --test 0"
        )
    order = sorted(groups, key=lambda name: hashlib.sha256(f"{rule.seed}\0{name}".encode()).digest())
    found = dict.fromkeys(range(len(members)), TRAIN)
    for split, share in parts:
        _fill(found, split, share, order, groups, len(parts))
    return [found[k] for k in range(len(members))]


def _fill(
    found: dict[int, str],
    split: str,
    share: float,
    order: list[str],
    groups: Mapping[str, Sequence[int]],
    parts: int,
) -> None:
    """Move groups into a split until it has its share; one group at least, and one is left for every other split."""
    taken = 0
    while order and (not taken or taken < share * len(found)):
        if taken and len(order) <= parts:
            return
        for member in groups[order.pop(0)]:
            found[member] = split
            taken += 1


def _groups(members: Sequence[Member], by: By) -> dict[str, list[int]]:
    """Return the episodes that have to stay together, by the name of the group."""
    keys = [_keys(member, by) for member in members]
    root: dict[str, str] = {key: key for mine in keys for key in mine}

    def find(key: str) -> str:
        while root[key] != key:
            root[key] = root[root[key]]
            key = root[key]
        return key

    for mine in keys:
        for key in mine[1:]:
            first, second = sorted((find(mine[0]), find(key)))
            root[second] = first
    groups: dict[str, list[int]] = {}
    for k, mine in enumerate(keys):
        groups.setdefault(find(mine[0]), []).append(k)
    return groups


def _keys(member: Member, by: By) -> list[str]:
    if by == "world":
        return [member.world]
    if by == "person" and member.persons:
        return [f"{member.world} {person}" for person in member.persons]
    return [member.name]
