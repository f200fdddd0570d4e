"""Layouts of grid maps against floor plans that are not in the maps' frame (IAS-15, section IV-A).

The true rooms are stretched so that the bounding box of all of them equals that of the wall segments that
were found, as the authors do; then A_FC and A_BC pool the overlap of each room with its best counterpart by
area.
Whether y points up or down in a floor plan no file says: `facing_outlines` asks the map.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely

from layoutexplore.errors import MapError, checks_arguments, shortened
from layoutexplore.files.markup import read_xml
from layoutexplore.grids.arrays import Floats
from layoutexplore.grids.grid import OccupancyGrid
from layoutexplore.grids.polygons import fill
from layoutexplore.layout.types import Layout
from layoutexplore.maps.sizes import MOST_METRES, check_count, check_outlines

WALL = 0.3
"""Thickness of the walls between true rooms where they are held against a map's free space, in metres."""


@dataclass(frozen=True, kw_only=True)
class LayoutScores:
    """Coverages in 0..1 and the number of rooms they are taken over.

    Attributes:
        a_fc: Forward accuracy: share of the layout's area inside the true room that each of its rooms
            overlaps most.
        a_bc: Backward accuracy: share of the true area inside the layout's room that each true room overlaps
            most.
        precision: Mean over the layout's rooms of the overlap share.
        recall: Mean over the true rooms of the overlap share.
        rooms: Rooms of the layout.
        true_rooms: Rooms of the truth.
    """

    a_fc: float
    a_bc: float
    precision: float
    recall: float
    rooms: int
    true_rooms: int


@checks_arguments
def read_outlines(path: str | Path) -> list[shapely.Polygon]:
    """The true rooms of a school's XML file, in its pixels and with its y, which may point up or down.

    Raises:
        MapError: The file cannot be read or holds no room.
    """
    path = Path(path)
    root = read_xml(path)
    try:
        outlines = [
            [_point(p.attrib) for p in outline.iter("point")] for outline in root.iter("bounding_polygon")
        ]
    except ValueError as error:
        raise MapError(f"{path}: cannot read the floor plan: {shortened(str(error))}") from error
    check_count(str(path), "outlines", len(outlines))
    check_outlines(str(path), outlines)
    rooms = []
    for points in outlines:
        if len(points) >= 3:
            rooms += [p for p in shapely.get_parts(shapely.Polygon(points).buffer(0)) if p.area > 0]
    if not rooms:
        raise MapError(f"{path}: the floor plan has no room")
    return rooms


def _point(attributes: Mapping[str, str]) -> tuple[float, float]:
    x, y = (float(attributes.get(key, "nan")) for key in "xy")
    if not (abs(x) <= MOST_METRES and abs(y) <= MOST_METRES):
        raise ValueError(f"a point needs two finite numbers x and y, got {shortened(dict(attributes))}")
    return x, y


@checks_arguments
def stretch(
    rooms: Sequence[shapely.Polygon], box: tuple[float, float, float, float]
) -> list[shapely.Polygon]:
    """The rooms moved and scaled along x and y so that their bounding box becomes `box` (x0, y0, x1, y1).

    Example:
        >>> stretch([shapely.box(0, 0, 1, 2)], (3, 0, 5, 1))[0].bounds
        (3.0, 0.0, 5.0, 1.0)
    """
    x0, y0, x1, y1 = shapely.total_bounds(np.array(rooms, object))
    low, size = np.array((x0, y0)), np.maximum((x1 - x0, y1 - y0), 1e-9)
    scale = (np.array(box[2:]) - np.array(box[:2])) / size

    def move(points: Floats) -> Floats:
        return np.asarray((points - low) * scale + np.array(box[:2]))

    return [shapely.transform(room, move) for room in rooms]


