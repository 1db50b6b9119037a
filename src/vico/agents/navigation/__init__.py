"""From pictures to ways: what is in view, what is in the way, what was seen where, and how to get to it.

`pixels` finds what a picture shows; `voxels` keeps what stands where; `search` and `keeping` find ways; `memory` knows
what was seen; `navigator` turns all that into actions. `docs/navigation.md` is the page about it.
"""
