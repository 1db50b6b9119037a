"""Does the validator see each kind of fault, and only that?"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from toytown import make_world
from vico.community import Community, Relation, Resident, ScheduleItem, check_community
from vico.world.world import World


def with_resident(community: Community, index: int, **change: Any) -> Community:
    people = list(community.residents)
    people[index] = people[index].model_copy(update=change)
    return community.model_copy(update={"residents": people})


def worker(community: Community) -> int:
    return next(k for k, r in enumerate(community.residents) if r.workplace and not r.occupation.startswith("student"))


def place_of(world: World, kind: str) -> str:
    return next(p.id for p in world.places if p.kind == kind)


def with_item(community: Community, index: int, k: int, **change: Any) -> Community:
    items = list(community.residents[index].schedule)
    items[k] = items[k].model_copy(update=change)
    return with_resident(community, index, schedule=items)


def commute(r: Resident) -> int:
    return next(k for k, i in enumerate(r.schedule) if i.type == "commute")


def no_commute(c: Community, w: World) -> Community:
    r = c.residents[0]
    k = commute(r)
    items = list(r.schedule)
    items[k - 1] = items[k - 1].model_copy(update={"end": items[k].end})
    return with_resident(c, 0, schedule=items[:k] + items[k + 1 :])


def short_commute(c: Community, w: World) -> Community:
    r = c.residents[0]
    k = commute(r)
    end = r.schedule[k].end
    start = f"{end[:-5]}{(int(end[3:5]) - 1) % 60:02d}:59" if end[3:5] != "00" else f"{int(end[:2]) - 1:02d}:59:59"
    c = with_item(c, 0, k - 1, end=start)
    return with_item(c, 0, k, start=start)


def closed(c: Community, w: World) -> Community:
    pub = w.place_by_id[place_of(w, "pub")]
    item = ScheduleItem(
        type="main", start="00:00:00", end="23:59:59", activity="Wait for the pub", place=pub.id, building=pub.building
    )
    return with_resident(c, 0, schedule=[item])


def strange_job(c: Community, w: World) -> Community:
    return with_resident(c, worker(c), occupation="zoo keeper")


def other_biography(c: Community, w: World) -> Community:
    return with_resident(c, worker(c), biography="Somebody who works somewhere. Likes tea. Sleeps well.")


def jobless(c: Community, w: World) -> Community:
    return with_resident(c, worker(c), workplace=None)


def lonely(c: Community, w: World) -> Community:
    groups = [g.model_copy(update={"members": [m for m in g.members if m != "resident_0"]}) for g in c.groups]
    return c.model_copy(update={"groups": groups})


def twins(c: Community, w: World) -> Community:
    return with_resident(c, 1, name=c.residents[0].name)


def crowd(c: Community, w: World) -> Community:
    x, y = c.residents[0].spawn
    return with_resident(c, 1, spawn=(x + 0.5, y))


def walled_in(c: Community, w: World) -> Community:
    return with_resident(c, 0, spawn=(-95.0, -95.0))


def unknown_known(c: Community, w: World) -> Community:
    return with_resident(c, 0, known_places=[*c.residents[0].known_places, "nowhere"])


def forgotten(c: Community, w: World) -> Community:
    r = c.residents[0]
    return with_resident(c, 0, known_places=[p for p in r.known_places if p != r.home])


def hole(c: Community, w: World) -> Community:
    return with_resident(c, 0, schedule=[*c.residents[0].schedule[:2], *c.residents[0].schedule[3:]])


def late_start(c: Community, w: World) -> Community:
    return with_item(c, 0, 0, start="00:05:00")


def early_end(c: Community, w: World) -> Community:
    return with_item(c, 0, -1, end="23:50:00")


def self_relation(c: Community, w: World) -> Community:
    me = Relation(between=("resident_0", "resident_0"), kind="friend", note="self", strength=0.5, since=2020)
    return c.model_copy(update={"relations": [*c.relations, me]})


def ghost_member(c: Community, w: World) -> Community:
    g = c.groups[0]
    return c.model_copy(
        update={"groups": [g.model_copy(update={"members": [*g.members, "resident_99"]}), *c.groups[1:]]}
    )


def moved_group(c: Community, w: World) -> Community:
    return c.model_copy(update={"groups": [c.groups[0].model_copy(update={"place": "nowhere"}), *c.groups[1:]]})


def other_looks(c: Community, w: World) -> Community:
    return with_resident(c, 0, appearance={**c.residents[0].appearance, "age": 9.0})


FAULTS: list[tuple[Callable[[Community, World], Community], str]] = [
    (lambda c, w: with_resident(c, 0, home="nowhere"), "no place 'nowhere'"),
    (lambda c, w: with_resident(c, 0, home=place_of(w, "cafe")), "not accommodation"),
    (lambda c, w: with_resident(c, 0, cash=99), "not in 100..1000"),
    (lambda c, w: with_resident(c, 0, schedule=[]), "empty"),
    (no_commute, "in no time"),
    (short_commute, "which takes"),
    (closed, "is not open"),
    (strange_job, "zoo keeper"),
    (other_biography, "does not mention"),
    (jobless, "has no workplace"),
    (lonely, "is in no group"),
    (twins, "share the name"),
    (crowd, "m from resident_0's"),
    (walled_in, "can't be reached from the map's edge"),
    (unknown_known, "no place 'nowhere'"),
    (forgotten, "used but not known"),
    (hole, "the item before ends at"),
    (late_start, "the day starts at 00:05:00"),
    (early_end, "the day ends at 23:50:00"),
    (self_relation, "not two residents"),
    (ghost_member, "no resident 'resident_99'"),
    (moved_group, "no place 'nowhere'"),
    (other_looks, "don't agree with"),
]


@pytest.mark.parametrize(("spoil", "expected"), FAULTS, ids=[getattr(f, "__name__", "x") + e[:14] for f, e in FAULTS])
def test_a_fault_is_found_and_named(
    community: Community, town: World, spoil: Callable[[Community, World], Community], expected: str
) -> None:
    found = [f"{f.what}" for f in check_community(spoil(community, town), town)]
    assert any(expected in what for what in found), found


def test_every_finding_says_how_to_mend_it(community: Community, town: World) -> None:
    findings = [f for spoil, _ in FAULTS for f in check_community(spoil(community, town), town)]
    assert all(f.where and f.what and f.mend for f in findings)


def test_a_community_of_another_world_is_refused_at_once(community: Community) -> None:
    findings = check_community(community, make_world(name="elsewhere"))
    assert [f.where for f in findings] == ["world.digest"]


def test_a_sound_community_has_no_findings(community: Community, town: World) -> None:
    assert check_community(community, town) == []
