"""Samples for the predictor of rooms: stopped explorations of floor plans whose rooms are known.

Every frontier is a sample with its true class and the true area left, and the unknown cells near a seen
region are samples of whether they are floor of its room.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from layoutexplore.frontiers.classes import FrontierClasses, true_classes
from layoutexplore.grids.arrays import Bytes, Floats, Floats32, Ints, Mask
from layoutexplore.layout.doorways import Regions, doorway_regions
from layoutexplore.maps.floorplan import PlanRaster
from layoutexplore.metrics.overlaps import most_shared
from layoutexplore.predictors.cell_model.features import CandidateCells, find_candidates
from layoutexplore.predictors.cell_model.network_input import NetworkInput, make_network_input
from layoutexplore.predictors.frontier_model.features import (
    FEATURES,
    Surroundings,
    frontier_features,
    look_around,
)
from layoutexplore.predictors.frontier_model.network_input import PLANES as CROP_PLANES
from layoutexplore.predictors.frontier_model.network_input import SIDE, draw_crops, draw_truth
from layoutexplore.predictors.snapshot import Snapshot

REGIONS = 8
"""Regions of a decision whose cells are kept."""


@dataclass(frozen=True, eq=False)
class CellSamples:
    """The cells that some regions of one decision may own.

    Attributes:
        candidates: All cells of these regions.
        inside: bool (n,), the cell is floor of the room that its region is the seen part of.
        resolution: Metres per cell.
        building: Group of the floor plan.
    """

    candidates: CandidateCells
    inside: Mask
    resolution: float
    building: str


@dataclass(frozen=True, eq=False)
class CellNetworkSample:
    """All lattice cells of one decision.

    Attributes:
        scene: What is known.
        inside: bool (n,), it is floor of the room that the region is the seen part of.
        plan: Name of the floor plan.
    """

    scene: NetworkInput
    inside: Mask
    plan: str


@dataclass(frozen=True, eq=False)
class CropSamples:
    """The crops of a plan's frontiers with what is true of the frontiers.

    Attributes:
        crops: uint8 (n, SIDE, SIDE, PLANES), of `draw_crops`.
        closed: bool (n,).
        area: float64 (n,), square metres left in the room behind.
        truth: uint8 (n, SIDE, SIDE), of `draw_truth`.
        plan: Name of the floor plan.
    """

    crops: Bytes
    closed: Mask
    area: Floats
    truth: Bytes
    plan: str


@dataclass(frozen=True, eq=False)
class PredictorSamples:
    """Frontiers and cells with what is true of them.

    Attributes:
        features: float32 (n, features).
        closed: bool (n,).
        area: float64 (n,), square metres left in the room behind.
        building: str (n,), group of the floor plan.
        real: bool (n,), whether the plan has such a group; others are generated.
        cells: One entry a decision.
    """

    features: Floats32
    closed: Mask
    area: Floats
    building: NDArray[np.str_]
    real: Mask
    cells: list[CellSamples]

    def of_buildings(self, wanted: Callable[[str], bool]) -> PredictorSamples:
        """The samples of the wanted buildings."""
        kept = np.isin(self.building, [name for name in np.unique(self.building).tolist() if wanted(name)])
        cells = [part for part in self.cells if wanted(part.building)]
        frontiers = (
            self.features[kept],
            self.closed[kept],
            self.area[kept],
            self.building[kept],
            self.real[kept],
        )
        return PredictorSamples(*frontiers, cells)


def gather(snapshots: Sequence[Sequence[Snapshot]], *, cells: bool = True) -> PredictorSamples:
    """Samples for trees from explorations, perhaps none; every plan is a building of its own.

    Args:
        snapshots: The decisions kept of each exploration.
        cells: Also those of cells, which take most of the time and memory.
    """
    features, closed = [np.zeros((0, len(FEATURES)), np.float32)], [np.zeros(0, np.bool_)]
    area, building = [np.zeros(0)], [np.zeros(0, np.str_)]
    found: list[CellSamples] = []
    for number, exploration in enumerate(snapshots):
        rng = np.random.default_rng(number)
        for snapshot in exploration:
            grid = snapshot.decision.grid
            regions = doorway_regions(grid.cells, grid.resolution)
            around, true = _look(snapshot, regions)
            features.append(frontier_features(around, snapshot.decision.table.visible_area))
            closed.append(true.is_closed)
            area.append(true.remaining_area)
            building.append(np.full(len(true.is_closed), snapshot.plan))
            if cells:
                found.append(_cell_samples(snapshot, regions, rng))
    names = np.concatenate(building)
    real = np.zeros(len(names), np.bool_)
    return PredictorSamples(
        np.concatenate(features), np.concatenate(closed), np.concatenate(area), names, real, found
    )


def join_samples(parts: Sequence[PredictorSamples], groups: Mapping[str, str]) -> PredictorSamples:
    """All samples in one; the building of a plan by its name, itself where there is none."""
    names, which = np.unique(np.concatenate([part.building for part in parts]), return_inverse=True)
    building = np.array([groups.get(name, name) for name in names.tolist()])[which]
    real = np.array([name in groups for name in names.tolist()], np.bool_)[which]
    cells = [
        replace(cell, building=groups.get(cell.building, cell.building))
        for part in parts
        for cell in part.cells
    ]
    return PredictorSamples(
        features=np.concatenate([part.features for part in parts]),
        closed=np.concatenate([part.closed for part in parts]),
        area=np.concatenate([part.area for part in parts]),
        building=building,
        real=real,
        cells=cells,
    )


def gather_network_inputs(snapshots: Iterable[Snapshot]) -> list[CellNetworkSample]:
    """Samples for the cell network: one of each decision that has candidate cells."""
    samples = []
    for snapshot in snapshots:
        grid = snapshot.decision.grid
        regions = doorway_regions(grid.cells, grid.resolution)
        found = find_candidates(grid.cells, regions, grid.resolution)
        if len(found.cells):
            scene = make_network_input(grid.cells, regions, found, grid.resolution)
            inside = _are_inside(found, regions, snapshot.truth.raster)
            samples.append(CellNetworkSample(scene, inside, snapshot.plan))
    return samples


def gather_crops(snapshots: Iterable[Snapshot], plan: str) -> CropSamples:
    """Samples for the frontier network from decisions in a plan, of which there may be none."""
    crops = [np.zeros((0, SIDE, SIDE, CROP_PLANES), np.uint8)]
    closed, area = [np.zeros(0, np.bool_)], [np.zeros(0)]
    truth = [np.zeros((0, SIDE, SIDE), np.uint8)]
    for snapshot in snapshots:
        grid, raster = snapshot.decision.grid, snapshot.truth.raster
        around, true = _look(snapshot, doorway_regions(grid.cells, grid.resolution))
        crops.append(draw_crops(around))
        closed.append(true.is_closed)
        area.append(true.remaining_area)
        truth.append(draw_truth(around, true.room, raster.room_ids, raster.free))
    return CropSamples(
        np.concatenate(crops), np.concatenate(closed), np.concatenate(area), np.concatenate(truth), plan
    )


def _look(snapshot: Snapshot, regions: Regions) -> tuple[Surroundings, FrontierClasses]:
    """What lies around a snapshot's frontiers, and their true classes."""
    decision, grid = snapshot.decision, snapshot.decision.grid
    around = look_around(grid.cells, decision.clusters, regions, grid.resolution)
    return around, true_classes(decision, snapshot.truth)


def _cell_samples(snapshot: Snapshot, regions: Regions, rng: np.random.Generator) -> CellSamples:
    """The cells of some regions, drawn at random."""
    grid, truth = snapshot.decision.grid, snapshot.truth.raster
    order = 1 + rng.permutation(regions.count)
    chosen = np.zeros(regions.count + 1, np.bool_)
    chosen[order[:REGIONS]] = True
    kept = find_candidates(grid.cells, regions, grid.resolution, wanted=chosen)
    return CellSamples(kept, _are_inside(kept, regions, truth), grid.resolution, snapshot.plan)


def _are_inside(candidates: CandidateCells, regions: Regions, truth: PlanRaster) -> Mask:
    """Whether each candidate is floor of the room that its region is the seen part of."""
    room = seen_rooms(regions, truth)[candidates.region]
    rows, cols = candidates.cells.T
    return np.asarray(truth.free[rows, cols] & (truth.room_ids[rows, cols] == room) & (room > 0))


def seen_rooms(regions: Regions, truth: PlanRaster) -> Ints:
    """The true room int64 (regions + 1,) that each region is mostly part of; 0 for none."""
    seen = regions.labels > 0
    return most_shared(regions.labels[seen], truth.room_ids[seen], count=regions.count + 1)[0]
