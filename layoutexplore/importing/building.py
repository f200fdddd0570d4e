"""From a map or a picture to a floor plan with rooms and doors, by a layout method."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from layoutexplore.errors import MapError, checks_arguments
from layoutexplore.files import naming
from layoutexplore.grids.arrays import Ints32, Labels, shows_shapes
from layoutexplore.grids.components import split_labels
from layoutexplore.grids.flood import spread_in_place
from layoutexplore.grids.grid import OccupancyGrid, Pose
from layoutexplore.grids.ros_map import IMAGE_SUFFIXES
from layoutexplore.importing.cleaning import without_noise
from layoutexplore.importing.findings import resolution_for
from layoutexplore.importing.pictures import PictureConfig, read_picture
from layoutexplore.layout.pipeline import reconstruct
from layoutexplore.maps.floorplan import Door, FloorPlan
from layoutexplore.maps.image import NO_FLOOR, said_scale
from layoutexplore.maps.raster import PlanRaster
from layoutexplore.maps.tracing import LEAST_ROOM, plan_from_raster

LEAST_DOOR = 0.25
"""Metres; where two rooms touch along less than this, a leak of the map joins them and no door."""


@shows_shapes
@dataclass(frozen=True, kw_only=True, eq=False)
class Building:
    """A user's building.

    Attributes:
        grid: The map, cleaned, in its own frame.
        room_ids: int16 or int32 (rows, cols), the room of each cell of the grid, 0 for none.
        plan: The floor plan, its rooms numbered alike; axes along the rows and columns of the map.
        warnings: Of the layout method.
    """

    grid: OccupancyGrid
    room_ids: Labels
    plan: FloorPlan
    warnings: tuple[str, ...] = ()


@checks_arguments
def import_building(
    path: str | os.PathLike[str], config: PictureConfig | None = None, *, method: str = "default"
) -> Building:
    """Read a map or a picture and find its rooms and doors.

    Args:
        path: A ROS map's YAML, or an image.
        config: What is said about the picture.
        method: A method of `reconstruct` that makes rooms; "none": each separate free area is a room.

    Raises:
        MapError: The picture cannot be read, or no room is found in it.
        UnknownNameError: There is no such method.
    """
    path = Path(path)
    config = config or PictureConfig()
    grid = read_picture(path, config)
    if not grid.free.any():
        raise MapError(f"{path}: {NO_FLOOR}")
    metadata = {"format": "image" if path.suffix.lower() in IMAGE_SUFFIXES else "ROS map"}
    if path.suffix.lower() in IMAGE_SUFFIXES:
        metadata["scale"] = said_scale(config.resolution)
    with naming(path, MapError):
        return building_from_grid(grid, name=path.stem, method=method, metadata=metadata)


@checks_arguments
def building_from_grid(
    grid: OccupancyGrid, *, name: str, method: str = "default", metadata: Mapping[str, str] | None = None
) -> Building:
    """Find the rooms and doors of a grid map.

    Args:
        grid: The map, complete or partial.
        name: The plan's name.
        method: A method of `reconstruct` that makes rooms; "none": each separate free area is a room.
        metadata: Where the map comes from.

    Raises:
        MapError: No room is found.
        UnknownNameError: There is no such method.
    """
    clean = without_noise(grid)
    room_ids, warnings = np.zeros(clean.shape, np.int32), tuple[str, ...]()
    if method != "none":
        layout = reconstruct(clean, method)
        room_ids, warnings = without_strips(layout.labels, clean), layout.warnings
        if not room_ids.any():
            raise MapError(f"{name}: the layout method {method} finds no room; {'; '.join(warnings)}")
    # A floor plan has no yaw: its axes are the rows and columns of the map.
    frame = Pose(grid.origin.x, grid.origin.y, 0.0)
    notes = {"rooms": f"by the layout method {method}", **(metadata or {})}
    if grid.origin.theta:
        turn = f"turned by {-grid.origin.theta:g} rad about the map's origin"
        notes["frame"] = f"{turn}, so that its rows run along x"
    plan = plan_from_raster(
        PlanRaster(~clean.free, room_ids, clean.resolution, frame), name=name, metadata=notes, oblique=True
    )
    plan = replace(plan, doors=tuple(door for door in plan.doors if is_door(door)))
    assert plan.source is not None
    return Building(grid=clean, room_ids=plan.source.room_ids, plan=plan, warnings=warnings)


@checks_arguments
def without_strips(labels: Ints32, grid: OccupancyGrid) -> Ints32:
    """Rooms of a layout on free cells: strips apart from their room are of the room that they touch.

    The lines of a method may run beside a wall. The strip of a room behind the wall would look like a door
    between the two, as wide as the wall is long.

    Args:
        labels: int32 (rows, cols), 0 for none.
        grid: The map.

    Returns:
        int32 (rows, cols), 0 on cells that are not free.

    Example:
        >>> labels = np.array([[1, 1, 0, 1, 2, 2]], np.int32)
        >>> without_strips(labels, OccupancyGrid(np.array([[0, 0, 100, 0, 0, 0]], np.int8), 0.1)).tolist()
        [[1, 1, 0, 2, 2, 2]]
    """
    labels = np.where(grid.free, labels, 0).astype(np.int32)
    inside = labels > 0
    parts, sizes = split_labels(np.where(inside, labels, -1))
    room = np.zeros(len(sizes), np.int64)
    room[parts[inside]] = labels[inside]
    order = np.argsort(sizes, kind="stable")
    largest = np.zeros(int(labels.max()) + 1, np.int64)
    largest[room[order]] = order  # the last one that is written
    is_whole = (sizes * grid.resolution**2 >= LEAST_ROOM) | (largest[room] == np.arange(len(sizes)))
    found = np.where(inside, labels * np.append(is_whole, False)[parts], 0).astype(np.int32)
    spread_in_place(found, inside)
    return np.where(found > 0, found, labels)


@checks_arguments
def building_of_plan(plan: FloorPlan, *, origin: Pose | None = None) -> Building:
    """The building that a floor plan tells of, with a map of it.

    Args:
        plan: The floor plan.
        origin: Of the map that the plan was read from, where that is turned: the building's map is in its
            frame.

    Raises:
        MapError: The plan has no free space at the map's resolution.
    """
    if origin is not None and plan.source is not None:
        grid = replace(plan.source.grid, origin=origin)
        return Building(grid=grid, room_ids=plan.source.room_ids, plan=plan)
    raster = plan.rasterize(resolution_for(plan))
    return Building(grid=raster.grid, room_ids=raster.room_ids, plan=plan)


@checks_arguments
def is_door(door: Door) -> bool:
    """Whether an opening is wide enough for a door."""
    return door.width >= LEAST_DOOR
