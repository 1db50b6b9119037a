"""Build a block of the packaged map under a roof of a city model, and say where every fact is from.

The model is written here, in CityJSON, over the largest house in the window: a hipped roof in the map's own place. A
city's own model is given the same way: vico world build --buildings city.json (docs/sources.md).

python examples/21_real_roofs.py --out out/real_roofs
"""

import argparse
import json
from collections import Counter
from pathlib import Path

import numpy as np
import shapely

from vico.geo.frame import LocalFrame
from vico.geo.osm import OsmArea, read_osm
from vico.geo.overlay import polygons_of
from vico.worldgen.pipeline import build_world
from vico.worldgen.request import BuildOptions, Sources, packaged_extract

LAT, LON = 60.1690, 24.9435
EAVES, RIDGE = 19.0, 26.0


def largest_house(path: Path, half: float) -> OsmArea:
    """Return the map's largest building whose middle lies in the window."""
    square = shapely.box(-half, -half, half, half)
    areas = read_osm(path, LocalFrame(LAT, LON), half).areas
    houses = [a for a in areas if "building" in a.tags and square.contains(a.polygon.centroid)]
    return max(houses, key=lambda area: area.polygon.area)


def model_of(house: OsmArea) -> dict[str, object]:
    """Return CityJSON of one building: four slopes over the house's box, longitudes, latitudes and metres."""
    box = np.asarray(
        shapely.minimum_rotated_rectangle(max(polygons_of(house.polygon), key=lambda p: p.area)).exterior.coords
    )
    corners = box[:4] if np.hypot(*(box[1] - box[0])) > np.hypot(*(box[2] - box[1])) else box[1:5]
    middle, along = corners.mean(axis=0), (corners[1] - corners[0]) * 0.25
    plan = np.concatenate([corners, corners, [middle - along, middle + along]])
    heights = np.array([0.0] * 4 + [EAVES] * 4 + [RIDGE] * 2)
    lat, lon = LocalFrame(LAT, LON).to_geodetic(plan)
    roofs = [[[4, 5, 9, 8]], [[5, 6, 9]], [[6, 7, 8, 9]], [[7, 4, 8]]]
    surfaces = [{"type": "GroundSurface"}, {"type": "RoofSurface"}]
    geometry = {
        "type": "MultiSurface",
        "lod": "2.2",
        "boundaries": [[[3, 2, 1, 0]], *roofs],
        "semantics": {"surfaces": surfaces, "values": [0, 1, 1, 1, 1]},
    }
    return {
        "type": "CityJSON",
        "version": "2.0",
        "metadata": {"referenceSystem": "https://www.opengis.net/def/crs/EPSG/0/4326"},
        "transform": {"scale": [1e-8, 1e-8, 0.001], "translate": [0.0, 0.0, 0.0]},
        "CityObjects": {"the-roof": {"type": "Building", "geometry": [geometry]}},
        # By the book EPSG:4326 begins with latitude.
        "vertices": np.round(np.column_stack([lat * 1e8, lon * 1e8, heights * 1e3])).astype(int).tolist(),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--radius", type=float, default=50.0)
    arguments = parser.parse_args()

    extract = packaged_extract().path
    house = largest_house(extract, arguments.radius)
    model = arguments.out.with_suffix(".city.json")
    model.parent.mkdir(parents=True, exist_ok=True)
    model.write_text(json.dumps(model_of(house)))

    sources = Sources(extract, buildings=(str(model),))
    options = BuildOptions(previews=False)
    build_world(sources, lat=LAT, lon=LON, half=arguments.radius, out=arguments.out, options=options)
    records = json.loads((arguments.out / "buildings.json").read_text())
    for what in ("footprint", "height", "roof"):
        told = Counter(record["sources"][what] for record in records)
        print(f"{what}: {', '.join(f'{number} from {name}' for name, number in told.most_common())}")
    roofed = next(record for record in records if record["id"] == house.id)
    print(f"{house.id} {roofed['name'] or ''}: {roofed['roof_shape']}, {roofed['height']:.1f} m to the ridge")


if __name__ == "__main__":
    main()
