"""Rooms sketched from what the classes of frontiers tell already: no network, a millisecond or two.

Every frontier of a decision has a predicted area that is left behind it. A sketch spends that area: from the
frontiers of a seen room a flood takes unknown cells, the cheapest first, until the room has the largest area
that is promised by one of them. A step over the continuation of a seen wall costs as much as `WALL_COST` of
floor, and a step that leads away from the box of what is seen costs `BOX_COST` more, so that rooms fill up
to their walls first. Frontiers in doorways belong to no sketch: what lies behind them is another room.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from layoutexplore.grids.arrays import ZERO, Bytes, Cells, Floats, Ints, Ints32
from layoutexplore.grids.grid import UNKNOWN
from layoutexplore.predictors.bit_map import ALONG_COLS, ALONG_ROWS, DOOR_BIT
from layoutexplore.predictors.frontier_model.features import Surroundings

WALL_COST, BOX_COST = 6.0, 0.2
"""Metres that crossing a continued wall counts as, and a step out of the box of what is seen."""

_PLACE, _ROOM, _NEXT = range(3)
"""Columns of a queue: number of the cell, the region that asks, and the entry behind it in its bucket."""


def sketch_rooms(around: Surroundings, area: Floats) -> Ints32:
    """The room int32 (rows, cols) of each cell, seen or sketched; 0 for none.

    Args:
        around: What lies around k frontiers.
        area: float64 (k,), predicted unknown area of the room behind each, in square metres.
    """
    resolution, bit_map = around.resolution, around.bit_map
    members, offsets = around.frontiers.cells, around.frontiers.offsets
    homes = _homes_without_doors(members, offsets, around.homes, bit_map.code, bit_map.margin)
    budget = np.zeros(around.regions.count + 1)
    np.maximum.at(budget, homes, area)
    budget[0] = 0.0
    return _spend(
        around.cells,
        around.regions.labels.astype(np.int32),
        bit_map.code[bit_map.margin : -bit_map.margin, bit_map.margin : -bit_map.margin],
        around.regions.boxes,
        _starts(around.cells, members, offsets, homes),
        np.rint(budget / resolution**2).astype(np.int64),
        (round(WALL_COST / resolution), round(BOX_COST / resolution)),
    )


@njit(cache=True, nogil=True)
def _homes_without_doors(members: Ints32, offsets: Ints, homes: Ints, code: Bytes, margin: int) -> Ints:
    """The region of each frontier, 0 where more than half of it lies in gaps that may be doors."""
    out = homes.copy()
    for k in range(len(homes)):
        doors = 0
        for n in range(offsets[k], offsets[k + 1]):
            doors += (code[members[n, 0] + margin, members[n, 1] + margin] & DOOR_BIT) != 0
        if 2 * doors > offsets[k + 1] - offsets[k]:
            out[k] = 0
    return out


@njit(cache=True, nogil=True)
def _starts(cells: Cells, members: Ints32, offsets: Ints, homes: Ints) -> Ints:
    """int64 (n, 3): unknown cells beside frontiers as (row, col), and the region that begins there."""
    rows, cols = cells.shape
    out = np.empty((4 * len(members), 3), np.int64)
    count = 0
    for k in range(len(homes)):
        if homes[k] == 0:
            continue
        for n in range(offsets[k], offsets[k + 1]):
            for step in range(4):
                r = members[n, 0] + (step == 0) - (step == 1)
                c = members[n, 1] + (step == 2) - (step == 3)
                if 0 <= r < rows and 0 <= c < cols and cells[r, c] == UNKNOWN:
                    out[count] = r, c, homes[k]
                    count += 1
    return out[:count]


@njit(cache=True, nogil=True)
def _spend(
    cells: Cells, rooms: Ints32, code: Bytes, boxes: Ints, starts: Ints, left: Ints, costs: tuple[int, int]
) -> Ints32:
    """Give each region as many unknown cells as it has left, the cheapest first; `rooms` is filled."""
    rows, cols = cells.shape
    across, wall_cost, box_cost = ALONG_ROWS | ALONG_COLS, costs[0], costs[1]
    # No step costs as much as there are buckets: a ring of them holds all entries, those of one cost each.
    buckets = np.full((2 + wall_cost + box_cost, 2), -1, np.int64)
    queue = np.empty((len(starts) + 4 * min(left.sum(), rows * cols), 3), np.int64)
    waiting = np.zeros((rows * cols, 2), np.int32)
    pushed = cost = ZERO
    for k in range(len(starts)):
        entry = cost, starts[k, 0] * cols + starts[k, 1], starts[k, 2]
        pushed = _push(queue, buckets, waiting, pushed, entry)
    popped = 0
    while popped < pushed:
        at = buckets[cost % len(buckets), 0]
        if at < 0:
            cost += 1
            continue
        buckets[cost % len(buckets), 0] = queue[at, _NEXT]
        popped += 1
        (r, c), room = divmod(queue[at, _PLACE], cols), queue[at, _ROOM]
        # A cell is the first one's to come; a region that has spent its area takes nothing more.
        if rooms[r, c] != 0 or left[room] <= 0:
            continue
        rooms[r, c] = room
        left[room] -= 1
        box, barred = boxes[room], code[r, c] & across != 0
        for step in range(4):
            row, col = r + (step == 0) - (step == 1), c + (step == 2) - (step == 3)
            if (
                not (0 <= row < rows and 0 <= col < cols)
                or cells[row, col] != UNKNOWN
                or rooms[row, col] != 0
            ):
                continue
            # A continued wall several cells thick is paid for once, where it is entered.
            price = cost + 1 + (wall_cost if code[row, col] & across and not barred else 0)
            outward = max(box[1] - row, row - box[3] + 1, 0) > max(box[1] - r, r - box[3] + 1, 0)
            outward |= max(box[2] - col, col - box[4] + 1, 0) > max(box[2] - c, c - box[4] + 1, 0)
            price += box_cost if outward else 0
            pushed = _push(queue, buckets, waiting, pushed, (price, row * cols + col, room))
    return rooms


@njit(cache=True, nogil=True)
def _push(queue: Ints, buckets: Ints, waiting: Ints32, pushed: int, entry: tuple[int, int, int]) -> int:
    """Append an entry (cost, place, room) to its bucket; how many there are now.

    `waiting` is int32 (cells, 2): which room asked for a cell last, and its cost + 1.
    """
    cost, place, room = entry
    # What the same room has asked for as cheaply would be refused when its turn comes.
    if waiting[place, 0] == room and waiting[place, 1] <= cost + 1:
        return pushed
    waiting[place, 0], waiting[place, 1] = room, cost + 1
    queue[pushed, _NEXT], queue[pushed, _PLACE], queue[pushed, _ROOM] = -1, place, room
    bucket = buckets[cost % len(buckets)]
    # Entries of equal cost take turns in the order in which they came: no direction is preferred.
    if bucket[0] < 0:
        bucket[0] = pushed
    else:
        queue[bucket[1], _NEXT] = pushed
    bucket[1] = pushed
    return pushed + 1
