"""``report.html`` of a city: its map, to be zoomed and dragged, what was built, what was left out; opens from disk."""

from __future__ import annotations

from html import escape

from vico.io.files import write_bytes
from vico.world.city import TILES, City
from vico.worldgen.report import STYLE, figures, left_out

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
_SIDE = 600  # pixels of a tile before it is zoomed


def city_page(city: City) -> str:
    """Return the page, HTML; its pictures are those of the tiles, by relative path."""
    manifest = city.manifest
    (west, south), (east, north) = manifest.first, manifest.last
    squares = []
    for tile in manifest.tiles:
        there = f"left:{(tile.column - west) * _SIDE}px;top:{(north - tile.row) * _SIDE}px"
        folder = f"{TILES}/{escape(tile.name)}"
        squares.append(
            f"<a style='{there}' href='{folder}/report.html' title='tile {escape(tile.name)}'>"
            f"<img src='{folder}/map.png' alt='Map of tile {escape(tile.name)}' loading=lazy></a>"
        )
    for name, reason in manifest.failed.items():
        column, row = map(int, name.split("_"))
        there = f"left:{(column - west) * _SIDE}px;top:{(north - row) * _SIDE}px"
        squares.append(f"<a class=lost style='{there}'>{escape(name)}: {escape(reason)}</a>")
    width, height = (east - west + 1) * _SIDE, (north - south + 1) * _SIDE
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
            f".map a {{ width:{_SIDE}px; height:{_SIDE}px }}",
            f".map > div {{ width:{width}px; height:{height}px }}</style>",
            f"<h1>{escape(city.path.name)}</h1>",
            f"<p class=lead>{len(manifest.tiles)} tiles of {manifest.size:.0f} m around {origin.lat:.5f}, "
            f"{origin.lon:.5f}; seed {manifest.seed}; {escape(manifest.producer)}</p>",
            "<p class=bar><button id=in>zoom in</button><button id=out>zoom out</button>"
            "<button id=fit>all of it</button><button id=tiles>borders of tiles</button> "
            "drag to move; a click opens a tile's own report</p>",
            f"<div class=map tabindex=0 aria-label='Map of the city'><div>{''.join(squares)}</div></div>",
            f"<h2>What is there</h2>{figures(numbers)}",
            f"<h2>What was left out of its streets, and why</h2>{left_out(manifest.reports)}",
            f"<script>{_SCRIPT}</script></html>",
        ]
    )


def write_city_report(city: City) -> None:
    """Write ``report.html`` into a city's folder."""
    write_bytes(city.path / "report.html", city_page(city).encode())
