"""Bad plans from true ones: what is wrong in a drawing, by kind and amount, drawn from a seed.

What a plan shows is changed first, in the cells of the true plan: rooms merged, split, moved or missing,
doors missing or drawn where there are none, furniture, a wing out of date, corridors alone. Its geometry is
distorted then (`layoutexplore.priors.distortion`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import product

import cv2
import numpy as np
import shapely

from layoutexplore.errors import checks_arguments
from layoutexplore.grids.arrays import Floats, Ints, Ints32, Mask, shows_shapes
from layoutexplore.grids.boxes import window
from layoutexplore.grids.grid import in_cells
from layoutexplore.grids.morphology import with_neighbours
from layoutexplore.grids.polygons import fill
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.raster import PlanRaster
from layoutexplore.options import SHARE, Rule, check
from layoutexplore.priors.distortion import Distortion, draw_distorted, random_waves, scale_matrix, snap_pairs
from layoutexplore.priors.plan import RESOLUTION

WALL = 0.8
"""Metres; rooms this near to each other share a wall."""

NEW_WALL, NEW_DOOR = 0.2, 0.9
"""Metres: how thick a drawn wall is, and how wide a drawn door."""

MOST_STRETCH = 0.1
"""Root mean square of local stretching up to which a drawing does not fold, so that it can be inverted."""

CORRIDOR_WORDS = ("corridor", "hall", "passage", "stairs", "walkway", "lobby")
"""Labels of rooms that lead on contain one of these."""


@dataclass(frozen=True, kw_only=True)
class SpoilConfig:
    """What is wrong in a plan.

    Attributes:
        scale: Greatest error of the scale, a share; drawn evenly from both sides.
        aspect: Greatest error of the ratio of the scales along x and y.
        stretch: Root mean square of the local stretching, at most 0.1: beyond, a drawing may fold.
        rounding: Walls are drawn at multiples of this many metres; 0 leaves them.
        merged: Share of the rooms that are drawn as one with a neighbour.
        split: Share of the rooms that are drawn as two.
        moved: Share of the rooms a wall of which is drawn elsewhere, up to 1.5 m away.
        missing: Share of the rooms that are not drawn.
        doors_missing: Share of the doors that are not drawn.
        doors_added: Doors drawn where there are none, as a share of the doors.
        furniture: Pieces of furniture drawn as walls, a room on average.
        outdated: Share of the floor (from one end) that is drawn as it was before a rebuild: other way round.
        corridors_only: Whether rooms that do not lead on are left out.
        mirrored: Whether left and right are exchanged.
        turned: Whether the drawing is turned by a random multiple of 90 degrees ...
        skew: ... and by up to so many degrees more.
    """

    scale: float = 0.0
    aspect: float = 0.0
    stretch: float = 0.0
    rounding: float = 0.0
    merged: float = 0.0
    split: float = 0.0
    moved: float = 0.0
    missing: float = 0.0
    doors_missing: float = 0.0
    doors_added: float = 0.0
    furniture: float = 0.0
    outdated: float = 0.0
    corridors_only: bool = False
    mirrored: bool = False
    turned: bool = False
    skew: float = 0.0

    def __post_init__(self) -> None:
        small = Rule(low=0.0, high=0.9)
        check(
            self,
            scale=small,
            aspect=small,
            stretch=Rule(low=0.0, high=MOST_STRETCH),
            rounding=Rule(low=0.0, high=2.0),
            merged=SHARE,
            split=SHARE,
            moved=SHARE,
            missing=SHARE,
            doors_missing=SHARE,
            doors_added=SHARE,
            furniture=Rule(low=0.0, high=20.0),
            outdated=SHARE,
            corridors_only=Rule(kind=bool),
            mirrored=Rule(kind=bool),
            turned=Rule(kind=bool),
            skew=Rule(low=0.0, high=45.0),
        )


@shows_shapes
@dataclass(frozen=True, eq=False)
class SpoiledPlan:
    """A bad plan.

    Attributes:
        free: bool (rows, cols), floor as it is drawn.
        room_ids: int32 (rows, cols), rooms as they are drawn; ids are those of the true rooms where these are
            still there.
        resolution: Metres of the drawing a cell.
        distortion: From true points to points of the drawing.
        changed: Ids of the true rooms that are drawn otherwise than they are.
    """

    free: Mask
    room_ids: Ints32
    resolution: float
    distortion: Distortion
    changed: frozenset[int]


@checks_arguments
def spoil(plan: FloorPlan, config: SpoilConfig, rng: np.random.Generator) -> SpoiledPlan:
    """A bad plan of a floor.

    Raises:
        MapError: The floor has no free space.
    """
    side = math.sqrt(float(np.prod(np.subtract(plan.bounds[2:], plan.bounds[:2]))))
    resolution = RESOLUTION * max(1.0, side / 170.0)
    raster = plan.rasterize(resolution)
    drawing = _Drawing(plan, raster, rng)
    if config.corridors_only:
        drawing.keep_corridors()
    drawing.change_rooms(config)
    drawing.drop_doors(config.doors_missing)
    drawing.add_doors(round(config.doors_added * len(plan.doors)))
    drawing.furnish(config.furniture)
    drawing.outdate(config.outdated)
    # The error of the scale is that of lengths in all; the aspect is shared out between the axes.
    scale = math.exp(rng.uniform(-1, 1) * math.log1p(config.scale))
    aspect = math.exp(0.5 * rng.uniform(-1, 1) * math.log1p(config.aspect))
    turn = math.radians(90.0 * rng.integers(4) if config.turned else 0.0)
    turn += math.radians(rng.uniform(-config.skew, config.skew))
    distortion = Distortion(
        snaps=snap_pairs(raster, config.rounding),
        waves=random_waves(config.stretch, rng),
        matrix=scale_matrix((scale * aspect, scale / aspect), config.mirrored, turn),
    )
    free, ids, placed = draw_distorted(drawing.free, drawing.ids, raster, distortion, resolution)
    return SpoiledPlan(free, ids, resolution, placed, frozenset(drawing.changed))


class _Drawing:
    """The cells of a plan while it is being changed."""

    def __init__(self, plan: FloorPlan, raster: PlanRaster, rng: np.random.Generator) -> None:
        self.plan, self.raster, self.rng = plan, raster, rng
        self.free, self.ids = raster.free.copy(), raster.room_ids.astype(np.int32)  # with room for new rooms
        self.changed: set[int] = set()
        self.next_id = int(self.ids.max()) + 1
        self.reach = round(WALL / raster.resolution)

    def change_rooms(self, config: SpoilConfig) -> None:
        """Merge, split, move and leave out rooms, each one at most once."""
        rooms = self.rng.permutation(np.unique(self.ids[self.ids > 0]))
        changes: tuple[tuple[float, tuple[Callable[[int], bool], ...]], ...] = (
            (config.merged, (self._merge,)),
            (config.split, (self._split,)),
            (config.moved, (partial(self._move, slice(1)), partial(self._move, slice(1, None)))),
            (config.missing, (self._drop,)),
        )
        shares = np.array([share for share, _ in changes])
        # A fifth of few rooms is changed too: the kinds share what there is to change.
        total = min(round(float(shares.sum()) * len(rooms)), len(rooms))
        counts = self.rng.multinomial(total, shares / max(float(shares.sum()), 1e-9)) if total else shares * 0
        waiting = [int(room) for room in rooms]
        for wanted, (_, ways) in zip(counts.tolist(), changes, strict=True):
            for change, room in product(ways, list(waiting)):
                if wanted <= 0:
                    break
                if room not in self.changed and change(room):
                    wanted -= 1
                    waiting.remove(room)

    def _window(self, room: int) -> tuple[slice, slice]:
        """The box of a room with its walls."""
        return window(self.ids == room, 2 * self.reach)

    def _near(self, mask: Mask) -> Mask:
        return with_neighbours(mask, self.reach)

    def _neighbours(self, room: int) -> tuple[tuple[slice, slice], Ints]:
        """The window of a room, and the rooms that share a long wall with it, the longest first."""
        window = self._window(room)
        ids = self.ids[window]
        touched = np.bincount(ids[self._near(ids == room)], minlength=1)
        touched[[0, room]] = 0
        order = np.argsort(-touched, kind="stable")
        least = 1.5 * WALL / 2 / self.raster.resolution**2
        return window, order[touched[order] > least]

    def _merge(self, room: int) -> bool:
        window, others = self._neighbours(room)
        others = np.array([other for other in others if other not in self.changed], np.int64)
        if not len(others):
            return False
        ids, free = self.ids[window], self.free[window]
        here, there = self._near(ids == room), self._near(ids == others[0])
        wall = here & there & ~free & ~self._near_others(ids, (room, int(others[0])))
        if not wall.any():
            return False
        free |= wall
        ids[wall] = room
        self.ids[self.ids == others[0]] = room
        self.changed |= {room, int(others[0])}
        return True

    def _near_others(self, ids: Ints32, pair: tuple[int, int]) -> Mask:
        """Walls of further rooms: cells within a wall's thickness of them."""
        thin = round(0.25 / self.raster.resolution)
        return with_neighbours((ids > 0) & ~np.isin(ids, pair), thin)

    def _split(self, room: int) -> bool:
        rows, cols = np.nonzero(self.ids == room)
        spans = np.ptp(rows), np.ptp(cols)
        axis = int(np.argmax(spans))
        if spans[axis] * self.raster.resolution < 3.0:
            return False
        values = (rows, cols)[axis]
        at = int(values.min() + self.rng.uniform(0.35, 0.65) * spans[axis])
        thick = in_cells(NEW_WALL, self.raster.resolution)
        wall = (values >= at) & (values < at + thick)
        across = (cols, rows)[axis]
        place = self.rng.choice(across[wall]) if wall.any() else 0
        door = np.abs(across - place) * self.raster.resolution <= NEW_DOOR / 2
        gone = wall & ~door
        beyond = values >= at + thick
        self.free[rows[gone], cols[gone]] = False
        self.ids[rows[wall], cols[wall]] = 0
        self.ids[rows[beyond], cols[beyond]] = self.next_id
        self.next_id += 1
        self.changed.add(room)
        return True

    def _move(self, which: slice, room: int) -> bool:
        """Move the wall towards one of these neighbours, the longest ones first."""
        window, others = self._neighbours(room)
        return any(self._move_wall(window, room, other) for other in others[which].tolist())

    def _move_wall(self, window: tuple[slice, slice], room: int, other: int) -> bool:
        ids, free = self.ids[window], self.free[window]
        wall = self._near(ids == room) & self._near(ids == other) & (ids == 0)
        wall &= ~self._near_others(ids, (room, other))
        distance = cv2.distanceTransform((ids != room).astype(np.uint8), cv2.DIST_L2, 5)
        reach = distance * self.raster.resolution
        depth = float(self.rng.uniform(0.6, 1.5)) + float(reach[wall].max(initial=0.0))
        strip = wall | (ids == other)
        taken, new_wall = strip & (reach <= depth), strip & (reach > depth) & (reach <= depth + NEW_WALL)
        if not wall.any() or np.count_nonzero((ids == other) & (reach > depth + NEW_WALL + 1.0)) == 0:
            return False
        free[taken], ids[taken] = True, room
        free[new_wall], ids[new_wall] = False, 0
        self.changed |= {room, other}
        return True

    def _drop(self, room: int) -> bool:
        where = self.ids == room
        self.free[where], self.ids[where] = False, 0
        self.changed.add(room)
        return True

    def _opening(self, index: int) -> Mask:
        """The cells of a door."""
        door = self.plan.doors[index]
        painted = np.zeros(self.free.shape, np.int32)
        shape = self.plan.opening(door)
        corner = (self.raster.origin.x, self.raster.origin.y)
        fill(painted, shape.buffer(0.15, join_style="mitre"), 1, self.raster.resolution, corner)
        line = shapely.LineString([door.start, door.end]).buffer(0.1, cap_style="flat")
        middle = np.zeros(self.free.shape, np.int32)
        fill(middle, line, 1, self.raster.resolution, corner, sealed=True)
        return np.asarray(((painted > 0) & (self.raster.room_ids == 0)) | (middle > 0))

    def drop_doors(self, share: float) -> None:
        """Wall up a share of the doors."""
        count = round(share * len(self.plan.doors))
        for index in self.rng.permutation(len(self.plan.doors))[:count].tolist():
            shut = self._opening(index)
            self.free[shut], self.ids[shut] = False, 0

    def add_doors(self, count: int) -> None:
        """Draw doors between rooms that have none between them."""
        joined = {frozenset(door.rooms) for door in self.plan.doors}
        for room in self.rng.permutation(np.unique(self.ids[self.ids > 0])).tolist():
            if count <= 0:
                return
            window, others = self._neighbours(room)
            closed = [other for other in others.tolist() if frozenset((room, other)) not in joined]
            if not closed:
                continue
            ids, free = self.ids[window], self.free[window]
            wall = self._near(ids == room) & self._near(ids == closed[0]) & (ids == 0) & ~free
            wall &= ~self._near_others(ids, (room, closed[0]))
            places = np.argwhere(wall)
            if not len(places):
                continue
            place = places[self.rng.integers(len(places))]
            near = np.abs(np.indices(wall.shape) - place[:, None, None]).max(axis=0)
            free |= wall & (near * self.raster.resolution <= NEW_DOOR / 2)
            joined.add(frozenset((room, closed[0])))
            count -= 1

    def furnish(self, amount: float) -> None:
        """Draw furniture as walls."""
        rooms = np.unique(self.ids[self.ids > 0])
        for room in self.rng.choice(rooms, self.rng.poisson(amount * len(rooms))) if len(rooms) else ():
            cells = np.argwhere(self.ids == room)
            if not len(cells):
                continue
            row, col = cells[self.rng.integers(len(cells))].tolist()
            high, wide = np.ceil(self.rng.uniform(0.5, 1.6, 2) / self.raster.resolution).astype(int).tolist()
            self.free[row : row + high, col : col + wide] = False
            self.ids[row : row + high, col : col + wide] = 0

    def outdate(self, share: float) -> None:
        """Turn a part at one end of the longer side by 180 degrees."""
        rows, cols = np.nonzero(self.free)
        if share == 0 or not len(rows):
            return
        axis = int(np.ptp(cols) > np.ptp(rows))
        values = (rows, cols)[axis]
        from_low = bool(self.rng.integers(2))
        cut = float(np.quantile(values, share if from_low else 1 - share))
        first, last = (values.min(), int(cut)) if from_low else (int(cut), values.max() + 1)
        other = (cols, rows)[axis]
        part = [slice(int(first), int(last)), slice(int(other.min()), int(other.max()) + 1)]
        window = (part[0], part[1]) if axis == 0 else (part[1], part[0])
        self.changed |= set(np.unique(self.ids[window]).tolist()) - {0}
        self.free[window], self.ids[window] = self.free[window][::-1, ::-1], self.ids[window][::-1, ::-1]

    def keep_corridors(self) -> None:
        """Leave out all rooms that do not lead on: by their labels, else those with few doors."""
        labelled = {
            room.id for room in self.plan.rooms if any(word in room.label.lower() for word in CORRIDOR_WORDS)
        }
        kept = labelled or _busy_rooms(self.plan)
        gone = (self.ids > 0) & ~np.isin(self.ids, sorted(kept))
        self.free[gone] = False
        self.ids[gone] = 0
        self.changed |= {room.id for room in self.plan.rooms} - kept
        # Doors of rooms that are gone would be niches.
        count, parts = cv2.connectedComponents((self.free & (self.ids == 0)).astype(np.uint8), connectivity=4)
        beside = self._sides(parts, count)
        dead = np.flatnonzero(beside < 2)
        stub = np.isin(parts, dead[dead > 0])
        self.free[stub] = False

    def _sides(self, parts: Ints32, count: int) -> Floats:
        """How many rooms each part of the roomless floor touches."""
        ring = cv2.dilate(self.ids.astype(np.float32), np.ones((3, 3), np.uint8)).astype(np.int64)
        low = np.where(self.ids > 0, self.ids, self.next_id).astype(np.float32)
        low = cv2.erode(low, np.ones((3, 3), np.uint8)).astype(np.int64)
        sides = np.zeros(count)
        for near in (ring, np.where(low < self.next_id, low, 0)):
            for part in range(1, count):
                touched = np.unique(near[parts == part])
                sides[part] = max(sides[part], np.count_nonzero(touched))
        return sides


def _busy_rooms(plan: FloorPlan) -> set[int]:
    """Rooms with at least four doors, or the one with the most."""
    doors: dict[int, int] = {}
    for door in plan.doors:
        for room in door.rooms:
            if room:
                doors[room] = doors.get(room, 0) + 1
    most = max(doors.values(), default=0)
    return {room for room, count in doors.items() if count >= min(4, most)} or {r.id for r in plan.rooms}
