"""Every building is held to the rules that a finished world is checked by, before anything is painted on it.

Whatever a map draws, a building that would be a finding is made again, plainer: small solids that are at fault go, a
part that would hover is brought down, one that shares a plane with another is cut where that stands, and else the
building becomes a block with a flat roof over its cleaned outline. One that fails even so is left out. What is left out
or made plainer is told, with the reason.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from shapely import Polygon

from vico.geo import overlay
from vico.geo.overlay import OverlayError
from vico.world.check.buildings import open_edges, open_edges_of, overlapping_faces, seating_findings, volumes_of
from vico.world.heights import HeightField
from vico.world.model import FAILED, Dropped
from vico.worldgen.buildings.solids import Draft, SolidMesh, draft_building, merge_solids, record_of, standing_parts
from vico.worldgen.facts.building_heights import STOREY
from vico.worldgen.facts.building_outlines import without_slivers
from vico.worldgen.facts.building_plans import BuildingPlan, PartPlan
from vico.worldgen.facts.fault_isolation import drop_on_failure
from vico.worldgen.facts.roofs import Roof

_APART = 0.02  # metres that a block keeps from its neighbours' walls, so that no two lie in one plane
_GAP = 0.05  # metres between parts over which a block goes on, and that a part is cut off from another
_LEAST_EAVES = 2.5  # metres above the ground floor
_FLOATS = "building floats"


class _Fault(NamedTuple):
    """A rule that a building breaks.

    Attributes
    ----------
    solid
        Which of its solids is at fault; None: all together.
    rule, what
        Which rule, and how it is broken.
    other
        Outline of another solid that it is too near to; None: it is at fault by itself.
    """

    building: str
    solid: int | None
    rule: str
    what: str
    other: Polygon | None = None


@dataclass
class _Remedy:
    """Remedies of a building's faults, by their reasons; the last that has one counts.

    Attributes
    ----------
    without
        Small solids that go, and why.
    cut, others
        Why parts are cut, and by which outlines each.
    lowered
        Why the lowest part is brought down.
    block
        Why it becomes a block.
    """

    without: dict[int, str] = field(default_factory=dict)
    cut: str = ""
    others: dict[int, list[Polygon]] = field(default_factory=dict)
    lowered: str = ""
    block: str = ""


def repair_buildings(
    drafts: list[Draft], terrain: HeightField, dropped: list[Dropped]
) -> tuple[list[Draft], SolidMesh]:
    """Make buildings that break a rule again, plainer, until none does.

    Parameters
    ----------
    drafts
        The buildings of a place, with their small solids.
    terrain
        What they stand on.
    dropped
        Where it is told what was left out or made plainer.

    Returns
    -------
    tuple
        The buildings, in their order, and all their solids.
    """
    standing = {draft.plan.id: draft for draft in drafts}
    cut: set[str] = set()
    blocks: set[str] = set()
    while True:
        mesh = merge_solids([draft.meshes for draft in standing.values()])
        remedies = _remedies(_faults(standing, blocks, mesh, terrain), standing, cut)
        if not remedies:
            return list(standing.values()), mesh
        for name, remedy in remedies.items():
            old, made = standing[name], None
            if remedy.block and name in blocks:
                dropped.append(Dropped(id=name, reason=f"{FAILED}: even as a plain block, {remedy.block}"))
            else:
                with drop_on_failure(name, dropped):
                    made = _apply_remedy(old, remedy, terrain, dropped)
            if made is None:
                del standing[name]
                continue
            standing[name] = made
            if remedy.block or remedy.cut:
                cut.add(name)
            if remedy.block:
                blocks.add(name)


def _faults(standing: Mapping[str, Draft], blocks: set[str], mesh: SolidMesh, terrain: HeightField) -> Iterator[_Fault]:
    """Find what is wrong with buildings, by the rules of `world.check`."""
    names, drafts = list(standing), list(standing.values())
    corners, owner = mesh.points[mesh.faces], mesh.plan_of_part[mesh.part]
    first = np.searchsorted(mesh.plan_of_part, np.arange(len(drafts)))
    volume = volumes_of(corners, owner)
    for k in np.unique(owner[open_edges(mesh.faces)]).tolist():
        mine = owner == k
        # As in the file, corners are one where they are equal in single precision.
        for solid, count in open_edges_of(corners[mine].astype(np.float32), mesh.part[mine] - first[k]).items():
            yield _Fault(names[k], solid, "building leaks", f"{count} of its edges have no counterpart")
    for k, draft in enumerate(drafts):
        if not volume.get(k, 0.0) > 0.0:
            yield _Fault(names[k], None, "building inside out", "it encloses nothing")
        low = min((float(body.positions[:, 2].min()) for body in draft.bodies), default=math.inf)
        for finding in seating_findings(record_of(draft, 1), low, terrain):
            yield _Fault(names[k], None, finding.id, finding.what)
    for pairs in overlapping_faces(corners, owner).values():
        area = float(pairs.area.sum())
        solids = np.stack([mesh.part[pairs.first], mesh.part[pairs.second]], axis=1)
        for pair in np.unique(solids, axis=0).tolist():
            whose = [int(mesh.plan_of_part[solid]) for solid in pair]
            (k, solid), (n, other) = _giving_way(
                [(k, solid - int(first[k])) for k, solid in zip(whose, pair, strict=True)], drafts, blocks
            )
            whom = "itself" if k == n else names[n]
            against = drafts[n].plan.solids[other].polygon if (k, solid) != (n, other) else None
            what = f"{area:.2f} m2 lie in one plane with faces of {whom}"
            yield _Fault(names[k], solid, "building faces overlap", what, against)


def _giving_way(pair: list[tuple[int, int]], drafts: list[Draft], blocks: set[str]) -> list[tuple[int, int]]:
    """Put the solid first that gives way: a small one before a part, then of the smaller building not yet a block."""

    def weight(solid: tuple[int, int]) -> tuple[bool, bool, float, int, int]:
        draft = drafts[solid[0]]
        part = solid[1] < len(draft.plan.parts)
        return part, draft.plan.id in blocks, draft.footprint.area if part else 0.0, -solid[0], -solid[1]

    return sorted(pair, key=weight)


def _remedies(faults: Iterator[_Fault], standing: Mapping[str, Draft], cut: set[str]) -> dict[str, _Remedy]:
    """Decide what is done about faults: the least that can help and was not done before."""
    made: dict[str, _Remedy] = {}
    for fault in faults:
        remedy = made.setdefault(fault.building, _Remedy())
        plan = standing[fault.building].plan
        if fault.solid is not None and fault.solid >= len(plan.parts):
            remedy.without.setdefault(fault.solid, fault.what)
        elif fault.rule == _FLOATS and min(part.low for part in plan.parts) > 0.0:
            remedy.lowered = remedy.lowered or fault.what
        elif fault.solid is not None and fault.other is not None and fault.building not in cut:
            remedy.cut = remedy.cut or fault.what
            remedy.others.setdefault(fault.solid, []).append(fault.other)
        else:
            remedy.block = remedy.block or fault.what
    return made


def _apply_remedy(draft: Draft, remedy: _Remedy, terrain: HeightField, dropped: list[Dropped]) -> Draft:
    """Return a building made again, plainer; add what it lacks to `dropped`."""
    name = draft.plan.id
    if remedy.block:
        made = draft_building(_block(draft.plan), draft.look, terrain)
        dropped.append(Dropped(id=f"{name} roof and details", reason=f"made a plain block: {remedy.block}"))
        return made
    if remedy.lowered:
        lowest = min(part.low for part in draft.plan.parts)
        parts = [replace(part, low=0.0) if part.low == lowest else part for part in draft.plan.parts]
        made = draft_building(replace(draft.plan, parts=parts, rooftop=[]), draft.look, terrain)
        dropped.append(Dropped(id=f"{name} details", reason=f"brought down to the ground: {remedy.lowered}"))
        return made
    if remedy.cut:
        made = draft_building(
            replace(draft.plan, parts=_cut(draft.plan, remedy.others), rooftop=[]), draft.look, terrain
        )
        dropped.append(Dropped(id=f"{name} details", reason=f"cut where others stand: {remedy.cut}"))
        return made
    solids = draft.plan.solids
    dropped += [Dropped(id=f"{name} {solids[k].finish}", reason=why) for k, why in sorted(remedy.without.items())]
    kept = [k for k in range(len(solids)) if k not in remedy.without]
    plan = replace(draft.plan, rooftop=[solids[k] for k in kept if k >= len(draft.plan.parts)])
    return replace(draft, plan=plan, meshes=[draft.meshes[k] for k in kept])


def _cut(plan: BuildingPlan, others: Mapping[int, list[Polygon]]) -> list[PartPlan]:
    """Return the parts of a building, some of them cut by outlines of others."""
    made: list[PartPlan] = []
    for k, part in enumerate(plan.parts):
        if k not in others:
            made.append(part)
            continue
        taken = overlay.buffer(overlay.union_all(others[k]), _GAP, join_style="mitre")
        rest = without_slivers(overlay.difference(part.polygon, taken), part.polygon)
        made += [replace(part, polygon=piece) for piece in rest]
    if not made:
        raise OverlayError("nothing is left of it beside what stands there; see whether it is mapped twice")
    return made


def _block(plan: BuildingPlan) -> BuildingPlan:
    """Return a building as a block: its cleaned footprint, as high as its largest part's eaves."""
    parts = standing_parts(plan)
    main = max(parts, key=lambda part: part.polygon.area)
    whole = overlay.union_all([overlay.buffer(part.polygon, _GAP, join_style="mitre") for part in parts])
    inner = overlay.areas_of(overlay.buffer(whole, -_GAP - _APART, join_style="mitre"))
    pieces = [piece for shape in inner.geoms for piece in without_slivers(shape, shape)]
    if not pieces:
        raise OverlayError("nothing is left of its outline; draw it anew")
    low = main.low if main.levels == 0 else 0.0  # a canopy stays one
    eaves = max(main.eaves, low + (_LEAST_EAVES if main.levels else 0.3))
    levels = max(round((eaves - 0.6) / STOREY), 1) if main.levels else 0
    made = [PartPlan(piece, low, eaves, levels, Roof("flat", 0.0), main.tags) for piece in pieces]
    outline = max(pieces, key=lambda piece: piece.area)
    origin = plan.origin and replace(plan.origin, roof="rule: plain block")
    return replace(plan, outline=outline, parts=made, rooftop=[], origin=origin)
