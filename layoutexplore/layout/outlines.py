"""From labelled cells to rooms with polygons: the outlines run along the sides of the cells."""

from __future__ import annotations

import numpy as np
import shapely
from numba import njit
from numpy.typing import NDArray

from layoutexplore.grids.bitsets import true_cells
from layoutexplore.grids.grid import FREE, UNKNOWN, OccupancyGrid
from layoutexplore.layout.lines.face_clusters import renumber
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
def _walk(
    labels: NDArray[np.int32],
    r1: int,
    c1: int,
    side: int,
    label: int,
    seen: NDArray[np.uint8],
    corners: NDArray[np.int32],
) -> tuple[int, bool]:
    """Write the corners of the ring that leaves corner (r1, c1) in direction `side`, the label to its left.

    Returns:
        How many there are, and whether at one of them the label touches itself.
    """
    r, c, d, last, n, touches = r1, c1, side, -1, 0, False
    while not seen[r, c] & (1 << d):
        seen[r, c] |= 1 << d
        if d != last:
            corners[n, 0] = r
            corners[n, 1] = c
            n += 1
        last = d
        r, c = int(r + _STEP_R[d]), int(c + _STEP_C[d])
        # the label lies to the left of the way here; cells that touch at a corner only stay apart
        if _left(labels, r, c, d) != label:
            touches |= _right(labels, r, c, d) == label
            d = (d + 1) % 4
        elif _right(labels, r, c, d) == label:
            d = (d + 3) % 4
    return n, touches


@njit(cache=True, nogil=True)
def _trace(
    labels: NDArray[np.int32], ends: NDArray[np.int64]
) -> tuple[NDArray[np.int32], NDArray[np.int64], NDArray[np.int32], NDArray[np.bool_]]:
    """Corners (n, 2) of all rings, the start of each ring (k + 1,), its label (k,), and where that touches itself at a corner.

    The label lies to the left of its rings.

    Args:
        labels: int32 (rows, cols).
        ends: int64 (m,), rising flat indices of all labelled cells with another label above or below them, or
            more.
    """
    rows, cols = labels.shape
    seen = np.zeros((rows + 1, cols + 1), np.uint8)
    # every ring and every corner belongs to the lower or the upper side of such a cell, a corner to one end
    # of it
    corners = np.empty((4 * len(ends), 2), np.int32)
    starts = np.zeros(2 * len(ends) + 1, np.int64)
    owners, touching = np.empty(2 * len(ends), np.int32), np.empty(2 * len(ends), np.bool_)
    k = 0
    for i in ends:
        r0, c0 = i // cols, i % cols
        label = labels[r0, c0]
        below = r0 > 0 and labels[r0 - 1, c0] == label
        above = r0 + 1 < rows and labels[r0 + 1, c0] == label
        for side in (0, 2):  # every ring has a lower and an upper side
            if (below and side == 0) or (above and side == 2):
                continue
            r1, c1 = (r0, c0) if side == 0 else (r0 + 1, c0 + 1)
            if seen[r1, c1] & (1 << side):
                continue
            n, touching[k] = _walk(labels, r1, c1, side, label, seen, corners[starts[k] :])
            starts[k + 1] = starts[k] + n
            owners[k] = label
            k += 1
    return corners[: starts[k]], starts[: k + 1], owners[:k], touching[:k]


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
    corners, starts, owners, touching = _trace(labels, true_cells(_ends(labels)))
    points = corners[:, ::-1].astype(np.float64)
    twice = np.cumsum(points[:, 0] * np.roll(points[:, 1], -1) - points[:, 1] * np.roll(points[:, 0], -1))
    shells: dict[int, tuple[float, int]] = {}
    holes: dict[int, list[NDArray[np.float64]]] = {}
    for ring, (begin, end, owner) in enumerate(
        zip(starts[:-1].tolist(), starts[1:].tolist(), owners.tolist(), strict=True)
    ):
        inner = twice[end - 2] - (twice[begin - 1] if begin else 0.0)
        double = inner + points[end - 1, 0] * points[begin, 1] - points[end - 1, 1] * points[begin, 0]
        if double < 0:
            holes.setdefault(owner, []).append(points[begin:end])
        elif owner not in shells or double > shells[owner][0]:
            shells[owner] = (double, ring)
    if not shells:
        return {}
    names = sorted(shells)
    rings = shapely.linearrings(points, indices=np.repeat(np.arange(len(owners)), np.diff(starts)))
    outlines = shapely.polygons(rings[[shells[label][1] for label in names]])
    for k, label in enumerate(names):
        if label in holes:
            outlines[k] = _with_holes(outlines[k], holes[label])
    doubtful = np.flatnonzero(
        np.isin(names, owners[touching])
    )  # where no label touches itself, its outline is valid
    for k in doubtful[~shapely.is_valid(outlines[doubtful])].tolist():
        outlines[k] = _largest(shapely.make_valid(outlines[k]))
    return dict(zip(names, outlines.tolist(), strict=True))


