"""Tables of the evaluation of half-seen rooms: by predictor and stratum, with intervals over buildings."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import spearmanr

from layoutexplore.errors import ConfigError, checks_arguments
from layoutexplore.evaluation.partial_rooms import FrontierScore, RoomScore, Scores
from layoutexplore.grids.arrays import Floats, Mask, check_alike
from layoutexplore.metrics.statistics import NO_INTERVAL, Interval, cluster_bootstrap

EXPLORED = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Ends of the strata of explored share."""

BINS = 10
"""Bins of stated confidence for the calibration error."""


@dataclass(frozen=True, kw_only=True)
class RoomLine:
    """What a predictor makes of half-seen rooms of one stratum.

    Attributes:
        explored: The stratum of explored share, "all" for all rooms.
        rooms: Their number.
        hidden_iou, hidden_low, hidden_high: IoU of hidden parts, interquartile mean, and its 95 % interval.
        hidden_mean: Its plain mean.
        iou, iou_low, iou_high: The same of whole rooms.
        log_area: Mean distance of the logarithms of predicted and true area.
        boundary_m: Median distance of the outlines [m].
        spearman: Rank correlation of predicted and true hidden area; NaN where there is none.
        mae_m2: Mean error of the hidden area [m2].
    """

    explored: str
    rooms: int
    hidden_iou: float
    hidden_low: float
    hidden_high: float
    hidden_mean: float
    iou: float
    iou_low: float
    iou_high: float
    log_area: float
    boundary_m: float
    spearman: float
    mae_m2: float

    @property
    def hidden(self) -> Interval:
        """The IoU of hidden parts."""
        return Interval(self.hidden_iou, self.hidden_low, self.hidden_high)


@dataclass(frozen=True, kw_only=True)
class FrontierLine:
    """How a predictor judges the frontiers of one stratum.

    Attributes:
        coverage: The coverage at which explorations were stopped, "all" for all.
        frontiers: Their number.
        mcc: Matthews' correlation of closed and open.
        f1_closed, f1_open: F1 of either class.
        leftover_accuracy: Share of which "closed, with less than 1 m2 left" is said rightly.
        leftover_mcc: Matthews' correlation of it.
        calibration_error: Of the stated confidence.
    """

    coverage: str
    frontiers: int
    mcc: float
    f1_closed: float
    f1_open: float
    leftover_accuracy: float
    leftover_mcc: float
    calibration_error: float


@dataclass(frozen=True, kw_only=True)
class PartLine:
    """Figures of a predictor on one part of the plans, as of `RoomLine` and `FrontierLine`."""

    part: str
    buildings: int
    rooms: int
    hidden_iou: float
    hidden_mean: float
    iou: float
    frontiers: int
    mcc: float
    leftover_accuracy: float


@dataclass(frozen=True)
class PredictorSummary:
    """What a predictor makes of rooms and frontiers.

    Attributes:
        rooms: A line for all rooms, and one a stratum that has some.
        frontiers: The same of frontiers.
        ms: Milliseconds a decision, their median; NaN where nothing was asked.
    """

    rooms: list[RoomLine]
    frontiers: list[FrontierLine]
    ms: float

    @property
    def hidden(self) -> Interval:
        """The IoU of hidden parts of all rooms; none without a room."""
        return self.rooms[0].hidden if self.rooms else NO_INTERVAL

    @property
    def mcc(self) -> float:
        """Matthews' correlation over all frontiers; NaN without a frontier."""
        return self.frontiers[0].mcc if self.frontiers else math.nan


@checks_arguments
def summarise_partial_rooms(scores: Scores) -> dict[str, PredictorSummary]:
    """Rooms, frontiers and times of every predictor."""
    return {
        name: PredictorSummary(
            rooms=summarise_rooms([r for r in scores.rooms if r.predictor == name]),
            frontiers=summarise_frontiers([f for f in scores.frontiers if f.predictor == name]),
            ms=float(np.median(times)) if times else math.nan,
        )
        for name, times in scores.milliseconds.items()
    }


@checks_arguments
def summarise_rooms(rooms: Sequence[RoomScore]) -> list[RoomLine]:
    """One line for all rooms and one for each stratum of explored share that has rooms."""
    strata = [("all", list(rooms))]
    for low, high in itertools.pairwise(EXPLORED):
        strata.append((f"{low:.0%}-{high:.0%}", [r for r in rooms if low <= r.explored < high]))
    return [_room_line(name, part) for name, part in strata if part]


