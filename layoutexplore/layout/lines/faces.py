"""The arrangement of lines: faces, their sides and neighbours, as a half-edge structure in numpy.

Lines are given by a direction (an angle) and an offset along its normal, and are clipped to a box whose four
sides are lines too. Half-edge 2 e runs along the line's direction, 2 e + 1 is its twin; the face of a
half-edge lies on its left.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numba import njit

from layoutexplore.grids.arrays import Floats, Ints
from layoutexplore.layout.lines.segments import AlignedSegments
from layoutexplore.layout.lines.walls import sums

Bounds = tuple[float, float, float, float]
"""x0, y0, x1, y1 in metres of the local frame."""

SNAP = 1e-5
"""Intersections closer than about this, in metres, are one vertex."""

_SAME_DIRECTION = 9
"""Decimals of an angle in radians: half-edges whose angles differ less have one direction."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LineSet:
    """Lines clipped to a box; the last four are the box's sides (bottom, right, top, left).

    Attributes:
        angle: float64 (n,), radians in [0, pi).
        offset: float64 (n,), along the normal (-sin, cos), in metres.
        start: float64 (n,), coordinate along the direction where the line enters the box.
        end: float64 (n,), where it leaves the box; not above `start` for a line that misses it.
        box: The box.
    """

    angle: Floats
    offset: Floats
    start: Floats
    end: Floats
    box: Bounds

    def __len__(self) -> int:
        return len(self.angle)

    def ends(self) -> tuple[Floats, Floats]:
        """Both ends float64 (n, 2) of every line; those of a line that misses the box are a point near it."""
        x0, y0, x1, y1 = self.box
        beside = 0.5 * ((x0 + x1) * np.cos(self.angle) + (y0 + y1) * np.sin(self.angle))
        missed = self.start >= self.end
        start, end = (np.where(missed, beside, at) for at in (self.start, self.end))
        return self.points(start), self.points(end)

    def points(self, coordinate: Floats, line: Ints | None = None) -> Floats:
        """Points float64 (m, 2) at coordinates (m,) along lines int64 (m,) (all lines in turn by default)."""
        angle, offset = (self.angle, self.offset) if line is None else (self.angle[line], self.offset[line])
        c, s = np.cos(angle), np.sin(angle)
        return np.stack((coordinate * c - offset * s, coordinate * s + offset * c), axis=1)


