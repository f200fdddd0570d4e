"""What can be seen from where on a known floor plan, as sets of target cells.

A set is a row of 64-bit words, a bit for every sampled target cell, so that unions and counts cost next to
nothing. At most a third of the target's cells are sampled, evenly; the share of the sample that has been seen
is the coverage to a few hundredths of a per cent.
"""

from __future__ import annotations

import dataclasses
import math
from typing import NamedTuple

import numpy as np
from numba import njit

from layoutexplore.errors import checks_making
from layoutexplore.frontiers.decision import CellPath, Truth
from layoutexplore.grids.arrays import Floats, Floats32, Ints, Ints32, Mask, Words
from layoutexplore.grids.bitsets import ones
from layoutexplore.grids.morphology import with_neighbours
from layoutexplore.sensing.lidar import LidarConfig, around, beam_table

Bits = Words
"""A set of sampled target cells: uint64 (words,)."""

_SAMPLE = 40_000
"""About how many cells a large sample has; a small target is sampled by a third."""
_WALL, _FLOOR = -2, -1
SPARE = 48
"""Words of a set beyond those of sampled cells, where a floor may change: for what lies beyond its edge."""
_BEAMS_TURNING, _BEAMS_WALKING = 720, 240
"""Beams in 360 degrees that planning needs: what falls between two of them, the next scan shows."""
_BEAMS_FORESEEN = 360
"""The same of a turn on a floor that may change: it is planned on anew before it is walked."""


class FloorInView(NamedTuple):
    """A floor as somebody plans on it: the truth, or what is known and foreseen.

    Attributes:
        occupied: bool (rows, cols), what ends a ray.
        target: bool (rows, cols), free cells that are to be seen, or have been.
        reachable: bool (rows, cols), cells that the robot's centre can reach.
        resolution: Side of a cell in metres.
        sensor: The lidar's configuration.
    """

    occupied: Mask
    target: Mask
    reachable: Mask
    resolution: float
    sensor: LidarConfig

    @staticmethod
    def of(truth: Truth) -> FloorInView:
        """The true floor."""
        raster = truth.raster
        return FloorInView(raster.occupied, truth.target, truth.reachable, raster.resolution, truth.sensor)


