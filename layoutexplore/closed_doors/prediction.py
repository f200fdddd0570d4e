"""Rooms behind closed doors: finds the doors, scores rectangles behind each by trees, and draws the best.

One forest tells closed doors from walls, the other estimates how well a rectangle agrees with the room behind
a door; `layoutexplore.training.closed_doors` makes both. The task is that of the ECMR 2021 paper on rooms
behind closed doors; the method is another.

What the shipped trees learnt from, and how right they are, says MODEL_CARD.md beside them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from layoutexplore.closed_doors.candidates import rectangles
from layoutexplore.closed_doors.doors import DOOR_FEATURES, ClosedDoor, door_features, find_edges, is_marked
from layoutexplore.closed_doors.features import FEATURES, describe
from layoutexplore.closed_doors.models import Models, shipped_models
from layoutexplore.closed_doors.scene import Scene, room_space, wall_thickness
from layoutexplore.closed_doors.symmetry import best_mirror
from layoutexplore.errors import checks_arguments
from layoutexplore.grids.arrays import Cells, Floats, Floats32, Ints, Mask, shows_shapes
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid, in_cells
from layoutexplore.grids.morphology import with_neighbours

LEAST_DOOR = 0.25
"""Edges less likely to be doors are walls."""

MARKED = 0.7
"""Least probability of an edge that looks like a door (`is_marked`), whatever the trees say."""

LEAST = 0.4
"""Least estimated agreement of a rectangle, times the probability of its door, that is drawn.

