"""What a viewer may be given beside colour, depth and segmentation, and through which lens.

`lens` are the projections, `surface` reads normals and past places off a picture's keys, `past` remembers where things
were, and `batch` takes the pictures of many viewers, each through a lens of its own.
"""
