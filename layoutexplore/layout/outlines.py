"""From labelled cells to rooms with polygons: the outlines run along the sides of the cells."""

from __future__ import annotations

import numpy as np
import shapely
from numba import njit

from layoutexplore.errors import ConfigError, MapError, checks_arguments, shortened
from layoutexplore.grids.arrays import Cells, Floats, Ints, Ints32, Mask, check_alike, dense_ids
from layoutexplore.grids.components import split_labels
from layoutexplore.grids.grid import FREE, UNKNOWN, OccupancyGrid
from layoutexplore.grids.outlines import cut_where_touching, trace_rings
from layoutexplore.grids.polygons import polygons_of
from layoutexplore.grids.runs import find_runs
from layoutexplore.layout.lines.face_clusters import renumber
from layoutexplore.layout.timing import StageTimer
from layoutexplore.layout.types import Details, Layout, LayoutRoom

HIGHEST_ID = 100_000
"""Ids of rooms up to this are kept where there are fewer cells: tables are as long as the highest one."""


def room_numbers(found: object, shape: tuple[int, int], where: str) -> Ints32:
    """Ids of rooms int32 (rows, cols) as they are, or 1, 2, ... in their order where one is too high.

    Args:
        found: int (rows, cols), 0 for none; anything, as a user's own code gives it.
        shape: (rows, cols) of the grid.
        where: Who gives them, for the message.

    Raises:
        ConfigError: It is something else, or one is below 0.

    Example:
        >>> room_numbers([[0, 2**40], [7, 7]], (2, 2), "mine").tolist()
        [[0, 2], [1, 1]]
    """
    try:
        ids = np.asarray(found)
    except (ValueError, OverflowError):  # a labelling and its number of labels, for one
        ids = np.asarray(None)
    if ids.shape != shape or not np.issubdtype(ids.dtype, np.integer):
        got = shortened(found) if ids.dtype == object else f"{ids.dtype} {ids.shape}"
        raise ConfigError(f"{where}: the room of each cell is a whole number {shape}, 0 for none, got {got}")
    least, most = int(ids.min(initial=0)), int(ids.max(initial=0))
    if least < 0:
        raise ConfigError(f"{where}: ids of rooms are 0 for none and above, got {least}")
    if most > max(ids.size, HIGHEST_ID):
        ids = dense_ids(ids)
    # In one order of memory: kernels are compiled anew for the other one.
    return ids.astype(np.int32, order="C")


@checks_arguments
def label_polygons(labels: Ints32) -> dict[int, shapely.Polygon]:
    """The outline of each label, in cells: x = column, y = row, cell (r, c) covering [c, c + 1] x [r, r + 1].

    Of a label in several 4-connected parts the largest part is outlined.

    Args:
        labels: int32 (rows, cols), 0 for none.

    Returns:
        Valid, pairwise disjoint polygons by label.

    Example:
        >>> label_polygons(np.array([[1, 1], [0, 2]], np.int32))[1].area
        2.0
    """
    # the kernel takes no array that may only be read
    labels = np.require(labels, np.int32, ("C", "W"))
    if labels.ndim != 2 or labels.min(initial=0) < 0:
        raise MapError(f"labels of cells are numbers (rows, cols) from 0 on, got {shortened(labels)}")
    corners, starts, owners, touching = trace_rings(labels)
    points = corners[:, ::-1].astype(np.float64)
    twice = np.cumsum(points[:, 0] * np.roll(points[:, 1], -1) - points[:, 1] * np.roll(points[:, 0], -1))
    shells: dict[int, tuple[float, int]] = {}
    holes: dict[int, list[Floats]] = {}
    several: set[int] = set()
    for ring, (begin, end, owner) in enumerate(
        zip(starts[:-1].tolist(), starts[1:].tolist(), owners.tolist(), strict=True)
    ):
        inner = twice[end - 2] - (twice[begin - 1] if begin else 0.0)
        double = inner + points[end - 1, 0] * points[begin, 1] - points[end - 1, 1] * points[begin, 0]
        if double < 0:
            holes.setdefault(owner, []).append(points[begin:end])
            continue
        if owner in shells:
            several.add(owner)
        if owner not in shells or double > shells[owner][0]:
            shells[owner] = (double, ring)
    if not shells:
        return {}
    names = sorted(shells)
    rings = shapely.linearrings(points, indices=np.repeat(np.arange(len(owners)), np.diff(starts)))
    outlines = shapely.polygons(rings[[shells[label][1] for label in names]])
    # Of a label in several parts, one may lie in a hole of another, and its holes in the outer one's shell.
    parts = split_labels(labels)[0] if several & holes.keys() else labels
    for k, label in enumerate(names):
        if label in holes:
            own = _of_part(holes[label], parts, outlines[k]) if label in several else holes[label]
            outlines[k] = shapely.Polygon(outlines[k].exterior, own)
    # An outline is valid where its label does not touch itself.
    doubtful = np.flatnonzero(np.isin(names, owners[touching]))
    for k in doubtful[~shapely.is_valid(outlines[doubtful])].tolist():
        outlines[k] = _cut_apart(outlines[k])
    return dict(zip(names, outlines.tolist(), strict=True))


