"""Shortest paths on a grid: exact octile distances, paths, and distances between many places.

A robot moves from a cell to one of its eight neighbours; a diagonal move needs both cells that it squeezes
past to be traversable, so no path cuts a corner. Straight moves cost 1 and diagonal ones the square root of
2, in cells. The search itself lies in `layoutexplore.planning.canonical_search`.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from layoutexplore.errors import ConfigError, shortened
from layoutexplore.grids.arrays import Bytes, Floats32, Ints, Ints32, Mask
from layoutexplore.grids.grid import Cell, check_resolution
from layoutexplore.grids.morphology import check_mask
from layoutexplore.planning.canonical_search import (
    DIAGONAL,
    FAR,
    STRAIGHT,
    Search,
    Workspace,
    to_metres,
    workspace,
)
from layoutexplore.planning.known_lengths import NOT_SEARCHED, sources_to_search


def geodesic_distances(
    traversable: Mask, source: Cell, resolution: float, *, stop_at: Ints32 | None = None
) -> Floats32:
    """Length of the shortest path from a cell to every cell.

    Args:
        traversable: bool (rows, cols).
        source: Where the robot is; it need not be traversable itself (paths may start in it, not pass through
            it).
        resolution: Side of a cell in metres.
        stop_at: int32 (n, 2) cells; stop as soon as the distances of all of them are known. Cells that are
            farther than the farthest of them may then be infinite; what is finite is exact.

    Returns:
        float32 (rows, cols) in metres, inf where there is no path.

    Raises:
        ConfigError: The source or a cell of `stop_at` lies outside of the grid.

    Example:
        >>> geodesic_distances(np.ones((2, 3), bool), Cell(0, 0), 1.0).round(1).tolist()
        [[0.0, 1.0, 2.0], [1.0, 1.399999976158142, 2.4000000953674316]]
    """
    world = check_mask(traversable)
    check_resolution(resolution)
    start = check_cells(np.array([source]), world.shape)
    stops = check_cells(np.empty((0, 2)) if stop_at is None else stop_at, world.shape)
    space = workspace(world)
    settled = space.spread(flat_indices(start, space)[0], flat_indices(stops, space))
    lengths = np.empty(world.shape, np.float32)
    to_metres(space.distance, float(space.origin), resolution / STRAIGHT, settled, lengths)
    return lengths


def descend(distances: Floats32, traversable: Mask, target: Cell) -> Ints32:
    """The shortest path to a cell, walking down a distance field.

    Args:
        distances: float32 (rows, cols) from `geodesic_distances`.
        traversable: The bool (rows, cols) it was computed on.
        target: Where to go.

    Returns:
        int32 (k, 2): cells as (row, col) from the source to the target, both included. Ties are broken the
        same way every time.

    Raises:
        ConfigError: The target lies outside or cannot be reached.
    """
    world = check_mask(traversable)
    goal = check_cells(np.array([target]), world.shape)[0]
    if not np.isfinite(distances[goal[0], goal[1]]):
        raise ConfigError(f"cell ({goal[0]}, {goal[1]}) cannot be reached: its distance is infinite")
    path = walk_down(
        np.ascontiguousarray(distances, np.float32),
        0,
        0.0,
        1.0,
        np.inf,
        workspace(world).moves,
        goal[0],
        goal[1],
    )
    if path.size == 0:
        raise ConfigError("the distance field does not lead to a source: was it computed on another grid?")
    return path


def shortest_path(search: Search, start: Cell, end: Cell, resolution: float) -> Ints32:
    """The shortest path between two cells, as `descend` finds it on the distances from its start.

    Args:
        search: Of the grid.
        start: Where it begins; it need not be traversable.
        end: Where it ends, inside of the grid.
        resolution: Side of a cell in metres.

    Returns:
        int32 (k, 2): cells as (row, col), both ends included; empty where there is no path.
    """
    source, target = flat_indices(np.array([start, end], np.int64), search).tolist()
    settled = search.spread(source, np.array([target]))
    lengths = search.distance.reshape(search.shape)
    if search.distance[target] > settled:
        return np.empty((0, 2), np.int32)
    origin, scale, row, col = float(search.origin), resolution / STRAIGHT, int(end[0]), int(end[1])
    path: Ints32 = walk_down(lengths, 1, origin, scale, float(settled), search.moves, row, col)
    return path


def distances_between(traversable: Mask, source: Cell, cells: Ints32, resolution: float) -> Floats32:
    """Lengths of the shortest paths from a cell to some others; like `geodesic_distances`, without the field.

    Args:
        traversable: bool (rows, cols).
        source: Where to begin; it need not be traversable.
        cells: int32 (n, 2) as (row, col), traversable.
        resolution: Side of a cell in metres.

    Returns:
        float32 (n,) in metres, inf where there is no path.

    Raises:
        ConfigError: A cell lies outside of the grid.
    """
    world = check_mask(traversable)
    check_resolution(resolution)
    start, places = check_cells(np.array([source]), world.shape), check_cells(cells, world.shape)
    space = workspace(world)
    units = space.lengths_to(int(flat_indices(start, space)[0]), flat_indices(places, space))
    return lengths_in_metres(units, resolution)


def lengths_in_metres(units: Ints, resolution: float) -> Floats32:
    """Lengths int64 in units of the search as float32 in metres, where `FAR` is inf."""
    return np.where(units == FAR, np.inf, units * (resolution / STRAIGHT)).astype(np.float32)


def check_path(path: NDArray[np.integer], start: Cell) -> Ints32:
    """The path int (k, 2) as int32, if it leads from a cell from neighbour to neighbour.

    Raises:
        ConfigError: It does not.
    """
    if not isinstance(path, np.ndarray):
        raise ConfigError(f"a path is an integer array (k, 2) of cells, got {shortened(path)}")
    if path.ndim != 2 or path.shape[1] != 2 or len(path) == 0 or not np.issubdtype(path.dtype, np.integer):
        raise ConfigError(f"a path is an integer array (k, 2) of cells, got {path.dtype} {path.shape}")
    if (first := tuple(path[0].tolist())) != start:
        raise ConfigError(f"the path starts at {first}, but the robot is in cell {tuple(start)}")
    signed = path.astype(np.int64)  # differences of unsigned numbers are never below 0
    jumps = np.flatnonzero(np.abs(np.diff(signed, axis=0)).max(axis=1, initial=0) > 1)
    if len(jumps):
        before, after = (tuple(cell) for cell in signed[jumps[0] : jumps[0] + 2].tolist())
        raise ConfigError(f"the path jumps from {before} to {after}: cells must be neighbours")
    # In one order of memory: kernels are compiled anew for the other one.
    return path.astype(np.int32, order="C")


def distance_matrix(traversable: Mask, cells: Ints32, resolution: float) -> Floats32:
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
    world = check_mask(traversable)
    check_resolution(resolution)
    places = check_cells(cells, world.shape)
    # A cell that is there twice is no way from itself.
    units = np.where((places[:, None] == places).all(axis=2), np.int64(0), np.int64(NOT_SEARCHED))
    search_unknown(world, places, units)
    return lengths_in_metres(units, resolution)


def search_unknown(world: Mask, places: Ints, units: Ints) -> int:
    """Fill in the unknown lengths int64 (n, n) between cells (n, 2), in units of the search; by how many."""
    space, count = workspace(world), 0
    flat = flat_indices(places, space)
    doors, steps = entrances(flat, space)
    for source in sources_to_search(units):
        targets = np.flatnonzero(units[source] == NOT_SEARCHED)
        ahead = doors[targets]
        lengths = space.lengths_to(int(flat[source]), ahead.ravel()).reshape(ahead.shape) + steps[targets]
        units[source, targets] = units[targets, source] = np.minimum(lengths.min(axis=1), FAR)
        count += 1
    return count


def check_cells(cells: ArrayLike, shape: tuple[int, ...]) -> Ints:
    """The cells as int64 (n, 2); raises `ConfigError` where one lies outside of a grid of that shape."""
    places = np.asarray(cells, np.int64).reshape(-1, 2)
    outside = ((places < 0) | (places >= np.array(shape))).any(axis=1)
    if outside.any():
        row, col = places[outside][0]
        raise ConfigError(f"cell ({row}, {col}) lies outside of the grid of shape {tuple(shape)}")
    return places


def flat_indices(places: Ints, space: Search) -> Ints:
    """Padded flat indices (n,) of cells (n, 2)."""
    return (places[:, 0] + 1) * space.cols + places[:, 1] + 1


def entrances(flat: Ints, space: Workspace) -> tuple[Ints, Ints]:
    """For each place the cells (n, 8) by which it is entered and the lengths (n, 8) of those moves.

    A traversable place is entered "by itself"; one that is not, by the moves that lead out of it, which no
    search follows. Where all are traversable, both are (n, 1).
    """
    if space.world.ravel()[flat].all():
        return flat[:, None], np.zeros((len(flat), 1), np.int64)
    cells = np.repeat(flat[:, None], 8, axis=1)
    lengths = np.zeros(cells.shape, np.int64)
    north, east = space.cols, 1
    offsets = np.array([north, -north, -east, east, north - east, north + east, -north - east, -north + east])
    moves = np.array([STRAIGHT] * 4 + [DIAGONAL] * 4)
    shut = space.world.ravel()[flat] == 0
    allowed = (space.moves.ravel()[flat, None] >> np.arange(8)) & 1 == 1
    cells[shut] = np.where(allowed[shut], cells[shut] + offsets, cells[shut])
    lengths[shut] = np.where(allowed[shut], moves, FAR)
    return cells, lengths


@njit(cache=True, nogil=True)
def walk_down(
    lengths: NDArray[np.generic],
    border: int,
    origin: float,
    scale: float,
    farthest: float,
    moves: Bytes,
    row: int,
    col: int,
) -> Ints32:
    """Cells (k, 2) from the source to (row, col), which has a length; empty when the field has no way down.

    Args:
        lengths: float32 (rows, cols) or int32 (rows + 2, cols + 2); minus the origin, times the scale and
            rounded to float32 it is metres.
        border: Of `lengths`, 0 or 1.
        origin: See `lengths`.
        scale: See `lengths`.
        farthest: What lies above is not reached.
        moves: uint8 (rows + 2, cols + 2), the moves out of every cell, as bits.
        row: Of the target; likewise `col`.
        col: See `row`.
    """
    rows, cols = moves.shape[0] - 2, moves.shape[1] - 2
    found = np.empty((rows + cols, 2), np.int32)
    count = 0
    here = np.float32((np.float64(lengths[row + border, col + border]) - origin) * scale)
    while True:
        if count == found.shape[0]:
            larger = np.empty((2 * count, 2), np.int32)
            for k in range(count):
                larger[k, 0], larger[k, 1] = found[k, 0], found[k, 1]
            found = larger
        found[count, 0], found[count, 1] = row, col
        count += 1
        if here == 0.0:
            return found[:count][::-1].copy()
        best_row, best_col, best, steepest = -1, -1, here, 0.0
        for k in range(8):
            d_row, d_col = _STEPS[k]
            r, c = row + d_row, col + d_col
            if not (0 <= r < rows and 0 <= c < cols) or lengths[r + border, c + border] > farthest:
                continue
            there = np.float32((np.float64(lengths[r + border, c + border]) - origin) * scale)
            if there >= here:
                continue
            sides = 1 << (0 if d_row > 0 else 1) | 1 << (2 if d_col < 0 else 3)
            if k >= 4 and moves[row + 1, col + 1] & sides != sides:
                continue
            # Down the steepest slope: the neighbour before this cell on a shortest path loses a whole move's
            # length.
            slope = float(here - there) / (1.0 if k < 4 else math.sqrt(2.0))
            if slope > steepest:
                best_row, best_col, best, steepest = r, c, there, slope
        if best_row < 0:
            return found[:0].copy()
        row, col, here = best_row, best_col, best


_STEPS = ((1, 0), (-1, 0), (0, -1), (0, 1), (1, -1), (1, 1), (-1, -1), (-1, 1))
