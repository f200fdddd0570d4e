"""Floor plans: the truth about a building, in metres.

A `FloorPlan` has rooms (polygons with a label), doors (openings, each a segment along its wall), the solid
footprint of walls and furniture, and passages (floor that belongs to no room). It rasterises at any
resolution to a `PlanRaster`. Plans that were born as images keep that image as their truth in `source`.

Free is what lies in a room, a passage or the opening of an open door, and in nothing solid. Everything else
is occupied. Walls are filled so that no step between two neighbouring cell centres crosses them (see
`layoutexplore.grids.polygons`).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import shapely
from shapely import LineString, Polygon
from shapely.geometry.base import BaseGeometry

from layoutexplore.errors import MapError, checks_calls, shortened
from layoutexplore.files.limits import limits
from layoutexplore.grids.arrays import Bytes, Floats, Labels, Mask, label_type, shows_shapes
from layoutexplore.grids.grid import Pose, check_resolution
from layoutexplore.grids.polygons import Nearness, Point, fill, polygons_of, seal_diagonals, still_valid
from layoutexplore.maps.content import geometry_digest, raster_digest
from layoutexplore.maps.raster import MOST_CELLS, PlanRaster, check_stretch, resample
from layoutexplore.maps.sizes import MOST_METRES, check_drawing, check_ids, check_plan

__all__ = ["Door", "FloorPlan", "PlanRaster", "Room"]

DOOR_REACH = (0.05, 1.0)
"""Least and greatest metres that an opening cuts on either side of its door's segment."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Room:
    """A room of the truth.

    Attributes:
        id: 1-based, unique in its plan.
        polygon: The room's floor in metres, up to the faces of its walls.
        label: What it is used as ("office", "corridor"); empty when not known.
    """

    id: int
    polygon: Polygon
    label: str = ""


@dataclass(frozen=True, kw_only=True, eq=False)
class Door:
    """An opening between two rooms, or between a room and the outside.

    Attributes:
        start: One end of the opening, a world point (x, y) in metres on the wall.
        end: The other end.
        rooms: Ids of the rooms on both sides; 0 is outside or no room.
        is_open: A closed door is solid.
    """

    start: Point
    end: Point
    rooms: tuple[int, int] = (0, 0)
    is_open: bool = True

    @property
    def width(self) -> float:
        """Width of the opening in metres."""
        return math.dist(self.start, self.end)


