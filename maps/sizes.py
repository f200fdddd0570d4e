"""How much a floor plan may hold: counted before anything is done with it that takes long.

Intersecting outlines takes time and memory with every place where two edges meet, tracing an image with every
corner between two rooms. Both are counted in a fraction of a second; public floor plans stay far below.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import shapely
from numba import njit
from numpy.typing import NDArray

from layoutexplore.errors import MapError
from layoutexplore.files.limits import limits, raise_it
from layoutexplore.grids.arrays import Floats, Labels, Mask

MOST_METRES = 1e8
"""No coordinate is larger: no building stands further from the origin of its coordinates."""

_PAIRS = 2_000_000_000
"""Pairs of edges that are compared at most: a second or two."""

_WORK = 100
"""Corners that are looked at for rooms and doors together, over the limit of vertices."""

_MEETINGS, _SHARED_MEETINGS = 2, 10
"""Places an edge in which it may meet others: rooms side by side touch at corners, or share whole edges."""

_CROWD, _STRAIGHT = 5, 0.005
"""Pairs of edges near each other, over the limit of crossings; how far a line bends, over what is near."""

_NESTED = 2
"""Pairs of rooms of which one lies inside of the other, over the limit of crossings."""

_CROSSED, _WRITTEN = 50_000_000, 50
"""Times that outlines may cross rows and columns, besides once a cell; and what is written meanwhile."""

_BOXES, _SMALL = 10, 400_000
"""How many rooms may lie over each other, as far as their boxes tell; and cells of the least image."""


def check_count(where: str, what: str, count: int, limit: str = "rooms") -> None:
    """Raise `MapError` where there are more of something than a limit allows.

    Args:
        where: The file or plan, for the message.
        what: What is counted, in the plural.
        count: How many there are.
        limit: Name of the limit.
    """
    most = getattr(limits(), limit)
    if count > most:
        raise MapError(
            f"{where}: {count} {what}, and the limit {limit} is {most:g}: {raise_it(limit, count)}"
        )


def check_ids(where: str, highest: int) -> None:
    """Raise `MapError` where the number of a room is too high: many tables are as long as the highest one.

    Args:
        where: The file or plan, for the message.
        highest: The number that is farthest from 0.
    """
    most = limits().room_ids
    if highest > most:
        raise MapError(
            f"{where}: a room has the id {highest}, and the limit room_ids is {most:g}: number the "
            f"rooms from 1, or {raise_it('room_ids', highest)}"
        )


def check_work(where: str, what: str, steps: float) -> None:
    """Raise `MapError` where every room or door would be compared with too many corners.

    Args:
        where: The file, for the message.
        what: What is compared.
        steps: How many comparisons of a thing with a corner.
    """
    most = _WORK * limits().vertices
    if steps > most:
        raise MapError(
            f"{where}: comparing {what} takes {steps:.2g} steps, and the limit vertices allows {most:g}: "
            f"{raise_it('vertices', steps / _WORK)}"
        )


def check_outlines(where: str, outlines: Iterable[Any], *, shared: bool = False) -> int:
    """Raise `MapError` unless outlines can be intersected soon: in their number, their corners, their tangle.

    Returns how many pairs of their edges meet that are no neighbours.

    Args:
        where: The file, for the message.
        outlines: Geometries, lines among them, or lists of points (x, y) that are closed to rings.
        shared: Whether neighbouring rooms share their outlines.
    """
    edges = _edges_of(outlines)
    check_count(where, "corners of outlines", len(edges), "vertices")
    if not (np.abs(edges) <= MOST_METRES).all():
        raise MapError(f"{where}: coordinates must be finite numbers of at most {MOST_METRES:g} m")
    most = limits().crossings + (_SHARED_MEETINGS if shared else _MEETINGS) * len(edges)
    order = np.argsort(np.minimum(edges[:, 0], edges[:, 2]), kind="stable")
    found = _meetings(np.ascontiguousarray(edges[order]), order, int(most), _PAIRS)
    if found > most:
        raise MapError(
            f"{where}: outlines cut across themselves or each other more than {limits().crossings:g} times, "
            "the limit crossings: this is no floor plan, or its points are in the wrong order"
        )
    return found


def check_crowding(where: str, outlines: Iterable[Any], reach: float) -> None:
    """Raise `MapError` where outlines lie too close to each other for walls of a thickness along them.

    The borders of walls that are thicker than what lies between them all cut each other. Corners along a
    curve do no harm, nor does a plan with the most rooms.

    Args:
        where: The file, for the message.
        outlines: Geometries, lines among them.
        reach: Metres; edges that lie as close as this are counted.
    """
    parts = shapely.get_parts(list(outlines))
    rings = np.concatenate([shapely.get_rings(parts), parts[shapely.get_dimensions(parts) == 1]])
    edges = _edges_of(shapely.simplify(rings, _STRAIGHT * reach, preserve_topology=False))
    order = np.argsort(np.minimum(edges[:, 0], edges[:, 2]), kind="stable")
    most = int(_CROWD * limits().crossings)
    if near_pairs(np.ascontiguousarray(edges[order]), order, reach, most, _PAIRS) > most:
        raise MapError(
            f"{where}: more than {most} pairs of edges lie within {reach:g} m of each other, "
            f"{_CROWD} times the limit crossings: this is no floor plan, or it is not in metres; "
            f"if it has thousands of rooms, {raise_it('crossings', 4 * limits().crossings)}"
        )


def check_overlaps(where: str, outlines: Sequence[Any]) -> None:
    """Raise `MapError` where far too many rooms lie inside of each other: each is cut by all those in it.

    A few areas with all the rooms of a floor inside do no harm.

    Args:
        where: The file, for the message.
        outlines: Polygons.
    """
    if not outlines:
        return
    tree = shapely.STRtree(outlines)
    boxes = len(tree.query(outlines)[0]) - len(outlines)
    check_count(where, "pairs of rooms of which the boxes overlap", boxes // 2, "vertices")
    pairs = len(tree.query(outlines, predicate="contains_properly")[0])
    most = int(_NESTED * limits().crossings)
    if pairs > most:
        raise MapError(
            f"{where}: rooms lie inside of each other, {pairs} pairs of them, and at most {most} may, "
            f"{_NESTED} times the limit crossings: {raise_it('crossings', pairs / _NESTED)}"
        )


def _edges_of(outlines: Iterable[Any]) -> Floats:
    """Edges float64 (n, 4) as (x0, y0, x1, y1) of all rings."""
    parts = [np.zeros((0, 4))]
    for outline in outlines:
        if isinstance(outline, shapely.LineString):
            rings = [shapely.get_coordinates(outline)]
        elif isinstance(outline, shapely.Geometry):
            rings = [shapely.get_coordinates(ring) for ring in shapely.get_rings(outline)]
        else:
            points = np.asarray(outline, np.float64).reshape(-1, 2)
            rings = [np.vstack([points, points[:1]])]
        parts += [np.hstack([ring[:-1], ring[1:]]) for ring in rings]
    return np.ascontiguousarray(np.vstack(parts))


@njit(cache=True, nogil=True)
def _meetings(edges: Floats, order: NDArray[np.int64], most: int, pairs: int) -> int:
    """How many pairs of edges meet, not counting neighbours of a ring; `most` + 1 where it is given up.

    The edges are sorted by their lower x: those that begin right of an edge's end cannot meet it, nor can any
    behind them. An edge meets another where neither has both ends strictly on one side of the other.
    """
    # Neighbours of a ring always meet; their numbers in the file differ by one.
    found = compared = 0
    for i in range(len(edges)):
        ax, ay, bx, by = edges[i, 0], edges[i, 1], edges[i, 2], edges[i, 3]
        right, low, high = max(ax, bx), min(ay, by), max(ay, by)
        for j in range(i + 1, len(edges)):
            cx, cy, dx, dy = edges[j, 0], edges[j, 1], edges[j, 2], edges[j, 3]
            if min(cx, dx) > right:
                break
            compared += 1
            if max(cy, dy) < low or min(cy, dy) > high or abs(order[i] - order[j]) == 1:
                continue
            c = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
            d = (bx - ax) * (dy - ay) - (by - ay) * (dx - ax)
            a = (dx - cx) * (ay - cy) - (dy - cy) * (ax - cx)
            b = (dx - cx) * (by - cy) - (dy - cy) * (bx - cx)
            if not ((c > 0 and d > 0) or (c < 0 and d < 0) or (a > 0 and b > 0) or (a < 0 and b < 0)):
                found += 1
        if found > most or compared > pairs:
            return most + 1
    return found


@njit(cache=True, nogil=True)
def near_pairs(edges: Floats, order: NDArray[np.int64], reach: float, most: int, pairs: int) -> int:
    """How many pairs of edges lie within `reach` of each other, as `_meetings` counts those that meet.

    Not counted are two that cross far from their ends: `_meetings` counts those.

    Args:
        edges: float64 (n, 4), metres: (x0, y0, x1, y1), sorted by their lower x.
        order: int64 (n,): number of each edge in the file; neighbours there are not counted.
        reach: Metres.
        most: How many pairs are counted; one more is returned where there are more.
        pairs: How many pairs are compared; `most` + 1 is returned where there are more.
    """
    # Segments that do not cross are nearest to each other at an end of one of them.
    found = compared = 0
    for i in range(len(edges)):
        a, b, right = edges[i, :2], edges[i, 2:], max(edges[i, 0], edges[i, 2]) + reach
        low, high = min(a[1], b[1]) - reach, max(a[1], b[1]) + reach
        for j in range(i + 1, len(edges)):
            c, d = edges[j, :2], edges[j, 2:]
            if min(c[0], d[0]) > right:
                break
            compared += 1
            if max(c[1], d[1]) < low or min(c[1], d[1]) > high or abs(order[i] - order[j]) == 1:
                continue
            away = min(squared_distance(a[0], a[1], c, d), squared_distance(b[0], b[1], c, d))
            away = min(away, squared_distance(c[0], c[1], a, b), squared_distance(d[0], d[1], a, b))
            found += away <= reach * reach
        if found > most or compared > pairs:
            return most + 1
    return found


@njit(cache=True, nogil=True)
def squared_distance(px: float, py: float, start: Floats, end: Floats) -> float:
    """The squared distance of a place from the segment between two points (x, y)."""
    x, y, to_x, to_y = end[0] - start[0], end[1] - start[1], px - start[0], py - start[1]
    along = min(max((to_x * x + to_y * y) / max(x * x + y * y, 1e-300), 0.0), 1.0)
    away: float = (to_x - along * x) ** 2 + (to_y - along * y) ** 2
    return away


def check_drawing(where: str, shapes: list[Any], resolution: float, cells: int) -> None:
    """Raise `MapError` where outlines are far too dense, or lie too often over each other, to be drawn soon.

    Args:
        where: The plan, for the message.
        shapes: Polygons that are drawn.
        resolution: Side of a cell in metres.
        cells: Of the raster.
    """
    rings = shapely.get_rings(shapely.get_parts(shapes))
    points, ring = shapely.get_coordinates(rings, return_index=True)
    # An outline crosses a line of cells every so many metres; of whole cells fifty are written as fast.
    lengths = np.abs(np.diff(points, axis=0)).sum(axis=1)[np.diff(ring) == 0].sum() / resolution
    steps = float(lengths + shapely.area(shapes).sum() / resolution**2 / _WRITTEN)
    if steps > _CROSSED + cells:
        raise MapError(
            f"{where}: its outlines are too dense for cells of {resolution:g} m, or too many lie over each "
            f"other: drawing them takes {steps:.2g} steps, and at most {_CROSSED + cells:.2g} are taken"
        )


def check_raster(where: str, occupied: Mask, room_ids: Labels) -> None:
    """Raise `MapError` unless the rooms of a raster can be traced soon.

    Args:
        where: The plan, for the message.
        occupied: bool (rows, cols).
        room_ids: int16 or int32 (rows, cols), 0 for none.
    """
    check_count(where, "cells", occupied.size, "image_pixels")
    ids = np.where(occupied, -1, room_ids)
    check_count(where, "corners between rooms and walls", _corners(ids), "vertices")
    check_count(where, "rooms", int(np.count_nonzero(np.bincount(ids[ids > 0]))))
    windows(where, room_ids)


Window = tuple[slice, slice]


def windows(where: str, ids: Labels) -> list[tuple[int, Window]]:
    """Every id above 0 of an image int16 or int32 (rows, cols), with the window of its cells.

    Args:
        where: The plan, for the message.
        ids: 0 for none.

    Raises:
        MapError: There are too many, or they lie scattered over each other.
    """
    from scipy.ndimage import find_objects

    count = int(np.count_nonzero(np.bincount(ids.ravel())[1:]))
    check_count(where, "rooms, doors and passages", count, "vertices")
    found = [(k, (w[0], w[1])) for k, w in enumerate(find_objects(ids), start=1) if w is not None]
    cells = sum((rows.stop - rows.start) * (cols.stop - cols.start) for _, (rows, cols) in found)
    if cells > _BOXES * max(ids.size, _SMALL):
        raise MapError(
            f"{where}: its {len(found)} rooms or passages lie scattered over each other: this is no image of "
            "rooms with one grey level or colour a room"
        )
    return found


@njit(cache=True, nogil=True)
def _corners(ids: Labels) -> int:
    """Places between four cells in which an outline turns, or two cross."""
    found = 0
    for r in range(ids.shape[0] - 1):
        for c in range(ids.shape[1] - 1):
            a, b, below, beside = ids[r, c], ids[r, c + 1], ids[r + 1, c], ids[r + 1, c + 1]
            # Straight on: the two upper cells are alike and the two lower ones, or left and right.
            if not ((a == b and below == beside) or (a == below and b == beside)):
                found += 1
    return found


def check_plan(where: str, rooms: Sequence[Any], doors: Sequence[Any]) -> None:
    """Raise `MapError` where there are too many rooms or doors."""
    check_count(where, "rooms", len(rooms))
    check_count(where, "doors", len(doors), "rooms")
