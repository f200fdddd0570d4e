"""Search over the corners of a grid: lengths of the shortest paths from places to corners, and on to places.

Lengths are those of `layoutexplore.planning.canonical_search`, and the same as there; so is the queue's kind.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from layoutexplore.grids.arrays import Bytes, Ints, Ints32
from layoutexplore.planning.canonical_search import FAR, STRAIGHT
from layoutexplore.planning.corner_sight import Ground, corners_in_sight, number_at, octile, room_for_corners


class Nodes(NamedTuple):
    """Corners by number, and where their edges are.

    Attributes:
        cell: int32 (n, 2), (row, col) in the padded grid; row 0 where a number is not in use.
        seen: int32 (n, 4), half-open box (row0, row1, col0, col1) around the cells that its edges depend on.
        first: int64 (n,), where its edges begin in the pool.
        degree: int64 (n,), how many it has.
    """

    cell: Ints32
    seen: Ints32
    first: Ints
    degree: Ints


class Edges(NamedTuple):
    """A pool of edges; each stands there twice, once from either end.

    Attributes:
        end: int32 (m,), the corner that an edge leads to.
        length: int32 (m,), in units of the search.
    """

    end: Ints32
    length: Ints32


class Links(NamedTuple):
    """The corners that places are joined to.

    Attributes:
        cell: int32 (n, 2), the places in the padded grid.
        seen: int32 (n, 4), half-open box around the cells that this depends on.
        first: int64 (n + 1,): place k has the entries from `first[k]` up to, but without, `first[k + 1]`.
        corner: int32 (m,), numbers of corners.
        length: int64 (m,), how far they are.
    """

    cell: Ints32
    seen: Ints32
    first: Ints
    corner: Ints32
    length: Ints


class _Queue(NamedTuple):
    """Dial's queue ("Algorithm 360", 1969): buckets one straight move wide, each a chain of entries."""

    heads: Ints32
    """First entry of each bucket, -1 if there is none; their number is a power of two."""
    items: Ints32
    """The corner of each entry."""
    links: Ints32
    """The next entry of the chain, -1 at its end."""


def find_links(ground: Ground, places: Ints) -> Links:
    """The corners that places int (n, 2) of the grid, not padded, are joined to; all are traversable."""
    cells, found = np.asarray(places, np.int32) + np.int32(1), room_for_corners(ground)
    count, size = len(cells), 32 * len(places) + len(found)
    links = Links(
        np.ascontiguousarray(cells),
        np.empty((count, 4), np.int32),
        np.zeros(count + 1, np.int64),
        np.empty(size, np.int32),
        np.empty(size, np.int64),
    )
    done = 0
    while True:
        done = _link(ground, links, found, done)
        if done == count:
            return links
        links = links._replace(
            corner=np.concatenate([links.corner, np.empty_like(links.corner)]),
            length=np.concatenate([links.length, np.empty_like(links.length)]),
        )


def spread_from(nodes: Nodes, edges: Edges, corners: Ints32, lengths: Ints, longest: int) -> Ints:
    """Distances int64 (n,) of all corners from some.

    Args:
        nodes: The corners.
        edges: What joins them.
        corners: int32 (m,), those to begin at.
        lengths: int64 (m,), the distances they begin with.
        longest: No edge and no length is longer than so many straight moves.
    """
    # Each edge is queued at most once, for it leads down only when its beginning is settled.
    entries = len(corners) + int(nodes.degree.sum())
    queue = _Queue(
        np.full(1 << (longest + 2).bit_length(), np.int32(-1)),
        np.empty(entries, np.int32),
        np.empty(entries, np.int32),
    )
    distance = np.full(len(nodes.cell), FAR, np.int64)
    _spread(nodes, edges, corners, lengths, distance, queue)
    return distance


