"""``report.html`` of a world and of a city: what was built, for a person; it opens from disk.

A world's page has its map, views, counts, what was left out and why, seconds and licences. A city's page has its map,
to be zoomed and dragged, what was built, and what was left out.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from html import escape

from vico.io.files import write_bytes
from vico.world.city import TILES, City
from vico.world.model import Dropped, StageReport
from vico.world.world import World, stage_seconds

_SHOWN_IDS = 200
#: Style sheet of our reports.
STYLE = """
:root { color-scheme: light dark; --ink: #22252a; --soft: #63676e; --line: #d9dade; --paper: #fbfaf7; --bar: #0072b2; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e8e6e1; --soft: #a2a5aa; --line: #3b3e44; --paper: #1b1d20; --bar: #56b4e9; }
}
body { margin: 0 auto; max-width: 1180px; padding: 2rem 1.2rem 4rem; background: var(--paper); color: var(--ink);
  font: 16px/1.5 system-ui, sans-serif; }
h1 { margin: 0; font-size: 2rem; } h2 { margin: 2.6rem 0 .6rem; font-size: 1.25rem; }
p.lead { margin: .2rem 0 1.6rem; color: var(--soft); }
img { width: 100%; height: auto; border-radius: 4px; display: block; background: var(--line); }
.views { display: grid; grid-template-columns: repeat(auto-fill, minmax(270px, 1fr)); gap: .7rem; margin-top: .7rem; }
.figures { display: grid; grid-template-columns: repeat(auto-fill, minmax(150px, 1fr)); gap: .8rem 1.4rem; }
.figures b { display: block; font-size: 1.5rem; font-variant-numeric: tabular-nums; line-height: 1.2; }
.figures span { color: var(--soft); font-size: .9rem; }
table { border-collapse: collapse; width: 100%; font-size: .95rem; }
th { text-align: left; font-weight: 600; } th, td { padding: .3rem .9rem .3rem 0; border-bottom: 1px solid var(--line);
  vertical-align: top; } td.n { text-align: right; white-space: nowrap; width: 5rem; }
td.bar { width: 45%; } td.bar i { display: block; height: .75rem; margin-top: .35rem; background: var(--bar);
  border-radius: 2px; min-width: 1px; }
details { border-bottom: 1px solid var(--line); padding: .35rem 0; } summary { cursor: pointer; }
details p { color: var(--soft); font-size: .85rem; overflow-wrap: anywhere; margin: .3rem 0 .3rem 1.2rem; }
code { font-size: .85em; }
"""


def report_page(world: World) -> str:
    """Return the page, HTML; its pictures are the world's own files, by relative path."""
    manifest = world.manifest
    origin, side = manifest.origin, 2 * manifest.half
    views = sorted(p.relative_to(world.file(".")).as_posix() for p in world.file(".").glob("previews/view_*.png"))
    seconds = stage_seconds(world)
    parts = [
        "<!doctype html><html lang=en><meta charset=utf-8>",
        "<meta name=viewport content='width=device-width, initial-scale=1'>",
        f"<title>{escape(manifest.name)}: a world</title><style>{STYLE}</style>",
        f"<h1>{escape(manifest.name)}</h1>",
        f"<p class=lead>{side:.0f} m × {side:.0f} m around {origin.lat:.5f}, {origin.lon:.5f}; seed {manifest.seed}; "
        f"{escape(manifest.producer)}; built in {sum(seconds.values()):.1f} s</p>",
        "<img src='map.png' alt='The world from above: streets, buildings, places and bus lines'>",
    ]
    if world.file("previews/above.png").is_file():
        parts.append("<img src='previews/above.png' alt='The whole square from straight above, rendered' loading=lazy>")
    if views:
        pictures = "".join(
            f"<a href='{escape(v)}'><img src='{escape(v)}' alt='A street seen at eye height' loading=lazy></a>"
            for v in views
        )
        parts.append(f"<h2>In its streets</h2><div class=views>{pictures}</div>")
    parts.append("<h2>What is there</h2>" + figures(manifest.counts))
    parts.append("<h2>Places by type</h2>" + _bars(manifest.places_by_type.items(), unit=""))
    parts.append("<h2>What was left out or mended, and why</h2>" + omissions(manifest.stages))
    stages = [
        (_label(s.name), "; ".join(f"{_label(name)} {number:,}" for name, number in s.counts.items()))
        for s in manifest.stages
    ]
    parts.append("<h2>Stage by stage</h2>" + _table(("stage", "made"), stages))
    parts.append("<h2>Seconds a stage</h2>" + _bars(seconds.items(), unit=" s"))
    rows = [
        (
            escape(s.kind),
            escape(s.name),
            escape(s.attribution),
            escape(s.licence),
            escape(s.timestamp or ""),
            f"<code>{escape((s.sha256 or '')[:12])}</code>",
        )
        for s in manifest.sources
    ]
    head = ("what", "name", "credit", "licence", "as of", "SHA-256")
    parts.append("<h2>Sources and licences</h2>" + _table(head, rows))
    return "\n".join(parts) + "\n"


