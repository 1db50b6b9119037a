"""Where the shader's queue holds what: offsets of the fields, which lie one behind the other."""

from __future__ import annotations

from vico.render.arrays import STRIDE

# Fields, float32: texture coordinates in texels and their step between samples; colour; normal; position; share of the
# sky that is seen; light of its own; shares of the sun and the sky that moving things leave. `LAMPS`: light of lamps.
U, V, SU, SV, RED, GREEN, BLUE, NX, NY, NZ, X, Y, Z, SKY, SHINE, SUN, AROUND = (k * STRIDE for k in range(17))
F, G, A, B, LEVEL, LIT, LAMPS = (k * STRIDE for k in range(17, 24))
# Fields, uint32: first texel, columns and rows of the texture's level, the pixel, and whose window it shows.
START, COLUMNS, ROWS, PIXEL = (k * STRIDE for k in range(4))
WINDOW = 14 * STRIDE
I0, I1, I2, I3, T0, T1, T2, T3, PAIR, MIDDLE = (k * STRIDE for k in range(4, 14))
# What is seen through a pane, once it is known: where a moving thing's share of the sun was.
SEEN = SUN
