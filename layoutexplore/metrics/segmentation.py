"""How well segments fit the true rooms: the measures of the room segmentation literature, in cells.

With S the segments (their free cells), G the true rooms and O their overlaps (Bormann et al. 2016; ROSE2 and
IAS-15, section IV):

- precision: mean over s of max_g O / |s|; recall: mean over g of max_s O / |g|;
- iou_s: mean over s of the IoU with the room of largest overlap (of several, the largest IoU); iou_g the same
  from the rooms to the segments;
- one_to_one: sum of IoU over the best one-to-one matching, divided by max(#S, #G): it forgives neither over-
  nor under-segmentation;
- a_fc, a_bc: the same overlaps as precision and recall, pooled by area (forward and backward coverage).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from layoutexplore.errors import ConfigError, MapError, checks_arguments, shortened
from layoutexplore.metrics.overlaps import shared_cells

PROTOCOLS: dict[str, int] = {"rose2": 0, "bormann": 100}
"""Segments and rooms of at most so many cells are dropped, by protocol."""


_MOST_IDS = 1000
"""Highest id of a segment or room by which a table is indexed."""

MEASURES = ("precision", "recall", "iou_s", "iou_g", "one_to_one", "a_fc", "a_bc")
"""The measures, in the order of the tables."""

HEADINGS = dict(zip(MEASURES, ("P", "R", "IoU_s", "IoU_g", "1-1", "A_FC", "A_BC"), strict=True))
"""Names of the measures in tables."""


@dataclass(frozen=True, kw_only=True)
class SegmentationScores:
    """Measures in 0..1 and the number of segments and rooms they are taken over."""

    precision: float
    recall: float
    iou_s: float
    iou_g: float
    one_to_one: float
    a_fc: float
    a_bc: float
    segments: int
    rooms: int


@checks_arguments
def score_segmentation(
    predicted: NDArray[np.integer[Any]],
    truth: NDArray[np.integer[Any]],
    free: NDArray[np.bool_],
    *,
    protocol: str = "rose2",
) -> SegmentationScores:
    """Compare the free cells of a segmentation with the true rooms.

    Args:
        predicted: int (rows, cols), segment of each cell, 0 for none.
        truth: int (rows, cols), true room of each cell, 0 for none. A room counts whole, with what is not
            free in it (the footprint of furniture), as in the published tables.
        free: bool (rows, cols), the cells on which a segment counts. Free cells that no room claims are not a
            room, but a segment that claims them pays for it.
        protocol: One of `PROTOCOLS`.

    Raises:
        MapError: The arrays differ in shape, or a segment that counts or a room is below 0.
        ConfigError: No such protocol.

    Example:
        >>> truth = np.array([[1, 1, 1, 1, 2, 2]])
        >>> scores = score_segmentation(np.array([[1, 1, 2, 2, 2, 2]]), truth, truth > 0)
        >>> scores.precision, scores.recall, scores.one_to_one
        (0.75, 0.75, 0.5)
    """
    if protocol not in PROTOCOLS:
        raise ConfigError(f"unknown protocol {shortened(protocol)}: known are {', '.join(PROTOCOLS)}")
    if not predicted.shape == truth.shape == free.shape:
        raise MapError(f"segments {predicted.shape}, truth {truth.shape} and map {free.shape} differ in size")
    found = np.where(free, predicted, 0)
    return scores_of_overlaps(*overlap_table(found.ravel(), truth.ravel(), min_cells=PROTOCOLS[protocol]))


@checks_arguments
def overlap_table(
    predicted: NDArray[np.integer[Any]], truth: NDArray[np.integer[Any]], *, min_cells: int = 0
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Cells that each segment shares with each room.

    Args:
        predicted: int (n,), segment of each cell, 0 for none.
        truth: int (n,), room of each cell, 0 for none.
        min_cells: Segments and rooms of at most so many cells are left out.

    Returns:
        overlaps int64 (segments, rooms), sizes of the segments int64 (segments,), of the rooms int64
        (rooms,), by rising label.

    Raises:
        MapError: The arrays differ in shape or are not flat, or hold an id below 0.
    """
    if predicted.ndim != 1 or predicted.shape != truth.shape:
        raise MapError(f"segments {predicted.shape} and rooms {truth.shape} must be flat and of one length")
    for name, ids in (("segments", predicted), ("rooms", truth)):
        if ids.min(initial=0) < 0:
            raise MapError(f"ids of {name} are 0 for none and above, got {ids.min()}")
    table = shared_cells(_bounded(predicted), _bounded(truth))
    segment_sizes, room_sizes = table.sum(1)[1:], table.sum(0)[1:]
    keep_s, keep_g = segment_sizes > min_cells, room_sizes > min_cells
    return table[1:, 1:][keep_s][:, keep_g], segment_sizes[keep_s], room_sizes[keep_g]


def _bounded(ids: NDArray[np.integer[Any]]) -> NDArray[np.int64]:
    """Ids int64 (n,) in the same order; numbered from 1 where one is too high to index a table."""
    if int(ids.max(initial=0)) > _MOST_IDS:
        ids = np.searchsorted(np.unique(ids[ids > 0]), ids, side="right")
    return ids.astype(np.int64)


@checks_arguments
def scores_of_overlaps(
    overlaps: NDArray[np.int64], segment_sizes: NDArray[np.int64], room_sizes: NDArray[np.int64]
) -> SegmentationScores:
    """The measures from the cells that segments and rooms share; all 0 where there is no segment or no room.

    Args:
        overlaps: int64 (segments, rooms).
        segment_sizes: int64 (segments,), at least 1.
        room_sizes: int64 (rooms,), at least 1.

    Raises:
        ConfigError: The shapes do not fit, or a size is below 1.
    """
    overlaps, segment_sizes, room_sizes = (np.asarray(a) for a in (overlaps, segment_sizes, room_sizes))
    alone = segment_sizes.ndim == room_sizes.ndim == 1
    if not alone or overlaps.shape != segment_sizes.shape + room_sizes.shape:
        raise ConfigError(
            "overlaps (segments, rooms) need a size of each segment and of each room, got shapes "
            f"{overlaps.shape}, {segment_sizes.shape} and {room_sizes.shape}"
        )
    if (segment_sizes < 1).any() or (room_sizes < 1).any():
        raise ConfigError("segments and rooms have at least one cell")
    n_segments, n_rooms = overlaps.shape
    if n_segments == 0 or n_rooms == 0:
        zeros = dict.fromkeys(MEASURES, 0.0)
        return SegmentationScores(**zeros, segments=n_segments, rooms=n_rooms)
    iou = overlaps / (segment_sizes[:, None] + room_sizes[None, :] - overlaps)
    rows, cols = linear_sum_assignment(iou, maximize=True)
    best_s, best_g = overlaps.max(1), overlaps.max(0)
    # which of two rooms with as many cells is meant must not depend on their numbers
    iou_s = np.where(overlaps == best_s[:, None], iou, 0.0).max(1)
    iou_g = np.where(overlaps == best_g[None, :], iou, 0.0).max(0)
    return SegmentationScores(
        precision=float((best_s / segment_sizes).mean()),
        recall=float((best_g / room_sizes).mean()),
        iou_s=float(iou_s.mean()),
        iou_g=float(iou_g.mean()),
        one_to_one=float(iou[rows, cols].sum() / max(n_segments, n_rooms)),
        a_fc=float(best_s.sum() / segment_sizes.sum()),
        a_bc=float(best_g.sum() / room_sizes.sum()),
        segments=n_segments,
        rooms=n_rooms,
    )
