"""The lane-level road network: SUMO's netconvert, run on cleaned streets as a process of its own."""

from __future__ import annotations

import importlib.metadata
import math
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from vico.errors import MissingExtraError, VicoError
from vico.geo.frame import LocalFrame
from vico.geo.osm import OsmData
from vico.world.heights import HeightField
from vico.world.model import FAILED
from vico.worldgen.facts.fault_isolation import leave_out
from vico.worldgen.facts.site import SiteFacts
from vico.worldgen.streets.lane_shapes import CarriagewayEdges, move_sidewalks, smooth_lanes
from vico.worldgen.streets.opendrive import repair_opendrive
from vico.worldgen.streets.roads import DEFAULTS, SIDEWALK_WIDTH, WALKING, NetworkStreet, is_traffic_street

_NO_RAIL = (
    "rail rail_urban rail_electric rail_fast tram drone aircraft scooter container wheelchair subway cable_car ship"
)
_OPTIONS = {
    "offset.disable-normalization": "true",
    "osm.sidewalks": "true",
    "osm.turn-lanes": "false",
    "osm.all-attributes": "false",
    "crossings.guess": "true",
    "crossings.guess.speed-threshold": "30",
    "walkingareas": "true",
    "default.crossing-width": "3.5",
    "geometry.remove": "true",
    "geometry.min-dist": "0.5",
    "roundabouts.guess": "true",
    "no-turnarounds.except-deadend": "true",
    "junctions.join": "true",
    "junctions.join-dist": "12",
    "junctions.corner-detail": "4",
    "junctions.internal-link-detail": "10",
    "tls.guess-signals": "true",
    "tls.join": "true",
    "tls.discard-simple": "true",
    "output.street-names": "true",
    "precision": "3",
    "no-warnings": "true",
    "xml-validation": "never",
    "xml-validation.net": "never",
}
# netconvert needs under a second for 800 m of a dense city; this only ends a hang. For each km2 of larger ones:
_LIMIT_SECONDS = 60
_ABOVE_ALL = 1e5  # metres above every surface
_PROFILE = 10.0  # metres between points of lanes on decks
# So many streets may be left out because netconvert refuses them.
_MOST_REFUSED = 3


class NetconvertError(VicoError, RuntimeError):
    """netconvert ran, but gave no network."""


@dataclass(frozen=True)
class RoadNetwork:
    """The bytes of `roads.net.xml` (SUMO) and `roads.xodr` (OpenDRIVE), local metres, free of times and paths.

    A part of a larger network has no OpenDRIVE of its own.
    """

    net_xml: bytes
    xodr: bytes | None


def netconvert_binary() -> Path:
    """Where netconvert lies in the environment, found without importing the package (it repoints PROJ's data).

    Raises
    ------
    MissingExtraError
        If the package is not installed.
    """
    try:
        files = importlib.metadata.files("eclipse-sumo") or []
    except importlib.metadata.PackageNotFoundError:
        files = []
    name = "netconvert.exe" if sys.platform == "win32" else "netconvert"
    for file in files:
        if file.name == name and file.parent.name == "bin" and "sumo" in file.parts:
            path = Path(str(file.locate()))
            if path.exists():
                return path
    raise MissingExtraError(
        "road network: netconvert is not installed; type: pip install 'virtual-community[worldgen]'"
    )


