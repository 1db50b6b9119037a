"""Draw the heuristic planner's automata into the page on challenges, from the data that it follows.

python scripts/draw_automata.py            # writes docs/challenges.md
python scripts/draw_automata.py --check    # exit code 1 if that would change it
"""

from __future__ import annotations

import argparse
import re
import sys
from pathlib import Path

from vico.agents.assistant.baselines import AUTOMATA, Automaton

PAGE = Path(__file__).parents[1] / "docs" / "challenges.md"


def mermaid(automaton: Automaton) -> str:
    """Return an automaton as a Mermaid state diagram: one arrow for all outcomes that lead from a state to another."""
    lines = ["stateDiagram-v2", "    [*] --> s0"]
    lines += [f"    s{number}: {number} {name}" for number, name in sorted(automaton.states.items())]
    arrows: dict[tuple[int, int], list[str]] = {}
    for (state, outcome), after in automaton.edges.items():
        arrows.setdefault((state, after), []).append(outcome.replace(",", ""))
    lines += [f"    s{state} --> s{after}: {' / '.join(arrows[state, after])}" for state, after in sorted(arrows)]
    return "\n".join([*lines, f"    s{automaton.final} --> [*]"])


def drawn(page: str) -> str:
    """Return a page with each automaton's figure after its mark.

    Raises
    ------
    SystemExit
        If the page has no mark for one of them.
    """
    for name, automaton in AUTOMATA.items():
        figure = f"<!-- automaton: {name} -->\n```mermaid\n{mermaid(automaton)}\n```\n<!-- /automaton -->"
        page, found = re.subn(
            rf"<!-- automaton: {name} -->.*?<!-- /automaton -->", lambda _, figure=figure: figure, page, flags=re.DOTALL
        )
        if found != 1:
            sys.exit(
                f"{PAGE.name}: {found} marks <!-- automaton: {name} --> ... <!-- /automaton -->; there is to be one"
            )
    return page


def main() -> None:
    """Write the figures, or say whether they are up to date."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="write nothing; exit code 1 if figures are not up to date")
    check = parser.parse_args().check
    before = PAGE.read_text(encoding="utf-8")
    after = drawn(before)
    if not check:
        PAGE.write_text(after, encoding="utf-8")
    elif before != after:
        sys.exit(f"{PAGE.name}: the automata are not up to date; run python scripts/draw_automata.py")


if __name__ == "__main__":
    main()