@checks_calls
@shows_shapes
@dataclass(frozen=True, kw_only=True, eq=False)
class FloorPlan:
    """One floor of a building, in metres.

    Attributes:
        name: Unique name of this floor.
        building: The building; floors of one building share it, and never fall into different splits.
        rooms: The rooms; where polygons overlap, the smaller room has the cells.
        doors: The openings.
        walls: Solid footprint of the walls, with the gaps of open doors cut out.
        furniture: Solid footprint of the furniture; may be empty.
        passages: Floor that belongs to no room (wide openings, unlabelled space); may be empty.
        source: The raster that is the truth of a plan born as an image; None otherwise.
        metadata: Where it comes from and under which terms; plain strings.
        file: The file it was read from, and its level, for messages; empty where there is none.

    Raises:
        MapError: There is no room, passage or source, an id is not unique or above the limit, a polygon is
            not valid, a door refers to a room that does not exist, or a number is not finite.

    Example:
        >>> room = Room(id=1, polygon=shapely.box(0, 0, 4, 3), label="office")
        >>> plan = FloorPlan(name="one-room", rooms=(room,))
        >>> plan.rasterize(0.5).free.sum()
        np.int64(48)
    """

    name: str
    building: str = ""
    rooms: tuple[Room, ...] = ()
    doors: tuple[Door, ...] = ()
    walls: BaseGeometry = field(default_factory=Polygon)
    furniture: BaseGeometry = field(default_factory=Polygon)
    passages: BaseGeometry = field(default_factory=Polygon)
    source: PlanRaster | None = None
    metadata: Mapping[str, str] = field(default_factory=dict)
    file: str = field(default="", repr=False)
    _cache: dict[tuple[float, float], PlanRaster] = field(default_factory=dict, init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "building", self.building or self.name)
        object.__setattr__(self, "rooms", tuple(self.rooms))
        object.__setattr__(self, "doors", tuple(self.doors))
        _check(self)

    def __getstate__(self) -> dict[str, Any]:
        # What can be computed again does not travel to other processes.
        return {k: v for k, v in self.__dict__.items() if k != "_nearness"} | {"_cache": {}}

    @property
    def _shown(self) -> str:
        return f"{self.file}: " * bool(self.file) + f"plan {shortened(self.name)}"

    @cached_property
    def bounds(self) -> tuple[float, float, float, float]:
        """(min x, min y, max x, max y) in metres of everything in the plan."""
        openings = [LineString([door.start, door.end]) for door in self.doors]
        shapes = [*(room.polygon for room in self.rooms), *openings]
        boxes = shapely.bounds([*shapes, self.walls, self.furniture, self.passages]).reshape(-1, 4)
        if self.source is not None:
            x, y, _ = self.source.origin
            rows, cols = self.source.shape
            boxes = np.array([[x, y, x + cols * self.source.resolution, y + rows * self.source.resolution]])
        low, high = np.nanmin(boxes[:, :2], axis=0), np.nanmax(boxes[:, 2:], axis=0)
        return float(low[0]), float(low[1]), float(high[0]), float(high[1])

    @cached_property
    def area(self) -> float:
        """Floor area of all rooms and passages in square metres, furniture included."""
        return float(shapely.union_all([*(room.polygon for room in self.rooms), self.passages]).area)

    @cached_property
    def content_hash(self) -> str:
        """SHA-256 (hex) of the geometry to 0.1 mm; names, labels and metadata do not count.

        Seeds follow from it. Rasters depend on ids of rooms and the rooms of doors, too: see `raster_hash`.
        """
        shapes = self.walls, self.furniture, self.passages
        return geometry_digest(self.rooms, self.doors, shapes, self.source)

    @cached_property
    def raster_hash(self) -> str:
        """SHA-256 (hex) of all that `rasterize` depends on: the geometry, ids, and the rooms of doors."""
        return raster_digest(self.content_hash, self.rooms, self.doors, self.source)

    def with_doors_closed(self, ids: Iterable[int]) -> FloorPlan:
        """A copy in which the doors with these indices into `doors` are closed.

        Raises:
            MapError: There is no such door.
        """
        count = len(self.doors)
        chosen = set(ids[: count + 1] if isinstance(ids, range) else ids)
        if missing := sorted(chosen - set(range(len(self.doors)))):
            raise MapError(f"{self._shown} has doors 0..{len(self.doors) - 1}: no door {missing[0]}")
        doors = (
            dataclasses.replace(door, is_open=door.is_open and k not in chosen)
            for k, door in enumerate(self.doors)
        )
        return dataclasses.replace(self, doors=tuple(doors))

    def stretched(self, x: float, y: float) -> FloorPlan:
        """A copy stretched along x and y: another building of the same kind.

        Args:
            x: Factor on all lengths along x, also of walls and doors; a `source` keeps its resolution.
            y: Factor along y.

        Raises:
            MapError: A factor is not a number from 0.001 to 1000.

        Example:
            >>> plan = FloorPlan(name="one-room", rooms=(Room(id=1, polygon=shapely.box(0, 0, 4, 3)),))
            >>> plan.stretched(1.5, 2.0).bounds
            (0.0, 0.0, 6.0, 6.0)
        """
        check_stretch(self._shown, x, y)
        source = self.source and self.source.stretched(x, y)
        return self._transformed(np.diag([x, y]), source)

    def turned(self, angle: float) -> FloorPlan:
        """A copy turned counter-clockwise about the origin, by an angle in radians.

        Raises:
            MapError: The angle is not finite, or the plan was born as an image.

        Example:
            >>> plan = FloorPlan(name="one-room", rooms=(Room(id=1, polygon=shapely.box(0, 0, 4, 3)),))
            >>> tuple(round(value) for value in plan.turned(math.pi / 2).bounds)
            (-3, 0, 0, 4)
        """
        if self.source is not None or not math.isfinite(angle):
            raise MapError(f"{self._shown} can be turned by a finite angle unless it is an image")
        c, s = math.cos(angle), math.sin(angle)
        return self._transformed(np.array([[c, -s], [s, c]]), None)

    def _transformed(self, matrix: Floats, source: PlanRaster | None) -> FloorPlan:
        """A copy whose points were multiplied by a matrix float64 (2, 2)."""

        def transform(shape: BaseGeometry) -> Any:
            return still_valid(shapely.transform(shape, lambda points: points @ matrix.T))

        def moved(point: Point) -> Point:
            x, y = (matrix @ point).tolist()
            return x, y

        return dataclasses.replace(
            self,
            rooms=tuple(dataclasses.replace(room, polygon=transform(room.polygon)) for room in self.rooms),
            doors=tuple(
                dataclasses.replace(door, start=moved(door.start), end=moved(door.end)) for door in self.doors
            ),
            walls=transform(self.walls),
            furniture=transform(self.furniture),
            passages=transform(self.passages),
            source=source,
        )

    @cached_property
    def _nearness(self) -> dict[int, Nearness]:
        """Distances from rooms by their ids."""
        return {room.id: Nearness(room.polygon) for room in self.rooms}

    def opening(self, door: Door) -> Polygon:
        """The floor that a door cuts through its wall: its segment, widened until it meets the rooms."""
        line = LineString([door.start, door.end])
        probes = shapely.points([door.start, door.end, line.interpolate(0.5, normalized=True).coords[0]])
        rooms = [self._nearness[number] for number in door.rooms if number in self._nearness]
        reach = max((float(room.distances(probes).max()) for room in rooms), default=0.0)
        depth = min(max(reach + DOOR_REACH[0], DOOR_REACH[0]), DOOR_REACH[1])
        return line.buffer(depth, cap_style="flat")

    def rasterize(self, resolution: float = 0.1, *, margin: float = 0.5) -> PlanRaster:
        """The plan as cells.

        Args:
            resolution: Side of a cell in metres.
            margin: Metres of solid cells around the plan (at least one cell).

        Returns:
            A raster that is shared between calls with the same arguments: do not write into it.

        Raises:
            MapError: The resolution or margin makes no sense, or no free cell is left.
        """
        check_resolution(resolution)
        if not math.isfinite(margin) or margin < 0:
            raise MapError(f"the margin must be a number of metres, 0 or more, got {shortened(margin)}")
        key = (float(resolution), float(margin))
        if key not in self._cache:
            self._cache[key] = self._rasterize(*key)
        return self._cache[key]

    def _rasterize(self, resolution: float, margin: float) -> PlanRaster:
        x0, y0, x1, y1 = self.bounds
        border = max(margin, resolution)
        # The origin lies on a whole number of cells: walls drawn on such numbers end at borders of cells.
        col0 = math.floor((x0 - border) / resolution + 1e-6)
        row0 = math.floor((y0 - border) / resolution + 1e-6)
        cols = math.ceil((x1 + border) / resolution - 1e-6) - col0
        rows = math.ceil((y1 + border) / resolution - 1e-6) - row0
        if rows * cols > max(MOST_CELLS, limits().image_pixels):
            raise MapError(
                f"{self._shown} reaches over {x1 - x0:.6g} x {y1 - y0:.6g} m, {rows} x {cols} cells of "
                f"{resolution:g} m: choose a coarser resolution, unless a part lies astray"
            )
        origin = Pose(col0 * resolution, row0 * resolution, 0.0)
        draw = _draw_shapes if self.source is None else _draw_source
        occupied, room_ids = draw(self, (rows, cols), resolution, origin)
        occupied = seal_diagonals(occupied)
        room_ids[occupied] = 0
        if occupied.all():
            raise MapError(f"{self._shown} has no free space at a resolution of {resolution:g} m")
        return PlanRaster(occupied, room_ids, resolution, origin, plan=self._shown)


