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
from numpy.typing import NDArray

from layoutexplore.errors import ConfigError
from layoutexplore.grids.arrays import Floats, Ints, Ints32, Mask
from layoutexplore.grids.components import components, join_runs
from layoutexplore.grids.grid import FREE, OccupancyGrid
from layoutexplore.grids.runs import find_runs
from layoutexplore.layout.limits import cells_at_most, most_lines
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
from layoutexplore.layout.lines.faces import Arrangement, LineSet
from layoutexplore.options import check_fields

BINS = 256
"""Of equal width, that a room's cells fall into when their extent is measured."""

LEAST_WIDTH = 1e-9
"""Values less than this apart, in metres, fall into one of these bins."""


LARGEST_DISC = 5
"""Larger discs are not drawn: distances are measured instead, whose time does not grow with the radius."""


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
        check_fields(self)
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
    is_open = _open_cells(grid, options.split_clearance)
    changed = np.ones(int(room.max(initial=-1)) + 1, np.bool_)
    for _ in range(options.split_rounds):
        # in a room that stays as it is no cut is found again: a line that was added has no wall
        looked_at = np.where(np.append(changed, False)[room], room, -1)
        cuts = _find_cuts(grid, model, faces, looked_at, is_open, options)
        if not cuts:
            break
        model, faces, room, changed = _apply(grid, model, faces, room, cuts, config)
    return model, faces, room


def _open_cells(grid: OccupancyGrid, clearance: float) -> Mask:
    """Free cells farther than this, in metres, from all that are not, bool (rows, cols)."""
    free = (grid.cells == FREE).astype(np.uint8)
    reach = cells_at_most(clearance, grid.resolution, max(grid.shape))
    if reach <= LARGEST_DISC:
        # what is too near to one cell is the same around all of them
        alone = np.ones((2 * reach + 1, 2 * reach + 1), np.uint8)
        alone[reach, reach] = 0
        distance = cv2.distanceTransform(alone, cv2.DIST_L2, cv2.DIST_MASK_5)
        disc = (distance * grid.resolution <= clearance).astype(np.uint8)
        return cv2.erode(free, disc, borderType=cv2.BORDER_CONSTANT, borderValue=0).view(np.bool_)
    distance = cv2.distanceTransform(np.pad(free, 1), cv2.DIST_L2, cv2.DIST_MASK_5)[1:-1, 1:-1]
    return np.asarray(distance * grid.resolution > clearance)


def _find_cuts(
    grid: OccupancyGrid,
    model: WallModel,
    faces: FaceModel,
    room: Ints,
    is_open: Mask,
    options: TopologyConfig,
) -> list[Cut]:
    runs, part, owner = _open_runs(is_open, faces.painted, np.append(room[faces.group], -1))
    length = runs[:, 2] - runs[:, 1]
    size = np.bincount(part, length, len(owner))
    owner[size * grid.resolution**2 < options.split_area] = -1
    parts_in_room = np.bincount(owner[owner >= 0], minlength=1)
    wanted = np.flatnonzero(parts_in_room >= 2)
    if not len(wanted):
        return []
    # the runs of these rooms, room by room, and from them their cells
    chosen = np.flatnonzero(np.append(parts_in_room >= 2, False)[owner[part]])
    chosen = chosen[np.argsort(owner[part[chosen]], kind="stable")]
    length = length[chosen]
    behind = np.cumsum(length)
    column = np.arange(behind[-1]) - np.repeat(behind - length - runs[chosen, 1], length)
    part_of, row = np.repeat(part[chosen], length), np.repeat(runs[chosen, 0], length)
    points = np.stack((column + 0.5, row + 0.5), axis=1) * grid.resolution
    first = np.searchsorted(owner[part_of], np.append(wanted, len(parts_in_room)))
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
def _open_runs(is_open: Mask, painted: Ints32, room: Ints) -> tuple[Ints32, Ints, Ints]:
    """The connected parts of the open cells of each room.

    `room` is that of each cell of the arrangement, as for `_label_open`.

    Returns:
        Runs int32 (n, 3) as `find_runs` finds them, the part int64 (n,) of each, and the room int64 (k,) of
        each part.
    """
    labels = _label_open(is_open, painted, room)
    runs = find_runs(labels, np.int32(-1))
    part = join_runs(runs, labels, 0)
    owner = np.empty(part.max() + 1 if len(part) else 0, np.int64)
    for k in range(len(runs)):
        owner[part[k]] = labels[runs[k, 0], runs[k, 1]]
    return runs, part, owner


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
    least, most = np.full(count, np.inf), np.full(count, -np.inf)
    for n in range(len(values)):
        k = rank[n]
        least[k], most[k] = min(least[k], values[n]), max(most[k], values[n])
    # values of one bin lie side by side in rising order: only those in the two bins wanted are sorted
    scale = BINS / np.maximum(most - least, LEAST_WIDTH)
    table = np.zeros((count, BINS + 1), np.int32)
    bins = np.empty(len(values), np.int16)
    for n in range(len(values)):
        bins[n] = min(int((values[n] - least[rank[n]]) * scale[rank[n]]), BINS)
        table[rank[n], bins[n]] += 1
    low, high = np.empty((count, 2), np.int64), np.empty((count, 2), np.int64)
    for k in range(count):
        places = table[k].sum() - 1
        low[k] = _bin_of(table[k], int(share * places))
        high[k] = _bin_of(table[k], int((1 - share) * places))
    return _picked(values, rank, bins, table, low), _picked(values, rank, bins, table, high)


