"""From pictures to paths: what is in the way, how to get to a target, and the actions that lead there.

`vico.agents.perception` finds what a picture shows, and remembers what was seen. `voxels` keeps what stands where;
`path_planning` finds paths on it; `navigator` turns all that into actions. `docs/navigation.md` is the page about it.
"""
