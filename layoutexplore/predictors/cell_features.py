"""What is known about unknown cells near a seen region, as numbers for the trees that say whether they belong to its room."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.grid import UNKNOWN
from layoutexplore.predictors.frontier_probes import wall_extensions
from layoutexplore.predictors.regions import Regions, region_boxes

STRIDE = 0.3
"""Metres between the cells that are judged; each stands for the square around it."""

REACH = 12.0
"""Metres of way through the unknown up to which a cell can belong to a region."""

WALL_MIN, EXTENSION_REACH = 0.4, 10.0
"""Metres: walls from this length on are thought to go on, and how far."""

FEATURES: tuple[str, ...] = (
    "way", "crossed", "outside_long", "outside_short", "box_long", "box_short", "area", "fill",
    *(f"{side}_{what}" for side in ("inward", "outward", "left", "right") for what in ("distance", "kind", "crossed", "line")),
    *(f"diagonal{k}_{what}" for k in range(4) for what in ("distance", "kind")),
    "typical_room", "typical_long", "typical_short", "rooms",
)  # fmt: skip
"""Names of the features. `long` is the axis along which the cell lies further outside of the region's box."""


@dataclass(frozen=True, eq=False)
class Candidates:
    """Unknown cells that may belong to a room.

    Attributes:
        cells: int32 (n, 2).
        region: int32 (n,), the region that reaches each first.
        features: float32 (n, len(FEATURES)).
        stride: Cells from one to the next.
    """

    cells: NDArray[np.int32]
    region: NDArray[np.int32]
    features: NDArray[np.float32]
    stride: int