@njit("boolean[:,::1](int32[:,::1])", cache=True, nogil=True)
def _ends(labels: NDArray[np.int32]) -> NDArray[np.bool_]:
    """Labelled cells with another label above or below them, or nothing."""
    rows, cols = labels.shape
    out = np.empty((rows, cols), np.bool_)
    for r in range(rows):
        below, above = max(r - 1, 0), min(r + 1, rows - 1)
        if below == r or above == r:
            for c in range(cols):
                out[r, c] = labels[r, c] != 0
        else:
            for c in range(cols):
                label = labels[r, c]
                out[r, c] = (label != 0) & ((labels[below, c] != label) | (labels[above, c] != label))
    return out


def _with_holes(outer: shapely.Polygon, holes: list[NDArray[np.float64]]) -> shapely.Polygon:
    """A shell with those of the label's holes that lie in it."""
    # the cell to the left of a ring's first side belongs to the label
    beside = np.array([_left_cell(hole) for hole in holes])
    own = shapely.contains_xy(outer, beside[:, 0], beside[:, 1])
    return shapely.Polygon(outer.exterior, [hole for hole, inside in zip(holes, own, strict=True) if inside])


def _left_cell(ring: NDArray[np.float64]) -> NDArray[np.float64]:
    """Centre of the cell to the left of the first side of a ring."""
    along = np.sign(ring[1] - ring[0])
    return np.asarray(ring[0] + 0.5 * along + 0.5 * np.array([-along[1], along[0]]))


def _largest(geometry: shapely.Geometry) -> shapely.Polygon:
    parts = [
        p
        for p in shapely.get_parts(geometry, return_index=False)
        if isinstance(p, shapely.Polygon) and not p.is_empty
    ]
    return max(parts, key=lambda p: float(p.area))


def to_world(polygons: list[shapely.Polygon], grid: OccupancyGrid) -> list[shapely.Polygon]:
    """Polygons in cells (x = column, y = row) as such in the grid's world frame, in metres."""

    def place(xy: NDArray[np.float64]) -> NDArray[np.float64]:
        return grid.cells_to_world(xy[:, ::-1] - 0.5)

    moved: list[shapely.Polygon] = shapely.transform(np.array(polygons, object), place).tolist()
    return moved


def number_rooms(labels: NDArray[np.int32]) -> NDArray[np.int32]:
    """Renumber labels 1, 2, ... in the order of their first cell in raster order."""
    return renumber(np.asarray(labels, np.int32).ravel(), 1).reshape(labels.shape)


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
        footprint: int32 (rows, cols), the cells each room's polygon covers, with the furniture inside; the
            labels when None.
        details: Of the layout, to know the rooms' faces.
    """
    details = details or Details()
    shapes = label_polygons(labels if footprint is None else footprint)
    total, seen, frontier, touching = (
        counts.tolist()
        for counts in _count_cells(
            np.ascontiguousarray(labels), np.ascontiguousarray(grid.cells), max(shapes, default=0) + 1
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
        for label, shape in zip(shapes, to_world(list(shapes.values()), grid), strict=True)
    )


@njit(cache=True, nogil=True)
def _count_cells(
    labels: NDArray[np.int32], cells: NDArray[np.int8], count: int
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_], NDArray[np.bool_]]:
    """By label: its cells, the known ones, whether a free one lies beside an unknown one, and whether one lies on the border."""
    rows, cols = labels.shape
    total, seen = np.zeros(count, np.int64), np.zeros(count, np.int64)
    frontier, border = np.zeros(count, np.bool_), np.zeros(count, np.bool_)
    for r in range(rows):
        last, begin, known = (
            0,
            0,
            0,
        )  # the label of the cell before, where its run began, and the known cells of it
        for c in range(cols):
            k = int(labels[r, c])
            if k != last:
                total[last] += c - begin
                seen[last] += known
                last, begin, known = k, c, 0
            known += cells[r, c] != UNKNOWN
            if k > 0 and cells[r, c] == FREE and not frontier[k]:
                frontier[k] = (
                    (r > 0 and cells[r - 1, c] == UNKNOWN)
                    or (r + 1 < rows and cells[r + 1, c] == UNKNOWN)
                    or (c > 0 and cells[r, c - 1] == UNKNOWN)
                    or (c + 1 < cols and cells[r, c + 1] == UNKNOWN)
                )
        total[last] += cols - begin
        seen[last] += known
        border[labels[r, 0]] = border[labels[r, cols - 1]] = True
    for c in range(cols):
        border[labels[0, c]] = border[labels[rows - 1, c]] = True
    return total, seen, frontier, border


def layout_of_labels(name: str, grid: OccupancyGrid, labels: NDArray[np.int32], timer: StageTimer) -> Layout:
    """The layout of a method that only labels cells."""
    numbered = number_rooms(labels)
    with timer("outlines"):
        rooms = rooms_of_labels(numbered, grid)
    warnings = () if rooms else ("no room found: the free space is too small or too narrow",)
    return Layout(
        method=name, clean_grid=grid, labels=numbered, rooms=rooms, timings=timer.seconds, warnings=warnings
    )
