"""Floor plans from occupancy maps: ROS YAML, or a plain image with an optional image of its rooms.

What is known to be free is the floor; the unknown counts as solid, because nobody can say what is there. The
rooms come from NAME_rooms.png (a number a room) or NAME_gt.png (a colour a room) beside the map; without one,
each separate free area of at least a square metre is a room. A plain image has no scale: 0.05 m a pixel is
assumed unless one is given.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from layoutexplore.errors import MapError
from layoutexplore.grids.arrays import Ints32
from layoutexplore.grids.grid import OccupancyGrid, Pose
from layoutexplore.grids.ros_map import DEFAULT_RESOLUTION, IMAGE_SUFFIXES, load_grid
from layoutexplore.maps.floorplan import FloorPlan, PlanRaster
from layoutexplore.maps.kth import read_room_ids
from layoutexplore.maps.tracing import LEAST_ROOM, plan_from_raster


def load_image(path: Path, *, resolution: float | None = None) -> FloorPlan:
    """Read a ROS map or an image as a floor plan.

    Args:
        path: YAML or image.
        resolution: Metres a pixel of a plain image.

    Raises:
        MapError: The map cannot be read, or shows no free space.
    """
    grid = load_grid(path, resolution=resolution)
    if not grid.free.any():
        raise MapError(f"{path}: the map shows no free space")
    metadata = {"format": "image" if path.suffix.lower() in IMAGE_SUFFIXES else "ROS map"}
    if path.suffix.lower() in IMAGE_SUFFIXES:
        scale = DEFAULT_RESOLUTION if resolution is None else resolution
        source = "assumed: the image has no scale" if resolution is None else "as given"
        metadata["scale"] = f"{scale:g} m a pixel ({source})"
    if grid.origin.theta:
        turn = f"turned by {-grid.origin.theta:g} rad about the map's origin"
        metadata["frame"] = f"{turn}, so that its rows run along x"
    origin = Pose(grid.origin.x, grid.origin.y, 0.0)
    room_ids = _rooms_beside(path, grid)
    return plan_from_raster(
        PlanRaster(~grid.free, room_ids, grid.resolution, origin), name=path.stem, metadata=metadata
    )


def _rooms_beside(path: Path, grid: OccupancyGrid) -> Ints32:
    """Room numbers int32 (rows, cols) from the image of rooms beside a map; all 0 without one."""
    for ending in ("_rooms", "_gt"):
        beside = path.with_name(f"{path.stem}{ending}.png")
        if beside.is_file():
            ids = read_room_ids(beside)
            if ids.shape != grid.shape:
                raise MapError(f"{beside}: {ids.shape} pixels do not fit the {grid.shape} of {path.name}")
            ids = np.where(grid.free, ids[::-1], 0)
            areas = np.bincount(ids.ravel()) * grid.resolution**2
            # Blends of two colours are no rooms.
            return np.where(areas[ids] >= LEAST_ROOM, ids, 0).astype(np.int32)
    return np.zeros(grid.shape, np.int32)
