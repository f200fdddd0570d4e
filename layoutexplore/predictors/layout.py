"""The predictor that ships: a room's seen part completed, its frontiers judged by trees.

Rooms are the seen regions, completed by `layoutexplore.predictors.completion`. Whether a frontier is closed and how much is
left behind it is judged by boosted trees on features of its surroundings; they were trained on simulated explorations
of other buildings (`layoutexplore.predictors.training`).
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from layoutexplore.decision import Decision
from layoutexplore.frontier_classes import FrontierClasses
from layoutexplore.predictors.completion import complete_regions
from layoutexplore.predictors.forest import FOLDER, Forest, load_forests
from layoutexplore.predictors.frontier_features import FEATURES, frontier_features
from layoutexplore.predictors.protocol import RoomMap, classes_in, with_classes
from layoutexplore.predictors.regions import Regions, seen_regions
from layoutexplore.predictors.shapes import draw_shapes, parallel_outline

LEFTOVER = 1.0
"""Square metres: closed frontiers with less left are what strategies put off."""

MODEL = FOLDER / "frontier_model.json"


class LayoutPredictor:
    """Completed rooms, and frontiers judged by trees.

    Args:
        forests: "closed", "leftover" and "area"; those that ship when None.
    """

    name = "layout"

    def __init__(self, forests: dict[str, Forest] | None = None) -> None:
        self._forests = forests or load_forests(MODEL, FEATURES)

    def rooms(self, decision: Decision) -> RoomMap:
        """The seen regions with what is thought to lie behind their frontiers."""
        return self._complete(decision, seen_regions(decision.grid.cells, decision.grid.resolution))

    def predict(self, decision: Decision) -> Decision:
        """The decision with class, area and confidence judged by the trees, and the predicted rooms as its layout."""
        if not decision.frontiers:
            return decision
        grid = decision.grid
        regions = seen_regions(grid.cells, grid.resolution)
        rooms = self._complete(decision, regions)
        visible = np.array([f.visible_area for f in decision.frontiers])
        clusters = [f.cells for f in decision.frontiers]
        features = frontier_features(grid.cells, clusters, visible, regions, grid.resolution)
        classes, confidence = judge(features, self._forests, classes_in(rooms, decision))
        return dataclasses.replace(with_classes(decision, classes, confidence), layout=rooms)

    def _complete(self, decision: Decision, regions: Regions) -> RoomMap:
        cells = decision.grid.cells
        return complete_regions(cells, regions, draw_shapes(cells, regions, parallel_outline))


def judge(
    features: NDArray[np.float32], forests: dict[str, Forest], classes: FrontierClasses
) -> tuple[FrontierClasses, NDArray[np.float64]]:
    """Classes and areas by the trees, and the probability that each class is right.

    Args:
        features: float32 (k, features).
        forests: "closed" and "leftover" (log-odds) and "area" (log of 1 + square metres).
        classes: What the predicted rooms say; of these the rooms are kept.
    """
    closed, leftover = forests["closed"].probability(features), forests["leftover"].probability(features)
    closed = np.maximum(closed, leftover)
    area = np.maximum(np.expm1(forests["area"].score(features)), 0.0)
    little = leftover > 0.5
    below = math.nextafter(LEFTOVER, 0.0)
    area = np.where(little, np.minimum(area, below), np.maximum(area, LEFTOVER))
    is_closed = closed > 0.5
    judged = dataclasses.replace(classes, is_closed=is_closed, remaining_area=area)
    return judged, np.where(is_closed, closed, 1.0 - closed)
