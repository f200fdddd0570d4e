"""What is known of a frontier's surroundings, as numbers for the trees that judge it.

Most of the numbers depend on nothing that is further away than `SIGHT`; a `FeatureCache` keeps those of
frontiers around which nothing has changed since the last decision. They are the same with and without it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.frontiers.detection import FrontierClusters
from layoutexplore.grids.grid import FREE
from layoutexplore.predictors.bit_map import ALONG_COLS, ALONG_ROWS, DOOR_BIT, WALL_BIT, BitMap, draw_bit_map
from layoutexplore.predictors.frontier_model.feature_kernels import (
    AHEAD,
    BESIDE,
    RAYS,
    TOUCHED,
    cast_rays,
    doors_near,
    flood_unknown,
    frontier_frame,
    walls_in_line,
)
from layoutexplore.predictors.seen_rooms import Regions, home_regions

SIGHT = 8.0
"""Metres that rays look; nothing else looks further."""

DEPTHS = (0.3, 0.6, 1.0, 2.0, 3.0, 5.0)
"""Metres behind the frontier at which floods are measured."""

UNIT = 0.5
"""Metres: thickness of the slices in which walls are looked for."""

NEAR_END, NEAR_DOOR = 0.5, 4.0
"""Metres within which a wall at the end of a frontier, and a door, are looked for."""

BLOCK = 8
"""Cells of a square in which changes are noticed together."""

_BARRIERS = {"open": 0, "extended": ALONG_ROWS | ALONG_COLS, "doors": DOOR_BIT}
_SHAPE = ("size", "depth", "width", "slant", "sides", "end_low", "end_high")
_DOORS = ("in_door_share", "door_near", "doors_free_cells", "doors_unknown_cells")
_FLOOD = (*(f"area_{d:g}" for d in DEPTHS), "walls", "free", "barred", "stopped", "ended")
_PROBES: tuple[str, ...] = (
    *_SHAPE,
    *_DOORS,
    *(f"ray{k}_{what}" for k in range(RAYS) for what in ("first", "end", "wall", "unknown")),
    *(f"{barrier}_{what}" for barrier in _BARRIERS for what in _FLOOD),
    *(f"ahead{k}_{what}" for what in ("wall", "extended") for k in range(AHEAD)),
    *(f"beside{k}_wall" for k in range(2 * BESIDE)),
)
_CONTACTS = tuple(f"{barrier}_{what}" for barrier in _BARRIERS for what in ("other_share", "other_rooms"))
_REGION = ("visible", "known", "frontiers", "door_width", "region", "ahead_min", "ahead_max", "side_min", "side_max", "fill",
           "region_long", "region_short", "region_frontier", "region_frontiers", "region_doors", "finished_room",
           "finished_rooms", "finished_long", "finished_short")  # fmt: skip

FEATURES: tuple[str, ...] = (*_PROBES, *_CONTACTS, *_REGION)
"""Names of the features, in their order. Lengths are metres, areas square metres."""


class FeatureCache:
    """What was found around the frontiers of the last decision, for a run on one grid after another of the same shape."""

    def __init__(self) -> None:
        self._chart: BitMap | None = None
        self._resolution = 0.0
        self._known: dict[bytes, int] = {}
        self._probes = np.zeros((0, len(_PROBES)), np.float32)
        self._frames = np.zeros((0, 8))
        self._touched = np.zeros((0, len(_BARRIERS), TOUCHED), np.int32)
        self._stamp, self._queue = np.zeros(0, np.int32), np.zeros(0, np.int32)
        self._mark = 0

    def probe(
        self, chart: BitMap, frontiers: FrontierClusters, resolution: float
    ) -> tuple[NDArray[np.float32], NDArray[np.float64], NDArray[np.int32]]:
        """What is found around each frontier.

        Returns:
            The probes float32 (k, len(_PROBES)) in metres, the frames float64 (k, 8) and the free cells that
            floods touch int32 (k, barriers, TOUCHED), in cells of the chart.
        """
        members, offsets = frontiers.cells + np.int32(chart.margin), frontiers.offsets
        keys = [frontiers.cluster(k).tobytes() for k in range(len(frontiers))]
        old = self._still_valid(chart, keys, members, offsets, resolution)
        fresh = np.flatnonzero(old < 0)
        probes, frames, touched = self._probes[old], self._frames[old], self._touched[old]
        if len(fresh):
            depths = np.array([max(round(d / resolution), 1) for d in DEPTHS], np.int64)
            lengths = np.array([round(v / resolution) for v in (SIGHT, NEAR_END, NEAR_DOOR, UNIT)], np.int64)
            barriers = np.array(list(_BARRIERS.values()), np.int64)
            found = np.zeros((len(fresh), len(_PROBES)), np.float32)
            if self._mark > 2**31 - 4 * len(fresh) - 4:
                self._stamp[:], self._mark = 0, 0
            args = (depths, lengths, barriers, self._stamp, self._mark, self._queue)
            frames[fresh], touched[fresh] = _probe(chart.code, members, offsets, fresh, *args, found)
            self._mark += len(barriers) * len(fresh)
            _scale(found, resolution)
            probes[fresh] = found
        self._probes, self._frames, self._touched = probes, frames, touched
        self._chart, self._resolution, self._known = chart, resolution, {key: k for k, key in enumerate(keys)}
        return probes, frames, touched

    def _still_valid(
        self,
        chart: BitMap,
        keys: Sequence[bytes],
        members: NDArray[np.int32],
        offsets: NDArray[np.int64],
        resolution: float,
    ) -> NDArray[np.int64]:
        """Per frontier int64 (k,) where it was found the last time with the same surroundings, or -1."""
        if (
            self._chart is None
            or self._chart.code.shape != chart.code.shape
            or self._resolution != resolution
        ):
            self._stamp, self._queue = (
                np.zeros(chart.code.size, np.int32),
                np.empty(chart.code.size, np.int32),
            )
            self._probes, self._frames = np.zeros((1, len(_PROBES)), np.float32), np.zeros((1, 8))
            self._touched, self._mark = np.zeros((1, len(_BARRIERS), TOUCHED), np.int32), 0
            return np.full(len(keys), -1, np.int64)
        old = np.array([self._known.get(key, -1) for key in keys], np.int64)
        changes = np.asarray(cv2.integral(_changed_blocks(self._chart.code, chart.code)), np.int32)
        _forget_changed(changes, members, offsets, chart.margin // BLOCK + 1, old)
        return old


@njit(cache=True, nogil=True)
def _changed_blocks(before: NDArray[np.uint8], after: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Not 0 in squares that hold a cell that differs."""
    changed = np.zeros(((before.shape[0] - 1) // BLOCK + 1, (before.shape[1] - 1) // BLOCK + 1), np.uint8)
    for r in range(before.shape[0]):
        old, new, row = before[r], after[r], changed[r // BLOCK]
        for k in range(old.size // BLOCK):
            differ = np.uint8(0)
            for c in range(BLOCK):
                differ |= old[np.uint64(BLOCK * k + c)] ^ new[np.uint64(BLOCK * k + c)]
            row[np.uint64(k)] |= differ
        for c in range(old.size // BLOCK * BLOCK, old.size):
            row[-1] |= old[c] ^ new[c]
    return changed


@njit(cache=True, nogil=True)
def _forget_changed(
    changes: NDArray[np.int32],
    members: NDArray[np.int32],
    offsets: NDArray[np.int64],
    reach: int,
    old: NDArray[np.int64],
) -> None:
    """Set to -1 what has a changed square within `reach` squares."""
    for k in range(len(old)):
        if old[k] < 0:
            continue
        rows, cols = members[offsets[k] : offsets[k + 1], 0], members[offsets[k] : offsets[k + 1], 1]
        r0, r1 = (
            max(rows.min() // BLOCK - reach, 0),
            min(rows.max() // BLOCK + reach + 1, changes.shape[0] - 1),
        )
        c0, c1 = (
            max(cols.min() // BLOCK - reach, 0),
            min(cols.max() // BLOCK + reach + 1, changes.shape[1] - 1),
        )
        if changes[r1, c1] - changes[r0, c1] - changes[r1, c0] + changes[r0, c0] > 0:
            old[k] = -1


@dataclass(frozen=True, eq=False)
class Surroundings:
    """What lies around k >= 1 frontiers.

    Attributes:
        cells: int8 (rows, cols), what is known.
        frontiers: Their cells.
        regions: The seen rooms of these cells.
        homes: int64 (k,), of `home_regions`.
        resolution: Metres per cell.
        chart: What is known, drawn for probing.
        probes: float32 (k, probes), the features that tell of the chart alone.
        frames: float64 (k, 8), of `frontier_frame`, in cells of the chart.
        touched: int32 (k, barriers, TOUCHED), free cells of the chart that floods touch.
    """

    cells: NDArray[np.int8]
    frontiers: FrontierClusters
    regions: Regions
    homes: NDArray[np.int64]
    resolution: float
    chart: BitMap
    probes: NDArray[np.float32]
    frames: NDArray[np.float64]
    touched: NDArray[np.int32]


def look_around(
    cells: NDArray[np.int8],
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
        memory: Of the last decision; makes this one cheaper.
    """
    chart = draw_bit_map(cells, regions, resolution, SIGHT + 2 * resolution)
    found = (memory or FeatureCache()).probe(chart, frontiers, resolution)
    return Surroundings(
        cells, frontiers, regions, home_regions(regions, frontiers), resolution, chart, *found
    )


def frontier_features(around: Surroundings, visible: NDArray[np.float64]) -> NDArray[np.float32]:
    """Features float32 (k, len(FEATURES)) of k frontiers.

    Args:
        around: What lies around them.
        visible: float64 (k,), unknown area in sight of each, in square metres.
    """
    chart, frontiers, regions, resolution = around.chart, around.frontiers, around.regions, around.resolution
    out = np.zeros((len(frontiers), len(FEATURES)), np.float32)
    out[:, : len(_PROBES)] = around.probes
    shape = chart.code.shape[1], chart.margin
    _contacts(around.touched, *shape, regions.labels, around.homes, out[:, len(_PROBES) : -len(_REGION)])
    rest = out[:, -len(_REGION) :]
    rest[:, 0] = visible
    rest[:, 1] = math.log(1.0 + np.count_nonzero(around.cells == FREE) * resolution**2)
    rest[:, 2] = len(frontiers)
    frames = around.frames - np.array([chart.margin] * 2 + [0] * 6)
    grids, sums = (regions.labels, regions.door_width), (regions.boxes, regions.doors)
    _region_features(
        frontiers.cells, frontiers.offsets, around.homes, frames, grids, sums, resolution, rest[:, 3:]
    )
    return out


@njit(cache=True, nogil=True)
def _probe(
    code: NDArray[np.uint8],
    members: NDArray[np.int32],
    offsets: NDArray[np.int64],
    wanted: NDArray[np.int64],
    depths: NDArray[np.int64],
    lengths: NDArray[np.int64],
    barriers: NDArray[np.int64],
    stamp: NDArray[np.int32],
    mark: int,
    queue: NDArray[np.int32],
    out: NDArray[np.float32],
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Probe the wanted frontiers, in cells; returns their frames float64 (k, 8) and what their floods touch."""
    frames = np.zeros((len(wanted), 8))
    touched = np.empty((len(wanted), len(barriers), TOUCHED), np.int32)
    flood = len(depths) + 5
    for n in range(len(wanted)):
        k = wanted[n]
        cluster = members[offsets[k] : offsets[k + 1]]
        frame = frontier_frame(code, cluster)
        frames[n] = frame
        _shape(code, cluster, frame, lengths[1], out[n])
        at = 7
        doors_near(code, cluster, frame, lengths[2], out[n, at:])
        at += 4
        cast_rays(code, frame, lengths[0], out[n, at:])
        at += 4 * RAYS
        met = 255
        for b in range(len(barriers)):
            if b > 0 and not met & barriers[b]:
                # The first flood, which nothing bars, met no cell of this barrier: this one would be the
                # same.
                out[n, at : at + flood], touched[n, b] = (
                    out[n, at - b * flood : at - (b - 1) * flood],
                    touched[n, 0],
                )
            else:
                mark += 1
                bits = flood_unknown(
                    code, barriers[b], cluster, depths, stamp, mark, queue, out[n, at:], touched[n, b]
                )
                met = bits if b == 0 else met
            at += flood
        walls_in_line(code, frame, lengths[3], out[n, at:])
    return frames, touched


@njit(cache=True, nogil=True)
def _shape(
    code: NDArray[np.uint8],
    cluster: NDArray[np.int32],
    frame: NDArray[np.float64],
    near: int,
    out: NDArray[np.float32],
) -> None:
    """Size, extents, slant, sides, and the distance to a wall from the ends on either side."""
    ahead = cluster[:, 0] * frame[2] + cluster[:, 1] * frame[3]
    side = cluster[:, 0] * frame[4] + cluster[:, 1] * frame[5]
    out[0], out[1], out[2] = len(cluster), ahead.max() - ahead.min() + 1, side.max() - side.min() + 1
    out[3], out[4] = frame[6], frame[7]
    for end in range(2):
        row, col = cluster[np.argmin(side) if end == 0 else np.argmax(side)]
        nearest = 2 * near
        for dr in range(-near, near + 1):
            for dc in range(-near, near + 1):
                if code[row + dr, col + dc] & WALL_BIT:
                    nearest = min(nearest, max(abs(dr), abs(dc)))
        out[5 + end] = nearest


_FACTORS = np.array(
    [
        2 if "_area_" in name or name.endswith("_cells")
        else 0 if name == "slant" or name.endswith(("_end", "_stopped", "_ended", "_share"))
        else 1
        for name in _PROBES
    ]
)  # fmt: skip


def _scale(out: NDArray[np.float32], resolution: float) -> None:
    """From cells to metres and square metres."""
    out *= np.float32(resolution) ** _FACTORS.astype(np.float32)


@njit(cache=True, nogil=True)
def _contacts(
    touched: NDArray[np.int32],
    cols: int,
    margin: int,
    labels: NDArray[np.int32],
    home: NDArray[np.int64],
    out: NDArray[np.float32],
) -> None:
    """Per flood the share of the touched free cells that lie in other regions than the frontier's, and how many these are."""
    seen = np.zeros(TOUCHED, np.int32)
    for k in range(len(touched)):
        for b in range(touched.shape[1]):
            total, others, count = 0, 0, 0
            for n in range(TOUCHED):
                i = touched[k, b, n]
                if i < 0:
                    break
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
    members: NDArray[np.int32],
    offsets: NDArray[np.int64],
    home: NDArray[np.int64],
    frames: NDArray[np.float64],
    grids: tuple[NDArray[np.int32], NDArray[np.float32]],
    sums: tuple[NDArray[np.int64], NDArray[np.float64]],
    resolution: float,
    out: NDArray[np.float32],
) -> None:
    """The region that holds each frontier, and what finished rooms are like: written to `out` float32 (k, 16).

    `grids` are the labels and door widths of `Regions`, `sums` their boxes and doors.
    """
    (labels, door_width), (boxes, doors) = grids, sums
    frontier_cells, waiting = np.zeros(len(boxes), np.int64), np.zeros(len(boxes), np.int64)
    for n in range(len(members)):
        frontier_cells[labels[members[n, 0], members[n, 1]]] += 1
    for k in range(len(home)):
        waiting[home[k]] += 1
    area = resolution**2
    shorter = np.minimum(boxes[:, 3] - boxes[:, 1], boxes[:, 4] - boxes[:, 2]) * resolution
    longer = np.maximum(boxes[:, 3] - boxes[:, 1], boxes[:, 4] - boxes[:, 2]) * resolution
    finished = (boxes[:, 0] * area > 2.0) & (waiting == 0)
    finished[0] = False
    typical = np.zeros(4)
    if finished.any():
        typical[0], typical[1] = np.median(boxes[finished, 0]) * area, np.count_nonzero(finished)
        typical[2], typical[3] = np.median(longer[finished]), np.median(shorter[finished])
    for k in range(len(home)):
        region, box = home[k], boxes[home[k]]
        for n in range(offsets[k], offsets[k + 1]):
            out[k, 0] = max(out[k, 0], door_width[members[n, 0], members[n, 1]])
        out[k, 1] = box[0] * area
        for axis in range(2):
            step_row, step_col = frames[k, 2 + 2 * axis], frames[k, 3 + 2 * axis]
            low = (box[1] - frames[k, 0]) * step_row + (box[2] - frames[k, 1]) * step_col
            high = (box[3] - 1 - frames[k, 0]) * step_row + (box[4] - 1 - frames[k, 1]) * step_col
            out[k, 2 + 2 * axis], out[k, 3 + 2 * axis] = (
                min(low, high) * resolution,
                max(low, high) * resolution,
            )
        out[k, 6] = box[0] / max((box[3] - box[1]) * (box[4] - box[2]), 1)
        out[k, 7], out[k, 8], out[k, 9] = longer[region], shorter[region], frontier_cells[region] * resolution
        out[k, 10], out[k, 11] = waiting[region], doors[region]
        out[k, 12:] = typical
