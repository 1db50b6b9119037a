"""The schema of a file of models: strict, one entry a model, one labelled primitive a part.

`docs/adding_a_model.md` says how to write one. Lengths are metres, angles degrees; the frame is that of `Model`.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from vico.io.data_files import DataRecord

Number = Annotated[float, Field(strict=True, ge=-1000.0, le=1000.0, allow_inf_nan=False)]
Length = Annotated[float, Field(strict=True, gt=0.0, le=100.0, allow_inf_nan=False)]
Radius = Annotated[float, Field(strict=True, ge=0.0, le=100.0, allow_inf_nan=False)]
Sides = Annotated[int, Field(strict=True, ge=3, le=64)]
Channel = Annotated[int, Field(strict=True, ge=0, le=255)]
Point = tuple[Number, Number, Number]
Corner = tuple[Number, Number]
Rgb = tuple[Channel, Channel, Channel]
ColourName = Annotated[str, Field(strict=True, min_length=1, max_length=40)]
ColourSpec = ColourName | Rgb
Grip = Literal["handle", "hand", "arms"]
Category = Literal["amenity", "natural", "transit", "indoor"]


class _Placed(DataRecord):
    """Something that stands once or several times in a model.

    Attributes
    ----------
    at
        Where it is, or a list of where its copies are.
    mirror
        Further copies at the places mirrored in x, in y or in both: the first stands where the entry says.
    repeat, step, turn
        Number of copies, and how far each is moved and turned about the model's z axis from the one before.
    """

    at: Point | list[Point] = (0.0, 0.0, 0.0)
    mirror: Literal["x", "y", "xy"] | None = None
    repeat: Annotated[int, Field(strict=True, ge=1, le=200)] = 1
    step: Point = (0.0, 0.0, 0.0)
    turn: Number = 0.0


class _Primitive(_Placed):
    """A shape of one colour. A list of colours goes round its copies; inside a group, round those of the group."""

    colour: ColourSpec | list[ColourSpec]


class _Turnable(_Primitive):
    """A shape that stands on z and may be turned about z, or laid so that its axis points to +x or +y."""

    yaw: Number = 0.0
    facing: Literal["up", "x", "y"] = "up"


class BoxPart(_Turnable):
    """A box of extents `size` along x, y, z around `at`."""

    shape: Literal["box"]
    size: tuple[Length, Length, Length]


class CylinderPart(_Turnable):
    """A capped cylinder whose foot is at `at`; a cone with another `top_radius`."""

    shape: Literal["cylinder"]
    radius: Radius
    length: Length
    top_radius: Radius | None = None
    sides: Sides = 8


class LathePart(_Turnable):
    """A solid of revolution from a profile of (radius, z), bottom to top; `inside_out` turns its faces round."""

    shape: Literal["lathe"]
    profile: Annotated[list[tuple[Radius, Number]], Field(min_length=2, max_length=60)]
    sides: Sides = 8
    smooth: bool = True
    inside_out: bool = False


class BallPart(_Turnable):
    """An ellipsoid around `at`."""

    shape: Literal["ball"]
    radii: tuple[Length, Length, Length]
    sides: Sides = 8
    rings: Annotated[int, Field(strict=True, ge=2, le=64)] = 5


class TubePart(_Primitive):
    """Straight bars from point to point of a path, open at the ends; `end_radius` is that at the end of each."""

    shape: Literal["tube"]
    path: Annotated[list[Point], Field(min_length=2, max_length=100)]
    radius: Radius
    end_radius: Radius | None = None
    sides: Sides = 4


class RingPart(_Primitive):
    """A flat ring around `axis`, seen from both sides; `radius` is its outer one."""

    shape: Literal["ring"]
    radius: Length
    width: Length
    axis: Literal["x", "y", "z"] = "y"
    sides: Sides = 12


class ExtrusionPart(_Turnable):
    """A convex outline in (x, z), counter-clockwise seen from -y, extruded to `width` along y."""

    shape: Literal["extrusion"]
    outline: Annotated[list[Corner], Field(min_length=3, max_length=60)]
    width: Length


class PlatePart(_Primitive):
    """A convex outline in (y, z), counter-clockwise seen from +x, as a plate that faces +x."""

    shape: Literal["plate"]
    outline: Annotated[list[Corner], Field(min_length=3, max_length=60)]
    thickness: Length


class DiscPart(_Primitive):
    """A regular polygon as a plate that faces +x; `angle` is where its first corner lies, from +y."""

    shape: Literal["disc"]
    radius: Length
    sides: Sides
    angle: Number = 0.0
    thickness: Length


class PacketsPart(_Placed):
    """Packets of goods side by side along y on a shelf: `size` of the row; colours and heights run on from `first`."""

    shape: Literal["packets"]
    size: tuple[Length, Length, Length]
    count: Annotated[int, Field(strict=True, ge=1, le=60)]
    first: Annotated[int, Field(strict=True, ge=-20, le=100)] = 0


class BoardsPart(_Primitive):
    """Upright boards side by side along x, of uneven height and tone: `size` along x, y and up from `at`, its foot.

    They reach `below` the foot; `gap` lies between two of them; `seed` names the stream that chance is drawn from.
    """

    shape: Literal["boards"]
    size: tuple[Length, Length, Length]
    below: Radius = 0.0
    count: Annotated[int, Field(strict=True, ge=1, le=60)]
    gap: Radius
    seed: str


class MasonryPart(_Primitive):
    """Courses of blocks of uneven tone along x, every other course shifted by half a block: `size` from its foot up.

    `joint` lies between two blocks; `seed` names the stream that chance is drawn from.
    """

    shape: Literal["masonry"]
    size: tuple[Length, Length, Length]
    courses: Annotated[int, Field(strict=True, ge=1, le=40)]
    blocks: Annotated[int, Field(strict=True, ge=1, le=40)]
    joint: Radius
    seed: str


class GroupPart(_Placed):
    """Parts that are placed, repeated and turned together; `pitch` about y comes before `yaw` about z."""

    shape: Literal["group"]
    parts: Annotated[list[Part], Field(min_length=1, max_length=100)]
    pitch: Number = 0.0
    yaw: Number = 0.0


class AssemblyPart(_Placed):
    """An assembly of this file, in other colours if given."""

    shape: Literal["assembly"]
    name: str
    colours: dict[ColourName, ColourSpec] = Field(default_factory=dict)


Part = Annotated[
    BoxPart
    | CylinderPart
    | LathePart
    | BallPart
    | TubePart
    | RingPart
    | ExtrusionPart
    | PlatePart
    | DiscPart
    | BoardsPart
    | MasonryPart
    | PacketsPart
    | GroupPart
    | AssemblyPart,
    Field(discriminator="shape"),
]
Parts = Annotated[list[Part], Field(min_length=1, max_length=200)]


class TopEntry(DataRecord):
    """A surface things may lie on; see `Top`."""

    kind: Literal["sofa", "table", "chair", "desk", "bed"]
    height: Length
    size: tuple[Length, Length]
    centre: Corner = (0.0, 0.0)


class SeatEntry(DataRecord):
    """Where people sit or lie; see `Seat`."""

    kind: Literal["sit", "lie"] = "sit"
    height: Length
    size: tuple[Length, Length]
    centre: Corner = (0.0, 0.0)


class Assembly(DataRecord):
    """Parts that several models of a file use; its own colours may be given anew at each use."""

    colours: dict[ColourName, ColourSpec] = Field(default_factory=dict)
    parts: Parts


class MeshEntry(DataRecord):
    """A mesh in a file beside this one; `vico assets generate` writes both.

    Attributes
    ----------
    file
        GLB, a name without folders; the mesh is metres, z up, its origin the middle of its foot.
    sha256
        Of the file: another mesh is another world.
    licence, credit
        Of the mesh, and whom to thank; worlds that show it say so.
    """

    file: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,100}\.glb$")]
    sha256: Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
    licence: Annotated[str, Field(min_length=1, max_length=200)]
    credit: Annotated[str, Field(min_length=1, max_length=1000)]


class ModelEntry(DataRecord):
    """A model, or a variant of one: `like` another, with other colours (and kind, foot and top, if given).

    Attributes
    ----------
    mesh
        Instead of parts: a mesh in a file.
    kind, group, solid, foot, top, seat
        See `Model`; the kind is the model's name if not given, group and solid are the file's.
    colours
        Names that hold in this model's parts alone: what a variant may change.
    """

    like: str | None = None
    kind: str | None = None
    group: Category | None = None
    solid: bool | None = None
    foot: tuple[Length, Length] | None = None
    top: TopEntry | None = None
    seat: SeatEntry | None = None
    colours: dict[ColourName, ColourSpec] = Field(default_factory=dict)
    parts: Parts | None = None
    mesh: MeshEntry | None = None

    @model_validator(mode="after")
    def _has_a_shape(self) -> ModelEntry:
        if sum(given is not None for given in (self.like, self.parts, self.mesh)) != 1:
            raise ValueError("give either its parts, its mesh, or the model it is like")
        if self.mesh is not None and self.colours:
            raise ValueError("a mesh brings its own colours")
        return self


class ModelFile(DataRecord):
    """A file of models of one theme: what holds for all of them, its named colours, assemblies and models."""

    group: Category
    solid: bool = True
    colours: dict[ColourName, Rgb] = Field(default_factory=dict)
    assembly: dict[str, Assembly] = Field(default_factory=dict)
    model: dict[str, ModelEntry] = Field(default_factory=dict)


class _SolidPlaced(DataRecord):
    """Where a convex solid of a thing is: `pitch` about y comes before `yaw` about z, degrees."""

    at: Point = (0.0, 0.0, 0.0)
    pitch: Number = 0.0
    yaw: Number = 0.0


class SolidBox(_SolidPlaced):
    """A solid box of extents `size` around `at`."""

    shape: Literal["box"]
    size: tuple[Length, Length, Length]


class SolidCylinder(_SolidPlaced):
    """A solid cylinder whose foot is at `at`."""

    shape: Literal["cylinder"]
    radius: Length
    length: Length


class SolidBall(_SolidPlaced):
    """A solid ball around `at`."""

    shape: Literal["ball"]
    radius: Length


SolidPart = Annotated[SolidBox | SolidCylinder | SolidBall, Field(discriminator="shape")]
Challenge = Literal["assistant", "robot"]


class MovableEntry(DataRecord):
    """A thing people carry: `sentence` names it in instructions ("a {colour} backpack"); `size` is at rest.

    Attributes
    ----------
    grip
        How it is carried: hanging from its handle, in one hand around its middle, or before the chest.
    mass
        Kilograms; None for what a box of its size would weigh.
    solid
        Convex solids that stand for it in physics; none for the box of its size.
    tasks
        Challenges whose tasks may be about it.
    """

    sentence: str
    grip: Grip | None = None
    size: tuple[Length, Length, Length]
    mass: Annotated[float, Field(strict=True, ge=0.05, le=60.0)] | None = None
    solid: Annotated[list[SolidPart], Field(max_length=6)] = Field(default_factory=list)
    tasks: tuple[Challenge, ...] = ("assistant", "robot")
    parts: Parts


class MovableFile(DataRecord):
    """Things people carry; `paints` are the colours each comes in: ``paint``, ``paint_dark``, ``paint_light``."""

    paints: dict[ColourName, Rgb] = Field(default_factory=dict)
    colours: dict[ColourName, Rgb] = Field(default_factory=dict)
    object: dict[str, MovableEntry]
