"""Examples for the learnt merging of regions: which pairs of regions are one room in truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from layoutexplore.grids.arrays import Cells, Floats, Ints32
from layoutexplore.grids.grid import FREE
from layoutexplore.layout.alignment import turn_back
from layoutexplore.layout.merging.graph_tables import RegionGraph
from layoutexplore.layout.merging.method import MergingConfig, find_regions
from layoutexplore.layout.timing import StageTimer
from layoutexplore.metrics.overlaps import shared_cells

SIMULATED = "simulated"
"""Building of the simulated maps."""


@dataclass(frozen=True, eq=False)
class Example:
    """A map to learn from.

    Attributes:
        graph: Its regions.
        features: float64 (regions + 1, `RegionFeatures`), what each of them is like by itself.
        rooms: float64 (regions + 1, rooms + 1), known free cells of each region in each true room, column 0
            in none.
        building: Maps of one building are trained on together or not at all.
        kind: Maps of one kind and building share one weight.
        noisy: Whether it was simulated with the noise of recorded maps.
    """

    graph: RegionGraph
    features: Floats
    rooms: Floats
    building: str
    kind: str
    noisy: bool = False


def make_example(cells: Cells, truth: Ints32, resolution: float, *, building: str, kind: str) -> Example:
    """Cut a map into regions and count whose they are.

    Args:
        cells: int8 (rows, cols), the map.
        truth: int32 (rows, cols), true room of each cell, 0 for none.
        resolution: Metres a cell.
        building: Name of the building.
        kind: Kind of map, such as "empty".
    """
    regions = find_regions(cells, resolution, MergingConfig(), StageTimer(), asked=True)
    labels = turn_back(regions.labels, regions.turned, (cells.shape[0], cells.shape[1]))
    free = cells == FREE
    counts = shared_cells(labels[free], truth[free], count=len(regions.part)).astype(np.float64)
    rooms = np.zeros((len(regions.graph.nodes), counts.shape[1]))
    np.add.at(rooms, regions.part, counts)
    return Example(regions.graph, regions.features, rooms, building, kind)
