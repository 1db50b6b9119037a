"""`vico community` peoples worlds; `vico check community` is beside it.

What a verb needs is imported when it runs, so that `vico --help` is quick.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from tyro.conf import Positional
from tyro.extras import SubcommandApp

from vico.cli.console import Report, check_output, print_json, print_table, progress_bars
from vico.cli.options import FLAT, CommunityBuildOptions
from vico.errors import InputError

if TYPE_CHECKING:
    from vico.community.llm import LlmCommunityAuthor

community = SubcommandApp()

# The longest answer that a model may give, tokens: the day of a busy person has about two thousand.
_LONGEST_ANSWER = 4096
# What went wrong is told for so many items; the rest is in authorship.json.
_MOST_TROUBLES = 8
# So many residents are shown in a table.
_SHOWN_RESIDENTS = 40
# What is told of a community, in words.
_MEANINGS = {
    "digest": "the same for the same community",
    "author": "procedural: by rules; or the language model that wrote it",
    "date": "of the first day that is planned",
    "days": "that are planned; a run begins with one of them",
    "groups": "circles of people with something in common, such as a choir",
    "relations": "pairs of people who know each other, and how",
    "seconds": "that it took to build",
}


@community.command(name="build")
def community_build(options: Annotated[CommunityBuildOptions, FLAT]) -> int:
    """People a world: homes, jobs, groups and a full day, or several, for each resident.

    Example: vico community build helsinki --residents 15 --day friday --days 3 --out people

    Example: vico community build helsinki --llm --llm-budget-tokens 400000 --out people
    """
    from vico.community import build_community, date_of, digest_of, write_community
    from vico.community.folder import COMMUNITY_FOLDER
    from vico.world.folder import read_world

    asks_model = options.asks_model
    check_output(options.out, options.path, force=options.force, kind=COMMUNITY_FOLDER)
    if asks_model and (options.day is not None or options.days != 1):
        raise InputError("community build: a language model writes one working day; leave out --day and --days")
    first = None if options.day is None else date_of(options.day)
    world = read_world(options.path)
    began = time.perf_counter()
    with progress_bars() as report:
        author = _llm_author(options, report) if asks_model else None
        if author is not None:
            people = build_community(world, residents=options.residents, seed=options.seed, author=author)
        else:
            report("people and schedules", 0, 1)
            people = build_community(
                world, residents=options.residents, seed=options.seed, date=first, days=options.days
            )
            report("people and schedules", 1, 1)
    write_community(people, options.out, force=options.force or options.out.is_dir(), world=options.path)
    facts = {
        "path": str(options.out),
        "world": people.world.name,
        "digest": digest_of(people),
        "author": people.author,
        "date": f"{people.weekday} {people.date}",
        "days": len(people.dates),
        "residents": len(people.residents),
        "groups": len(people.groups),
        "relations": len(people.relations),
        "seconds": round(time.perf_counter() - began, 2),
    }
    residents = [
        {
            "name": r.name,
            "age": r.age,
            "occupation": r.occupation,
            "home": world.place_by_id[r.home].name,
            "workplace": world.place_by_id[r.workplace].name if r.workplace else None,
        }
        for r in people.residents
    ]
    told = _authorship_report(author) if author is not None else None
    if options.json:
        print_json({**facts, "people": residents, **({} if told is None else {"llm": told})})
        return 0
    print_table("Community", facts, _MEANINGS)
    rows = {
        str(p["name"]): f"{p['age']}, {p['occupation']}" + (f" at {p['workplace']}" if p["workplace"] else "")
        for p in residents[:_SHOWN_RESIDENTS]
    }
    if len(residents) > _SHOWN_RESIDENTS:
        rows["..."] = f"{len(residents) - _SHOWN_RESIDENTS:,} more; --json tells all"
    print_table("Residents", rows)
    if told is not None:
        _print_authorship(told)
    return 0


def _llm_author(options: CommunityBuildOptions, report: Report) -> LlmCommunityAuthor:
    """Return the language model that options and environment name, as an author.

    Raises
    ------
    InputError, MissingFileError, SchemaError
        If no model is named, or an option is unusable.
    """
    from vico.community.llm import LlmCommunityAuthor
    from vico.io.cache import cache_folder
    from vico.llm import Budget, Connection, LanguageModel, Sampling

    given: dict[str, Any] = {"record": options.llm_record, "replay": options.llm_replay}
    model = LanguageModel.from_environment(
        cache=options.llm_cache or cache_folder() / "llm",
        budget=Budget(tokens=options.llm_budget_tokens, cost=options.llm_budget_cost),
        sampling=Sampling(seed=options.seed, max_tokens=_LONGEST_ANSWER),
        connection=Connection(timeout=options.llm_timeout),
        **{name: value for name, value in given.items() if value is not None},
    )
    return LlmCommunityAuthor(model, workers=options.llm_concurrency, only=options.llm_only, progress=report)


def _authorship_report(author: LlmCommunityAuthor) -> dict[str, Any]:
    """Return who wrote what, what it took, and what went wrong."""
    assert author.report is not None
    authorship, spent = author.report.authorship, author.model.budget.spent
    return {
        "model": authorship.model,
        "items": {kind: {o.value: n for o, n in counts.items()} for kind, counts in authorship.counts.items()},
        "written": authorship.written,
        "fallen_back": [
            {"item": one.item, "why": one.origin.value, "detail": one.detail} for one in authorship.fallen_back
        ],
        "troubles": author.report.troubles,
        "stopped": author.report.over,
        "calls": spent.calls,
        "tokens": spent.tokens,
        "dollars": round(spent.cost, 6),
    }


def _print_authorship(told: dict[str, Any]) -> None:
    from vico.community.model import Origin

    rows = {
        kind: ", ".join(f"{counts[o.value]} {o.value}" for o in Origin if counts.get(o.value))
        for kind, counts in told["items"].items()
    }
    rows["spent"] = f"{told['calls']} calls, {told['tokens']:,} tokens" + (
        f", ${told['dollars']:.4f}" if told["dollars"] else ""
    )
    print_table(f"Written by {told['model']}", rows)
    if told["stopped"]:
        print(f"The model was not asked to the end: {told['stopped']}")
    left = told["fallen_back"]
    if left:
        what = "everything" if not told["written"] else f"{len(left)} items"
        print(f"By rule, as the model did not write them so that they hold: {what} (authorship.json lists them)")
    for one in left[:_MOST_TROUBLES]:
        print(f"  {one['item']}: {one['why']}" + (f" ({one['detail']})" if one["detail"] else ""))
    if len(left) > _MOST_TROUBLES:
        print(f"  and {len(left) - _MOST_TROUBLES} more")


@community.command(name="day")
def community_day(path: Positional[Path], day: str, out: Path, force: bool = False, json: bool = False) -> int:
    """Take one of several days of a community, as a community of its own that runs can live through.

    Example: vico community day people --day saturday --out people_saturday

    Args:
        path: Community folder, built with --days.
        day: A date like 2025-06-07, or a day of the week like saturday: the first one there is.
        out: Folder to make; refused if it exists, unless --force.
        force: Replace what this verb made there before; refused if the folder holds anything else.
        json: Print the result as JSON.
    """
    from vico.community import date_of, digest_of, read_community, world_of, write_community
    from vico.community.folder import COMMUNITY_FOLDER

    check_output(out, path, force=force, kind=COMMUNITY_FOLDER)
    people = read_community(path)
    one = people.on(date_of(day, people.dates))
    write_community(one, out, force=force or out.is_dir(), world=world_of(path))
    facts = {"path": str(out), "digest": digest_of(one), "date": f"{one.weekday} {one.date}"}
    if json:
        print_json(facts)
    else:
        print_table("Community", facts)
    return 0


def check_community(path: Positional[Path], world: Path | None = None, json: bool = False) -> int:
    """Check that a community is grounded in its world. Exit 1 if anything is wrong.

    Args:
        path: Community folder.
        world: World folder; without it, the one the community was made for, if it is still where it was.
        json: Print JSON.
    """
    from vico.community import check_community as findings_of
    from vico.community import read_community, world_of
    from vico.world.folder import read_world

    people = read_community(path)
    folder = world or world_of(path)
    if folder is None:
        raise InputError(f"{path}: its world is not where it was; say where it is with --world")
    findings = findings_of(people, read_world(folder))
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
            f"{path}: {len(people.residents)} residents and {len(people.groups)} groups, all grounded in "
            f"{people.world.name}"
        )
    return 1 if findings else 0
