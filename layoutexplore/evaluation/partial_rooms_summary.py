"""Tables of the evaluation of half-seen rooms: by predictor and stratum, with intervals over buildings."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

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


@checks_arguments
def summarise_partial_rooms(scores: Scores) -> dict[str, Any]:
    """Rooms, frontiers and times of every predictor."""
    return {
        name: {
            "rooms": summarise_rooms([r for r in scores.rooms if r.predictor == name]),
            "frontiers": summarise_frontiers([f for f in scores.frontiers if f.predictor == name]),
            "ms": float(np.median(times)) if times else float("nan"),
        }
        for name, times in scores.milliseconds.items()
    }


@checks_arguments
def summarise_rooms(rooms: Sequence[RoomScore]) -> list[dict[str, Any]]:
    """One line for all rooms and one for each stratum of explored share that has rooms."""
    strata = [("all", list(rooms))]
    for low, high in itertools.pairwise(EXPLORED):
        strata.append((f"{low:.0%}-{high:.0%}", [r for r in rooms if low <= r.explored < high]))
    return [{"explored": name} | _room_line(part) for name, part in strata if part]


@checks_arguments
def hidden_interval(rooms: Sequence[Mapping[str, Any]]) -> Interval:
    """The IoU of hidden parts in the first of the lines of `summarise_rooms`; none without a line."""
    keys = ("hidden_iou", "hidden_low", "hidden_high")
    return Interval(*(rooms[0][key] for key in keys)) if rooms else NO_INTERVAL


@checks_arguments
def summarise_parts(scores: Scores, predictor: str, part_of: Mapping[str, str]) -> list[dict[str, Any]]:
    """One line a part of the plans, in the order of `part_of`, which tells the part of each plan by its name.

    Where a part has no half-seen room, or no frontier, it has no line.
    """
    lines = []
    for part in dict.fromkeys(part_of.values()):
        rooms = [r for r in scores.rooms if r.predictor == predictor and part_of[r.plan] == part]
        frontiers = [f for f in scores.frontiers if f.predictor == predictor and part_of[f.plan] == part]
        if not rooms or not frontiers:
            continue
        of_rooms, of_frontiers = _room_line(rooms), _frontier_line(frontiers)
        line = {"part": part, "buildings": len({r.building for r in rooms})}
        line |= {name: of_rooms[name] for name in ("rooms", "hidden_iou", "hidden_mean", "iou")}
        lines.append(line | {name: of_frontiers[name] for name in ("frontiers", "mcc", "leftover_accuracy")})
    return lines


def _room_line(rooms: Sequence[RoomScore]) -> dict[str, Any]:
    buildings = [r.building for r in rooms]
    hidden = cluster_bootstrap([r.hidden_iou for r in rooms], buildings)
    whole = cluster_bootstrap([r.iou for r in rooms], buildings)
    predicted, true = np.array([(r.remaining, r.true_remaining) for r in rooms]).T
    varied = len(rooms) > 2 and predicted.std() > 0 and true.std() > 0
    return {
        "rooms": len(rooms),
        "hidden_iou": hidden.estimate,
        "hidden_low": hidden.low,
        "hidden_high": hidden.high,
        "hidden_mean": float(np.mean([r.hidden_iou for r in rooms])),
        "iou": whole.estimate,
        "iou_low": whole.low,
        "iou_high": whole.high,
        "log_area": float(np.mean([r.log_area for r in rooms])),
        "boundary_m": float(np.median([r.boundary for r in rooms])),
        "spearman": float(spearmanr(predicted, true).statistic) if varied else float("nan"),
        "mae_m2": float(np.abs(predicted - true).mean()),
    }


@checks_arguments
def summarise_frontiers(frontiers: Sequence[FrontierScore]) -> list[dict[str, Any]]:
    """One line for all frontiers and one for each coverage."""
    shares = sorted({f.coverage for f in frontiers})
    strata = [
        ("all", list(frontiers)),
        *((f"{share:.0%}", [f for f in frontiers if f.coverage == share]) for share in shares),
    ]
    return [{"coverage": name} | _frontier_line(part) for name, part in strata if part]


def _frontier_line(frontiers: Sequence[FrontierScore]) -> dict[str, Any]:
    closed, truth = np.array([(f.closed, f.true_closed) for f in frontiers]).T
    leftover, true_leftover = np.array([(f.leftover, f.true_leftover) for f in frontiers]).T
    return {
        "frontiers": len(frontiers),
        "mcc": matthews(closed, truth),
        "f1_closed": f1(closed, truth),
        "f1_open": f1(~closed, ~truth),
        "leftover_accuracy": float((leftover == true_leftover).mean()),
        "leftover_mcc": matthews(leftover, true_leftover),
        "calibration_error": calibration_error(np.array([f.confidence for f in frontiers]), closed == truth),
    }


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
