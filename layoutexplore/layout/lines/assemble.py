"""From faces and their rooms to a `Layout`: labels, polygons, walls and lines in the world frame."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial
from itertools import pairwise

import numpy as np
import shapely
from numba import njit

from layoutexplore.grids.arrays import Cells, Floats32, Ints, Ints32, Mask, shows_shapes
from layoutexplore.grids.bitsets import true_cells
from layoutexplore.grids.grid import FREE, OCCUPIED, OccupancyGrid, Pose
from layoutexplore.grids.polygons import valid_polygons
from layoutexplore.layout.frame import angles_to_world, ranks, to_world
from layoutexplore.layout.lines.face_model import FaceModel, WallModel
from layoutexplore.layout.lines.face_outlines import outline
from layoutexplore.layout.lines.segments import AlignedSegments
from layoutexplore.layout.lines.walls import WallGroups
from layoutexplore.layout.timing import StageTimer
from layoutexplore.layout.types import (
    BORDER,
    OUTSIDE,
    Deferred,
    Details,
    Face,
    FaceEdge,
    FaceKind,
    Layout,
    LayoutRoom,
    Line,
    RoomReach,
    Wall,
)

KINDS = (FaceKind.EXTERNAL, FaceKind.PARTIAL, FaceKind.INTERNAL)


def assemble(
    method: str,
    grid: OccupancyGrid,
    model: WallModel,
    faces: FaceModel,
    room: Ints,
    timer: StageTimer,
    warnings: tuple[str, ...] = (),
) -> Layout:
    """The layout of faces and their rooms, moved to the world frame."""
    with timer("rooms"):
        labels = np.zeros(grid.shape, np.int32)
        of_cell = np.append(room[faces.group] + 1, 0).astype(np.int32)
        seen = np.zeros(room.max(initial=-1) + 2, np.bool_)
        _label_free(faces.painted, grid.cells, of_cell, labels, seen)
        room, labels = _numbered(room, labels, seen)
        details = FaceDetails(model, faces, room, grid.origin)
        if room.max(initial=-1) < 0:
            warnings = (*warnings, "no room: no face of the wall lines lies inside the seen space")
        ends = to_world(model.segments.reshape(-1, 2), grid.origin).reshape(-1, 4)
    return Layout(
        method=method,
        clean_grid=model.clean_grid,
        labels=labels,
        rooms=Deferred(timer.timed("rooms", partial(_rooms, details))),
        directions=np.sort(angles_to_world(model.aligned.directions, grid.origin)),
        structure_score=model.structure_score,
        segments=ends,
        walls=Deferred(
            timer.timed("rooms", partial(place_walls, model.aligned, model.walls, model.lines, grid.origin))
        ),
        timings=timer.seconds,
        warnings=warnings,
        details=details,
    )


@shows_shapes
@dataclass(frozen=True, eq=False)
class FaceDetails(Details):
    """Lines and faces as objects, made from the arrays when they are asked for.

    Attributes:
        model: The lines.
        face_model: Their faces, n of them.
        room: int64 (n,), room of each face from 0, -1 for none.
        origin: Of the grid.
        rooms: At least so many rooms there are, those without a face among them.
    """

    model: WallModel
    face_model: FaceModel
    room: Ints
    origin: Pose
    rooms: int = 0

    @property
    def cell_scores(self) -> Floats32 | None:
        """As the method found them."""
        return self.model.cell_scores

    def faces_of(self, room: int) -> tuple[int, ...]:
        """Indices of the faces of a room, rising."""
        return tuple(np.flatnonzero(self.room == room - 1).tolist())

    @cached_property
    def lines(self) -> tuple[Line, ...]:
        """Representative lines, the box's border last."""
        faces, aligned = self.face_model, self.model.lines.direction
        lines, angle = faces.arrangement.lines, angles_to_world(self.model.aligned.directions, self.origin)
        start, end = (to_world(points, self.origin).tolist() for points in lines.ends())
        direction = [*ranks(angle)[aligned].tolist(), *[BORDER] * 4]
        angles = [*angle[aligned].tolist(), *angles_to_world(lines.angle[-4:], self.origin).tolist()]
        return tuple(
            Line(
                direction=direction[i],
                angle=angles[i],
                start=tuple(start[i]),
                end=tuple(end[i]),
                weight=float(faces.weight[i]),
                is_local=bool(faces.dropped[i]),
                is_border=direction[i] == BORDER,
            )
            for i in range(len(lines))
        )

    @cached_property
    def faces(self) -> tuple[Face, ...]:
        """The faces, by id."""
        model, edges = self.face_model, self._edges()
        return tuple(
            Face(
                id=i,
                polygon=polygon,
                kind=KINDS[model.kind[i]],
                inside_share=float(model.inside_share[i]),
                edges=tuple(edges[i]),
                room=int(self.room[i]) + 1,
            )
            for i, polygon in enumerate(
                polygons_to_world(outline(model.arrangement, model.group, len(model)), self.origin)
            )
        )

    @cached_property
    def room_reach(self) -> RoomReach:
        """The cells of the rooms' faces."""
        model = self.face_model
        of_cell = np.append(self.room[model.group] + 1, 0).astype(np.int32)
        at_border = np.zeros(max(int(self.room.max(initial=-1)) + 1, self.rooms) + 1, np.bool_)
        at_border[self.room[model.at_border] + 1] = True
        at_border[0] = False  # faces in no room
        return RoomReach(_looked_up(model.painted, of_cell), at_border)

    def _edges(self) -> list[list[FaceEdge]]:
        """The sides of each face that part it from another one or from what lies outside the box."""
        model, arrangement = self.face_model, self.face_model.arrangement
        ends = to_world(arrangement.vertices, self.origin)
        edges: list[list[FaceEdge]] = [[] for _ in range(len(model))]
        of_half = np.where(arrangement.face >= 0, model.group[arrangement.face], OUTSIDE)
        share = model.covered / np.maximum(arrangement.edge_length, 1e-9)
        border = len(model.weight) - 4
        for half in np.flatnonzero(
            (of_half >= 0) & (of_half != of_half.reshape(-1, 2)[:, ::-1].reshape(-1))
        ).tolist():
            edge = int(half) // 2
            start, end = arrangement.edges[edge][:: 1 - 2 * (int(half) % 2)].tolist()
            line = int(arrangement.line[edge])
            edges[of_half[half]].append(
                FaceEdge(
                    start=(float(ends[start, 0]), float(ends[start, 1])),
                    end=(float(ends[end, 0]), float(ends[end, 1])),
                    line=line if line < border else BORDER,
                    weight=float(min(share[edge], 1.0)),
                    neighbour=int(of_half[half ^ 1]),
                )
            )
        return edges


