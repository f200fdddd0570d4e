"""Ways into foreseen rooms that a plan draws without a door: through walls that nobody has seen yet.

A plan on the wall lacks doors. A room that cannot be entered as it is drawn gets a doorway where its wall has
not been seen, at once elsewhere when the robot sees that it is shut; and a doorway that the robot looks
through is open, whatever is drawn behind it.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
from numba import njit

from layoutexplore.grids.arrays import Cells, Floats32, Ints, Ints32, Mask
from layoutexplore.grids.boxes import grown_box, known_box, true_box
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN
from layoutexplore.grids.morphology import disc, draw_way, nearest_cells

DOOR = 0.9
"""Metres of a doorway that is assumed."""

PASSAGE = 0.3
"""Metres of a disc's radius that fits through whatever is taken for open."""

THROUGH = 1.6
"""Metres from passable floor to passable floor across a wall in which there may be a doorway."""

LEAST_HIDDEN = 2.0
"""Square metres of unseen floor for which a way in is looked for."""

GAP = (0.55, 2.5)
"""Metres of a gap between seen walls that is a doorway, whatever is drawn behind it."""

JAMB = 0.25
"""Metres from the ends of such a gap to seen walls."""

ROUNDS = 3
"""Rooms behind rooms behind rooms that are opened."""


def with_ways_in(foreseen: Cells, known: Cells, resolution: float) -> Cells:
    """What is foreseen, with doorways through unseen walls so that every foreseen room can be entered.

    Args:
        foreseen: int8 (rows, cols), as of `Foresight`.
        known: int8 (rows, cols), what the robot knows.
        resolution: Metres a cell.
    """
    row0, row1, col0, col1 = known_box(np.where(known == UNKNOWN, foreseen, known))
    box = slice(row0, row1), slice(col0, col1)
    cells, seen = foreseen[box].copy(), np.ascontiguousarray(known[box])
    if cells.size:
        _open_seen_gaps(cells, seen, resolution)
        for _ in range(ROUNDS):
            if not open_rooms(cells, seen, resolution):
                break
    found = foreseen.copy()
    found[box] = cells
    return found


def open_rooms(cells: Cells, known: Cells, resolution: float) -> bool:
    """Open a way into each part that is cut off from where the robot has been; whether any was.

    Args:
        cells: int8 (rows, cols), what is foreseen; the ways become free.
        known: int8 (rows, cols), what the robot knows.
        resolution: Metres a cell.
    """
    unseen = known == UNKNOWN
    free = np.where(unseen, cells, known) == FREE
    passable = cv2.erode(
        free.astype(np.uint8), disc(PASSAGE / resolution), borderType=cv2.BORDER_CONSTANT, borderValue=0
    )
    count, parts = cv2.connectedComponents(passable, connectivity=4)
    if count <= 2:
        return False
    hidden = np.bincount(parts[unseen], minlength=count) * resolution**2
    visited = np.bincount(parts[~unseen], minlength=count)
    visited[0] = 0
    main = int(visited.argmax())
    if not main:
        return False
    closed = hidden >= LEAST_HIDDEN
    closed[[0, main]] = False
    if not closed.any():
        return False
    near, ends, gaps = _across(closed[parts], parts == main, THROUGH / resolution)
    walls = cv2.dilate((known == OCCUPIED).astype(np.uint8), disc(PASSAGE / resolution)) > 0
    good = _unseen_way(near, ends, walls)
    near, ends, gaps = near[good], ends[good], gaps[good]
    owner = parts[near[:, 0], near[:, 1]]
    for part in np.unique(owner).tolist():
        ways = np.flatnonzero(owner == part)
        best = ways[_chosen(near[ways], ends[ways], gaps[ways], known)]
        draw_way(cells.view(np.uint8), near[best], ends[best], DOOR / resolution, FREE)
    return len(near) > 0


