"""Overlays of geometry that comes from outside: on a grid, of one dimension, and never a surprise.

Outlines that people draw nearly coincide, touch in points and cross themselves. An exact overlay of such outlines may
fail in the geometry engine, give slivers of a nanometre, or give lines and points beside areas, which the next overlay
refuses. The operations here bear shapely's names and do three things more:

- results lie on a grid of `GRID` metres, so that what is cut twice is cut alike, and slivers narrower than it vanish;
- a result holds only parts of the dimension that is meant: of two areas it is an area, even where they touch in a line;
- what the engine refuses is done once more with the operands mended (`make_valid`) and rounded to the grid as well,
  and then on a grid ten times as coarse. What fails even so is an `OverlayError`, for whoever knows which object it is
  about to leave that one out.

All take single geometries or arrays of them, as shapely's do.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.errors import GEOSException
from shapely.geometry.base import BaseGeometry

from vico.errors import VicoError

GRID = 0.001
"""Metres between the points that results may have: a tenth of the grid of OpenStreetMap's own coordinates."""

_COARSER = 10
_COLLECTION = int(shapely.GeometryType.GEOMETRYCOLLECTION)
_EMPTY: dict[int, BaseGeometry] = {
    0: shapely.from_wkt("POINT EMPTY"),
    1: shapely.from_wkt("LINESTRING EMPTY"),
    2: shapely.from_wkt("POLYGON EMPTY"),
}
_MULTI: dict[int, type[BaseGeometry]] = {
    0: shapely.MultiPoint,
    1: shapely.MultiLineString,
    2: shapely.MultiPolygon,
}

Shapes = NDArray[np.object_]


class OverlayError(VicoError, ValueError):
    """Geometries that can't be overlaid, even mended and on a coarser grid.

    Attributes
    ----------
    at
        Index of the failing one among arrays of operands; None where they were single.
    """

    at: int | None = None


def intersection(first: Any, second: Any, *, grid: float | None = GRID) -> Any:
    """Return what two geometries share, in the lower of their dimensions.

    Parameters
    ----------
    first, second
        Geometries or arrays of them, metres.
    grid
        Spacing of the grid that the result lies on, metres; None for results that are looked at and not cut further.

    Raises
    ------
    OverlayError
        If the engine refuses them even mended and on a coarser grid.
    """
    return _overlay(shapely.intersection, first, second, grid, np.minimum)


def difference(first: Any, second: Any, *, grid: float | None = GRID) -> Any:
    """Return what is left of `first` outside `second`, in the dimension of `first`. See `intersection`."""
    return _overlay(shapely.difference, first, second, grid, lambda one, _: one)


def symmetric_difference(first: Any, second: Any, *, grid: float | None = GRID) -> Any:
    """Return what lies in one of two geometries but not in both. See `intersection`."""
    return _overlay(shapely.symmetric_difference, first, second, grid, np.maximum)


def union(first: Any, second: Any, *, grid: float | None = GRID) -> Any:
    """Return what lies in either of two geometries, in the higher of their dimensions. See `intersection`."""
    return _overlay(shapely.union, first, second, grid, np.maximum)


def crossing(first: Any, second: Any, *, grid: float | None = GRID) -> Any:
    """Return where lines meet: points where they cross, and stretches that they share. See `intersection`."""
    return _overlay(shapely.intersection, first, second, grid, lambda one, _: one * 0 - 1)


def union_all(shapes: Iterable[BaseGeometry], *, grid: float | None = GRID) -> BaseGeometry:
    """Return what lies in any of the geometries, in the highest of their dimensions; an empty polygon of none.

    Raises
    ------
    OverlayError
        If the engine refuses one even mended and on a coarser grid; `at` is its index.
    """
    given = _array(shapes)
    if not len(given):
        return _EMPTY[2]
    wanted = int(shapely.get_dimensions(given).max())
    try:
        return _round_to_grid(_only(shapely.union_all(given), wanted), grid)
    except GEOSException:
        return _only(_union_of_each(given, wanted, grid), wanted)


def common_area(first: Any, second: Any) -> Any:
    """Return the area that geometries share, square metres: a measure alone, so on no grid, at a fifth of the cost."""
    return _measure(first, second, shapely.area)


def common_length(first: Any, second: Any) -> Any:
    """Return the length that lines share with lines or areas, metres: a measure alone, so on no grid."""
    return _measure(first, second, shapely.length)


def buffer(shape: Any, distance: Any, **style: Any) -> Any:
    """Return everything within a distance of a geometry, as `shapely.buffer`; `style` is passed on.

    Raises
    ------
    OverlayError
        If the engine refuses it even mended and on a coarser grid.
    """
    return _robust(lambda it, d: shapely.buffer(it, d, **style), "buffer", shape, distance)


def offset_curve(line: Any, distance: Any, **style: Any) -> Any:
    """Return the line at a distance beside a line (left is positive), as `shapely.offset_curve`. See `buffer`."""
    return _robust(lambda it, d: shapely.offset_curve(it, d, **style), "offset curve", line, distance)


