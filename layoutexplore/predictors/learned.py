"""The shipped predictor: completes seen rooms and classifies frontiers.

Trees and small networks do so together. Rooms are the seen regions; unknown cells near them belong to their
rooms where trees (`cell_model.features`) and a small U-Net (`cell_model.network`) say so together. Whether a
frontier is closed and how much is left behind it is estimated by trees on features of its surroundings
(`frontier_model.features`) and, where these are in doubt, by a network that sees an egocentric crop of them
(`frontier_model.network`). All learn from simulated explorations of floor plans
(`layoutexplore evaluate train-predictor`); MODEL_CARD.md says what the shipped models learnt from, and how
right they are on buildings that they never saw. Rooms are completed only when somebody looks at them: a
strategy that asks for classes does not pay for shapes. A third network (`floor_model`) may complete the map,
a few metres beyond known floor, for those who look for what is left at the end. All look along rows and
columns: a map whose walls run otherwise is looked at as it is when turned upright (`predictors.upright`).
"""

from __future__ import annotations

import dataclasses
import math
import os
from functools import cached_property, partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from layoutexplore.errors import ConfigError, checks_calls, checks_making
from layoutexplore.files import fingerprint
from layoutexplore.files.reading import is_there
from layoutexplore.frontiers.classes import LITTLE_LEFT, FrontierClasses
from layoutexplore.frontiers.decision import Decision
from layoutexplore.frontiers.foresight import Foresight
from layoutexplore.grids.arrays import Floats, Floats32, Ints32
from layoutexplore.grids.grid import UNKNOWN, OccupancyGrid
from layoutexplore.layout.alignment import turn_back
from layoutexplore.layout.doorways import Regions
from layoutexplore.models.forest import Forest, logistic
from layoutexplore.models.forest_files import load_forests
from layoutexplore.models.network_files import load_weights, shapes_of
from layoutexplore.options import Rule, format_value
from layoutexplore.predictors.cell_model import features as cell_features
from layoutexplore.predictors.cell_model.features import CandidateCells, add_first_estimate, find_candidates
from layoutexplore.predictors.cell_model.network import LAYERS, CellNetwork
from layoutexplore.predictors.cell_model.network_input import make_network_input
from layoutexplore.predictors.cell_model.room_shapes import room_shapes
from layoutexplore.predictors.floor_model.completion import MOST_AHEAD, completed_map
from layoutexplore.predictors.floor_model.network import LAYERS as FLOOR_LAYERS
from layoutexplore.predictors.floor_model.network import FloorNetwork
from layoutexplore.predictors.frontier_model.feature_cache import FeatureCache
from layoutexplore.predictors.frontier_model.features import (
    FEATURES,
    Surroundings,
    frontier_features,
    look_around,
)
from layoutexplore.predictors.frontier_model.network import SHAPES, FrontierNetwork
from layoutexplore.predictors.frontier_model.network_input import draw_crops
from layoutexplore.predictors.protocol import RoomLabels, RoomsOnGrid, with_classes
from layoutexplore.predictors.room_completion import complete_regions
from layoutexplore.predictors.room_sketch import sketch_rooms
from layoutexplore.predictors.seen_regions import DOORWAYS, SeenRegions
from layoutexplore.predictors.upright import UprightView, UprightViews

CLOSED = 0.6
"""Probability from which a frontier is called closed.

Most are, so that a doubtful one is rather open (MODEL_CARD.md).
"""

_CHANGES = np.array([math.log(CLOSED / (1.0 - CLOSED)), 0.0])
"""Log-odds at which "closed" and "leftover" change."""

COARSE, COARSE_REACH = 0.9, 6.0
"""Metres between the cells classified for probabilities in sight, and how far away they are classified."""

FOLDER = Path(__file__).parent
"""Where the shipped models lie; `layoutexplore.training.predictor_forests` makes them."""

FRONTIER_MODEL, CELL_MODEL = (FOLDER / name for name in ("frontier_model.json", "cell_model.json"))

CELL_NETWORK, FRONTIER_NETWORK, FLOOR_NETWORK = (
    FOLDER / f"{name}.safetensors" for name in ("rooms", "frontiers", "floor")
)

ROOM_SHARE, FRONTIER_SHARE = 0.6, 0.5
"""Weight of the networks' log-odds, for cells and for frontiers, against those of the trees."""

FORESIGHT_CONFIDENCE = 0.6
"""Told of the completed map: it is right about five cells in six near what is known (MODEL_CARD.md)."""

_VAST = 20.0
"""The logarithm of more square metres than any building has."""

DOUBT = 1.0
"""The network scores frontiers whose log-odds by the trees are as near as this to a change of class."""