@checks_arguments
def summarise_parts(scores: Scores, predictor: str, part_of: Mapping[str, str]) -> list[PartLine]:
    """One line a part of the plans, in the order of `part_of`, which tells the part of each plan by its name.

    Where a part has no half-seen room, or no frontier, it has no line.
    """
    lines = []
    for part in dict.fromkeys(part_of.values()):
        rooms = [r for r in scores.rooms if r.predictor == predictor and part_of[r.plan] == part]
        frontiers = [f for f in scores.frontiers if f.predictor == predictor and part_of[f.plan] == part]
        if not rooms or not frontiers:
            continue
        of_rooms, of_frontiers = _room_line(part, rooms), _frontier_line(part, frontiers)
        lines.append(
            PartLine(
                part=part,
                buildings=len({r.building for r in rooms}),
                rooms=of_rooms.rooms,
                hidden_iou=of_rooms.hidden_iou,
                hidden_mean=of_rooms.hidden_mean,
                iou=of_rooms.iou,
                frontiers=of_frontiers.frontiers,
                mcc=of_frontiers.mcc,
                leftover_accuracy=of_frontiers.leftover_accuracy,
            )
        )
    return lines


def _room_line(explored: str, rooms: Sequence[RoomScore]) -> RoomLine:
    buildings = [r.building for r in rooms]
    hidden = cluster_bootstrap([r.hidden_iou for r in rooms], buildings)
    whole = cluster_bootstrap([r.iou for r in rooms], buildings)
    predicted, true = np.array([(r.remaining, r.true_remaining) for r in rooms]).T
    varied = len(rooms) > 2 and predicted.std() > 0 and true.std() > 0
    return RoomLine(
        explored=explored,
        rooms=len(rooms),
        hidden_iou=hidden.estimate,
        hidden_low=hidden.low,
        hidden_high=hidden.high,
        hidden_mean=float(np.mean([r.hidden_iou for r in rooms])),
        iou=whole.estimate,
        iou_low=whole.low,
        iou_high=whole.high,
        log_area=float(np.mean([r.log_area for r in rooms])),
        boundary_m=float(np.median([r.boundary for r in rooms])),
        spearman=float(spearmanr(predicted, true).statistic) if varied else math.nan,
        mae_m2=float(np.abs(predicted - true).mean()),
    )


@checks_arguments
def summarise_frontiers(frontiers: Sequence[FrontierScore]) -> list[FrontierLine]:
    """One line for all frontiers and one for each coverage."""
    shares = sorted({f.coverage for f in frontiers})
    strata = [
        ("all", list(frontiers)),
        *((f"{share:.0%}", [f for f in frontiers if f.coverage == share]) for share in shares),
    ]
    return [_frontier_line(name, part) for name, part in strata if part]


def _frontier_line(coverage: str, frontiers: Sequence[FrontierScore]) -> FrontierLine:
    closed, truth = np.array([(f.closed, f.true_closed) for f in frontiers]).T
    leftover, true_leftover = np.array([(f.leftover, f.true_leftover) for f in frontiers]).T
    return FrontierLine(
        coverage=coverage,
        frontiers=len(frontiers),
        mcc=matthews(closed, truth),
        f1_closed=f1(closed, truth),
        f1_open=f1(~closed, ~truth),
        leftover_accuracy=float((leftover == true_leftover).mean()),
        leftover_mcc=matthews(leftover, true_leftover),
        calibration_error=calibration_error(np.array([f.confidence for f in frontiers]), closed == truth),
    )


@checks_arguments
def matthews(found: Mask, truth: Mask) -> float:
    """Matthews' correlation of two classes, bool (n,); 0 where one of them never varies.

    Example:
        >>> round(matthews(np.array([True, False, True]), np.array([True, False, True])), 6)
        1.0
    """
    check_alike("matthews", found=found, truth=truth)
    if found.all() or truth.all() or not found.any() or not truth.any():
        return 0.0
    return float(np.corrcoef(found, truth)[0, 1])


@checks_arguments
def f1(found: Mask, truth: Mask) -> float:
    """Harmonic mean of precision and recall of the class True; 0 where it is neither found nor there."""
    check_alike("f1", found=found, truth=truth)
    return float(2 * (found & truth).sum() / max(int(found.sum() + truth.sum()), 1))


@checks_arguments
def calibration_error(confidence: Floats, right: Mask) -> float:
    """Expected calibration error.

    Mean distance of stated and observed probability over bins of equal width.
    """
    check_alike("calibration_error", confidence=confidence, right=right)
    if confidence.ndim != 1 or not len(right) or not (confidence >= 0.0).all():
        raise ConfigError(
            f"calibration_error: confidence is 0..1, (n,), of one at least, got {confidence.shape}"
        )
    which = np.minimum((confidence * BINS).astype(int), BINS - 1)
    gaps = np.bincount(which, weights=confidence - right, minlength=BINS)
    return float(np.abs(gaps).sum() / len(right))
