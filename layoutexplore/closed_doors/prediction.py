"""Rooms behind closed doors: doors are found, rectangles behind each are judged by trees, and the best are drawn.

The trees estimate how well a rectangle agrees with the unseen rooms it touches; `layoutexplore.closed_doors.training`
makes them. The task is that of the ECMR 2021 paper on rooms behind closed doors; the way is another.

The shipped trees were trained on the 8 buildings with a published answer: scores on these are not scores on new buildings.
With each building withheld in turn, the interquartile mean of the never-seen IoU was 0.46 on 49 of their 78 maps, under that
of the published answers.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from layoutexplore.closed_doors.candidates import FEATURES, Scene, room_space, wall_thickness
from layoutexplore.closed_doors.doors import Door, find_doors
from layoutexplore.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from layoutexplore.predictors.forest import Forest, load_forests

MODEL = Path(__file__).with_name("model.json")
"""The shipped trees."""

AGREEMENT = "agreement"
"""Name of the trees in the model's file."""

LEAST = 0.3
"""Rectangles whose estimated agreement is lower are not drawn."""


@dataclass(frozen=True, eq=False)
class ClosedRooms:
    """What is predicted behind closed doors.

    Attributes:
        grid: The grid with the predicted rooms free and their walls occupied.
        rooms: Bool (rows, cols): cells of predicted rooms, all of them unknown in the grid.
        confidence: Estimated agreement of each predicted room with the truth, 0..1.
        doors: Number of closed doors found.
    """

    grid: OccupancyGrid
    rooms: NDArray[np.bool_]
    confidence: tuple[float, ...]
    doors: int


def predict_closed_rooms(grid: OccupancyGrid, forest: Forest | None = None) -> ClosedRooms:
    """Predict the rooms behind the closed doors of a grid whose walls run along rows and columns.

    Args:
        grid: What has been seen.
        forest: Trees that estimate the agreement; the shipped ones when None.
    """
    forest = forest or load_forests(MODEL, FEATURES)[AGREEMENT]
    cells = np.where(grid.free, FREE, np.where(grid.occupied, OCCUPIED, UNKNOWN)).astype(np.int8)
    rooms = np.zeros(grid.shape, np.bool_)
    confidence, doors = [], 0
    for turns, scene, door in door_scenes(cells, grid.resolution):
        doors += 1
        boxes = scene.rectangles(door)
        if not len(boxes):
            continue
        agreement = forest.score(scene.features(door, boxes).astype(np.float32))
        best = int(agreement.argmax())
        if agreement[best] < LEAST:
            continue
        confidence.append(float(np.clip(agreement[best], 0, 1)))
        top, left, bottom, right = boxes[best]
        np.rot90(rooms, turns)[top:bottom, left:right] = True
    if doors:
        rooms &= room_space(cells, wall_thickness(cells, grid.resolution))
    rim = cv2.dilate(rooms.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    drawn = np.where(rooms, FREE, np.where(rim & (cells == UNKNOWN), OCCUPIED, grid.cells)).astype(np.int8)
    return ClosedRooms(OccupancyGrid(drawn, grid.resolution, grid.origin), rooms, tuple(confidence), doors)


def door_scenes(cells: NDArray[np.int8], resolution: float) -> Iterator[tuple[int, Scene, Door]]:
    """Every closed door with the grid turned to it, and the number of quarter turns (`numpy.rot90`)."""
    if not (cells != UNKNOWN).any():
        return
    views = [np.ascontiguousarray(np.rot90(cells, turns)) for turns in range(4)]
    doors = [find_doors(view, resolution) for view in views]
    leaves = np.zeros(cells.shape, np.bool_)
    for turns, found in enumerate(doors):
        for door in found:
            np.rot90(leaves, turns)[door.row, door.start : door.stop] = True
    thickness, hull = wall_thickness(cells, resolution), _hull(cells != UNKNOWN)
    for turns, (view, found) in enumerate(zip(views, doors, strict=True)):
        turned = (np.ascontiguousarray(np.rot90(mask, turns)) for mask in (hull, leaves))
        scene = Scene(view, resolution, thickness, *turned)
        for door in found:
            yield turns, scene, door


def _hull(known: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The convex hull of the known cells."""
    points = np.argwhere(known)[:, ::-1].astype(np.int32)
    mask = np.zeros(known.shape, np.uint8)
    cv2.fillConvexPoly(mask, np.asarray(cv2.convexHull(points), np.int32), 1)
    return mask > 0
