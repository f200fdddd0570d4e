"""A map turned to its walls, its door-gap candidates, and what of its obstacles is wall and what clutter."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from layoutexplore.grids.arrays import Cells, Floats, Mask
from layoutexplore.grids.grid import OCCUPIED
from layoutexplore.layout.alignment import Turned, askew_directions, main_direction, surfaces, turn
from layoutexplore.layout.canonical import canonical_orientation, trinary_part
from layoutexplore.layout.lines.declutter import DeclutterConfig, Directions, find_directions
from layoutexplore.layout.merging.door_gaps import DoorGapConfig, DoorGaps, find_door_gaps
from layoutexplore.layout.merging.walls.raggedness import is_ragged
from layoutexplore.layout.merging.walls.wall_components import structural_components
from layoutexplore.layout.timing import StageTimer


@dataclass(frozen=True, kw_only=True)
class AlignedMapConfig(DoorGapConfig):
    """What counts as a door-gap candidate and as clutter; lengths in metres.

    Attributes:
        clutter_area: Obstacles that float freely are clutter below this occupied area [m2] ...
        clutter_length: ... unless they are this long: a curved or diagonal wall hangs on nothing.
        clutter_gap: Obstacles this far apart count as one: a thin wall is seen in pieces.
    """

    clutter_area: float = 1.0
    clutter_length: float = 2.0
    clutter_gap: float = 0.1


@dataclass(frozen=True, eq=False)
class AlignedMap:
    """A map in the frame of its walls.

    Attributes:
        turned: The known part of the map, aligned with its walls.
        wall: bool of the shape of `turned.cells`, occupied cells that are wall.
        clutter: bool, occupied cells that are no wall.
        gaps: The door-gap candidates.
        shut: bool, their cells that hang on walls.
        structure: The directions of its walls, in the frame of its known part (the profile in the frame it
            was brought into).
        askew: float64 (n,), directions of further walls where a wing stands askew, in the turned frame.
        ragged: Whether its walls are those of a recorded map, not of a drawn one.
    """

    turned: Turned
    wall: Mask
    clutter: Mask
    gaps: DoorGaps
    shut: Mask
    structure: Directions
    askew: Floats
    ragged: bool


def align_map(cells: Cells, resolution: float, config: AlignedMapConfig, timer: StageTimer) -> AlignedMap:
    """Turn a grid to its walls, and tell its door gaps, walls and clutter.

    Args:
        cells: int8 (rows, cols), with at least one free cell.
        resolution: Metres a cell.
        config: The options.
        timer: Takes the times of the stages.
    """
    with timer("directions"):
        part, corner = trinary_part(cells)
        orientation = canonical_orientation(part)
        oriented = orientation.apply(part)
        structure = find_directions(surfaces(oriented), resolution, DeclutterConfig())
        turned = turn(oriented, main_direction(structure.profile), corner, orientation)
        askew = askew_directions(structure.directions, turned.angle)
        structure = replace(structure, directions=np.sort(orientation.invert_angles(structure.directions)))
    with timer("openings"):
        occupied = turned.cells == OCCUPIED
        gaps = find_door_gaps(occupied, resolution, config, askew)
        doors = gaps.gap > 0
        structural = structural_components(
            occupied,
            doors,
            resolution,
            gap=config.clutter_gap,
            area=config.clutter_area,
            length=config.clutter_length,
        )
    return AlignedMap(
        turned,
        occupied & structural,
        occupied & ~structural,
        gaps,
        doors & structural,
        structure,
        askew,
        is_ragged(turned.cells, resolution),
    )
