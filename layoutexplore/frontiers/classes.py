"""Closed and open frontiers: is what lies behind the rest of a seen room, or does it lead on?

The same rule serves the truth (with the floor plan's rooms) and every prediction (with the predicted rooms),
after the definitions of the layout-based exploration papers (Luperto, Fochetta and Amigoni, AAMAS 2021): the
room behind a frontier is the one with the most unknown free cells within 0.5 m behind it; the frontier is
open when that room is hardly seen, or when the unknown behind it reaches a square metre of another room; else
it is closed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from layoutexplore.errors import checks_arguments
from layoutexplore.frontiers.decision import Decision, Truth
from layoutexplore.frontiers.detection import FrontierClusters
from layoutexplore.grids.arrays import ZERO, Cells, Floats, Ints, Ints32, Labels, Mask, shows_shapes
from layoutexplore.grids.components import label_components
from layoutexplore.grids.grid import UNKNOWN, in_cells
from layoutexplore.grids.runs import run_end

LITTLE_LEFT = 1.0
"""Square metres: a closed frontier with less left in its room can wait, a room with less left is finished."""

DEPTH = 0.5
"""Metres behind a frontier in which its room is looked for."""

ENTRANCE_SHARE = 0.1
"""A room of which less than this share has been seen is entered by an open frontier."""

BEYOND_AREA = 1.0
"""Square metres of another room, reached through the unknown, that make a frontier open."""


@shows_shapes
@dataclass(frozen=True, eq=False)
class FrontierClasses:
    """What lies behind each of k frontiers.

    Attributes:
        is_closed: bool (k,), the rest of a seen room and nothing else.
        room: int32 (k,), id of the room behind; 0 when there is none.
        remaining_area: float64 (k,), the unseen free area of that room in square metres; of no room, what can
            be reached through the unknown.
    """

    is_closed: Mask
    room: Ints32
    remaining_area: Floats


@checks_arguments
def classify_frontiers(
    cells: Cells, clusters: FrontierClusters, room_ids: Labels, passable: Mask, resolution: float
) -> FrontierClasses:
    """Classify frontiers on a grid against rooms, true or predicted.

    Args:
        cells: int8 (rows, cols), what is known.
        clusters: The cells of the frontiers.
        room_ids: int16 or int32 (rows, cols), the room of each cell, 0 none (walls, doorways).
        passable: bool (rows, cols), cells that are free, in truth or by prediction.
        resolution: Metres per cell.

    Example:
        A room that is seen to the right of column 1, and an unseen one behind the door in row 1:

        >>> cells = np.array([[-1, 0, 0, 100, -1], [-1, 0, 0, 0, -1], [-1, 0, 0, 100, -1]], np.int8)
        >>> rooms = np.array([[1, 1, 1, 0, 2], [1, 1, 1, 0, 2], [1, 1, 1, 0, 2]], np.int32)
        >>> left, door = np.array([[0, 1], [1, 1], [2, 1]], np.int32), np.array([[1, 3]], np.int32)
        >>> clusters = FrontierClusters.of([left, door])
        >>> classes = classify_frontiers(cells, clusters, rooms, cells != 100, resolution=0.5)
        >>> classes.is_closed.tolist(), classes.room.tolist(), classes.remaining_area.tolist()
        ([True, False], [1, 2], [0.75, 0.75])
    """
    members, offsets = clusters.cells, clusters.offsets
    depth = in_cells(DEPTH, resolution)
    total, seen = _count_rooms(cells, room_ids, passable)
    component, components = label_components((cells == UNKNOWN) & passable)
    starts, ids, counts = _count_components(component, components, room_ids, len(total))
    room = _rooms_behind(cells, members, offsets, room_ids, passable, depth, len(total))
    other, beyond = _reached(component, members, offsets, starts, ids, counts, room, len(total))
    cell_area = resolution**2
    share = np.where(total[room] > 0, seen[room] / np.maximum(total[room], 1), 1.0)
    share[room == 0] = 1.0
    remaining = np.where(room > 0, (total - seen)[room], beyond) * cell_area
    is_open = (share < ENTRANCE_SHARE) | (other * cell_area >= BEYOND_AREA)
    return FrontierClasses(~is_open, room, remaining)


@checks_arguments
def true_classes(decision: Decision, truth: Truth) -> FrontierClasses:
    """The classes of a decision's frontiers against the rooms of the floor plan."""
    cells, raster = decision.grid.cells, truth.raster
    return classify_frontiers(cells, decision.clusters, raster.room_ids, raster.free, raster.resolution)


@njit(cache=True, nogil=True)
def _count_rooms(cells: Cells, room_ids: Labels, passable: Mask) -> tuple[Ints, Ints]:
    """Passable cells of each room: all, and those that are known."""
    rooms = room_ids.max() + 1
    total, seen = np.zeros(rooms, np.int64), np.zeros(rooms, np.int64)
    for r in range(cells.shape[0]):
        first = ZERO
        # counted once a run of equal cells, not once a cell
        while first < cells.shape[1]:
            room = room_ids[r, first]
            last = run_end(room_ids[r], first, room)
            here, known = 0, 0
            for c in range(first, last):
                here += passable[r, c]
                known += passable[r, c] & (cells[r, c] != UNKNOWN)
            total[room] += here
            seen[room] += known
            first = last
    return total, seen


