"""How carefully pictures are made: switches, each with its price."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from vico.errors import InputError


@dataclass(frozen=True)
class RenderQuality:
    """What is done beyond a quick picture; nothing, unless told.

    Attributes
    ----------
    soft_shadows
        The rims of the sun's shadows are blurred instead of following the texels of the shadow map.
    ambient_occlusion
        Corners, and the ground beneath things, get less light from around.
    smooth_edges
        Edges of what stands before something else are smoothed.
    reflections
        Windows and other glass mirror the sky and the street.
    interiors
        Rooms are seen behind windows: the shop's own behind its front, behind others one that might be there.
    """

    soft_shadows: bool = False
    ambient_occlusion: bool = False
    smooth_edges: bool = False
    reflections: bool = False
    interiors: bool = False

    @property
    def is_plain(self) -> bool:
        """Whether nothing is done."""
        return not any(getattr(self, field.name) for field in fields(self))

    @classmethod
    def of(cls, wanted: str | Mapping[str, Any]) -> RenderQuality:
        """Make a record of ``"plain"``, ``"fine"`` (everything), or of switches by name.

        Raises
        ------
        InputError
            If it is another word, a switch is unknown, or not true or false.
        """
        names = [field.name for field in fields(cls)]
        if isinstance(wanted, str):
            if wanted not in ("plain", "fine"):
                raise InputError(f"quality: {wanted!r}; it has to be plain, fine, or switches: {', '.join(names)}")
            return cls(**dict.fromkeys(names, wanted == "fine"))
        for name, value in wanted.items():
            if name not in names or not isinstance(value, bool):
                raise InputError(f"quality: {name!r} is {value!r}; switches are {', '.join(names)}, true or false")
        return cls(**wanted)


PLAIN, FINE = RenderQuality(), RenderQuality.of("fine")
