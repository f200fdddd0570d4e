"""A floor plan on a grid: what is solid, which room a cell belongs to, and where a robot can get.

The robot's centre may be in a cell unless an occupied cell lies closer than its radius; it moves to the eight
neighbours without cutting corners, so what it can reach are the four-connected components of those cells.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from layoutexplore.errors import MapError, checks_calls, shortened
from layoutexplore.grids.arrays import Ints, Ints32, Labels, Mask, shows_shapes, small_labels
from layoutexplore.grids.components import join_runs
from layoutexplore.grids.grid import FREE, OCCUPIED, Cell, OccupancyGrid, Pose, check_resolution
from layoutexplore.grids.morphology import grow, inflate
from layoutexplore.grids.polygons import Point, resample_solid
from layoutexplore.grids.runs import runs_of, write_runs
from layoutexplore.maps.sizes import check_ids

SIGHT_BEYOND_REACH = 0.8
"""Metres of free space beyond the reachable cells that an exploration is asked to see."""

LARGEST_ROBOT = 100.0
"""Metres: a greater radius of a robot is a mistake, and would take much memory."""

MOST_CELLS = 400_000_000
"""A raster with more takes more memory than most computers have."""

MOST_STRETCHED = 1e3
"""What is stretched by more is no building any more."""


def check_stretch(what: str, x: float, y: float) -> None:
    """Raise `MapError` unless lengths can be multiplied by these factors."""
    if not all(1 / MOST_STRETCHED <= factor <= MOST_STRETCHED for factor in (x, y)):
        shown = f"{shortened(x)} and {shortened(y)}"
        raise MapError(
            f"{what} can be stretched by finite factors above 0, "
            f"from {1 / MOST_STRETCHED:g} to {MOST_STRETCHED:g}, got {shown}"
        )


@checks_calls
@shows_shapes
@dataclass(frozen=True, eq=False)
class PlanRaster:
    """A rasterised floor plan; everything that is not indoor free space is occupied.

    Attributes:
        occupied: bool (rows, cols), C-contiguous: walls, furniture, closed doors and the outside.
        room_ids: (rows, cols), the room of each cell, 0 for none (walls, door gaps, the outside); int16
            where the numbers fit, else int32.
        resolution: Side of a cell in metres.
        origin: Pose of the lower left corner of cell (0, 0).
        plan: The floor plan, as messages name it; empty where nobody knows.

    Raises:
        MapError: The shapes differ, the resolution is unusable, there is no free cell, or a room has an id
            above the limit.
    """

    occupied: Mask
    room_ids: Labels
    resolution: float
    origin: Pose = field(default=Pose(0.0, 0.0, 0.0))
    plan: str = field(default="", repr=False, kw_only=True)
    _cache: dict[Any, Any] = field(default_factory=dict, init=False, repr=False)

    def __post_init__(self) -> None:
        check_resolution(self.resolution)
        object.__setattr__(self, "resolution", float(self.resolution))
        if self.occupied.ndim != 2 or self.occupied.shape != self.room_ids.shape:
            raise MapError(
                f"occupied {self.occupied.shape} and room_ids {self.room_ids.shape} must be equal 2-d shapes"
            )
        if self.occupied.all():
            raise MapError("the floor plan has no free space at this resolution")
        object.__setattr__(self, "occupied", np.ascontiguousarray(self.occupied, np.bool_))
        farthest = max(int(self.room_ids.max()), -int(self.room_ids.min()))
        check_ids("a raster of rooms", farthest)
        object.__setattr__(self, "room_ids", small_labels(self.room_ids, farthest))

    def __getstate__(self) -> dict[str, Any]:
        # What can be computed again does not travel to other processes.
        return {**self.__dict__, "_cache": {}}

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, cols)."""
        rows, cols = self.occupied.shape
        return rows, cols

    @property
    def free(self) -> Mask:
        """Bool (rows, cols): indoor free space."""
        return ~self.occupied

    @property
    def grid(self) -> OccupancyGrid:
        """The truth as an occupancy grid without unknown cells."""
        cells = np.where(self.occupied, OCCUPIED, FREE).astype(np.int8)
        return OccupancyGrid(cells, self.resolution, self.origin)

    def world_to_cell(self, x: float, y: float) -> Cell:
        """The cell that holds a world point; it may lie outside the raster."""
        return self._frame.world_to_cell(x, y)

    def cell_to_world(self, row: float, col: float) -> tuple[float, float]:
        """World coordinates (x, y) of a cell's centre."""
        return self._frame.cell_to_world(row, col)

    def stretched(self, x: float, y: float) -> PlanRaster:
        """A copy in which lengths along x and y are multiplied by these; its resolution is the same.

        Raises:
            MapError: No free cell is left.
        """
        check_stretch("a raster", x, y)
        shape = max(round(self.shape[0] * y), 1), max(round(self.shape[1] * x), 1)
        if shape[0] * shape[1] > MOST_CELLS:
            raise MapError(f"a raster of {shape[0]} x {shape[1]} cells is too large: stretch it less")
        occupied, room_ids = resample(self, (1.0 / x, 1.0 / y), (0.0, 0.0), shape)
        origin = Pose(self.origin.x * x, self.origin.y * y, self.origin.theta)
        return PlanRaster(occupied, np.where(occupied, 0, room_ids), self.resolution, origin)

    def blocked(self, robot_radius: float) -> Mask:
        """Bool (rows, cols): cells where the centre of a robot of that radius (metres) may not be.

        Raises:
            MapError: The radius is below 0 or above `LARGEST_ROBOT`.
        """
        key = ("blocked", robot_radius)
        if key not in self._cache:
            if not 0 <= robot_radius <= LARGEST_ROBOT:
                raise MapError(f"robot_radius must be from 0 to {LARGEST_ROBOT:g} m, got {robot_radius}")
            self._cache[key] = inflate(self.occupied, robot_radius, self.resolution)
        blocked: Mask = self._cache[key]
        return blocked

    def reachable(self, robot_radius: float, start: Cell | None = None) -> Mask:
        """Bool (rows, cols): cells that the robot's centre can reach from `start`, or the largest such area.

        All False where `start` itself is blocked or outside.

        Raises:
            MapError: `start` is None and the robot fits nowhere.
        """
        return self._reachable(robot_radius, self._area(robot_radius, start))

    def coverage_target(self, robot_radius: float, start: Cell | None = None) -> Mask:
        """Bool (rows, cols): free cells that an exploration can be asked to see.

        Those within 0.8 m (along free space) of the cells that the robot can reach from `start`.
        """
        area = self._area(robot_radius, start)
        key = ("target", robot_radius, area)
        if key not in self._cache:
            reachable = self._reachable(robot_radius, area)
            target = grow(reachable, self.free, SIGHT_BEYOND_REACH / self.resolution)
            self._cache[key] = runs_of(target.view(np.uint8), 1)
        return self._painted(self._cache[key])

    @property
    def _frame(self) -> OccupancyGrid:
        """A grid of the same shape and place, whose cells take no memory."""
        if "frame" not in self._cache:
            nothing = np.broadcast_to(np.int8(FREE), self.shape)
            self._cache["frame"] = OccupancyGrid(nothing, self.resolution, self.origin)
        frame: OccupancyGrid = self._cache["frame"]
        return frame

    def _areas(self, robot_radius: float) -> list[Ints32]:
        """Connected areas that were asked for, as the runs of their cells int32 (n, 3).

        The first is the largest, if any is.
        """
        key = ("areas", robot_radius)
        if key not in self._cache:
            runs, number = self._parts(robot_radius)
            sizes = np.zeros(number.max(initial=-1) + 1, np.int64)
            np.add.at(sizes, number, runs[:, 2] - runs[:, 1])
            self._cache[key] = [runs[number == sizes.argmax()]] if len(sizes) else []
        areas: list[Ints32] = self._cache[key]
        return areas

    def _parts(self, robot_radius: float) -> tuple[Ints32, Ints]:
        """The runs int32 (n, 3) of cells that are not blocked, and the connected area int64 (n,) of each."""
        blocked = self.blocked(robot_radius).view(np.uint8)
        runs = runs_of(blocked, 0)
        return runs, join_runs(runs, blocked, 0)

    def _painted(self, runs: Ints32) -> Mask:
        """Bool (rows, cols): the cells of some runs."""
        mask = np.zeros(self.shape, np.bool_)
        write_runs(runs, np.ones(len(runs), np.int64), mask.view(np.int8))
        return mask

    def _area(self, robot_radius: float, start: Cell | None) -> int:
        """Which of the `_areas` holds the start, or is the largest without one; -1 where it cannot stand."""
        areas = self._areas(robot_radius)
        if start is None:
            if not areas:
                told = f"{self.plan}: " * bool(self.plan)
                raise MapError(f"{told}a robot of radius {robot_radius:g} m fits nowhere in this floor plan")
            return 0
        row, col = start
        inside = 0 <= row < self.shape[0] and 0 <= col < self.shape[1]
        if not inside or self.blocked(robot_radius)[row, col]:
            return -1
        found = next((k for k, area in enumerate(areas) if _holds(area, row, col).any()), len(areas))
        if found == len(areas):
            runs, number = self._parts(robot_radius)
            areas.append(runs[number == number[_holds(runs, row, col)]])
        return found

    def _reachable(self, robot_radius: float, area: int) -> Mask:
        return self._painted(self._areas(robot_radius)[area] if area >= 0 else np.empty((0, 3), np.int32))


