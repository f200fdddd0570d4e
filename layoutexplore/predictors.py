"""Predictors: what a decision is told about rooms. Pluggable by name.

`none` tells nothing, `oracle` tells the truth (the ceiling of prediction), and `oracle:flip=0.1` tells it with a share of
the rooms judged wrongly, for the question how good a prediction has to be.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from layoutexplore.decision import Decision, Predictor, Truth
from layoutexplore.errors import ConfigError, unknown_name
from layoutexplore.frontier_classes import FrontierClasses, classify_frontiers

FALSE_CLOSED_AREA = 0.3
"""Square metres that a frontier wrongly called closed is said to have left: little enough to be put off."""


class OraclePredictor:
    """The true rooms, optionally with a share of the rooms judged wrongly for a whole run.

    Args:
        flip: Probability 0..1 that a room's frontiers are given the wrong class; a frontier wrongly called closed
            is said to have 0.3 m2 left.

    Raises:
        ConfigError: The probability is outside 0..1.
    """

    def __init__(self, flip: float = 0.0) -> None:
        if not (math.isfinite(flip) and 0 <= flip <= 1):
            raise ConfigError(f"oracle: flip is a probability 0..1, got {flip}")
        self.flip = flip
        self.name = f"oracle:flip={flip:g}" if flip else "oracle"
        self._truth: Truth | None = None

    def reveal(self, truth: Truth) -> None:
        """Receive the truth of the run that begins."""
        self._truth = truth
        rng = np.random.default_rng(np.frombuffer(truth.plan.content_hash.encode(), np.uint8))
        rooms = int(truth.raster.room_ids.max()) + 1
        self._flipped: NDArray[np.bool_] = rng.random(rooms) < self.flip

    def predict(self, decision: Decision) -> Decision:
        """The decision with the true class and remaining area of every frontier."""
        assert self._truth is not None, "a simulation reveals the truth before the first decision"
        raster = self._truth.raster
        classes = classify_frontiers(
            decision.grid.cells,
            [f.cells for f in decision.frontiers],
            raster.room_ids,
            raster.free,
            raster.resolution,
        )
        return with_classes(decision, self._wrong(classes))

    def _wrong(self, classes: FrontierClasses) -> FrontierClasses:
        wrong = self._flipped[classes.room]
        if not wrong.any():
            return classes
        is_closed = classes.is_closed ^ wrong
        area = np.where(wrong & is_closed, FALSE_CLOSED_AREA, classes.remaining_area)
        return dataclasses.replace(classes, is_closed=is_closed, remaining_area=area)


def with_classes(decision: Decision, classes: FrontierClasses, confidence: NDArray[np.float64] | None = None) -> Decision:
    """The decision with classes, areas and rooms written into its frontiers.

    Args:
        decision: The decision.
        classes: One entry a frontier.
        confidence: float64 (k,), probability that each class is right; 1 when None.
    """
    frontiers = tuple(
        dataclasses.replace(
            frontier,
            is_closed=bool(classes.is_closed[k]),
            expected_area=float(classes.remaining_area[k]),
            confidence=1.0 if confidence is None else float(confidence[k]),
            room=int(classes.room[k]),
        )
        for k, frontier in enumerate(decision.frontiers)
    )
    return dataclasses.replace(decision, frontiers=frontiers)


def predictor_names() -> list[str]:
    """The names that `make_predictor` knows."""
    return ["none", "oracle"]


def make_predictor(spec: str) -> Predictor | None:
    """A predictor from `NAME` or `NAME:key=value`; None for "none".

    Raises:
        UnknownNameError: There is no predictor of that name.
        ConfigError: It has no such parameter, or the value makes no sense.

    Example:
        >>> make_predictor("oracle:flip=0.25").name
        'oracle:flip=0.25'
        >>> make_predictor("none")
    """
    name, _, text = spec.partition(":")
    if name not in predictor_names():
        raise unknown_name("predictor", name, predictor_names())
    if name == "none" and not text:
        return None
    if not text:
        return OraclePredictor()
    key, _, value = text.partition("=")
    if name != "oracle" or key != "flip":
        raise ConfigError(f"predictor {spec!r}: only oracle:flip=SHARE takes a parameter")
    try:
        return OraclePredictor(flip=float(value))
    except ValueError as error:
        raise ConfigError(f"predictor {spec!r}: flip is a probability 0..1, got {value!r}") from error
