"""Where assistants start: as a run says, or by the seed."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import toy_city
from vico.errors import InputError
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation

SPOT = (2.0, -3.0, 0.5)


def positions(**settings: Any) -> dict[str, tuple[float, ...]]:
    """Where assistants are, x, y and yaw, of three in the toy city."""
    sim = Simulation(toy_city.world(), None, SimConfig(assistants=3, observe=(), seed=1, **settings))
    people = sim.state.people
    return {
        name: (*people.position[i, :2].tolist(), float(people.yaw[i]))
        for i, name in enumerate(people.names)
        if name.startswith("assistant_")
    }


def test_assistants_start_where_a_run_places_them_and_the_others_by_the_seed() -> None:
    by_seed, placed = positions(), positions(assistant_places={"assistant_1": SPOT})
    assert placed["assistant_1"] == pytest.approx(SPOT)
    assert by_seed["assistant_1"] != placed["assistant_1"]
    assert (placed["assistant_0"], placed["assistant_2"]) == (by_seed["assistant_0"], by_seed["assistant_2"])


@pytest.mark.parametrize(
    ("places", "says"),
    [
        ({"assistant_7": SPOT}, "nobody is called 'assistant_7'; there are assistant_0, assistant_1, assistant_2"),
        ({"assistant_0": (0, 0)}, r"assistant_0: \(0, 0\); give x, y"),
        ({"assistant_0": (1e6, 0, 0)}, "there is no free ground"),
        ({"assistant_0": SPOT, "assistant_1": SPOT, "assistant_2": (2.01, -3.0, 0.0)}, None),
        ([1], r'give a table of places by name, such as {"assistant_0"'),
    ],
)
def test_places_that_make_no_sense_are_refused_and_those_too_near_are_moved_apart(
    places: Any, says: str | None
) -> None:
    if says is None:
        assert len(set(positions(assistant_places=places).values())) == 3
        return
    with pytest.raises(InputError, match=f"assistant_places: .*{says}"):
        positions(assistant_places=places)


def test_people_of_one_room_start_farther_apart_than_chest_to_chest() -> None:
    sim = Simulation(toy_city.world(), toy_city.community(), SimConfig(start=7 * 3600, observe=()))
    people = sim.state.people
    standing = np.flatnonzero((people.seat < 0) & (people.room == people.room[0]))
    spots = people.position[standing, :2]
    assert len(spots) == 3
    assert np.hypot(*(spots[:, None] - spots[None])[np.triu_indices(3, 1)].T).min() >= 1.0