def _of_part(holes: list[Floats], parts: Ints32, shell: shapely.Polygon) -> list[Floats]:
    """Those of a label's holes that lie in the part of a shell; `parts` int32 (rows, cols) numbers them."""
    # the cell to the left of a ring's first side belongs to the label
    cells = [_left_cell(ring) for ring in (shapely.get_coordinates(shell), *holes)]
    mine, *found = (parts[row, col] for row, col in cells)
    return [hole for hole, part in zip(holes, found, strict=True) if part == mine]


def _cut_apart(outline: shapely.Polygon) -> shapely.Polygon:
    """The same polygon with rings that touch none of their own corners.

    What a ring of cells encloses is four-connected: cut where it touches itself, its parts bound one polygon.
    The time follows the corners, where that of `make_valid`, which is left what is still wrong then, grows
    with the square of the holes.
    """
    pieces = [
        np.array(piece, np.float64)
        for ring in (outline.exterior, *outline.interiors)
        for piece in cut_where_touching(shapely.get_coordinates(ring)[:-1].tolist())
    ]
    first = np.cumsum([0, *map(len, pieces)])
    x, y = np.concatenate(pieces).T
    following = np.arange(1, len(x) + 1)
    following[first[1:] - 1] = first[:-1]
    area = np.add.reduceat(x * y[following] - y * x[following], first[:-1])
    rings = shapely.linearrings(
        np.stack([x, y], axis=1), indices=np.repeat(np.arange(len(pieces)), np.diff(first))
    )
    shell = int(area.argmax())
    cut: shapely.Polygon = shapely.polygons(rings[shell], holes=rings[area < 0])
    return cut if cut.is_valid else max(polygons_of(shapely.make_valid(cut)), key=lambda p: float(p.area))


def _left_cell(ring: Floats) -> tuple[int, int]:
    """(row, col) of the cell to the left of the first side of a ring."""
    along = np.sign(ring[1] - ring[0])
    x, y = ring[0] + 0.5 * along + 0.5 * np.array([-along[1], along[0]])
    return int(y), int(x)


def cell_polygons_to_world(polygons: list[shapely.Polygon], grid: OccupancyGrid) -> list[shapely.Polygon]:
    """Polygons in cells (x = column, y = row) as such in the grid's world frame, in metres."""

    def place(xy: Floats) -> Floats:
        return grid.cells_to_world(xy[:, ::-1] - 0.5)

    moved: list[shapely.Polygon] = shapely.transform(np.array(polygons, object), place).tolist()
    return moved


def number_rooms(labels: Ints32) -> Ints32:
    """Renumber labels 1, 2, ... in the order of their first cell in raster order."""
    return renumber(np.asarray(labels, np.int32).ravel(), 1).reshape(labels.shape)


