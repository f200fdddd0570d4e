"""Closed doors in a grid: straight edges between free and unknown space that trees tell from walls.

A shut leaf is seen from one side only: a straight, clean line of occupied cells, free in front, unknown
behind. It ends at jambs, where the face of the wall steps forward, or runs on into the wall, where a range
sensor never marks a cell. An opening that nothing marks but that was never looked into is a door too. The
trees are trained by `layoutexplore.training.closed_doors`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from layoutexplore.grids.arrays import Cells, Floats32, Ints, Mask
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN, in_cells

DOOR_FEATURES = (
    *("length", "occupied", "run", "buried", "buried_other", "loose", "loose_other"),
    *("recess", "recess_other", "jamb", "jamb_other", "flat", "flat_other"),
    *("behind", "behind_share", "ahead", "ahead_most", "clean", "rough", "rough_other", "gap", "gap_other"),
)
"""What is known of an edge; see `door_features`."""

WIDTHS = (0.6, 3.4)
"""Narrowest and widest opening in metres."""

_RECESS = 1.0
"""Metres by which a jamb stands before a leaf at most; beyond it the ends are corners of a room."""

_BESIDE, _BEHIND, _AHEAD = 1.0, 3.0, 5.0
"""Metres beside, behind and ahead of an edge that its features tell of."""


@dataclass(frozen=True)
class ClosedDoor:
    """A closed door in a grid turned so that the unknown space lies towards lower rows.

    Attributes:
        row: Row of the leaf.
        start: First column of the leaf.
        stop: Column behind its last one.
        recess: Rows by which the wall's face stands before the leaf, the smaller of both ends.
        recess_other: The larger of both.
        probability: That it is a door and no wall, 0..1.
    """

    row: int
    start: int
    stop: int
    recess: int
    recess_other: int
    probability: float = 1.0


def find_edges(cells: Cells, resolution: float) -> Ints:
    """Find straight edges between free and unknown space that are as wide as doors.

    The next higher row of an edge is free, the next lower one unknown.

    Args:
        cells: int8 (rows, cols), as in `OccupancyGrid`.
        resolution: Metres a cell.

    Returns:
        int64 (n, 3): row, first column, column behind the last.
    """
    free, unknown = cells == FREE, cells == UNKNOWN
    edge = np.zeros((cells.shape[0], cells.shape[1] + 2), np.int8)
    edge[1:-1, 1:-1] = free[2:] & ~free[1:-1] & unknown[:-2]
    step = np.diff(edge, axis=1)
    rows, starts = np.nonzero(step == 1)
    stops = np.nonzero(step == -1)[1]
    length = (stops - starts) * resolution
    kept = (length > WIDTHS[0] - resolution / 2) & (length < WIDTHS[1])
    return np.stack([rows, starts, stops], 1)[kept].astype(np.int64)


def door_features(cells: Cells, resolution: float, edges: Ints) -> Floats32:
    """`DOOR_FEATURES` of edges, float32 (n, features); lengths in metres, shares 0..1.

    Args:
        cells: int8 (rows, cols), as in `OccupancyGrid`.
        resolution: Metres a cell.
        edges: As from `find_edges`.
    """
    pad = round(max(_BEHIND, _AHEAD) / resolution) + in_cells(0.2, resolution)
    padded = np.pad(cells, pad, constant_values=UNKNOWN)
    return np.array([_describe(padded, resolution, *(edge + pad)) for edge in edges], np.float32).reshape(
        -1, len(DOOR_FEATURES)
    )


def is_marked(features: Floats32) -> Mask:
    """Edges that look like doors: shut, and between two jambs or with a line that runs on inside the wall.

    Between two jambs a few holes in the line are no matter.

    Args:
        features: `DOOR_FEATURES`, float32 (n, features).
    """
    known = dict(zip(DOOR_FEATURES, features.T, strict=True))
    niche = (
        (known["recess"] > 0.09)
        & (known["behind"] > 1.0)
        & (known["ahead_most"] > 1.0)
        & (known["length"] < 2.9)
    )
    inside = known["buried"] + known["buried_other"] > 0.09
    shut = known["occupied"]
    return np.asarray((shut > 0.8) & niche | (shut > 0.9) & inside)


def _describe(cells: Cells, resolution: float, row: int, start: int, stop: int) -> list[float]:
    cut = np.s_[row - round(_BEHIND / resolution) : row + round(_AHEAD / resolution)]
    middle = row - cut.start
    occupied, free, unknown = (cells[cut] == value for value in (OCCUPIED, FREE, UNKNOWN))
    beside = round(_BESIDE / resolution)
    line = occupied[middle]
    buried = line & unknown[middle - 1] & unknown[middle + 1]
    loose = line & free[middle - 1] & free[middle + 1]
    edge = free[2:] & ~free[1:-1] & unknown[:-2]
    # Row k of `edge` tells of row k + 1 of the cells.
    one, two, three = (in_cells(metres, resolution) for metres in (0.05, 0.1, 0.15))
    near = edge[middle - 1 - two : middle + two].any(0)
    ends: list[list[float]] = []
    run = stop - start if line[start:stop].mean() > 0.5 else 0
    for columns, jambs in (
        (np.arange(start - 1, start - 1 - beside, -1), range(start - three, start + two)),
        (np.arange(stop, stop + beside), range(stop - one, stop + one + three)),
    ):
        more = int(np.argmin(np.append(line[columns], False))) if run else 0
        run += more
        on = columns[:more]
        reach = round(_RECESS / resolution)
        steps = [_step(occupied[middle + 1 :, c], free[middle + 1 :, c], reach, two) for c in jambs]
        jamb = max(int(occupied[middle + 1 : middle + 1 + 2 * reach, c].sum()) for c in jambs)
        rough = (occupied[middle - three : middle + three + 1, columns].sum() - more) / 3
        gap = _run(~occupied[middle - one : middle + one + 1, columns].any(0))
        beside_share = near[columns].mean() / resolution
        ends.append([buried[on].sum(), loose[on].sum(), max(steps), jamb, beside_share, rough, gap])
    pairs = np.sort(np.array(ends), axis=0).T * resolution
    shut = occupied[middle, start:stop].mean()
    samples = [start + two, (start + stop) // 2, stop - 1 - two]
    behind = min(_run(unknown[:middle, c][::-1]) for c in samples)
    ahead = sorted(_run(free[middle + 2 :, c]) for c in samples)
    share = unknown[middle - beside : middle, start:stop].mean()
    lengths = np.array([stop - start, run]) * resolution
    clean = (stop - start) / max(run, stop - start)
    depths = [behind * resolution, share, ahead[1] * resolution, ahead[2] * resolution]
    return [lengths[0], shut, lengths[1], *pairs[:5].ravel(), *depths, clean, *pairs[5:].ravel()]


def _run(mask: Mask) -> int:
    """Length of the run of true values that a mask begins with."""
    return int(np.argmin(np.append(mask, False)))


def _step(occupied: Mask, free: Mask, reach: int, before: int) -> int:
    """Cells by which a wall's face, free `before` it, stands before a leaf in one column; 0 for none."""
    found = np.flatnonzero(occupied[:reach])
    return int(found[-1]) + 1 if len(found) and free[found[-1] + 1 : found[-1] + 1 + before].any() else 0
