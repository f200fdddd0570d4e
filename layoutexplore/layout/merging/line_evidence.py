"""Representative lines as evidence of where rooms end, on a grid whose walls run along rows and columns.

ROSE keeps what agrees with the long walls of a map: inside a ridge of its spectrum, an occupied cell scores
what lies in line with it along the ridge's wall direction. Where walls run along rows and columns, that is a
running sum over the rows or the columns. Cells that score enough are walls; walls in line make a
representative line through the whole map; the lines of both directions cut the map into faces, whose edges
are covered by wall or not, and faces with uncovered edges cluster to rooms as in ROSE2 (section III-C). Two
regions that lie on two sides of a line, or in two such rooms, are rarely one room, even where no wall was seen
between them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.grids.bitsets import count_bits, set_bits, true_cells
from layoutexplore.grids.components import join, number_sets
from layoutexplore.grids.grid import UNKNOWN
from layoutexplore.layout.alignment import surfaces
from layoutexplore.layout.lines.face_clusters import FaceGraph, cluster_faces

BESIDE_LINE = 0.05
"""What a cell beside a line counts in the rooms of the lines: walls are thicker than lines and step aside."""


@dataclass(frozen=True, kw_only=True)
class EvidenceConfig:
    """How lines are found; lengths in metres.

    Attributes:
        wall_length: What lies in line with a cell within half of this on either side supports it (ROSE).
        level: Least score of a wall, as a share of the best (ROSE2), on a map whose surfaces are nearly all
            in line ...
        level_max: ... and on one of much clutter, as ROSE2 raises it with the density of segments.
        in_line: Shares of the surfaces that are walls at the lowest level, of a map of much clutter and of
            one of little.
        support: And the least wall in line with a wall's cell.
        run: And around a wall's cell, over so long ...
        run_share: ... this share is wall.
        slack: A wall may step aside by this much.
        line_distance: Two lines are at least so far apart.
        line_length: Least wall on a line.
        line_weight: A line covered for a smaller share of its length does not part faces ...
        edge_weight: ... except where an edge is covered for this share.
        known_share: Faces of which less is known belong to no room.
        sigma: Scale of the covered share in the affinity of two faces.
        affinity: Least normalised affinity of faces of one room.
    """

    wall_length: float = 8.0
    level: float = 0.18
    level_max: float = 0.4
    in_line: tuple[float, float] = (0.6, 0.8)
    support: float = 1.25
    run: float = 0.8
    run_share: float = 0.75
    slack: float = 0.1
    line_distance: float = 1.0
    line_length: float = 1.0
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

    row_strip: NDArray[np.int32]
    col_strip: NDArray[np.int32]
    face: NDArray[np.int32]
    room: NDArray[np.int32]
    above: NDArray[np.float64]
    right: NDArray[np.float64]


@njit(cache=True, nogil=True)
def _scores(
    rows: NDArray[np.int64],
    cols: NDArray[np.int64],
    thick: NDArray[np.uint64],
    length: int,
    half: int,
    near: int,
    near_least: float,
) -> NDArray[np.int64]:
    """The wall in line with each of the occupied cells, 0 next to too little; `thick` are rows of `length` cells, as bits."""
    score = np.zeros(len(rows), np.int64)
    for n in range(len(rows)):
        r, c = rows[n], cols[n]
        if count_bits(thick, r, length, c - near, c + near + 1) >= near_least:
            score[n] = count_bits(thick, r, length, c - half, c + half + 1)
    return score


def _walls(
    scores: Sequence[NDArray[np.int64]], count: int, resolution: float, config: EvidenceConfig
) -> list[NDArray[np.bool_]]:
    """Which cells are walls along the rows and which along the columns, by both scores; a map has `count` cells of surface."""
    least, best = config.support / resolution, [int(score.max(initial=0)) for score in scores]

    def above(level: float) -> list[NDArray[np.bool_]]:
        return [score >= max(level * top, least) for score, top in zip(scores, best, strict=True)]

    share = np.count_nonzero(np.logical_or(*above(config.level))) / max(count, 1)
    return above(float(np.interp(share, config.in_line, (config.level_max, config.level))))


@njit(cache=True, nogil=True)
def _offsets(profile: NDArray[np.float64], slack: int, reach: int, least: float) -> NDArray[np.int64]:
    """Rows of the lines: the row with most wall within `slack` first, none within `reach` of another."""
    n = len(profile)
    left = profile.copy()
    out = np.empty(n, np.int64)
    count = 0
    while True:
        best, best_sum = -1, least
        for r in range(n):
            if left[r] <= 0:
                continue
            total = 0.0
            for k in range(max(r - slack, 0), min(r + slack + 1, n)):
                total += left[k]
            if total > best_sum or (total == best_sum and best >= 0 and left[r] > left[best]):
                best, best_sum = r, total
        if best < 0:
            break
        out[count] = best
        count += 1
        for k in range(max(best - reach, 0), min(best + reach + 1, n)):
            left[k] = 0.0
    return np.sort(out[:count])


@njit(cache=True, nogil=True)
def _coverage(
    rows: NDArray[np.int64],
    cols: NDArray[np.int64],
    length: int,
    offsets: NDArray[np.int64],
    reach: int,
    joint: int,
) -> NDArray[np.int32]:
    """int32 (lines, length + 1): covered cells of each line before each column; gaps up to 2 `joint` are covered too."""
    covered = np.zeros((len(offsets), length), np.bool_)
    for n in range(len(rows)):
        r, c = rows[n], cols[n]
        k = np.searchsorted(offsets, r)
        best = -1
        for j in range(max(k - 1, 0), min(k + 1, len(offsets))):
            if abs(offsets[j] - r) <= reach and (best < 0 or abs(offsets[j] - r) < abs(offsets[best] - r)):
                best = j
        if best >= 0:
            for d in range(max(c - joint, 0), min(c + joint + 1, length)):
                covered[best, d] = True
    sums = np.zeros((len(offsets), length + 1), np.int32)
    for k in range(len(offsets)):
        for c in range(length):
            sums[k, c + 1] = sums[k, c] + covered[k, c]
    return sums


def _lines(
    rows: NDArray[np.int64],
    cols: NDArray[np.int64],
    shape: tuple[int, int],
    resolution: float,
    config: EvidenceConfig,
) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """Rows of the lines along the rows, and their covered cells before each column.

    Args:
        rows: int64 (n,), of the cells of walls along the rows.
        cols: int64 (n,), of the same cells.
        shape: Rows and columns of the grid.
        resolution: Metres a cell.
        config: The options.
    """
    profile = np.bincount(rows, minlength=shape[0]).astype(np.float64)
    reach = max(round(config.line_distance / resolution / 2), 1)
    offsets = _offsets(
        profile, max(round(config.slack / resolution), 1), reach, config.line_length / resolution
    )
    return offsets, _coverage(
        rows, cols, shape[1], offsets, reach, max(round(config.slack / resolution / 2), 1)
    )


@njit(cache=True, nogil=True)
def _edges(
    sums: NDArray[np.int32], bounds: NDArray[np.int64], line_weight: float, edge_weight: float
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Covered share (lines, strips) of the edges between bounds (strips + 1,), and whether they part no faces."""
    lines, strips = len(sums), len(bounds) - 1
    share, opened = np.empty((lines, strips)), np.empty((lines, strips), np.bool_)
    for k in range(lines):
        dropped = sums[k, -1] < line_weight * (sums.shape[1] - 1)
        for m in range(strips):
            share[k, m] = (sums[k, bounds[m + 1]] - sums[k, bounds[m]]) / max(bounds[m + 1] - bounds[m], 1)
            opened[k, m] = dropped and share[k, m] < edge_weight
    return share, opened