@dataclass(frozen=True, kw_only=True, eq=False)
class Arrangement:
    """Vertices, edges and faces of a set of lines; v vertices, e edges, f bounded faces.

    Attributes:
        vertices: float64 (v, 2), metres of the local frame.
        edges: int64 (e, 2), start and end vertex; the edge runs along its line's direction.
        line: int64 (e,), the line each edge lies on.
        span: float64 (e, 2), coordinates of its ends along the line.
        following: int64 (2 e,), the half-edge after each half-edge around its face.
        face: int64 (2 e,), the face on each half-edge's left, -1 outside the box.
        area: float64 (f,), square metres.
        lines: The lines.
    """

    vertices: Floats
    edges: Ints
    line: Ints
    span: Floats
    following: Ints
    face: Ints
    area: Floats
    lines: LineSet

    def __len__(self) -> int:
        return len(self.area)

    @property
    def sides(self) -> Ints:
        """int64 (e, 2): the faces to the left and to the right of each edge, -1 outside the box."""
        return self.face.reshape(-1, 2)

    @property
    def edge_length(self) -> Floats:
        """float64 (e,), in metres."""
        return self.span[:, 1] - self.span[:, 0]

    @cached_property
    def rings(self) -> tuple[Floats, Ints]:
        """Corners float64 (n, 2) of all bounded faces, counter-clockwise, and offsets int64 (f + 1,).

        Faces of an arrangement of lines are convex: sorting their half-edges by direction walks around them.
        Those of one direction follow each other along it: a corner can lie in the middle of a side.
        """
        inner = np.flatnonzero(self.face >= 0)
        angle = self.lines.angle[self.line[inner // 2]] + np.pi * (inner % 2)
        angle = np.mod(np.round(np.mod(angle, 2 * np.pi), _SAME_DIRECTION), round(2 * np.pi, _SAME_DIRECTION))
        corner = self.vertices[self.edges.reshape(-1)[inner]]
        along = corner[:, 0] * np.cos(angle) + corner[:, 1] * np.sin(angle)
        order = np.lexsort((along, angle, self.face[inner]))
        offsets = np.searchsorted(self.face[inner[order]], np.arange(len(self) + 1))
        return corner[order], offsets


def clip_lines(angle: Floats, offset: Floats, box: Bounds) -> LineSet:
    """Clip lines (n,) to a box and add its four sides.

    Of parallel lines that lie closer than 2 `SNAP` all become the first: with a third line they would share a
    vertex or not as the rounding falls.
    """
    x0, y0, x1, y1 = box
    angle = np.concatenate((angle, (0.0, np.pi / 2, 0.0, np.pi / 2)))
    offset = np.concatenate((_united(angle[:-4], offset), (y0, -x1, y1, -x0)))
    c, s = np.cos(angle), np.sin(angle)
    start, end = np.full(len(angle), -np.inf), np.full(len(angle), np.inf)
    for low, high, rate, across in ((x0, x1, c, -s), (y0, y1, s, c)):
        steep = np.abs(rate) > 1e-12
        for side in (low, high):
            beside = ~steep & (np.abs(offset * across - side) <= 2 * SNAP)
            offset[beside] = side / across[beside]
        foot = offset * across
        safe = np.where(steep, rate, 1.0)
        near, far = (low - foot) / safe, (high - foot) / safe
        start = np.where(steep, np.maximum(start, np.minimum(near, far)), start)
        end = np.where(steep, np.minimum(end, np.maximum(near, far)), end)
        missed = ~steep & ((foot < low) | (foot > high))
        end = np.where(missed, start, end)
    return LineSet(angle=angle, offset=offset, start=start, end=end, box=box)


def _united(angle: Floats, offset: Floats) -> Floats:
    """The offsets (n,), those of parallel lines that hardly differ made equal."""
    order = np.lexsort((offset, angle))
    near = (np.diff(angle[order]) == 0) & (np.diff(offset[order]) <= 2 * SNAP)
    first = np.arange(len(order))
    first[1:][near] = 0
    united = np.empty(len(order))
    united[order] = offset[order[np.maximum.accumulate(first)]]
    return united


def arrange(lines: LineSet) -> Arrangement:
    """Intersect all lines and find the faces between them."""
    vertices, edges, line, span = _edges(lines)
    angle = np.stack((lines.angle[line], lines.angle[line] + np.pi), axis=1).reshape(-1)
    origin = edges.reshape(-1)
    following = _next_half_edges(origin, angle)
    cycle = _cycles(following)
    a, b = vertices[origin], vertices[origin[np.arange(len(origin)) ^ 1]]
    area = sums(cycle, (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / 2)
    bounded = area > 0
    rank = np.where(bounded, np.cumsum(bounded) - 1, -1)
    return Arrangement(
        vertices=vertices,
        edges=edges,
        line=line,
        span=span,
        following=following,
        face=rank[cycle],
        area=area[bounded],
        lines=lines,
    )


def _edges(lines: LineSet) -> tuple[Floats, Ints, Ints, Floats]:
    """Vertices (v, 2), edges (e, 2), the edges' lines (e,) and coordinates along them (e, 2)."""
    n = len(lines)
    x0, y0, x1, y1 = lines.box
    c, s = np.cos(lines.angle), np.sin(lines.angle)
    first, second = np.triu_indices(n, 1)
    cross = c[first] * s[second] - s[first] * c[second]
    met = np.abs(cross) > 1e-6
    first, second, cross = first[met], second[met], cross[met]
    x = (c[first] * lines.offset[second] - c[second] * lines.offset[first]) / -cross
    y = (s[first] * lines.offset[second] - s[second] * lines.offset[first]) / -cross
    inside = (x >= x0 - SNAP) & (x <= x1 + SNAP) & (y >= y0 - SNAP) & (y <= y1 + SNAP)
    # Onto the box before they are compared: lines that meet just outside of it meet on its border.
    first, second, x, y = (
        first[inside],
        second[inside],
        np.clip(x[inside], x0, x1),
        np.clip(y[inside], y0, y1),
    )
    snap = max(SNAP, (x1 - x0) / 2**30, (y1 - y0) / 2**30)  # both coordinates go into one number
    snapped = np.rint((x - x0) / snap).astype(np.int64) << 32 | np.rint((y - y0) / snap).astype(np.int64) + 1
    _, keep, vertex = np.unique(snapped, return_index=True, return_inverse=True)
    vertex = vertex.reshape(-1)
    on_line = np.concatenate((first, second))
    on_vertex = np.concatenate((vertex, vertex))
    points = np.stack((x[keep], y[keep]), axis=1)
    along = points[on_vertex, 0] * c[on_line] + points[on_vertex, 1] * s[on_line]
    order = np.lexsort((along, on_line))
    on_line, on_vertex, along = on_line[order], on_vertex[order], along[order]
    step = np.flatnonzero((np.diff(on_line) == 0) & (np.diff(on_vertex) != 0))
    # Lines that coincide (a wall on the border of the box) share their edges: the first line keeps them.
    ends = np.sort(np.stack((on_vertex[step], on_vertex[step + 1]), axis=1), axis=1)
    _, first_edge = np.unique(ends[:, 0] * len(points) + ends[:, 1], return_index=True)
    step = step[np.sort(first_edge)]
    edges = np.stack((on_vertex[step], on_vertex[step + 1]), axis=1)
    return points, edges, on_line[step], np.stack((along[step], along[step + 1]), axis=1)


def _next_half_edges(origin: Ints, angle: Floats) -> Ints:
    """The half-edge after each one around the face on its left: at its end, clockwise next to its twin."""
    order = np.lexsort((angle, origin))
    place = np.empty(len(order), np.int64)
    place[order] = np.arange(len(order))
    sorted_origin = origin[order]
    first = np.searchsorted(sorted_origin, sorted_origin, side="left")
    last = np.searchsorted(sorted_origin, sorted_origin, side="right") - 1
    twin_place = place[np.arange(len(origin)) ^ 1]
    previous = np.where(twin_place == first[twin_place], last[twin_place], twin_place - 1)
    return np.asarray(order[previous])


@njit(cache=True, nogil=True)
def _cycles(following: Ints) -> Ints:
    """The cycle of each member (n,) of a permutation, numbered from 0 by first member."""
    cycle = np.full(len(following), -1, np.int64)
    count = 0
    for k in range(len(following)):
        if cycle[k] < 0:
            while cycle[k] < 0:
                cycle[k] = count
                k = following[k]
            count += 1
    return cycle


@dataclass(frozen=True, kw_only=True, eq=False)
class LineCoverage:
    """How much of each line segments cover: a piecewise linear cumulative length for all lines at once.

    Attributes:
        position: float64 (m,), line * stride + coordinate, rising.
        covered: float64 (m,), length covered up to there.
        stride: Metres between the coordinates of one line and the next.
    """

    position: Floats
    covered: Floats
    stride: float

    def between(self, line: Ints, start: Floats, end: Floats) -> Floats:
        """Covered metres float64 (n,) of the stretches start (n,) to end (n,) of lines (n,)."""
        if not len(self.position):
            return np.zeros(len(line))
        base = (line + 0.5) * self.stride
        return np.interp(base + end, self.position, self.covered) - np.interp(
            base + start, self.position, self.covered
        )


def cover_lines(segments: AlignedSegments, line: Ints, stride: float) -> LineCoverage:
    """The union of the segments' projections on the lines they were given, int64 (n,)."""
    base = (line + 0.5) * stride
    start, end = base + segments.start, base + segments.end
    order = np.argsort(start, kind="stable")
    start, reach = start[order], np.maximum.accumulate(end[order])
    opens = (
        np.flatnonzero(np.concatenate(([True], start[1:] > reach[:-1])))
        if len(start)
        else np.zeros(0, np.int64)
    )
    left, right = start[opens], reach[np.append(opens[1:], len(start)) - 1] if len(start) else start
    total = np.cumsum(right - left)
    position = np.stack((left, right), axis=1).reshape(-1)
    covered = np.stack((total - (right - left), total), axis=1).reshape(-1)
    return LineCoverage(position=position, covered=covered, stride=stride)