@checks_arguments
def rooms_of_labels(
    labels: Ints32, grid: OccupancyGrid, footprint: Ints32 | None = None, details: Details | None = None
) -> tuple[LayoutRoom, ...]:
    """Rooms with polygons from labelled cells.

    Args:
        labels: int32 (rows, cols), 0 for none, numbered from 1.
        grid: The grid they belong to.
        footprint: int32 (rows, cols), the cells each room's polygon covers, with the furniture inside; the
            labels when None.
        details: Of the layout, to know the rooms' faces.
    """
    details = details or Details()
    most = int(labels.max(initial=0))
    if labels.shape != grid.shape or labels.min(initial=0) < 0 or most > labels.size:
        raise MapError(f"labels {labels.shape} number the rooms of a grid {grid.shape} from 1 on")
    if footprint is not None:
        check_alike("rooms_of_labels", labels=labels, footprint=footprint)
        if footprint.max(initial=0) > labels.size:
            raise MapError("footprints have the numbers of the labels")
    shapes = label_polygons(labels if footprint is None else footprint)
    total, seen, frontier, touching = (
        counts.tolist()
        for counts in _count_cells(
            np.ascontiguousarray(labels), np.ascontiguousarray(grid.cells), max(most, *shapes, 0) + 1
        )
    )
    return tuple(
        LayoutRoom(
            id=label,
            polygon=shape,
            seen_share=seen[label] / max(total[label], 1),
            is_partial=frontier[label],
            is_closed=not touching[label],
            details=details,
        )
        for label, shape in zip(shapes, cell_polygons_to_world(list(shapes.values()), grid), strict=True)
    )


@njit(cache=True, nogil=True)
def _count_cells(labels: Ints32, cells: Cells, count: int) -> tuple[Ints, Ints, Mask, Mask]:
    """By label: cells, known ones, whether a free one is beside an unknown one, and one on the border."""
    rows, cols = labels.shape
    total, seen = np.zeros(count, np.int64), np.zeros(count, np.int64)
    frontier, border = np.zeros(count, np.bool_), np.zeros(count, np.bool_)
    runs = find_runs(labels, np.int32(0))
    for k in range(len(runs)):
        r, first, last = runs[k]
        label, here, known = labels[r, first], cells[r, first:last], 0
        for c in range(here.size):
            known += here[c] != UNKNOWN
        total[label] += last - first
        seen[label] += known
        # outside of the grid is what lies on its border: no free cell is beside an unknown one there
        if not frontier[label]:
            below, above = cells[max(r - 1, 0), first:last], cells[min(r + 1, rows - 1), first:last]
            frontier[label] = _any_frontier(here, below, above) or (
                (first > 0 and here[0] == FREE and cells[r, first - 1] == UNKNOWN)
                or (last < cols and here[-1] == FREE and cells[r, last] == UNKNOWN)
            )
        border[label] |= r == 0 or r == rows - 1 or first == 0 or last == cols
    return total, seen, frontier, border


@njit(cache=True, nogil=True)
def _any_frontier(here: Cells, below: Cells, above: Cells) -> bool:
    """Whether a free cell of a run (n,) is beside an unknown one, in it or in the rows beside it."""
    found = False
    # bitwise and to the end: the compiler takes many cells at once
    for c in range(here.size):
        found |= (here[c] == FREE) & ((below[c] == UNKNOWN) | (above[c] == UNKNOWN))
    for c in range(here.size - 1):
        found |= (here[c] == FREE) & (here[c + 1] == UNKNOWN)
        found |= (here[c] == UNKNOWN) & (here[c + 1] == FREE)
    return found


def layout_of_labels(name: str, grid: OccupancyGrid, labels: Ints32, timer: StageTimer) -> Layout:
    """The layout of a method that only labels cells."""
    numbered = number_rooms(labels)
    with timer("outlines"):
        rooms = rooms_of_labels(numbered, grid)
    warnings = () if rooms else ("no room found: the free space is too small or too narrow",)
    return Layout(
        method=name, clean_grid=grid, labels=numbered, rooms=rooms, timings=timer.seconds, warnings=warnings
    )
