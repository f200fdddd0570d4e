"""The predictor that ships: seen rooms completed and frontiers judged, both by trees.

Rooms are the seen regions; unknown cells near them belong to their rooms where trees say so (`cell_features`). Whether a
frontier is closed and how much is left behind it is judged by trees on features of its surroundings (`frontier_features`).
All were trained on simulated explorations of generated floor plans, of schools and of university floors
(`layoutexplore.predictors.training`); how they do on buildings they never saw is for its cross-validation to say.
Rooms are completed only when somebody looks at them: a strategy that asks for classes does not pay for shapes.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from layoutexplore.decision import Decision
from layoutexplore.frontier_classes import FrontierClasses
from layoutexplore.grid import UNKNOWN
from layoutexplore.predictors import cell_features
from layoutexplore.predictors.completion import Shape, complete_regions
from layoutexplore.predictors.forest import FOLDER, Forest, load_forests
from layoutexplore.predictors.frontier_features import FEATURES, frontier_features, home_regions
from layoutexplore.predictors.protocol import RoomMap, with_classes
from layoutexplore.predictors.regions import Regions, region_boxes, seen_regions

LEFTOVER = 1.0
"""Square metres: closed frontiers with less left are what strategies put off."""

INSIDE = 0.35
"""Probability from which an unknown cell belongs to a room: the intersection over union is best below a half."""

COARSE, COARSE_REACH = 0.6, 8.0
"""Metres between the cells judged for probabilities in sight, and how far they are judged: a quarter of the work."""

FRONTIER_MODEL, CELL_MODEL = FOLDER / "frontier_model.json", FOLDER / "cell_model.json"


class PredictedLayout:
    """The rooms that are predicted at a decision, completed when they are first asked for.

    Args:
        cells: int8 (rows, cols), what is known; not copied.
        regions: The seen rooms.
        resolution: Metres per cell.
        forest: Says whether an unknown cell belongs to a room.
    """

    def __init__(self, cells: NDArray[np.int8], regions: Regions, resolution: float, forest: Forest) -> None:
        self._cells, self._regions, self._resolution, self._forest = cells, regions, resolution, forest

    @cached_property
    def rooms(self) -> RoomMap:
        """The completed rooms, and the unseen rest of the building as one more."""
        candidates = cell_features.find_candidates(self._cells, self._regions, self._resolution)
        probability = self._forest.probability(candidates.features)
        shapes = _judged_shapes(self._cells.shape, self._regions, candidates, probability)
        return complete_regions(self._cells, self._regions, shapes)

    @cached_property
    def inside(self) -> NDArray[np.float32]:
        """float32 (rows, cols): probability that an unknown cell belongs to the seen room next to it; 0 where it is known.

        Judged more coarsely than the rooms: strategies that look at probabilities need them at every decision.
        """
        candidates = cell_features.find_candidates(
            self._cells, self._regions, self._resolution, spacing=COARSE, reach=COARSE_REACH
        )
        probability = self._forest.probability(candidates.features)
        chance = np.zeros(self._cells.shape, np.float32)
        for square in _squares(candidates):
            fits = (square < self._cells.shape).all(axis=1)
            chance[square[fits, 0], square[fits, 1]] = probability[fits]
        chance[self._cells != UNKNOWN] = 0.0
        return chance

    @property
    def labels(self) -> NDArray[np.int32]:
        """int32 (rows, cols): the predicted room of each cell, seen or not, 0 for none."""
        ids = self.rooms.room_ids
        return np.where(ids > self._regions.count, np.int32(0), ids)


class LayoutPredictor:
    """Completed rooms, and frontiers judged by trees.

    Args:
        frontier_forests: "closed", "leftover" and "area"; those that ship when None.
        cell_forest: Whether a cell belongs to a room; the one that ships when None.
    """

    name = "layout"

    def __init__(self, frontier_forests: dict[str, Forest] | None = None, cell_forest: Forest | None = None) -> None:
        self._frontiers = frontier_forests or load_forests(FRONTIER_MODEL, FEATURES)
        self._inside = cell_forest or load_forests(CELL_MODEL, cell_features.FEATURES)["inside"]

    def rooms(self, decision: Decision) -> RoomMap:
        """The seen regions with what is thought to lie behind their frontiers."""
        cells, resolution = decision.grid.cells, decision.grid.resolution
        return PredictedLayout(cells, seen_regions(cells, resolution), resolution, self._inside).rooms

    def predict(self, decision: Decision) -> Decision:
        """The decision with class, area and confidence judged by the trees, and a `PredictedLayout`."""
        if not decision.frontiers:
            return decision
        cells, resolution = decision.grid.cells, decision.grid.resolution
        regions = seen_regions(cells, resolution)
        clusters = [f.cells for f in decision.frontiers]
        visible = np.array([f.visible_area for f in decision.frontiers])
        features = frontier_features(cells, clusters, visible, regions, resolution)
        offsets = np.cumsum([0, *(len(c) for c in clusters)])
        homes = home_regions(regions, np.concatenate(clusters), offsets)
        classes, confidence = judge(features, self._frontiers, homes.astype(np.int32))
        layout = PredictedLayout(cells, regions, resolution, self._inside)
        return dataclasses.replace(with_classes(decision, classes, confidence), layout=layout)


def judge(
    features: NDArray[np.float32], forests: dict[str, Forest], rooms: NDArray[np.int32]
) -> tuple[FrontierClasses, NDArray[np.float64]]:
    """Classes and areas by the trees, and the probability that each class is right.

    Args:
        features: float32 (k, features).
        forests: "closed" and "leftover" (log-odds) and "area" (log of 1 + square metres).
        rooms: int32 (k,), the room that each frontier lies in.
    """
    leftover = forests["leftover"].probability(features)
    closed = np.maximum(forests["closed"].probability(features), leftover)
    area = np.maximum(np.expm1(forests["area"].score(features)), 0.0)
    area = np.where(leftover > 0.5, np.minimum(area, math.nextafter(LEFTOVER, 0.0)), np.maximum(area, LEFTOVER))
    is_closed = closed > 0.5
    classes = FrontierClasses(is_closed, rooms, area, np.ones(len(rooms)), area)
    return classes, np.where(is_closed, closed, 1.0 - closed)


def _squares(candidates: cell_features.Candidates) -> Iterator[NDArray[np.int32]]:
    """The cells int32 (n, 2) of the squares around the candidates, some beyond the grid: one cell of each square at a time."""
    for offset in np.ndindex(candidates.stride, candidates.stride):
        yield candidates.cells - candidates.stride // 2 + np.array(offset, np.int32)


def _judged_shapes(
    shape: tuple[int, ...], regions: Regions, candidates: cell_features.Candidates, probability: NDArray[np.float64]
) -> dict[int, Shape]:
    """By region the squares around the lattice cells that belong to its room."""
    claims = np.zeros(shape, np.int32)
    inside = probability > INSIDE
    for square in _squares(candidates):
        fits = inside & (square < shape).all(axis=1)
        claims[square[fits, 0], square[fits, 1]] = candidates.region[fits]
    boxes = region_boxes(Regions(claims, regions.count, regions.door_width))
    shapes = {}
    for region in np.unique(candidates.region[inside]).tolist():
        _, row0, col0, row1, col1 = boxes[region].tolist()
        shapes[region] = Shape(row0, col0, claims[row0:row1, col0:col1] == region)
    return shapes
