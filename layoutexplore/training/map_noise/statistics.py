"""What a grid map looks like, in ten numbers that need no truth: simulated maps are held against real ones.

All lengths are in metres, all areas in square metres, all counts a hundred square metres of free space.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass, fields

import cv2
import numpy as np
from numpy.typing import NDArray

from layoutexplore.errors import MapError
from layoutexplore.grids.arrays import Bytes, Cells, Floats, Mask
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN, in_cells

SPECK, THING = 0.02, 1.0
"""Occupied components up to this area are specks, larger ones up to this are things that float [m2]."""

LONG_RUN = 1.0
"""A straight run of wall from this length on is long [m]."""

RAY = 0.15
"""Free space that holds no disc of this radius is a ray, or as narrow as one [m]."""

GAP = (0.4, 2.2)
"""Openings in line with walls: free between two runs of wall for so many metres."""

DOUBLE = (0.1, 0.45)
"""Two surfaces so far apart across unknown cells are a wall of two faces or one drawn twice [m]."""


@dataclass(frozen=True, kw_only=True)
class MapStatistics:
    """Ten numbers of a map.

    Attributes:
        specks: Occupied components of up to `SPECK`, a hundred square metres.
        things: Occupied components above it and up to `THING`, a hundred square metres.
        wall_run: Mean length of the straight run that an occupied cell lies in [m].
        long_runs: Share of the occupied cells in runs of at least `LONG_RUN`.
        thickness: Mean width across these runs [m].
        unknown: Share of unknown cells inside the convex hull of the free ones.
        rays: Share of the free cells that are rays (`RAY`).
        frayed: Share of the free space's border that is unknown, not occupied.
        gap_width: Mean width of openings in line with walls (`GAP`), 0 where there is none [m].
        doubled: Share of the occupied cells that face another one across unknown space (`DOUBLE`).
    """

    specks: float
    things: float
    wall_run: float
    long_runs: float
    thickness: float
    unknown: float
    rays: float
    frayed: float
    gap_width: float
    doubled: float


STATISTICS = tuple(field.name for field in fields(MapStatistics))
"""Their names, in the order of `statistics_table`."""


def statistics_table(found: list[MapStatistics]) -> Floats:
    """The numbers of several maps, float64 (maps, len(STATISTICS))."""
    return np.array([astuple(one) for one in found], np.float64).reshape(-1, len(STATISTICS))


def describe_grid(cells: Cells, resolution: float) -> MapStatistics:
    """The statistics of a map.

    Args:
        cells: int8 (rows, cols), trinary.
        resolution: Metres a cell.

    Raises:
        MapError: The map has no free or no occupied cell.
    """
    free, occupied = cells == FREE, cells == OCCUPIED
    if not free.any() or not occupied.any():
        raise MapError("a map without free or without occupied cells has no statistics")
    area = np.count_nonzero(free) * resolution**2
    _, _, components, _ = cv2.connectedComponentsWithStats(occupied.view(np.uint8), connectivity=8)
    sizes = components[1:, cv2.CC_STAT_AREA] * resolution**2
    along = np.maximum(_run_lengths(occupied), _run_lengths(occupied.T).T)[occupied] * resolution
    across = np.minimum(_run_lengths(occupied), _run_lengths(occupied.T).T)[occupied] * resolution
    in_long = along >= LONG_RUN
    # where two walls cross, both runs are long, and neither is a width
    of_one_wall = in_long & (across < LONG_RUN)
    widths = np.concatenate([_gap_widths(cells, resolution), _gap_widths(cells.T, resolution)])
    return MapStatistics(
        specks=float(100 * np.count_nonzero(sizes <= SPECK) / area),
        things=float(100 * np.count_nonzero((sizes > SPECK) & (sizes <= THING)) / area),
        wall_run=float(along.mean()),
        long_runs=float(in_long.mean()),
        thickness=float(across[of_one_wall].mean()) if of_one_wall.any() else 0.0,
        unknown=_unknown_share(cells),
        rays=_ray_share(free, resolution),
        frayed=_frayed_share(cells),
        gap_width=float(widths.mean()) if len(widths) else 0.0,
        doubled=_doubled_share(cells, resolution),
    )


def _run_lengths(mask: Mask) -> NDArray[np.int64]:
    """Length in cells of the run along its row that each true cell lies in, 0 elsewhere."""
    starts, ends = _runs(mask)
    lengths = np.zeros(mask.size, np.int64)
    inside = np.ascontiguousarray(mask).ravel()
    lengths[inside] = np.repeat(ends - starts, ends - starts)
    return lengths.reshape(mask.shape)


def _runs(mask: Mask) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """First cell of every run along the rows, and the cell behind it, as flat indices of the array."""
    padded = np.zeros((mask.shape[0], mask.shape[1] + 2), np.int8)
    padded[:, 1:-1] = mask
    steps = np.diff(padded, axis=1)
    # a row of steps is one longer than a row of cells: its number is taken off again
    start, end = np.flatnonzero(steps.ravel() == 1), np.flatnonzero(steps.ravel() == -1)
    width = mask.shape[1] + 1
    return start - start // width, end - end // width


def _gap_widths(cells: Cells, resolution: float) -> Floats:
    """Widths [m] of free runs along the rows between two walls, of the length of an opening."""
    starts, ends = _between_walls(cells, FREE, GAP, resolution)
    lengths = _run_lengths(cells == OCCUPIED).ravel() * resolution
    # in line with walls, not merely between two: a wall of some length ends on both sides
    in_line = np.minimum(lengths[starts - 1], lengths[ends]) >= 2 * resolution
    return np.asarray((ends - starts)[in_line] * resolution)


def _between_walls(
    cells: Cells, kind: int, widths: tuple[float, float], resolution: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Those of the `_runs` of a kind of cells that end at walls and are from one width to another [m]."""
    starts, ends = _runs(cells == kind)
    flat, cols = np.ascontiguousarray(cells).ravel(), cells.shape[1]
    width = (ends - starts) * resolution
    fit = (starts % cols > 0) & (ends % cols > 0) & (width >= widths[0]) & (width <= widths[1])
    starts, ends = starts[fit], ends[fit]
    walls = (flat[starts - 1] == OCCUPIED) & (flat[ends] == OCCUPIED)
    return starts[walls], ends[walls]


