"""`vico bench`: run one of the checkout's benchmarks on the packaged place, and print its tables."""

from __future__ import annotations

import io
import subprocess
import sys
import tempfile
from contextlib import redirect_stdout
from pathlib import Path

from vico.cli import community, world
from vico.cli.machine_speed import speed_table
from vico.cli.options import CommunityBuildOptions
from vico.cli.output import print_json
from vico.errors import MissingFileError, VicoError
from vico.worldgen.packaged import packaged_extract
from vico.worldgen.sources import Sources

SCRIPTS = Path(__file__).parents[3] / "benchmarks"
RESIDENTS = 15
# What each script is given of the place made for it: its world, and the people in it.
_GIVEN = {"render": ("world",), "sim": ("world", "people"), "world": (), "memory": ("world", "people")}


class BenchmarkError(VicoError, RuntimeError):
    """A benchmark did not come to its end."""


def bench(what: str, *, table: Path | None = None, json: bool = False, options: tuple[str, ...] = ()) -> int:
    """Measure one thing in a process of its own; print the markdown it reports, or its tables as JSON.

    Beside it stands how fast this machine is, and that of the README's figures.

    Parameters
    ----------
    what
        ``render``, ``sim``, ``world`` or ``memory``.
    table
        File for the report.
    options
        More arguments for the script.

    Raises
    ------
    MissingFileError
        If vico was installed without its repository.
    BenchmarkError
        If the script failed.
    """
    script = SCRIPTS / f"{what}.py"
    if not script.exists():
        raise MissingFileError(
            f"bench {what}: benchmarks come with the repository, not with the package; run it in a checkout"
        )
    with tempfile.TemporaryDirectory(prefix="vico-") as folder:
        here = Path(folder)
        _prepare(here, _GIVEN[what])
        report = here / "report.md"
        given = [str(here / name) for name in _GIVEN[what]]
        command = [sys.executable, str(script), *given, "--table", str(report), *options]
        # Stdout is ours: the report is printed once, from the file.
        done = subprocess.run(command, stdout=subprocess.DEVNULL, check=False)
        if done.returncode or not report.exists():
            raise BenchmarkError(f"bench {what}: stopped with exit status {done.returncode}; what it said is above")
        text = report.read_text(encoding="utf-8")
    speeds = speed_table()
    if table is not None:
        table.parent.mkdir(parents=True, exist_ok=True)
        table.write_text(text, encoding="utf-8")
    if json:
        (measured,) = tables_of(speeds)
        print_json({"benchmark": what, "tables": tables_of(text), "machine": measured["rows"]})
    else:
        print(f"{text}\nSeconds and megabytes: less is better. Times real time: more is better.\n\n{speeds}")
    return 0


def _prepare(here: Path, parts: tuple[str, ...]) -> None:
    place = packaged_extract()
    with redirect_stdout(io.StringIO()):
        if "world" in parts:
            world.build(Sources(place.path), out=here / "world", centre=(place.lat, place.lon), half=place.half)
        if "people" in parts:
            community.build(CommunityBuildOptions(here / "world", here / "people", residents=RESIDENTS))


def tables_of(text: str) -> list[dict[str, object]]:
    """Read the tables of a markdown report: the heading above each, and its rows by column."""
    found: list[dict[str, object]] = []
    heading, columns = "", None
    rows: list[dict[str, str]] = []
    for line in text.splitlines():
        if line.startswith("#"):
            heading = line.lstrip("# ")
        if not line.startswith("|"):
            columns = None
            continue
        cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
        if columns is None:
            columns, rows = cells, []
            found.append({"title": heading, "rows": rows})
        elif not all(set(cell) <= set("-: ") for cell in cells):
            rows.append(dict(zip(columns, cells, strict=True)))
    return found
