"""Local features of frontiers, kept from one decision to the next where nothing near them changed.

The features are the same with and without those that are kept.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np
from numba import njit

from layoutexplore.frontiers.detection import FrontierClusters
from layoutexplore.grids.arrays import Bytes, Cells, Floats, Floats32, Ints, Ints32
from layoutexplore.grids.boxes import box_around
from layoutexplore.grids.grid import in_cells
from layoutexplore.layout.doorways import Regions
from layoutexplore.predictors.bit_map import ALONG_COLS, ALONG_ROWS, DOOR_BIT, WALL_BIT, BitMap
from layoutexplore.predictors.frontier_model.feature_kernels import (
    AHEAD,
    BESIDE,
    FRAME,
    RAYS,
    TOUCHED,
    FloodScratch,
    cast_rays,
    doors_near,
    flood_sizes,
    flood_unknown,
    frontier_frame,
    walls_in_line,
)
from layoutexplore.predictors.frontier_model.followed_bit_map import BLOCK, FollowedBitMap
from layoutexplore.processes.threads import ByThread

SIGHT = 8.0
"""Metres that rays look; nothing else looks further."""

DEPTHS = (0.3, 0.6, 1.0, 2.0, 3.0, 5.0)
"""Metres behind the frontier at which floods are measured."""

UNIT = 0.5
"""Metres: thickness of the slices in which walls are looked for."""

NEAR_END, NEAR_DOOR = 0.5, 4.0
"""Metres within which a wall at the end of a frontier, and a door, are looked for."""

BARRIERS = {"open": 0, "extended": ALONG_ROWS | ALONG_COLS, "doors": DOOR_BIT}
_SHAPE = ("size", "depth", "width", "slant", "sides", "end_low", "end_high")
_DOORS = ("in_door_share", "door_near", "doors_free_cells", "doors_unknown_cells")
_FLOOD = (*(f"area_{d:g}" for d in DEPTHS), "walls", "free", "barred", "stopped", "ended")
LOCAL_FEATURES: tuple[str, ...] = (
    *_SHAPE,
    *_DOORS,
    *(f"ray{k}_{what}" for k in range(RAYS) for what in ("first", "end", "wall", "unknown")),
    *(f"{barrier}_{what}" for barrier in BARRIERS for what in _FLOOD),
    *(f"ahead{k}_{what}" for what in ("wall", "extended") for k in range(AHEAD)),
    *(f"beside{k}_wall" for k in range(2 * BESIDE)),
)
"""Features that depend on nothing further away than `SIGHT`: shape, doors, rays, floods, walls in line."""

_SHAPE_AT, _DOORS_AT, _RAYS_AT, _FLOODS_AT, _WALLS_AT = (
    LOCAL_FEATURES.index(name)
    for name in (_SHAPE[0], _DOORS[0], "ray0_first", f"open_{_FLOOD[0]}", "ahead0_wall")
)
"""Where each of them begins to write."""


class Lengths(NamedTuple):
    """How far is looked, in cells.

    Attributes:
        sight: Along rays.
        near_end: For walls at the ends of a frontier.
        near_door: For doors.
        unit: Thickness of the slices in which walls are looked for.
        depths: int64 (d,), rising, at which floods are measured.
    """

    sight: int
    near_end: int
    near_door: int
    unit: int
    depths: Ints


class Clusters(NamedTuple):
    """The cells of frontiers int32 (n, 2), and int64 (k + 1,) where in them each frontier begins."""

    members: Ints32
    offsets: Ints


class FeatureCache(ByThread):
    """Keeps the bit map of the last decision, and the local features of its frontiers.

    The next decision may be on a changed grid of the same shape.
    """

    def __init__(self) -> None:
        self._draw = FollowedBitMap()
        self._known: dict[bytes, int] = {}
        self._forget()

    def _forget(self) -> None:
        """Keep a row of zeros: what no frontier was found in before."""
        self._scratch = FloodScratch(np.zeros(0, np.uint8), np.zeros(0, np.int32))
        self._features = np.zeros((1, len(LOCAL_FEATURES)), np.float32)
        self._frames = np.zeros((1, len(FRAME)))
        self._touched = np.zeros((1, len(BARRIERS), TOUCHED), np.int32)

    def compute(
        self, cells: Cells, frontiers: FrontierClusters, regions: Regions, resolution: float
    ) -> tuple[BitMap, Floats32, Floats, Ints32]:
        """Compute the local features of each frontier, or take those that are still valid.

        Returns:
            The bit map, which changes with the next call, the features float32 (k, len(LOCAL_FEATURES)) in
            metres, the frames float64 (k, len(FRAME)) and the free cells that floods touch int32 (k,
            barriers, TOUCHED), in cells of the bit map.
        """
        bit_map, changed = self._draw(cells, regions, resolution, SIGHT + 2 * resolution)
        clusters = Clusters(frontiers.cells + np.int32(bit_map.margin), frontiers.offsets)
        keys = [frontiers.cluster(k).tobytes() for k in range(len(frontiers))]
        old = self._still_valid(changed, keys, clusters, bit_map.margin // BLOCK + 1)
        fresh = np.flatnonzero(old < 0)
        features, frames, touched = self._features[old], self._frames[old], self._touched[old]
        if len(fresh):
            sight, end, door = (round(v / resolution) for v in (SIGHT, NEAR_END, NEAR_DOOR))
            unit, *depths = (in_cells(length, resolution) for length in (UNIT, *DEPTHS))
            lengths = Lengths(sight, end, door, unit, np.array(depths, np.int64))
            barriers = np.array(list(BARRIERS.values()), np.int64)
            found = np.zeros((len(fresh), len(LOCAL_FEATURES)), np.float32)
            self._make_room(clusters, fresh, int(depths[-1]), bit_map.code.shape[1])
            frames[fresh], touched[fresh] = compute_local_features(
                bit_map.code, clusters, fresh, lengths, barriers, self._scratch, found
            )
            _scale(found, resolution)
            features[fresh] = found
        self._features, self._frames, self._touched = features, frames, touched
        self._known = {key: k for k, key in enumerate(keys)}
        return bit_map, features, frames, touched

    def _make_room(self, clusters: Clusters, fresh: Ints, depth: int, cols: int) -> None:
        """Have scratch memory for the floods of some frontiers."""
        span, cells = flood_sizes(clusters.members, clusters.offsets, fresh, depth, cols)
        if span > len(self._scratch.taken):
            self._scratch = self._scratch._replace(taken=np.zeros(span, np.uint8))
        if cells > len(self._scratch.queue):
            self._scratch = self._scratch._replace(queue=np.empty(cells, np.int32))

    def _still_valid(
        self, changed: Bytes | None, keys: Sequence[bytes], clusters: Clusters, reach: int
    ) -> Ints:
        """Per frontier int64 (k,) where it was found the last time with the same surroundings, or -1.

        These reach so many blocks. The changed blocks are None where the grid is another one.
        """
        if changed is None:
            self._forget()
            return np.full(len(keys), -1, np.int64)
        old = np.array([self._known.get(key, -1) for key in keys], np.int64)
        _forget_changed(np.asarray(cv2.integral(changed), np.int32), clusters, reach, old)
        return old


@njit(cache=True, nogil=True)
def _forget_changed(changes: Ints32, clusters: Clusters, reach: int, old: Ints) -> None:
    """Set to -1 what has a changed block within `reach` blocks."""
    for k in range(len(old)):
        if old[k] < 0:
            continue
        cells = clusters.members[clusters.offsets[k] : clusters.offsets[k + 1]]
        top, bottom, left, right = box_around(cells)
        # A half-open box of blocks; the sums hold one row and column more than there are blocks.
        r0, r1 = max(top // BLOCK - reach, 0), min((bottom - 1) // BLOCK + reach + 1, changes.shape[0] - 1)
        c0, c1 = max(left // BLOCK - reach, 0), min((right - 1) // BLOCK + reach + 1, changes.shape[1] - 1)
        if changes[r1, c1] - changes[r0, c1] - changes[r1, c0] + changes[r0, c0] > 0:
            old[k] = -1


@njit(cache=True, nogil=True)
def compute_local_features(
    code: Bytes,
    clusters: Clusters,
    wanted: Ints,
    lengths: Lengths,
    barriers: Ints,
    scratch: FloodScratch,
    out: Floats32,
) -> tuple[Floats, Ints32]:
    """Compute `LOCAL_FEATURES` of the wanted frontiers, in cells, into `out` float32 (wanted, features).

    Returns the frames float64 (wanted, len(FRAME)) and the free cells that floods touch int32 (wanted,
    barriers, TOUCHED).
    """
    frames = np.zeros((len(wanted), len(FRAME)))
    touched = np.empty((len(wanted), len(barriers), TOUCHED), np.int32)
    flood = len(lengths.depths) + 5
    for n in range(len(wanted)):
        k = wanted[n]
        cluster = clusters.members[clusters.offsets[k] : clusters.offsets[k + 1]]
        frame = frontier_frame(code, cluster)
        for j in range(len(frame)):
            frames[n, j] = frame[j]
        _shape(code, cluster, frame, lengths.near_end, out[n, _SHAPE_AT:])
        doors_near(code, cluster, frame, lengths.near_door, out[n, _DOORS_AT:])
        cast_rays(code, frame, lengths.sight, out[n, _RAYS_AT:])
        met = 255
        for b in range(len(barriers)):
            at = _FLOODS_AT + b * flood
            # The first flood, which nothing bars, tells whether a barrier is met at all: where it is not, the
            # flood with this barrier would find the same.
            if b > 0 and not met & barriers[b]:
                for j in range(flood):
                    out[n, at + j] = out[n, _FLOODS_AT + j]
                for j in range(TOUCHED):
                    touched[n, b, j] = touched[n, 0, j]
                continue
            found = out[n, at:]
            bits = flood_unknown(code, barriers[b], cluster, lengths.depths, scratch, found, touched[n, b])
            met = bits if b == 0 else met
        walls_in_line(code, frame, lengths.unit, out[n, _WALLS_AT:])
    return frames, touched


@njit(cache=True, nogil=True)
def _shape(code: Bytes, cluster: Ints32, frame: Floats, near: int, out: Floats32) -> None:
    """Size, extents, slant, sides, and the distance to a wall from the ends on either side."""
    # In the order of `_SHAPE`.
    nearest_ahead = left = np.inf
    farthest_ahead = right = -np.inf
    leftmost = rightmost = 0
    for n in range(len(cluster)):
        ahead = cluster[n, 0] * frame[FRAME.forward_row] + cluster[n, 1] * frame[FRAME.forward_col]
        side = cluster[n, 0] * frame[FRAME.side_row] + cluster[n, 1] * frame[FRAME.side_col]
        nearest_ahead, farthest_ahead = min(nearest_ahead, ahead), max(farthest_ahead, ahead)
        if side < left:
            left, leftmost = side, n
        if side > right:
            right, rightmost = side, n
    out[0], out[1], out[2] = len(cluster), farthest_ahead - nearest_ahead + 1, right - left + 1
    out[3], out[4] = frame[FRAME.slant], frame[FRAME.sides]
    for end in range(2):
        row, col = cluster[leftmost if end == 0 else rightmost]
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
        for name in LOCAL_FEATURES
    ]
)  # fmt: skip


def _scale(out: Floats32, resolution: float) -> None:
    """From cells to metres and square metres."""
    out *= np.float32(resolution) ** _FACTORS.astype(np.float32)