def road_network(
    site: SiteFacts,
    streets: Sequence[NetworkStreet],
    height: HeightField | None = None,
    kerbs: CarriagewayEdges | None = None,
) -> RoadNetwork:
    """Build the lane-level network of a window: lanes, junctions, sidewalks, crossings, signals.

    Parameters
    ----------
    site
        The map and its facts; every street ends at the edge of its window.
    streets
        `streets_from_osm` of the same site.
    height
        The ground and the decks above it: lanes and walkways lie on them; without it all is flat.
    kerbs
        Where carriageways end: sidewalks lie beyond; without it they lie beside the outermost lanes.

    Returns
    -------
    RoadNetwork
        Equal input gives equal bytes; an empty network where the window has no street for people or traffic. Where
        traffic keeps left so do the lanes: a street's lane 0 is at its left kerb.

    Raises
    ------
    MissingExtraError, NetconvertError
        If netconvert is not installed, or gives no network even without the streets that it seems to refuse; one or a
        few of these are left out.
    """
    osm = site.osm
    used = [street for street in streets if is_traffic_street(street)]
    used += [s for s in streets if s.kind == "pedestrian" and s.closed is None]
    if not used:
        return empty_network(osm.frame, osm.half)
    binary = netconvert_binary()
    for _ in range(_MOST_REFUSED):
        try:
            return _convert(binary, site, used, height, kerbs)
        except NetconvertError as error:
            culprit = _culprit(binary, site, used, height)
            leave_out(f"w{culprit}", f"{FAILED}: {error}")
            used = [street for street in used if street.way != culprit]
    return _convert(binary, site, used, height, kerbs) if used else empty_network(osm.frame, osm.half)


def _culprit(binary: Path, site: SiteFacts, streets: Sequence[NetworkStreet], height: HeightField | None) -> int:
    """Return the way with which streets that are converted together begin to fail, by halving: the list fails whole."""
    good, bad = 0, len(streets)
    while bad - good > 1:
        middle = (good + bad) // 2
        try:
            _convert(binary, site, streets[:middle], height)
            good = middle
        except NetconvertError:
            bad = middle
    return streets[bad - 1].way


def _convert(
    binary: Path,
    site: SiteFacts,
    streets: Sequence[NetworkStreet],
    height: HeightField | None = None,
    kerbs: CarriagewayEdges | None = None,
) -> RoadNetwork:
    """Run netconvert.

    Raises
    ------
    NetconvertError
        If it gives no network.
    """
    osm = site.osm
    with tempfile.TemporaryDirectory(prefix="vico-roads-") as folder:
        work = Path(folder)
        (work / "streets.osm").write_text(_osm_xml(osm, streets, height), encoding="utf-8")
        (work / "types.xml").write_text(_types_xml(), encoding="utf-8")
        command = [
            str(binary), "--osm-files", "streets.osm", "--type-files", "types.xml", "--proj", osm.frame.proj4,
            "--output-file", "net.xml", "--opendrive-output", "roads.xodr", 
            "--lefthand", str(site.left_driving).lower(), "--osm.elevation", str(height is not None).lower(),
            *[part for key, value in _OPTIONS.items() for part in (f"--{key}", value)],
        ]  # fmt: skip
        environment = {"PATH": os.environ.get("PATH", ""), "LC_ALL": "C", "SUMO_HOME": str(binary.parent.parent)}
        limit = _LIMIT_SECONDS * max(1.0, 4e-6 * osm.half**2)
        try:
            done = subprocess.run(command, cwd=work, env=environment, capture_output=True, timeout=limit, check=False)
        except subprocess.TimeoutExpired:
            raise NetconvertError(f"road network: netconvert did not end within {limit:.0f} s") from None
        net, xodr = work / "net.xml", work / "roads.xodr"
        # netconvert's exit status lies when the clip cuts a relation: trust the files, not the code.
        if not (net.exists() and xodr.exists() and b"</net>" in net.read_bytes()[-64:]):
            said = done.stderr.decode(errors="replace").strip().splitlines()[-1:] or ["no message"]
            raise NetconvertError(
                f"road network: netconvert gave no network ({said[0]}); exit status {done.returncode}"
            )
        # The comment at the head holds the time of generation, the paths and the options: equal roads give equal bytes
        # without it and with a fixed date.
        plain = smooth_lanes(_COMMENT.sub(b"", net.read_bytes()))
        if kerbs is not None:
            plain = move_sidewalks(plain, kerbs, left_driving=site.left_driving)
        content = _DATE.sub(rb'\1 date=""', _COMMENT.sub(b"", xodr.read_bytes()), count=1)
        roads = repair_opendrive(content, height)
        return RoadNetwork(plain if height is None else _lay_lanes(plain, height), roads)