def simplify(shape: Any, tolerance: Any) -> Any:
    """Return a geometry with fewer corners, none farther off than the tolerance, valid if the given one is."""

    def simplify_valid(it: Any, tolerance: Any) -> Any:
        made = shapely.simplify(it, tolerance, preserve_topology=True)
        torn = ~shapely.is_valid(made)
        return np.where(torn, it, made) if np.ndim(torn) else (it if torn else made)

    return _robust(simplify_valid, "simplification", shape, tolerance)


def on_grid(shape: Any, *, grid: float = GRID) -> Any:
    """Return a geometry with its corners on the grid and valid; parts that are narrower than it vanish.

    Raises
    ------
    OverlayError
        If the engine refuses it even mended.
    """
    return _robust(_snap, "rounding", shape, grid)


def make_valid(shape: Any) -> Any:
    """Return a valid geometry of the same dimension: rings that cross themselves become what they enclose.

    Raises
    ------
    OverlayError
        If the engine refuses it; `at` is its index in an array.
    """
    if isinstance(shape, BaseGeometry):
        try:
            return shape if shape.is_valid else _only(shape, int(shapely.get_dimensions(shape)))
        except GEOSException as error:
            raise _overlay_error("mending", error, shape) from None
    made = np.array(shape, object)
    for k in np.flatnonzero(~shapely.is_valid(made)).tolist():
        try:
            made.flat[k] = make_valid(made.flat[k])
        except OverlayError as error:
            error.at = k
            raise
    return made


def polygonize(lines: Iterable[BaseGeometry], *, grid: float | None = GRID) -> list[shapely.Polygon]:
    """Return the faces that lines enclose; they are cut where they cross, on the grid, so that none is missed.

    Raises
    ------
    OverlayError
        If the engine refuses the lines even on a coarser grid.
    """
    given = _array(lines)
    if not len(given):
        return []
    cut = union_all(given, grid=grid)
    try:
        return [face for face in shapely.get_parts(shapely.polygonize(shapely.get_parts(cut))) if face.is_valid]
    except GEOSException as error:
        raise _overlay_error("polygonize", error, cut) from None


def faces_between(lines: Iterable[BaseGeometry], *, grid: float = GRID) -> list[shapely.Polygon]:
    """Return the faces between lines of one piece or several, cut by each other on a grid in a single pass.

    Unlike `polygonize` it rounds the lines to the grid only where they are cut: lines that nearly coincide become one.

    Raises
    ------
    OverlayError
        If the engine refuses the lines.
    """
    try:
        cut = shapely.union_all([part for line in lines for part in shapely.get_parts(line)], grid_size=grid)
        return [face for face in shapely.get_parts(shapely.polygonize(shapely.get_parts(cut))) if face.is_valid]
    except GEOSException as error:
        raise OverlayError(f"lines can't be cut by each other ({error})") from None


def polygons_of(shape: BaseGeometry, least: float = 0.0) -> list[shapely.Polygon]:
    """Return the polygons within any geometry that are larger than `least` square metres."""
    found: list[shapely.Polygon] = []
    for part in shapely.get_parts(shape):
        if isinstance(part, shapely.Polygon):
            if part.area > least:
                found.append(part)
        elif hasattr(part, "geoms"):
            found += polygons_of(part, least)
    return found


def areas_of(shape: BaseGeometry, least: float = 0.0) -> shapely.MultiPolygon:
    """Return the areas within any geometry that are larger than `least` square metres, as one."""
    return shapely.MultiPolygon(polygons_of(shape, least))


def _array(shapes: Iterable[BaseGeometry]) -> Shapes:
    if isinstance(shapes, np.ndarray):
        return shapes
    given = list(shapes)
    made = np.empty(len(given), object)
    made[:] = given
    return made


def _overlay(
    operation: Callable[..., Any], first: Any, second: Any, grid: float | None, dimension: Callable[[Any, Any], Any]
) -> Any:
    if not isinstance(first, BaseGeometry) or not isinstance(second, BaseGeometry):
        one, two = np.broadcast_arrays(np.asarray(first, object), np.asarray(second, object))
        wanted = dimension(shapely.get_dimensions(one), shapely.get_dimensions(two))
        try:
            made = np.asarray(operation(one, two), object)
            odd = (shapely.get_dimensions(made) != wanted) | (shapely.get_type_id(made) == _COLLECTION)
            for k in np.argwhere((odd & (wanted >= 0)) | ~shapely.is_valid(made)):
                made[tuple(k)] = _only(made[tuple(k)], int(wanted[tuple(k)]))
            return made if grid is None else _snap(made, grid)
        except GEOSException:
            return _each(lambda a, b: _overlay(operation, a, b, grid, dimension), one, two)
    wanted = int(dimension(shapely.get_dimensions(first), shapely.get_dimensions(second)))
    try:
        return _round_to_grid(_only(operation(first, second), wanted), grid)
    except GEOSException:
        return _only(_once_more(operation, first, second, grid), wanted)


def _snap(shape: Any, grid: float) -> Any:
    """Round geometries to a grid, and forget it: overlays of what remembers a grid differ from those of a copy of it.

    A file does not keep it, so what was read would be overlaid otherwise than what was computed.
    """
    return shapely.set_precision(shapely.set_precision(shape, grid), 0.0)