@checks_making
class Visibility:
    """What a robot sees on a known floor plan.

    Args:
        scene: The floor, the target and the sensor.
        scan_spacing: Metres between scans while walking.
        sample: About how many cells are sampled: of the target, or of all where the floor may change.
        fixed: Whether the floor stays as it is; where not, see `adapt`.

    Attributes:
        sample: int64 (count,), flat indices of the sampled cells; those near each other have near numbers.
        count: Number of sampled cells.
        words: Number of words of a set.
        spare: The first of the words that stand for no sampled cell.
        target: The sampled cells that are to be seen, as a set.
        cell_area: Square metres that a sampled cell stands for.
    """

    def __init__(
        self, scene: FloorInView, scan_spacing: float, sample: int = _SAMPLE, *, fixed: bool = True
    ) -> None:
        self.resolution = scene.resolution
        self.spacing = scan_spacing / self.resolution
        # An odd stride and knight's moves: every row and column has its share of the sample.
        numbered = scene.target if fixed else np.ones(scene.occupied.shape, np.bool_)
        stride = max(3, 2 * (int(np.count_nonzero(numbered)) // (2 * sample)) + 1)
        self.cell_area = stride * self.resolution**2
        steps = np.add.outer(np.arange(scene.occupied.shape[0]), 2 * np.arange(scene.occupied.shape[1]))
        chosen = np.argwhere(numbered & (steps % stride == 0))
        # A word is a tile of the floor: what is left to see lies in few words.
        tile = max(1, round(8 * math.sqrt(stride)))
        chosen = chosen[np.lexsort((chosen[:, 1] // tile, chosen[:, 0] // tile))]
        self.sample = np.ravel_multi_index((chosen[:, 0], chosen[:, 1]), scene.occupied.shape)
        self.count = len(self.sample)
        self.spare = (self.count + 63) // 64
        self.words = self.spare + (0 if fixed else SPARE)
        self._stride = stride
        # A border of wall around the plan ends every ray.
        labels = np.full((scene.occupied.shape[0] + 2, scene.occupied.shape[1] + 2), _WALL, np.int32)
        self._numbers = np.full(scene.occupied.shape, _FLOOR, np.int32)
        self._numbers.ravel()[self.sample] = np.arange(self.count)
        reach = scene.sensor.range_max / self.resolution
        turning = _BEAMS_TURNING if fixed else _BEAMS_FORESEEN
        self._around = _Scanner(labels, *beam_table(_thinned(around(scene.sensor), turning)), reach)
        self._ahead = _Scanner(labels, *beam_table(_thinned(scene.sensor, _BEAMS_WALKING)), reach)
        self.adapt(scene)

    def adapt(self, scene: FloorInView) -> None:
        """Look at a floor of the same shape that has changed from now on."""
        # Both scanners have the same labels, also in a copy.
        self._around.labels[1:-1, 1:-1] = np.where(scene.occupied, _WALL, self._numbers)
        self.target = self.set_of(scene.target)

    def set_of(self, mask: Mask) -> Bits:
        """The sampled cells that lie in a mask bool (rows, cols): uint64 (words,)."""
        flags = np.zeros(64 * self.words, np.uint8)
        flags[: self.count] = mask.ravel()[self.sample]
        return np.packbits(flags, bitorder="little").view(np.uint64)

    def near(self, mask: Mask) -> Bits:
        """The sampled cells at and around a mask bool (rows, cols), some for every cell of it."""
        return self.set_of(with_neighbours(mask, math.ceil(math.sqrt(self._stride)) + 1))

    def turning(self, cells: Ints32) -> Words:
        """What a full turn in each of the cells int32 (n, 2) shows: uint64 (n, words)."""
        seen = np.zeros((len(cells), self.words), np.uint64)
        _look_around(self._around, np.asarray(cells, np.int64), seen)
        return seen

    def walking(self, path: CellPath) -> Bits:
        """What the scans on the way along a path show (not those at its ends): uint64 (words,)."""
        seen = np.zeros(self.words, np.uint64)
        _look_ahead(self._ahead, np.asarray(path, np.int64), self.spacing - 1e-6, seen)
        return seen


def _thinned(sensor: LidarConfig, beams_around: int) -> LidarConfig:
    """The sensor with no more beams than that in 360 degrees."""
    return dataclasses.replace(
        sensor, beams=min(sensor.beams, math.ceil(beams_around * sensor.fov / (2 * math.pi)))
    )


def size(bits: Bits) -> int:
    """Number of cells in a set."""
    count: int = _size_of_union(bits, bits, bits)
    return count


def size_of_union(a: Bits, b: Bits, c: Bits) -> int:
    """Number of cells in any of three sets."""
    count: int = _size_of_union(a, b, c)
    return count


def added_sizes(sets: Words, rows: Ints, other: Bits) -> Ints:
    """How many cells int64 (k,) some rows int64 (k,) of `sets` uint64 (n, words) each add to `other`."""
    return _added(sets, rows, ~other)


def cheapest_enough(
    sets: Words, near: Floats32, weights: Floats, below: float, limits: list[tuple[Bits, int]]
) -> int:
    """The set that costs least among those that add enough; -1 where none does, or none costs little enough.

    Args:
        sets: uint64 (n, words).
        near: float32 (k, n), parts of the cost of each set.
        weights: float64 (k,), of the parts.
        below: What it must cost less than.
        limits: Pairs of another set, and how many cells a set must add to it.
    """
    missing = np.array([~other for other, _ in limits])
    row: int = _cheapest_enough(sets, near, weights, below, missing, np.array([n for _, n in limits]))
    return row


@njit(cache=True, nogil=True)
def _size_of_union(a: Bits, b: Bits, c: Bits) -> int:
    count = 0
    for w in range(len(a)):
        count += ones(a[w] | b[w] | c[w])
    return count


@njit(cache=True, nogil=True)
def _added(sets: Words, rows: Ints, missing: Words) -> Ints:
    counts = np.zeros(len(rows), np.int64)
    words = np.flatnonzero(missing)
    for k in range(len(rows)):
        for w in words:
            counts[k] += ones(sets[rows[k], w] & missing[w])
    return counts


@njit(cache=True, nogil=True)
def _cheapest_enough(
    sets: Words, near: Floats32, weights: Floats, below: float, missing: Words, needed: Ints
) -> int:
    """As `cheapest_enough`, with what is missing from the other sets uint64 (m, words)."""
    best, least = -1, below
    for row in range(len(sets)):
        cost = 0.0
        for k in range(len(weights)):
            cost += weights[k] * near[k, row]
        # Of equally dear ones the first; what costs more than the best so far need not be looked at.
        if cost >= least:
            continue
        enough = True
        for m in range(len(needed)):
            count = 0
            for w in range(sets.shape[1]):
                count += ones(sets[row, w] & missing[m, w])
            enough &= count >= needed[m]
        if enough:
            best, least = row, cost
    return best


class _Scanner(NamedTuple):
    """What is looked at and how far.

    Attributes:
        labels: int32 (rows, cols), the number of a sampled target cell, -1 for other floor, -2 for walls.
        unit_x: float64 (beams,), ahead, of each beam's direction in the robot's frame.
        unit_y: float64 (beams,), to the left: the other part of the direction,
            so that a beam is turned by multiplication alone.
        reach: Range in cells.
    """

    labels: Ints32
    unit_x: Floats
    unit_y: Floats
    reach: float


@njit(cache=True, nogil=True)
def _look_around(scanner: _Scanner, cells: Ints, seen: Words) -> None:
    """Add to each row of `seen` what a full turn in a cell shows."""
    for k in range(len(cells)):
        _look(scanner, cells[k], 1.0, 0.0, seen[k])


@njit(cache=True, nogil=True)
def _look_ahead(scanner: _Scanner, path: Ints, spacing: float, seen: Words) -> None:
    """Scan whenever `spacing` cells have been walked since the last scan, looking the way walked since.

    The ends of the path are left out: whoever stops there turns fully.
    """
    walked = 0.0
    last = 0
    for k in range(1, len(path) - 1):
        walked += np.hypot(path[k, 0] - path[k - 1, 0], path[k, 1] - path[k - 1, 1])
        if walked < spacing:
            continue
        d_row, d_col = path[k, 0] - path[last, 0], path[k, 1] - path[last, 1]
        length = np.hypot(d_row, d_col)
        _look(scanner, path[k], d_col / length, d_row / length, seen)
        walked = 0.0
        last = k


@njit(cache=True, nogil=True)
def _look(scanner: _Scanner, cell: Ints, cos: float, sin: float, seen: Words) -> None:
    """Add what the beams of one scan cross, from the middle of a cell, to a set."""
    # Not `grids.rays.ray_frame`: here distances are summed; their rounding decides what is seen at corners.
    field = scanner.labels.ravel()
    cols = scanner.labels.shape[1]
    # The labels have a border of one cell of wall, so that no ray needs to ask whether it has left the plan.
    start = (cell[0] + 1) * cols + cell[1] + 1
    one = np.uint64(1)
    for i in range(scanner.unit_x.size):
        dx = scanner.unit_x[i] * cos - scanner.unit_y[i] * sin
        dy = scanner.unit_x[i] * sin + scanner.unit_y[i] * cos
        inverse_x = abs(1.0 / dx) if dx != 0.0 else np.inf
        inverse_y = abs(1.0 / dy) if dy != 0.0 else np.inf
        step_x = 1 if dx > 0.0 else -1
        step_y = cols if dy > 0.0 else -cols
        # Distances along the ray to its next crossings of a column's and of a row's edge.
        next_x, next_y = 0.5 * inverse_x, 0.5 * inverse_y
        index = start
        label = field[index]
        here = 0.0
        # A cell counts when the ray enters it within the range, however little of it lies there.
        while label != _WALL and here <= scanner.reach:
            if label >= 0:
                seen[label >> 6] |= one << np.uint64(label & 63)
            if next_x <= next_y:
                here = next_x
                next_x += inverse_x
                index += step_x
            else:
                here = next_y
                next_y += inverse_y
                index += step_y
            label = field[index]
