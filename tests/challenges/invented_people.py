"""Profiles that tests of the influence challenge talk to: drawn by seed, no community needed."""

from __future__ import annotations

import numpy as np

from vico.agents.influence.situation import Profile, Tie

VALUES = (
    "self-direction", "stimulation", "hedonism", "achievement", "power",
    "security", "conformity", "tradition", "benevolence", "universalism",
)  # fmt: skip
HOBBIES = ("cooking", "running", "chess", "film", "singing", "photography", "baking bread", "languages", "dancing")
GROUPS = ("Choir", "Chess table at The Anchor", "Film club", "Board game crowd")
NAMES = (
    "Ada", "Bo", "Carl", "Dina", "Eino", "Fay", "Gus", "Hilde", "Ida", "Jon", "Kai", "Lea", "Mo", "Nils", "Oda",
)  # fmt: skip
SAYS = {
    "self-direction": "freedom", "stimulation": "adventure", "hedonism": "good food", "achievement": "ambition",
    "power": "influence", "security": "safety", "conformity": "good manners", "tradition": "family recipes",
    "benevolence": "lending a hand to friends in need", "universalism": "fairness",
}  # fmt: skip


def invented_people(seed: int = 0, count: int = 15) -> list[Profile]:
    """Return residents, the first two of whom may be main agents; neighbours in the list know each other."""
    chance = np.random.default_rng(seed)

    def some(options: tuple[str, ...], number: int) -> tuple[str, ...]:
        return tuple(options[int(k)] for k in chance.choice(len(options), number, replace=False))

    people = []
    for k in range(count):
        five = [round(float(v), 2) for v in np.clip(chance.normal(0.55, 0.19, 5), 0.05, 0.95)]
        ties = tuple(Tie(f"resident_{j}", "friend", 0.5) for j in (k - 1, k + 1) if 0 <= j < count)
        people.append(
            Profile(
                id=f"resident_{k}",
                name=f"{NAMES[k]} Invented",
                age=30,
                occupation="clerk",
                values=some(VALUES, 3),
                five=(five[0], five[1], five[2], five[3], five[4]),
                traits=("kind",),
                hobbies=some(HOBBIES, 2),
                groups=some(GROUPS, 1),
                ties=ties,
            )
        )
    return people


def about(*topics: str) -> str:
    """Say something about one or two topics, in enough words for each."""
    told = " and ".join(SAYS.get(topic, topic) for topic in topics)
    return f"To be honest with you, there is hardly anything that matters to me like {told} does these days."
