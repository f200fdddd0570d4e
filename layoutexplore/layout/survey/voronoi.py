"""Room segmentation by critical lines of the Voronoi graph (Thrun and Bücken; Bormann et al. 2016).

Cells of the Voronoi graph where the free space is narrowest are critical points; the lines from them to the
walls cut the free space into regions, and regions that share much of their border merge.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from layoutexplore.errors import ConfigError
from layoutexplore.grids.arrays import Ints32, Mask
from layoutexplore.grids.flood import grow_labels
from layoutexplore.layout.survey.border_merging import merge_by_borders
from layoutexplore.layout.survey.critical_lines import critical_lines
from layoutexplore.layout.survey.voronoi_graph import contour_cells, critical_points, voronoi_graph
from layoutexplore.options import Rule, check, check_fields


@dataclass(frozen=True, kw_only=True)
class VoronoiConfig:
    """Options of the Voronoi method, by default those of the survey's program.

    Attributes:
        neighbourhood: A critical point is the narrowest of 280 / D cells of the graph, D its distance to the
            walls in cells.
        iterations: A neighbourhood grows so many times at most.
        spacing: Of two critical points closer than this share of their distance to the walls one is dropped.
        area_min: Smallest region [m2].
        merge_area: A room with one neighbour merges with it below this area [m2].
    """

    neighbourhood: int = 280
    iterations: int = 150
    spacing: float = 0.5
    area_min: float = 0.1
    merge_area: float = 12.5

    def __post_init__(self) -> None:
        check_fields(self)
        check(self, neighbourhood=Rule(kind=int, high=1e9), iterations=Rule(kind=int, high=1e9))
        least = min(self.spacing, self.area_min, self.merge_area)
        if min(self.neighbourhood, self.iterations) < 1 or least < 0:
            raise ConfigError(
                "neighbourhood and iterations must be above 0, spacing, area_min and merge_area not below"
            )


def voronoi_labels(free: Mask, resolution: float, config: VoronoiConfig) -> Ints32:
    """Rooms of the Voronoi method, int32 (rows, cols), 0 outside the free space."""
    regions = grow_labels(voronoi_regions(free, resolution, config), free)
    return merge_by_borders(regions, resolution, merge_area=config.merge_area)


def voronoi_regions(free: Mask, resolution: float, config: VoronoiConfig) -> Ints32:
    """What the critical lines leave of the free space, int32 (rows, cols): regions from 1, 0 elsewhere."""
    cells = cv2.distanceTransform(np.pad(free, 1).astype(np.uint8), cv2.DIST_L2, 5)[1:-1, 1:-1]
    distance = np.ascontiguousarray(np.minimum(np.rint(cells), 255).astype(np.uint8))
    walls = contour_cells(free)
    points = critical_points(voronoi_graph(free, walls), distance, config.neighbourhood, config.iterations)
    cut = free.astype(np.uint8, order="C")
    for point, *ends in critical_lines(points, walls, distance, config.spacing)[:, :, ::-1].tolist():
        for end in ends:
            cv2.line(cut, point, end, 0, 2)
    # of a region with holes the outer contour is the longer way around: its area is the largest
    contours, _ = cv2.findContours(cut, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    count, parts = cv2.connectedComponents(cut, connectivity=8)
    areas = np.zeros(count)
    for contour in contours:
        col, row = contour[0, 0]
        part = parts[row, col]
        areas[part] = max(areas[part], cv2.contourArea(contour) * resolution**2)
    keep = areas >= config.area_min
    keep[0] = False
    return np.where(keep[parts], parts, 0).astype(np.int32)
