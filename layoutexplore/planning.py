"""Shortest ways on a grid: obstacle inflation, exact octile distances, paths, and distances between many places.

A robot moves from a cell to one of its eight neighbours; a diagonal move needs both cells that it squeezes past to be
traversable, so no path cuts a corner. Straight moves cost 1 and diagonal ones the square root of 2, in cells.

Distances are counted in whole numbers, 5741 for a straight and 8119 for a diagonal move (8119 / 5741 is a convergent of
the square root of 2, wrong by 8e-9 in relation): sums are exact, symmetric and free of the order in which they are made.
Dijkstra's algorithm runs on a bucket queue (Dial, "Algorithm 360", 1969) with buckets one cell wide: no move is shorter,
so cells of one bucket cannot improve each other and need no order; no move is longer than 1.42, so three buckets do.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from layoutexplore.errors import ConfigError, MapError
from layoutexplore.grid import Cell, check_resolution

_STRAIGHT = 5741
_DIAGONAL = 8119
_FAR = 2**31 - 1


def inflate(occupied: NDArray[np.bool_], radius: float, resolution: float) -> NDArray[np.bool_]:
    """Cells whose centre is closer than the radius to the centre of an occupied cell.

    Args:
        occupied: bool (rows, cols).
        radius: In metres; 0 gives a copy.
        resolution: Side of a cell in metres.

    Returns:
        bool (rows, cols). Outside of the array there is nothing.

    Example:
        >>> inflate(np.array([[False, False, False, True]]), radius=0.2, resolution=0.1).tolist()
        [[False, False, True, True]]
    """
    check_resolution(resolution)
    if not (math.isfinite(radius) and radius >= 0):
        raise ConfigError(f"the radius must be metres, 0 or more, got {radius}")
    world = _checked(occupied)
    reach = radius / resolution
    # Centres at exactly the radius are not closer, whatever the rounding of the division.
    limit = reach * reach - 1e-9
    span = np.arange(-math.ceil(reach), math.ceil(reach) + 1)
    near = ((span[:, None] ** 2 + span[None, :] ** 2) < limit) if limit > 0 else np.zeros((1, 1), bool)
    near[near.shape[0] // 2, near.shape[1] // 2] = True
    if near.sum() <= 1:
        return world.copy()
    if reach <= 8:
        return cv2.dilate(world.view(np.uint8), _trimmed(near)).view(np.bool_)
    distance = cv2.distanceTransform((~world).view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return distance.astype(np.float64) ** 2 < limit if world.any() else world.copy()


def geodesic_distances(
    traversable: NDArray[np.bool_], source: Cell, resolution: float, *, stop_at: NDArray[np.int32] | None = None
) -> NDArray[np.float32]:
    """Length of the shortest path from a cell to every cell.

    Args:
        traversable: bool (rows, cols).
        source: Where the robot is; it need not be traversable itself (paths may start in it, not pass through it).
        resolution: Side of a cell in metres.
        stop_at: int32 (n, 2) cells; stop as soon as all of them are settled. Cells beyond may then be inf or longer
            than they should be; those of `stop_at` and all that are nearer than the farthest of them are exact.

    Returns:
        float32 (rows, cols) in metres, inf where there is no path.

    Raises:
        ConfigError: The source or a cell of `stop_at` lies outside of the grid.

    Example:
        >>> geodesic_distances(np.ones((2, 3), bool), Cell(0, 0), 1.0).round(1).tolist()
        [[0.0, 1.0, 2.0], [1.0, 1.399999976158142, 2.4000000953674316]]
    """
    world = _checked(traversable)
    check_resolution(resolution)
    start = _checked_cells(np.array([source]), world.shape)
    stops = _checked_cells(np.empty((0, 2)) if stop_at is None else stop_at, world.shape)
    moves = _allowed_moves(_padded(world))
    units = np.empty(moves.shape, np.int32)
    _fill(moves, start[0, 0] + 1, start[0, 1] + 1, stops + 1, units)
    return _in_metres(units[1:-1, 1:-1], resolution / _STRAIGHT)


def descend(distances: NDArray[np.float32], traversable: NDArray[np.bool_], target: Cell) -> NDArray[np.int32]:
    """The shortest path to a cell, walking down a distance field.

    Args:
        distances: float32 (rows, cols) from `geodesic_distances`.
        traversable: The bool (rows, cols) it was computed on.
        target: Where to go.

    Returns:
        int32 (k, 2): cells as (row, col) from the source to the target, both included. Ties are broken the same way
        every time.

    Raises:
        ConfigError: The target lies outside or cannot be reached.
    """
    world = _checked(traversable)
    goal = _checked_cells(np.array([target]), world.shape)[0]
    if not np.isfinite(distances[goal[0], goal[1]]):
        raise ConfigError(f"cell ({goal[0]}, {goal[1]}) cannot be reached: its distance is infinite")
    path = _walk_down(np.ascontiguousarray(distances, np.float32), _padded(world), goal[0], goal[1])
    if path.size == 0:
        raise ConfigError("the distance field does not lead to a source: was it computed on another grid?")
    return path


def distance_matrix(traversable: NDArray[np.bool_], cells: NDArray[np.int32], resolution: float) -> NDArray[np.float32]:
    """Shortest path lengths between all pairs of cells.

    Args:
        traversable: bool (rows, cols).
        cells: int32 (n, 2) as (row, col); they need not be traversable (paths may start or end in them).
        resolution: Side of a cell in metres.

    Returns:
        float32 (n, n) in metres, symmetric, 0 on the diagonal, inf where there is no path.

    Raises:
        ConfigError: A cell lies outside of the grid.
    """
    world = _checked(traversable)
    check_resolution(resolution)
    places = _checked_cells(cells, world.shape)
    units = _all_pairs(_padded(world), places + 1)
    return _in_metres(units, resolution / _STRAIGHT)


def _checked(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    if mask.ndim != 2 or mask.dtype != np.bool_ or mask.size == 0:
        raise MapError(f"planning needs a non-empty bool array in two dimensions, got {mask.dtype} {mask.shape}")
    return np.ascontiguousarray(mask)


def _checked_cells(cells: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.int64]:
    places = np.asarray(cells, np.int64).reshape(-1, 2)
    outside = ((places < 0) | (places >= np.array(shape))).any(axis=1)
    if outside.any():
        row, col = places[outside][0]
        raise ConfigError(f"cell ({row}, {col}) lies outside of the grid of shape {tuple(shape)}")
    return places


def _padded(world: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """uint8 (rows + 2, cols + 2): the mask with a border that is not traversable, so that kernels need no bounds."""
    padded = np.zeros((world.shape[0] + 2, world.shape[1] + 2), np.uint8)
    padded[1:-1, 1:-1] = world
    return padded


def _trimmed(kernel: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """A symmetric kernel without its empty outer rows and columns."""
    rows, cols = np.flatnonzero(kernel.any(axis=1)), np.flatnonzero(kernel.any(axis=0))
    return kernel[rows[0] : rows[-1] + 1, cols[0] : cols[-1] + 1].astype(np.uint8)


def _in_metres(units: NDArray[np.int32], metres: float) -> NDArray[np.float32]:
    lengths = (units * np.float64(metres)).astype(np.float32)
    lengths[units == _FAR] = np.inf
    return lengths


@njit(cache=True, nogil=True)
def _allowed_moves(world: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """uint8 (rows, cols): the moves out of each cell, bits in the order of `_offsets`; none out of the border."""
    rows, cols = world.shape
    moves = np.zeros((rows, cols), np.uint8)
    for r in range(1, rows - 1):
        for c in range(1, cols - 1):
            north, south, west, east = world[r + 1, c], world[r - 1, c], world[r, c - 1], world[r, c + 1]
            moves[r, c] = (
                north
                | south << 1
                | west << 2
                | east << 3
                | (north & west & world[r + 1, c - 1]) << 4
                | (north & east & world[r + 1, c + 1]) << 5
                | (south & west & world[r - 1, c - 1]) << 6
                | (south & east & world[r - 1, c + 1]) << 7
            )
    return moves


@njit(cache=True, nogil=True)
def _offsets(cols: int) -> NDArray[np.int64]:
    return np.array([cols, -cols, -1, 1, cols - 1, cols + 1, -cols - 1, -cols + 1])


@njit(cache=True, nogil=True)
def _fill(moves: NDArray[np.uint8], row: int, col: int, stops: NDArray[np.int64], units: NDArray[np.int32]) -> None:
    """Write distances from (row, col) into `units`, `_FAR` where there is no path; stop when all `stops` are settled."""
    cols = moves.shape[1]
    allowed = moves.ravel()
    distance = units.ravel()
    distance[:] = _FAR
    offsets = _offsets(cols)
    is_stop = np.zeros(distance.size if stops.shape[0] else 1, np.bool_)
    waiting = 0
    for k in range(stops.shape[0]):
        index = stops[k, 0] * cols + stops[k, 1]
        waiting += not is_stop[index]
        is_stop[index] = True
    capacity = 4 * (moves.shape[0] + cols) + 64
    buckets = np.empty((3, capacity), np.int32)
    counts = np.zeros(3, np.int64)
    source = row * cols + col
    distance[source] = 0
    buckets[0, 0] = source
    counts[0] = 1
    level, empty = 0, 0
    while empty < 3:
        slot = level % 3
        n = counts[slot]
        if n == 0:
            empty += 1
            level += 1
            continue
        empty = 0
        base = level * _STRAIGHT
        for j in range(n):
            index = buckets[slot, j]
            here = distance[index]
            if here < base:
                continue  # Settled in an earlier bucket: it was improved after it had been queued here.
            if stops.shape[0] and is_stop[index]:
                is_stop[index] = False
                waiting -= 1
            bits = allowed[index]
            for k in range(8):
                if not bits >> k & 1:
                    continue
                target = index + offsets[k]
                there = here + (_STRAIGHT if k < 4 else _DIAGONAL)
                if there < distance[target]:
                    distance[target] = there
                    ahead = (level + (1 if there < base + 2 * _STRAIGHT else 2)) % 3
                    if counts[ahead] == capacity:
                        larger = np.empty((3, 2 * capacity), np.int32)
                        larger[:, :capacity] = buckets
                        buckets, capacity = larger, 2 * capacity
                    buckets[ahead, counts[ahead]] = target
                    counts[ahead] += 1
        counts[slot] = 0
        level += 1
        if stops.shape[0] and waiting == 0:
            break


@njit(cache=True, nogil=True)
def _all_pairs(world: NDArray[np.uint8], places: NDArray[np.int64]) -> NDArray[np.int32]:
    """int32 (n, n) distances between places of a padded mask."""
    n = places.shape[0]
    result = np.full((n, n), _FAR, np.int32)
    moves = _allowed_moves(world)
    units = np.empty(world.shape, np.int32)
    offsets = _offsets(world.shape[1])
    flat, distance, allowed = world.ravel(), units.ravel(), moves.ravel()
    for i in range(n):
        result[i, i] = 0
        _fill(moves, places[i, 0], places[i, 1], _entrances(world, moves, places[i + 1 :]), units)
        for j in range(i + 1, n):
            index = places[j, 0] * world.shape[1] + places[j, 1]
            length = distance[index]
            if not flat[index] and length > 0:
                # A path may end in a cell that is not traversable: by the last of the moves that lead out of it.
                for k in range(8):
                    before = distance[index + offsets[k]]
                    if allowed[index] >> k & 1 and before != _FAR:
                        length = min(length, before + (_STRAIGHT if k < 4 else _DIAGONAL))
            result[i, j] = result[j, i] = length
    return result


@njit(cache=True, nogil=True)
def _entrances(world: NDArray[np.uint8], moves: NDArray[np.uint8], places: NDArray[np.int64]) -> NDArray[np.int64]:
    """The places, with those that are not traversable replaced by the cells from which they are entered."""
    entrances = np.empty((8 * places.shape[0], 2), np.int64)
    count = 0
    offsets = _offsets(world.shape[1])
    for j in range(places.shape[0]):
        row, col = places[j]
        if world[row, col]:
            entrances[count, 0], entrances[count, 1] = row, col
            count += 1
            continue
        for k in range(8):
            if moves[row, col] >> k & 1:
                index = row * world.shape[1] + col + offsets[k]
                entrances[count, 0], entrances[count, 1] = index // world.shape[1], index % world.shape[1]
                count += 1
    return entrances[:count]


@njit(cache=True, nogil=True)
def _walk_down(distances: NDArray[np.float32], world: NDArray[np.uint8], row: int, col: int) -> NDArray[np.int32]:
    """Cells (k, 2) from the source to (row, col); empty when the field has no way down."""
    rows, cols = distances.shape
    found = np.empty((rows + cols, 2), np.int32)
    count = 0
    while True:
        if count == found.shape[0]:
            larger = np.empty((2 * count, 2), np.int32)
            larger[:count] = found
            found = larger
        found[count, 0], found[count, 1] = row, col
        count += 1
        here = distances[row, col]
        if here == 0.0:
            return found[:count][::-1].copy()
        best_row, best_col, best = -1, -1, np.inf
        unit = np.inf
        for k in range(8):
            d_row, d_col = _STEPS[k]
            r, c = row + d_row, col + d_col
            if not (0 <= r < rows and 0 <= c < cols) or distances[r, c] >= here:
                continue
            if k >= 4 and not (world[row + 1, c + 1] and world[r + 1, col + 1]):
                continue
            # Down the steepest slope: the neighbour before this cell on a shortest path loses a whole move's length.
            slope = (here - distances[r, c]) / (1.0 if k < 4 else math.sqrt(2.0))
            if best == np.inf or slope > unit:
                best_row, best_col, best, unit = r, c, distances[r, c], slope
        if best_row < 0:
            return found[:0].copy()
        row, col = best_row, best_col


_STEPS = ((1, 0), (-1, 0), (0, -1), (0, 1), (1, -1), (1, 1), (-1, -1), (-1, 1))
