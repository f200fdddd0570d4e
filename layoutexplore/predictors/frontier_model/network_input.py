"""Egocentric crops: the surroundings of a frontier as planes, turned so that the unknown is ahead.

A bit map's margin is wider than a crop reaches, so that nothing tells where the array ends: beyond it all is
unknown.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from layoutexplore.grids.arrays import ZERO, Bytes, Floats, Ints, Ints32, Labels, Mask
from layoutexplore.predictors.bit_map import ALONG_COLS, ALONG_ROWS, DOOR_BIT, FREE_BIT, UNKNOWN_BIT, WALL_BIT
from layoutexplore.predictors.frontier_model.feature_cache import Clusters
from layoutexplore.predictors.frontier_model.feature_kernels import FRAME
from layoutexplore.predictors.frontier_model.features import Surroundings

CROP_CELL = 0.3
"""Metres: side of a cell of a crop."""

SIDE = 32
"""Side of a crop, in steps of `CROP_CELL`."""

BEHIND = 10
"""Steps of it that lie behind the middle of the frontier; half of all lie to either side."""

_BITS = np.array([FREE_BIT, WALL_BIT, UNKNOWN_BIT, DOOR_BIT, ALONG_ROWS, ALONG_COLS], np.uint8)

_ALONG_ROWS, _ALONG_COLS, _HOME, _OTHER, _OWN_CELLS, _FRONTIER_CELLS = range(len(_BITS) - 2, len(_BITS) + 4)
"""Where the planes of continued walls, of regions and of frontier cells stand."""

PLANES = len(_BITS) + 4
"""Planes of a crop.

Shares of a cell that have a bit of a `BitMap` (continued walls: across the path ahead, then along it), that
are of the frontier's region and of other regions; whether it holds grid cells of the frontier, and of any.
"""


_WIDTH = 10
"""Bits in which grid cells with a bit of a bit map are counted, side by side in one number."""

_COUNTERS = np.zeros(int(_BITS.sum()) + 1, np.int64)
for _code in range(len(_COUNTERS)):
    _COUNTERS[_code] = sum(1 << _WIDTH * k for k, bit in enumerate(_BITS.tolist()) if _code & bit)

_MOST_CELLS = 31
"""So many are counted along either side of a crop's cell, lest the counters overflow."""

ROOM_BEHIND, OTHER_ROOM, DOORWAY, SOLID, KNOWN = range(5)
"""Classes of `draw_truth`: floor of the room behind the frontier, of another, of none, no floor, known."""


