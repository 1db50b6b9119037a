"""Make the documentation's pictures of the page: a day's and an evening's run, wide and narrow, light and dark.

    python scripts/viewer_pictures.py DAY EVENING docs/images

Both are recorded runs with residents outdoors and indoors, such as those of `make demo`. Needs Chromium.
"""

from __future__ import annotations

import argparse
import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from PIL import Image

from vico.viewer.city import city_folder
from vico.viewer.headless import BrowserPage, open_page
from vico.viewer.server.serve import ViewerServer
from vico.viewer.server.state import ViewerState
from vico.viewer.sources.source import Source
from vico.viewer.sources.views import RecordedViews

_READY = "window.vico && vico.view && vico.state.before && vico.view.city.textured && !vico.view.pending"
# Of the residents outdoors, or indoors, the one with most people around.
_SOMEBODY = """(() => {
  const { agents, people } = vico.state.before, place = (e) => vico.state.bodies.get(e);
  const away = (a, b) => Math.hypot(a.x - b.x, a.y - b.y);
  const near = (e) => [...people.entity].filter((o) => away(place(o), place(e)) < 25);
  const found = [...agents.entity].filter((e, k) => (agents.room[k] >= 0) === INDOORS && place(e));
  return found.sort((a, b) => near(b).length - near(a).length)[0] ?? 0;
})()"""


@contextmanager
def shown(run: Path, *, width: int, height: int, dark: bool = False) -> Iterator[BrowserPage]:
    """Open a run's page, all of it drawn, standing still."""
    source = Source.recorded(run)
    assert source.tables.run is not None
    assert source.world is not None
    state = ViewerState(source, RecordedViews(source.tables.run).view, city=city_folder(source.world))
    with ViewerServer(state) as server, open_page() as page:
        page.resize(width, height, dark=dark)
        page.go_to(server.url)
        page.wait_for(_READY, seconds=120)
        page.evaluate("vico.view.adapts = false, vico.view.setCare(5), vico.clock.playing = false")
        yield page


def shoot(page: BrowserPage, path: Path) -> None:
    """Wait until everything in view is there, and keep what is seen."""
    page.wait_for(_READY, seconds=120)
    page.evaluate("new Promise((done) => setTimeout(done, 4000))")
    picture = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
    picture.save(path, quality=88, optimize=True)


def follow(page: BrowserPage, second: float, *, indoors: bool, mode: str) -> None:
    """Go to a moment, choose somebody there, and look from somewhere."""
    page.evaluate(f"vico.clock.seek({second})")
    page.evaluate("new Promise((done) => setTimeout(done, 1500))")
    who = page.evaluate(_SOMEBODY.replace("INDOORS", str(indoors).lower()))
    page.evaluate(f"vico.select({who}), vico.page.setMode('{mode}')")
    page.evaluate("new Promise((done) => setTimeout(done, 1500))")


def main() -> None:
    """Shoot them all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("day", type=Path)
    parser.add_argument("evening", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--second", type=float, default=240.0, help="of the day's run, from its start")
    arguments = parser.parse_args()
    out = arguments.out
    with shown(arguments.day, width=1440, height=860) as page:
        start = float(page.evaluate("vico.source.timeOf(0)"))
        follow(page, start + arguments.second, indoors=False, mode="follow")
        shoot(page, out / "viewer_street.jpg")
        page.evaluate("vico.page.setMode('bird')")
        shoot(page, out / "viewer_birds_eye.jpg")
        page.evaluate("vico.page.setMode('orbit'), vico.cameras.distance = 90")
        shoot(page, out / "viewer_shadows.jpg")
        follow(page, start + arguments.second, indoors=True, mode="orbit")
        shoot(page, out / "viewer_room.jpg")
    with shown(arguments.day, width=400, height=780) as page:
        follow(page, start + arguments.second, indoors=False, mode="follow")
        shoot(page, out / "viewer_narrow.jpg")
    with shown(arguments.evening, width=1440, height=860, dark=True) as page:
        follow(page, float(page.evaluate("vico.source.timeOf(20)")), indoors=False, mode="follow")
        shoot(page, out / "viewer_night_dark.jpg")


if __name__ == "__main__":
    main()