def empty_network(frame: LocalFrame, half: float) -> RoadNetwork:
    """Make the network of a place without streets (a pedestrian quarter, a campus): valid files with nothing in them.

    netconvert refuses to write one, so this is written here, as SUMO 1.20 and OpenDRIVE 1.4 have it.
    """
    west, south, east, north = frame.bbox(half)
    net = f"""<?xml version="1.0" encoding="UTF-8"?>

<net version="1.20" walkingareas="true" xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" \
xsi:noNamespaceSchemaLocation="http://sumo.dlr.de/xsd/net_file.xsd">

    <location netOffset="0.000,0.000" convBoundary="{-half:.3f},{-half:.3f},{half:.3f},{half:.3f}" \
origBoundary="{west:.6f},{south:.6f},{east:.6f},{north:.6f}" projParameter="{frame.proj4}"/>

</net>
"""
    xodr = f"""<?xml version="1.0" encoding="UTF-8"?>

<OpenDRIVE>
    <header revMajor="1" revMinor="4" name="" version="1.00" date="" north="{half:.3f}" south="{-half:.3f}" \
east="{half:.3f}" west="{-half:.3f}">
        <geoReference>
 <![CDATA[
 {frame.proj4}
]]>
        </geoReference>
    </header>
</OpenDRIVE>
"""
    return RoadNetwork(net.encode(), xodr.encode())


_COMMENT = re.compile(rb"<!--.*?-->\s*", re.DOTALL)
_DATE = re.compile(rb'(<header [^>]*?) date="[^"]*"')
_SHAPE = re.compile(rb'(<lane [^>]*? shape=")([^"]*)(")')


def _lay_lanes(content: bytes, height: HeightField) -> bytes:
    """Put every point of the lanes on the surface it is nearest to.

    netconvert knows heights at the nodes of the map alone. Between them the ground is not straight, but it is clear
    which of several surfaces above each other is meant.
    """
    shapes = [
        np.array([[*map(float, point.split(b",")), 0.0][:3] for point in found.group(2).split()])
        for found in _SHAPE.finditer(content)
    ]
    if not shapes:
        return content
    points = np.concatenate(shapes)
    rows = iter(
        [f"{x:.3f},{y:.3f},{z:.2f}" for (x, y, _), z in zip(points.tolist(), height.near(points).tolist(), strict=True)]
    )
    texts = iter([" ".join(next(rows) for _ in shape).encode() for shape in shapes])
    return _SHAPE.sub(lambda found: found.group(1) + next(texts) + found.group(3), content)


def _types_xml() -> str:
    """Lane widths and sidewalks as in the road database, so that lanes lie where the ground is painted."""
    rows = []
    for rank, (kind, (lanes, width, speed)) in enumerate(reversed(DEFAULTS.items()), start=1):
        for name in (kind, f"{kind}_link"):
            rows.append(
                f'<type id="highway.{name}" numLanes="{lanes}" speed="{speed}" priority="{rank}" oneway="false" '
                f'width="{width}" sidewalkWidth="{SIDEWALK_WIDTH}" disallow="pedestrian bicycle {_NO_RAIL}"/>'
            )
    rows.append(
        f'<type id="highway.pedestrian" numLanes="1" speed="2.78" priority="1" oneway="true" '
        f'width="{WALKING["pedestrian"]}" allow="pedestrian"/>'
    )
    return "<types>\n" + "\n".join(rows) + "\n</types>\n"


def _way_tags(street: NetworkStreet) -> dict[str, str]:
    """Return the tags netconvert reads, all decided; a link keeps its class."""
    tags = {"highway": street.kind}
    if street.name:
        tags["name"] = street.name
    if not street.drivable:
        return tags | {"oneway": "yes"}
    tags |= {
        "lanes": str(street.forward + street.backward),
        "oneway": "no" if street.backward else "yes",
        "maxspeed": f"{street.speed * 3.6:.1f}",
        "sidewalk": street.sidewalk if street.sidewalk != "none" else "no",
    }
    if street.backward:
        tags |= {"lanes:forward": str(street.forward), "lanes:backward": str(street.backward)}
    if street.tags.get("junction") in ("roundabout", "circular"):
        tags["junction"] = "roundabout"
    if street.access == "bus":
        tags |= {"access": "no", "bus": "yes"}
    return tags


