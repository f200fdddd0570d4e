"""Simple guesses of a room's shape from its seen part: the baselines of the literature.

`rectangle` is the smallest rectangle around it, `hull` its convex hull, `parallel-wall` closes it by walls
parallel to those that are seen (IAS-15), and `face-subset` adds the best of the faces that the continued
walls cut out of the unknown (Luperto, Arcerito and Amigoni, ICRA 2019).
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations

import cv2
import numpy as np

from layoutexplore.errors import checks_calls
from layoutexplore.frontiers.decision import Decision
from layoutexplore.grids.arrays import Bytes, Cells, Floats, Ints, Ints32, Mask
from layoutexplore.grids.grid import OCCUPIED, UNKNOWN, OccupancyGrid, in_cells
from layoutexplore.grids.morphology import with_neighbours
from layoutexplore.layout.doorways import Regions, doorway_regions
from layoutexplore.predictors.bit_map import draw_bit_map, extended_walls
from layoutexplore.predictors.protocol import RoomLabels, with_rooms
from layoutexplore.predictors.room_completion import Shape, complete_regions

LINE_WEIGHT, SHAPE_WEIGHT, COUNT_WEIGHT = 10.0, 10.0, 5.0
"""Weights in the score of a face subset: walls on its sides, area missing to its hull, number of sides."""

MOST_FACES, FACE_AREA = 9, (0.1, 60.0)
"""Most candidate faces of a room, and the areas in square metres that they may have."""

_BLUR, _SIMPLER, _BESIDE = 0.1, 0.3, 0.2
"""Metres: blur before walls get a direction, tolerance of outlines, distance of a wall to a side it backs."""

Outline = Callable[[Ints32, float], Floats]
"""(points (x, y) int32 (n, 2), main angle in radians) -> corners float64 (k, 2)."""


@checks_calls
class ShapePredictor:
    """Every region takes a shape that is drawn around its seen part.

    Args:
        name: What it is called.
        outline: Draws the shape; None leaves regions as they are seen.
    """

    def __init__(self, name: str, outline: Outline | None) -> None:
        self.name = name
        self._outline = outline

    def rooms(self, decision: Decision) -> RoomLabels:
        """The seen regions with their shapes filled."""
        cells, resolution = decision.grid.cells, decision.grid.resolution
        regions = doorway_regions(cells, resolution)
        if self._outline is None:
            return complete_regions(cells, regions, {})
        return complete_regions(cells, regions, draw_shapes(cells, resolution, regions, self._outline))

    def predict(self, decision: Decision) -> Decision:
        """The decision with the classes that follow from the rooms."""
        return with_rooms(decision, self.name, self.rooms(decision)) if decision.frontiers else decision


def main_angle(cells: Cells, resolution: float) -> float:
    """Direction of the walls against the grid's columns in radians, in [-pi/4, pi/4].

    It is a quarter of the mean of four times the gradient's direction: quarter turns count as one.
    """
    side, sigma = 2 * in_cells(2 * _BLUR, resolution) + 1, _BLUR / resolution
    blurred = cv2.GaussianBlur((cells == OCCUPIED).astype(np.float32), (side, side), sigma)
    gradient = cv2.Sobel(blurred, cv2.CV_32F, 1, 0) + 1j * cv2.Sobel(blurred, cv2.CV_32F, 0, 1)
    size = np.maximum(np.abs(gradient), 1e-3)
    unit = gradient / size
    fourfold = complex((size * (unit * unit) * (unit * unit)).sum())
    return float(np.angle(fourfold) / 4) if abs(fourfold) > 0 else 0.0


def rectangle_outline(points: Ints32, angle: float) -> Floats:
    """The corners of the smallest rectangle around points (x, y)."""
    return np.asarray(cv2.boxPoints(cv2.minAreaRect(points)), np.float64)


def hull_outline(points: Ints32, angle: float) -> Floats:
    """The corners of the convex hull of points (x, y)."""
    return np.asarray(cv2.convexHull(points).reshape(-1, 2), np.float64)


def parallel_outline(points: Ints32, angle: float) -> Floats:
    """The corners of the rectangle around points (x, y) whose sides are parallel to the building's walls."""
    along = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    turned = points @ along.T
    (x0, y0), (x1, y1) = turned.min(0), turned.max(0)
    return np.asarray(np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)]) @ along)


def draw_shapes(cells: Cells, resolution: float, regions: Regions, outline: Outline) -> dict[int, Shape]:
    """The shape of every region that borders the unknown."""
    angle, boxes = main_angle(cells, resolution), regions.boxes
    beside = with_neighbours(cells == UNKNOWN)
    partial = np.unique(regions.labels[beside & (regions.labels > 0)])
    return {int(region): _draw(regions, boxes, int(region), outline, angle) for region in partial}


def _draw(regions: Regions, boxes: Ints, region: int, outline: Outline, angle: float) -> Shape:
    """The shape that an outline around a region's cells encloses."""
    _, row0, col0, row1, col1 = boxes[region].tolist()
    rows, cols = np.nonzero(regions.labels[row0:row1, col0:col1] == region)
    points = np.stack([cols + col0, rows + row0], axis=1).astype(np.int32)
    corners = np.rint(outline(points, angle)).astype(np.int32)
    x0, y0 = np.maximum(corners.min(0), 0).tolist()
    x1, y1 = np.minimum(corners.max(0), (regions.labels.shape[1] - 1, regions.labels.shape[0] - 1)).tolist()
    mask = np.zeros((y1 - y0 + 1, x1 - x0 + 1), np.uint8)
    cv2.fillPoly(mask, [corners - np.array([x0, y0], np.int32)], 1)
    return Shape(y0, x0, mask > 0)


