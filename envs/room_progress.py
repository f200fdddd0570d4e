"""The floor plan's rooms in an episode: what is left to see in each, and how far it is between them.

Only rewards and the critic's privileged view read it; policies do not.
"""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np

from layoutexplore.errors import checks_making
from layoutexplore.frontiers.classes import LITTLE_LEFT
from layoutexplore.frontiers.decision import Truth
from layoutexplore.grids.arrays import Floats, Ints, Mask
from layoutexplore.grids.grid import Cell, in_cells
from layoutexplore.maps.floorplan import PlanRaster
from layoutexplore.planning.shortest_paths import distances_between

_BLOCK = 0.4
"""Side in metres of the squares of the plan for each of which one path length to a room is kept."""


@checks_making
class RoomLedger:
    """What is left to see in each room of an episode's floor plan, and how often the robot has been in it.

    Args:
        truth: The truth of the episode.

    Attributes:
        left: float64 (rooms + 1,), square metres of the target area in each room that have not been seen;
            entry 0 lies in no room.
        counted: bool (rooms + 1,), the rooms that had `LITTLE_LEFT` or more to see at first: smaller ones
            are no rooms to visit.
        open: bool (rooms + 1,), those of them with as much left to see.
        visits: int64 (rooms + 1,), how often the robot has entered each room.
    """

    def __init__(self, truth: Truth) -> None:
        self._raster = truth.raster
        self._cell_area = truth.raster.resolution**2
        ids = truth.raster.room_ids
        counts = np.bincount(ids[truth.target], minlength=int(ids.max()) + 1)
        self.left = np.asarray(counts * self._cell_area, np.float64)
        self.counted = self.left >= LITTLE_LEFT
        self.counted[0] = False
        self.open = self.counted
        self.visits = np.zeros(len(counts), np.int64)
        self._room = self._walked = 0

    def update(self, unseen: Ints, track: Floats | None) -> int:
        """Take note of what has happened since the last call.

        Args:
            unseen: int64 (rooms + 1,), how many cells of the target area have not been seen in each room.
            track: float64 (n, 3), the robot's true poses since the episode began; None leaves the visits as
                they are, which is quicker.

        Returns:
            Number of rooms that were finished (less than 1 m² left) before the robot came to them a second
            time.
        """
        if track is not None:
            self._follow(track)
        open_before = self.open
        self.left = np.asarray(unseen * self._cell_area, np.float64)
        self.open = self.counted & (self.left >= LITTLE_LEFT)
        return int(np.count_nonzero(open_before & ~self.open & (self.visits <= 1)))

    def _follow(self, track: Floats) -> None:
        """Count the rooms that were entered."""
        if len(track) > self._walked:
            origin, resolution = self._raster.origin, self._raster.resolution
            cols, rows = np.floor((track[self._walked :, :2] - origin[:2]) / resolution).astype(np.int64).T
            rooms = self._raster.room_ids[rows, cols]
            rooms = rooms[rooms > 0]
            entered = rooms[np.diff(rooms, prepend=self._room) != 0]
            np.add.at(self.visits, entered, 1)
            self._room = int(rooms[-1]) if len(rooms) else self._room
        self._walked = len(track)


@checks_making
class RoomDistances:
    """How far it is to the rooms of a floor plan, for one connected area of it.

    Attributes:
        rooms: int64 (n,), the ids of the rooms.
        between: float64 (n, n), path lengths in metres between their middles.
    """

    def __init__(self, truth: Truth) -> None:
        raster = truth.raster
        ids = np.where(truth.target, raster.room_ids, 0)
        self.rooms = np.flatnonzero(np.bincount(ids.ravel())[1:]) + 1
        middles = [_middle(np.argwhere(ids == room), truth.reachable) for room in self.rooms.tolist()]
        # One reachable cell stands for its block; it is what the fields are kept for.
        cells = np.argwhere(truth.reachable)
        self._side = side = in_cells(_BLOCK, raster.resolution)
        height, width = (-(-count // side) for count in raster.shape)
        blocks, first = np.unique(cells[:, 0] // side * width + cells[:, 1] // side, return_index=True)
        self._place = np.zeros(height * width, np.int32)
        self._place[blocks], self._width = np.arange(len(blocks)), width
        targets = np.concatenate([np.array(middles, np.int64).reshape(-1, 2), cells[first]]).astype(np.int32)
        reachable, resolution = truth.reachable, raster.resolution
        fields = [distances_between(reachable, middle, targets, resolution) for middle in middles]
        table = np.array(fields, np.float32).reshape(len(middles), len(targets))
        self.between = table[:, : len(middles)].astype(np.float64)
        self._fields = table[:, len(middles) :].astype(np.float16)

    def to_rooms(self, cell: Cell) -> Floats:
        """Path lengths float64 (n,) from a reachable cell to the rooms' middles, in metres (half ones)."""
        place = self._place[cell.row // self._side * self._width + cell.col // self._side]
        return self._fields[:, place].astype(np.float64)


def room_distances(truth: Truth) -> RoomDistances:
    """The distances of an episode's floor plan, shared by all episodes in the same area and region of it."""
    kept = _DISTANCES.setdefault(truth.raster, {})
    region = b"" if truth.region is None else np.packbits(truth.region).tobytes()
    key = (truth.robot_radius, int(np.argmax(truth.reachable)), region)
    if key not in kept:
        kept[key] = RoomDistances(truth)
    return kept[key]


_DISTANCES: WeakKeyDictionary[PlanRaster, dict[tuple[float, int, bytes], RoomDistances]] = WeakKeyDictionary()


def _middle(cells: Ints, reachable: Mask) -> Cell:
    """The reachable cell nearest to the middle of a room's cells int64 (n, 2), inside of it if one is."""
    inside = cells[reachable[cells[:, 0], cells[:, 1]]]
    candidates = inside if len(inside) else np.argwhere(reachable)
    nearest = candidates[np.argmin(((candidates - cells.mean(axis=0)) ** 2).sum(axis=1))]
    return Cell(int(nearest[0]), int(nearest[1]))
