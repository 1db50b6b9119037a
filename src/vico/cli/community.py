"""`vico community build` and `vico check community`."""

from __future__ import annotations

import time
from pathlib import Path

from vico.cli.output import check_output, print_json, print_table, progress_bars
from vico.community import (
    build_community,
    check_community,
    date_of,
    digest_of,
    read_community,
    world_of,
    write_community,
)
from vico.errors import InputError
from vico.world.folder import read_world


def build(
    path: Path,
    *,
    out: Path,
    residents: int,
    seed: int,
    day: str | None = None,
    days: int = 1,
    force: bool,
    json: bool,
) -> int:
    """People the world at `path`, write the community to `out`, and say who lives there."""
    check_output(out, path, force=force)
    first = None if day is None else date_of(day)
    world = read_world(path)
    began = time.perf_counter()
    with progress_bars() as report:
        report("people and schedules", 0, 1)
        community = build_community(world, residents=residents, seed=seed, date=first, days=days)
        report("people and schedules", 1, 1)
    write_community(community, out, force=force or out.is_dir(), world=path)
    people = [
        {
            "name": r.name,
            "age": r.age,
            "occupation": r.occupation,
            "home": world.place_by_id[r.home].name,
            "workplace": world.place_by_id[r.workplace].name if r.workplace else None,
        }
        for r in community.residents
    ]
    facts = {
        "path": str(out),
        "world": community.world.name,
        "digest": digest_of(community),
        "date": f"{community.weekday} {community.date}",
        "days": len(community.dates),
        "residents": len(community.residents),
        "groups": len(community.groups),
        "relations": len(community.relations),
        "seconds": round(time.perf_counter() - began, 2),
    }
    if json:
        print_json({**facts, "people": people})
    else:
        print_table("Community", facts)
        print_table(
            "Residents",
            {
                str(p["name"]): f"{p['age']}, {p['occupation']}" + (f" at {p['workplace']}" if p["workplace"] else "")
                for p in people
            },
        )
    return 0


def day(path: Path, *, day: str, out: Path, force: bool, json: bool) -> int:
    """Write one day of the community at `path` to `out`."""
    check_output(out, path, force=force)
    community = read_community(path)
    one = community.on(date_of(day, community.dates))
    write_community(one, out, force=force or out.is_dir(), world=world_of(path))
    facts = {"path": str(out), "digest": digest_of(one), "date": f"{one.weekday} {one.date}"}
    if json:
        print_json(facts)
    else:
        print_table("Community", facts)
    return 0


def check(path: Path, *, world: Path | None = None, json: bool = False) -> int:
    """Check the community at `path` against its world; 1 if anything is found."""
    community = read_community(path)
    folder = world or world_of(path)
    if folder is None:
        raise InputError(f"{path}: its world is not where it was; say where it is with --world")
    findings = check_community(community, read_world(folder))
    if json:
        print_json(
            {
                "path": str(path),
                "world": str(folder),
                "ok": not findings,
                "findings": [{"where": f.where, "what": f.what, "mend": f.mend} for f in findings],
            }
        )
    elif findings:
        for finding in findings:
            print(f"{finding.where}: {finding.what}; {finding.mend}")
    else:
        print(
            f"{path}: {len(community.residents)} residents and {len(community.groups)} groups, all grounded in "
            f"{community.world.name}"
        )
    return 1 if findings else 0