@checks_calls
class FaceSubsetPredictor:
    """Every region takes the subset of the neighbouring faces that scores best, if any beats none."""

    name = "face-subset"

    def rooms(self, decision: Decision) -> RoomLabels:
        """The seen regions with the faces they take."""
        cells, resolution = decision.grid.cells, decision.grid.resolution
        regions = doorway_regions(cells, resolution)
        lines = extended_walls(draw_bit_map(cells, regions, resolution, resolution))
        inner = ((cells == UNKNOWN) & ~lines).astype(np.uint8)
        _, faces, stats, _ = cv2.connectedComponentsWithStats(inner, connectivity=4)
        candidates = _neighbouring_faces(regions, faces, stats[:, cv2.CC_STAT_AREA] * resolution**2)
        shapes = {}
        for region, chosen in candidates.items():
            shape = _best_subset(decision.grid, regions, faces, region, chosen)
            if shape is not None:
                shapes[region] = shape
        return complete_regions(cells, regions, shapes)

    def predict(self, decision: Decision) -> Decision:
        """The decision with the classes that follow from the rooms."""
        return with_rooms(decision, self.name, self.rooms(decision)) if decision.frontiers else decision


def _neighbouring_faces(regions: Regions, faces: Ints32, areas: Floats) -> dict[int, list[int]]:
    """By region the faces that touch it, at most a line between them, the longest contact first."""
    found: dict[tuple[int, int], int] = {}
    for shift in (1, 2):
        for axis in (0, 1):
            here, there = (np.moveaxis(a, axis, 0) for a in (regions.labels, faces))
            for a, b in ((here[:-shift], there[shift:]), (here[shift:], there[:-shift])):
                touch = (a > 0) & (b > 0)
                pairs, counts = np.unique(np.stack([a[touch], b[touch]]), axis=1, return_counts=True)
                for region, face, n in zip(*pairs.tolist(), counts.tolist(), strict=True):
                    found[region, face] = found.get((region, face), 0) + n
    chosen: dict[int, list[int]] = {}
    for (region, face), _ in sorted(found.items(), key=lambda item: (-item[1], item[0])):
        mine = chosen.setdefault(region, [])
        if FACE_AREA[0] <= areas[face] <= FACE_AREA[1] and len(mine) < MOST_FACES:
            mine.append(face)
    return {region: mine for region, mine in chosen.items() if mine}


def _best_subset(
    grid: OccupancyGrid, regions: Regions, faces: Ints32, region: int, candidates: list[int]
) -> Shape | None:
    """The union of the best faces and the lines between them; None where nothing beats the seen part."""
    cells, resolution = grid.cells, grid.resolution
    part = (regions.labels == region) | np.isin(faces, candidates)
    rows, cols = np.flatnonzero(part.any(1)), np.flatnonzero(part.any(0))
    window = np.s_[max(rows[0] - 2, 0) : rows[-1] + 3, max(cols[0] - 2, 0) : cols[-1] + 3]
    seen = (regions.labels[window] == region).astype(np.uint8)
    walls, unknown = cells[window] == OCCUPIED, cells[window] == UNKNOWN
    best, best_score = None, _subset_score(seen, walls, resolution)
    singles = [_with_lines(seen | (faces[window] == face), unknown) for face in candidates]
    # Up to three faces together: more are almost never the best and cost as many again.
    for size in (1, 2, 3):
        for subset in combinations(range(len(singles)), size):
            union = _with_lines(np.maximum.reduce([singles[k] for k in subset]), unknown)
            score = _subset_score(union, walls, resolution)
            if score > best_score:
                best, best_score = union, score
    return None if best is None else Shape(int(window[0].start), int(window[1].start), best > 0)


def _with_lines(part: Bytes, unknown: Mask) -> Bytes:
    """The part with the unknown lines inside it, a cell or two wide, filled."""
    closed = cv2.morphologyEx(part.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    return np.where(unknown, closed, part).astype(np.uint8)


def _subset_score(part: Bytes, walls: Mask, resolution: float) -> float:
    """Walls seen on the sides, less what lacks to the convex hull, less the number of sides."""
    contours, _ = cv2.findContours(part, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    if len(contours) != 1:
        return -np.inf
    contour = contours[0].reshape(-1, 1, 2)
    area = max(int(part.sum()), 1)
    hull = np.zeros_like(part)
    cv2.fillPoly(hull, [cv2.convexHull(contour)], 1)
    corners = cv2.approxPolyDP(contour, in_cells(_SIMPLER, resolution), True).reshape(-1, 2)
    near = with_neighbours(walls, in_cells(_BESIDE, resolution))
    weights = 0.0
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        steps = int(max(abs(b - a).max(), 1))
        line = np.rint(a + (b - a) * np.linspace(0, 1, steps + 1)[:, None]).astype(int)
        weights += float(near[line[:, 1], line[:, 0]].mean())
    return (
        LINE_WEIGHT * weights - SHAPE_WEIGHT * (int(hull.sum()) - area) / area - COUNT_WEIGHT * len(corners)
    )
