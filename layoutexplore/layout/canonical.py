"""Running a method in a map's canonical frame, so that turned, mirrored or moved it has the same rooms.

What decides close calls in raster order, or by the order of directions, treats a map and its mirror image
differently. Brought into the orientation that follows from where their free cells lie, both are one map. What
rounds lines by their distance from the first cell, or ends at the border of the array, does so with a map and
itself in a wider picture: what is known is cut out, with a margin of the same width all around.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, wraps
from itertools import chain
from typing import Any, Concatenate, NamedTuple, ParamSpec, TypeVar

import cv2
import numpy as np
import shapely
from numba import njit
from numpy.typing import NDArray

from layoutexplore.grids.arrays import Cells, Floats, Floats32, Ints, shows_shapes
from layoutexplore.grids.boxes import known_box
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from layoutexplore.grids.polygons import Point, valid_polygons
from layoutexplore.layout.frame import angles_to_world, ranks, to_world, undirected
from layoutexplore.layout.limits import cells_at_most
from layoutexplore.layout.types import (
    BORDER,
    Deferred,
    Details,
    Face,
    FaceEdge,
    Layout,
    LayoutRoom,
    Line,
    RoomReach,
    Wall,
)

MARGIN = 2
"""Unknown cells around what is known; with them, the border of the array means nothing."""

ConfigT = TypeVar("ConfigT")
Params = ParamSpec("Params")
Side = TypeVar("Side", Line, Wall)
T = TypeVar("T", np.int8, np.int32, np.bool_, np.float32)


def in_canonical_orientation(
    run: Callable[[OccupancyGrid, ConfigT], Layout],
) -> Callable[[OccupancyGrid, ConfigT], Layout]:
    """Decorate `run(grid, config)`: it sees what is known, oriented, and its layout is brought back.

    The margin is as wide as the option `margin`, for methods whose lines reach so far beyond the walls.
    """

    @wraps(run)
    def run_oriented(grid: OccupancyGrid, config: ConfigT) -> Layout:
        if not grid.free.any():
            return run(grid, config)
        row0, row1, col0, col1 = known_box(grid.cells)
        reach = cells_at_most(getattr(config, "margin", 0.0), grid.resolution, row1 - row0 + col1 - col0)
        window = Cutout(row0 - reach, row1 + reach, col0 - reach, col1 + reach)
        cells = window.cut(grid.cells, UNKNOWN)
        orientation = canonical_orientation(trinary_part(cells)[0])
        found = run(OccupancyGrid(orientation.apply(cells), grid.resolution), config)
        return Inversion(orientation, window, grid, found.directions).layout(found)

    return run_oriented


def with_unknown_around(
    run: Callable[Concatenate[OccupancyGrid, Params], Layout],
) -> Callable[Concatenate[OccupancyGrid, Params], Layout]:
    """Decorate `run(grid, ...)`: a map that is known up to the border of its array is seen with a margin.

    For methods that find the canonical frame themselves.
    """

    @wraps(run)
    def run_with_margin(grid: OccupancyGrid, /, *args: Params.args, **options: Params.kwargs) -> Layout:
        row0, row1, col0, col1 = known_box(grid.cells)
        rows, cols = grid.shape
        if row1 == 0 or min(row0, rows - row1, col0, cols - col1) >= MARGIN:
            return run(grid, *args, **options)
        window = Cutout(-MARGIN, rows + MARGIN, -MARGIN, cols + MARGIN)
        cells = window.cut(grid.cells, UNKNOWN)
        found = run(OccupancyGrid(cells, grid.resolution), *args, **options)
        return Inversion(Orientation(), window, grid, found.directions).layout(found)

    return run_with_margin


class Cutout(NamedTuple):
    """A part of a grid, half open, that may reach beyond its borders."""

    row0: int
    row1: int
    col0: int
    col1: int

    def cut(self, cells: NDArray[T], nothing: int) -> NDArray[T]:
        """The cells of the window; `nothing` where the grid has none."""
        rows, cols = cells.shape
        part = cells[max(self.row0, 0) : self.row1, max(self.col0, 0) : self.col1]
        beyond = max(-self.row0, 0), max(self.row1 - rows, 0), max(-self.col0, 0), max(self.col1 - cols, 0)
        return np.pad(part, (beyond[:2], beyond[2:]), constant_values=nothing)

    def paste(self, cells: NDArray[T], shape: tuple[int, int], nothing: int) -> NDArray[T]:
        """A grid (rows, cols) with the cells of the window; `nothing` around it."""
        rows, cols = shape
        return Cutout(-self.row0, rows - self.row0, -self.col0, cols - self.col0).cut(cells, nothing)


@dataclass(frozen=True, eq=False)
class Inversion:
    """From a part of a grid that was oriented, at the origin, back to the grid as it was.

    Attributes:
        orientation: What was applied to it.
        window: The part.
        grid: The grid.
        directions: float64 (k,), the directions found in the oriented part.
    """

    orientation: Orientation
    window: Cutout
    grid: OccupancyGrid
    directions: Floats

    def points(self, points: Floats) -> Floats:
        """World points float64 (n, 2) of points of the oriented part."""
        x, y = points[:, ::-1].T if self.orientation.swap else points.T
        row0, row1, col0, col1 = (side * self.grid.resolution for side in self.window)
        x = col1 - x if self.orientation.mirror_cols else col0 + x
        y = row1 - y if self.orientation.mirror_rows else row0 + y
        return to_world(np.stack([x, y], axis=1), self.grid.origin)

    def cells(self, cells: NDArray[T], nothing: int = 0) -> NDArray[T]:
        """Cells of the oriented part as they lie in the grid; `nothing` where it is not."""
        return self.window.paste(self.orientation.invert(cells), self.grid.shape, nothing)

    def angles(self, angles: Floats) -> Floats:
        """Directions float64 (n,) in the world, in [0, pi), of directions in the oriented grid."""
        return angles_to_world(self.orientation.invert_angles(angles), self.grid.origin)

    def pairs(self, points: Iterable[Point]) -> list[Point]:
        """The world points of points."""
        flat = np.fromiter(chain.from_iterable(points), np.float64).reshape(-1, 2)
        return [(x, y) for x, y in self.points(flat).tolist()]

    @cached_property
    def mirrors(self) -> bool:
        """Whether what ran counter-clockwise runs clockwise once it is brought back."""
        return self.orientation.swap ^ self.orientation.mirror_rows ^ self.orientation.mirror_cols

    def polygons(self, polygons: Iterable[shapely.Polygon]) -> list[shapely.Polygon]:
        """The polygons in the world, their rings running as before."""
        moved: Any = shapely.transform(np.array([*polygons], object), self.points)
        return valid_polygons(shapely.reverse(moved) if self.mirrors else moved)

    @cached_property
    def rank(self) -> Ints:
        """int64 (k,): the new index of each direction, for directions rise."""
        return ranks(self.angles(self.directions))

    def sides(self, sides: Sequence[Side]) -> tuple[Side, ...]:
        """Walls or lines."""
        angles = self.angles(np.array([side.angle for side in sides])).tolist()
        starts, ends = self.pairs(side.start for side in sides), self.pairs(side.end for side in sides)
        rank = [*self.rank.tolist(), BORDER]  # the border's is -1
        return tuple(
            replace(side, direction=rank[side.direction], angle=angle, start=start, end=end)
            for side, angle, start, end in zip(sides, angles, starts, ends, strict=True)
        )

    def face(self, face: Face) -> Face:
        """A face; its sides run counter-clockwise again."""
        ends = zip(
            self.pairs(edge.start for edge in face.edges),
            self.pairs(edge.end for edge in face.edges),
            strict=True,
        )
        edges = [FaceEdge(start, end, *edge[2:]) for (start, end), edge in zip(ends, face.edges, strict=True)]
        if self.mirrors:
            edges = [FaceEdge(edge.end, edge.start, *edge[2:]) for edge in reversed(edges)]
        return replace(face, polygon=self.polygons([face.polygon])[0], edges=tuple(edges))

    def rooms(self, rooms: Sequence[LayoutRoom], details: Details) -> tuple[LayoutRoom, ...]:
        """Rooms, with the details of the layout that is brought back."""
        polygons = self.polygons(room.polygon for room in rooms)
        return tuple(replace(r, polygon=p, details=details) for r, p in zip(rooms, polygons, strict=True))

    def layout(self, found: Layout) -> Layout:
        """The layout of the grid."""
        details = InvertedDetails(found.details, self)
        return replace(
            found,
            clean_grid=replace(self.grid, cells=self.cells(found.clean_grid.cells, UNKNOWN)),
            labels=self.cells(found.labels),
            rooms=Deferred(lambda: self.rooms(found.rooms, details)),
            directions=np.sort(self.angles(found.directions)),
            segments=self.points(found.segments.reshape(-1, 2)).reshape(-1, 4),
            walls=Deferred(lambda: self.sides(found.walls)),
            details=details,
        )


@shows_shapes
@dataclass(frozen=True, eq=False)
class InvertedDetails(Details):
    """Details of an oriented grid, brought back when they are asked for."""

    oriented: Details
    inversion: Inversion

    @cached_property
    def lines(self) -> tuple[Line, ...]:
        """Representative lines, the box's border last."""
        return self.inversion.sides(self.oriented.lines)

    @cached_property
    def faces(self) -> tuple[Face, ...]:
        """The faces, by id."""
        return tuple(self.inversion.face(face) for face in self.oriented.faces)

    @cached_property
    def room_reach(self) -> RoomReach | None:
        """The cells of the rooms' faces."""
        found = self.oriented.room_reach
        return found and found._replace(labels=self.inversion.cells(found.labels))

    @property
    def cell_scores(self) -> Floats32 | None:
        """ROSE's score of the occupied cells."""
        scores = self.oriented.cell_scores
        return None if scores is None else self.inversion.cells(scores)

    def faces_of(self, room: int) -> tuple[int, ...]:
        """Indices of the faces of a room, rising."""
        return self.oriented.faces_of(room)