def write_report(world: World) -> None:
    """Write the page into the world's folder. It shows seconds, so it is no part of the world's identity."""
    write_bytes(world.file("report.html"), report_page(world).encode())


def _label(name: str) -> str:
    return escape(name.replace("_", " "))


def figures(counts: Mapping[str, float]) -> str:
    """Return numbers with what they count, HTML."""
    cells = "".join(f"<div><b>{number:,}</b><span>{_label(name)}</span></div>" for name, number in counts.items())
    return f"<div class=figures>{cells}</div>"


def _bars(values: Iterable[tuple[str, float]], *, unit: str) -> str:
    pairs = list(values)
    most = max((value for _, value in pairs), default=0) or 1
    rows = "".join(
        f"<tr><td>{_label(name)}</td><td class=n>{value if isinstance(value, int) else f'{value:.2f}'}{unit}</td>"
        f"<td class=bar><i style='width:{100 * value / most:.1f}%'></i></td></tr>"
        for name, value in pairs
    )
    return f"<table>{rows}</table>"


def omissions(stages: Sequence[StageReport]) -> str:
    """Return what stages left out, by reason, HTML."""
    parts = []
    for stage in stages:
        reasons: dict[str, list[Dropped]] = defaultdict(list)
        for dropped in stage.dropped:
            reasons[dropped.reason].append(dropped)
        for reason, them in sorted(reasons.items(), key=lambda item: (-len(item[1]), item[0])):
            ids = ", ".join(escape(d.id) for d in them[:_SHOWN_IDS])
            more = f" and {len(them) - _SHOWN_IDS} more" if len(them) > _SHOWN_IDS else ""
            parts.append(
                f"<details><summary>{_label(stage.name)}: {len(them):,} × {escape(reason + _mending(reason))}</summary>"
                f"<p>{ids}{more}</p></details>"
            )
    return "".join(parts) or "<p>Nothing.</p>"


def _mending(reason: str) -> str:
    """Return how to mend what an extract's edge cut; empty for other reasons."""
    if "not in the file" not in reason:
        return ""
    return "; to have it whole, clip anew with whole relations (osmium extract -s smart), or take a larger extract"


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    top = "".join(f"<th>{cell}</th>" for cell in head)
    body = "".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<table><tr>{top}</tr>{body}</table>"


# The map of a tile is the left of its picture; the rest is its legend.
_PICTURE = 1880 / 1500
_OWN_STYLE = """
.map { position: relative; overflow: hidden; height: 78vh; border-radius: 4px; background: var(--line); cursor: grab;
  touch-action: none; } .map:active { cursor: grabbing; }
.map > div { position: absolute; transform-origin: 0 0; }
.map a { position: absolute; overflow: hidden; outline: 1px solid transparent; }
.map img { width: PERCENT; max-width: none; border-radius: 0; display: block; }
.map.bordered a { outline-color: #0072b288; } .map a.lost { background: repeating-linear-gradient(45deg, #8884 0 8px,
  #8882 8px 16px); color: var(--soft); font-size: .8rem; padding: .4rem; box-sizing: border-box; }
.bar button { font: inherit; padding: .25rem .8rem; margin: .5rem .3rem .5rem 0; }
""".replace("PERCENT", f"{100 * _PICTURE:.4f}%")
_SCRIPT = """
const map = document.querySelector(".map"), sheet = map.firstElementChild, whole = sheet.clientWidth;
let zoom = 1, x = 0, y = 0;
const show = () => { sheet.style.transform = `translate(${x}px, ${y}px) scale(${zoom})`; };
const fit = () => { zoom = Math.min(map.clientWidth, map.clientHeight) / whole;
  x = (map.clientWidth - whole * zoom) / 2; y = (map.clientHeight - whole * zoom) / 2; show(); };
const by = (factor, px, py) => { const before = zoom; zoom = Math.min(Math.max(zoom * factor, 0.02), 8);
  x = px - (px - x) * zoom / before; y = py - (py - y) * zoom / before; show(); };
const middle = () => [map.clientWidth / 2, map.clientHeight / 2];
map.addEventListener("wheel", (e) => { e.preventDefault(); const box = map.getBoundingClientRect();
  by(Math.exp(-e.deltaY / 500), e.clientX - box.left, e.clientY - box.top); }, { passive: false });
let from = null, moved = 0;
map.addEventListener("pointerdown", (e) => { from = [e.clientX - x, e.clientY - y]; moved = 0; });
addEventListener("pointermove", (e) => { if (!from) return; moved += Math.abs(e.movementX) + Math.abs(e.movementY);
  x = e.clientX - from[0]; y = e.clientY - from[1]; show(); });
addEventListener("pointerup", () => { from = null; });
map.addEventListener("click", (e) => { if (moved > 6) e.preventDefault(); });
map.addEventListener("dragstart", (e) => e.preventDefault());
map.addEventListener("keydown", (e) => {
  const step = { ArrowLeft: [80, 0], ArrowRight: [-80, 0], ArrowUp: [0, 80], ArrowDown: [0, -80] }[e.key];
  if (step) { x += step[0]; y += step[1]; show(); e.preventDefault(); }
  else if (e.key === "+" || e.key === "=") by(1.3, ...middle());
  else if (e.key === "-") by(1 / 1.3, ...middle()); });
document.getElementById("in").onclick = () => by(1.5, ...middle());
document.getElementById("out").onclick = () => by(1 / 1.5, ...middle());
document.getElementById("fit").onclick = fit;
document.getElementById("tiles").onclick = () => map.classList.toggle("bordered");
addEventListener("resize", fit); fit();
"""
_MAP_SIDE = 600  # pixels of a tile before it is zoomed


