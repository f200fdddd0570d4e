"""What a layout is: directions, walls, lines, faces and rooms, all in metres of the world frame.

The vocabulary is that of the IAS-15, ROSE and ROSE2 papers: a *wall* is a chain of collinear segments, a
*representative line* runs through one or more walls, a *face* is a cell of the arrangement of the lines, a
*room* is a union of faces.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import cached_property
from typing import Any, NamedTuple, Self, TypeVar, overload

import numpy as np
import shapely

from layoutexplore.errors import MapError, shortened
from layoutexplore.grids.arrays import Floats, Floats32, Ints32, Mask, shows_shapes
from layoutexplore.grids.grid import FREE, OCCUPIED, OccupancyGrid
from layoutexplore.grids.polygons import Point
from layoutexplore.options import check_kind

OUTSIDE = -1
"""The neighbour of a face across an edge behind which there is no face."""

BORDER = -1
"""Direction and line index of what belongs to the border of the map's box instead of a wall."""


class FaceKind(StrEnum):
    """How a face lies to the seen map (IAS-15, section III)."""

    EXTERNAL = "external"
    PARTIAL = "partial"
    INTERNAL = "internal"


@shows_shapes
@dataclass(frozen=True, kw_only=True, eq=False)
class Wall:
    """Collinear segments that belong together.

    Attributes:
        direction: Index into `Layout.directions`.
        angle: In radians, counter-clockwise from x, in [0, pi).
        start: First end of the wall.
        end: Other end of the wall.
        segments: int32 (k,), the rows of `Layout.segments` the wall is made of.
        line: Index into `Layout.lines` of the representative line through it, or -1.
    """

    direction: int
    angle: float
    start: Point
    end: Point
    segments: Ints32
    line: int = -1

    @property
    def length(self) -> float:
        """Distance between the ends, in metres."""
        return float(np.hypot(self.end[0] - self.start[0], self.end[1] - self.start[1]))


@dataclass(frozen=True, kw_only=True, eq=False)
class Line:
    """A representative line, clipped to the box of the map.

    Attributes:
        direction: Index into `Layout.directions`, or `BORDER` for the four sides of the box.
        angle: In radians, counter-clockwise from x, in [0, pi).
        start: First end.
        end: Other end.
        weight: Share of its length that is covered by seen wall.
        is_local: Only some of its edges separate faces: the rest of the line was dropped.
        is_border: A side of the padded box of the map.
    """

    direction: int
    angle: float
    start: Point
    end: Point
    weight: float
    is_local: bool = False
    is_border: bool = False


class FaceEdge(NamedTuple):
    """A side of a face: its ends, its line, the covered share, and the face behind it (or `OUTSIDE`)."""

    start: Point
    end: Point
    line: int
    weight: float
    neighbour: int


@shows_shapes
@dataclass(frozen=True, kw_only=True, eq=False)
class Face:
    """A cell of the arrangement of representative lines.

    Attributes:
        id: Index into `Layout.faces`.
        polygon: In world metres.
        kind: External, partial or internal.
        inside_share: Share of the face inside the contour of the seen map.
        edges: Its sides, counter-clockwise.
        room: Id of the room it belongs to; 0 for none.
    """

    id: int
    polygon: shapely.Polygon
    kind: FaceKind
    inside_share: float
    edges: tuple[FaceEdge, ...]
    room: int = 0

    @property
    def neighbours(self) -> tuple[int, ...]:
        """Indices of the faces on the other side of its edges, each once, in rising order."""
        return tuple(sorted({e.neighbour for e in self.edges} - {OUTSIDE}))


class RoomReach(NamedTuple):
    """How far the rooms reach beyond what is seen of them: to the borders of their faces.

    Attributes:
        labels: int32 (rows, cols), the room whose faces hold each cell's centre, seen or not, 0 for none.
        at_border: bool (rooms + 1,), by room id: a face of it has a side on the border of the map's box.
    """

    labels: Ints32
    at_border: Mask


