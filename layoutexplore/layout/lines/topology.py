"""Splitting rooms by the topology of the free space (ROSE2, section III-D).

ROSE2 asks whether the nodes of the free space's Voronoi graph that lie in one room are connected inside that
room. The Voronoi graph is a deformation retract of the free space, so they are exactly if the free space of
the room is connected; passages too narrow for the blurred skeleton are those that vanish when the free space
is eroded. So no skeleton is needed: the connected parts of the eroded free space, room by room, are the
components of the graph.

A room of several parts is cut by the representative line that separates them best, and where there is none by
a line of a dominant direction through the widest gap between the parts.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import cv2
import numpy as np
from numba import njit

from layoutexplore.errors import ConfigError
from layoutexplore.grids.arrays import Bytes, Floats, Ints, Ints32, Mask
from layoutexplore.grids.components import components, split_labels
from layoutexplore.grids.grid import FREE, OccupancyGrid
from layoutexplore.layout.limits import most_lines
from layoutexplore.layout.lines.face_clusters import merge_small, renumber
from layoutexplore.layout.lines.face_model import (
    FaceConfig,
    FaceModel,
    WallModel,
    arrange_lines,
    face_model,
    line_weights,
    with_lines,
)
from layoutexplore.layout.lines.faces import Arrangement

BINS = 256
"""Of equal width, that a room's cells fall into when their extent is measured."""


@dataclass(frozen=True, kw_only=True)
class TopologyConfig:
    """When and how a room is split.

    Attributes:
        split: Whether rooms are split at all.
        split_clearance: Passages narrower than twice this, in metres, do not connect.
        split_area: Parts with less eroded free space, in square metres, do not count.
        split_overlap: Parts that overlap by more than this, in metres, along every direction are not
            separated: one lies within the other, behind furniture.
        split_rounds: A room is cut at most so often in a row.
    """

    split: bool = True
    split_clearance: float = 0.2
    split_area: float = 1.0
    split_overlap: float = 0.5
    split_rounds: int = 4

    def __post_init__(self) -> None:
        if self.split_clearance < 0 or self.split_area < 0 or self.split_rounds < 0:
            raise ConfigError("split_clearance, split_area and split_rounds must not be negative")


@dataclass(frozen=True, kw_only=True)
class Cut:
    """A room and the line that cuts it, by the index of its direction and its offset."""

    room: int
    direction: int
    offset: float


def split_rooms(
    grid: OccupancyGrid,
    model: WallModel,
    faces: FaceModel,
    room: Ints,
    options: TopologyConfig,
    config: FaceConfig,
) -> tuple[WallModel, FaceModel, Ints]:
    """Split the rooms whose free space falls into parts.

    Args:
        grid: The grid.
        model: Its lines.
        faces: Their faces.
        room: int64 (n,), room of each face, -1 for none.
        options: When to split.
        config: How faces become rooms.

    Returns:
        The lines with those added that were needed, the faces cut by them, and the room of each face.
    """
    free = (grid.cells == FREE).astype(np.uint8)
    distance = cv2.distanceTransform(np.pad(free, 1), cv2.DIST_L2, cv2.DIST_MASK_5)[1:-1, 1:-1]
    is_open = np.asarray(distance * grid.resolution > options.split_clearance)
    for _ in range(options.split_rounds):
        cuts = _find_cuts(grid, model, faces, room, is_open, options)
        if not cuts:
            break
        model, faces, room = _apply(grid, model, faces, room, cuts, config)
    return model, faces, room


