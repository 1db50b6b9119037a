"""Judging a day: who wins how many rankings, and how many are won over."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from vico.agents.influence.situation import FAILURES, Ending
from vico.challenges.influence.day import Day, Ledger
from vico.challenges.records import Metric, Part

#: Rankings by language models go by this name beside the opinion model's variants.
LANGUAGE = "llm"
LOST, NOT_CONVINCED, NEVER_SOUGHT = "lost to the rival", "not convinced", "never sought"
#: Why a member is not won: who first ranked one first and does not at last; who listened, and who did not and why.
CAUSES = (LOST, NOT_CONVINCED, *FAILURES, NEVER_SOUGHT)

Rankings = Mapping[str, str]  # whom each member ranks first


@dataclass(frozen=True)
class Verdict:
    """What a day came to for one main agent, by who judges.

    Attributes
    ----------
    main
        Id of the main agent.
    before, after
        Whom each member ranks first before and after the day, by judge.
    talked
        Members who listened to the main agent at least once.
    visits
        How the main agent's visits ended, by member, in order.
    """

    main: str
    before: dict[str, dict[str, str]]
    after: dict[str, dict[str, str]]
    talked: frozenset[str]
    visits: dict[str, list[Ending]] = field(default_factory=dict)

    def rankings_won(self, judge: str) -> tuple[int, int]:
        """Return how many rankings are won, of how many."""
        after = self.after[judge]
        return sum(first == self.main for first in after.values()), len(after)

    def rankings_converted(self, judge: str) -> tuple[int, int]:
        """Return how many that did not rank one first at the beginning do at the end, of how many."""
        others = [member for member, first in self.before[judge].items() if first != self.main]
        return sum(self.after[judge][member] == self.main for member in others), len(others)

    @property
    def judges(self) -> tuple[str, ...]:
        """Who ranked: the variants of the opinion model, or a language model too, which comes first then."""
        return tuple(self.after)


def first_choices(ledger: Ledger, *, now: float, with_talk: bool) -> dict[str, dict[str, str]]:
    """Return whom every member ranks first, by judge.

    Parameters
    ----------
    with_talk
        Whether what was said counts; before the day nothing was.
    """
    model, found = ledger.model, {}
    for variant in model.variants:
        opinions = ledger.opinions(now, variant) if with_talk else model.opinions([], now=now, variant=variant)
        found[variant] = {member: model.ranking(opinions, member)[0] for member in model.members}
    if ledger.language is None:
        return found
    mains = [model.profiles[main] for main in model.mains]
    asked = {}
    for member in model.members:
        said = ledger.talks_of(member) if with_talk else []
        friend = ledger.language.friend(model.profiles[member], mains, list(said))
        # Counted as a fallback by who was asked.
        asked[member] = found[model.variants[0]][member] if friend is None else friend
    return {LANGUAGE: asked} | found


def judge(day: Day, before: dict[str, dict[str, str]]) -> Verdict:
    """Judge a day that is over, for the method's first strategy; `before` as `first_choices` gave it."""
    after = first_choices(day.ledger, now=day.task.ends, with_talk=True)
    talked = frozenset(one.listener for one in day.ledger.utterances if one.speaker == day.ours and not one.ignored)
    visits: dict[str, list[Ending]] = {}
    for visit in day.courtships[day.ours].visits:
        visits.setdefault(visit.target, []).append(visit.ending)
    return Verdict(day.ours, before, after, talked, visits)


def metrics_of(verdicts: Sequence[Verdict]) -> dict[str, float]:
    """Return Win and Conv over several days, percent: of each judge, and the mean of the variants (or the model's).

    With it go visits and how they ended, as numbers a day.
    """
    endings = Counter(ending for verdict in verdicts for some in verdict.visits.values() for ending in some)
    found = {_key(ending): endings[ending] / len(verdicts) for ending in FAILURES}
    found["visits"] = endings.total() / len(verdicts)
    judges = verdicts[0].judges
    for judge_name in judges:
        won, conv = [v.rankings_won(judge_name) for v in verdicts], [v.rankings_converted(judge_name) for v in verdicts]
        found[f"win_{judge_name}"] = _share(won)
        if sum(of for _, of in conv):
            found[f"conv_{judge_name}"] = _share(conv)
    main = [LANGUAGE] if LANGUAGE in judges else list(judges)
    for name in ("win", "conv"):
        values = [found[f"{name}_{j}"] for j in main if f"{name}_{j}" in found]
        if values:
            found[name] = sum(values) / len(values)
    return found


def parts_of(verdict: Verdict, names: Mapping[str, str], label: str, done_at: int) -> list[Part]:
    """Return every member as a part: won where most judges say so."""
    parts = []
    for member in verdict.after[verdict.judges[0]]:
        judges = [LANGUAGE] if LANGUAGE in verdict.judges else list(verdict.judges)
        after = sum(verdict.after[j][member] == verdict.main for j in judges)
        before = sum(verdict.before[j][member] == verdict.main for j in judges)
        success = 2 * after > len(judges)
        cause = "" if success else _cause(verdict, member, supported=2 * before > len(judges))
        parts.append(Part(f"{names[member]} ({label})", success, cause, done_at if success else None))
    return parts


def _cause(verdict: Verdict, member: str, *, supported: bool) -> str:
    """Return why a member is not won; of several visits for nothing the last one counts."""
    if supported:
        return LOST
    if member in verdict.talked:
        return NOT_CONVINCED
    # One who answered is among those talked with; an answer that nobody counted is none.
    endings = [ending if ending != "talked" else "no answer" for ending in verdict.visits.get(member, [])]
    return endings[-1] if endings else NEVER_SOUGHT


def columns(variants: Sequence[str]) -> list[Metric]:
    """Return the columns of a table."""

    def share(key: str, label: str, about: str) -> Metric:
        return Metric(key, label, "%", "higher", 0.0, 100.0, about=about)

    def of_visits(ending: Ending) -> Metric:
        about = f"visits that ended so: {ending}"
        return Metric(_key(ending), ending.capitalize(), "a day", "lower", 0.0, about=about)

    return [
        share("win", "Win", "members who rank the agent first at the end of the day"),
        share(
            "conv",
            "Conv",
            "conversions: of those who first ranked the rival first, who rank the agent first at the end",
        ),
        *(share(f"win_{name}", f"Win, {name}", f"the same, by the opinion model {name}") for name in variants),
        *(share(f"conv_{name}", f"Conv, {name}", f"the same, by the opinion model {name}") for name in variants),
        Metric("talks", "Talks", "a day", "higher", 0.0, about="conversations in which a member was spoken with"),
        Metric("visits", "Visits", "a day", "higher", 0.0, about="times that the agent went to see a member"),
        *map(of_visits, FAILURES),
    ]


def _key(ending: Ending) -> str:
    return f"visits_{ending.replace(' ', '_')}"


def _share(counts: Sequence[tuple[int, int]]) -> float:
    return 100.0 * sum(k for k, _ in counts) / sum(n for _, n in counts)
