"""ROSE2: room segmentation of cluttered grids (Luperto, Kucner, Tassi, Magnusson, Amigoni).

ROSE declutters the map and gives the directions (III-A), segments become walls and representative lines
(III-B), the faces of the lines become rooms (III-C), and rooms whose topological graph falls apart are split
(III-D).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from layoutexplore.errors import ConfigError
from layoutexplore.grids.arrays import Floats, Ints, Mask
from layoutexplore.grids.grid import OccupancyGrid
from layoutexplore.layout.canonical import in_canonical_orientation
from layoutexplore.layout.frame import undirected
from layoutexplore.layout.limits import left_out, most_lines
from layoutexplore.layout.lines.assemble import assemble, clean_grid
from layoutexplore.layout.lines.declutter import (
    DeclutterConfig,
    Directions,
    Structure,
    find_structure,
    wall_surface,
)
from layoutexplore.layout.lines.face_model import FaceConfig, WallModel, build_faces, find_rooms
from layoutexplore.layout.lines.segments import AlignedSegments, SegmentConfig, align, find_segments, project
from layoutexplore.layout.lines.topology import TopologyConfig, split_rooms
from layoutexplore.layout.lines.walls import WallGroups, find_walls, merge_walls, on_heaviest
from layoutexplore.layout.pipeline import register_method
from layoutexplore.layout.timing import StageTimer
from layoutexplore.layout.types import Layout, ScoreDetails, empty_layout, has_free_space
from layoutexplore.options import Rule, check

S = TypeVar("S", bound=Directions)


@dataclass(frozen=True, kw_only=True)
class Rose2Config(DeclutterConfig, SegmentConfig, FaceConfig, TopologyConfig):
    """Every option of the rose2 method; lengths in metres. See also the classes it extends.

    Attributes:
        wall_depth: Occupied cells deeper than this in solid masses are no walls.
        level: Least score of a cell of the clean map, at first.
        level_step: It rises by this while the segments are too dense ...
        level_max: ... but not above this.
        density: Most segments that a search of the clean map finds per square metre of free space.
        deviation: Segments farther than this from every dominant direction, in degrees, are left out.
        wall_gap: Segments of one direction closer than this belong to one wall.
        line_distance: Walls of one direction closer than this share a representative line ("a doorway").
    """

    wall_depth: float = 0.5
    level: float = 0.15
    level_step: float = 0.03
    level_max: float = 0.3
    density: float = 1.6
    deviation: float = 30.0
    wall_gap: float = 0.6
    line_distance: float = 0.6

    def __post_init__(self) -> None:
        for parent in (DeclutterConfig, SegmentConfig, FaceConfig, TopologyConfig):
            parent.__post_init__(self)  # the first checks every field's kind
        if not 0 < self.level <= self.level_max < 1 or self.level_step < 1e-3:
            raise ConfigError(
                "levels must rise from above 0 to below 1 by 0.001 or more, "
                f"got {self.level} to {self.level_max} by {self.level_step}"
            )
        check(self, wall_gap=Rule(high=1e6))
        if self.wall_gap < 0 or self.line_distance < 0 or self.deviation <= 0:
            raise ConfigError("wall_gap and line_distance must not be negative, deviation must be above 0")


@in_canonical_orientation
def rose2(grid: OccupancyGrid, config: Rose2Config) -> Layout:
    """Run ROSE2 on a grid."""
    timer = StageTimer()
    if not has_free_space(grid):
        return empty_layout("rose2", grid, "no free space: nothing has been seen")
    with timer("declutter"):
        occupied = wall_surface(grid, config.wall_depth)
        structure = with_perpendicular(find_structure(occupied, grid.resolution, config))
    with timer("segments"):
        mask, segments = clean_map(occupied, structure, grid, config)
    model = find_wall_model(grid, structure, mask, segments, config, timer)
    doubts = left_out(grid.shape, len(segments), 0 if model is None else len(model.lines))
    if model is None:
        return empty_layout(
            "rose2",
            grid,
            "no walls: the map has no dominant direction"
            if not len(structure.directions)
            else "no wall segment was found",
            structure_score=structure.score,
            clean_grid=clean_grid(grid, mask),
            timings=timer.seconds,
            details=ScoreDetails(structure.cell_scores),
        )
    faces = build_faces(grid, model, config, timer)
    with timer("clusters"):
        room = find_rooms(faces, config)
    if config.split and room.max(initial=-1) >= 0:
        with timer("topology"):
            model, faces, room = split_rooms(grid, model, faces, room, config, config)
    if structure.score > 0.4:
        doubts += (f"structure score {structure.score:.2f} is above 0.4: do not trust the layout",)
    return assemble("rose2", grid, model, faces, room, timer, doubts)


def with_perpendicular(structure: S) -> S:
    """A single direction closes no room: its perpendicular joins it."""
    if len(structure.directions) != 1:
        return structure
    both = undirected(structure.directions[0] + np.array((0.0, np.pi / 2)))
    return replace(structure, directions=np.sort(both))


def clean_map(
    occupied: Mask, structure: Structure, grid: OccupancyGrid, config: Rose2Config
) -> tuple[Mask, Floats]:
    """The cells of the clean map bool (rows, cols), and their segments float64 (n, 4).

    The level starts low and rises until the segments are no denser than walls can be: clutter makes many
    short ones. The paper tunes the level to an interval of segments per free cell that it does not print.
    """
    most = config.density * (1 + config.twice) * max(grid.free_area, grid.resolution**2)
    level = config.level
    while True:
        mask = occupied & (structure.cell_scores >= level)
        segments = find_segments(mask, grid.resolution, config)
        if len(segments) <= most or level + config.level_step > config.level_max:
            return mask, segments
        level += config.level_step


def chain_walls(
    segments: Floats, structure: Directions, config: Rose2Config, most: int
) -> tuple[AlignedSegments, Ints, WallGroups, WallGroups] | None:
    """Aligned segments, their rows in `segments`, walls and at most `most` lines; None without a wall."""
    if not len(structure.directions) or not len(segments):
        return None
    aligned, kept = align(segments, structure.directions, np.radians(config.deviation))
    if not len(aligned):
        return None
    walls = find_walls(aligned, config.wall_gap)
    lines = merge_walls(aligned, walls, config.line_distance)
    heavy = on_heaviest(lines, most)
    if heavy is not None:
        kept = kept[heavy]
        aligned = project(segments[kept], structure.directions, aligned.direction[heavy])
        walls = find_walls(aligned, config.wall_gap)
        lines = merge_walls(aligned, walls, config.line_distance)
    return aligned, kept, walls, lines


def find_wall_model(
    grid: OccupancyGrid,
    structure: Structure,
    mask: Mask,
    segments: Floats,
    config: Rose2Config,
    timer: StageTimer,
) -> WallModel | None:
    """Walls and representative lines of the clean map; None when there is no wall."""
    with timer("walls"):
        chained = chain_walls(segments, structure, config, most_lines(grid.shape))
    if chained is None:
        return None
    aligned, kept, walls, lines = chained
    return WallModel(
        clean_grid=clean_grid(grid, mask),
        segments=segments[kept],
        aligned=aligned,
        walls=walls,
        lines=lines,
        structure_score=structure.score,
        cell_scores=structure.cell_scores,
    )


register_method("rose2", "ROSE2: rooms from the lines of a decluttered map", rose2, Rose2Config)
