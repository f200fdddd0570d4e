"""Features of the unknown cells near a seen region, from which trees say whether they belong to its room."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.grids.arrays import Bytes, Cells, Floats, Floats32, Ints, Ints32, Labels, Mask
from layoutexplore.grids.grid import in_cells
from layoutexplore.grids.morphology import with_neighbours
from layoutexplore.layout.doorways import Regions
from layoutexplore.predictors.bit_map import (
    ALONG_COLS,
    ALONG_ROWS,
    FREE_BIT,
    UNKNOWN_BIT,
    WALL_BIT,
    BitMap,
    draw_bit_map,
)

STRIDE = 0.3
"""Metres between the cells of a lattice, of which one is classified for all around it."""

REACH, RIVAL = 10.0, 2.0
"""Metres of path through the unknown up to which a cell is a region's, and the surplus of a second one."""

SIGHT = 8.0
"""Metres that a cell looks around."""

_SEEN: tuple[str, ...] = (
    "way", "crossed", "outside_long", "outside_short", "box_long", "box_short", "area", "fill",
    *(f"{side}_{what}" for side in ("inward", "outward", "left", "right")
      for what in ("distance", "kind", "crossed", "line")),
    *(f"diagonal{k}_{what}" for k in range(4) for what in ("distance", "kind")),
    "rank", "other_way", "region_doors", "typical_area", "typical_long", "typical_short", "rooms",
)  # fmt: skip
_FIRST = ("self", "near", "wide", "total", "mean", "grown_long", "grown_short", "beyond_long", "beyond_short")

FEATURES: tuple[str, ...] = (*_SEEN, *(f"judged_{what}" for what in _FIRST))
"""Names of the features.

`long` is the axis along which the cell lies further outside of the region's box. The `judged` ones tell what
a first estimate, made without them, says of the neighbourhood and of the whole room.
"""

_WAY, _CROSSED, _OUTSIDE, _BOX = map(FEATURES.index, ("way", "crossed", "outside_long", "box_long"))
_AREA, _FILL, _STRAIGHT = map(FEATURES.index, ("area", "fill", "inward_distance"))
_DIAGONAL, _RANK, _OTHER_WAY = map(FEATURES.index, ("diagonal0_distance", "rank", "other_way"))
_REGION_DOORS, _TYPICAL = map(FEATURES.index, ("region_doors", "typical_area"))
_SELF, _NEAR, _TOTAL = map(FEATURES.index, ("judged_self", "judged_near", "judged_total"))
_MEAN, _GROWN = map(FEATURES.index, ("judged_mean", "judged_grown_long"))
"""Columns of features, and the first ones of those that are written together."""

NEAR, WIDE = 3, 7
"""Lattice cells on a side of the neighbourhoods whose first estimate is averaged."""


class _Known(NamedTuple):
    """What is known: the code and margin of a bit map, and the labels of regions (rows, cols)."""

    code: Bytes
    margin: int
    labels: Labels


@dataclass(frozen=True, eq=False)
class CandidateCells:
    """Unknown cells and the rooms that they may belong to.

    Attributes:
        cells: int32 (n, 2), one of every lattice cell that holds an unknown cell.
        region: int32 (n,), one of the two regions that reach each first; a cell that two reach is there
            twice.
        rank: int32 (n,), 0 for the first of the two.
        features: float32 (n, len(FEATURES)).
        stride: Cells on a side of a lattice cell.
        boxes: int64 (regions + 1, 5), of `Regions`.
    """

    cells: Ints32
    region: Ints32
    rank: Ints32
    features: Floats32
    stride: int
    boxes: Ints


