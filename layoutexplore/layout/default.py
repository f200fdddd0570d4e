"""The default method: pieces of the free space, merged into rooms by a learned judge.

1. The map is turned to its main direction (ROSE's profile of the walls' surfaces).
2. Short gaps in line with walls are candidate doors. With them shut, what floats freely and is small is clutter; the rest
   is wall.
3. The distance to walls, shut doors and unseen space falls into basins: more pieces than there are rooms.
4. A small forest of decision trees looks at two touching pieces (the pass between them, the doors and walls in line with
   it, their shapes and that of their union, ...) and merges the surest pair, again and again, while it is likely that
   both belong to one room.
5. Pieces too small for a room are dropped; the rooms' cells are turned back.

What varies from map to map is in the features; there is one set of parameters.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from layoutexplore.errors import ConfigError
from layoutexplore.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from layoutexplore.layout.basins import closed_space, distance_basins
from layoutexplore.layout.declutter import DeclutterConfig, find_structure
from layoutexplore.layout.default_turn import Turned, main_direction, surfaces, trinary_part, turn, turn_back
from layoutexplore.layout.merging import Forest, merge_pieces
from layoutexplore.layout.merging_graph import PieceGraph, piece_graph
from layoutexplore.layout.merging_model import load_forest
from layoutexplore.layout.openings import find_openings
from layoutexplore.layout.outlines import number_rooms, rooms_of_labels
from layoutexplore.layout.registry import register_method
from layoutexplore.layout.timing import StageTimer
from layoutexplore.layout.types import Layout, empty_layout, has_free_space
from layoutexplore.layout.wavefront import grow_labels


@dataclass(frozen=True, kw_only=True)
class DefaultConfig:
    """Options of the default method; lengths in metres.

    Attributes:
        door_min: Narrowest gap that may be a door.
        door_max: Widest gap that may be one; the judge decides.
        door_run: A wall beside a door is at least this long.
        clutter_area: Obstacles that float freely are clutter below this occupied area [m2] ...
        clutter_length: ... unless they are this long: a curved or diagonal wall hangs on nothing.
        chink: Unseen space between seen space narrower than twice this is taken as free.
        basin_share: Two basins are one where the pass between them is at least this share of the lower peak ...
        basin_wide: ... or so far from all obstacles.
        merge_level: Pieces merge while the log-odds of belonging together are at least this.
        room_area: Smallest room [m2].
    """

    door_min: float = 0.45
    door_max: float = 3.0
    door_run: float = 0.3
    clutter_area: float = 1.0
    clutter_length: float = 2.0
    chink: float = 0.25
    basin_share: float = 0.85
    basin_wide: float = 1.5
    merge_level: float = 0.25
    room_area: float = 1.5

    def __post_init__(self) -> None:
        if not 0 < self.door_min <= self.door_max:
            raise ConfigError("door_min must be above 0 and at most door_max")
        if not 0 < self.basin_share <= 1:
            raise ConfigError(f"basin_share must lie in (0, 1], got {self.basin_share}")
        if (
            min(self.door_run, self.clutter_area, self.clutter_length, self.basin_wide) <= 0
            or min(self.chink, self.room_area) < 0
        ):
            raise ConfigError("lengths and areas must be above 0 (chink and room_area may be 0)")


@dataclass(frozen=True, eq=False)
class Pieces:
    """The pieces of a map before they merge.

    Attributes:
        turned: The known part of the map, aligned with its walls.
        labels: int32 of the shape of `turned.cells`, the pieces.
        clutter: bool, occupied cells that are no wall.
        graph: What the pieces are like.
        structure_score: ROSE's W.
        directions: Dominant directions of the walls in the frame of the grid, in radians.
    """

    turned: Turned
    labels: NDArray[np.int32]
    clutter: NDArray[np.bool_]
    graph: PieceGraph
    structure_score: float
    directions: NDArray[np.float64]


def split_clutter(
    occupied: NDArray[np.bool_], doors: NDArray[np.bool_], resolution: float, config: DefaultConfig
) -> NDArray[np.bool_]:
    """Obstacles and doors that belong to the building: bool (rows, cols); the rest floats freely and is small."""
    solid = (occupied | doors).astype(np.uint8)
    count, parts, stats, _ = cv2.connectedComponentsWithStats(solid, connectivity=8)
    area = np.bincount(parts[occupied], minlength=count) * resolution**2
    length = np.maximum(stats[:, cv2.CC_STAT_WIDTH], stats[:, cv2.CC_STAT_HEIGHT]) * resolution
    building = (area >= config.clutter_area) | (length > config.clutter_length)
    building[0] = False
    return np.asarray(building[parts])


def find_pieces(cells: NDArray[np.int8], resolution: float, config: DefaultConfig, timer: StageTimer) -> Pieces:
    """Cut the free space of a grid into pieces, no piece in two rooms.

    Args:
        cells: int8 (rows, cols), with at least one free cell.
        resolution: Metres a cell.
        config: The options.
        timer: Takes the times of the stages.
    """
    with timer("directions"):
        part, corner = trinary_part(cells)
        structure = find_structure(surfaces(part), resolution, DeclutterConfig())
        turned = turn(part, main_direction(structure.profile), corner)
    with timer("openings"):
        occupied = turned.cells == OCCUPIED
        openings = find_openings(
            occupied, resolution, width_min=config.door_min, width_max=config.door_max, run_min=config.door_run
        )
        building = split_clutter(occupied, openings.width > 0, resolution, config)
        wall = occupied & building
    with timer("basins"):
        inside = ~wall & (closed_space(turned.cells, resolution, config.chink) | (turned.cells != UNKNOWN))
        basins = distance_basins(
            ~inside | ((openings.width > 0) & building), resolution, share=config.basin_share, wide=config.basin_wide
        )
        labels = grow_labels(basins, inside)
    with timer("graph"):
        padded = cv2.copyMakeBorder(inside.astype(np.uint8), 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=0)
        distance = cv2.distanceTransform(padded, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)[1:-1, 1:-1]
        graph = piece_graph(
            labels,
            free=turned.cells == FREE,
            clutter=occupied & ~wall,
            wall=wall,
            distance=np.ascontiguousarray(distance),
            doors=(openings.width, openings.long_run, openings.short_run),
            resolution=resolution,
        )
    return Pieces(turned, labels, occupied & ~wall, graph, structure.score, structure.directions)


def merge_into_rooms(
    pieces: Pieces, grid: OccupancyGrid, config: DefaultConfig, forest: Forest
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Room labels of the grid's cells that are not occupied, and the rooms' footprints with the furniture in them."""
    into = merge_pieces(pieces.graph, forest, level=config.merge_level)
    footprint = turn_back(into[pieces.labels], pieces.turned, grid.shape)
    if pieces.turned.angle:
        footprint = grow_labels(footprint, grid.free)
    area = np.bincount(footprint[grid.free], minlength=len(into)) * grid.resolution**2
    keep = area >= config.room_area
    keep[0] = False
    footprint = number_rooms(np.where(keep[footprint], footprint, np.int32(0)))
    return np.where(grid.occupied, np.int32(0), footprint), footprint