@njit(cache=True, nogil=True)
def _unknown_at(cells: Cells, passable: Mask, r: int, c: int) -> bool:
    """Whether a cell lies inside of the grid, is unknown and can be passed."""
    return bool(
        0 <= r < cells.shape[0] and 0 <= c < cells.shape[1] and cells[r, c] == UNKNOWN and passable[r, c]
    )


@njit(cache=True, nogil=True)
def _count_components(
    component: Ints32, components: int, room_ids: Labels, rooms: int
) -> tuple[Ints, Ints32, Ints32]:
    """Cells of each component in each of its rooms.

    Returns:
        starts int64 (components + 2,), and int32 (n,) ids of rooms and counts: component i has those from
        `starts[i]` up to, but without, `starts[i + 1]`, each room once.
    """
    # A component lies in few rooms: a table of all by all would take hundreds of megabytes.
    runs = np.empty((component.size, 3), np.int32)
    count = 0
    starts = np.zeros(components + 2, np.int64)
    for r in range(component.shape[0]):
        first = ZERO
        while first < component.shape[1]:
            part = component[r, first]
            last = run_end(component[r], first, part)
            while part and first < last:
                room = room_ids[r, first]
                behind = min(run_end(room_ids[r], first, room), last)
                runs[count, 0], runs[count, 1], runs[count, 2] = part, room, behind - first
                count += 1
                starts[part + 1] += 1
                first = behind
            first = last
    starts = np.cumsum(starts)
    ids, counts = np.empty(count, np.int32), np.empty(count, np.int32)
    place = starts.copy()
    for k in range(count):
        at = place[runs[k, 0]]
        ids[at], counts[at] = runs[k, 1], runs[k, 2]
        place[runs[k, 0]] += 1
    # Runs in one room become one: `entry` is where a room stands, from `begin` on if in this component.
    entry, end = np.full(rooms, -1, np.int64), 0
    for k in range(components + 1):
        begin = end
        for n in range(starts[k], starts[k + 1]):
            inside, length = ids[n], counts[n]
            if entry[inside] < begin:
                entry[inside], ids[end], counts[end] = end, inside, 0
                end += 1
            counts[entry[inside]] += length
        starts[k] = begin
    starts[components + 1] = end
    return starts, ids[:end], counts[:end]


@njit(cache=True, nogil=True)
def _rooms_behind(
    cells: Cells, members: Ints32, offsets: Ints, room_ids: Labels, passable: Mask, depth: int, rooms: int
) -> Ints32:
    """Per frontier the room with the most unknown cells within `depth` steps behind it; 0 if none.

    Of rooms with equally many the one with the lowest id.
    """
    # Not `grids.flood.spread_in_place`: every frontier has its own flood, and they overlap.
    # A cell with the stamp k + 1 has been counted for frontier k: the array need not be cleared in between.
    stamp = np.zeros(cells.shape, np.int32)
    queue = np.empty((cells.shape[0] * cells.shape[1], 2), np.int32)
    room = np.zeros(len(offsets) - 1, np.int32)
    for k in range(len(room)):
        votes = np.zeros(rooms, np.int64)
        # The queue holds the ring that is spread from, queue[first:ring], and behind it the next one.
        first, last = 0, 0
        for n in range(offsets[k], offsets[k + 1]):
            queue[last, 0], queue[last, 1] = members[n, 0], members[n, 1]
            last += 1
        for _ in range(depth):
            ring = last
            while first < ring:
                row, col = queue[first, 0], queue[first, 1]
                first += 1
                for step in range(4):
                    r, c = row + (step == 0) - (step == 1), col + (step == 2) - (step == 3)
                    if _unknown_at(cells, passable, r, c) and stamp[r, c] != k + 1:
                        stamp[r, c] = k + 1
                        votes[room_ids[r, c]] += 1
                        queue[last, 0], queue[last, 1] = r, c
                        last += 1
        votes[0] = 0  # Cells in no room do not vote.
        if votes.max() > 0:
            room[k] = votes.argmax()
    return room


@njit(cache=True, nogil=True)
def _reached(
    component: Ints32,
    members: Ints32,
    offsets: Ints,
    starts: Ints,
    ids: Ints32,
    counts: Ints32,
    room: Ints32,
    rooms: int,
) -> tuple[Ints, Ints]:
    """Per frontier the unknown cells it reaches: the most in any one other room, and all together."""
    # Components are counted as a whole: what borders the frontier is reached to its end.
    height, width = component.shape
    other, beyond = np.zeros(len(room), np.int64), np.zeros(len(room), np.int64)
    stamp = np.zeros(len(starts) - 1, np.int32)
    for k in range(len(room)):
        reached = np.zeros(rooms, np.int64)
        for n in range(offsets[k], offsets[k + 1]):
            for step in range(4):
                r, c = members[n, 0] + (step == 0) - (step == 1), members[n, 1] + (step == 2) - (step == 3)
                part = component[r, c] if 0 <= r < height and 0 <= c < width else np.int32(0)
                if part and stamp[part] != k + 1:
                    stamp[part] = k + 1
                    for entry in range(starts[part], starts[part + 1]):
                        reached[ids[entry]] += counts[entry]
        beyond[k] = reached.sum()
        reached[0] = 0
        reached[room[k]] = 0
        other[k] = reached.max()
    return other, beyond
