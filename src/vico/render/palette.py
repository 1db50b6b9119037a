"""Materials by number, with their textures packed: scenes of one city share them."""

from __future__ import annotations

from dataclasses import fields

from vico.render.textures import Textures, pack_textures
from vico.world.mesh import Material

_PLAIN = [field.name for field in fields(Material) if field.name != "texture"]


class Palette:
    """Numbers for materials: those that look the same share one.

    Where scenes share a palette, those made later find the textures of those made before in memory. A scene keeps the
    textures that there were when it was made.
    """

    def __init__(self) -> None:
        self._entries: list[Material] = []
        self._known: dict[tuple[object, ...], int] = {}
        self._packed: Textures | None = None

    @property
    def names(self) -> list[str]:
        """Names of all materials so far."""
        return [material.name for material in self._entries]

    def number(self, material: Material) -> int:
        """Return a material's number; it gets one where it has none yet."""
        # The picture is known by its object, which stays: its material is kept.
        key = (id(material.texture), *(getattr(material, name) for name in _PLAIN))
        if key not in self._known:
            self._known[key] = len(self._entries)
            self._entries.append(material)
            self._packed = None
        return self._known[key]

    def packed(self) -> Textures:
        """Return the textures of all materials so far; the same arrays until there is another one."""
        if self._packed is None:
            self._packed = pack_textures(self._entries)
        return self._packed