def _round_to_grid(shape: BaseGeometry, grid: float | None) -> BaseGeometry:
    """Round a geometry to the grid. What lies there already, as whatever was cut before does, costs next to nothing."""
    if grid is None:
        return shape
    scale = round(1 / grid)
    points = shapely.get_coordinates(shape)
    return shape if bool((np.rint(points * scale) / scale == points).all()) else _snap(shape, grid)


def _once_more(
    operation: Callable[..., Any], first: BaseGeometry, second: BaseGeometry, grid: float | None
) -> BaseGeometry:
    """Do an overlay of two geometries that was refused, or may be, with whatever it takes."""
    refused: Exception = GEOSException("")
    for size in (grid or GRID, (grid or GRID) * _COARSER):
        try:
            return operation(_clean(first, size), _clean(second, size), grid_size=size)
        except GEOSException as error:
            refused = error
    raise _overlay_error(operation.__name__, refused, first, second) from None


def _clean(shape: BaseGeometry, grid: float) -> BaseGeometry:
    """Make a geometry valid, of its highest dimension alone, and on the grid."""
    made = _only(shape, int(shapely.get_dimensions(shape)))
    return _only(_snap(made, grid), int(shapely.get_dimensions(made)))


def _union_of_each(shapes: Shapes, wanted: int, grid: float | None) -> BaseGeometry:
    """Unite geometries that are refused together: each is mended, then they are joined one after the other."""
    clean, finest = [], grid or GRID
    for k, shape in enumerate(shapes.tolist()):
        try:
            clean.append(_clean(shape, finest))
        except GEOSException as error:
            raise _overlay_error("union", error, shape, at=k) from None
    kept = [(k, shape) for k, shape in enumerate(clean) if int(shapely.get_dimensions(shape)) == wanted]
    for size in (finest, finest * _COARSER):
        try:
            return shapely.union_all([shape for _, shape in kept], grid_size=size)
        except GEOSException:
            continue
    made = _EMPTY[wanted]
    for k, shape in kept:
        try:
            made = _only(_once_more(shapely.union, made, shape, finest), wanted)
        except OverlayError as error:
            error.at = k
            raise
    return made


def _measure(first: Any, second: Any, measure: Callable[[Any], Any]) -> Any:
    try:
        return measure(shapely.intersection(first, second))
    except GEOSException:
        return measure(intersection(first, second))


def _robust(operation: Callable[..., Any], name: str, shape: Any, amount: Any) -> Any:
    """Apply an operation to one geometry or each of an array, with a second and third try."""
    try:
        return operation(shape, amount)
    except GEOSException as error:
        refused = error
    if not isinstance(shape, BaseGeometry):
        one, two = np.broadcast_arrays(np.asarray(shape, object), np.asarray(amount))
        return _each(lambda a, b: _robust(operation, name, a, b), one, two)
    for size in (GRID, GRID * _COARSER):
        try:
            return operation(_clean(shape, size), amount)
        except GEOSException as error:
            refused = error
    raise _overlay_error(name, refused, shape) from None


def _each(function: Callable[[Any, Any], Any], one: NDArray[Any], two: NDArray[Any]) -> Shapes:
    """Apply a function to each pair of two arrays; an error says which."""
    made = np.empty(one.shape, object)
    for k, (a, b) in enumerate(zip(one.ravel().tolist(), two.ravel().tolist(), strict=True)):
        try:
            made.ravel()[k] = function(a, b)
        except OverlayError as error:
            error.at = k
            raise
    return made


def _only(shape: BaseGeometry, dimension: int) -> BaseGeometry:
    """Keep a geometry's valid parts of a dimension: the engine hands on outlines without extent as they are."""
    if not shape.is_valid:
        shape = shapely.make_valid(shape)
    if shape.geom_type != "GeometryCollection":
        return shape if dimension < 0 or shapely.get_dimensions(shape) == dimension else _EMPTY[dimension]
    if dimension < 0:
        return shape
    parts = [part for part in _leaves(shape) if shapely.get_dimensions(part) == dimension and not part.is_empty]
    if not parts:
        return _EMPTY[dimension]
    return parts[0] if len(parts) == 1 else _MULTI[dimension](parts)


def _leaves(shape: BaseGeometry) -> list[BaseGeometry]:
    parts = shapely.get_parts(shape).tolist()
    return [leaf for part in parts for leaf in (_leaves(part) if hasattr(part, "geoms") else [part])]


def _overlay_error(what: str, error: Exception, *shapes: BaseGeometry, at: int | None = None) -> OverlayError:
    named: Sequence[str] = [
        f"a {shape.geom_type} of {int(shapely.get_num_coordinates(shape))} corners at "
        + ", ".join(f"{value:.2f}" for value in shape.bounds[:2])
        for shape in shapes
    ]
    made = OverlayError(f"{what}: {' and '.join(named)} can't be overlaid ({str(error).splitlines()[0]})")
    made.at = at
    return made
