"""Layout reconstruction as in "Extracting structure of buildings using layout reconstruction" (IAS-15).

Canny edges of the walls, probabilistic Hough segments, mean shift on their directions, spatial clusters of
parallel segments, one representative line a cluster, faces, and rooms by the affinity of faces. The defaults
are those with which the authors' published numbers were made, turned into metres at 0.1 m a cell, but for
three: their segments are 0.3 m long at least, the map is searched for them once (`twice`), and only
directions near the grid's axes are kept (`manhattan`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numba import njit

from layoutexplore.errors import ConfigError
from layoutexplore.grids.arrays import Cells, Floats, Ints, Ints32, Mask
from layoutexplore.grids.components import components
from layoutexplore.grids.grid import FREE, OCCUPIED, OccupancyGrid
from layoutexplore.layout.canonical import in_canonical_orientation
from layoutexplore.layout.frame import ranks, undirected
from layoutexplore.layout.limits import cells_at_most, left_out, most_lines
from layoutexplore.layout.lines.assemble import assemble, clean_grid
from layoutexplore.layout.lines.canny import canny_edges
from layoutexplore.layout.lines.face_model import (
    FaceConfig,
    FaceModel,
    WallModel,
    build_faces,
    find_rooms,
    with_lines,
)
from layoutexplore.layout.lines.segments import (
    SegmentConfig,
    angle_between,
    find_segments,
    project,
    segment_angles,
)
from layoutexplore.layout.lines.walls import chain_lines, find_walls, on_heaviest
from layoutexplore.layout.pipeline import register_method
from layoutexplore.layout.timing import StageTimer
from layoutexplore.layout.types import Layout, empty_layout, has_free_space
from layoutexplore.options import Rule, check

STILL = 1e-5
"""Radians: the mean shift ends where no mode moves farther."""

MOST_ANGLES = 1500
"""The mean shift looks at so many different angles at most; where there are more, they are rounded."""


@dataclass(frozen=True, kw_only=True)
class Ias15Config(SegmentConfig, FaceConfig):
    """Every option of the ias15 method; lengths in metres. See also the classes it extends.

    Attributes:
        canny: Thresholds of the Canny detector on the image of the walls, 0..255.
        bandwidth: h of the mean shift kernel (1 - (1 - cos d) / h)^2 over angles d.
        merge_angle: Directions closer than this, in radians, are one.
        manhattan: Keep only directions near the two axes of the grid, as in the authors' runs (the paper does
            not ask for it).
        manhattan_angle: How near, in radians.
        line_distance: Parallel segments closer than this belong to one spatial cluster.
        wall_gap: Segments of one direction closer than this belong to one wall.
        furniture_filter: Drop isolated groups of occupied cells first (for furnished maps).
        furniture_gap: Occupied cells closer than this belong to one group.
        furniture_size: Groups that fit into a box of this side are dropped.
        complete: Close rooms that no line bounds with a line parallel to the direction nearest to the open
            side.
    """

    votes: float = 2.0
    min_length: float = 0.5
    margin: float = 2.0
    line_weight: float = 0.0
    inside_share: float = 0.5
    partial_weight: float = 0.2
    room_area: float = 0.0
    canny: tuple[int, int] = (90, 100)
    bandwidth: float = 0.023
    merge_angle: float = 0.01
    manhattan: bool = False
    manhattan_angle: float = 0.15
    line_distance: float = 0.7
    wall_gap: float = 0.7
    furniture_filter: bool = False
    furniture_gap: float = 0.15
    furniture_size: float = 2.0
    complete: bool = True

    def __post_init__(self) -> None:
        SegmentConfig.__post_init__(self)
        FaceConfig.__post_init__(self)
        check(self, canny=Rule(kind=int, low=0, high=255, count=2), wall_gap=Rule(high=1e6))
        if self.bandwidth <= 0 or self.merge_angle < 0 or self.line_distance < 0 or self.wall_gap < 0:
            raise ConfigError(
                "bandwidth must be above 0; merge_angle, line_distance and wall_gap must not be negative"
            )


@in_canonical_orientation
def ias15(grid: OccupancyGrid, config: Ias15Config) -> Layout:
    """Run the IAS-15 reconstruction on a grid."""
    timer = StageTimer()
    if not has_free_space(grid):
        return empty_layout("ias15", grid, "no free space: nothing has been seen")
    with timer("segments"):
        walls = grid.cells == OCCUPIED
        if config.furniture_filter:
            walls = without_islands(walls, grid.resolution, config.furniture_gap, config.furniture_size)
        segments = find_segments(canny_edges(walls, *config.canny), grid.resolution, config)
    model = _wall_model(grid, walls, segments, config, timer)
    if model is None:
        return empty_layout("ias15", grid, "no walls: no wall segment was found", timings=timer.seconds)
    doubts = left_out(grid.shape, len(segments), len(model.lines))
    faces = build_faces(grid, model, config, timer)
    with timer("clusters"):
        room = find_rooms(faces, config)
    if config.complete and (extra := _closing_lines(grid, model, faces, room)):
        direction, offset = map(np.array, zip(*extra, strict=True))
        model = replace(model, lines=with_lines(model.lines, direction, offset, most_lines(grid.shape)))
        faces = build_faces(grid, model, config, timer)
        with timer("clusters"):
            room = find_rooms(faces, config)
    return assemble("ias15", grid, model, faces, room, timer, doubts)


def _wall_model(
    grid: OccupancyGrid, walls: Mask, segments: Floats, config: Ias15Config, timer: StageTimer
) -> WallModel | None:
    with timer("walls"):
        directions, member = mean_shift_directions(
            segment_angles(segments), config.bandwidth, config.merge_angle
        )
        directions, kept, member = _select(segments, directions, member, grid.resolution, config)
        if not len(kept):
            return None
        aligned = project(segments[kept], directions, member)
        lines = chain_lines(aligned, config.line_distance)
        heavy = on_heaviest(lines, most_lines(grid.shape))
        if heavy is not None:
            kept, member = kept[heavy], member[heavy]
            aligned = project(segments[kept], directions, member)
            lines = chain_lines(aligned, config.line_distance)
        return WallModel(
            clean_grid=clean_grid(grid, walls),
            segments=segments[kept],
            aligned=aligned,
            walls=find_walls(aligned, config.wall_gap),
            lines=lines,
        )


def mean_shift_directions(angles: Floats, bandwidth: float, merge_angle: float) -> tuple[Floats, Ints]:
    """Modes of undirected angles by mean shift with the kernel (1 - u)^2, u = (1 - cos d) / bandwidth.

    Args:
        angles: float64 (n,), radians in [0, pi).
        bandwidth: h.
        merge_angle: Modes closer than this, in radians, become one.

    Returns:
        The modes float64 (k,), rising, and the mode of each angle int64 (n,).
    """
    if not len(angles):
        return np.zeros(0), np.zeros(0, np.int64)
    values, inverse, counts = np.unique(np.round(angles, 4), return_inverse=True, return_counts=True)
    if len(values) > MOST_ANGLES:  # all pairs are compared
        step = np.pi / MOST_ANGLES
        values, inverse, counts = np.unique(
            np.floor(angles / step) * step, return_inverse=True, return_counts=True
        )
    modes = values.copy()
    for _ in range(200):
        difference = np.mod(values[None, :] - modes[:, None] + np.pi / 2, np.pi) - np.pi / 2
        weight = counts * np.maximum(1 - (1 - np.cos(difference)) / bandwidth, 0.0) ** 2
        move = (weight * difference).sum(axis=1) / weight.sum(axis=1)
        modes = np.mod(modes + move, np.pi)
        if np.abs(move).max() <= STILL:
            break
    near = np.argwhere(np.triu(angle_between(modes[:, None], modes[None, :]) < merge_angle, 1))
    group = components(near[:, 0], near[:, 1], len(modes))
    doubled = counts * np.exp(2j * modes)
    total = np.bincount(group, doubled.real) + 1j * np.bincount(group, doubled.imag)
    centres = undirected(np.angle(total) / 2)
    return np.sort(centres), ranks(centres)[group][inverse.reshape(-1)]


def _select(
    segments: Floats, directions: Floats, member: Ints, resolution: float, config: Ias15Config
) -> tuple[Floats, Ints, Ints]:
    """Drop directions of a few tiny segments and, on demand, all that are not near the axes.

    Returns:
        The directions, the rows of the segments that have one, and the direction of each of these.
    """
    length = np.hypot(segments[:, 2] - segments[:, 0], segments[:, 3] - segments[:, 1])
    longest = np.zeros(len(directions))
    np.maximum.at(longest, member, length)
    good = (np.bincount(member, minlength=len(directions)) > 3) | (longest > 3 * resolution)
    if config.manhattan:
        axes = np.minimum(
            angle_between(directions, np.array(0.0)), angle_between(directions, np.array(np.pi / 2))
        )
        good &= axes <= config.manhattan_angle
    rank = np.cumsum(good) - 1
    kept = np.flatnonzero(good[member])
    return directions[good], kept, rank[member[kept]]


def without_islands(walls: Mask, resolution: float, gap: float, size: float) -> Mask:
    """The occupied cells without isolated groups that fit into a box of `size` metres.

    Args:
        walls: bool (rows, cols).
        resolution: Metres a cell.
        gap: Cells closer than this, in metres, belong to one group.
        size: In metres.
    """
    reach = cells_at_most(gap, resolution, max(walls.shape))
    grown = cv2.dilate(walls.astype(np.uint8), np.ones((reach, reach), np.uint8))
    count, part = cv2.connectedComponents(grown, connectivity=8, ltype=cv2.CV_32S)
    part[~walls] = 0
    rows, cols = np.nonzero(part)
    group = np.asarray(part[rows, cols], np.int64)
    span = np.zeros(count, np.int64)
    for at in (rows, cols):
        low, high = np.full(count, part.size, np.int64), np.zeros(count, np.int64)
        np.minimum.at(low, group, at)
        np.maximum.at(high, group, at)
        span = np.maximum(span, high - low + 1)
    return np.asarray(walls & (span * resolution > size)[part])


def _closing_lines(
    grid: OccupancyGrid, model: WallModel, faces: FaceModel, room: Ints
) -> list[tuple[int, float]]:
    """Lines (direction, offset) that close the rooms which only the box bounds.

    For each such room and each side of the box it touches: the direction nearest to the side's, as far out as
    the room's free cells reach.
    """
    arrangement = faces.arrangement
    at_side = arrangement.sides.max(axis=1)
    border, directions = len(model.lines), model.aligned.directions
    angles = arrangement.lines.angle[border : border + 4]
    nearest = angle_between(directions[:, None], angles[None, :]).argmin(axis=0)
    of_cell = np.append(room[faces.group], -1)
    ends = [_ends(faces.painted, grid.cells, of_cell, *_unit(directions[d])) for d in nearest[:2]]
    found = set()
    for side, outward in enumerate((-1.0, 1.0, 1.0, -1.0)):
        direction = int(nearest[side])
        theta = directions[direction]
        if not angle_between(np.array(theta), np.array(angles[side])) < np.pi / 4:
            continue
        towards = outward * np.sign(np.cos(theta)) if side % 2 == 0 else -outward * np.sign(np.sin(theta))
        touching = at_side[(arrangement.line == border + side) & (arrangement.edge_length > 1e-6)]
        for owner in np.unique(room[faces.group[touching]]):
            low, high = ends[side % 2]
            if owner >= 0 and low[owner] <= high[owner]:
                end = high[owner] if towards > 0 else low[owner]
                found.add((direction, float(end * grid.resolution)))
    return sorted(found)


def _unit(angle: float) -> tuple[float, float]:
    return float(np.cos(angle)), float(np.sin(angle))


@njit(cache=True, nogil=True)
def _ends(painted: Ints32, cells: Cells, of_cell: Ints, c: float, s: float) -> tuple[Floats, Floats]:
    """By room (k,) the least and the largest offset in cells, along the normal (-s, c), of its free cells.

    Where it has none, the least one is larger.
    """
    count = of_cell.max() + 1
    low, high = np.full(count, np.inf), np.full(count, -np.inf)
    for row in range(painted.shape[0]):
        for col in range(painted.shape[1]):
            room = of_cell[painted[row, col]]  # the last one, of -1, is none
            if room >= 0 and cells[row, col] == FREE:
                offset = (row + 0.5) * c - (col + 0.5) * s
                low[room], high[room] = min(low[room], offset), max(high[room], offset)
    return low, high


register_method("ias15", "IAS-15: rooms from the lines of the walls", ias15, Ias15Config)