@register_method("default", DefaultConfig)
def run_default(grid: OccupancyGrid, config: DefaultConfig) -> Layout:
    """Rooms of a complete or partial, clean or cluttered grid."""
    return reconstruct_with(grid, config, load_forest())


def reconstruct_with(grid: OccupancyGrid, config: DefaultConfig, forest: Forest) -> Layout:
    """`run_default` with another judge than the shipped one."""
    if not has_free_space(grid):
        return empty_layout("default", grid, "the grid has no free cell")
    timer = StageTimer()
    pieces = find_pieces(grid.cells, grid.resolution, config, timer)
    with timer("merging"):
        labels, footprint = merge_into_rooms(pieces, grid, config, forest)
    with timer("outlines"):
        rooms = rooms_of_labels(labels, grid, footprint)
    with timer("clean grid"):
        clean = clean_grid(pieces, grid)
    warnings: list[str] = []
    if not rooms:
        warnings.append("no room found: the free space is too small or too narrow")
    if not len(pieces.directions):
        warnings.append("no dominant direction: the map has no straight walls")
    extra: dict[str, Any] = {"directions": np.mod(np.asarray(pieces.directions) + grid.origin.theta, np.pi)}
    return Layout(
        method="default",
        clean_grid=clean,
        labels=labels,
        rooms=rooms,
        structure_score=pieces.structure_score,
        timings=timer.seconds,
        warnings=tuple(warnings),
        **extra,
    )


def clean_grid(pieces: Pieces, grid: OccupancyGrid) -> OccupancyGrid:
    """The grid with its clutter turned free."""
    clutter = turn_back(pieces.clutter.astype(np.int32), pieces.turned, grid.shape) > 0
    return OccupancyGrid(np.where(clutter & grid.occupied, np.int8(FREE), grid.cells), grid.resolution, grid.origin)