def _draw_shapes(
    plan: FloorPlan, shape: tuple[int, int], resolution: float, origin: Pose
) -> tuple[Mask, Labels]:
    """Occupied cells and room ids from the polygons."""
    corner, openings = (origin.x, origin.y), [plan.opening(door) for door in plan.doors]
    outlines = [room.polygon for room in plan.rooms]
    shapes = [*outlines, *openings, plan.passages, plan.walls, plan.furniture]
    check_drawing(plan._shown, shapes, resolution, shape[0] * shape[1])
    room_ids: Labels = np.zeros(shape, label_type(max((room.id for room in plan.rooms), default=0)))
    for room in sorted(plan.rooms, key=lambda room: -room.polygon.area):
        fill(room_ids, room.polygon, room.id, resolution, corner)
    occupied = room_ids == 0
    solid = occupied.view(np.uint8)
    fill(solid, plan.passages, 0, resolution, corner)
    for door, opening in zip(plan.doors, openings, strict=True):
        if door.is_open:
            fill(solid, opening, 0, resolution, corner)
    fill(solid, plan.walls, 1, resolution, corner, sealed=True)
    fill(solid, plan.furniture, 1, resolution, corner, sealed=True)
    _close_doors(plan, solid, resolution, corner)
    return occupied, room_ids


