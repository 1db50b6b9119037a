"""Records that compiled code reads by name: what the fields of the renderer's structured arrays are.

Numbers of one vertex, triangle, box or camera lie side by side in memory, and cost no more to read than slots of a
plain array. Positions are metres in the world's frame (ENU) unless said otherwise.
"""

from __future__ import annotations

import numpy as np

from vico.render.limbs import LIMBS

f4, f8, i4, i8, u4 = np.float32, np.float64, np.int32, np.int64, np.uint32

VERTEX = np.dtype(
    [
        ("position", f4, (3,)),
        ("normal", f4, (3,)),  # unit length
        ("u", f4),  # texture coordinates, 1 = one repeat
        ("v", f4),
        ("colour", f4, (3,)),  # linear red, green, blue, 0..1
        ("spare", f4),  # 48 bytes a vertex: one or two cache lines
    ],
    align=True,
)
TRIANGLE = np.dtype(
    [
        ("vertices", i4, (3,)),  # counter-clockwise seen from outside
        ("material", i4),  # row of `Textures`
    ],
    align=True,
)
# A range of triangles, and of the vertices that they alone use.
SPAN = np.dtype([("first_triangle", i4), ("end_triangle", i4), ("first_vertex", i4), ("end_vertex", i4)], align=True)
# A sphere around something, metres.
SPHERE = np.dtype([("x", f4), ("y", f4), ("z", f4), ("radius", f4)], align=True)
# Directions that a cluster's faces look in: their mean, and the cosine-like limit of culling it (2: never).
NORMAL_CONE = np.dtype([("x", f4), ("y", f4), ("z", f4), ("limit", f4)], align=True)
NEVER_CULLED = 2.0

MATERIAL = np.dtype(
    [
        ("log2_width", i4),  # of the finest level of the texture, texels
        ("log2_height", i4),
        ("levels", i4),  # number of mip levels; 0: no texture
        ("flags", i4),  # bits CUTOUT and DOUBLE_SIDED
        ("emission", f4),  # light of its own, 1 = a white wall in full light
        ("windows", i4),  # whose light it is: NO_WINDOWS, or a place in `LIT_WINDOWS`' shares and one
        ("storeys", i4),  # a facade's picture shows `BAYS` bays by so many storeys; 0: it is none
    ],
    align=True,
)
# Bits of a material.
CUTOUT = 1
DOUBLE_SIDED = 2
# Of which windows a material's light is.
NO_WINDOWS = 0
UPPER_WINDOWS = 1
GROUND_WINDOWS = 2
# How much of the light of a building's windows is on. As `surface.frag` reads it, too.
LIT_WINDOWS = np.dtype(
    [
        ("building", i4),  # entity
        ("shares", f4, (2,)),  # of upper floors and of the ground floor, 0..1
    ],
    align=True,
)
BAYS = 8

# How many there are: instances in all, those of them that never move (they come first), and avatars; and vertices of
# the largest item but avatars.
COUNTS = np.dtype([("instances", i8), ("static_instances", i8), ("avatars", i8), ("fixed_vertices", i8)], align=True)

ROOM = np.dtype(
    [
        ("x", f8),  # centre of the floor
        ("y", f8),
        ("z", f8),
        ("half_length", f8),  # along and across the yaw, metres
        ("half_width", f8),
        ("height", f8),
        ("yaw", f8),  # radians, counter-clockwise from east
        ("windows", f8),  # 1: it has some
        ("lamp", f8),  # how far its lamps are switched on, 0..1
        ("daylight", f8),  # that comes in by its windows, 1 = as much as by day
    ],
    align=True,
)

CAMERA_UNIFORMS = np.dtype(
    [
        ("x", f8),  # optical centre
        ("y", f8),
        ("z", f8),
        ("right_x", f8),  # unit vectors of the camera's axes, in the world
        ("right_y", f8),
        ("right_z", f8),
        ("down_x", f8),
        ("down_y", f8),
        ("down_z", f8),
        ("forward_x", f8),
        ("forward_y", f8),
        ("forward_z", f8),
        ("focal", f8),  # focal length, pixels (square)
        ("centre_x", f8),  # principal point, pixels
        ("centre_y", f8),
        ("near", f8),  # depths between which things are seen, metres
        ("far", f8),
        ("width", i8),  # of the picture, pixels
        ("height", i8),
        ("room_x", f8),  # the room around the camera: centre of its floor
        ("room_y", f8),
        ("room_z", f8),
        ("room_half_length", f8),  # metres
        ("room_half_width", f8),
        ("room_height", f8),
        ("room_cos", f8),  # of its yaw
        ("room_sin", f8),
        ("room_lamp", f4),  # share of its lamps' light
        ("room_around", f4),  # share of the light that is all around in it
        ("room_window", f4),  # share of the daylight picture that its windows show
        ("indoors", i8),  # 1: in a room, which is then all that is seen
        ("hidden_entity", i8),  # body that is not seen, 0: none
        ("most_taps", i8),  # texture samples a pixel on slanted surfaces, at most
    ],
    align=True,
)

