"""Options of an environment that are of another kind than they have to be."""

from __future__ import annotations

from datetime import date
from typing import Any

import numpy as np
import pytest

from vico.envs.spec import EnvSpec
from vico.errors import InputError


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"cars": "30"}, "cars is '30'; it has to be a whole number, such as 30"),
        ({"cars": 2.5}, "cars is 2.5; it has to be a whole number"),
        ({"cars": True}, "cars is True; it has to be a whole number"),
        ({"seed": "0"}, "seed is '0'"),
        ({"start": 8}, "start is 8; it has to be text"),
        ({"transit": "no"}, "transit is 'no'; it has to be True or False"),
        ({"utc_offset": "3"}, "utc_offset is '3'; it has to be None or a number"),
        ({"robots": 3}, "robots is 3; it has to be names, as in ('husky', 'go2')"),
        ({"observe": 1}, "observe is 1; it has to be 'all', 'none', or names"),
        ({"max_step": 5}, "there is no option 'max_step'; did you mean 'max_steps'?"),
    ],
)
def test_an_option_of_another_kind_is_named(options: dict[str, Any], told: str) -> None:
    with pytest.raises(InputError) as caught:
        EnvSpec.of("W", None, options)  # type: ignore[arg-type]
    assert told in str(caught.value)


def test_what_is_plainly_meant_is_taken() -> None:
    spec = EnvSpec.of("W", None, {"robots": "husky, go2", "cars": np.int64(3), "date": date(2026, 1, 5)})  # type: ignore[typeddict-item]
    assert (spec.robots, spec.cars, spec.date) == (("husky", "go2"), 3, "2026-01-05")
    assert type(spec.cars) is int