@dataclass(frozen=True)
class Orientation:
    """One of the eight orientations of a part of a grid: mirrored first, then rows and columns swapped.

    Attributes:
        mirror_rows: The order of the rows is reversed.
        mirror_cols: The order of the columns is reversed.
        swap: Rows become columns.
    """

    mirror_rows: bool = False
    mirror_cols: bool = False
    swap: bool = False

    def apply(self, cells: NDArray[T]) -> NDArray[T]:
        """The cells (rows, cols) in this orientation."""
        mirrored = self._mirrored(np.ascontiguousarray(cells))
        return _transposed(mirrored) if self.swap else mirrored

    def invert(self, cells: NDArray[T]) -> NDArray[T]:
        """Cells in this orientation as they lie in the grid."""
        return self._mirrored(_transposed(cells) if self.swap else np.ascontiguousarray(cells))

    def _mirrored(self, cells: NDArray[T]) -> NDArray[T]:
        if not (self.mirror_rows or self.mirror_cols):
            return cells
        code = -1 if self.mirror_rows and self.mirror_cols else int(self.mirror_cols)
        return np.asarray(cv2.flip(_plain(cells), code)).view(cells.dtype)

    def invert_angles(self, angles: Floats) -> Floats:
        """Directions (n,) in this orientation as directions in the grid, radians in [0, pi)."""
        if self.swap:
            angles = np.pi / 2 - angles
        return undirected(-angles if self.mirror_rows != self.mirror_cols else angles)