# Colours are linear light after exposure.
LIGHT_UNIFORMS = np.dtype(
    [
        ("sun_x", f4),  # unit vector to the sun
        ("sun_y", f4),
        ("sun_z", f4),
        ("sun_red", f4),
        ("sun_green", f4),
        ("sun_blue", f4),
        ("ambient_red", f4),  # what an upright surface gets of the sky above and the lit ground below ...
        ("ambient_green", f4),
        ("ambient_blue", f4),
        ("tilt_red", f4),  # ... and what is added for each unit of its normal's z
        ("tilt_green", f4),
        ("tilt_blue", f4),
        ("haze_red", f4),
        ("haze_green", f4),
        ("haze_blue", f4),
        ("haze_per_metre", f4),  # 1 / visibility
        ("lamp_exposure", f4),  # factor on materials' own light
        ("cloud_cover", f4),  # share of the sky, 0..1
        ("shadow_x", f4),  # unit vector from where shadows are cast
        ("shadow_y", f4),
        ("shadow_z", f4),
        ("side_x", f4),  # light that turns the corner from the sun's side, for each unit of the normal's x and y
        ("side_y", f4),
        ("cloud_lit_red", f4),
        ("cloud_lit_green", f4),
        ("cloud_lit_blue", f4),
        ("cloud_shade_red", f4),
        ("cloud_shade_green", f4),
        ("cloud_shade_blue", f4),
        ("wet", f4),  # how wet ground is, 0..1
        ("snow_cover", f4),  # share of what looks up that is under snow, 0..1
        ("rain", f4),  # mm/h of water
        ("snowfall", f4),
        ("shadow_softness", f4),  # radius of the blur of static shadows' rims, texels of their map; 0: none
        ("glass", f4),  # share of what glass mirrors that is shown, 0..1
        ("interiors", f4),  # 1: windows show what is behind them
        ("unlit_x", f4),  # circle on which all that is fixed and shines is out, metres
        ("unlit_y", f4),
        ("unlit_radius", f4),  # 0 for none
    ],
    align=True,
)

# An item's vertices to the camera's frame: subtract `origin`, then apply the affine `matrix`.
MODEL_VIEW = np.dtype([("matrix", f4, (3, 4)), ("origin", f4, (3,))], align=True)
# A bounding box in the camera's frame (x right, y down, z forward): centre and half axes, metres.
BOX = np.dtype([("centre", f8, (3,)), ("a", f8, (3,)), ("b", f8, (3,)), ("c", f8, (3,))], align=True)

# What the shader keeps of a triangle. The first ten are planes over the picture (value at row 0, column 0, and steps):
# inverse depth and the weights of the first two corners, each times `volume`.
TRIANGLE_SETUP = np.dtype(
    [
        ("inverse_column", f8),
        ("inverse_row", f8),
        ("inverse_start", f8),
        ("first_column", f8),
        ("first_row", f8),
        ("first_start", f8),
        ("second_column", f8),
        ("second_row", f8),
        ("second_start", f8),
        ("volume", f8),  # depth is this divided by the plane of the inverse
        ("u", f4),  # texture coordinates of the third corner, and what the first and second differ by
        ("v", f4),
        ("first_u", f4),
        ("first_v", f4),
        ("second_u", f4),
        ("second_v", f4),
        ("colour", f4, (3, 3)),  # of the third corner, then differences of the first and the second
        ("normal", f4, (3, 3)),  # likewise, world frame
        ("emission", f4),
        ("texture_width", f4),  # of the finest level, texels
        ("texture_height", f4),
        ("material", i4),
        ("window", u4),  # 0, or whose window it is: see `WINDOW_STOREYS`
        ("flags", i4),  # bits FLAT_NORMAL, PLAIN_COLOUR, TWO_SIDED, SHELTERED (nothing lies on it), MOVES
    ],
    align=True,
)
# Bits of a triangle.
FLAT_NORMAL = 1
PLAIN_COLOUR = 2
TWO_SIDED = 4
SHELTERED = 8
MOVES = 16

# A window's number.
WINDOW_STOREYS = 7  # mask of the low bits: storeys of the picture
WINDOW_GROUND = 8  # bit: on the ground floor
WINDOW_SHIFT = 4  # above these bits is the building

