"""The toy town and its people, made once a session."""

import pytest

from toytown import make_world
from vico.community import Community, build_community
from vico.world.world import World


@pytest.fixture(scope="session")
def town() -> World:
    return make_world()


@pytest.fixture(scope="session")
def community(town: World) -> Community:
    return build_community(town, residents=15, seed=0)