@njit(cache=True, nogil=True)
def _link(ground: Ground, links: Links, found: Ints32, begin: int) -> int:
    """Fill the links of places from `begin` on; the first place for which the memory did not do."""
    for k in range(begin, len(links.cell)):
        row, col = links.cell[k, 0], links.cell[k, 1]
        count, row0, row1, col0, col1 = corners_in_sight(ground, row, col, found)
        m = links.first[k]
        if m + count + 1 > len(links.corner):
            return k
        links.seen[k, 0], links.seen[k, 1], links.seen[k, 2], links.seen[k, 3] = row0, row1, col0, col1
        # A place on a corner is joined to that one as well, at no length.
        if number_at(ground, row, col):
            links.corner[m], links.length[m] = number_at(ground, row, col), 0
            m += 1
        for n in range(count):
            r, c = found[n, 0], found[n, 1]
            links.corner[m], links.length[m] = number_at(ground, r, c), octile(r - row, c - col)
            m += 1
        links.first[k + 1] = m
    return len(links.cell)


@njit(cache=True, nogil=True)
def _spread(
    nodes: Nodes, edges: Edges, corners: Ints32, lengths: Ints, distance: Ints, queue: _Queue
) -> None:
    """Lower the distances, `FAR` at first, to those of the shortest paths."""
    (heads, items, links), used = queue, 0
    ring = np.int64(heads.size - 1)
    for n in range(len(corners)):
        if lengths[n] < distance[corners[n]]:
            distance[corners[n]] = lengths[n]
            bucket = (lengths[n] // STRAIGHT) & ring
            items[used], links[used], heads[bucket] = corners[n], heads[bucket], used
            used += 1
    waiting, level = used, np.int64(0)
    while waiting > 0:
        entry, heads[level & ring] = heads[level & ring], -1
        # No edge is shorter than a bucket: the corners of this one cannot improve each other.
        while entry >= 0:
            k, entry = np.uint64(items[np.uint64(entry)]), links[np.uint64(entry)]
            waiting -= 1
            here = distance[k]
            if here // STRAIGHT != level:
                continue  # Improved since it was queued.
            for e in range(nodes.first[k], nodes.first[k] + nodes.degree[k]):
                end, there = np.uint64(edges.end[np.uint64(e)]), here + edges.length[np.uint64(e)]
                if there < distance[end]:
                    distance[end] = there
                    bucket = np.uint64((there // STRAIGHT) & ring)
                    items[used], links[used], heads[bucket] = np.int32(end), heads[bucket], used
                    used += 1
                    waiting += 1
        level += 1


@njit(cache=True, nogil=True)
def lengths_at(links: Links, distance: Ints) -> Ints:
    """Lengths int64 (n,) of the paths to places by way of corners, whose distances are known."""
    found = np.full(len(links.cell), np.int64(FAR))
    for k in range(len(found)):
        for m in range(links.first[k], links.first[k + 1]):
            found[k] = min(found[k], distance[links.corner[m]] + links.length[m])
    return found


@njit(cache=True, nogil=True)
def shorten(world: Bytes, links: Links, row: int, col: int, lengths: Ints) -> None:
    """Lower the lengths int64 (n,) to places by the paths from a padded cell that turn at no corner."""
    for k in range(len(lengths)):
        rows, cols = links.cell[k, 0] - row, links.cell[k, 1] - col
        straight = octile(rows, cols)
        # Where the way by corners is as short already, nothing need be looked at.
        if straight < lengths[k] and is_straight(world, row, col, rows, cols):
            lengths[k] = straight


@njit(cache=True, nogil=True)
def is_straight(world: Bytes, row: int, col: int, rows: int, cols: int) -> bool:
    """Whether a cell so many rows and columns away is reached by diagonal moves, then straight ones."""
    r, c, dr, dc = row, col, np.sign(rows), np.sign(cols)
    diagonal = min(abs(rows), abs(cols))
    for _ in range(diagonal):
        if not (world[r + dr, c] and world[r, c + dc] and world[r + dr, c + dc]):
            return False
        r, c = r + dr, c + dc
    if abs(rows) > abs(cols):
        dc = 0
    else:
        dr = 0
    for _ in range(max(abs(rows), abs(cols)) - diagonal):
        r, c = r + dr, c + dc
        if not world[r, c]:
            return False
    return True