def draw_crops(around: Surroundings, wanted: Ints | None = None) -> Bytes:
    """The crops uint8 (k, SIDE, SIDE, PLANES) of k frontiers.

    Rows go from behind to ahead, columns from one side to the other.

    Args:
        around: What lies around frontiers.
        wanted: int64 (k,), which of them; all when None.
    """
    bit_map, frontiers = around.bit_map, around.frontiers
    which = np.arange(len(frontiers)) if wanted is None else wanted
    members = frontiers.cells + np.int32(bit_map.margin)
    out = np.zeros((len(which), SIDE, SIDE, PLANES), np.uint8)
    grids = bit_map.code, bit_map.margin, around.regions.labels
    clusters = Clusters(members, frontiers.offsets)
    ahead, aside = _bounds(BEHIND, around.resolution), _bounds(SIDE // 2, around.resolution)
    _draw(grids, clusters, which, around.frames, around.homes, ahead, aside, out)
    return out


def draw_truth(around: Surroundings, behind: Ints32, room_ids: Labels, free: Mask) -> Bytes:
    """What the unknown in the crops of k frontiers is in truth: uint8 (k, SIDE, SIDE).

    The grid cell in the middle of a crop's cell decides.

    Args:
        around: What lies around frontiers.
        behind: int32 (k,), the true room behind each frontier, 0 for none.
        room_ids: int32 (rows, cols), the true room of each cell, 0 for none.
        free: bool (rows, cols), true floor.
    """
    margin, code = around.bit_map.margin, around.bit_map.code
    rooms = np.pad(np.where(free, room_ids, np.int32(-1)), margin, constant_values=-1)
    ahead, aside = _bounds(BEHIND, around.resolution), _bounds(SIDE // 2, around.resolution)
    i, j = (((bounds[:-1] + bounds[1:] - 1) // 2) for bounds in (ahead, aside))
    out = np.empty((len(behind), SIDE, SIDE), np.uint8)
    for k, frame in enumerate(around.frames.astype(np.int64)):
        row = frame[FRAME.row] + i[:, None] * frame[FRAME.forward_row] + j * frame[FRAME.side_row]
        col = frame[FRAME.col] + i[:, None] * frame[FRAME.forward_col] + j * frame[FRAME.side_col]
        at = row, col
        room, unknown = rooms[at], code[at] & UNKNOWN_BIT > 0
        is_behind = (room == behind[k]) & (room > 0)
        out[k] = np.select(
            [~unknown, room < 0, room == 0, is_behind], [KNOWN, SOLID, DOORWAY, ROOM_BEHIND], OTHER_ROOM
        )
    return out


def _bounds(before: int, resolution: float) -> Ints:
    """First grid cell int64 (SIDE + 1,) of each cell of a crop along one side.

    So many come before the one with grid cell 0 in its middle.
    """
    edges = (np.arange(SIDE + 1) - 0.5 - before) * CROP_CELL / resolution
    # Edges between grid cells are not exact numbers.
    return np.asarray(np.floor(edges + 0.5 + 1e-6), np.int64)


@njit(cache=True, nogil=True)
def _draw(
    grids: tuple[Bytes, int, Labels],
    clusters: Clusters,
    wanted: Ints,
    frames: Floats,
    homes: Ints,
    ahead: Ints,
    aside: Ints,
    out: Bytes,
) -> None:
    """Draw the wanted frontiers' crops.

    `ahead` and `aside` are the first grid cells of a crop's cells in the frontier's frame; `grids` are a bit
    map's code and margin, and the labels of regions.
    """
    (code, margin, labels), (members, offsets) = grids, clusters
    rows, cols = _crop_cell_of(ahead), _crop_cell_of(aside)
    flat = code.ravel(), labels.ravel()
    for at in range(len(wanted)):
        k = wanted[at]
        frame = frames[k].astype(np.int64)
        row, col = frame[FRAME.row], frame[FRAME.col]
        forward_row, forward_col = frame[FRAME.forward_row], frame[FRAME.forward_col]
        side_row, side_col = frame[FRAME.side_row], frame[FRAME.side_col]
        # Steps in flat cells of the bit map, which has a margin, and of the labels.
        width, inner = code.shape[1], labels.shape[1]
        first = row * width + col, (row - margin) * inner + col - margin
        forward = forward_row * width + forward_col, forward_row * inner + forward_col
        sideways = side_row * width + side_col, side_row * inner + side_col
        crop = out[at]
        _draw_crop(flat, first, forward, sideways, homes[k], ahead, aside, crop)
        if forward_row == 0:  # The path ahead runs along a row.
            for a in range(SIDE):
                for s in range(SIDE):
                    across, along = crop[a, s, _ALONG_ROWS], crop[a, s, _ALONG_COLS]
                    crop[a, s, _ALONG_ROWS], crop[a, s, _ALONG_COLS] = along, across
        for n in range(len(members)):
            r, c = members[n, 0] - row, members[n, 1] - col
            i = r * forward_row + c * forward_col - ahead[0]
            j = r * side_row + c * side_col - aside[0]
            if 0 <= i < len(rows) and 0 <= j < len(cols):
                crop[rows[i], cols[j], _FRONTIER_CELLS] = 255
                if offsets[k] <= n < offsets[k + 1]:
                    crop[rows[i], cols[j], _OWN_CELLS] = 255


@njit(cache=True, nogil=True)
def _crop_cell_of(bounds: Ints) -> Ints:
    """The crop's cell of each grid cell from the first bound up to the last."""
    found = np.zeros(bounds[-1] - bounds[0], np.int64)
    for k in range(len(bounds) - 1):
        found[bounds[k] - bounds[0] : bounds[k + 1] - bounds[0]] = k
    return found


@njit(cache=True, nogil=True)
def _draw_crop(
    flat: tuple[Bytes, Labels],
    first: tuple[int, int],
    forward: tuple[int, int],
    sideways: tuple[int, int],
    home: int,
    ahead: Ints,
    aside: Ints,
    out: Bytes,
) -> None:
    """Count the grid cells of each cell of a crop; one that is smaller than a grid cell has one.

    `flat` are a bit map's code and the labels of regions; `first` is where the middle of the frontier lies in
    either, and `forward` and `sideways` are what lies between there and the next cells.
    """
    (code, labels), squares = flat, out.reshape(SIDE * SIDE, PLANES)
    for a in range(SIDE):
        # Where a cell has more grid cells than a counter holds, only every n-th is counted.
        step_ahead = (ahead[a + 1] - ahead[a]) // (_MOST_CELLS + 1) + 1
        for s in range(SIDE):
            step_aside = (aside[s + 1] - aside[s]) // (_MOST_CELLS + 1) + 1
            counts = total = mine = others = ZERO
            for i in range(ahead[a], max(ahead[a + 1], ahead[a] + 1), step_ahead):
                for j in range(aside[s], max(aside[s + 1], aside[s] + 1), step_aside):
                    # Six counters of `_WIDTH` bits in one number: no carry, for a cell has fewer grid cells.
                    bits = code[np.uint64(first[0] + i * forward[0] + j * sideways[0])]
                    counts += _COUNTERS[bits]
                    total += 1
                    if bits & FREE_BIT:
                        is_home = labels[np.uint64(first[1] + i * forward[1] + j * sideways[1])] == home
                        mine += is_home
                        others += not is_home
            at = np.uint64(a * SIDE + s)
            for b in range(len(_BITS)):
                squares[at, np.uint64(b)] = _share(counts & (1 << _WIDTH) - 1, total)
                counts >>= _WIDTH
            squares[at, np.uint64(_HOME)] = _share(mine, total)
            squares[at, np.uint64(_OTHER)] = _share(others, total)


@njit(cache=True, nogil=True)
def _share(count: int, total: int) -> int:
    """A share times 255."""
    if count == 0:
        return 0
    return 255 if count == total else (255 * count + total // 2) // total