def find_candidates(
    cells: NDArray[np.int8], regions: Regions, resolution: float, *, spacing: float = STRIDE, reach: float = REACH
) -> Candidates:
    """The unknown cells of a lattice that a region reaches through the unknown.

    Args:
        cells: int8 (rows, cols), what is known.
        regions: The seen rooms.
        resolution: Metres per cell.
        spacing: Metres between the cells of the lattice.
        reach: Metres of way through the unknown up to which a cell is a candidate.
    """
    stride = max(round(spacing / resolution), 1)
    extensions = wall_extensions(cells, max(round(WALL_MIN / resolution), 1), round(EXTENSION_REACH / resolution))
    boxes = region_boxes(regions)
    owner, way, crossed = _reach(cells, regions.labels, extensions, round(reach / resolution))
    lattice = np.argwhere(owner[stride // 2 :: stride, stride // 2 :: stride] > 0) * stride + stride // 2
    found: NDArray[np.int32] = lattice.astype(np.int32)
    region = owner[found[:, 0], found[:, 1]]
    features = np.zeros((len(found), len(FEATURES)), np.float32)
    _describe(cells, regions.labels, extensions, boxes, found, region, round(EXTENSION_REACH / resolution), features)
    features[:, 0], features[:, 1] = way[found[:, 0], found[:, 1]], crossed[found[:, 0], found[:, 1]]
    for k, name in enumerate(FEATURES):
        if not name.endswith(("crossed", "kind", "fill")):
            features[:, k] *= resolution**2 if name == "area" else resolution
    features[:, -4:] = _typical_room(cells, regions, boxes, resolution)
    return Candidates(found, region, features, stride)


def _typical_room(
    cells: NDArray[np.int8], regions: Regions, boxes: NDArray[np.int64], resolution: float
) -> tuple[float, float, float, float]:
    """Median area, longer and shorter side of the rooms that are seen whole, and how many there are."""
    beside = cv2.dilate((cells == UNKNOWN).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    edge = np.bincount(regions.labels[beside], minlength=regions.count + 1)
    area = boxes[:, 0] * resolution**2
    whole = (area > 2.0) & (edge * resolution < 0.3)
    whole[0] = False
    if not whole.any():
        return 0.0, 0.0, 0.0, 0.0
    sides = np.sort(boxes[whole, 3:5] - boxes[whole, 1:3], axis=1) * resolution
    return float(np.median(area[whole])), float(np.median(sides[:, 1])), float(np.median(sides[:, 0])), float(whole.sum())


@njit(cache=True, nogil=True)
def _reach(
    cells: NDArray[np.int8], labels: NDArray[np.int32], extensions: NDArray[np.uint8], depth: int
) -> tuple[NDArray[np.int32], NDArray[np.int16], NDArray[np.int16]]:
    """Flood the unknown from all regions: who comes first, how long the way is, how many continued walls it crosses."""
    rows, cols = cells.shape
    owner = np.zeros((rows, cols), np.int32)
    way, crossed = np.zeros((rows, cols), np.int16), np.zeros((rows, cols), np.int16)
    queue = np.empty((rows * cols, 2), np.int32)
    last = 0
    for r in range(rows):
        for c in range(cols):
            if labels[r, c] == 0:
                continue
            for step in range(4):
                row, col = r + (step == 0) - (step == 1), c + (step == 2) - (step == 3)
                if 0 <= row < rows and 0 <= col < cols and cells[row, col] == -1 and owner[row, col] == 0:
                    owner[row, col], way[row, col] = labels[r, c], 1
                    crossed[row, col] = extensions[row, col] > 0
                    queue[last] = row, col
                    last += 1
    first = 0
    while first < last:
        r, c = queue[first]
        first += 1
        if way[r, c] >= depth:
            continue
        for step in range(4):
            row, col = r + (step == 0) - (step == 1), c + (step == 2) - (step == 3)
            if 0 <= row < rows and 0 <= col < cols and cells[row, col] == -1 and owner[row, col] == 0:
                owner[row, col], way[row, col] = owner[r, c], way[r, c] + 1
                crossed[row, col] = crossed[r, c] + (extensions[row, col] > 0 and extensions[r, c] == 0)
                queue[last] = row, col
                last += 1
    return owner, way, crossed


@njit(cache=True, nogil=True)
def _describe(
    cells: NDArray[np.int8],
    labels: NDArray[np.int32],
    extensions: NDArray[np.uint8],
    boxes: NDArray[np.int64],
    found: NDArray[np.int32],
    region: NDArray[np.int32],
    reach: int,
    out: NDArray[np.float32],
) -> None:
    """Where each cell lies to the box of its region, and what is first known in the four directions."""
    seen = np.zeros(4, np.float32)
    for k in range(len(found)):
        r, c = found[k]
        box = boxes[region[k]]
        over_row, over_col = max(box[1] - r, r - box[3] + 1, 0), max(box[2] - c, c - box[4] + 1, 0)
        height, width = box[3] - box[1], box[4] - box[2]
        row_first = over_row > over_col or (over_row == over_col and height >= width)
        sign_row, sign_col = (1 if 2 * r < box[1] + box[3] else -1), (1 if 2 * c < box[2] + box[4] else -1)
        ur, uc, vr, vc = (sign_row, 0, 0, sign_col) if row_first else (0, sign_col, sign_row, 0)
        out[k, 2], out[k, 3] = (over_row, over_col) if row_first else (over_col, over_row)
        out[k, 4], out[k, 5] = (height, width) if row_first else (width, height)
        out[k, 6], out[k, 7] = box[0], box[0] / max(height * width, 1)
        for side in range(4):
            dr, dc = (ur, uc) if side < 2 else (vr, vc)
            if side % 2:
                dr, dc = -dr, -dc
            _look(cells, labels, extensions, r, c, dr, dc, region[k], reach, out[k, 8 + 4 * side : 12 + 4 * side])
        for turn in range(4):
            dr, dc = ur + vr * (1 - 2 * (turn % 2)), uc + vc * (1 - 2 * (turn % 2))
            if turn >= 2:
                dr, dc = -dr, -dc
            _look(cells, labels, extensions, r, c, dr, dc, region[k], reach, seen)
            out[k, 24 + 2 * turn], out[k, 25 + 2 * turn] = seen[0], seen[1]


@njit(cache=True, nogil=True)
def _look(
    cells: NDArray[np.int8],
    labels: NDArray[np.int32],
    extensions: NDArray[np.uint8],
    row: int,
    col: int,
    dr: int,
    dc: int,
    region: int,
    reach: int,
    out: NDArray[np.float32],
) -> None:
    """Steps to the first known cell, its kind (0 none, 1 own room, 2 other room, 3 wall), lines crossed, steps to the first."""
    across = 3 if dr != 0 and dc != 0 else (2 if dc != 0 else 1)
    kind, crossings, inside, distance, line = 0, 0, False, 0, reach
    while distance < reach:
        distance += 1
        row, col = row + dr, col + dc
        if not (0 <= row < cells.shape[0] and 0 <= col < cells.shape[1]):
            break
        if cells[row, col] == 100:
            kind = 3
            break
        if cells[row, col] == 0:
            kind = 1 if labels[row, col] == region else 2
            break
        extended = extensions[row, col] & across != 0
        if extended and not inside:
            crossings += 1
            line = min(line, distance)
        inside = extended
    out[0], out[1], out[2], out[3] = distance, kind, crossings, line
