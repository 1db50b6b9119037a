"""The page in headless Chromium: seconds to the first picture, frames a second, triangles and draw calls.

Example: python benchmarks/viewer.py RUN --table benchmarks/results/viewer.md
"""

from __future__ import annotations

import argparse
import os
import statistics
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from reporting import machine, publish

from vico.viewer.city import city_folder
from vico.viewer.headless import BrowserPage, open_page
from vico.viewer.server.serve import ViewerServer
from vico.viewer.server.state import ViewerState
from vico.viewer.sources.source import Source
from vico.viewer.sources.views import RecordedViews

WIDTH, HEIGHT = 1280, 720
OPENINGS, FRAMES, SECONDS = 5, 30, 8.0
# Draws frames one after the other, each finished before the next begins, while the run goes on.
_DRAW = """(async () => {
  const { page, view, state, clock, source } = vico, gl = view.renderer.getContext(), pixel = new Uint8Array(4);
  view.adapts = false; view.setCare(CARE); page.frozen = true; view._fine = false;
  const took = [];
  for (let k = 0; k < FRAMES + 5; k++) {
    clock.time += 1 / 30;
    const [a, b, share] = source.around(source.stepAt(clock.time));
    if (a && b) state.set(a, b, share);
    const began = performance.now();
    view.resize(); view.draw(state, 1 / 30, null, began, true);
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
    if (k >= 5) took.push(performance.now() - began);
    await new Promise((resolve) => setTimeout(resolve, 0));
  }
  const { render } = view.renderer.info, { width, height } = view.renderer.domElement;
  return { took, triangles: render.triangles, calls: render.calls, width, height, people: view.people.drawn };
})()"""
# What a reader gets: the page's own loop, which draws as carefully as it can.
_LOOP = """(async () => {
  const { page, view } = vico;
  page.frozen = false; view.adapts = true; view.setCare(2); vico.clock.playing = true;
  requestAnimationFrame((now) => page._tick(now));
  let frames = 0, since = 0; const drawn = view.renderer.info.render.frame;
  await new Promise((resolve) => setTimeout(resolve, 9000));
  const first = view.renderer.info.render.frame, began = performance.now();
  await new Promise((resolve) => setTimeout(resolve, MILLISECONDS));
  frames = view.renderer.info.render.frame - first; since = performance.now() - began;
  const { triangles, calls, care } = view.stats;
  return { fps: 1000 * frames / since, triangles, calls, care };
})()"""