# Glass on a street, and the room behind it: two frames that are laid over each other (right as seen from the street,
# inwards, up), with their origins at the foot of the door and of the middle of the wall that has it.
ROOM_FRONT = np.dtype(
    [
        ("x", f8),
        ("y", f8),
        ("z", f8),
        ("inward_x", f8),
        ("inward_y", f8),
        ("room_x", f8),
        ("room_y", f8),
        ("room_z", f8),
        ("room_inward_x", f8),
        ("room_inward_y", f8),
        ("left", f8),  # what belongs to it, metres to the right of the door
        ("right", f8),
        ("height", f8),  # of the room, metres
        ("depth", f8),
        ("half_width", f8),
        ("room", i8),  # row of `Scene.rooms`
    ],
    align=True,
)

# What shines on its surroundings. From a lamp, a way at an angle to its axis gets `spread` times the angle's cosine and
# `share`, from 0 to 1, of its light.
LAMP = np.dtype(
    [
        ("x", f4),  # metres; of the lamp of a vehicle's model, in the model's frame
        ("y", f4),
        ("z", f4),
        ("axis_x", f4),  # unit vector
        ("axis_y", f4),
        ("axis_z", f4),
        ("spread", f4),
        ("share", f4),
        (
            "power",
            f4,
        ),  # times the light, over the squared distance and `size`: light on what faces it, 1 = a sunny wall's
        ("size", f4),  # square metres
        ("inverse_reach", f4),  # squared, 1 / square metres: beyond, nothing is lit
        ("entity", i4),  # building whose ground floor's windows it is, 0: none
    ],
    align=True,
)
# A lamp that lights a cell of a grid, and how much of it comes to the cell's corners past what stands in between.
LAMP_IN_CELL = np.dtype([("lamp", i4), ("low", f4, (2,)), ("high", f4, (2,))], align=True)

# The inside of a vehicle, in the frame in which its bounding box has corners at +-1 (x forward, y left, z up).
CABIN_STEPS = 512
CABIN = np.dtype(
    [
        ("low", f4, (3,)),
        ("high", f4, (3,)),
        ("windows", f4, (2,)),  # heights of the rims of side windows
        ("front", f4, (2,)),  # and of those at the ends; equal: none
        ("rear", f4, (2,)),
        ("end_half", f4),  # half their width
        ("sharp", f4, (3,)),  # steepness of rims along each axis: 1 / penumbra
        ("open", f4, (2, CABIN_STEPS)),  # share of each side, right and left, that is window, from x = -1 to 1
    ],
    align=True,
)

# A door that is not closed: what of the wall is not drawn there, a box from before its leaf to the back of the hall.
OPENING = np.dtype(
    [
        ("x", f8),  # middle of the sill, in the plane of the closed leaf
        ("y", f8),
        ("z", f8),
        ("inward_x", f8),  # unit vector into the building
        ("inward_y", f8),
        ("half_width", f8),  # metres
        ("height", f8),
        ("before", f8),  # how far before and behind the leaf's plane nothing of the wall is drawn
        ("behind", f8),
    ],
    align=True,
)

# Something that moves, as it casts a shadow.
CASTER = np.dtype(
    [
        ("centre", f8, (3,)),  # of its bounding box
        ("half_axes", f8, (3, 3)),  # columns, metres
        ("to_unit", f8, (3, 4)),  # world to the frame in which its box has corners at +-1
        ("sun", f8, (3,)),  # direction to the sun in that frame
        ("reach", f8, (16, 3)),  # camera frame: corners of its box with a rim, and the same moved along its shadow
        ("half_height", f8),  # metres
        ("foot", f8),  # height of its lowest point
        ("inverse_soft", f8),  # of the length of light's way through it that makes a full shadow, 1/m
        ("first_column", i8),  # of the picture's part that it may darken
        ("end_column", i8),
        ("first_row", i8),
        ("end_row", i8),
        ("is_round", i8),  # 1: an avatar, 0: a box
        ("cabin", i8),  # row of `Prototypes.cabins`, -1: nobody sees its inside
        ("limb_count", i8),  # 0: a whole box or ellipsoid throws the shadow
        ("sun_frame", f8, (3, 4)),  # world to what limbs' shadows are told in: across the light twice, then along it
        # Of each limb in that frame, metres: its start, the step to its end, 1 / length of that squared (all across the
        # light), start and step along it, and its radius.
        ("limbs", f4, (len(LIMBS), 8)),
        ("area", f4, (4,)),  # least and most of both coordinates across that it may darken
    ],
    align=True,
)
