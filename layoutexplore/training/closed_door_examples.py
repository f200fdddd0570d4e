"""Maps with closed doors and their truth, from any map or floor plan: doorways are shut at random.

A doorway is a short narrow passage of the free space. Some are shut by a straight line across them; what is
then cut off from the largest part of the free space was never seen, nor were the walls that only it touches.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from layoutexplore.grids.arrays import Cells, Mask
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN, in_cells
from layoutexplore.grids.morphology import with_neighbours
from layoutexplore.layout.alignment import turn
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.predictors.upright import outlined, wall_angle

RESOLUTION = 0.05
"""Metres a cell of the simulated maps."""

_WIDTHS, _DEPTHS = (0.6, 2.6), (0.1, 0.9)  # metres, of a doorway
_MARKS = ((2.0, 2.1), (1.2, 2.6))  # metres, of the line that marks a door: a fixed length, or one of its own
_SHARE = 0.6  # the largest share of the free space that is shut off
_AREAS = (0.8, 250.0)  # square metres of a room that is shut
_TRIED = 30  # doorways that may be shut
_FILL = 0.6  # least share of its bounding box that it fills: what is less is several rooms or a corridor


@dataclass(frozen=True)
class Doorway:
    """A passage in a grid turned (`numpy.rot90`) so that it runs along columns.

    Attributes:
        turns: Quarter turns.
        row: First row.
        end: Row behind the last.
        start: First free column.
        stop: Column behind the last.
    """

    turns: int
    row: int
    end: int
    start: int
    stop: int


def find_doorways(cells: Cells, resolution: float) -> list[Doorway]:
    """The narrow passages of the free space along rows and columns."""
    # Not `list_gaps` of layout.merging.door_gaps: that asks for walls in line with a gap and knows no depth,
    # here a stack of equal runs is as deep as a wall, and no wall has to go on beside it.
    found = []
    for turns in (0, 1):
        free = np.pad(np.rot90(cells == FREE, turns), 1)
        found += [Doorway(turns, *(v - 1 for v in box)) for box in _passages(free, resolution)]
    return found


def _passages(free: Mask, resolution: float) -> list[tuple[int, int, int, int]]:
    """Stacks of equal short runs between wider ones: first row, row after the last, first and last column."""
    step, astray = np.diff(free.astype(np.int8), axis=1), in_cells(0.15, resolution)
    open_stacks: list[list[int]] = []
    found = []
    for row in range(free.shape[0]):
        starts, stops = np.flatnonzero(step[row] == 1) + 1, np.flatnonzero(step[row] == -1) + 1
        narrow = ((stops - starts) * resolution >= _WIDTHS[0]) & ((stops - starts) * resolution <= _WIDTHS[1])
        runs = np.stack([starts, stops], 1)[narrow].tolist()
        going = []
        for stack in open_stacks:
            near = [r for r in runs if max(abs(r[0] - stack[2]), abs(r[1] - stack[3])) <= astray]
            if near:
                runs.remove(near[0])
                stack[1], stack[2], stack[3] = row + 1, max(stack[2], near[0][0]), min(stack[3], near[0][1])
                going.append(stack)
            elif _DEPTHS[0] <= (stack[1] - stack[0]) * resolution <= _DEPTHS[1] and _wider(
                free, stack, resolution
            ):
                found.append((stack[0], stack[1], stack[2], stack[3]))
        open_stacks = going + [[row, row + 1, *run] for run in runs]
    return found


def _wider(free: Mask, stack: list[int], resolution: float) -> bool:
    """Whether the free space widens on both sides of a passage."""
    top, bottom, start, stop = stack
    beside, rim = in_cells(0.15, resolution), in_cells(0.2, resolution)
    if stop - start < in_cells(0.3, resolution) or top < rim or bottom > free.shape[0] - rim:
        return False
    middle, more = (start + stop) // 2, (stop - start) // 4
    for row in (top - beside, bottom - 1 + beside):
        if not free[row, middle]:
            return False
        left, right = free[row, max(start - more, 0) : middle].all(), free[row, middle : stop + more].all()
        if not (left or right):
            return False
    return True


def shut_rooms(truth: Cells, resolution: float, rng: np.random.Generator) -> Cells | None:
    """What is seen of a map when some of its doorways are shut; None where no room can be shut off.

    Args:
        truth: int8 (rows, cols), rows along walls.
        resolution: Metres a cell.
        rng: Which doorways, and where in them the line is drawn.
    """
    free = truth == FREE
    lines = [_line(truth.shape, doorway, resolution, rng) for doorway in find_doorways(truth, resolution)]
    rng.shuffle(lines)
    lines = lines[:_TRIED]
    whole = _largest(free)
    wanted = max(round(len(lines) * float(rng.uniform(0.02, 0.7))), 1)
    shut: list[Mask] = []
    seen = whole
    for line in lines:
        rest = _largest(seen & ~line)
        if not _is_room(seen & ~rest & ~line, resolution) or rest.sum() < (1 - _SHARE) * whole.sum():
            continue
        seen = rest
        shut.append(line)
        if len(shut) == wanted:
            break
    if not shut:
        return None
    around = with_neighbours(seen, in_cells(0.1, resolution))
    cells = np.where(seen, FREE, np.where((truth == OCCUPIED) & around, OCCUPIED, UNKNOWN)).astype(np.int8)
    touched = with_neighbours(seen)
    for line in shut:
        if (line & touched).any():
            cells[line] = OCCUPIED
    return cells


def _is_room(lost: Mask, resolution: float) -> bool:
    """Whether what is cut off is a room of a usual size and shape."""
    area = int(lost.sum()) * resolution**2
    if not _AREAS[0] <= area <= _AREAS[1]:
        return False
    part = _largest(lost)
    rows, cols = np.flatnonzero(part.any(1)), np.flatnonzero(part.any(0))
    return bool(part.sum() >= _FILL * (rows[-1] - rows[0] + 1) * (cols[-1] - cols[0] + 1))


def _line(shape: tuple[int, ...], doorway: Doorway, resolution: float, rng: np.random.Generator) -> Mask:
    """The cells of the line that shuts a doorway."""
    line = np.zeros(shape, np.bool_)
    turned = np.rot90(line, doorway.turns)
    width = doorway.stop - doorway.start
    lengths = _MARKS[0] if rng.random() < 0.7 else _MARKS[1]
    length = max(round(float(rng.uniform(*lengths)) / resolution), width + 2)
    slack = length - width
    begin = doorway.start - int(rng.integers(1, slack)) if slack > 1 else doorway.start - 1
    row = int(rng.integers(doorway.row, doorway.end))
    turned[row, max(begin, 0) : begin + length] = True
    return line


def _largest(mask: Mask) -> Mask:
    """The largest part of a mask, over the four sides."""
    _, labels, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=4)
    if len(stats) == 1:
        return mask
    return np.asarray(labels == 1 + int(stats[1:, cv2.CC_STAT_AREA].argmax()))


def plan_cells(plan: FloorPlan, resolution: float, rng: np.random.Generator) -> Cells:
    """The map int8 (rows, cols) of a floor plan: its free space, upright and shrunk at random, and its rim.

    Args:
        plan: A floor plan; where its walls lie askew (`wall_angle`) it is turned.
        resolution: Metres a cell.
        rng: How much is shrunk, as by thicker walls, and which cells of the rim are missing.
    """
    free = _upright(plan.rasterize(resolution, margin=1.0).free, resolution)
    shrink = 2 * int(rng.integers(0, 3)) * in_cells(0.05, resolution) + 1
    free = cv2.erode(free.astype(np.uint8), np.ones((shrink, shrink), np.uint8)) > 0
    free = _largest(free)
    rim = with_neighbours(free)
    rim &= (rng.random(free.shape) > rng.choice([0.0, 0.1, 0.3])) & ~free
    return np.where(free, FREE, np.where(rim, OCCUPIED, UNKNOWN)).astype(np.int8)


def _upright(free: Mask, resolution: float) -> Mask:
    """Free space turned so that its outlines run along rows and columns."""
    cells = outlined(free)
    angle = wall_angle(cells, resolution)
    return np.asarray(turn(cells, angle, (0, 0)).cells == FREE) if angle else free


def add_outer_doors(
    cells: Cells, truth: Cells, resolution: float, rng: np.random.Generator, count: int
) -> tuple[Cells, Cells]:
    """Doors to the outside, behind which only a few cells were ever seen: what a closed door may be as well.

    Args:
        cells: int8 (rows, cols), what is seen.
        truth: int8 (rows, cols).
        resolution: Metres a cell.
        rng: Where they are, and how deep.
        count: How many at most.

    Returns:
        Both maps with the doors.
    """
    cells, truth = cells.copy(), truth.copy()

    def cells_of(metres: float) -> int:
        return in_cells(metres, resolution)

    width, space, face = (cells_of(metres) for metres in (1.2, 2.5, 1.8))
    wall = max(cells_of(0.15), 2)  # The rim is a cell thick on every grid, what lies behind it another one.
    behind = np.ones((space, face), np.uint8), (face // 2, space - 1)
    before = np.ones((cells_of(0.2), face), np.uint8), (face // 2, 0)
    for turns in rng.permutation(4)[:count].tolist():
        seen, true = np.rot90(cells, turns), np.rot90(truth, turns)
        unknown = ((seen == UNKNOWN) & (true == UNKNOWN)).astype(np.uint8)
        outside = cv2.erode(unknown, behind[0], anchor=behind[1]) > 0
        inside = cv2.erode((seen == FREE).astype(np.uint8), before[0], anchor=before[1]) > 0
        near = np.zeros(seen.shape, np.bool_)
        near[wall:] = outside[:-wall] & inside[wall:]
        places = np.argwhere(near)
        last = seen.shape[0] - cells_of(0.2)
        places = places[(places[:, 0] > 2 * space // 3) & (places[:, 0] < last)]
        if not len(places):
            continue
        row, col = places[rng.integers(len(places))]
        start = int(col) - width // 2 + int(rng.integers(cells_of(0.15)))
        stop = int(col) + width // 2 - int(rng.integers(cells_of(0.15)))
        deep = int(rng.integers(wall, cells_of(0.4)))
        pocket = int(rng.integers(cells_of(0.05), cells_of(0.6)))
        leaf = int(row) - deep
        for grid in (seen, true):
            grid[leaf:row, start - 1 : stop + 1] = OCCUPIED
            grid[leaf + 1 : row + 1, start:stop] = FREE
        extra = int(rng.integers(0, cells_of(0.4)))
        seen[leaf, start - extra : stop + cells_of(0.4) - extra] = OCCUPIED
        true[max(leaf - pocket, 0) : leaf + 1, start:stop] = FREE
    return cells, truth