def _levels(points: np.ndarray, level: np.ndarray, height: HeightField | None) -> np.ndarray:
    """Return how high nodes lie, metres: on the ground, on the highest surface (`level` 1) or on the lowest (-1)."""
    if height is None:
        return np.zeros(len(points))
    ground = height(points)
    return np.where(level != 0, height.near(np.c_[points, np.where(level != 0, level * _ABOVE_ALL, ground)]), ground)


def _with_profile(street: NetworkStreet, number: int) -> NetworkStreet:
    """Return a street with more nodes, so that its lanes can follow the profile of the deck it lies on."""
    nodes, points = [street.nodes[0]], [street.line[0]]
    for k in range(1, len(street.nodes)):
        run = street.line[k] - street.line[k - 1]
        count = math.ceil(float(np.hypot(*run)) / _PROFILE)
        for step in range(1, count):
            nodes.append(2 * 10**15 + number * 10**6 + len(nodes))
            points.append(street.line[k - 1] + run * (step / count))
        nodes.append(street.nodes[k])
        points.append(street.line[k])
    return replace(street, nodes=nodes, line=np.array(points))


def _osm_xml(osm: OsmData, streets: Sequence[NetworkStreet], height: HeightField | None) -> str:
    """Write an OSM file of just these streets, their nodes with their heights where those are known."""

    # Parts of a cut way and the edge's new nodes need ids of their own; OSM's end far below these.
    def way_id(street: NetworkStreet) -> int:
        return street.way + street.part * 10**13

    def node_id(node: int) -> int:
        return node if node > 0 else 10**15 - node

    streets = [_with_profile(street, k) if street.deck else street for k, street in enumerate(streets)]
    points: dict[int, np.ndarray] = {}
    level: dict[int, int] = {}
    for street in streets:
        for node, xy in zip(street.nodes, street.line, strict=True):
            points.setdefault(node_id(node), xy)
        if street.deck:
            level.update(dict.fromkeys(map(node_id, street.nodes), -1 if street.below else 1))
    signals = {n.id for n in osm.nodes if n.tags.get("highway") == "traffic_signals"}
    ids = sorted(points)
    lat, lon = osm.frame.to_geodetic(np.array([points[i] for i in ids]))
    rows = ['<?xml version="1.0" encoding="UTF-8"?>', '<osm version="0.6">']
    levels = _levels(np.array([points[i] for i in ids]), np.array([level.get(i, 0) for i in ids]), height)
    for i, y, x, z in zip(ids, lat, lon, levels, strict=True):
        tag = '<tag k="highway" v="traffic_signals"/>' if i in signals else ""
        tag += "" if height is None else f'<tag k="ele" v="{z:.2f}"/>'
        rows.append(f'<node id="{i}" lat="{y:.9f}" lon="{x:.9f}">{tag}</node>')
    for street in sorted(streets, key=way_id):
        refs = "".join(f'<nd ref="{node_id(n)}"/>' for n in street.nodes)
        tags = "".join(f"<tag k={quoteattr(k)} v={quoteattr(v)}/>" for k, v in _way_tags(street).items())
        rows.append(f'<way id="{way_id(street)}">{refs}{tags}</way>')
    whole = {street.way for street in streets if street.part == 0}
    for relation in sorted(osm.relations, key=lambda r: r.id):
        kind = relation.tags.get("restriction", "")
        kept = [m for m in relation.members if (m[0] == "w" and m[1] in whole) or (m[0] == "n" and m[1] in points)]
        roles = sorted(m[2] for m in kept)
        if relation.tags.get("type") == "restriction" and kind[:3] in ("no_", "onl") and roles == ["from", "to", "via"]:
            members = "".join(
                f'<member type="{"way" if t == "w" else "node"}" ref="{r}" role={quoteattr(role)}/>'
                for t, r, role in kept
            )
            rows.append(
                f'<relation id="{relation.id}">{members}<tag k="type" v="restriction"/>'
                f'<tag k="restriction" v={quoteattr(kind)}/></relation>'
            )
    return "\n".join([*rows, "</osm>", ""])
