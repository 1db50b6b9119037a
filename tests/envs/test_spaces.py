"""The rich form: Gymnasium's own spaces, samples that are valid, texts in any script."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces

import toy_city
import vico
from vico.envs.spaces import CHARACTERS, TextSpace, escape_text, unescape_text


def parts(space: spaces.Space[Any]) -> Iterator[spaces.Space[Any]]:
    """A space and all spaces in it."""
    yield space
    if isinstance(space, spaces.Dict):
        for one in space.spaces.values():
            yield from parts(one)
    if isinstance(space, spaces.Sequence):
        yield from parts(space.feature_space)


@pytest.mark.parametrize("form", ["rich", "arrays"])
def test_every_space_is_gymnasiums_own_and_contains_its_samples(form: str) -> None:
    env = vico.make(
        toy_city.world(), toy_city.community(), assistants=1, robots=("husky",), observe="all", image=16, form=form
    )
    for name in env.possible_agents:
        for space in (env.observation_space(name), env.action_space(name)):
            # Text is shown shorter than Gymnasium's, and is one of them.
            kinds = {spaces.Text if isinstance(one, TextSpace) else type(one) for one in parts(space)}
            assert {kind.__module__ for kind in kinds} <= {f"gymnasium.spaces.{m}" for m in MODULES}
            space.seed(1)
            assert all(space.contains(space.sample()) for _ in range(5))


MODULES = ("box", "dict", "discrete", "multi_discrete", "text", "sequence")


def test_numbers_lists_and_texts_are_what_gymnasium_takes_them_for() -> None:
    env = vico.make(toy_city.world(), toy_city.community(), assistants=1, observe="none")
    observations, _ = env.reset(seed=0)
    seen = observations["resident_0"]
    assert isinstance(seen["state"]["time"], np.ndarray)
    assert isinstance(seen["state"]["doors"], tuple)
    assert seen["state"]["held"].tolist() == [0, 0]
    assert float(seen["state"]["time"]) == 8 * 3600
    flat = gymnasium.spaces.flatten_space(env.observation_space("resident_0")["state"]["time"])
    assert flat.shape == (1,)


@pytest.mark.parametrize("text", ["Huomenta, maailma!", "Ελλάδα 12 €", "Добрый день", "", "tab\tand line\n"])
def test_texts_of_alphabetic_scripts_stay_what_they_are(text: str) -> None:
    assert escape_text(text, 1000) == text


@pytest.mark.parametrize("text", ["東京駅", "مرحبا", "see you 😀"])
def test_texts_of_other_scripts_are_escaped_and_can_be_read_back(text: str) -> None:
    told = escape_text(text, 1000)
    assert set(told) <= set(CHARACTERS)
    assert unescape_text(told) == text


def test_a_text_is_cut_off_between_characters() -> None:
    assert escape_text("a東京", 8) == "a\\u6771"
    assert escape_text("abc", 2) == "ab"
