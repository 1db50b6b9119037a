"""What the documentation shows: its Python and its commands, and how they are tried.

A comment before a block of Markdown says what readers need not see: ``<!-- snippet setup: CODE -->`` is run before it,
``<!-- snippet not run: REASON -->`` leaves it out. A page's blocks share one namespace, as in a notebook.
"""

from __future__ import annotations

import ast
import importlib
import io
import json
import re
import shlex
import sys
import traceback
from collections.abc import Iterator, Sequence
from contextlib import chdir, redirect_stdout
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")))
#: Worlds and people by the names that pages give them.
WORLD_NAMES = ("out/demo/world", "helsinki", "berlin", "my_world", "W")
#: Steps after which an episode of a snippet ends.
STEPS = 3

_BLOCK = re.compile(
    r"(?:<!-- snippet (?P<mark>setup|not run): (?P<said>.*?) *-->\n)?^```(?P<language>\w*)\n(?P<code>.*?)^```",
    re.MULTILINE | re.DOTALL,
)
_INLINE = re.compile(r"(?<!`)`(?:[^\s`]*/)?(vico [a-z][^`]*)`(?!`)")


@dataclass(frozen=True)
class Snippet:
    """A block of a page: its code, and what a comment before it says."""

    page: Path
    line: int
    language: str
    code: str
    setup: str = ""
    not_run: str = ""

    @property
    def where(self) -> str:
        """Page and line."""
        return f"{self.page.relative_to(ROOT)}:{self.line}"


def snippets(page: Path) -> Iterator[Snippet]:
    """Give the blocks of a page."""
    text = page.read_text(encoding="utf-8")
    for match in _BLOCK.finditer(text):
        said = {match["mark"]: (match["said"] or "").strip()}
        line = text[: match.start("code")].count("\n") + 1
        yield Snippet(page, line, match["language"], match["code"], said.get("setup", ""), said.get("not run", ""))


def commands(page: Path) -> Iterator[tuple[str, list[str]]]:
    """Give the ``vico`` commands in the blocks of a page, as words, with where each is."""
    for block in snippets(page):
        if block.language not in ("", "sh", "bash") or block.not_run:
            continue
        for line in block.code.replace("\\\n", " ").splitlines():
            if re.match(r"(\S*/)?vico \w", line.strip()):
                yield block.where, shlex.split(line, comments=True)[1:]


def inline_commands(page: Path) -> Iterator[tuple[str, list[str]]]:
    """Give the commands that stand in a sentence; they may leave out what is needed, as ``vico run --isolate`` does."""
    text = re.sub(r"^```.*?^```", lambda block: "\n" * block[0].count("\n"), page.read_text("utf-8"), flags=re.M | re.S)
    for match in _INLINE.finditer(text):
        where = f"{page.relative_to(ROOT)}:{text[: match.start()].count(chr(10)) + 1}"
        said = match[1].partition(" | ")[0].replace("[", "").replace("]", "")
        # One of what stands for the others: --to gltf|usd.
        yield where, [word.partition("|")[0] for word in shlex.split(said)[1:] if word != "..."]


def lost_imports(code: str) -> list[str]:
    """Return the names that code imports from vico and that are not there."""
    lost = []
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "vico":
            module = importlib.import_module(str(node.module))
            lost += [f"{node.module}.{one.name}" for one in node.names if not hasattr(module, one.name)]
        elif isinstance(node, ast.Import):
            for name in (one.name for one in node.names if one.name.split(".")[0] == "vico"):
                importlib.import_module(name)
    return lost


def lay_out(folder: Path, *, world: Path, community: Path, run: Path) -> None:
    """Give a folder what the demo writes, under the names that the demo gives it."""
    for name in WORLD_NAMES:
        link = folder / name
        link.parent.mkdir(parents=True, exist_ok=True)
        link.symlink_to(world)
    (folder / "out/demo/community").symlink_to(community)
    (folder / "out/demo/run").symlink_to(run)


def run_pages(scratch: Path, pages: Sequence[Path], **made: Path) -> list[str]:
    """Run the Python of pages, each in a folder of its own; return what failed."""
    import gymnasium
    from pettingzoo import ParallelEnv

    _end_episodes_early()
    failures = []
    for page in pages:
        blocks = [block for block in snippets(page) if block.language == "python" and not block.not_run]
        if not blocks:
            continue
        here = scratch / page.stem
        lay_out(here, **made)
        names: dict[str, object] = {"__name__": f"snippets_of_{page.stem}"}
        with chdir(here), redirect_stdout(io.StringIO()):
            sys.path.insert(0, str(here))
            for block in blocks:
                try:
                    exec(compile(block.setup, f"setup of {block.where}", "exec"), names)  # noqa: S102
                    exec(compile(block.code, block.where, "exec"), names)  # noqa: S102
                except Exception:
                    failures.append(f"{block.where}: {traceback.format_exc(limit=-3)}")
            sys.path.remove(str(here))
        for value in names.values():
            if isinstance(value, (ParallelEnv, gymnasium.Env, gymnasium.vector.VectorEnv)):
                value.close()
    return failures


def _end_episodes_early() -> None:
    from vico.envs import CommunityEnv

    make = CommunityEnv.__init__

    def short(self: CommunityEnv, *arguments: object, **options: object) -> None:
        make(self, *arguments, **options)  # type: ignore[arg-type]
        self.max_steps = min(self.max_steps, STEPS)

    CommunityEnv.__init__ = short  # type: ignore[method-assign]


if __name__ == "__main__":
    _scratch, _world, _community, _run = map(Path, sys.argv[1:])
    _told = run_pages(_scratch, PAGES[1:], world=_world, community=_community, run=_run)
    print(json.dumps(_told))
