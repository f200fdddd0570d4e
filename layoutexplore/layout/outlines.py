"""From labelled cells to rooms with polygons: the outlines run along the sides of the cells."""

from __future__ import annotations

import numpy as np
import shapely
from numba import njit
from numpy.typing import NDArray

from layoutexplore.grid import FREE, UNKNOWN, OccupancyGrid
from layoutexplore.layout.timing import StageTimer
from layoutexplore.layout.types import Details, Layout, LayoutRoom

_STEP_R = np.array([0, 1, 0, -1], np.int64)
_STEP_C = np.array([1, 0, -1, 0], np.int64)


@njit("int32(int32[:,::1], int64, int64)", cache=True, nogil=True, inline="always")
def _at(labels: NDArray[np.int32], r: int, c: int) -> int:
    if r < 0 or c < 0 or r >= labels.shape[0] or c >= labels.shape[1]:
        return 0
    return int(labels[r, c])


@njit("int32(int32[:,::1], int64, int64, int64)", cache=True, nogil=True)
def _left(labels: NDArray[np.int32], r: int, c: int, d: int) -> int:
    """Label on the left of the side that leaves corner (r, c) in direction d (0 = +col, 1 = +row, 2 = -col, 3 = -row)."""
    if d == 0:
        return _at(labels, r, c)
    if d == 1:
        return _at(labels, r, c - 1)
    if d == 2:
        return _at(labels, r - 1, c - 1)
    return _at(labels, r - 1, c)


@njit("int32(int32[:,::1], int64, int64, int64)", cache=True, nogil=True)
def _right(labels: NDArray[np.int32], r: int, c: int, d: int) -> int:
    return _left(labels, r + _STEP_R[d], c + _STEP_C[d], (d + 2) % 4)


@njit(cache=True, nogil=True)
def _trace(labels: NDArray[np.int32], ends: NDArray[np.int64]) -> tuple[NDArray[np.int32], NDArray[np.int64], NDArray[np.int32]]:
    """Corners (n, 2) of all rings, the start of each ring (k + 1,), and its label (k,); the label lies to the left.

    Args:
        labels: int32 (rows, cols).
        ends: int64 (m,), rising flat indices of all cells with another label above or below them, or more.
    """
    rows, cols = labels.shape
    seen = np.zeros((rows + 1, cols + 1), np.uint8)
    corners = np.empty((1024, 2), np.int32)
    starts = np.empty(64, np.int64)
    owners = np.empty(64, np.int32)
    n = k = 0
    for i in ends:
        r0, c0 = i // cols, i % cols
        label = labels[r0, c0]
        if label == 0:
            continue
        below = r0 > 0 and labels[r0 - 1, c0] == label
        above = r0 + 1 < rows and labels[r0 + 1, c0] == label
        for side in (0, 2):  # every ring has a lower and an upper side
            if (below and side == 0) or (above and side == 2):
                continue
            r1, c1 = (r0, c0) if side == 0 else (r0 + 1, c0 + 1)
            if seen[r1, c1] & (1 << side):
                continue
            if k + 1 >= len(starts):
                starts = np.append(starts, np.empty(len(starts), np.int64))
                owners = np.append(owners, np.empty(len(owners), np.int32))
            starts[k] = n
            owners[k] = label
            k += 1
            r, c, d, last = r1, c1, side, -1
            while not seen[r, c] & (1 << d):
                seen[r, c] |= 1 << d
                if d != last:
                    if n >= len(corners):
                        corners = np.concatenate((corners, np.empty_like(corners)))
                    corners[n, 0] = r
                    corners[n, 1] = c
                    n += 1
                last = d
                r += _STEP_R[d]
                c += _STEP_C[d]
                for turn in (1, 0, 3):  # left first: cells that touch at a corner only stay apart
                    e = (d + turn) % 4
                    if _left(labels, r, c, e) == label and _right(labels, r, c, e) != label:
                        d = e
                        break
    starts[k] = n
    return corners[:n], starts[: k + 1], owners[:k]


def label_polygons(labels: NDArray[np.int32]) -> dict[int, shapely.Polygon]:
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
    labels = np.ascontiguousarray(labels, np.int32)
    ends = np.zeros(labels.shape, np.bool_)
    ends[0], ends[-1] = True, True
    change = labels[1:] != labels[:-1]
    ends[1:] |= change
    ends[:-1] |= change
    corners, starts, owners = _trace(labels, np.flatnonzero(ends))
    points = corners[:, ::-1].astype(np.float64)
    twice = np.cumsum(points[:, 0] * np.roll(points[:, 1], -1) - points[:, 1] * np.roll(points[:, 0], -1))
    shells: dict[int, tuple[float, NDArray[np.float64]]] = {}
    holes: dict[int, list[NDArray[np.float64]]] = {}
    for begin, end, owner in zip(starts[:-1].tolist(), starts[1:].tolist(), owners.tolist(), strict=True):
        ring = points[begin:end]
        inner = twice[end - 2] - (twice[begin - 1] if begin else 0.0)
        double = inner + ring[-1, 0] * ring[0, 1] - ring[-1, 1] * ring[0, 0]
        if double < 0:
            holes.setdefault(owner, []).append(ring)
        elif owner not in shells or double > shells[owner][0]:
            shells[owner] = (double, ring)
    return {label: _polygon(shells[label][1], holes.get(label, [])) for label in sorted(shells)}


