"""Join what benchmarks/tables.py wrote of a table to one page; nothing on it is typed by hand.

python benchmarks/tables.py --table assistant --worlds WORLDS --first-seed N --out OUT
python benchmarks/table_page.py OUT --title "The community assistant" --frozen COMMIT --page FILE
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Sequence
from pathlib import Path

from reporting import write_page

from vico.challenges.tables.results import read_results
from vico.errors import InputError


def blocks_in(out: Path) -> list[Path]:
    """Return the folders of the parts that were played, in the order of their names.

    Raises
    ------
    InputError
        If there are none.
    """
    found = sorted(path.parent for path in out.glob("*/results.md"))
    if not found:
        raise InputError(f"{out}: no results; play a table with benchmarks/tables.py --out {out}")
    return found


def page(
    blocks: Sequence[Path], title: str, frozen: str = "", note: str = "", compared: str = "docs/challenges.md"
) -> str:
    """Return the page: what it was played with, and each part's own page a level lower."""
    found = [read_results(block / "results.json") for block in blocks]
    first, _ = found[0]
    seconds = sum(record.wall_seconds for _, records in found for _, record in records)
    lines = [
        f"# {title}",
        "",
        f"Written by `benchmarks/table_page.py` from what `benchmarks/tables.py` played. vico {first['vico']}, code "
        f"`{first['code'][:12]}`; {seconds / 3600:.1f} hours of episodes on the clock.",
        "",
        *([note, ""] if note else []),
    ]
    if frozen:
        lines += [
            f"`ours` is frozen at commit `{frozen}`; seeds begin with its first six hexadecimal digits, "
            f"{int(frozen[:6], 16)}. What is comparable with the paper's rows, and what is not: "
            f"[{compared}](../../{compared}#results).",
            "",
        ]
    for block in blocks:
        text = (block / "results.md").read_text(encoding="utf-8")
        lines += [re.sub(r"^(#+) ", r"#\1 ", text, flags=re.MULTILINE).rstrip(), ""]
    return "\n".join(lines).rstrip() + "\n"


def main(words: Sequence[str] | None = None) -> int:
    """Write the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--title", required=True)
    parser.add_argument("--frozen", default="", help="hash of the commit at which ours was frozen")
    parser.add_argument("--note", default="", help="a sentence on how and where it was played")
    parser.add_argument("--compared", default="docs/challenges.md", help="page whose results say what is comparable")
    return write_page(parser, lambda it: page(blocks_in(it.out), it.title, it.frozen, it.note, it.compared), words)


if __name__ == "__main__":
    sys.exit(main())