def _holds(runs: Ints32, row: int, col: int) -> Mask:
    """Bool (n,): which of some runs int32 (n, 3) holds a cell."""
    return np.asarray((runs[:, 0] == row) & (runs[:, 1] <= col) & (col < runs[:, 2]))


def meetings(rooms: Labels) -> Iterator[tuple[Ints, Ints]]:
    """Where two rooms meet: first those below each other, then those side by side.

    Args:
        rooms: int (rows, cols), 0 for none.

    Yields:
        The first of both cells int64 (n, 2) as (row, col), and both rooms int64 (n, 2), rising.
    """
    for lower, upper in ((rooms[:-1], rooms[1:]), (rooms[:, :-1], rooms[:, 1:])):
        cells = np.argwhere((lower != upper) & (lower > 0) & (upper > 0))
        place = tuple(cells.T)
        yield cells, np.sort(np.stack([lower[place], upper[place]], axis=1).astype(np.int64), axis=1)


def resample(source: PlanRaster, ratios: Point, offset: Point, shape: tuple[int, int]) -> tuple[Mask, Labels]:
    """Occupied cells and room ids of a raster at other resolutions.

    Args:
        source: The raster.
        ratios: New resolution over the source's, along (x, y).
        offset: (x, y) of the new lower left corner in source cells from the source's.
        shape: New (rows, cols); what lies outside of the source is occupied.
    """
    places = [
        np.floor(first + (np.arange(count) + 0.5) * ratio + 1e-9).astype(np.int64)
        for first, count, ratio in zip(offset[::-1], shape, ratios[::-1], strict=True)
    ]
    rows, cols = ((place >= 0) & (place < size) for place, size in zip(places, source.shape, strict=True))
    room_ids = np.zeros(shape, source.room_ids.dtype)
    room_ids[np.ix_(rows, cols)] = source.room_ids[np.ix_(places[0][rows], places[1][cols])]
    return resample_solid(source.occupied, ratios, offset, shape), room_ids