@checks_arguments
def facing_outlines(
    rooms: Sequence[shapely.Polygon], grid: OccupancyGrid
) -> tuple[list[shapely.Polygon], bool]:
    """The true rooms the way round that fits a map's free space better, and whether that is mirrored in y.

    Both ways, the rooms are stretched over the free cells; what counts is the intersection over union of
    these and of the rooms without their walls. No layout of the map is looked at.

    Args:
        rooms: The true rooms, in any units, y up or down.
        grid: The map; where nothing in it is free, the rooms stay as they are.

    Example:
        >>> cells = np.where(np.arange(40)[:, None] > np.arange(40), 100, 0).astype(np.int8)
        >>> triangle = shapely.Polygon([(0, 0), (2, 2), (2, 0)])
        >>> facing_outlines([triangle], OccupancyGrid(cells, 0.1))[1]
        False
        >>> facing_outlines([shapely.Polygon([(0, 0), (2, -2), (2, 0)])], OccupancyGrid(cells, 0.1))[1]
        True
    """
    mirrored = [shapely.transform(room, _mirror) for room in rooms]
    if not grid.free.any() or _free_fit(mirrored, grid) <= _free_fit(rooms, grid):
        return [*rooms], False
    return mirrored, True


def _mirror(points: Floats) -> Floats:
    return np.asarray(points * np.array((1.0, -1.0)))


def _free_fit(rooms: Sequence[shapely.Polygon], grid: OccupancyGrid) -> float:
    """Intersection over union of the free cells and of the rooms less their walls, stretched over them."""
    rows, cols = np.nonzero(grid.free)
    low, high = np.array((cols.min(), rows.min())), np.array((cols.max(), rows.max())) + 1
    box = tuple((grid.resolution * np.concatenate([low, high])).tolist())
    cells = np.zeros(grid.shape, np.uint8)
    for room in stretch(rooms, box):
        fill(cells, room.buffer(-WALL / 2), 1, grid.resolution, (0.0, 0.0))
    inside = cells > 0
    return float(np.count_nonzero(inside & grid.free) / np.count_nonzero(inside | grid.free))


@checks_arguments
def wall_bounds(layout: Layout) -> tuple[float, float, float, float]:
    """Bounding box (x0, y0, x1, y1) of the layout's wall segments; of its rooms where there are none."""
    if len(layout.segments):
        x, y = layout.segments[:, ::2], layout.segments[:, 1::2]
        return float(x.min()), float(y.min()), float(x.max()), float(y.max())
    x0, y0, x1, y1 = shapely.total_bounds(np.array([r.polygon for r in layout.rooms], object))
    return float(x0), float(y0), float(x1), float(y1)


@checks_arguments
def score_layout(layout: Layout, truth: Sequence[shapely.Polygon]) -> LayoutScores:
    """Compare a layout's rooms with the true ones, whose frame is only known up to a stretch along the axes.

    Args:
        layout: The layout; one without rooms scores 0.
        truth: The true rooms with y up, in any units: see `facing_outlines`.
    """
    if not layout.rooms:
        return score_polygons([], truth)
    return score_polygons([room.polygon for room in layout.rooms], stretch(truth, wall_bounds(layout)))


@checks_arguments
def score_polygons(rooms: Sequence[shapely.Polygon], truth: Sequence[shapely.Polygon]) -> LayoutScores:
    """Compare rooms with true rooms in the same frame; all 0 where either is missing.

    Example:
        >>> score_polygons([shapely.box(0, 0, 2, 1)], [shapely.box(0, 0, 1, 1), shapely.box(1, 0, 2, 1)]).a_fc
        0.5
    """
    counts = {"rooms": len(rooms), "true_rooms": len(truth)}
    if not len(rooms) or not len(truth):
        return LayoutScores(a_fc=0.0, a_bc=0.0, precision=0.0, recall=0.0, **counts)
    found, true = np.array(rooms, object), np.array(truth, object)
    overlap = shapely.area(shapely.intersection(found[:, None], true[None, :]))
    area, true_area = np.maximum(shapely.area(found), 1e-12), np.maximum(shapely.area(true), 1e-12)
    forward, backward = overlap.max(axis=1), overlap.max(axis=0)
    return LayoutScores(
        a_fc=float(forward.sum() / area.sum()),
        a_bc=float(backward.sum() / true_area.sum()),
        precision=float((forward / area).mean()),
        recall=float((backward / true_area).mean()),
        **counts,
    )
