"""Households: who lives with whom, how old they are, and what they are called."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vico.community.childhood import GROWN_UP, YOUNGEST
from vico.community.names import NameBook
from vico.community.people import Household, ResidentDraft

# Kind, weight, and the status of each member; w worker, f freelancer, s student, r retired, g guest, c child.
_HOUSEHOLDS: tuple[tuple[str, float, str], ...] = (
    ("single", 4.0, "w"),
    ("single", 1.3, "f"),
    ("single", 1.2, "r"),
    ("single", 0.6, "s"),
    ("couple", 1.9, "ww"),
    ("couple", 1.3, "wf"),
    ("couple", 1.1, "rr"),
    ("couple", 0.3, "wr"),
    ("flatmates", 1.0, "ss"),
    ("flatmates", 0.6, "ssw"),
    ("flatmates", 1.0, "ww"),
    ("parent", 0.9, "ws"),
    ("parent", 0.3, "ww"),
    ("siblings", 0.7, "ww"),
    ("guest", 1.0, "g"),
    ("family", 2.2, "wwc"),
    ("family", 2.6, "wwcc"),
    ("family", 0.8, "wwccc"),
    ("family", 1.0, "wfc"),
    ("family", 1.2, "wfcc"),
    ("family", 1.1, "wc"),
    ("family", 0.7, "wcc"),
    ("family", 0.3, "fc"),
    ("family", 0.1, "ffcc"),
)
_STATUS = {"w": "worker", "f": "freelancer", "s": "student", "r": "retired", "g": "guest", "c": "pupil"}
# Of a town's residents from five years on; those of 5 to 17 are about a seventh in older countries, a fifth elsewhere.
_SHARES = {"w": 0.48, "f": 0.10, "s": 0.10, "r": 0.13, "g": 0.04, "c": 0.15}
# Years between brothers and sisters, and from a parent to the eldest child: least, most usual, most.
_BETWEEN, _FIRST_CHILD = (1, 2, 6), (20, 29, 42)


def draw_households(
    rng: np.random.Generator, count: int, *, students: bool, guests: bool, workers: bool, largest: int = 5
) -> list[Household]:
    """Draw households for `count` people whose ways of life come in believable shares.

    Parameters
    ----------
    students, guests, workers
        Whether the world has somewhere to study, to stay for a while, and to work.
    largest
        Most members of a household: the beds of the largest home.
    """
    shares = dict(_SHARES)
    for letter, possible in (("s", students), ("g", guests), ("w", workers)):
        if not possible:
            shares[letter] = 0.0
    total = sum(shares.values())
    quota = {k: v / total * count for k, v in shares.items()}
    found: list[Household] = []
    people = 0
    while people < count:
        weights = np.zeros(len(_HOUSEHOLDS))
        for k, (_, weight, members) in enumerate(_HOUSEHOLDS):
            if people + len(members) > count or len(members) > largest or any(shares[m] == 0 for m in members):
                continue
            room = min(quota[m] - (members.count(m) - 1) for m in members)
            weights[k] = weight * (max(room, 0.02) if room < 1 else room**0.5)
        choice = int(rng.choice(len(_HOUSEHOLDS), p=weights / weights.sum()))
        kind, _, members = _HOUSEHOLDS[choice]
        drafts = _members(rng, kind, members, len(found), people)
        for m in members:
            quota[m] -= 1
        people += len(members)
        found.append(Household(kind, drafts))
    _name(rng, found)
    return found


def _age(rng: np.random.Generator, status: str, kind: str) -> int:
    spans = {
        "worker": (22, 34, 64),
        "freelancer": (25, 36, 62),
        "student": (18, 21, 27),
        "retired": (64, 70, 90),
        "guest": (26, 40, 60),
    }
    low, mode, high = (23, 27, 34) if kind == "flatmates" and status == "worker" else spans[status]
    return round(float(rng.triangular(low, mode, high)))


def _members(rng: np.random.Generator, kind: str, members: str, household: int, first: int) -> list[ResidentDraft]:
    statuses = [_STATUS[m] for m in members]
    ages = [0 if status == "pupil" else _age(rng, status, kind) for status in statuses]
    genders = [("female", "male")[int(rng.integers(2))] for _ in members]
    if kind == "family":
        ages = _ages_of_family(rng, statuses.index("pupil"), statuses.count("pupil"))
        if statuses[1] != "pupil" and rng.random() < 0.9:
            genders[1] = "male" if genders[0] == "female" else "female"
    elif kind == "couple":
        low, high = (63, 90) if statuses[1] == "retired" else (22, 64)
        if statuses == ["worker", "retired"]:
            ages[0], low = int(rng.integers(57, 65)), 63
        ages[1] = int(np.clip(ages[0] + round(float(rng.normal(0, 3))), low, high))
        if rng.random() < 0.85:
            genders[1] = "male" if genders[0] == "female" else "female"
    elif kind == "parent":
        child = int(rng.integers(18, 25)) if statuses[1] == "student" else int(rng.integers(21, 27))
        ages = [child + int(rng.integers(24, 36)), child]
    elif kind == "siblings":
        ages[0] = int(rng.integers(23, 45))
        ages[1] = ages[0] + int(rng.integers(2, 6))
    elif kind == "flatmates" and "student" in statuses:
        ages = [int(rng.integers(19, 26)) if s == "student" else int(rng.integers(22, 28)) for s in statuses]
    return [
        ResidentDraft(f"resident_{first + k}", gender, age, status, household)
        for k, (gender, age, status) in enumerate(zip(genders, ages, statuses, strict=True))
    ]


def _ages_of_family(rng: np.random.Generator, parents: int, children: int) -> list[int]:
    """Return the ages of parents and of their children, the eldest first."""
    eldest = int(rng.integers(YOUNGEST + 2 * (children - 1), GROWN_UP))
    ages = [eldest]
    for k in range(1, children):
        gap = round(float(rng.triangular(*_BETWEEN)))
        # The younger ones need a year each.
        ages.append(max(ages[-1] - gap, YOUNGEST + children - 1 - k))
    first = eldest + round(float(rng.triangular(*_FIRST_CHILD)))
    second = int(np.clip(first + round(float(rng.normal(0, 3))), eldest + _FIRST_CHILD[0] - 2, 64))
    return [min(first, 60), second][:parents] + ages


def _name(rng: np.random.Generator, households: Sequence[Household]) -> None:
    book = NameBook(rng)
    for household in households:
        family = book.family()
        shared = household.kind in ("parent", "siblings")
        if household.kind in ("couple", "family"):
            shared = bool(rng.random() < 0.5)
        for k, draft in enumerate(household.members):
            # Children are called as their first parent is.
            full = book.full(draft.gender, family if shared or k == 0 or draft.child else book.family())
            draft.first, draft.last = full.split(" ", 1)
