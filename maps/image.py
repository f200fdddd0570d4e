"""Floor plans from occupancy maps: ROS YAML, or a plain image with an optional image of its rooms.

What is known to be free is the floor; the unknown counts as solid, because nobody can say what is there. The
rooms come from NAME_rooms.png or NAME_labels.png (a number a room) or NAME_gt.png (a colour a room) beside
the map; without one, each separate free area of at least a square metre is a room. What lies outside of the
building in a picture with margins is no floor. A plain image has no scale: 0.05 m a pixel is
assumed unless one is given.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from layoutexplore.errors import MapError, checks_arguments
from layoutexplore.files.limits import limits
from layoutexplore.files.reading import is_file
from layoutexplore.grids.arrays import Ints32, dense_ids
from layoutexplore.grids.grid import OccupancyGrid, Pose
from layoutexplore.grids.outside import without_outside
from layoutexplore.grids.ros_map import DEFAULT_RESOLUTION, IMAGE_SUFFIXES, load_grid
from layoutexplore.maps.floorplan import FloorPlan, PlanRaster
from layoutexplore.maps.kth import read_room_ids
from layoutexplore.maps.tracing import LEAST_ROOM, plan_from_raster

ASSUMED = "assumed: the image has no scale"
"""Of a scale that nobody gave."""

NO_FLOOR = "the map shows no free space (what is transparent is unknown: lay a drawing on white)"
"""What is said of a map or an image without floor."""

LABELS_ENDING = "_labels"
"""What the name of the room numbers ends with that `layoutexplore layout` writes."""

ROOM_ENDINGS = ("_rooms", "_gt", LABELS_ENDING)
"""What the name of an image of the rooms of a map ends with."""


@checks_arguments
def load_image(path: str | os.PathLike[str], *, resolution: float | None = None) -> FloorPlan:
    """Read a ROS map or an image as a floor plan.

    Args:
        path: YAML or image.
        resolution: Metres a pixel of a plain image.

    Raises:
        MapError: The map cannot be read, or shows no free space.
    """
    path = Path(path)
    if path.stem.endswith(LABELS_ENDING):
        return _load_labels(path, resolution)
    known = load_grid(path, resolution=resolution).trinary
    if not known.free.any():
        raise MapError(f"{path}: {NO_FLOOR}")
    grid = without_outside(known)
    metadata = {"format": "image" if path.suffix.lower() in IMAGE_SUFFIXES else "ROS map"}
    if path.suffix.lower() in IMAGE_SUFFIXES:
        metadata["scale"] = said_scale(resolution)
    if grid is not known:
        outside = known.free_area - grid.free_area
        metadata["outside"] = f"{outside:.0f} m2 of free space around the building are no floor"
    if grid.origin.theta:
        turn = f"turned by {-grid.origin.theta:g} rad about the map's origin"
        metadata["frame"] = f"{turn}, so that its rows run along x"
    origin = Pose(grid.origin.x, grid.origin.y, 0.0)
    room_ids = _rooms_of(path, grid)
    return plan_from_raster(
        PlanRaster(~grid.free, room_ids, grid.resolution, origin), name=path.stem, metadata=metadata
    )


@checks_arguments
def said_scale(resolution: float | None, unit: str = "pixel") -> str:
    """The scale of an image or a drawing in words, and whether it was given.

    Example:
        >>> said_scale(None), said_scale(0.3048, "unit")
        ('0.05 m a pixel (assumed: the image has no scale)', '0.3048 m a unit (as given)')
    """
    if resolution is None:
        return f"{DEFAULT_RESOLUTION:g} m a {unit} ({ASSUMED})"
    return f"{resolution:g} m a {unit} (as given)"


def _load_labels(path: Path, resolution: float | None) -> FloorPlan:
    """The plan that room numbers alone tell of: what belongs to no room is solid."""
    ids = np.ascontiguousarray(read_room_ids(path)[::-1])
    if not ids.any():
        raise MapError(f"{path}: the image of room numbers holds no room")
    return plan_from_raster(
        PlanRaster(ids == 0, ids, DEFAULT_RESOLUTION if resolution is None else resolution),
        name=path.stem.removesuffix(LABELS_ENDING),
        metadata={"format": "room numbers", "scale": said_scale(resolution)},
    )


@checks_arguments
def rooms_beside(path: str | os.PathLike[str]) -> Path | None:
    """The image of the rooms of a map, or None: the map may be one itself."""
    path = Path(path)
    for ending in ROOM_ENDINGS if path.name else ():
        beside = path.with_name(f"{path.stem}{ending}.png")
        if is_file(beside):
            return beside
    return None


def _rooms_of(path: Path, grid: OccupancyGrid) -> Ints32:
    """Room numbers int32 (rows, cols) from the image of rooms beside a map; all 0 without one."""
    beside = rooms_beside(path)
    if beside is None:
        return np.zeros(grid.shape, np.int32)
    ids = read_room_ids(beside)
    if ids.shape != grid.shape:
        raise MapError(f"{beside}: {ids.shape} pixels do not fit the {grid.shape} of {path.name}")
    ids = np.where(grid.free, ids[::-1], 0)
    areas = np.bincount(ids.ravel()) * grid.resolution**2
    # Blends of two colours are no rooms.
    ids = np.where(areas[ids] >= LEAST_ROOM, ids, 0).astype(np.int32)
    if ids.max() > limits().room_ids:  # few rooms among thousands of blends
        ids = dense_ids(ids).astype(np.int32)
    return ids