def _transposed(cells: NDArray[T]) -> NDArray[T]:
    return np.asarray(cv2.transpose(_plain(np.ascontiguousarray(cells)))).view(cells.dtype)


def _plain(cells: NDArray[T]) -> Any:
    """Cells of a type that OpenCV knows."""
    return cells.view(np.uint8) if cells.dtype == np.bool_ else cells


def canonical_orientation(cells: Cells) -> Orientation:
    """The orientation in which the cells are wider than high, most free ones low and left of the middle."""
    free = (cells == FREE).view(np.uint8)
    high, wide = (np.arange(1 - n, n, 2) for n in cells.shape)  # twice the distance from the middle
    rows, cols = (
        cv2.reduce(free, axis, cv2.REDUCE_SUM, dtype=cv2.CV_32S).reshape(-1).astype(np.int64)
        for axis in (1, 0)
    )
    spread = (rows @ high**2, cols @ wide**2)
    swap = cells.shape[0] > cells.shape[1] or (cells.shape[0] == cells.shape[1] and spread[0] > spread[1])
    return Orientation(mirror_rows=bool(rows @ high > 0), mirror_cols=bool(cols @ wide > 0), swap=bool(swap))


def trinary_part(cells: Cells) -> tuple[Cells, tuple[int, int]]:
    """The known part of a grid as -1, 0 and 100 (above 50 is occupied, 1 to 50 unknown), and its corner.

    Args:
        cells: int8 (rows, cols), -1 unknown, 0 free ... 100 occupied.
    """
    row0, row1, col0, col1 = known_box(cells, MARGIN)
    return _trinary(np.ascontiguousarray(cells[row0:row1, col0:col1], np.int8)), (row0, col0)


@njit(cache=True, nogil=True)
def _trinary(cells: Cells) -> Cells:
    """Free, occupied and unknown cells: what is neither free nor above 50 is unknown."""
    rows, cols = cells.shape
    out = np.empty((rows, cols), np.int8)
    for r in range(rows):
        for c in range(cols):
            known = np.int8(FREE) if cells[r, c] == FREE else np.int8(UNKNOWN)
            out[r, c] = np.int8(OCCUPIED) if cells[r, c] > 50 else known
    return out
