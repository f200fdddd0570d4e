"""Pieces merge into rooms: the surest pair first, as judged by a small forest of decision trees on readable features."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.grids.components import root_of
from layoutexplore.layout.merging.adjacency_graph import (
    ACROSS_ROWS,
    APART,
    AREA,
    CLUTTER,
    COL0,
    COL1,
    COVERED,
    DOOR,
    FAR,
    LONG,
    NEAR,
    NEAR_MIN,
    OPEN,
    OPEN_END,
    PARTED,
    PASS,
    PEAK,
    ROW0,
    ROW1,
    SEEN,
    SHORT,
    SIDES,
    SPACE,
    THROUGH,
    WALL_SIDES,
    WIDTH,
    PieceGraph,
    add_node,
)
from layoutexplore.models.forest import Forest, Numbers, log_odds

FEATURES = (
    "log_area_small", "log_area_large", "openness", "contact", "contact_share_small", "contact_share_large",
    "pass", "pass_ratio_small", "pass_ratio_large", "radius_small", "radius_large",
    "door_share", "door_width", "door_long_run", "door_short_run",
    "fill_small", "fill_large", "fill_union", "fill_change", "aspect_small", "aspect_large", "aspect_union", "misalignment",
    "line_near", "line_near_min", "line_far", "unknown_small", "unknown_large", "clutter_small", "clutter_large",
    "wall_small", "wall_large", "straightness", "through", "facing_small", "facing_large",
    "only_way_small", "only_way_large", "parted", "covered", "apart", "seen",
    "same_room", "room_share_small", "room_share_large", "room_overlap", "room_fit", "map_clutter", "map_unknown", "map_radius",
)  # fmt: skip
"""What is known of a pair of touching pieces, in this order; the small one is the one of less known free space."""

FEATURE_COUNT = len(FEATURES)


class Rest(NamedTuple):
    """What is too small for a room joins the neighbour it most likely belongs to.

    Attributes:
        small: What is smaller than this always does [m2].
        nook: What is smaller than this does [m2] ...
        level: ... while the log-odds are at least this.
    """

    small: float = 0.0
    nook: float = 0.0
    level: float = 0.0


NO_REST = Rest()


@njit(cache=True, nogil=True)
def _aspect(rows: float, cols: float) -> float:
    return min(rows, cols) / max(max(rows, cols), 1.0)


@njit(cache=True, nogil=True)
def _smaller(a: NDArray[np.float64], b: NDArray[np.float64]) -> bool:
    return bool(a[AREA] < b[AREA] or (a[AREA] == b[AREA] and a[SPACE] <= b[SPACE]))


@njit(cache=True, nogil=True)
def _features(
    a: NDArray[np.float64],
    b: NDArray[np.float64],
    e: NDArray[np.float64],
    resolution: float,
    out: NDArray[np.float64],
) -> None:
    s, t = (a, b) if _smaller(a, b) else (b, a)
    n = max(e[OPEN], 1.0)
    out[0] = np.log(max(s[AREA], 1.0) * resolution**2)
    out[1] = np.log(max(t[AREA], 1.0) * resolution**2)
    out[2] = e[OPEN] / max(e[OPEN] + e[THROUGH], 1.0)
    out[3] = e[OPEN] * resolution
    out[4] = e[OPEN] / max(s[SIDES], 1.0)
    out[5] = e[OPEN] / max(t[SIDES], 1.0)
    out[6] = e[PASS] * resolution
    out[7] = e[PASS] / max(s[PEAK], 0.5)
    out[8] = e[PASS] / max(t[PEAK], 0.5)
    out[9] = s[PEAK] * resolution
    out[10] = t[PEAK] * resolution
    out[11] = e[DOOR] / n
    doors = max(e[DOOR], 1.0)
    out[12] = e[WIDTH] / doors
    out[13] = min(e[LONG] / doors, 5.0)
    out[14] = min(e[SHORT] / doors, 5.0)
    hs, ws, ht, wt = s[ROW1] - s[ROW0], s[COL1] - s[COL0], t[ROW1] - t[ROW0], t[COL1] - t[COL0]
    hu = max(s[ROW1], t[ROW1]) - min(s[ROW0], t[ROW0])
    wu = max(s[COL1], t[COL1]) - min(s[COL0], t[COL0])
    out[15] = s[SPACE] / (hs * ws)
    out[16] = t[SPACE] / (ht * wt)
    out[17] = (s[SPACE] + t[SPACE]) / (hu * wu)
    out[18] = out[17] - (s[SPACE] + t[SPACE]) / (hs * ws + ht * wt)
    out[19] = _aspect(hs, ws)
    out[20] = _aspect(ht, wt)
    out[21] = _aspect(hu, wu)
    rows = abs(s[ROW0] - t[ROW0]) + abs(s[ROW1] - t[ROW1])
    cols = abs(s[COL0] - t[COL0]) + abs(s[COL1] - t[COL1])
    out[22] = min(rows, cols) * resolution
    out[23] = e[NEAR] / n
    out[24] = e[NEAR_MIN] / n
    out[25] = e[FAR] / n
    out[26] = s[OPEN_END] / max(s[SIDES], 1.0)
    out[27] = t[OPEN_END] / max(t[SIDES], 1.0)
    out[28] = s[CLUTTER] / s[SPACE]
    out[29] = t[CLUTTER] / t[SPACE]
    out[30] = s[WALL_SIDES] / max(s[SIDES], 1.0)
    out[31] = t[WALL_SIDES] / max(t[SIDES], 1.0)
    out[32] = abs(2 * e[ACROSS_ROWS] - e[OPEN]) / n
    out[33] = e[THROUGH] * resolution
    lying = e[ACROSS_ROWS] / n  # share of the contact that runs along the rows
    out[34] = e[OPEN] / max(lying * ws + (1 - lying) * hs, 1.0)
    out[35] = e[OPEN] / max(lying * wt + (1 - lying) * ht, 1.0)
    out[36] = e[OPEN] / max(s[SIDES] - s[WALL_SIDES] - s[OPEN_END], e[OPEN], 1.0)
    out[37] = e[OPEN] / max(t[SIDES] - t[WALL_SIDES] - t[OPEN_END], e[OPEN], 1.0)
    out[38] = e[PARTED] / n
    out[39] = e[COVERED] / n
    out[40] = e[APART] / n
    out[41] = e[SEEN] / n


@njit(cache=True, nogil=True)
def _room_features(
    a: NDArray[np.float64], b: NDArray[np.float64], size: NDArray[np.float64], out: NDArray[np.float64]
) -> None:
    """What the rooms of the lines say of a small and a large piece; `size` (r + 1,) is what all pieces have in each room."""
    total_a, total_b = max(a.sum(), 1.0), max(b.sum(), 1.0)
    same = overlap = most_a = most_b = fit_a = fit_b = fit = 0.0
    for k in range(1, len(size)):
        x, y = a[k], b[k]
        if x == 0 and y == 0:
            continue
        same += x * y
        overlap += min(x / total_a, y / total_b)
        most_a, most_b = max(most_a, x), max(most_b, y)
        fit_a, fit_b = max(fit_a, x / (total_a + size[k] - x)), max(fit_b, y / (total_b + size[k] - y))
        fit = max(fit, (x + y) / (total_a + total_b + size[k] - x - y))
    out[42] = same / (total_a * total_b)
    out[43] = most_a / total_a
    out[44] = most_b / total_b
    out[45] = overlap
    out[46] = fit - max(fit_a, fit_b)


@njit(cache=True, nogil=True)
def _surroundings(nodes: NDArray[np.float64], resolution: float) -> NDArray[np.float64]:
    """What is typical of a map: clutter and unknown borders over its space, and the mean radius of its pieces by area."""
    space = max(nodes[:, SPACE].sum(), 1.0)
    out = np.empty(3)
    out[0] = nodes[:, CLUTTER].sum() / space
    out[1] = nodes[:, OPEN_END].sum() / max(nodes[:, OPEN_END].sum() + nodes[:, WALL_SIDES].sum(), 1.0)
    out[2] = (nodes[:, PEAK] * nodes[:, SPACE]).sum() / space * resolution
    return out


@njit(cache=True, nogil=True)
def _same_room(a: NDArray[np.float64], b: NDArray[np.float64]) -> bool:
    return int(a.argmax()) == int(b.argmax())


@njit(cache=True, nogil=True)
def _describe(
    pairs: NDArray[np.int32],
    ends: NDArray[np.int32],
    tables: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]],
    resolution: float,
    size: NDArray[np.float64],
    out: NDArray[np.float64],
) -> None:
    """Write the features of some contacts, but not those of the map, to `out`; the tables: nodes, edges and rooms."""
    nodes, edges, rooms = tables
    for n in range(len(pairs)):
        i, j = ends[pairs[n], 0], ends[pairs[n], 1]
        _features(nodes[i], nodes[j], edges[pairs[n]], resolution, out[n])
        if _smaller(nodes[i], nodes[j]):
            _room_features(rooms[i], rooms[j], size, out[n])
        else:
            _room_features(rooms[j], rooms[i], size, out[n])


@njit(cache=True, nogil=True)
def _add_sample(
    x: NDArray[np.float64], a: NDArray[np.float64], b: NDArray[np.float64], sample: NDArray[np.float64]
) -> None:
    """Write features, answer and weight of a pair of pieces, given what each has in the true rooms."""
    sample[:FEATURE_COUNT] = x
    sample[FEATURE_COUNT] = 1.0 if _same_room(a, b) else 0.0
    ra, rb = a.argmax(), b.argmax()
    pure = min(a[ra] / max(a.sum(), 1.0), b[rb] / max(b.sum(), 1.0))
    sample[FEATURE_COUNT + 1] = pure * (0.2 if ra == 0 and rb == 0 else 1.0)


@njit(cache=True, nogil=True)
def _unite(
    best: int,
    ends: NDArray[np.int32],
    tables: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]],
) -> None:
    """Add the second piece of a contact to the first one."""
    nodes, edges, rooms = tables
    a, b = ends[best, 0], ends[best, 1]
    add_node(nodes[a], nodes[b])
    nodes[a, SIDES] -= 2 * edges[best, OPEN]
    rooms[a] += rooms[b]


@njit(cache=True, nogil=True)
def _move_contacts(
    a: int,
    b: int,
    ends: NDArray[np.int32],
    edges: NDArray[np.float64],
    slots: NDArray[np.int32],
    gone: NDArray[np.bool_],
) -> None:
    """Give the contacts of piece b to piece a, adding up those with one neighbour."""
    slots[a, b] = slots[b, a] = -1
    for n in range(1, len(slots)):
        f = slots[b, n]
        if f < 0:
            continue
        slots[b, n] = slots[n, b] = -1
        g = slots[a, n]
        if g < 0:
            ends[f, 0], ends[f, 1] = min(a, n), max(a, n)
            slots[a, n] = slots[n, a] = f
        else:
            top = max(edges[g, PASS], edges[f, PASS])
            edges[g] += edges[f]
            edges[g, PASS] = top
            gone[f] = True


@njit(cache=True, nogil=True)
def _stale_contacts(
    a: int,
    edges: NDArray[np.float64],
    slots: NDArray[np.int32],
    gone: NDArray[np.bool_],
    out: NDArray[np.int32],
) -> int:
    """Write the contacts of piece a that are to be judged again to `out`, rising, and return how many."""
    count = 0
    for n in range(1, len(slots)):
        f = slots[a, n]
        if f >= 0 and edges[f, OPEN] > 0:
            gone[f] = False
            out[count] = f
            count += 1
    out[:count].sort()
    return count


@njit(cache=True, nogil=True)
def _surest(odds: NDArray[np.float64], gone: NDArray[np.bool_]) -> int:
    """The first of the contacts with the highest odds, -1 when all are gone."""
    best, best_odds = -1, -1e9
    for e in range(len(odds)):
        if not gone[e] and odds[e] > best_odds:
            best, best_odds = e, odds[e]
    return best


@njit(cache=True, nogil=True)
def _surest_of_rest(
    odds: NDArray[np.float64],
    gone: NDArray[np.bool_],
    ends: NDArray[np.int32],
    nodes: NDArray[np.float64],
    rest: Rest,
) -> int:
    """The same among the contacts of pieces that are too small (areas in cells)."""
    best, best_odds = -1, -1e9
    for e in range(len(odds)):
        if not gone[e] and odds[e] > best_odds:
            area = min(nodes[ends[e, 0], AREA], nodes[ends[e, 1], AREA])
            if area < rest.small or (area < rest.nook and odds[e] >= rest.level):
                best, best_odds = e, odds[e]
    return best


@njit(cache=True, nogil=True)
def _agglomerate(
    ends: NDArray[np.int32],
    tables: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]],
    resolution: float,
    forest: Numbers,
    level: float,
    rest: Rest,
    truth: NDArray[np.float64],
    samples: NDArray[np.float64],
) -> tuple[NDArray[np.int32], int]:
    """Merge in place; with `truth` (k + 1, rooms + 1) only right merges happen and every judged pair is written to `samples`."""
    nodes, edges, rooms = tables
    count = len(nodes)
    into = np.arange(count).astype(np.int32)
    learning = truth.shape[0] > 0
    slots = np.full((count, count), -1, np.int32)
    for e in range(len(ends)):
        slots[ends[e, 0], ends[e, 1]] = slots[ends[e, 1], ends[e, 0]] = e
    odds = np.full(len(ends), -1e9)
    gone = edges[:, OPEN] <= 0  # contacts across walls only never merge by themselves, but add up
    stale = np.flatnonzero(~gone).astype(np.int32)
    stale_count = len(stale)
    stale = np.concatenate((stale, np.empty(count, np.int32)))
    x, judged = np.empty((len(stale), FEATURE_COUNT)), np.empty(len(stale))
    x[:, 47:] = _surroundings(nodes, resolution)
    size = rooms.sum(axis=0)
    written = 0
    while True:
        fresh = stale[:stale_count]
        _describe(fresh, ends, tables, resolution, size, x)
        log_odds(x, forest, judged[:stale_count])
        for n in range(stale_count):
            odds[fresh[n]] = judged[n]
            if learning and written < len(samples):
                _add_sample(x[n], truth[ends[fresh[n], 0]], truth[ends[fresh[n], 1]], samples[written])
                written += 1
        stale_count = 0
        best = _surest(odds, gone)
        if not learning and best >= 0 and odds[best] < level:
            best = _surest_of_rest(odds, gone, ends, nodes, rest)
        if best < 0:
            break
        a, b = ends[best, 0], ends[best, 1]
        gone[best] = True
        if learning:
            if not _same_room(truth[a], truth[b]):
                continue
            truth[a] += truth[b]
        into[b] = a
        _unite(best, ends, tables)
        _move_contacts(a, b, ends, edges, slots, gone)
        stale_count = _stale_contacts(a, edges, slots, gone, stale)
    for k in range(count):
        into[k] = root_of(into, k)
    return into, written


def merge_pieces(
    graph: PieceGraph, forest: Forest, *, level: float = 0.0, rest: Rest = NO_REST
) -> NDArray[np.int32]:
    """Which pieces become one.

    Args:
        graph: The pieces; not changed.
        forest: The judge.
        level: Merge while the log-odds of the surest pair are at least this.
        rest: What is too small to stay by itself then.

    Returns:
        int32 (k + 1,), the piece that each piece is merged into (itself for the first of each room).
    """
    nothing, cell = np.zeros((0, 0)), graph.resolution**2
    rest = Rest(rest.small / cell, rest.nook / cell, rest.level)
    into, _ = _agglomerate(
        graph.ends.copy(), _tables(graph), graph.resolution, forest.numbers, level, rest, nothing, nothing
    )
    return into


def _tables(graph: PieceGraph) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Copies of the nodes, edges and rooms of a graph."""
    return graph.nodes.copy(), graph.edges.copy(), graph.rooms.copy()


def judge_with_truth(graph: PieceGraph, forest: Forest, rooms: NDArray[np.float64]) -> NDArray[np.float64]:
    """Samples for training: merge as the forest would, but only where it is right.

    Args:
        graph: The pieces; not changed.
        forest: The judge that gives the order.
        rooms: float64 (k + 1, rooms + 1), known free cells of each piece in each true room, column 0 in none.

    Returns:
        float64 (n, features + 2): the features of a pair, 1 where both belong to one room, and the sample's
            weight; the
        first look at each pair and as many of the later ones, evenly spaced.
    """
    pairs = len(graph.ends)
    samples = np.zeros((min(80 * pairs + 100, 400_000), FEATURE_COUNT + 2))
    _, n = _agglomerate(
        graph.ends.copy(),
        _tables(graph),
        graph.resolution,
        forest.numbers,
        0.0,
        NO_REST,
        rooms.copy(),
        samples,
    )
    later = np.linspace(pairs, n - 1, min(pairs, max(n - pairs, 0))).astype(np.int64)
    chosen = np.concatenate([np.arange(min(pairs, n)), later])
    return np.asarray(samples[chosen])