class Details:
    """What a method found on its way, computed when it is first asked for; this one found nothing.

    A method whose layouts have lines, faces or scores gives them a child of this class.
    """

    @property
    def lines(self) -> tuple[Line, ...]:
        """Representative lines, the box's border last."""
        return ()

    @property
    def faces(self) -> tuple[Face, ...]:
        """The faces of the lines, by id."""
        return ()

    @property
    def room_reach(self) -> RoomReach | None:
        """The cells of the rooms' faces, cheaper than `faces`; None without faces."""
        return None

    @property
    def cell_scores(self) -> Floats32 | None:
        """float32 (rows, cols) in 0..1, ROSE's score of the occupied cells."""
        return None

    def faces_of(self, room: int) -> tuple[int, ...]:
        """Indices of the faces of a room, rising."""
        return ()


@shows_shapes
@dataclass(frozen=True, eq=False)
class ScoreDetails(Details):
    """The details of a method that only scores cells."""

    scores: Floats32

    @property
    def cell_scores(self) -> Floats32:
        """As they were given."""
        return self.scores


@dataclass(frozen=True, kw_only=True, eq=False)
class LayoutRoom:
    """A predicted room.

    Attributes:
        id: 1-based; the value of its cells in `Layout.room_labels`.
        polygon: Valid polygon in world metres; rooms do not overlap.
        seen_share: Share of the polygon's area that is known free or occupied.
        is_partial: Part of the room has not been seen.
        is_closed: No side of the room lies on the border of the map's box: walls or lines bound it.
        details: Of the layout that the room belongs to.
    """

    id: int
    polygon: shapely.Polygon
    seen_share: float = 1.0
    is_partial: bool = False
    is_closed: bool = True
    details: Details = field(default_factory=Details, repr=False)

    @property
    def area(self) -> float:
        """Of the polygon, in square metres.

        The polygons of `default`, `rose2` and `ias15` have half of the walls and what stands in the room in
        them; the floor that is seen is in `Layout.free_areas`.
        """
        return float(self.polygon.area)

    @property
    def faces(self) -> tuple[int, ...]:
        """Indices into `Layout.faces`; empty without faces, and for a room that no face belongs to."""
        return self.details.faces_of(self.id)


ItemT = TypeVar("ItemT", covariant=True)


class Deferred(Sequence[ItemT]):
    """Rooms or walls that are made when they are first looked at: predictions need their cells alone.

    Args:
        make: Makes them.
    """

    def __init__(self, make: Callable[[], tuple[ItemT, ...]]) -> None:
        self._make = make

    @cached_property
    def _items(self) -> tuple[ItemT, ...]:
        return self._make()

    @overload
    def __getitem__(self, index: int) -> ItemT: ...

    @overload
    def __getitem__(self, index: slice) -> tuple[ItemT, ...]: ...

    def __getitem__(self, index: int | slice) -> ItemT | tuple[ItemT, ...]:
        """One of them, or some."""
        return self._items[index]

    def __len__(self) -> int:
        return len(self._items)

    def __getstate__(self) -> dict[str, tuple[ItemT, ...]]:
        return {"_items": self._items}  # what makes them is a function of a run, which does not travel

    def __deepcopy__(self, memo: object) -> Self:
        return self  # nothing of it changes, and a copy made in between need not wait for them