def find_candidates(
    cells: Cells,
    regions: Regions,
    resolution: float,
    *,
    wanted: Mask | None = None,
    spacing: float = STRIDE,
    reach: float = REACH,
) -> CandidateCells:
    """The unknown cells of a lattice that a region reaches through the unknown, without a first estimate.

    Args:
        cells: int8 (rows, cols), what is known.
        regions: The seen rooms.
        resolution: Metres per cell.
        wanted: bool (regions + 1,), the regions to look at; all when None.
        spacing: Metres on a side of a lattice cell.
        reach: Metres of path through the unknown up to which a cell is a candidate.
    """
    stride = in_cells(spacing, resolution)
    bit_map = draw_bit_map(cells, regions, resolution, SIGHT + resolution)
    owner, way, crossed = _reach(bit_map.code, bit_map.margin, regions.labels, round(reach / resolution))
    first: Ints32 = _one_each(owner[0], bit_map.margin, cells.shape, stride)
    found, rank = np.concatenate([first, first]), np.repeat(np.array([0, 1], np.int32), len(first))
    at = rank, found[:, 0] + bit_map.margin, found[:, 1] + bit_map.margin
    kept = (owner[at] > 0) & ((rank == 0) | (way[at] <= way[0][at[1:]] + round(RIVAL / resolution)))
    if wanted is not None:
        kept &= wanted[owner[at]]
    found, rank, at = found[kept], rank[kept], (rank[kept], at[1][kept], at[2][kept])
    region = owner[at]
    features = np.zeros((len(found), len(FEATURES)), np.float32)
    sight = round(SIGHT / resolution)
    known = _Known(bit_map.code, bit_map.margin, regions.labels)
    _describe(known, regions.boxes, found, region, sight, features)
    features[:, _WAY], features[:, _CROSSED], features[:, _RANK] = way[at], crossed[at], rank
    features[:, _OTHER_WAY] = way[1 - rank, at[1], at[2]]
    for k, name in enumerate(_SEEN):
        if not name.endswith(("crossed", "kind", "fill", "rank")):
            features[:, k] *= resolution**2 if name == "area" else resolution
    features[:, _REGION_DOORS] = regions.doors[region]
    features[:, _TYPICAL : _TYPICAL + 4] = _typical_room(bit_map, regions, resolution)
    return CandidateCells(found, region, rank, features, stride, regions.boxes)


