"""Features of a frontier's surroundings, from which trees classify it.

What depends on the near surroundings alone is in `feature_cache`; here are what floods touch and the regions.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.frontiers.detection import FrontierClusters
from layoutexplore.grids.arrays import Cells, Floats, Floats32, Ints, Ints32, Labels
from layoutexplore.grids.grid import FREE
from layoutexplore.layout.doorways import Gaps, Regions
from layoutexplore.predictors.bit_map import BitMap
from layoutexplore.predictors.frontier_model.feature_cache import (
    BARRIERS,
    LOCAL_FEATURES,
    Clusters,
    FeatureCache,
)
from layoutexplore.predictors.frontier_model.feature_kernels import FRAME, TOUCHED

_CONTACTS = tuple(f"{barrier}_{what}" for barrier in BARRIERS for what in ("other_share", "other_rooms"))


class _RegionFeatures(NamedTuple):
    """Features of the region that a frontier lies in, of all frontiers, and of rooms that have none left."""

    visible: int
    known: int
    frontiers: int
    door_width: int
    region: int
    ahead_min: int
    ahead_max: int
    side_min: int
    side_max: int
    fill: int
    region_long: int
    region_short: int
    region_frontier: int
    region_frontiers: int
    region_doors: int
    finished_room: int
    finished_rooms: int
    finished_long: int
    finished_short: int


_REGION = _RegionFeatures._fields
_AT = _RegionFeatures(*range(len(_REGION)))
"""The column of each."""

FEATURES: tuple[str, ...] = (*LOCAL_FEATURES, *_CONTACTS, *_REGION)
"""Names of the features, in their order. Lengths are metres, areas square metres."""

_CONTACTS_AT, _REGION_AT = len(LOCAL_FEATURES), len(LOCAL_FEATURES) + len(_CONTACTS)


@dataclass(frozen=True, eq=False)
class Surroundings:
    """What lies around k >= 1 frontiers.

    Attributes:
        cells: int8 (rows, cols), what is known.
        frontiers: Their cells.
        regions: The seen rooms of these cells.
        homes: int64 (k,), of `home_regions`.
        resolution: Metres per cell.
        bit_map: What is known, as the feature kernels read it.
        local_features: float32 (k, len(LOCAL_FEATURES)), those that tell of the bit map alone.
        frames: float64 (k, len(FRAME)), of `frontier_frame`, in cells of the bit map.
        touched: int32 (k, barriers, TOUCHED), free cells of the bit map that floods touch.
    """

    cells: Cells
    frontiers: FrontierClusters
    regions: Regions
    homes: Ints
    resolution: float
    bit_map: BitMap
    local_features: Floats32
    frames: Floats
    touched: Ints32


def look_around(
    cells: Cells,
    frontiers: FrontierClusters,
    regions: Regions,
    resolution: float,
    memory: FeatureCache | None = None,
) -> Surroundings:
    """Look at what lies around k >= 1 frontiers.

    Args:
        cells: int8 (rows, cols), what is known.
        frontiers: Their cells.
        regions: The seen rooms of these cells.
        resolution: Metres per cell.
        memory: Of the last decision; makes this one cheaper, and takes away the last one's bit map.
    """
    found = (memory or FeatureCache()).compute(cells, frontiers, regions, resolution)
    return Surroundings(cells, frontiers, regions, home_regions(regions, frontiers), resolution, *found)


def frontier_features(around: Surroundings, visible: Floats) -> Floats32:
    """Features float32 (k, len(FEATURES)) of k frontiers.

    Args:
        around: What lies around them.
        visible: float64 (k,), unknown area in sight of each, in square metres.
    """
    bit_map, frontiers = around.bit_map, around.frontiers
    regions, resolution = around.regions, around.resolution
    out = np.zeros((len(frontiers), len(FEATURES)), np.float32)
    out[:, : len(LOCAL_FEATURES)] = around.local_features
    shape = bit_map.code.shape[1], bit_map.margin
    _contacts(around.touched, *shape, regions.labels, around.homes, out)
    rest = out[:, _REGION_AT:]
    rest[:, _AT.visible] = visible
    rest[:, _AT.known] = math.log(1.0 + _count_free(around.cells) * resolution**2)
    rest[:, _AT.frontiers] = len(frontiers)
    frames = around.frames.copy()
    frames[:, [FRAME.row, FRAME.col]] -= bit_map.margin
    grids, sums = (regions.labels, regions.gaps), (regions.boxes, regions.doors)
    clusters = Clusters(frontiers.cells, frontiers.offsets)
    _region_features(clusters, around.homes, frames, grids, sums, resolution, out)
    return out


@njit(cache=True, nogil=True)
def _count_free(cells: Cells) -> int:
    """The free cells of a grid."""
    count = 0
    for r in range(cells.shape[0]):
        # A row's count by itself, without a branch, so that it compiles to SIMD.
        row, free = cells[r], 0
        for c in range(row.size):
            free += row[np.uint64(c)] == FREE
        count += free
    return count


@njit(cache=True, nogil=True)
def _contacts(touched: Ints32, cols: int, margin: int, labels: Labels, home: Ints, out: Floats32) -> None:
    """Per flood the share of touched free cells in other regions, and the number of these regions."""
    out = out[:, _CONTACTS_AT:_REGION_AT]
    seen = np.zeros(TOUCHED, np.int32)
    for k in range(len(touched)):
        for b in range(touched.shape[1]):
            total, others, count = 0, 0, 0
            for n in range(TOUCHED):
                i = touched[k, b, n]
                if i < 0:
                    break  # -1: no more cells were kept
                total += 1
                label = labels[i // cols - margin, i % cols - margin]
                if label == home[k]:
                    continue
                others += 1
                new = True
                for j in range(count):
                    new = new and seen[j] != label
                if new:
                    seen[count] = label
                    count += 1
            out[k, 2 * b], out[k, 2 * b + 1] = others / max(total, 1), count


@njit(cache=True, nogil=True)
def _region_features(
    clusters: Clusters,
    home: Ints,
    frames: Floats,
    grids: tuple[Labels, Gaps],
    sums: tuple[Ints, Floats],
    resolution: float,
    out: Floats32,
) -> None:
    """The region that holds each frontier, and what finished rooms are like: written to `out` by `_AT`.

    `grids` are the labels and gaps of `Regions`, `sums` their boxes and doors.
    """
    # Cut out here: the columns of one frontier alone are an array of another kind.
    out = out[:, _REGION_AT:]
    (labels, gaps), (boxes, doors), (members, offsets) = grids, sums, clusters
    frontier_cells, waiting = np.zeros(len(boxes), np.int64), np.zeros(len(boxes), np.int64)
    for n in range(len(members)):
        frontier_cells[labels[members[n, 0], members[n, 1]]] += 1
    for k in range(len(home)):
        waiting[home[k]] += 1
    area = resolution**2
    shorter = np.minimum(boxes[:, 3] - boxes[:, 1], boxes[:, 4] - boxes[:, 2]) * resolution
    longer = np.maximum(boxes[:, 3] - boxes[:, 1], boxes[:, 4] - boxes[:, 2]) * resolution
    # A room is finished where no frontier waits in it; less than 2 m2 is no room, and region 0 is none.
    finished = (boxes[:, 0] * area > 2.0) & (waiting == 0)
    finished[0] = False
    for k in range(len(home)):
        region, box, row = home[k], boxes[home[k]], out[k]
        for n in range(offsets[k], offsets[k + 1]):
            width = np.float32(gaps[members[n, 0], members[n, 1]] * resolution)
            row[_AT.door_width] = max(row[_AT.door_width], width)
        row[_AT.region] = box[0] * area
        # The region's box as the frontier sees it: cells from its middle, ahead and to the side.
        middle_row, middle_col = frames[k, FRAME.row], frames[k, FRAME.col]
        for axis, low_at, high_at in (
            (FRAME.forward_row, _AT.ahead_min, _AT.ahead_max),
            (FRAME.side_row, _AT.side_min, _AT.side_max),
        ):
            step_row, step_col = frames[k, axis], frames[k, axis + 1]
            low = (box[1] - middle_row) * step_row + (box[2] - middle_col) * step_col
            high = (box[3] - 1 - middle_row) * step_row + (box[4] - 1 - middle_col) * step_col
            row[low_at], row[high_at] = min(low, high) * resolution, max(low, high) * resolution
        row[_AT.fill] = box[0] / max((box[3] - box[1]) * (box[4] - box[2]), 1)
        row[_AT.region_long], row[_AT.region_short] = longer[region], shorter[region]
        row[_AT.region_frontier] = frontier_cells[region] * resolution
        row[_AT.region_frontiers], row[_AT.region_doors] = waiting[region], doors[region]
    sizes = boxes[:, 0][finished]
    if len(sizes):
        out[:, _AT.finished_room] = _median(sizes) * area
        out[:, _AT.finished_rooms] = len(sizes)
        out[:, _AT.finished_long] = _median(longer[finished])
        out[:, _AT.finished_short] = _median(shorter[finished])


@njit(cache=True, nogil=True)
def _median(values: NDArray[Any]) -> float:
    """The median of numbers (n,), at least one."""
    # Of floats, so that numba's sort, which takes seconds to compile, is compiled for one type.
    ordered = np.sort(values.astype(np.float64))
    half = len(ordered) // 2
    return float(ordered[half] if len(ordered) % 2 else (ordered[half - 1] + ordered[half]) / 2)


def home_regions(regions: Regions, frontiers: FrontierClusters) -> Ints:
    """The region int64 (k,) that holds most cells of each frontier; the lowest of equals."""
    rows, cols = frontiers.cells.T
    return _most_common(regions.labels[rows, cols].astype(np.int64), frontiers.offsets)


@njit(cache=True, nogil=True)
def _most_common(owners: Ints, offsets: Ints) -> Ints:
    """Per group the most common of values from 0 on, the lowest of equals."""
    out = np.zeros(len(offsets) - 1, np.int64)
    most = 0
    for n in range(len(owners)):
        most = max(most, owners[n])
    counts = np.zeros(most + 1, np.int64)
    for k in range(len(out)):
        group, best = owners[offsets[k] : offsets[k + 1]], 0
        for n in range(len(group)):
            counts[group[n]] += 1
        for n in range(len(group)):
            count = counts[group[n]]
            if count > best or (count == best and group[n] < out[k]):
                best, out[k] = count, group[n]
        for n in range(len(group)):
            counts[group[n]] = 0
    return out
