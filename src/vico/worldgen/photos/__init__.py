"""Photos on surfaces: baking from photogrammetry, filling, sharpening, and the street-view chain."""