def _polygon(shell: NDArray[np.float64], holes: list[NDArray[np.float64]]) -> shapely.Polygon:
    outer = shapely.Polygon(shell)
    if holes:
        # the cell to the left of a ring's first side belongs to the label
        beside = np.array([_left_cell(hole) for hole in holes])
        own = shapely.contains_xy(outer, beside[:, 0], beside[:, 1])
        outer = shapely.Polygon(shell, [hole for hole, inside in zip(holes, own, strict=True) if inside])
    return outer if outer.is_valid else _largest(shapely.make_valid(outer))


def _left_cell(ring: NDArray[np.float64]) -> NDArray[np.float64]:
    """Centre of the cell to the left of the first side of a ring."""
    along = np.sign(ring[1] - ring[0])
    return np.asarray(ring[0] + 0.5 * along + 0.5 * np.array([-along[1], along[0]]))


def _largest(geometry: shapely.Geometry) -> shapely.Polygon:
    parts = [p for p in shapely.get_parts(geometry, return_index=False) if isinstance(p, shapely.Polygon) and not p.is_empty]
    return max(parts, key=lambda p: float(p.area))


def to_world(polygons: list[shapely.Polygon], grid: OccupancyGrid) -> list[shapely.Polygon]:
    """Polygons in cells (x = column, y = row) as such in the grid's world frame, in metres."""

    def place(xy: NDArray[np.float64]) -> NDArray[np.float64]:
        return grid.cells_to_world(xy[:, ::-1] - 0.5)

    moved: list[shapely.Polygon] = shapely.transform(np.array(polygons, object), place).tolist()
    return moved


def number_rooms(labels: NDArray[np.int32]) -> NDArray[np.int32]:
    """Renumber labels 1, 2, ... in the order of their first cell in raster order."""
    return _number(np.ascontiguousarray(labels, np.int32))


@njit("int32[:,::1](int32[:,::1])", cache=True, nogil=True)
def _number(labels: NDArray[np.int32]) -> NDArray[np.int32]:
    rows, cols = labels.shape
    top = 0
    for r in range(rows):
        for c in range(cols):
            top = max(top, labels[r, c])
    table = np.zeros(top + 1, np.int32)
    out = np.zeros((rows, cols), np.int32)
    count = 0
    for r in range(rows):
        for c in range(cols):
            label = labels[r, c]
            if label > 0:
                if table[label] == 0:
                    count += 1
                    table[label] = count
                out[r, c] = table[label]
    return out


def rooms_of_labels(
    labels: NDArray[np.int32],
    grid: OccupancyGrid,
    footprint: NDArray[np.int32] | None = None,
    details: Details | None = None,
) -> tuple[LayoutRoom, ...]:
    """Rooms with polygons from labelled cells.

    Args:
        labels: int32 (rows, cols), 0 for none, numbered from 1.
        grid: The grid they belong to.
        footprint: int32 (rows, cols), the cells each room's polygon covers, with the furniture inside; the labels when None.
        details: Of the layout, to know the rooms' faces.
    """
    details = details or Details()
    shapes = label_polygons(labels if footprint is None else footprint)
    total, seen, frontier = _count_cells(
        np.ascontiguousarray(labels), np.ascontiguousarray(grid.cells), max(shapes, default=0) + 1
    )
    touching = set(np.unique(np.concatenate([labels[0], labels[-1], labels[:, 0], labels[:, -1]])).tolist())
    return tuple(
        LayoutRoom(
            id=label,
            polygon=shape,
            seen_share=float(seen[label] / max(total[label], 1)),
            is_partial=bool(frontier[label]),
            is_closed=label not in touching,
            details=details,
        )
        for label, shape in zip(shapes, to_world(list(shapes.values()), grid), strict=True)
    )


@njit(cache=True, nogil=True)
def _count_cells(
    labels: NDArray[np.int32], cells: NDArray[np.int8], count: int
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
    """Cells of each label, the known ones among them, and whether it has a free cell beside an unknown one."""
    rows, cols = labels.shape
    total, seen = np.zeros(count, np.int64), np.zeros(count, np.int64)
    frontier = np.zeros(count, np.bool_)
    for r in range(rows):
        for c in range(cols):
            k = labels[r, c]
            if k == 0:
                continue
            total[k] += 1
            if cells[r, c] == UNKNOWN:
                continue
            seen[k] += 1
            if cells[r, c] == FREE and not frontier[k]:
                frontier[k] = (
                    (r > 0 and cells[r - 1, c] == UNKNOWN)
                    or (r + 1 < rows and cells[r + 1, c] == UNKNOWN)
                    or (c > 0 and cells[r, c - 1] == UNKNOWN)
                    or (c + 1 < cols and cells[r, c + 1] == UNKNOWN)
                )
    return total, seen, frontier


def layout_of_labels(name: str, grid: OccupancyGrid, labels: NDArray[np.int32], timer: StageTimer) -> Layout:
    """The layout of a method that only labels cells."""
    numbered = number_rooms(labels)
    with timer("outlines"):
        rooms = rooms_of_labels(numbered, grid)
    warnings = () if rooms else ("no room found: the free space is too small or too narrow",)
    return Layout(method=name, clean_grid=grid, labels=numbered, rooms=rooms, timings=timer.seconds, warnings=warnings)
