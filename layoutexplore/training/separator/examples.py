"""Examples for the separator network: what it sees of a map, and the truth of every square."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from layoutexplore.grids.arrays import Bytes, Cells, Ints32
from layoutexplore.grids.flood import spread_in_place
from layoutexplore.grids.grid import OCCUPIED
from layoutexplore.layout.alignment import turn_labels
from layoutexplore.layout.limits import cells_at_most
from layoutexplore.layout.merging.method import MergingConfig
from layoutexplore.layout.merging.separator.planes import (
    KINDS,
    PATCH,
    fine_index,
    network_input,
    square_middles,
)
from layoutexplore.layout.merging.walls.aligned_map import AlignedMap, align_map
from layoutexplore.layout.timing import StageTimer

SPREAD = 0.6
"""Rooms reach so far into walls and doorways around them: their borders lie in the middle of these [m]."""

NEAR_WALL, INSIDE = 0.12, 0.3
"""Obstacles up to so far inside a room may be its wall, from so far on they are none [m]."""


@dataclass(frozen=True, eq=False)
class SeparatorExample:
    """A map to learn from, turned to its walls; its sizes are whole places of the network's coarsest layer.

    Attributes:
        shares: uint8 (fine squares, fine squares, KINDS), of 255.
        rooms: int16 (squares, squares), the room that each square lies in or near, 0 for none.
        thing: uint8 (squares, squares), the share of its obstacles that are no wall, of 255.
        thing_weight: uint8 (squares, squares), the share of its obstacles of which that is known, of 255.
    """

    shares: Bytes
    rooms: NDArray[np.int16]
    thing: Bytes
    thing_weight: Bytes


def separator_example(cells: Cells, rooms: Ints32, resolution: float) -> SeparatorExample:
    """What a map teaches.

    Args:
        cells: int8 (rows, cols), trinary, with a free cell.
        rooms: int32 (rows, cols), the true room of each cell, 0 for none.
        resolution: Metres a cell.
    """
    aligned = align_map(cells, resolution, MergingConfig(), StageTimer())
    seen = network_input(aligned.turned.cells, aligned.wall, aligned.gaps.gap, resolution)
    fine = PATCH * seen.shape[0], PATCH * seen.shape[1]
    shares = seen.reshape(*seen.shape[:2], PATCH, PATCH, KINDS).transpose(0, 2, 1, 3, 4).reshape(*fine, KINDS)
    truth = np.ascontiguousarray(turn_labels(rooms.astype(np.int32), aligned.turned))
    thing, weight = _things(aligned, truth, resolution, (fine[0] // 2, fine[1] // 2))
    return SeparatorExample(
        # Rounded down, the parts of a square are no more than 255 together: they are added up later.
        np.floor(shares * 255).astype(np.uint8),
        _rooms_of_squares(truth, resolution, thing.shape),
        np.asarray(np.rint(thing * 255), np.uint8),
        np.asarray(np.rint(weight * 255), np.uint8),
    )


def _rooms_of_squares(truth: Ints32, resolution: float, shape: tuple[int, ...]) -> NDArray[np.int16]:
    spread = truth.copy()
    spread_in_place(spread, truth == 0, cells_at_most(SPREAD, resolution, max(truth.shape)))
    rows, cols = (
        np.minimum(square_middles(squares, resolution), size - 1)
        for squares, size in zip(shape, truth.shape, strict=True)
    )
    return np.asarray(spread[np.ix_(rows, cols)], np.int16)


def _things(
    aligned: AlignedMap, truth: Ints32, resolution: float, shape: tuple[int, int]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Share of the obstacles of each square that are no wall, and of those of which that is known."""
    depth = cv2.distanceTransform((truth > 0).view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5) * resolution
    rows, cols = np.nonzero(aligned.turned.cells == OCCUPIED)
    index = [fine_index(size, resolution) // 2 for size in truth.shape]
    at, inside = (index[0][rows], index[1][cols]), depth[rows, cols]
    count, thing, known = (np.zeros(shape) for _ in range(3))
    np.add.at(count, at, 1)
    np.add.at(thing, at, inside > INSIDE)
    np.add.at(known, at, (inside > INSIDE) | (inside <= NEAR_WALL))
    return thing / np.maximum(known, 1), known / np.maximum(count, 1)
