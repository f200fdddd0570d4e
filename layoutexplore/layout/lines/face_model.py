"""The faces of a map's representative lines: their weights, kinds and neighbours (IAS-15, section III).

Shared by the methods that are built on lines (IAS-15, ROSE2); they differ in how they find the lines.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numba import njit

from layoutexplore.errors import ConfigError
from layoutexplore.grids.arrays import ZERO, Bytes, Cells, Floats, Floats32, Ints, Ints32, Mask
from layoutexplore.grids.grid import FREE, UNKNOWN, OccupancyGrid
from layoutexplore.grids.runs import run_end
from layoutexplore.layout.frame import extent
from layoutexplore.layout.lines.face_clusters import (
    FaceGraph,
    cluster_faces,
    dissolve,
    face_graph,
    merge_small,
)
from layoutexplore.layout.lines.face_outlines import paint_faces
from layoutexplore.layout.lines.faces import Arrangement, Bounds, LineSet, arrange, clip_lines, cover_lines
from layoutexplore.layout.lines.segments import AlignedSegments
from layoutexplore.layout.lines.walls import WallGroups, sums
from layoutexplore.layout.timing import StageTimer
from layoutexplore.options import check_fields


@dataclass(frozen=True, kw_only=True)
class FaceConfig:
    """How faces become rooms.

    Attributes:
        margin: The box of the lines reaches so far beyond the walls, in metres.
        line_weight: A line covered for a smaller share of its length is dropped but for its well covered
            edges.
        edge_weight: An edge of a dropped line stays when at least this share of it is covered.
        edge_length: ... and when it is at least so long, in metres.
        inside_share: A face with a smaller share inside the contour is external.
        partial_weight: A face next to an external one over an edge of smaller weight is partial; so is one at
            the border.
        sigma: Scale of an edge's weight in the affinity of the faces on its sides (ROSE2's code: 0.125).
        affinity: Least normalised affinity of two faces of one room (1 - eps of DBSCAN).
        room_area: Rooms with less free space, in square metres, join a neighbour.
        region_area: Seen regions smaller than this, in square metres, do not count as inside.
    """

    margin: float = 1.0
    line_weight: float = 0.1
    edge_weight: float = 0.9
    edge_length: float = 0.0
    inside_share: float = 0.2
    partial_weight: float = 0.05
    sigma: float = 0.1
    affinity: float = 0.15
    room_area: float = 1.9
    region_area: float = 2.0

    def __post_init__(self) -> None:
        check_fields(self)
        for name in ("line_weight", "edge_weight", "inside_share", "partial_weight", "affinity"):
            if not 0 <= getattr(self, name) <= 1:
                raise ConfigError(f"{name} must lie between 0 and 1, got {getattr(self, name)}")
        for name in ("margin", "room_area", "region_area"):
            if getattr(self, name) < 0:
                raise ConfigError(f"{name} must not be negative, got {getattr(self, name)}")
        if self.sigma <= 0:
            raise ConfigError(f"sigma must be above 0, got {self.sigma}")


@dataclass(frozen=True, kw_only=True, eq=False)
class WallModel:
    """What a method found before the faces: segments, walls and the groups of segments that share a line.

    Attributes:
        clean_grid: The grid the segments come from.
        segments: float64 (n, 4), in metres of the local frame.
        aligned: The same segments on their directions.
        walls: The walls.
        lines: The representative lines.
        structure_score: ROSE's W, or NaN.
        cell_scores: ROSE's scores, or None.
    """

    clean_grid: OccupancyGrid
    segments: Floats
    aligned: AlignedSegments
    walls: WallGroups
    lines: WallGroups
    structure_score: float = float("nan")
    cell_scores: Floats32 | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class FaceModel:
    """The faces of a wall model: m lines, f cells of the arrangement, n faces (unions over dropped edges).

    Attributes:
        arrangement: The cells of all lines.
        covered: float64 (e,), covered metres of each edge.
        weight: float64 (m + 4,), covered share of each line; 1 for the box's sides.
        dropped: bool (m + 4,), lines of which only well covered edges remain.
        group: int64 (f,), face of each cell of the arrangement.
        graph: The faces' neighbourhood.
        inside_share: float64 (n,), share of each face inside the contour of what has been seen.
        known_share: float64 (n,), share of each face's grid cells that are known.
        free_area: float64 (n,), square metres.
        painted: int32 (rows, cols), the cell of the arrangement at each grid cell, -1 outside the box.
        region: uint8 (rows, cols), 1 inside the contour of what has been seen.
        kind: int64 (n,), 0 external, 1 partial, 2 internal.
        at_border: bool (n,), the face has a side on the border of the box.
    """

    arrangement: Arrangement
    covered: Floats
    weight: Floats
    dropped: Mask
    group: Ints
    graph: FaceGraph
    inside_share: Floats
    known_share: Floats
    free_area: Floats
    painted: Ints32
    region: Bytes
    kind: Ints
    at_border: Mask

    def __len__(self) -> int:
        return len(self.inside_share)


def seen_region(grid: OccupancyGrid, least: float) -> Bytes:
    """uint8 (rows, cols), 1 inside the outer contours of the free space (holes count as inside).

    Args:
        grid: The grid.
        least: Contours around less than this, in square metres, do not count.
    """
    free = (grid.cells == FREE).view(np.uint8)
    contours, _ = cv2.findContours(free, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    large = [c for c in contours if cv2.contourArea(c) * grid.resolution**2 >= least]
    region = np.zeros(grid.shape, np.uint8)
    cv2.drawContours(region, large, -1, 1, cv2.FILLED)
    return region


def arrange_lines(grid: OccupancyGrid, model: WallModel, margin: float) -> Arrangement:
    """The arrangement of the representative lines in the box of the segments."""
    box = _box(grid, model.segments, margin)
    return arrange(clip_lines(model.aligned.directions[model.lines.direction], model.lines.offset, box))


def build_faces(grid: OccupancyGrid, model: WallModel, config: FaceConfig, timer: StageTimer) -> FaceModel:
    """Arrange the lines, weigh their edges, unite faces over dropped edges, and classify the faces."""
    with timer("faces"):
        arrangement = arrange_lines(grid, model, config.margin)
        covered, weight, is_open = open_edges(arrangement, model, config)
        group, _ = dissolve(arrangement, is_open)
    with timer("contour"):
        region = seen_region(grid, config.region_area)
    with timer("paint"):
        return face_model(grid, arrangement, covered, weight, group, region, config)


def open_edges(arrangement: Arrangement, model: WallModel, config: FaceConfig) -> tuple[Floats, Floats, Mask]:
    """Covered metres of each edge (e,), covered share of each line (m + 4,), and whether an edge is open."""
    covered, weight = line_weights(arrangement, model)
    share = covered / np.maximum(arrangement.edge_length, 1e-9)
    solid = (share >= config.edge_weight) & (arrangement.edge_length >= config.edge_length)
    return covered, weight, (weight < config.line_weight)[arrangement.line] & ~solid


def face_model(
    grid: OccupancyGrid,
    arrangement: Arrangement,
    covered: Floats,
    weight: Floats,
    group: Ints,
    region: Bytes,
    config: FaceConfig,
    painted: Ints32 | None = None,
) -> FaceModel:
    """Everything about faces, unions of cells of an arrangement; `region` is 1 inside the seen contour.

    `painted` is what `paint_faces` makes of the arrangement, where it is known already.
    """
    count = int(group.max()) + 1
    graph = face_graph(arrangement, covered, group, count)
    if painted is None:
        painted = paint_faces(arrangement, grid.shape, grid.resolution)
    found = _count_cells(painted, region, grid.cells, len(arrangement))
    cells, inside, known, free = (sums(group, number.astype(np.float64), count) for number in found)
    cells = np.maximum(cells, 1)
    external = inside / cells < config.inside_share
    at_border = _at_border(arrangement, group, count)
    return FaceModel(
        arrangement=arrangement,
        covered=covered,
        weight=weight,
        dropped=weight < config.line_weight,
        group=group,
        graph=graph,
        inside_share=inside / cells,
        known_share=known / cells,
        free_area=free * grid.resolution**2,
        painted=painted,
        region=region,
        kind=_kinds(graph, external, at_border, config.partial_weight),
        at_border=at_border,
    )


def find_rooms(faces: FaceModel, config: FaceConfig) -> Ints:
    """Room of each face int64 (n,), numbered from 0, -1 for none."""
    room = cluster_faces(faces.graph, faces.kind > 0, config.sigma, config.affinity)
    return merge_small(room, faces.graph, faces.free_area, config.room_area)


def with_lines(lines: WallGroups, direction: Ints, offset: Floats, most: int) -> WallGroups:
    """The lines and those of direction (n,) and offset (n,) not among them; no segment covers these.

    Together they are at most `most`.
    """
    known = set(zip(lines.direction.tolist(), lines.offset.tolist(), strict=True))
    new = sorted(set(zip(direction.tolist(), offset.tolist(), strict=True)) - known)
    new = new[: max(most - len(lines), 0)]
    zeros = np.zeros(len(new))
    return WallGroups(
        group=lines.group,
        direction=np.concatenate((lines.direction, np.array([d for d, _ in new], np.int64))),
        offset=np.concatenate((lines.offset, np.array([t for _, t in new], np.float64))),
        start=np.concatenate((lines.start, zeros)),
        end=np.concatenate((lines.end, zeros)),
        length=np.concatenate((lines.length, zeros)),
    )


def _box(grid: OccupancyGrid, segments: Floats, margin: float) -> Bounds:
    width, height = extent(grid)
    x, y = segments[:, ::2], segments[:, 1::2]
    return (
        max(float(x.min()) - margin, 0.0),
        max(float(y.min()) - margin, 0.0),
        min(float(x.max()) + margin, width),
        min(float(y.max()) + margin, height),
    )


def line_weights(arrangement: Arrangement, model: WallModel) -> tuple[Floats, Floats]:
    """Covered metres of each edge (e,) and covered share of each line (m + 4,)."""
    lines: LineSet = arrangement.lines
    count = len(model.lines)
    crosses = lines.start <= lines.end  # a line that misses the box starts and ends at infinity
    start, end = np.where(crosses, lines.start, 0.0), np.where(crosses, lines.end, 0.0)
    reach = 4 * (1 + np.abs(np.concatenate((start, end, model.aligned.start, model.aligned.end))).max())
    coverage = cover_lines(model.aligned, model.lines.group, float(reach))
    wall = arrangement.line < count
    covered = np.zeros(len(arrangement.line))
    covered[wall] = coverage.between(
        arrangement.line[wall], arrangement.span[wall, 0], arrangement.span[wall, 1]
    )
    weight = np.ones(count + 4)
    length = np.maximum(end[:count] - start[:count], 1e-9)
    weight[:count] = coverage.between(np.arange(count), start[:count], end[:count]) / length
    return np.minimum(covered, arrangement.edge_length), np.minimum(weight, 1.0)


def _kinds(graph: FaceGraph, external: Mask, at_border: Mask, partial_weight: float) -> Ints:
    """External 0, partial 1 (open towards an external face or the border of the box), internal 2."""
    kind = np.where(at_border, 1, 2)
    opens = graph.weight < partial_weight
    kind[graph.first[opens & external[graph.second]]] = 1
    kind[graph.second[opens & external[graph.first]]] = 1
    kind[external] = 0
    return kind


def _at_border(arrangement: Arrangement, group: Ints, count: int) -> Mask:
    sides = arrangement.sides[(arrangement.sides < 0).any(axis=1)].max(axis=1)
    touched = np.zeros(count, np.bool_)
    touched[group[sides[sides >= 0]]] = True
    return touched


@njit(cache=True, nogil=True)
def _count_cells(painted: Ints32, region: Bytes, cells: Cells, count: int) -> tuple[Ints, Ints, Ints, Ints]:
    """By cell of the arrangement, int64 (count,): grid cells, those of the region, known and free ones."""
    total, inside = np.zeros(count, np.int64), np.zeros(count, np.int64)
    known, free = np.zeros(count, np.int64), np.zeros(count, np.int64)
    for row in range(painted.shape[0]):
        first = ZERO
        # counted once a run of equal cells, not once a cell
        while first < painted.shape[1]:
            face = painted[row, first]
            last = run_end(painted[row], first, face)
            if face >= 0:
                seen, empty, within = 0, 0, 0
                for col in range(first, last):
                    within += region[row, col]
                    seen += cells[row, col] != UNKNOWN
                    empty += cells[row, col] == FREE
                total[face] += last - first
                inside[face] += within
                known[face] += seen
                free[face] += empty
            first = last
    return total, inside, known, free