def main() -> int:
    """Measure, and write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=Path)
    parser.add_argument("--table", type=Path)
    arguments = parser.parse_args()
    began = time.perf_counter()
    source = Source.of_run(arguments.run)
    assert source.world is not None
    assert source.tables.run is not None
    city = city_folder(source.world)
    made = time.perf_counter() - began
    state = ViewerState(source, RecordedViews(source.tables.run).view, city=city)
    with ViewerServer(state) as server:
        first = [_first_picture(server.url) for _ in range(OPENINGS)]
        with _opened(server.url) as page:
            page.evaluate("vico.clock.playing = false")
            levels = [_level(page, care) for care in range(6)]
            loop = page.evaluate(_LOOP.replace("MILLISECONDS", str(int(1000 * SECONDS))))
    publish(_lines(source, made, first, levels, loop), arguments.table)
    return 0


@contextmanager
def _opened(url: str) -> Iterator[BrowserPage]:
    with open_page() as page:
        page.resize(WIDTH, HEIGHT)
        page.go_to(url)
        page.wait_for("window.vico && vico.view && vico.state.before && vico.view.city.textured", seconds=120)
        # The picture alone, without the panel beside it.
        page.evaluate("document.body.classList.add('bare')")
        page.wait_for("!vico.view.pending", seconds=60)
        yield page


def _first_picture(url: str) -> dict[str, float]:
    """Return seconds from asking for the page to the first picture of the city, and to all of it."""
    with open_page() as page:
        page.resize(WIDTH, HEIGHT)
        began = time.perf_counter()
        page.go_to(url)
        page.wait_for("window.vico && vico.view && vico.view.stats.first > 0", seconds=120)
        drawn = float(page.evaluate("vico.view.stats.first")) / 1000
        page.wait_for("vico.view.city.textured && !vico.view.pending", seconds=120)
        return {"first": drawn, "all": time.perf_counter() - began}


def _level(page: BrowserPage, care: int) -> dict[str, Any]:
    """Draw frames at a level of care; return their times, and the processor time of the whole browser a frame."""
    script = _DRAW.replace("CARE", str(care)).replace("FRAMES", str(FRAMES))
    page.evaluate(script)  # what comes into view is fetched
    before = _processor_seconds()
    found: dict[str, Any] = page.evaluate(script)
    found["processor"] = (_processor_seconds() - before) / (FRAMES + 5)
    found["care"] = care
    return found


def _processor_seconds() -> float:
    """Return the processor time that all processes below this one have taken."""
    parents, spent = {}, {}
    for folder in Path("/proc").iterdir():
        if not folder.name.isdecimal():
            continue
        try:
            fields = (folder / "stat").read_text().rpartition(")")[2].split()
        except OSError:
            continue
        parents[int(folder.name)] = int(fields[1])
        spent[int(folder.name)] = int(fields[11]) + int(fields[12])
    mine = {os.getpid()}
    while more := {child for child, parent in parents.items() if parent in mine} - mine:
        mine |= more
    return sum(spent[p] for p in mine if p != os.getpid()) / os.sysconf("SC_CLK_TCK")


def _lines(
    source: Source, made: float, first: list[dict[str, float]], levels: list[dict[str, Any]], loop: dict[str, Any]
) -> list[str]:
    kinds: dict[str, int] = {}
    for member in source.tables.cast().values():
        kinds[member.kind] = kinds.get(member.kind, 0) + 1
    there = ", ".join(f"{count} {kind}" for kind, count in sorted(kinds.items()))
    load = os.getloadavg()[0]
    return [
        "# Viewer: the page in headless Chromium",
        "",
        f"{machine()}",
        "Made by `python benchmarks/viewer.py RUN --table benchmarks/results/viewer.md`.",
        "",
        f"{WIDTH} x {HEIGHT} pixels, software WebGL (SwiftShader); load {load:.1f} at the end. In the run: {there}.",
        f"The files of the city: {made:.1f} s (made once a world, then read).",
        "",
        "| seconds on loopback | median | least | greatest | n |",
        "|---|---|---|---|---|",
        *(_row(name, [found[key] for found in first]) for name, key in
          (("to the first picture of the city", "first"), ("until everything in view is there", "all"))),
        "",
        "Frames drawn one after the other at each level of care, the run going on; milliseconds:",
        "",
        "| care | pixels | triangles | draw calls | people | wall, median | wall, p95 | processor time |",
        "|---|---|---|---|---|---|---|---|",
        *(_level_row(found) for found in levels),
        "",
        f"The page's own loop, which chooses its level of care: {loop['fps']:.1f} frames a second at level "
        f"{loop['care']} ({loop['triangles']:,} triangles, {loop['calls']} draw calls) over {SECONDS:.0f} s.",
        "",
        "A level's processor time is that of the whole browser: on idle cores a frame takes less than that, for the",
        "software renderer uses both. Wall times contain whatever else the machine did.",
    ]  # fmt: skip


def _row(name: str, values: list[float]) -> str:
    return f"| {name} | {statistics.median(values):.2f} | {min(values):.2f} | {max(values):.2f} | {len(values)} |"


def _level_row(found: dict[str, Any]) -> str:
    took = sorted(found["took"])
    return (
        f"| {found['care']} | {found['width']} x {found['height']} | {found['triangles']:,} | {found['calls']} | "
        f"{found['people']} | {statistics.median(took):.0f} | {took[int(0.95 * len(took))]:.0f} | "
        f"{1000 * found['processor']:.0f} |"
    )


if __name__ == "__main__":
    raise SystemExit(main())