def _city_page(city: City) -> str:
    """Return the page, HTML; its pictures are those of the tiles, by relative path."""
    manifest = city.manifest
    (west, south), (east, north) = manifest.first, manifest.last
    squares = []
    for tile in manifest.tiles:
        there = f"left:{(tile.column - west) * _MAP_SIDE}px;top:{(north - tile.row) * _MAP_SIDE}px"
        folder = f"{TILES}/{escape(tile.name)}"
        squares.append(
            f"<a style='{there}' href='{folder}/report.html' title='tile {escape(tile.name)}'>"
            f"<img src='{folder}/map.png' alt='Map of tile {escape(tile.name)}' loading=lazy></a>"
        )
    for name, reason in manifest.failed.items():
        column, row = map(int, name.split("_"))
        there = f"left:{(column - west) * _MAP_SIDE}px;top:{(north - row) * _MAP_SIDE}px"
        squares.append(f"<a class=lost style='{there}'>{escape(name)}: {escape(reason)}</a>")
    width, height = (east - west + 1) * _MAP_SIDE, (north - south + 1) * _MAP_SIDE
    area = len(manifest.tiles) * (manifest.size / 1000) ** 2
    numbers: dict[str, float] = {
        "square kilometres": round(area, 2),
        "tiles": len(manifest.tiles),
        "buildings": sum(tile.buildings for tile in manifest.tiles),
        "places": sum(tile.places for tile in manifest.tiles),
    }
    for report in manifest.reports:
        numbers |= {name.replace("_", " "): count for name, count in report.counts.items() if name != "tried"}
    origin = manifest.origin
    return "\n".join(
        [
            "<!doctype html><html lang=en><meta charset=utf-8>",
            "<meta name=viewport content='width=device-width, initial-scale=1'>",
            f"<title>{escape(city.path.name)}: a city</title><style>{STYLE}{_OWN_STYLE}"
            f".map a {{ width:{_MAP_SIDE}px; height:{_MAP_SIDE}px }}",
            f".map > div {{ width:{width}px; height:{height}px }}</style>",
            f"<h1>{escape(city.path.name)}</h1>",
            f"<p class=lead>{len(manifest.tiles)} tiles of {manifest.size:.0f} m around {origin.lat:.5f}, "
            f"{origin.lon:.5f}; seed {manifest.seed}; {escape(manifest.producer)}</p>",
            "<p class=bar><button id=in>zoom in</button><button id=out>zoom out</button>"
            "<button id=fit>all of it</button><button id=tiles>borders of tiles</button> "
            "drag to move; a click opens a tile's own report</p>",
            f"<div class=map tabindex=0 aria-label='Map of the city'><div>{''.join(squares)}</div></div>",
            f"<h2>What is there</h2>{figures(numbers)}",
            f"<h2>What was left out of its streets, and why</h2>{omissions(manifest.reports)}",
            f"<script>{_SCRIPT}</script></html>",
        ]
    )


def write_city_report(city: City) -> None:
    """Write ``report.html`` into a city's folder."""
    write_bytes(city.path / "report.html", _city_page(city).encode())
