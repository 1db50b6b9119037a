"""What the small solids of a building wear: by the `finish` of their plan."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

Rgb = tuple[int, int, int]


@dataclass(frozen=True)
class Finish:
    """The stuffs of one kind of small solid.

    Attributes
    ----------
    side, tint
        Material and colour of its sides.
    picture
        What its outline's edges show from bottom to top, where that is not plain; "" nothing.
    bay
        Width of one of the picture's bays, metres.
    shown
        Which edges of the outline show the picture; empty: all.
    cover, cover_tint
        Material and colour of what faces up; "" the building's roof.
    under, under_tint
        Of what faces down.
    """

    side: str
    tint: Rgb
    picture: str = ""
    bay: float = 1.0
    shown: tuple[int, ...] = ()
    cover: str = "roof_gravel"
    cover_tint: Rgb = (150, 148, 146)
    under: str = "blank_plaster"
    under_tint: Rgb = (168, 164, 158)


_WHITE: Rgb = (255, 255, 255)

FINISHES: Mapping[str, Finish] = {
    "cornice": Finish("blank_plaster", (255, 253, 248), cover="roof_metal", cover_tint=(112, 112, 112)),
    "penthouse": Finish("blank_plaster", (190, 192, 194)),
    "chimney": Finish("blank_brick", (226, 210, 200), cover="blank_plaster", cover_tint=(120, 116, 112)),
    "post": Finish("blank_plaster", (150, 152, 156)),
    "eaves": Finish("blank_plaster", (214, 208, 198), cover="", under_tint=(206, 200, 190)),
    "eaves_wood": Finish("blank_boards", (128, 92, 66), cover="", under="blank_boards", under_tint=(122, 88, 64)),
    "dormer": Finish("blank_plaster", (196, 192, 186), "dormer", 1.4, (0,), cover=""),
    "rail_wood": Finish("rail_open", _WHITE, "rail_wood", 1.25, (0, 1, 2), "rail_open", _WHITE, "rail_deck",
                        (142, 104, 76)),
    "rail_iron": Finish("rail_open", _WHITE, "rail_iron", 1.25, (0, 1, 2), "rail_open", _WHITE, "rail_deck",
                        (206, 202, 196)),
    "rail_glass": Finish("rail_open", _WHITE, "rail_glass", 1.25, (0, 1, 2), "rail_open", _WHITE, "rail_deck",
                         (206, 202, 196)),
    "rail_landing": Finish("rail_open", _WHITE, "rail_landing", 1.0, (0, 1, 2), "rail_open", _WHITE, "rail_deck",
                           (72, 70, 70)),
    "steps": Finish("rail_open", _WHITE, "rail_steps", 3.0, (1, 3), "rail_open", _WHITE, "rail_open", _WHITE),
    "trestle": Finish("rail_open", _WHITE, "rail_trestle", 2.4, (), "rail_open", _WHITE, "rail_open", _WHITE),
    "cornice_tin_cream": Finish("blank_plaster", (222, 206, 178), cover="roof_metal", cover_tint=(120, 116, 112)),
    "cornice_tin_green": Finish("blank_plaster", (104, 122, 106), cover="roof_metal", cover_tint=(104, 108, 104)),
    "cornice_tin_brown": Finish("blank_plaster", (122, 84, 70), cover="roof_metal", cover_tint=(108, 96, 90)),
    "tank": Finish("blank_boards", (152, 118, 90), cover="roof_slate", cover_tint=(96, 84, 76)),
}  # fmt: skip
"""By name; a plan without finish has rooms and wears what its building wears."""
