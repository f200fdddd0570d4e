"""What is known of a frontier's surroundings, as numbers for the trees that judge it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.grid import FREE, UNKNOWN
from layoutexplore.predictors.frontier_probes import (
    RAYS,
    cast_rays,
    flood_unknown,
    frontier_frame,
    wall_extensions,
    walls_in_line,
)
from layoutexplore.predictors.regions import Regions, region_boxes

RAY_REACH = 12.0
"""Metres that rays look."""

DEPTHS = (0.3, 0.6, 1.0, 2.0, 3.0, 5.0)
"""Metres behind the frontier at which floods are measured."""

UNIT = 0.5
"""Metres: thickness of the slices in which walls are looked for."""

WALL_MIN, EXTENSION_REACH = 0.4, 10.0
"""Metres: walls from this length on are thought to go on, and how far."""

NEAR_END = 0.5
"""Metres within which a wall at the end of a frontier is looked for."""

_SHAPE = ("size", "depth", "width", "slant", "visible", "sides", "end_low", "end_high", "known", "frontiers")
_FLOOD = (*(f"area_{d:g}" for d in DEPTHS), "walls", "free", "barred", "stopped", "ended")
_REGION = ("door_share", "door_near", "door_width", "region", "ahead_min", "ahead_max", "side_min", "side_max", "fill",
           "region_frontier", "region_frontiers", "box_unknown", "finished_room", "finished_rooms")  # fmt: skip

FEATURES: tuple[str, ...] = (
    *_SHAPE,
    *(f"ray{k}_{what}" for k in range(RAYS) for what in ("first", "end", "wall", "unknown")),
    *(f"{barrier}_{what}" for barrier in ("open", "extended", "doors") for what in _FLOOD),
    *(f"ahead{k}_{what}" for what in ("wall", "extended") for k in range(16)),
    *(f"beside{k}_wall" for k in range(24)),
    *_REGION,
)
"""Names of the features, in their order. Lengths are metres, areas square metres."""


def frontier_features(
    cells: NDArray[np.int8],
    frontiers: Sequence[NDArray[np.int32]],
    visible: NDArray[np.float64],
    regions: Regions,
    resolution: float,
) -> NDArray[np.float32]:
    """Features float32 (k, len(FEATURES)) of k >= 1 frontiers.

    Args:
        cells: int8 (rows, cols), what is known.
        frontiers: Per frontier its cells int32 (n, 2).
        visible: float64 (k,), unknown area in sight of each, in square metres.
        regions: The seen rooms of these cells.
        resolution: Metres per cell.
    """
    members = np.concatenate(frontiers).astype(np.int32)
    offsets = np.cumsum([0, *(len(f) for f in frontiers)]).astype(np.int64)
    door = regions.door_width > 0
    out = np.zeros((len(frontiers), len(FEATURES)), np.float32)
    extensions = wall_extensions(cells, max(round(WALL_MIN / resolution), 1), round(EXTENSION_REACH / resolution))
    depths = np.array([max(round(d / resolution), 1) for d in DEPTHS], np.int64)
    lengths = np.array([round(v / resolution) for v in (RAY_REACH, NEAR_END, UNIT)], np.int64)
    frames = _probe(cells, extensions, door, members, offsets, depths, lengths, out)
    _scale(out, resolution)
    out[:, 4] = visible
    out[:, 8] = math.log(1.0 + np.count_nonzero(cells == FREE) * resolution**2)
    out[:, 9] = len(frontiers)
    out[:, -len(_REGION) :] = _region_features(cells, members, offsets, frames, regions, resolution)
    return out


@njit(cache=True, nogil=True)
def _probe(
    cells: NDArray[np.int8],
    extensions: NDArray[np.uint8],
    door: NDArray[np.bool_],
    members: NDArray[np.int32],
    offsets: NDArray[np.int64],
    depths: NDArray[np.int64],
    lengths: NDArray[np.int64],
    out: NDArray[np.float32],
) -> NDArray[np.float64]:
    """Fill in all but the features of regions, in cells; returns the frames float64 (k, 8)."""
    frames = np.zeros((len(out), 8))
    stamp = np.zeros(cells.shape, np.int32)
    queue = np.empty((cells.size, 2), np.int32)
    nothing, extended = np.zeros(cells.shape, np.bool_), extensions > 0
    flood = len(depths) + 5
    for k in range(len(out)):
        cluster = members[offsets[k] : offsets[k + 1]]
        frame = frontier_frame(cells, cluster)
        frames[k] = frame
        _shape(cells, cluster, frame, lengths[1], out[k])
        at = 10
        cast_rays(cells, frame, lengths[0], out[k, at:])
        at += 4 * RAYS
        flood_unknown(cells, nothing, cluster, depths, stamp, 3 * k + 1, queue, out[k, at:])
        flood_unknown(cells, extended, cluster, depths, stamp, 3 * k + 2, queue, out[k, at + flood :])
        flood_unknown(cells, door, cluster, depths, stamp, 3 * k + 3, queue, out[k, at + 2 * flood :])
        walls_in_line(cells, extensions, frame, lengths[2], out[k, at + 3 * flood :])
    return frames


@njit(cache=True, nogil=True)
def _shape(
    cells: NDArray[np.int8], cluster: NDArray[np.int32], frame: NDArray[np.float64], near: int, out: NDArray[np.float32]
) -> None:
    """Size, extents, slant, sides, and the distance to a wall from the ends on either side."""
    ahead = cluster[:, 0] * frame[2] + cluster[:, 1] * frame[3]
    side = cluster[:, 0] * frame[4] + cluster[:, 1] * frame[5]
    out[0], out[1], out[2] = len(cluster), ahead.max() - ahead.min() + 1, side.max() - side.min() + 1
    out[3], out[5] = frame[6], frame[7]
    for end in range(2):
        row, col = cluster[np.argmin(side) if end == 0 else np.argmax(side)]
        nearest = 2 * near
        for dr in range(-near, near + 1):
            for dc in range(-near, near + 1):
                r, c = row + dr, col + dc
                if 0 <= r < cells.shape[0] and 0 <= c < cells.shape[1] and cells[r, c] == 100:
                    nearest = min(nearest, max(abs(dr), abs(dc)))
        out[6 + end] = nearest


def _scale(out: NDArray[np.float32], resolution: float) -> None:
    """From cells to metres and square metres."""
    for k, name in enumerate(FEATURES[: -len(_REGION)]):
        if "_area_" in name:
            out[:, k] *= resolution**2
        elif name not in ("slant",) and not name.endswith(("_end", "_stopped", "_ended")):
            out[:, k] *= resolution


def _region_features(
    cells: NDArray[np.int8],
    members: NDArray[np.int32],
    offsets: NDArray[np.int64],
    frames: NDArray[np.float64],
    regions: Regions,
    resolution: float,
) -> NDArray[np.float32]:
    """Doors at each frontier, and the region that holds it."""
    count = len(offsets) - 1
    out = np.zeros((count, len(_REGION)), np.float32)
    width = regions.door_width[members[:, 0], members[:, 1]]
    clear = cv2.distanceTransform((regions.door_width == 0).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_3)
    out[:, 0] = np.add.reduceat(width > 0, offsets[:-1], dtype=np.float64) / np.diff(offsets)
    out[:, 1] = np.minimum(np.minimum.reduceat(clear[members[:, 0], members[:, 1]], offsets[:-1]) * resolution, 10.0)
    out[:, 2] = np.maximum.reduceat(width, offsets[:-1])
    home = home_regions(regions, members, offsets)
    boxes = region_boxes(regions)
    owners = regions.labels[members[:, 0], members[:, 1]]
    box = boxes[home]
    out[:, 3] = box[:, 0] * resolution**2
    low, high = box[:, 1:3] - frames[:, :2], box[:, 3:5] - 1 - frames[:, :2]
    for column, axis in ((4, frames[:, 2:4]), (6, frames[:, 4:6])):
        ends = np.stack([(low * axis).sum(1), (high * axis).sum(1)])
        out[:, column], out[:, column + 1] = ends.min(0) * resolution, ends.max(0) * resolution
    area = np.maximum((box[:, 3] - box[:, 1]) * (box[:, 4] - box[:, 2]), 1)
    out[:, 8] = box[:, 0] / area
    out[:, 9] = np.bincount(owners, minlength=regions.count + 1)[home] * resolution
    out[:, 10] = np.bincount(home, minlength=regions.count + 1)[home]
    sums = cv2.integral((cells == UNKNOWN).astype(np.uint8))
    out[:, 11] = sums[box[:, 3], box[:, 4]] - sums[box[:, 1], box[:, 4]] - sums[box[:, 3], box[:, 2]] + sums[box[:, 1], box[:, 2]]
    out[:, 11] *= resolution**2
    finished = boxes[1:, 0][np.bincount(home, minlength=regions.count + 1)[1:] == 0] * resolution**2
    finished = finished[finished > 2.0]
    out[:, 12] = np.median(finished) if len(finished) else 0.0
    out[:, 13] = len(finished)
    return out


def home_regions(regions: Regions, members: NDArray[np.int32], offsets: NDArray[np.int64]) -> NDArray[np.int64]:
    """The region int64 (k,) that holds most cells of each frontier; the lowest of equals."""
    owners = regions.labels[members[:, 0], members[:, 1]].astype(np.int64)
    frontier = np.repeat(np.arange(len(offsets) - 1), np.diff(offsets))
    pairs, counts = np.unique(frontier * (regions.count + 1) + owners, return_counts=True)
    order = np.lexsort((pairs, -counts, pairs // (regions.count + 1)))
    _, first = np.unique(pairs[order] // (regions.count + 1), return_index=True)
    return np.asarray(pairs[order][first] % (regions.count + 1))
