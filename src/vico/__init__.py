"""Virtual Community: an open world for humans, robots and society."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from vico.envs import make

__version__ = "0.1.0"
__all__ = ["__version__", "make"]


def __getattr__(name: str) -> Any:
    """Import `make` when it is asked for: `import vico` alone stays quick."""
    if name == "make":
        from vico.envs import make

        return make
    raise AttributeError(f"module 'vico' has no attribute {name!r}")