@shows_shapes
@dataclass(frozen=True, kw_only=True, eq=False)
class Layout:
    """The reconstructed layout of a grid, with every intermediate result that the method computes.

    Attributes:
        method: Name of the method.
        clean_grid: The grid with clutter turned free; its frame is the frame of `labels`.
        labels: int32 (rows, cols), room id of each cell that a room claims, 0 for none.
        rooms: The rooms, by id.
        directions: float64 (k,), dominant directions of the walls in radians in [0, pi), in the world frame,
            rising.
        structure_score: ROSE's W: near 0 for a structured map, near 1 for an unstructured one; NaN if not
            computed.
        segments: float64 (n, 4), wall segments as (x0, y0, x1, y1).
        walls: Chains of collinear segments.
        timings: Seconds a stage, in the order in which they ran.
        warnings: What went wrong or is missing, in words.
        details: What gives `lines`, `faces` and `cell_scores` when they are asked for.
    """

    method: str
    clean_grid: OccupancyGrid
    labels: Ints32
    rooms: Sequence[LayoutRoom] = ()
    directions: Floats = field(default_factory=lambda: np.zeros(0))
    structure_score: float = float("nan")
    segments: Floats = field(default_factory=lambda: np.zeros((0, 4)))
    walls: Sequence[Wall] = ()
    timings: Mapping[str, float] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    details: Details = field(default_factory=Details, repr=False)

    def __post_init__(self) -> None:
        check_kind("clean_grid", self.clean_grid, OccupancyGrid)
        for name, kind, ndim in (("labels", "i", 2), ("directions", "f", 1), ("segments", "f", 2)):
            array = getattr(self, name)
            if not isinstance(array, np.ndarray) or array.dtype.kind != kind or array.ndim != ndim:
                numbers = {"i": "whole numbers", "f": "floats"}[kind]
                raise MapError(
                    f"{name} must be a {ndim}-dimensional array of {numbers}, got {shortened(array)}"
                )
        parts: tuple[tuple[str, type], ...] = (("rooms", LayoutRoom), ("walls", Wall), ("warnings", str))
        for name, part in parts:
            given = getattr(self, name)
            check_kind(name, given, Sequence)
            for one in given if isinstance(given, (tuple, list)) else ():  # others make theirs when asked
                if not isinstance(one, part):
                    check_kind(f"each of {name}", one, part)
        check_kind("method", self.method, str)
        check_kind("structure_score", self.structure_score, float, int, np.floating)
        check_kind("timings", self.timings, Mapping)
        check_kind("details", self.details, Details)

    def completed(self) -> Layout:
        """The same with all rooms and walls made."""
        return replace(self, rooms=tuple(self.rooms), walls=tuple(self.walls))

    @property
    def lines(self) -> tuple[Line, ...]:
        """Representative lines, the four sides of the map's box last; empty for methods without lines."""
        return self.details.lines

    @property
    def faces(self) -> tuple[Face, ...]:
        """The cells of the representative lines, by id; empty for methods without lines."""
        return self.details.faces

    @property
    def room_reach(self) -> RoomReach | None:
        """The cells of the rooms' faces, in the frame of `labels`; None for methods without lines."""
        return self.details.room_reach

    @property
    def cell_scores(self) -> Floats32 | None:
        """float32 (rows, cols) in 0..1, ROSE's score of the occupied cells; None without scores."""
        return self.details.cell_scores

    @property
    def free_areas(self) -> dict[int, float]:
        """By id of a room the square metres of its free cells, without walls and what stands in it."""
        ids, counts = np.unique(self.labels[self.clean_grid.free], return_counts=True)
        cells = dict(zip(ids.tolist(), counts.tolist(), strict=True))
        return {room.id: cells.get(room.id, 0) * self.clean_grid.resolution**2 for room in self.rooms}

    @property
    def seconds(self) -> float:
        """Time of all stages together."""
        return float(sum(self.timings.values()))

    def room_labels(self, grid: OccupancyGrid | None = None) -> Ints32:
        """Room ids int32 (rows, cols) on the cells of a grid that are not occupied, 0 for none.

        Args:
            grid: The grid to label, in the frame of the one that was reconstructed; it may have learnt more
                since. Without it, the reconstructed grid as the method saw it.

        Raises:
            MapError: The grid has another shape or resolution than the one that was reconstructed.
        """
        if grid is None:
            return self.labels
        check_kind("grid", grid, OccupancyGrid)
        if grid.shape != self.labels.shape or grid.resolution != self.clean_grid.resolution:
            raise MapError(
                f"the layout is of a grid of {self.labels.shape} cells of {self.clean_grid.resolution} m, "
                f"not {grid.shape} cells of {grid.resolution} m"
            )
        return np.where(grid.cells == OCCUPIED, np.int32(0), self.labels)


def empty_layout(method: str, grid: OccupancyGrid, warning: str, **fields: Any) -> Layout:
    """A layout without rooms that says why."""
    clean = fields.pop("clean_grid", grid)
    labels = np.zeros(grid.shape, np.int32)
    return Layout(method=method, clean_grid=clean, labels=labels, warnings=(warning,), **fields)


def has_free_space(grid: OccupancyGrid) -> bool:
    """Whether any cell is known to be free."""
    return bool((grid.cells == FREE).any())