@checks_making
class LearnedRooms(RoomsOnGrid):
    """The rooms that are predicted at a decision, completed when they are first asked for.

    Args:
        name: Of the predictor.
        grid: What is known; its cells are not copied.
        regions: The seen rooms.
        forests: As for `classify_cells`.
        network: Scores the cells as well, if there is one.
        frontiers: What lies around the frontiers, and the area float64 (k,) predicted behind each in square
            metres, for `sketch`.
    """

    def __init__(
        self,
        name: str,
        grid: OccupancyGrid,
        regions: Regions,
        forests: dict[str, Forest],
        network: CellNetwork | None = None,
        frontiers: tuple[Surroundings, Floats] | None = None,
    ) -> None:
        super().__init__(name, grid)
        self._cells, self._regions, self._resolution = grid.cells, regions, grid.resolution
        self._forests, self._network, self._frontiers = forests, network, frontiers

    @cached_property
    def rooms(self) -> RoomLabels:
        """The completed rooms, and the unseen rest of the building as one more."""
        candidates = find_candidates(self._cells, self._regions, self._resolution)
        probability = classify_cells(candidates, self._resolution, self._forests)
        if self._network:
            scene = make_network_input(self._cells, self._regions, candidates, self._resolution)
            probability = agreed(probability, self._network.score(scene))
        return complete_regions(self._cells, self._regions, room_shapes(self._cells, candidates, probability))

    @cached_property
    def sketch(self) -> Ints32:
        """The seen rooms, grown by the areas predicted behind their frontiers (`room_sketch`)."""
        return sketch_rooms(*self._frontiers) if self._frontiers else self.labels

    @cached_property
    def inside(self) -> Floats32:
        """float32 (rows, cols): probability that an unknown cell belongs to a seen room next to it.

        0 where a cell is known. Estimated once and more coarsely than the rooms: strategies that look at
        probabilities need them at every decision.
        """
        candidates = find_candidates(
            self._cells, self._regions, self._resolution, spacing=COARSE, reach=COARSE_REACH
        )
        probability = self._forests["first"].probability(candidates.features)
        rows, cols = self._cells.shape
        squares = np.zeros((-(-rows // candidates.stride), -(-cols // candidates.stride)), np.float32)
        at = candidates.cells // candidates.stride
        # Of two rooms the likelier one counts.
        np.maximum.at(squares, (at[:, 0], at[:, 1]), probability.astype(np.float32))
        chance: Floats32 = squares.repeat(candidates.stride, 0).repeat(candidates.stride, 1)[:rows, :cols]
        chance[self._cells != UNKNOWN] = 0.0
        return chance


def _floor_network(path: Path) -> FloorNetwork:
    """The network that completes maps; `evaluate train-predictor` does not write one."""
    if not is_there(path):
        raise ConfigError(
            f"{path}: there is no such network, and ahead needs it: layoutexplore evaluate train-floor PLANS "
            f"--out {path} trains one; or leave ahead out"
        )
    return FloorNetwork(load_weights(path, shapes_of(FLOOR_LAYERS), "network that completes maps"))


@checks_calls
class LearnedPredictor:
    """Completes rooms and classifies frontiers.

    Args:
        folder: Where `layoutexplore evaluate train-predictor` wrote the models; those that ship when None.
        network: Whether the networks have a say, if there are any: better rooms and classes in more time.
        rooms: The layout method whose rooms are completed; the models have learnt with `doorways`.
        called: What its name begins with.
        ahead: Metres beyond known floor that are foreseen once no open frontier is left; 0 for nothing, at
            most 6.

    Raises:
        ConfigError: The folder holds no models, or they do not fit this version; another number of metres.
        UnknownNameError: No such layout method.
    """

    remembers = True
    """The angle at which a map stands upright is held while another is hardly clearer."""

    def __init__(
        self,
        folder: str | os.PathLike[str] | None = None,
        *,
        network: bool = True,
        rooms: str = DOORWAYS,
        called: str = "layout",
        ahead: float = 0.0,
    ) -> None:
        ahead = Rule(low=0.0, high=MOST_AHEAD).convert("ahead", ahead)
        folder = None if folder is None else Path(folder)
        changed = [f"model={folder}"] * (folder is not None) + ["network=off"] * (not network)
        changed += [f"rooms={rooms}"] * (rooms != DOORWAYS) + [f"ahead={format_value(ahead)}"] * (ahead > 0.0)
        self.name = ":".join([called, *([",".join(changed)] if changed else [])])
        self._method, self._regions = rooms, SeenRegions(rooms)
        paths = [(folder or FOLDER) / path.name for path in (FRONTIER_MODEL, CELL_MODEL)]
        self._frontiers = load_forests(paths[0], FEATURES, ("closed", "leftover", "area"))
        self._cells = load_forests(paths[1], cell_features.FEATURES, ("first", "inside"))
        of_cells, of_frontiers = ((folder or FOLDER) / path.name for path in (CELL_NETWORK, FRONTIER_NETWORK))
        networks = [path for path in (of_cells, of_frontiers) if network and is_there(path)]
        self._room_network = (
            CellNetwork(load_weights(of_cells, shapes_of(LAYERS))) if of_cells in networks else None
        )
        self._frontier_network = (
            FrontierNetwork(load_weights(of_frontiers, SHAPES)) if of_frontiers in networks else None
        )
        self._memory, self._upright, self._ahead = FeatureCache(), UprightViews(), ahead
        self._files = [*paths, *networks]
        if ahead:
            self._files.append((folder or FOLDER) / FLOOR_NETWORK.name)
            self._floor_network = _floor_network(self._files[-1])

    @property
    def fingerprint(self) -> str:
        """Of the models."""
        return fingerprint(self._files)

    def rooms(self, decision: Decision) -> RoomLabels:
        """The seen regions with what is thought to lie behind their frontiers."""
        view = self._upright(decision)
        found = self._completed(view.grid, SeenRegions(self._method)(view.grid))
        return view.rooms(found, self.name, decision.grid).rooms

    def _completed(
        self, grid: OccupancyGrid, regions: Regions, frontiers: tuple[Surroundings, Floats] | None = None
    ) -> LearnedRooms:
        return LearnedRooms(self.name, grid, regions, self._cells, self._room_network, frontiers)

    def predict(self, decision: Decision) -> Decision:
        """The decision with class, area and confidence, and a `LearnedRooms`."""
        if not decision.frontiers:
            return decision
        view = self._upright(decision)
        regions = self._regions(view.grid)
        around = look_around(view.grid.cells, view.clusters, regions, view.grid.resolution, self._memory)
        scores = score_frontiers(frontier_features(around, decision.table.visible_area), self._frontiers)
        if self._frontier_network:
            doubtful = np.flatnonzero((np.abs(scores[:2] - _CHANGES[:, None]) < DOUBT).any(axis=0))
            found = self._frontier_network.score(draw_crops(around, doubtful)).T
            scores[:, doubtful] += FRONTIER_SHARE * (found - scores[:, doubtful])
        classes, confidence = classify(scores, around.homes.astype(np.int32))
        rooms = self._completed(view.grid, regions, (around, classes.remaining_area))
        judged = with_classes(decision, classes, view.rooms(rooms, self.name, decision.grid), confidence)
        if not self._ahead or not classes.is_closed.all():
            return judged
        return dataclasses.replace(judged, foresee=partial(self._foresee, decision.grid, view))

    def _foresee(self, grid: OccupancyGrid, view: UprightView) -> Foresight:
        """The map completed near known floor."""
        cells = completed_map(self._floor_network, view.grid.cells, grid.resolution, self._ahead)
        if view.turned is not None:
            # 0 is what lies outside of the turned part.
            above = cells.astype(np.int32) - UNKNOWN
            cells = (turn_back(above, view.turned, grid.shape) + UNKNOWN).astype(np.int8)
        foresight = Foresight(
            cells=cells,
            room_ids=np.zeros(grid.shape, np.int32),
            confidence=FORESIGHT_CONFIDENCE,
            predictor=self.name,
            resolution=grid.resolution,
        )
        return foresight.within(self._ahead, grid.cells)


def score_frontiers(features: Floats32, forests: dict[str, Forest]) -> Floats:
    """What the trees find float64 (3, k): log-odds of "closed" and "leftover", log of 1 + square metres left.

    Args:
        features: float32 (k, features).
        forests: "closed", "leftover" and "area".
    """
    return np.stack([forests[name].score(features) for name in ("closed", "leftover", "area")])


def classify(scores: Floats, rooms: Ints32) -> tuple[FrontierClasses, Floats]:
    """Classes and areas, and the probability that each class is right.

    Args:
        scores: float64 (3, k), as of `score_frontiers`.
        rooms: int32 (k,), the room that each frontier lies in.
    """
    closed, leftover = logistic(scores[:2])
    closed, area = np.maximum(closed, leftover), np.maximum(np.expm1(np.minimum(scores[2], _VAST)), 0.0)
    area = np.where(
        leftover > 0.5, np.minimum(area, math.nextafter(LITTLE_LEFT, 0.0)), np.maximum(area, LITTLE_LEFT)
    )
    is_closed = (closed > CLOSED) | (leftover > 0.5)
    classes = FrontierClasses(is_closed, rooms, area)
    return classes, np.where(is_closed, closed, 1.0 - closed)


def classify_cells(candidates: CandidateCells, resolution: float, forests: dict[str, Forest]) -> Floats:
    """Probability float64 (n,) that each cell belongs to the room of its region, estimated twice.

    Args:
        candidates: The cells.
        resolution: Metres per cell.
        forests: "first" (log-odds), which is followed by "inside", which knows the first estimate.
    """
    first = forests["first"].probability(candidates.features)
    return forests["inside"].probability(add_first_estimate(candidates, first, resolution))


def agreed(probability: Floats, log_odds: NDArray[np.floating]) -> Floats:
    """The joint probability float64 (n,) of trees and network, by the mean of their log-odds.

    Args:
        probability: float64 (n,), of the trees.
        log_odds: float (n,), of the network.

    Example:
        >>> agreed(np.array([0.5, 0.9]), np.array([0.0, -np.log(9.0)])).round(3).tolist()
        [0.5, 0.392]
    """
    sure = np.clip(probability, 1e-5, 1.0 - 1e-5)
    return logistic((1.0 - ROOM_SHARE) * np.log(sure / (1.0 - sure)) + ROOM_SHARE * log_odds)
