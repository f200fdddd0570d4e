"""The classic room segmentations, for comparison: morphological and distance transform.

Bormann et al., "Room segmentation: survey, implementation, and analysis" (ICRA 2016), written from the
description of the algorithms. Only free cells take part; unknown and occupied ones are obstacles. Lengths and
areas are in metres, with the authors' steps of one cell kept as steps of one cell. Ties go to the lower
label, in raster order of the map in its canonical orientation.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, cast

import cv2
import numpy as np

from layoutexplore.errors import ConfigError
from layoutexplore.grids.arrays import Bytes, Floats, Ints32, Mask
from layoutexplore.grids.flood import grow_labels
from layoutexplore.grids.grid import OccupancyGrid
from layoutexplore.layout.canonical import in_canonical_orientation
from layoutexplore.layout.outlines import layout_of_labels
from layoutexplore.layout.pipeline import register_method
from layoutexplore.layout.survey.voronoi import VoronoiConfig, voronoi_labels
from layoutexplore.layout.timing import StageTimer
from layoutexplore.layout.types import Layout, empty_layout, has_free_space
from layoutexplore.options import check_fields

PEN = 7
"""Width of the pen that draws the outlines of the distance method's seeds; the wave fills the inside.

The authors' choice; like their erosion, which takes one cell at a time, it does not follow the resolution: a
pen of 0.35 m would draw other rooms at 0.1 m.
"""


@dataclass(frozen=True, kw_only=True)
class MorphologicalConfig:
    """Erode the free space step by step; a region that falls into the area range is a room.

    Attributes:
        area_min: Smallest eroded room [m2], as in the survey's program.
        area_max: Largest eroded room [m2].
        depth: The erosion stops so far from the walls [m]: their 73 steps of 0.05 m.
    """

    area_min: float = 0.8
    area_max: float = 47.0
    depth: float = 3.65

    def __post_init__(self) -> None:
        check_fields(self)
        if not 0 <= self.area_min < self.area_max or self.depth <= 0:
            raise ConfigError("area_min must be at least 0 and below area_max, depth above 0")


@dataclass(frozen=True, kw_only=True)
class DistanceConfig:
    """The threshold on the distance that gives most regions within the area range gives the rooms.

    Attributes:
        area_min: Smallest region [m2], as in the survey's program.
        area_max: Largest region [m2].
    """

    area_min: float = 0.35
    area_max: float = 163.0

    def __post_init__(self) -> None:
        check_fields(self)
        if not 0 <= self.area_min < self.area_max:
            raise ConfigError("area_min must be at least 0 and below area_max")


Contours = Sequence[Ints32]


def regions_with_areas(mask: Bytes) -> tuple[Contours, Ints32, list[int], Floats]:
    """Outer contours of the regions of a mask and the areas of their polygons less those of their holes.

    Args:
        mask: uint8 (rows, cols), not 0 inside the regions (8-connected).

    Returns:
        All contours, OpenCV's tree of them int32 (n, 4), the indices of the outer ones, and the area of each
        outer one in cells squared.
    """
    contours, tree = cv2.findContours(mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    if not contours:
        return (), np.zeros((0, 4), np.int32), [], np.zeros(0)
    nodes = np.asarray(tree, np.int32).reshape(-1, 4)
    parents = nodes[:, 3]
    areas = np.array([cv2.contourArea(c) for c in contours], np.float64)
    net = areas.copy()
    holes = parents >= 0
    np.subtract.at(net, parents[holes].astype(np.int64), areas[holes])
    outer = np.flatnonzero(~holes)
    return cast(Contours, contours), nodes, outer.tolist(), net[outer]


def morphological_labels(free: Mask, resolution: float, config: MorphologicalConfig) -> Ints32:
    """Rooms of the morphological method, int32 (rows, cols), 0 where no seed gets or nothing is free."""
    left = free.astype(np.uint8)
    seeds = np.zeros(free.shape, np.int32)
    kernel, label = np.ones((3, 3), np.uint8), 0
    for _ in range(math.ceil(config.depth / resolution)):
        left = cast("Bytes", cv2.erode(left, kernel))
        contours, tree, outer, areas = regions_with_areas(left)
        if not outer:
            break
        for index, area in zip(outer, areas * resolution**2, strict=True):
            if config.area_min < area < config.area_max:
                label += 1
                cv2.drawContours(seeds, [contours[index]], 0, label, cv2.FILLED)
                # what lies in its holes may still become a room
                cv2.drawContours(left, contours, index, 0, cv2.FILLED, hierarchy=tree[None], maxLevel=1)
    seeds[~free] = 0
    return grow_labels(seeds, free)


def distance_labels(free: Mask, resolution: float, config: DistanceConfig) -> Ints32:
    """Rooms of the distance method, int32 (rows, cols), 0 outside the free space and where no seed gets."""
    eroded = cv2.erode(free.astype(np.uint8), np.ones((3, 3), np.uint8))
    distance = np.minimum(np.rint(cv2.distanceTransform(eroded, cv2.DIST_L2, 5)), 255).astype(np.uint8)
    best: list[Ints32] = []
    for threshold in range(int(distance.max(initial=0)), 0, -1):
        contours, _, outer, areas = regions_with_areas((distance > threshold).astype(np.uint8))
        metres = areas * resolution**2
        kept = [
            contours[i] for i, a in zip(outer, metres, strict=True) if config.area_min <= a <= config.area_max
        ]
        if kept and len(kept) >= len(best):
            best = kept
    seeds = np.zeros(free.shape, np.int32)
    for label, contour in enumerate(best, start=1):
        cv2.drawContours(seeds, [contour], 0, label, PEN)
    seeds[~free] = 0
    return grow_labels(seeds, free)


def _labelled(name: str, labelling: Callable[..., Ints32], grid: OccupancyGrid, config: Any) -> Layout:
    """The layout of a method that labels the free cells of a grid."""
    if not has_free_space(grid):
        return empty_layout(name, grid, "the grid has no free cell")
    timer = StageTimer()
    with timer("segmentation"):
        labels = labelling(grid.free, grid.resolution, config)
    return layout_of_labels(name, grid, labels, timer)


@in_canonical_orientation
def morphological(grid: OccupancyGrid, config: MorphologicalConfig) -> Layout:
    """Rooms by `morphological_labels`."""
    return _labelled("morphological", morphological_labels, grid, config)


@in_canonical_orientation
def distance(grid: OccupancyGrid, config: DistanceConfig) -> Layout:
    """Rooms by `distance_labels`."""
    return _labelled("distance", distance_labels, grid, config)


@in_canonical_orientation
def voronoi(grid: OccupancyGrid, config: VoronoiConfig) -> Layout:
    """Rooms by `voronoi_labels`."""
    return _labelled("voronoi", voronoi_labels, grid, config)


register_method("morphological", "Erosion, step by step", morphological, MorphologicalConfig)
register_method("distance", "One threshold on the distance to the walls", distance, DistanceConfig)
register_method(
    "voronoi", "Critical lines of the Voronoi graph, small regions merged", voronoi, VoronoiConfig
)