def _find_cuts(
    grid: OccupancyGrid,
    model: WallModel,
    faces: FaceModel,
    room: Ints,
    is_open: Mask,
    options: TopologyConfig,
) -> list[Cut]:
    labels = _label_open(is_open, faces.painted, np.append(room[faces.group], -1))
    part, size = split_labels(labels)
    owner = _owners(labels, part, len(size))
    owner[size * grid.resolution**2 < options.split_area] = -1
    parts_in_room = np.bincount(owner[owner >= 0], minlength=1)
    wanted = np.flatnonzero(parts_in_room >= 2)
    if not len(wanted):
        return []
    is_wanted = np.append(parts_in_room >= 2, False)[owner]
    at = np.flatnonzero(np.append(is_wanted, False)[part])
    part_of = part.reshape(-1)[at]
    by_room = np.argsort(owner[part_of], kind="stable")
    at, part_of = at[by_room], part_of[by_room]
    room_of = owner[part_of]
    points = np.stack((at % grid.shape[1] + 0.5, at // grid.shape[1] + 0.5), axis=1) * grid.resolution
    first = np.searchsorted(room_of, np.append(wanted, len(parts_in_room)))
    by_owner = np.argsort(owner, kind="stable")
    rank = np.empty(len(owner), np.int64)
    rank[by_owner] = np.arange(len(owner)) - np.searchsorted(owner[by_owner], owner[by_owner])
    rank = rank[part_of]
    cuts = [
        _best_cut(int(r), model, points[i:j], rank[i:j], int(parts_in_room[r]), options.split_overlap)
        for r, (i, j) in zip(wanted, pairwise(first.tolist()), strict=True)
    ]
    return [cut for cut in cuts if cut is not None]


@njit(cache=True, nogil=True)
def _label_open(is_open: Mask, painted: Ints32, room: Ints) -> Ints32:
    """The room of the face that holds each open cell, int32 (rows, cols); -1 elsewhere.

    `room` is int64 (f + 1,), -1 for none and at its end.
    """
    out = np.full(painted.shape, -1, np.int32)
    for r in range(painted.shape[0]):
        for c in range(painted.shape[1]):
            if is_open[r, c]:
                out[r, c] = room[painted[r, c]]  # outside of the box it is -1: the last one
    return out


@njit(cache=True, nogil=True)
def _owners(labels: Ints32, part: Ints32, count: int) -> Ints:
    """The label int64 (count,) of each part of equal labels."""
    out = np.full(count, -1, np.int64)
    for r in range(part.shape[0]):
        for c in range(part.shape[1]):
            if part[r, c] >= 0:
                out[part[r, c]] = labels[r, c]
    return out


def _best_cut(
    room: int, model: WallModel, points: Floats, rank: Ints, parts: int, overlap: float
) -> Cut | None:
    """The line that separates a room's parts: a representative one, else in the widest gap, if one does.

    `rank` (n,) is the part, from 0, that each of the points (n, 2) lies in.
    """
    fallback, widest = None, -overlap
    best, most = None, 0.0
    for direction, angle in enumerate(model.aligned.directions):
        offset = points[:, 1] * np.cos(angle) - points[:, 0] * np.sin(angle)
        low, high = quantile_extent(offset, rank, parts, 0.05)
        order = np.argsort(low + high, kind="stable")
        reach = np.maximum.accumulate(high[order])[:-1]
        begin = np.minimum.accumulate(low[order][::-1])[::-1][1:]
        gap = begin - reach
        k = int(gap.argmax())
        if gap[k] > widest:
            widest = float(gap[k])
            fallback = Cut(room=room, direction=direction, offset=float((begin[k] + reach[k]) / 2))
        mine = np.flatnonzero((model.lines.direction == direction) & (model.lines.length > most))
        # both rise: of the gaps that begin before a line the last one ends last
        last = np.searchsorted(reach, model.lines.offset[mine], side="right") - 1
        mine = mine[(last >= 0) & (model.lines.offset[mine] <= begin[last])]
        if len(mine):
            line = mine[model.lines.length[mine].argmax()]
            most = float(model.lines.length[line])
            best = Cut(room=room, direction=direction, offset=float(model.lines.offset[line]))
    return best or fallback


def quantile_extent(values: Floats, rank: Ints, count: int, share: float) -> tuple[Floats, Floats]:
    """The quantiles `share` and 1 - `share`, float64 (count,), of the values of each rank; no rank is empty.

    Example:
        >>> low, high = quantile_extent(np.arange(10.0), np.zeros(10, np.int64), 1, 0.2)
        >>> low.tolist(), high.tolist()
        ([1.0], [7.0])
    """
    return _extents(np.ascontiguousarray(values), rank, count, share)


@njit(cache=True, nogil=True)
def _extents(values: Floats, rank: Ints, count: int, share: float) -> tuple[Floats, Floats]:
    grouped, first = _grouped(values, rank, count)
    low, high = np.empty(count), np.empty(count)
    for k in range(count):
        group = grouped[first[k] : first[k + 1]]
        low[k] = _nth(group, int(share * (len(group) - 1)))
        high[k] = _nth(group, int((1 - share) * (len(group) - 1)))
    return low, high


@njit(cache=True, nogil=True)
def _nth(values: Floats, place: int) -> float:
    """The value at a place in rising order: only those in its bin are looked at again."""
    while True:
        least, width = values.min(), values.max() - values.min()
        if width == 0:
            return float(least)
        counts = np.zeros(BINS + 1, np.int64)
        for value in values:
            counts[int((value - least) / width * BINS)] += 1
        wanted = 0
        while counts[wanted] <= place:
            place -= counts[wanted]
            wanted += 1
        # the least and the largest value are never in one bin: fewer are left with every round
        inside = np.empty(counts[wanted])
        count = 0
        for value in values:
            if int((value - least) / width * BINS) == wanted:
                inside[count] = value
                count += 1
        values = inside


@njit(cache=True, nogil=True)
def _grouped(values: Floats, rank: Ints, count: int) -> tuple[Floats, Ints]:
    """The values (n,) group by group, and where each group begins, int64 (count + 1,)."""
    first = np.zeros(count + 1, np.int64)
    for k in range(len(rank)):
        first[rank[k] + 1] += 1
    for group in range(count):
        first[group + 1] += first[group]
    # `place` is where the next value of a group goes
    place, grouped = first[:-1].copy(), np.empty(len(values))
    for k in range(len(values)):
        grouped[place[rank[k]]] = values[k]
        place[rank[k]] += 1
    return grouped, first


def _apply(
    grid: OccupancyGrid, model: WallModel, faces: FaceModel, room: Ints, cuts: list[Cut], config: FaceConfig
) -> tuple[WallModel, FaceModel, Ints]:
    added = np.array([c.direction for c in cuts], np.int64), np.array([c.offset for c in cuts])
    model = replace(model, lines=with_lines(model.lines, *added, most_lines(grid.shape)))
    arrangement = arrange_lines(grid, model, config.margin)
    covered, weight = line_weights(arrangement, model)
    centre, parent = _centres(arrangement), _parents(arrangement, faces.arrangement)
    group = faces.group[parent]
    of_cell = room[group]
    count = int(room.max()) + 1
    for cut in cuts:
        angle = model.aligned.directions[cut.direction]
        offset = centre[:, 1] * np.cos(angle) - centre[:, 0] * np.sin(angle)
        of_cell[(of_cell == cut.room) & (offset > cut.offset)] = count
        count += 1
    group, of_cell = _connected(arrangement, group, of_cell)
    faces = face_model(grid, arrangement, covered, weight, group, faces.region, config)
    room = np.full(len(faces), -1, np.int64)
    room[group] = of_cell
    return model, faces, merge_small(renumber(room), faces.graph, faces.free_area, config.room_area)


def _centres(arrangement: Arrangement) -> Floats:
    """A point float64 (f, 2) inside each cell: the mean of its corners."""
    corners, offsets = arrangement.rings()
    return np.asarray(np.add.reduceat(corners, offsets[:-1]) / np.diff(offsets)[:, None])


def _parents(fine: Arrangement, coarse: Arrangement) -> Ints:
    """The coarse arrangement's cell that holds each of the fine one, by the sides of all coarse lines."""
    lines = coarse.lines
    normal = np.stack((-np.sin(lines.angle), np.cos(lines.angle)))
    held, wanted = (
        [code.tobytes() for code in _codes(_centres(a), normal, lines.offset)] for a in (coarse, fine)
    )
    cell_of = {code: cell for cell, code in enumerate(held)}
    return np.array([cell_of.get(code, 0) for code in wanted], np.int64)


def _codes(points: Floats, normal: Floats, offset: Floats) -> Bytes:
    """On which side of each line (2, n) points (m, 2) lie, as bits uint8 (m, n / 8); block by block."""
    blocks = [points[i : i + 4096] for i in range(0, len(points), 4096)]
    return np.concatenate([np.packbits(block @ normal > offset, axis=1) for block in blocks])


def _connected(arrangement: Arrangement, group: Ints, of_cell: Ints) -> tuple[Ints, Ints]:
    """Faces and rooms that are connected: groups split by room, rooms into their components; both (f,)."""
    left, right = arrangement.sides.T
    inner = (left >= 0) & (right >= 0)
    left, right = left[inner], right[inner]
    same_room = of_cell[left] == of_cell[right]
    part = components(left[same_room], right[same_room], len(arrangement))
    same_face = same_room & (group[left] == group[right])
    face = components(left[same_face], right[same_face], len(arrangement))
    return face, np.where(of_cell < 0, -1, part)