def _across(closed: Mask, main: Mask, reach: float) -> tuple[Ints32, Ints32, Floats32]:
    """Closed cells within reach of the main part, its cell nearest to each, and how far apart they are.

    Args:
        closed: bool (rows, cols), at least one.
        main: bool (rows, cols).
        reach: In cells.

    Returns:
        int32 (n, 2), in raster order; int32 (n, 2); float32 (n,), in cells.
    """
    # What decides lies around closed parts: there, distances are as they are all over the grid.
    row0, row1, col0, col1 = grown_box(true_box(closed), math.ceil(reach) + 2, closed.shape)
    closed, main = closed[row0:row1, col0:col1], main[row0:row1, col0:col1]
    if not main.any():
        return np.zeros((0, 2), np.int32), np.zeros((0, 2), np.int32), np.zeros(0, np.float32)
    distance, nearest = nearest_cells(main)
    near = np.argwhere(closed & (distance <= reach)).astype(np.int32)
    corner = np.array([row0, col0], np.int32)
    rows, cols = near.T
    return near + corner, nearest[rows, cols] + corner, distance[rows, cols]


def _chosen(near: Ints32, ends: Ints32, gaps: Floats32, known: Cells) -> int:
    """The middle of the places where the wall is thin; those where the robot sees no wall come first."""
    at_floor = known[ends[:, 0], ends[:, 1]] == FREE
    choice = np.flatnonzero(at_floor) if at_floor.any() else np.arange(len(near))
    choice = choice[gaps[choice] <= gaps[choice].min() + 3]
    middle = np.median(near[choice], axis=0)
    return int(choice[np.abs(near[choice] - middle).sum(axis=1).argmin()])


@njit(cache=True, nogil=True)
def _unseen_way(starts: Ints32, ends: Ints32, walls: Mask) -> Mask:
    """Bool (n,): whether no seen wall lies between two cells (n, 2) each."""
    free = np.ones(len(starts), np.bool_)
    for n in range(len(starts)):
        r, c = starts[n]
        dr, dc = ends[n, 0] - r, ends[n, 1] - c
        steps = max(abs(dr), abs(dc), 1)
        for k in range(steps + 1):
            row, col = r + round(dr * k / steps), c + round(dc * k / steps)
            if walls[row, col]:
                free[n] = False
                break
    return free


def _open_seen_gaps(cells: Cells, known: Cells, resolution: float) -> None:
    """Clear drawn walls behind gaps between seen walls: the robot looks through them."""
    blocked = ((known == UNKNOWN) & (cells == OCCUPIED)).astype(np.uint8)
    cross = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
    edge = (known == FREE) & (cv2.dilate(blocked, cross) > 0)
    count, parts, stats, _ = cv2.connectedComponentsWithStats(edge.astype(np.uint8), connectivity=8)
    if count <= 1:
        return
    walls = cv2.dilate((known == OCCUPIED).astype(np.uint8), disc(JAMB / resolution)) > 0
    sides = np.maximum(stats[:, cv2.CC_STAT_WIDTH], stats[:, cv2.CC_STAT_HEIGHT]) * resolution
    for part in np.flatnonzero((sides >= GAP[0]) & (sides <= GAP[1])).tolist():
        if part == 0:
            continue
        left, top, width, height = stats[part, :4].tolist()
        members = np.argwhere(parts[top : top + height, left : left + width] == part) + np.array([top, left])
        low, high = _ends(members)
        if walls[low[0], low[1]] and walls[high[0], high[1]]:
            _clear(cells, known, members, round(THROUGH / 2 / resolution))


def _ends(members: Ints) -> tuple[Ints, Ints]:
    """The two cells of a line of cells (n, 2) that lie farthest along it."""
    axis = int(np.ptp(members[:, 1]) > np.ptp(members[:, 0]))
    return members[members[:, axis].argmin()], members[members[:, axis].argmax()]


def _clear(cells: Cells, known: Cells, members: Ints, reach: int) -> None:
    """Floor where walls are drawn within reach (in cells) of a gap, on the side that is not known."""
    low = np.maximum(members.min(axis=0) - reach, 0)
    high = members.max(axis=0) + reach + 1
    window = slice(int(low[0]), int(high[0])), slice(int(low[1]), int(high[1]))
    part, seen = cells[window], known[window]
    mask = np.zeros(part.shape, np.uint8)
    mask[members[:, 0] - low[0], members[:, 1] - low[1]] = 1
    axis = int(np.ptp(members[:, 1]) > np.ptp(members[:, 0]))
    shape = (1, 2 * reach + 1) if axis == 0 else (2 * reach + 1, 1)
    strip = cv2.dilate(mask, np.ones(shape, np.uint8)) > 0
    part[strip & (seen == UNKNOWN) & (part == OCCUPIED)] = FREE