A part raises an intersection over union of J when more than J / (1 + J) of it is right; J is about 0.7.
"""

_MARK = 0.8
"""Metres by which the line that marks a door may run on into the wall."""

MOST_EDGES, MOST_DOORS = 4000, 200
"""To each of the four sides so many edges are looked at, and so many doors opened: no floor has more."""

CHINK = 0.2
"""Pieces of free space of their own below this area were seen through chinks [m2]."""

DoorClassifier = Callable[[int, Ints, Floats32], Floats]
"""(quarter turns, edges int64 (n, 3), their features) -> probability float64 (n,) that each is a door."""


@shows_shapes
@dataclass(frozen=True, eq=False)
class ClosedRooms:
    """What is predicted behind closed doors.

    Attributes:
        grid: The grid with the predicted rooms free and their walls occupied.
        rooms: Bool (rows, cols): cells of predicted rooms and of the doorways that lead there, all of them
            unknown in the grid.
        confidence: Estimated agreement of each predicted room with the truth, 0..1.
        doors: Number of closed doors found.
        warnings: What was left out, in words.
    """

    grid: OccupancyGrid
    rooms: Mask
    confidence: tuple[float, ...]
    doors: int
    warnings: tuple[str, ...] = ()


@checks_arguments
def predict_closed_rooms(grid: OccupancyGrid, models: Models | None = None) -> ClosedRooms:
    """Predict the rooms behind the closed doors of a grid whose walls run along rows and columns.

    Args:
        grid: What has been seen.
        models: Trees that find doors and score rooms; the shipped ones when None.
    """
    models, grid = models or shipped_models(), grid.trinary
    cells = np.ascontiguousarray(grid.cells)
    doors = find_closed_doors(
        cells, grid.resolution, lambda turns, edges, features: door_probability(features, models)
    )
    rooms, doorways = np.zeros(grid.shape, np.bool_), np.zeros(grid.shape, np.bool_)
    confidence = []
    if any(doors):
        for turns, scene in enumerate(turned_scenes(cells, grid.resolution, doors)):
            for door in doors[turns]:
                box, agreement = _best_room(scene, door, models)
                if agreement < LEAST:
                    continue
                confidence.append(min(agreement, 1.0))
                top, left, bottom, right = box
                np.rot90(rooms, turns)[top:bottom, left:right] = True
                np.rot90(doorways, turns)[bottom : door.row + 1, door.start : door.stop] = True
        walls = without_doors(cells, grid.resolution, doors)
        rooms &= room_space(walls, wall_thickness(cells, grid.resolution))
        rooms = (rooms | doorways) & (cells == UNKNOWN)
    rim = with_neighbours(rooms)
    drawn = np.where(rooms, FREE, np.where(rim & (cells == UNKNOWN), OCCUPIED, grid.cells)).astype(np.int8)
    return ClosedRooms(
        OccupancyGrid(drawn, grid.resolution, grid.origin),
        rooms,
        tuple(confidence),
        sum(map(len, doors)),
        tuple(_left_out(cells, grid.resolution, doors)),
    )


def _left_out(cells: Cells, resolution: float, doors: Sequence[Sequence[ClosedDoor]]) -> Iterator[str]:
    """What `find_closed_doors` has left out, in words."""
    if any(len(find_edges(np.rot90(cells, turns), resolution)) > MOST_EDGES for turns in range(4)):
        yield f"of more than {MOST_EDGES} edges to one side only the widest were taken for doors"
    if any(len(found) == MOST_DOORS for found in doors):
        yield f"of more than {MOST_DOORS} doors to one side only the likeliest were opened"


def door_probability(features: Floats32, models: Models) -> Floats:
    """The probability float64 (n,) that edges with these `DOOR_FEATURES` are closed doors."""
    chances: Floats = np.maximum(models.doors.probability(features), MARKED * is_marked(features))
    return chances


def _best_room(scene: Scene, door: ClosedDoor, models: Models) -> tuple[tuple[int, ...], float]:
    """The best rectangle behind a door (top, left, bottom, right) and its estimated agreement, else 0."""
    boxes = rectangles(scene, door)
    if not len(boxes):
        return (), 0.0
    features = describe(scene, door, boxes).astype(np.float32)
    # What sticks out of all that is known is guesswork, and a door there may as well lead outside.
    agreement = models.rooms.score(features) * features[:, FEATURES.index("in_box")]
    best = int(agreement.argmax())
    return tuple(int(v) for v in boxes[best]), float(agreement[best]) * door.probability


def find_closed_doors(cells: Cells, resolution: float, classifier: DoorClassifier) -> list[list[ClosedDoor]]:
    """The closed doors of a grid turned by 0, 1, 2 and 3 quarters (`numpy.rot90`).

    Args:
        cells: int8 (rows, cols), as in `OccupancyGrid`.
        resolution: Metres a cell.
        classifier: Tells which edges are doors.
    """
    cells = without_chinks(cells, resolution)
    recess = [DOOR_FEATURES.index("recess"), DOOR_FEATURES.index("recess_other")]
    doors = []
    for turns in range(4):
        view = np.ascontiguousarray(np.rot90(cells, turns))
        edges = find_edges(view, resolution)
        if len(edges) > MOST_EDGES:
            edges = edges[np.sort(np.argsort(edges[:, 1] - edges[:, 2], kind="stable")[:MOST_EDGES])]
        features = door_features(view, resolution, edges)
        chances = classifier(turns, edges, features)
        steps = np.rint(features[:, recess] / resolution).astype(np.int64)
        likely = np.flatnonzero(chances >= LEAST_DOOR)
        likely = np.sort(likely[np.argsort(-chances[likely], kind="stable")[:MOST_DOORS]])
        numbers = np.concatenate([edges, steps], axis=1)[likely].tolist()
        found = zip(numbers, chances[likely].tolist(), strict=True)
        doors.append(
            [
                ClosedDoor(row, start, stop, least, most, chance)
                for (row, start, stop, least, most), chance in found
            ]
        )
    return doors


def without_chinks(cells: Cells, resolution: float) -> Cells:
    """The cells int8 (rows, cols) with small pieces of free space unknown that nothing joins to the rest.

    A beam through the chink of a shut door leaves them behind it, and would part it in two.
    """
    free = (cells == FREE).view(np.uint8)
    count, labels, stats, _ = cv2.connectedComponentsWithStats(free, connectivity=4)
    if count < 2:
        return cells
    small = stats[:, cv2.CC_STAT_AREA] * resolution**2 < CHINK
    small[[0, 1 + int(stats[1:, cv2.CC_STAT_AREA].argmax())]] = False
    return np.where(small[labels], UNKNOWN, cells).astype(np.int8)


def turned_scenes(cells: Cells, resolution: float, doors: Sequence[Sequence[ClosedDoor]]) -> Iterator[Scene]:
    """The grid, of which something must be known, turned by 0, 1, 2 and 3 quarters, with its doors."""
    leaves = np.zeros(cells.shape, np.bool_)
    for turns, found in enumerate(doors):
        for door in found:
            np.rot90(leaves, turns)[door.row, door.start : door.stop] = True
    mirror = best_mirror(cells, resolution)
    thickness, hull = wall_thickness(cells, resolution), _hull(cells != UNKNOWN)
    possible = room_space(without_doors(cells, resolution, doors), thickness)
    for turns in range(4):
        view, mirrored = (np.ascontiguousarray(np.rot90(layer, turns)) for layer in (cells, mirror.cells))
        around, shut, space = (
            np.ascontiguousarray(np.rot90(layer, turns)) for layer in (hull, leaves, possible)
        )
        likeness = (mirror.score, mirror.overlap)
        yield Scene(view, resolution, thickness, around, shut, mirrored, likeness, space)


def without_doors(cells: Cells, resolution: float, doors: Sequence[Sequence[ClosedDoor]]) -> Cells:
    """The cells int8 (rows, cols) with the leaves of doors, their jambs and niches unknown."""
    out, mark = cells.copy(), in_cells(_MARK, resolution)
    for turns, found in enumerate(doors):
        view = np.rot90(out, turns)
        for door in found:
            rows = slice(max(door.row - 1, 0), door.row + max(door.recess_other, 1))
            view[rows, door.start : door.stop] = UNKNOWN
            beside = view[rows, max(door.start - mark, 0) : door.stop + mark]
            beside[beside == OCCUPIED] = UNKNOWN
    return out


def _hull(known: Mask) -> Mask:
    """The convex hull of the known cells."""
    outlines, _ = cv2.findContours(known.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    mask = np.zeros(known.shape, np.uint8)
    cv2.fillConvexPoly(mask, np.asarray(cv2.convexHull(np.concatenate(outlines)), np.int32), 1)
    return mask > 0
