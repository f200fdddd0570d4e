"""Representative lines as evidence of where rooms end, on a grid whose walls run along rows and columns.

The lines of both directions (`layoutexplore.layout.merging.axis_lines`) cut the map into faces, whose edges
are covered by wall or not, and faces with uncovered edges cluster to rooms as in ROSE2 (section III-C). Two
regions that lie on two sides of a line, or in two such rooms, are rarely one room, even where no wall was
seen between them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from layoutexplore.grids.arrays import Cells, Floats, Ints, Ints32, Mask
from layoutexplore.grids.components import join, number_sets
from layoutexplore.grids.grid import UNKNOWN
from layoutexplore.grids.runs import find_runs
from layoutexplore.layout.lines.face_clusters import FaceGraph, cluster_faces
from layoutexplore.layout.merging.axis_lines import AxisLineConfig, find_lines

BESIDE_LINE = 0.05
"""What a cell beside a line counts in the rooms of the lines: walls are thicker than lines and step aside."""


@dataclass(frozen=True, kw_only=True)
class EvidenceConfig(AxisLineConfig):
    """How lines, their faces and rooms are found.

    Attributes:
        line_weight: A line covered for a smaller share of its length does not part faces ...
        edge_weight: ... except where an edge is covered for this share.
        known_share: Faces of which less is known belong to no room.
        sigma: Scale of the covered share in the affinity of two faces.
        affinity: Least normalised affinity of faces of one room.
    """

    line_weight: float = 0.1
    edge_weight: float = 0.6
    known_share: float = 0.2
    sigma: float = 0.1
    affinity: float = 0.15


@dataclass(frozen=True, eq=False)
class LineEvidence:
    """Faces and rooms of the lines, looked up by row and column.

    Attributes:
        row_strip: int32 (rows,), strip between the lines along the rows that each row lies in.
        col_strip: int32 (cols,), the same for the columns.
        face: int32 (row strips, col strips), the face of each crossing of strips.
        room: int32 (row strips, col strips), its room, numbered from 1, 0 for none.
        above: float64 (row strips, col strips), covered share of the edge to the strip above.
        right: float64 (row strips, col strips), and to the strip on the right.
    """

    row_strip: Ints32
    col_strip: Ints32
    face: Ints32
    room: Ints32
    above: Floats
    right: Floats


@njit(cache=True, nogil=True)
def _edges(sums: Ints32, bounds: Ints, line_weight: float, edge_weight: float) -> tuple[Floats, Mask]:
    """Covered share (lines, strips) of the edges between bounds (strips + 1,); and whether they are open."""
    lines, strips = len(sums), len(bounds) - 1
    share, opened = np.empty((lines, strips)), np.empty((lines, strips), np.bool_)
    for k in range(lines):
        # a line that hardly any wall lies on parts faces nowhere but along a wall
        dropped = sums[k, -1] < line_weight * (sums.shape[1] - 1)
        for m in range(strips):
            share[k, m] = (sums[k, bounds[m + 1]] - sums[k, bounds[m]]) / max(bounds[m + 1] - bounds[m], 1)
            opened[k, m] = dropped and share[k, m] < edge_weight
    return share, opened


@njit(cache=True, nogil=True)
def _known(cells: Cells, row_bounds: Ints, col_bounds: Ints) -> Ints:
    """int64 (row strips, col strips): known cells of each crossing of strips."""
    out = np.zeros((len(row_bounds) - 1, len(col_bounds) - 1), np.int64)
    for n in range(len(row_bounds) - 1):
        for r in range(row_bounds[n], row_bounds[n + 1]):
            for m in range(len(col_bounds) - 1):
                stretch, known = cells[r, col_bounds[m] : col_bounds[m + 1]], 0
                for c in range(stretch.size):
                    known += stretch[c] != UNKNOWN
                out[n, m] += known
    return out


@njit(cache=True, nogil=True)
def _crossing_faces(above_open: Mask, right_open: Mask) -> Ints:
    """Face of each crossing (row strips, col strips), joined over the open edges (lines, strips)."""
    rows, cols = len(above_open) + 1, len(right_open) + 1
    parent = np.arange(rows * cols).astype(np.int32)
    for n in range(rows):
        for m in range(cols):
            if n + 1 < rows and above_open[n, m]:
                join(parent, n * cols + m, (n + 1) * cols + m)
            if m + 1 < cols and right_open[m, n]:
                join(parent, n * cols + m, n * cols + m + 1)
    return number_sets(parent).reshape(rows, cols)


@njit(cache=True, nogil=True)
def _face_sides(
    face: Ints, above: Floats, right: Floats, row_bounds: Ints, col_bounds: Ints
) -> tuple[Ints, Floats, Floats]:
    """The pairs of faces (p, 2) that touch, rising, the length of their common sides and its covered part."""
    rows, cols = face.shape
    count = face.max() + 1
    keys = np.empty(2 * face.size, np.int64)
    lengths, shares = np.empty(2 * face.size), np.empty(2 * face.size)
    k = 0
    # the sides to the strips above, then those to the right: sums of floats depend on the order
    for n in range(rows - 1):
        for m in range(cols):
            a, b = face[n, m], face[n + 1, m]
            if a != b:
                keys[k] = min(a, b) * count + max(a, b)
                lengths[k], shares[k] = col_bounds[m + 1] - col_bounds[m], above[n, m]
                k += 1
    for n in range(rows):
        for m in range(cols - 1):
            a, b = face[n, m], face[n, m + 1]
            if a != b:
                keys[k] = min(a, b) * count + max(a, b)
                lengths[k], shares[k] = row_bounds[n + 1] - row_bounds[n], right[m, n]
                k += 1
    pairs, length, covered = np.empty((k, 2), np.int64), np.zeros(k), np.zeros(k)
    p = -1
    for side in np.argsort(keys[:k], kind="mergesort"):
        a, b = keys[side] // count, keys[side] % count
        if p < 0 or pairs[p, 0] != a or pairs[p, 1] != b:
            p += 1
            pairs[p, 0], pairs[p, 1] = a, b
        length[p] += lengths[side]
        covered[p] += shares[side] * lengths[side]
    return pairs[: p + 1], length[: p + 1], covered[: p + 1]


@njit(cache=True, nogil=True)
def _seen_faces(face: Ints, known: Ints, row_bounds: Ints, col_bounds: Ints, least: float) -> Mask:
    """Faces of which at least this share is known."""
    total, seen = np.zeros(face.max() + 1), np.zeros(face.max() + 1)
    for n in range(face.shape[0]):
        for m in range(face.shape[1]):
            total[face[n, m]] += (row_bounds[n + 1] - row_bounds[n]) * (col_bounds[m + 1] - col_bounds[m])
            seen[face[n, m]] += known[n, m]
    return seen >= least * np.maximum(total, 1.0)


def find_evidence(
    cells: Cells, wall: Mask, resolution: float, config: EvidenceConfig | None = None
) -> LineEvidence:
    """Lines, faces and rooms of a grid whose walls run along rows and columns.

    Args:
        cells: int8 (rows, cols), trinary.
        wall: bool (rows, cols), the occupied cells that may be wall.
        resolution: Metres a cell.
        config: The options.
    """
    config = config or EvidenceConfig()
    row_lines, col_lines = find_lines(cells, wall, resolution, config)
    row_bounds = np.concatenate(([0], row_lines.offsets, [cells.shape[0]]))
    col_bounds = np.concatenate(([0], col_lines.offsets, [cells.shape[1]]))
    above, above_open = _edges(row_lines.sums, col_bounds, config.line_weight, config.edge_weight)
    right, right_open = _edges(col_lines.sums, row_bounds, config.line_weight, config.edge_weight)
    face = _crossing_faces(above_open, right_open)
    pairs, length, covered = _face_sides(face, above, right, row_bounds, col_bounds)
    graph = FaceGraph(first=pairs[:, 0], second=pairs[:, 1], length=length, covered=covered)
    known = _known(cells, row_bounds, col_bounds)
    inside = _seen_faces(face, known, row_bounds, col_bounds, config.known_share)
    room = cluster_faces(graph, inside, config.sigma, config.affinity) + 1
    return LineEvidence(
        row_strip=np.repeat(np.arange(len(row_bounds) - 1, dtype=np.int32), np.diff(row_bounds)),
        col_strip=np.repeat(np.arange(len(col_bounds) - 1, dtype=np.int32), np.diff(col_bounds)),
        face=face.astype(np.int32),
        room=room[face].astype(np.int32),
        above=np.concatenate((above, np.zeros((1, above.shape[1])))),
        right=np.concatenate((right, np.zeros((1, right.shape[1])))).T.copy(),
    )


@njit(cache=True, nogil=True)
def _count(
    labels: Ints32,
    free: Mask,
    row_strip: Ints32,
    col_strip: Ints32,
    room: Ints32,
    row_weight: Floats,
    col_weight: Floats,
    out: Floats,
) -> None:
    """Add to `out` what each region has in each room; of the weights of row and column the less counts."""
    runs = find_runs(labels, np.int32(0))
    for k in range(len(runs)):
        r, first, last = runs[k]
        mine, of_row, weight = out[labels[r, first]], room[row_strip[r]], row_weight[r]
        # what a region has in a room is kept along a strip: sums of floats depend on their order
        begin = first
        while begin < last:
            strip, end = col_strip[begin], begin + 1
            while end < last and col_strip[end] == strip:
                end += 1
            total, here, weights = mine[of_row[strip]], free[r, begin:end], col_weight[begin:end]
            for c in range(here.size):
                if here[c]:
                    total += min(weight, weights[c])
            mine[of_row[strip]] = total
            begin = end


def _weights(strip: Ints32, beside: int) -> Floats:
    """float64 (n,): 1, and `BESIDE_LINE` for rows or columns less than so many cells beside a line."""
    padded = np.concatenate((np.repeat(strip[:1], beside), strip, np.repeat(strip[-1:], beside)))
    return np.where(padded[: len(strip)] == padded[2 * beside :], 1.0, BESIDE_LINE)


def count_rooms(
    labels: Ints32, free: Mask, evidence: LineEvidence, count: int | None = None, *, beside: int = 0
) -> Floats:
    """float64 (k + 1, rooms + 1): known free cells of each region in each room of the lines, 0 for none.

    Args:
        labels: int32 (rows, cols), the regions, from 1.
        free: bool (rows, cols), known free cells.
        evidence: The rooms.
        count: Number of regions, where it is known.
        beside: On which side of a line cells lie that are no further from it is chance: they count
            `BESIDE_LINE`.
    """
    regions = int(labels.max(initial=0)) if count is None else count
    out = np.zeros((regions + 1, int(evidence.room.max(initial=0)) + 1))
    row_weight, col_weight = (_weights(strip, beside) for strip in (evidence.row_strip, evidence.col_strip))
    _count(labels, free, evidence.row_strip, evidence.col_strip, evidence.room, row_weight, col_weight, out)
    return out
