"""ROSE2: structure identification and room segmentation of cluttered grids (Luperto, Kucner, Tassi, Magnusson, Amigoni).

ROSE declutters the map and gives the directions (III-A), segments become walls and representative lines (III-B), the faces
of the lines become rooms (III-C), and rooms whose topological graph falls apart are split (III-D).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from layoutexplore.errors import ConfigError
from layoutexplore.grid import OCCUPIED, OccupancyGrid
from layoutexplore.layout.assembly import FaceConfig, WallModel, assemble, build_faces, clean_grid, find_rooms
from layoutexplore.layout.declutter import DeclutterConfig, Structure, find_structure
from layoutexplore.layout.registry import register_method
from layoutexplore.layout.segments import SegmentConfig, align, find_segments
from layoutexplore.layout.timing import StageTimer
from layoutexplore.layout.topology import TopologyConfig, split_rooms
from layoutexplore.layout.types import Layout, empty_layout, has_free_space
from layoutexplore.layout.walls import find_walls, merge_walls


@dataclass(frozen=True, kw_only=True)
class Rose2Config(DeclutterConfig, SegmentConfig, FaceConfig, TopologyConfig):
    """Every option of the rose2 method; lengths in metres. See also the classes it extends.

    Attributes:
        level: Least score of a cell of the clean map.
        deviation: Segments farther than this from every dominant direction, in degrees, are left out.
        wall_gap: Segments of one direction closer than this belong to one wall.
        line_distance: Walls of one direction closer than this share a representative line ("a doorway").
    """

    level: float = 0.18
    deviation: float = 30.0
    wall_gap: float = 0.35
    line_distance: float = 0.6

    def __post_init__(self) -> None:
        for parent in (DeclutterConfig, SegmentConfig, FaceConfig, TopologyConfig):
            parent.__post_init__(self)
        if not 0 < self.level < 1:
            raise ConfigError(f"level must lie between 0 and 1, got {self.level}")
        if self.wall_gap < 0 or self.line_distance < 0 or self.deviation <= 0:
            raise ConfigError("wall_gap and line_distance must not be negative, deviation must be above 0")


@register_method("rose2", Rose2Config)
def rose2(grid: OccupancyGrid, config: Rose2Config) -> Layout:
    """Run ROSE2 on a grid."""
    timer = StageTimer()
    if not has_free_space(grid):
        return empty_layout("rose2", grid, "no free space: nothing has been seen")
    occupied = grid.cells == OCCUPIED
    with timer("declutter"):
        structure = find_structure(occupied, grid.resolution, config)
        mask = occupied & (structure.cell_scores >= config.level)
    model = find_wall_model(grid, structure, mask, config, timer)
    if model is None:
        return empty_layout(
            "rose2",
            grid,
            "no walls: the map has no dominant direction" if not len(structure.directions) else "no wall segment was found",
            structure_score=structure.score,
            cell_scores=structure.cell_scores,
            clean_grid=clean_grid(grid, mask),
            timings=timer.seconds,
        )
    faces = build_faces(grid, model, config, timer)
    with timer("clusters"):
        room = find_rooms(faces, config)
    if config.split and room.max(initial=-1) >= 0:
        with timer("topology"):
            model, faces, room = split_rooms(grid, model, faces, room, config, config)
    return assemble("rose2", grid, model, faces, room, timer)


def find_wall_model(
    grid: OccupancyGrid, structure: Structure, mask: NDArray[np.bool_], config: Rose2Config, timer: StageTimer
) -> WallModel | None:
    """Segments, walls and representative lines of the clean map; None when there is no wall."""
    if not len(structure.directions):
        return None
    with timer("segments"):
        segments = find_segments(mask, grid.resolution, config)
        aligned, kept = align(segments, structure.directions, np.radians(config.deviation))
    if not len(aligned):
        return None
    with timer("walls"):
        walls = find_walls(aligned, config.wall_gap)
        lines = merge_walls(aligned, walls, config.line_distance)
    return WallModel(
        clean_grid=clean_grid(grid, mask),
        segments=segments[kept],
        aligned=aligned,
        walls=walls,
        lines=lines,
        structure_score=structure.score,
        cell_scores=structure.cell_scores,
    )