@njit(cache=True, nogil=True)
def _known(
    cells: NDArray[np.int8], row_bounds: NDArray[np.int64], col_bounds: NDArray[np.int64]
) -> NDArray[np.int64]:
    """int64 (row strips, col strips): known cells of each crossing of strips."""
    out = np.zeros((len(row_bounds) - 1, len(col_bounds) - 1), np.int64)
    for n in range(len(row_bounds) - 1):
        for r in range(row_bounds[n], row_bounds[n + 1]):
            for m in range(len(col_bounds) - 1):
                known = 0
                for c in range(col_bounds[m], col_bounds[m + 1]):
                    known += cells[r, c] != UNKNOWN
                out[n, m] += known
    return out


@njit(cache=True, nogil=True)
def _crossing_faces(above_open: NDArray[np.bool_], right_open: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Face of each crossing of strips (row strips, col strips), joined over the open edges; the latter are (lines, strips)."""
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
    face: NDArray[np.int64],
    above: NDArray[np.float64],
    right: NDArray[np.float64],
    row_bounds: NDArray[np.int64],
    col_bounds: NDArray[np.int64],
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    """The pairs of faces (p, 2) that touch, in rising order, with the length of their common sides and the covered part of it."""
    rows, cols = face.shape
    count = face.max() + 1
    keys, lengths, shares = (
        np.empty(2 * face.size, np.int64),
        np.empty(2 * face.size),
        np.empty(2 * face.size),
    )
    k = 0
    for n in range(rows - 1):
        for m in range(cols):
            a, b = face[n, m], face[n + 1, m]
            if a != b:
                keys[k], lengths[k], shares[k] = (
                    min(a, b) * count + max(a, b),
                    col_bounds[m + 1] - col_bounds[m],
                    above[n, m],
                )
                k += 1
    for n in range(rows):
        for m in range(cols - 1):
            a, b = face[n, m], face[n, m + 1]
            if a != b:
                keys[k], lengths[k], shares[k] = (
                    min(a, b) * count + max(a, b),
                    row_bounds[n + 1] - row_bounds[n],
                    right[m, n],
                )
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
def _seen_faces(
    face: NDArray[np.int64],
    known: NDArray[np.int64],
    row_bounds: NDArray[np.int64],
    col_bounds: NDArray[np.int64],
    least: float,
) -> NDArray[np.bool_]:
    """Faces of which at least this share is known."""
    total, seen = np.zeros(face.max() + 1), np.zeros(face.max() + 1)
    for n in range(face.shape[0]):
        for m in range(face.shape[1]):
            total[face[n, m]] += (row_bounds[n + 1] - row_bounds[n]) * (col_bounds[m + 1] - col_bounds[m])
            seen[face[n, m]] += known[n, m]
    return seen >= least * np.maximum(total, 1.0)


def find_evidence(
    cells: NDArray[np.int8], wall: NDArray[np.bool_], resolution: float, config: EvidenceConfig | None = None
) -> LineEvidence:
    """Lines, faces and rooms of a grid whose walls run along rows and columns.

    Args:
        cells: int8 (rows, cols), trinary.
        wall: bool (rows, cols), the occupied cells that may be wall.
        resolution: Metres a cell.
        config: The options.
    """
    config = config or EvidenceConfig()
    rows, cols = cells.shape
    surface = surfaces(cells)
    at = true_cells(surface & wall)
    along_rows, along_cols = set_bits(at, rows, cols, max(round(config.slack / resolution), 1))
    row, col = np.divmod(at, cols)
    half, near = (max(round(length / resolution / 2), 1) for length in (config.wall_length, config.run))
    enough = config.run_share * (2 * near + 1)
    scores = [
        _scores(row, col, along_rows, cols, half, near, enough),
        _scores(col, row, along_cols, rows, half, near, enough),
    ]
    lying, standing = _walls(scores, int(np.count_nonzero(surface)), resolution, config)
    row_lines, row_sums = _lines(row[lying], col[lying], (rows, cols), resolution, config)
    col_lines, col_sums = _lines(col[standing], row[standing], (cols, rows), resolution, config)
    row_bounds, col_bounds = (
        np.concatenate(([0], row_lines, [rows])),
        np.concatenate(([0], col_lines, [cols])),
    )
    above, above_open = _edges(row_sums, col_bounds, config.line_weight, config.edge_weight)
    right, right_open = _edges(col_sums, row_bounds, config.line_weight, config.edge_weight)
    face = _crossing_faces(above_open, right_open)
    pairs, length, covered = _face_sides(face, above, right, row_bounds, col_bounds)
    graph = FaceGraph(first=pairs[:, 0], second=pairs[:, 1], length=length, covered=covered)
    inside = _seen_faces(
        face, _known(cells, row_bounds, col_bounds), row_bounds, col_bounds, config.known_share
    )
    room = cluster_faces(graph, inside, config.sigma, config.affinity) + 1
    return LineEvidence(
        row_strip=np.repeat(np.arange(len(row_bounds) - 1, dtype=np.int32), np.diff(row_bounds)),
        col_strip=np.repeat(np.arange(len(col_bounds) - 1, dtype=np.int32), np.diff(col_bounds)),
        face=face.astype(np.int32),
        room=room[face].astype(np.int32),
        above=np.pad(above, ((0, 1), (0, 0))),
        right=np.pad(right.T, ((0, 0), (0, 1))),
    )


@njit(
    "void(int32[:,::1], boolean[:,::1], int32[::1], int32[::1], int32[:,::1], float64[::1], float64[::1], float64[:,::1])",
    cache=True,
    nogil=True,
)
def _count(
    labels: NDArray[np.int32],
    free: NDArray[np.bool_],
    row_strip: NDArray[np.int32],
    col_strip: NDArray[np.int32],
    room: NDArray[np.int32],
    row_weight: NDArray[np.float64],
    col_weight: NDArray[np.float64],
    out: NDArray[np.float64],
) -> None:
    for r in range(labels.shape[0]):
        of_row, weight = room[row_strip[r]], row_weight[r]
        for c in range(labels.shape[1]):
            if labels[r, c] > 0 and free[r, c]:
                out[labels[r, c], of_row[col_strip[c]]] += min(weight, col_weight[c])


def _weights(strip: NDArray[np.int32], beside: int) -> NDArray[np.float64]:
    """float64 (n,): 1, and `BESIDE_LINE` for rows or columns less than so many cells beside a line."""
    padded = np.pad(strip, beside, mode="edge")
    return np.where(padded[: len(strip)] == padded[2 * beside :], 1.0, BESIDE_LINE)


def count_rooms(
    labels: NDArray[np.int32],
    free: NDArray[np.bool_],
    evidence: LineEvidence,
    count: int | None = None,
    *,
    beside: int = 0,
) -> NDArray[np.float64]:
    """float64 (k + 1, rooms + 1): known free cells of each region in each room of the lines, column 0 in none.

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
