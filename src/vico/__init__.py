"""Virtual Community: an open world for humans, robots and society.

>>> import vico
>>> world = vico.build_world("helsinki", radius=150)         # doctest: +SKIP
>>> people = vico.build_community(world, residents=5)        # doctest: +SKIP
>>> env = vico.make(world, people, assistants=1)             # doctest: +SKIP
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from vico.version import __version__

if TYPE_CHECKING:
    from vico.agents.single import make_vec
    from vico.api import build_community, build_world, check_community, check_world, read_world, view_world
    from vico.community import read_community
    from vico.envs import EnvSpec, check_env, make, make_parallel_vec

__all__ = [
    "EnvSpec",
    "__version__",
    "build_community",
    "build_world",
    "check_community",
    "check_env",
    "check_world",
    "make",
    "make_parallel_vec",
    "make_vec",
    "read_community",
    "read_world",
    "view_world",
]

_WHERE = {
    "EnvSpec": "vico.envs",
    "build_community": "vico.api",
    "build_world": "vico.api",
    "check_community": "vico.api",
    "check_env": "vico.envs",
    "check_world": "vico.api",
    "make": "vico.envs",
    "make_parallel_vec": "vico.envs",
    "make_vec": "vico.agents.single",
    "read_community": "vico.community",
    "read_world": "vico.api",
    "view_world": "vico.api",
}


def __getattr__(name: str) -> Any:
    """Import what is asked for: `import vico` alone stays quick."""
    if name not in _WHERE:
        raise AttributeError(f"module 'vico' has no attribute {name!r}")
    value = globals()[name] = getattr(import_module(_WHERE[name]), name)
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