def add_first_estimate(candidates: CandidateCells, inside: Floats, resolution: float) -> Floats32:
    """The features of the candidates with those that tell of a first estimate.

    Args:
        candidates: The cells.
        inside: float64 (n,), the probability that each belongs to its region's room.
        resolution: Metres per cell.
    """
    features, region, stride = candidates.features.copy(), candidates.region, candidates.stride
    if not len(features):
        return features
    square = (stride * resolution) ** 2
    at = candidates.cells // stride
    shape = (2, *(at.max(0) + 1).tolist())
    owner, estimate = np.zeros(shape, np.int32), np.zeros(shape, np.float32)
    owner[candidates.rank, at[:, 0], at[:, 1]] = region
    estimate[candidates.rank, at[:, 0], at[:, 1]] = inside
    features[:, _SELF] = inside
    for k, size in enumerate((NEAR, WIDE)):
        features[:, _NEAR + k] = _own_mean(owner, estimate, region, at, size // 2)
    total = np.bincount(region, weights=inside, minlength=len(candidates.boxes))
    count = np.bincount(region, minlength=len(candidates.boxes))
    features[:, _TOTAL] = total[region] * square
    features[:, _MEAN] = (total / np.maximum(count, 1))[region]
    features[:, _GROWN:] = _grown_boxes(candidates, inside > 0.5) * resolution
    return features


@njit(cache=True, nogil=True)
def _one_each(owner: Ints32, margin: int, shape: tuple[int, int], size: int) -> Ints32:
    """Of every lattice cell that holds cells with an owner the one next to its middle: int32 (n, 2)."""
    out = np.empty(((shape[0] // size + 1) * (shape[1] // size + 1), 2), np.int32)
    count = 0
    for row in range(0, shape[0], size):
        for col in range(0, shape[1], size):
            nearest = 2 * size * size
            for r in range(row, min(row + size, shape[0])):
                for c in range(col, min(col + size, shape[1])):
                    away = (r - row - size // 2) ** 2 + (c - col - size // 2) ** 2
                    if away < nearest and owner[r + margin, c + margin]:
                        nearest = away
                        out[count, 0], out[count, 1] = r, c
            count += nearest < 2 * size * size
    return out[:count].copy()


@njit(cache=True, nogil=True)
def _own_mean(owner: Ints32, judged: Floats32, region: Ints32, at: Ints32, reach: int) -> Floats32:
    """Mean estimate float32 (n,) of the lattice cells within `reach` that the same region may own."""
    out = np.zeros(len(at), np.float32)
    for k in range(len(at)):
        row, col = at[k]
        total, count = 0.0, 0
        for r in range(max(row - reach, 0), min(row + reach + 1, owner.shape[1])):
            for c in range(max(col - reach, 0), min(col + reach + 1, owner.shape[2])):
                for rank in range(2):
                    if owner[rank, r, c] == region[k]:
                        total += judged[rank, r, c]
                        count += 1
        out[k] = total / max(count, 1)
    return out


def _grown_boxes(candidates: CandidateCells, inside: Mask) -> Floats:
    """Per candidate float64 (n, 4): sides of the grown box, and how far the candidate lies outside of it.

    The box is that of the region with all cells that the first estimate puts inside. The first of either pair
    belongs to the axis along which the cell lies further outside of the box of what is seen.
    """
    grown = _grow_boxes(candidates.boxes, candidates.region[inside], candidates.cells[inside])
    boxes = grown[candidates.region]
    sides, beyond = boxes[:, 3:5] - boxes[:, 1:3], _outside(boxes, candidates.cells)
    first = _first_axis(candidates)[:, None]
    pairs = [np.take_along_axis(part, np.hstack([first, 1 - first]), 1) for part in (sides, beyond)]
    return np.hstack(pairs).astype(np.float64)


@njit(cache=True, nogil=True)
def _grow_boxes(boxes: Ints, region: Ints32, cells: Ints32) -> Ints:
    """Boxes that also hold some cells of each region."""
    grown = boxes.copy()
    for k in range(len(region)):
        box = grown[region[k]]
        box[1], box[2] = min(box[1], cells[k, 0]), min(box[2], cells[k, 1])
        box[3], box[4] = max(box[3], cells[k, 0] + 1), max(box[4], cells[k, 1] + 1)
    return grown


def _first_axis(candidates: CandidateCells) -> Ints:
    """0 where a candidate lies further outside of its region's box along the rows, 1 along the columns."""
    box = candidates.boxes[candidates.region]
    over, sides = _outside(box, candidates.cells), box[:, 3:5] - box[:, 1:3]
    rows = (over[:, 0] > over[:, 1]) | ((over[:, 0] == over[:, 1]) & (sides[:, 0] >= sides[:, 1]))
    return np.where(rows, 0, 1)


def _outside(boxes: Ints, cells: Ints32) -> Ints:
    """Rows and columns int64 (n, 2) by which each cell lies outside of its box (n, 5), 0 inside."""
    return np.asarray(np.maximum(np.maximum(boxes[:, 1:3] - cells, cells - boxes[:, 3:5] + 1), 0))


def _typical_room(bit_map: BitMap, regions: Regions, resolution: float) -> tuple[float, float, float, float]:
    """Median area, longer and shorter side of the rooms that are seen whole, and how many there are."""
    inner = slice(bit_map.margin, -bit_map.margin)
    beside = with_neighbours(bit_map.code & UNKNOWN_BIT > 0)[inner, inner]
    boxes = regions.boxes
    edge = np.bincount(regions.labels[beside], minlength=regions.count + 1)
    area = boxes[:, 0] * resolution**2
    whole = (area > 2.0) & (edge * resolution < 0.3)
    whole[0] = False
    if not whole.any():
        return 0.0, 0.0, 0.0, 0.0
    sides = np.sort(boxes[whole, 3:5] - boxes[whole, 1:3], axis=1) * resolution
    longer, shorter = float(np.median(sides[:, 1])), float(np.median(sides[:, 0]))
    return float(np.median(area[whole])), longer, shorter, float(whole.sum())


@njit(cache=True, nogil=True)
def _reach(
    code: Bytes, margin: int, labels: Labels, depth: int
) -> tuple[Ints32, NDArray[np.int16], NDArray[np.int16]]:
    """Flood the unknown from all regions: owner, path length, and number of continued walls crossed.

    Each is (2, rows, cols): for the region that comes first, and for the second.
    """
    # Not `grids.flood.spread_in_place`: a cell takes two labels, each with its length and its walls.
    rows, cols = code.shape
    flat, extended = code.ravel(), ALONG_ROWS | ALONG_COLS
    owner = np.zeros((2, rows * cols), np.int32)
    way, crossed = np.zeros((2, rows * cols), np.int16), np.zeros((2, rows * cols), np.int16)
    queue = np.empty(2 * rows * cols, np.int64)
    last = 0
    for r in range(labels.shape[0]):
        for c in range(labels.shape[1]):
            if labels[r, c] == 0:
                continue
            for step in (cols, -cols, 1, -1):
                k = (r + margin) * cols + c + margin + step
                rank = _place(flat, owner, k, labels[r, c])
                if rank >= 0:
                    way[rank, k], crossed[rank, k] = 1, (flat[k] & extended) != 0
                    queue[last] = 2 * k + rank
                    last += 1
    first = 0
    while first < last:
        # Ring by ring: an entry is a cell and which of its two owners goes on from it.
        i, own = queue[first] // 2, queue[first] % 2
        first += 1
        if (
            way[own, i] >= depth
            or i % cols == 0
            or i % cols == cols - 1
            or i < cols
            or i >= (rows - 1) * cols
        ):
            continue
        for step in (cols, -cols, 1, -1):
            k = i + step
            rank = _place(flat, owner, k, owner[own, i])
            if rank >= 0:
                way[rank, k] = way[own, i] + 1
                crossed[rank, k] = crossed[own, i] + ((flat[k] & extended) != 0 and (flat[i] & extended) == 0)
                queue[last] = 2 * k + rank
                last += 1
    return owner.reshape(2, rows, cols), way.reshape(2, rows, cols), crossed.reshape(2, rows, cols)


@njit(cache=True, nogil=True, inline="always")
def _place(flat: Bytes, owner: Ints32, k: int, region: int) -> int:
    """Make a region the first or the second owner of an unknown cell; which of them, or -1."""
    if not flat[k] & UNKNOWN_BIT or owner[0, k] == region:
        return -1
    if owner[0, k] == 0:
        owner[0, k] = region
        return 0
    if owner[1, k] == 0:
        owner[1, k] = region
        return 1
    return -1


@njit(cache=True, nogil=True)
def _describe(known: _Known, boxes: Ints, found: Ints32, region: Ints32, reach: int, out: Floats32) -> None:
    """Where each cell lies to the box of its region, and what is first known in the eight directions."""
    seen = np.zeros(4, np.float32)
    for k in range(len(found)):
        r, c = found[k]
        box = boxes[region[k]]
        over_row, over_col = max(box[1] - r, r - box[3] + 1, 0), max(box[2] - c, c - box[4] + 1, 0)
        height, width = box[3] - box[1], box[4] - box[2]
        # The frame of a cell: u runs along the axis on which it lies further outside of the box (of two equal
        # ones the longer side's), v across, both towards the box's middle. Mirrored grids look the same.
        row_first = over_row > over_col or (over_row == over_col and height >= width)
        sign_row, sign_col = (1 if 2 * r < box[1] + box[3] else -1), (1 if 2 * c < box[2] + box[4] else -1)
        ur, uc, vr, vc = (sign_row, 0, 0, sign_col) if row_first else (0, sign_col, sign_row, 0)
        row = out[k]
        row[_OUTSIDE], row[_OUTSIDE + 1] = (over_row, over_col) if row_first else (over_col, over_row)
        row[_BOX], row[_BOX + 1] = (height, width) if row_first else (width, height)
        row[_AREA], row[_FILL] = box[0], box[0] / max(height * width, 1)
        for side in range(4):
            dr, dc = (ur, uc) if side < 2 else (vr, vc)
            if side % 2:
                dr, dc = -dr, -dc
            at = _STRAIGHT + 4 * side
            _look(known, (r, c), (dr, dc), region[k], reach, row[at : at + 4])
        for turn in range(4):
            dr, dc = ur + vr * (1 - 2 * (turn % 2)), uc + vc * (1 - 2 * (turn % 2))
            if turn >= 2:
                dr, dc = -dr, -dc
            _look(known, (r, c), (dr, dc), region[k], reach, seen)
            row[_DIAGONAL + 2 * turn], row[_DIAGONAL + 2 * turn + 1] = seen[0], seen[1]


@njit(cache=True, nogil=True)
def _look(
    known: _Known, cell: tuple[int, int], step: tuple[int, int], region: int, reach: int, out: Floats32
) -> None:
    """Steps to the first known cell, its kind, lines crossed, steps to the first line.

    Kinds: 0 none, 1 own room, 2 other room, 3 wall.
    """
    # Not `grids.rays.ray_frame`: a diagonal goes from corner to corner here, past the two cells beside.
    (row, col), (dr, dc) = cell, step
    across = ALONG_ROWS | ALONG_COLS if dr != 0 and dc != 0 else (ALONG_COLS if dc != 0 else ALONG_ROWS)
    kind, crossings, inside, distance, line = 0, 0, False, 0, reach
    # The bit map's margin is wider than `reach`: no border is looked for. Free cells lie in the grid.
    while distance < reach:
        distance += 1
        row, col = row + dr, col + dc
        bits = known.code[row + known.margin, col + known.margin]
        if bits & WALL_BIT:
            kind = 3
            break
        if bits & FREE_BIT:
            kind = 1 if known.labels[row, col] == region else 2
            break
        extended = bits & across != 0
        # A continued wall several cells thick is one line.
        if extended and not inside:
            crossings += 1
            line = min(line, distance)
        inside = extended
    out[0], out[1], out[2], out[3] = distance, kind, crossings, line