@njit(cache=True, nogil=True)
def _bin_of(counts: Ints32, place: int) -> tuple[int, int]:
    """The bin that holds a place in rising order, and the place within it."""
    wanted = 0
    while counts[wanted] <= place:
        place -= counts[wanted]
        wanted += 1
    return wanted, place


@njit(cache=True, nogil=True)
def _picked(values: Floats, rank: Ints, bins: NDArray[np.int16], table: Ints32, wanted: Ints) -> Floats:
    """Of each rank the value at the place within the bin that is wanted, int64 (count, 2) as both."""
    count = len(wanted)
    first = np.zeros(count + 1, np.int64)
    for k in range(count):
        first[k + 1] = first[k] + table[k, wanted[k, 0]]
    # `at` is where the next value of a rank goes
    inside, at = np.empty(first[count]), first[:-1].copy()
    for n in range(len(values)):
        k = rank[n]
        if bins[n] == wanted[k, 0]:
            inside[at[k]] = values[n]
            at[k] += 1
    out = np.empty(count)
    for k in range(count):
        out[k] = np.sort(inside[first[k] : first[k + 1]])[wanted[k, 1]]
    return out


def _apply(
    grid: OccupancyGrid, model: WallModel, faces: FaceModel, room: Ints, cuts: list[Cut], config: FaceConfig
) -> tuple[WallModel, FaceModel, Ints, Mask]:
    """Lines, faces and rooms after the cuts; and of each room whether it has changed."""
    added = np.array([c.direction for c in cuts], np.int64), np.array([c.offset for c in cuts])
    model = replace(model, lines=with_lines(model.lines, *added, most_lines(grid.shape)))
    arrangement = arrange_lines(grid, model, config.margin)
    covered, weight = line_weights(arrangement, model)
    centre, parent = _centres(arrangement), _parents(arrangement, faces.arrangement)
    group = faces.group[parent]
    before = room[group]
    of_cell = before.copy()
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
    room = merge_small(renumber(room), faces.graph, faces.free_area, config.room_area)
    return model, faces, room, _changed(before, room[group])


def _changed(before: Ints, after: Ints) -> Mask:
    """Of each group of `after` (n,) whether its members are not those of a group of `before`; -1 is none."""
    count = int(after.max(initial=-1)) + 1
    inside = after >= 0
    old = np.full(count, -1, np.int64)
    old[after[inside]] = before[inside]
    same = np.bincount(after[inside & (before == old[after])], minlength=count)
    size = np.bincount(before[before >= 0], minlength=1)
    return np.asarray((old < 0) | (same != np.bincount(after[inside], minlength=count)) | (same != size[old]))


def _centres(arrangement: Arrangement) -> Floats:
    """A point float64 (f, 2) inside each cell: the mean of its corners."""
    corners, offsets = arrangement.rings
    return np.asarray(np.add.reduceat(corners, offsets[:-1]) / np.diff(offsets)[:, None])


def _parents(fine: Arrangement, coarse: Arrangement) -> Ints:
    """The coarse arrangement's cell that holds each of the fine one, by the sides of all coarse lines."""
    code = _strips(coarse.lines, np.concatenate((_centres(coarse), _centres(fine))))
    cell_of = np.zeros(int(code.max()) + 1, np.int64)
    cell_of[code[: len(coarse)]] = np.arange(len(coarse))
    return cell_of[code[len(coarse) :]]


def _strips(lines: LineSet, points: Floats) -> Ints:
    """A number int64 (m,) from 0 for the cell that holds each of the points (m, 2), the same in one cell.

    It comes from the strips that a point lies in, one of each set of parallel lines.
    """
    code, numbers = np.zeros(len(points), np.int64), 1
    for angle in np.unique(lines.angle):
        offset = np.sort(lines.offset[lines.angle == angle])
        if numbers > 2**62 // (len(offset) + 1):
            code = _from_zero(code)
            numbers = len(points)
        strip = np.searchsorted(offset, points @ np.array((-np.sin(angle), np.cos(angle))))
        code = code * (len(offset) + 1) + strip
        numbers *= len(offset) + 1
    return _from_zero(code)


def _from_zero(code: Ints) -> Ints:
    return np.unique(code, return_inverse=True)[1].reshape(-1)


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