def _draw_source(
    plan: FloorPlan, shape: tuple[int, int], resolution: float, origin: Pose
) -> tuple[Mask, Labels]:
    """Occupied cells and room ids from the image that the plan was born as."""
    assert plan.source is not None
    source, corner = plan.source, (origin.x, origin.y)
    ratio, (x, y, _) = resolution / source.resolution, source.origin
    offset = (origin.x - x) / source.resolution, (origin.y - y) / source.resolution
    occupied, room_ids = resample(source, (ratio, ratio), offset, shape)
    _close_doors(plan, occupied.view(np.uint8), resolution, corner)
    return occupied, room_ids


def _close_doors(plan: FloorPlan, solid: Bytes, resolution: float, corner: Point) -> None:
    """Write 1 into the cells uint8 (rows, cols) of all doors that are closed."""
    for door in plan.doors:
        if not door.is_open:
            fill(solid, plan.opening(door), 1, resolution, corner, sealed=True)


def _check(plan: FloorPlan) -> None:
    """Raise `MapError` where a plan contradicts itself, naming the plan and the part."""
    if not plan.name:
        raise MapError("a floor plan needs a name")
    if plan.source is not None and not isinstance(plan.source, PlanRaster):
        raise MapError(f"{plan._shown}: the source must be a PlanRaster, got {shortened(plan.source)}")
    for part, kind in (("room", Room), ("door", Door)):
        if wrong := [thing for thing in getattr(plan, f"{part}s") if not isinstance(thing, kind)]:
            raise MapError(f"{plan._shown}: {shortened(wrong[0])} is no {part}")
    check_plan(plan._shown, plan.rooms, plan.doors)
    ids = [room.id for room in plan.rooms]
    if not all(isinstance(i, int) and 0 < i < 2**31 for i in ids) or len(set(ids)) < len(ids):
        raise MapError(f"{plan._shown}: room ids are different whole numbers from 1, got {shortened(ids)}")
    check_ids(plan._shown, max(ids, default=0))
    for room in plan.rooms:
        _check_shape(plan, room.polygon, f"room {room.id}", empty=False)
    for what in ("walls", "furniture", "passages"):
        _check_shape(plan, getattr(plan, what), what, empty=True)
    known = {0, *ids}
    for k, door in enumerate(plan.doors):
        if not _is_sound(door):
            raise MapError(f"{plan._shown}, door {k}: needs two different finite ends, got {shortened(door)}")
        if unknown := set(door.rooms) - known:
            raise MapError(f"{plan._shown}, door {k}: there is no room {min(unknown)}")
    if plan.source is None and not plan.rooms and plan.passages.is_empty:
        raise MapError(f"{plan._shown} has no free space: it needs rooms or passages")


def _is_sound(door: Door) -> bool:
    """Whether a door has two ends, a width, and the ids of two rooms."""
    try:
        ends = (*door.start, *door.end)
        return (
            len(door.start) == len(door.end) == len(door.rooms) == 2
            and all(abs(value) <= MOST_METRES for value in ends)
            and door.width > 0.0
            and all(isinstance(room, (int, np.integer)) for room in door.rooms)
            and isinstance(door.is_open, (bool, np.bool_))
        )
    except (TypeError, ValueError, MemoryError):
        return False


def _check_shape(plan: FloorPlan, shape: Any, what: str, *, empty: bool) -> None:
    if not isinstance(shape, BaseGeometry):
        raise MapError(f"{plan._shown}, {what}: must be a shapely geometry, got {type(shape).__name__}")
    if shape.is_empty:
        if not empty:
            raise MapError(f"{plan._shown}, {what}: the polygon is empty")
        return
    if not polygons_of(shape):
        raise MapError(f"{plan._shown}, {what}: must be polygons, got {shape.geom_type}")
    if not (np.abs(shapely.get_coordinates(shape)) <= MOST_METRES).all():
        raise MapError(f"{plan._shown}, {what}: a coordinate is not a finite number, or too large")
    if not all(polygon.is_valid for polygon in polygons_of(shape)):
        raise MapError(f"{plan._shown}, {what}: {shapely.is_valid_reason(shape)}")
    if not (empty or shape.area > 0.0):
        raise MapError(f"{plan._shown}, {what}: the polygon has no area")