def _unknown_share(cells: Cells) -> float:
    free = np.argwhere(cells == FREE)[:, ::-1].astype(np.int32)
    hull = np.zeros(cells.shape, np.uint8)
    cv2.fillConvexPoly(hull, cv2.convexHull(free), 1)
    return float((cells == UNKNOWN)[hull > 0].mean())


def _ray_share(free: Mask, resolution: float) -> float:
    reach = in_cells(RAY, resolution)
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
    wide: Bytes = np.asarray(cv2.morphologyEx(free.view(np.uint8), cv2.MORPH_OPEN, disc), np.uint8)
    return float(1 - wide[free].mean())


def _frayed_share(cells: Cells) -> float:
    unknown = walls = 0
    for one in (cells, cells.T):
        for a, b in ((one[:, :-1], one[:, 1:]), (one[:, 1:], one[:, :-1])):
            unknown += int(np.count_nonzero((a == FREE) & (b == UNKNOWN)))
            walls += int(np.count_nonzero((a == FREE) & (b == OCCUPIED)))
    return float(unknown / max(unknown + walls, 1))


def _doubled_share(cells: Cells, resolution: float) -> float:
    occupied = cells == OCCUPIED
    facing = np.zeros(cells.shape, bool)
    for one, out in ((cells, facing), (cells.T, facing.T)):
        starts, ends = _between_walls(one, UNKNOWN, DOUBLE, resolution)
        for at in (starts - 1, ends):
            out[np.divmod(at, one.shape[1])] = True
    return float(facing[occupied].mean())