def polygons_to_world(polygons: list[shapely.Polygon], origin: Pose) -> list[shapely.Polygon]:
    """Polygons of the local frame in the world frame, valid there too."""
    return valid_polygons(
        shapely.transform(np.array(polygons, object), lambda points: to_world(points, origin))
    )


@njit(cache=True, nogil=True)
def _looked_up(painted: Ints32, of_cell: Ints32) -> Ints32:
    """The entry of `of_cell` of the arrangement's cell at each grid cell; its last one where that is -1."""
    out = np.empty(painted.shape, np.int32)
    for row in range(painted.shape[0]):
        for col in range(painted.shape[1]):
            out[row, col] = of_cell[painted[row, col]]
    return out


@njit(cache=True, nogil=True)
def _label_free(painted: Ints32, cells: Cells, of_cell: Ints32, labels: Ints32, seen: Mask) -> None:
    """Write the room of the face that holds each free cell, and which rooms hold any; others stay."""
    for row in range(painted.shape[0]):
        for col in range(painted.shape[1]):
            if painted[row, col] >= 0 and cells[row, col] == FREE:
                labels[row, col] = of_cell[painted[row, col]]
                seen[labels[row, col]] = True


def _numbered(room: Ints, labels: Ints32, seen: Mask) -> tuple[Ints, Ints32]:
    """Rooms of faces and cells without those that hold no free cell: slits between lines."""
    if seen[1:].all():
        return room, labels
    held = np.append(False, seen[1:])  # entry 0 stands for cells in no room
    number = np.where(held, np.cumsum(held), 0)
    return number[room + 1] - 1, number.astype(np.int32)[labels]


def _rooms(details: FaceDetails) -> tuple[LayoutRoom, ...]:
    faces, room = details.face_model, details.room
    count = int(room.max(initial=-1)) + 1
    polygons = polygons_to_world(
        outline(faces.arrangement, np.append(room, -1)[faces.group], count), details.origin
    )
    by_room = np.argsort(room, kind="stable")
    members = np.split(by_room, np.searchsorted(room[by_room], np.arange(count)))[1:]
    area = np.bincount(faces.group, faces.arrangement.area, len(faces))
    known, is_open = faces.known_share * area, faces.kind == 1
    return tuple(
        LayoutRoom(
            id=i + 1,
            polygon=polygon,
            seen_share=float(known[inside].sum() / area[inside].sum()),
            is_partial=bool(is_open[inside].any()),
            is_closed=not faces.at_border[inside].any(),
            details=details,
        )
        for i, (polygon, inside) in enumerate(zip(polygons, members, strict=True))
    )


def place_walls(
    aligned: AlignedSegments, walls: WallGroups, lines: WallGroups, origin: Pose
) -> tuple[Wall, ...]:
    """The walls in the world frame.

    Args:
        aligned: The segments.
        walls: Which of them make a wall.
        lines: Which of them share a representative line.
        origin: Of the grid.
    """
    angle = angles_to_world(aligned.directions, origin)
    line = np.zeros(len(walls), np.int64)
    line[walls.group] = lines.group
    ends = [to_world(points, origin).tolist() for points in walls.ends(aligned.directions)]
    order = np.argsort(walls.group, kind="stable").astype(np.int32)
    begin = [0, *np.cumsum(np.bincount(walls.group, minlength=len(walls))).tolist()]
    members = [order[i:j] for i, j in pairwise(begin)]
    directions, angles = ranks(angle)[walls.direction].tolist(), angle[walls.direction].tolist()
    return tuple(
        Wall(direction=d, angle=t, start=tuple(a), end=tuple(b), segments=m, line=k)
        for d, t, a, b, m, k in zip(directions, angles, *ends, members, line.tolist(), strict=True)
    )


def clean_grid(grid: OccupancyGrid, structure: Mask) -> OccupancyGrid:
    """The grid with occupied cells that are not structure turned free."""
    return freed(grid, true_cells((grid.cells == OCCUPIED) & ~structure))


def freed(grid: OccupancyGrid, clutter: Ints) -> OccupancyGrid:
    """The grid with some cells, given by their flat indices, turned free."""
    cells = grid.cells.copy()
    cells.reshape(-1)[clutter] = FREE
    return OccupancyGrid(cells, grid.resolution, grid.origin)
