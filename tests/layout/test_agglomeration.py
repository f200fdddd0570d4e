"""What the default method's judge sees: slivers, representative lines, and judges made of several forests."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from layoutexplore.evaluation.segmentation import MapScore, seed_spread
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN
from layoutexplore.layout.merging.adjacency_graph import (
    AREA,
    DOOR,
    EDGE_COLUMNS,
    NODE_COLUMNS,
    OPEN,
    PASS,
    PEAK,
    SIDES,
    SPACE,
    PieceGraph,
)
from layoutexplore.layout.merging.agglomeration import Rest, merge_pieces
from layoutexplore.layout.merging.line_evidence import BESIDE_LINE, EvidenceConfig, count_rooms, find_evidence
from layoutexplore.layout.merging.line_rooms import split_line_rooms
from layoutexplore.layout.merging.slivers import absorb_slivers
from layoutexplore.maps.painted_rooms import Case
from layoutexplore.training.explored_maps import explore, explored_examples
from layoutexplore.training.folds import deal_folds
from layoutexplore.training.merging_examples import make_example
from layoutexplore.training.room_merging import TrainingConfig, first_forest, mean_forest, train_forest


def plan() -> np.ndarray:
    """Two rooms of 4 m x 5 m side by side above a corridor of 2 m, walls of 0.2 m, doors of 0.9 m, at 0.05 m."""
    cells = np.full((170, 190), UNKNOWN, np.int8)
    cells[10:164, 10:178] = 100
    cells[14:54, 14:174] = 0
    cells[58:158, 14:92] = 0
    cells[58:158, 96:174] = 0
    cells[54:58, 40:58] = 0
    cells[54:58, 120:138] = 0
    return cells


def rooms_of(cells: np.ndarray) -> np.ndarray:
    truth = np.zeros(cells.shape, np.int32)
    truth[14:54], truth[58:158, 14:92], truth[58:158, 96:174] = 1, 2, 3
    return np.where(cells == 0, truth, 0).astype(np.int32)


@st.composite
def graphs(draw: st.DrawFn) -> PieceGraph:
    count = draw(st.integers(2, 9))
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    pairs = [(a, b) for a in range(1, count + 1) for b in range(a + 1, count + 1) if rng.random() < 0.5]
    nodes = np.zeros((count + 1, NODE_COLUMNS))
    nodes[1:] = rng.integers(1, 60, (count, NODE_COLUMNS))
    edges = rng.integers(0, 6, (len(pairs), EDGE_COLUMNS)).astype(np.float64)
    edges[:, DOOR] = np.minimum(edges[:, DOOR], edges[:, OPEN])
    rooms = rng.integers(0, 5, (count + 1, 3)).astype(np.float64)
    return PieceGraph(nodes, np.array(pairs, np.int32).reshape(-1, 2), edges, rooms, 1.0)


def slow_parts(graph: PieceGraph, area: float) -> list[set[int]]:
    """The pieces that become one: each sliver in turn, by size, looks at all contacts of what it belongs to."""
    groups = {k: {k} for k in range(1, len(graph.nodes))}
    of = {k: k for k in groups}
    order = sorted(groups, key=lambda k: (graph.nodes[k, SPACE], k))
    for k in order:
        if sum(graph.nodes[m, SPACE] for m in groups[of[k]]) >= area:
            continue
        found: dict[int, list[float]] = {}
        for (a, b), edge in zip(graph.ends.tolist(), graph.edges, strict=True):
            if edge[OPEN] > 0 and (of[a] == of[k]) != (of[b] == of[k]):
                other = of[b] if of[a] == of[k] else of[a]
                sums = found.setdefault(other, [0.0, 0.0, 0.0])
                sums[0] += edge[OPEN]
                sums[1] += edge[DOOR]
                sums[2] = max(sums[2], edge[PASS])
        if found:
            top = max((v[2] * (0.5 if v[1] > 0.5 * v[0] else 1.0), v[0]) for v in found.values())
            best = {o for o, v in found.items() if (v[2] * (0.5 if v[1] > 0.5 * v[0] else 1.0), v[0]) == top}
            if len(best) > 1:
                return []  # a tie: any choice is right
            other, mine = best.pop(), of[k]
            groups[other] |= groups.pop(mine)
            for m in groups[other]:
                of[m] = other
    return list(groups.values())


@settings(max_examples=80, deadline=None)
@given(graphs(), st.floats(1, 80))
def test_slivers_join_their_widest_neighbour(graph: PieceGraph, area: float) -> None:
    coarse, part = absorb_slivers(graph, area)
    assert sorted(set(part[part > 0].tolist())) == list(range(1, len(coarse.nodes)))
    kept = part > 0
    assert coarse.nodes[:, SPACE].sum() == graph.nodes[kept, SPACE].sum()
    assert (coarse.rooms.sum(axis=0) == graph.rooms[kept].sum(axis=0)).all()
    a, b = part[graph.ends].T if len(graph.ends) else (part[:0], part[:0])
    between = (a != b) & (a > 0) & (b > 0)
    assert coarse.edges[:, OPEN].sum() == graph.edges[between, OPEN].sum()
    within = (a == b) & (a > 0)
    assert (
        coarse.nodes[1:, SIDES].sum() == graph.nodes[kept, SIDES].sum() - 2 * graph.edges[within, OPEN].sum()
    )
    groups = slow_parts(graph, area)
    for group in groups:
        assert len({int(part[k]) for k in group}) == 1
    if groups:
        assert len(coarse.nodes) - 1 <= len(groups)


@settings(max_examples=80, deadline=None)
@given(graphs(), st.floats(0.01, 1))
def test_rooms_of_the_lines_fall_apart_at_narrow_passes(graph: PieceGraph, share: float) -> None:
    rooms = graph.rooms.copy()
    rooms[0] = 0
    graph = replace(graph, rooms=rooms)
    own, peak = rooms.argmax(axis=1), graph.nodes[:, PEAK]
    group = list(range(len(rooms)))
    for _ in rooms:
        for (a, b), edge in zip(graph.ends, graph.edges, strict=True):
            if own[a] == own[b] and edge[OPEN] > 0 and edge[PASS] >= share * min(peak[a], peak[b]):
                group[a] = group[b] = min(group[a], group[b])
    found = split_line_rooms(graph, share).rooms
    names = sorted({group[k] for k in range(1, len(rooms)) if own[k] > 0})
    assert found.shape == (len(rooms), len(names) + 1)
    for k in range(1, len(rooms)):
        expected = np.zeros(len(names) + 1)
        column = names.index(group[k]) + 1 if own[k] > 0 else 0
        expected[column] = rooms[k, own[k]]
        expected[0] += rooms[k].sum() - rooms[k, own[k]]
        assert (found[k] == expected).all()


def test_lines_part_the_rooms_of_a_plan() -> None:
    cells = plan()
    evidence = find_evidence(cells, cells == 100, 0.05)
    room = evidence.room[evidence.row_strip][:, evidence.col_strip]
    found = [np.bincount(room[rooms_of(cells) == k]).argmax() for k in (1, 2, 3)]
    assert len(set(found)) == 3 and 0 not in found
    labels = np.ascontiguousarray(rooms_of(cells))
    table = count_rooms(labels, cells == FREE, evidence)
    assert table.sum() == np.count_nonzero(labels)
    assert all(table[k].argmax() == found[k - 1] for k in (1, 2, 3))


def test_walls_among_much_clutter_have_to_be_longer() -> None:
    cells = plan()
    rng = np.random.default_rng(0)
    for r, c in np.stack((rng.integers(60, 150, 60), rng.integers(100, 170, 60)), axis=1):
        cells[r : r + 3, c : c + 3] = 100  # boxes
    for r in range(66, 150, 24):
        cells[r : r + 2, 22:50] = 100  # shelves of 1.4 m
    low = find_evidence(cells, cells == 100, 0.05, EvidenceConfig(level_max=EvidenceConfig.level))
    adapted = find_evidence(cells, cells == 100, 0.05)
    high = find_evidence(cells, cells == 100, 0.05, EvidenceConfig(level=EvidenceConfig.level_max))
    assert adapted.face.shape == high.face.shape and adapted.face.size < low.face.size
    clean = (
        find_evidence(plan(), plan() == 100, 0.05),
        find_evidence(plan(), plan() == 100, 0.05, EvidenceConfig(level_max=0.18)),
    )
    assert (clean[0].face == clean[1].face).all()


@pytest.mark.parametrize("cells", [np.full((5, 6), UNKNOWN), np.zeros((5, 6)), np.full((5, 6), 100)])
def test_a_map_without_walls_is_one_face(cells: np.ndarray) -> None:
    cells = cells.astype(np.int8)
    evidence = find_evidence(cells, cells == 100, 0.05, EvidenceConfig())
    assert evidence.face.shape == evidence.room.shape == (1, 1)


def test_kinds_of_maps_weigh_what_they_are_given() -> None:
    rooms = rooms_of(plan())
    parted = make_example(plan(), rooms, 0.05, building="a", kind="parted")  # no two pieces are one room
    whole = make_example(plan(), np.minimum(rooms, 1), 0.05, building="a", kind="whole")  # all are
    for weights in ({}, {"whole": 4.0}, {"whole": 0.5, "parted": 2.0}):
        forest = train_forest(
            [parted, whole], TrainingConfig(rounds=1, forests=1, trees=2, kind_weights=weights)
        )
        assert forest.bias == pytest.approx(
            np.log(weights.get("whole", 1.0) / weights.get("parted", 1.0)), abs=1e-5
        )


def test_the_mean_of_judges_is_a_judge() -> None:
    example = make_example(plan(), rooms_of(plan()), 0.05, building="a", kind="x")
    config = TrainingConfig(rounds=1, forests=1, trees=4, leaves=4)
    one, other = (
        train_forest([example, example], TrainingConfig(**{**config.__dict__, "seed": s})) for s in (0, 1)
    )
    both = mean_forest([one, other])
    assert len(both.roots) == 8 and both.bias == pytest.approx((one.bias + other.bias) / 2)
    assert (merge_pieces(example.graph, mean_forest([one])) == merge_pieces(example.graph, one)).all()
    again = train_forest([example, example], config)
    assert (again.threshold == one.threshold).all()


@pytest.mark.parametrize("room_area", [0.0, 1.5, 12.0, 1e6])
def test_what_is_too_small_for_a_room_joins_a_neighbour(room_area: float) -> None:
    graph = make_example(plan(), rooms_of(plan()), 0.05, building="a", kind="x").graph
    into = merge_pieces(graph, first_forest(), level=1e9, rest=Rest(room_area))
    area = np.bincount(into, weights=graph.nodes[:, AREA], minlength=len(into))[into] * graph.resolution**2
    a, b = graph.ends[graph.edges[:, OPEN] > 0].T
    parted = into[a] != into[b]
    assert (np.minimum(area[a], area[b])[parted] >= room_area).all()
    assert len(set(into[1:].tolist())) == len(into) - 1 or room_area > 0


def test_nooks_join_a_neighbour_unless_they_are_surely_rooms() -> None:
    graph = make_example(plan(), rooms_of(plan()), 0.05, building="a", kind="x").graph
    alone = np.arange(len(graph.nodes))
    assert (merge_pieces(graph, first_forest(), level=1e9, rest=Rest(nook=1e6, level=1e9)) == alone).all()
    for area in (1.5, 12.0, 1e6):
        always, unless = (
            merge_pieces(graph, first_forest(), level=1e9, rest=rest)
            for rest in (Rest(area), Rest(0, area, -1e9))
        )
        assert (always == unless).all()


def test_cells_beside_a_line_hardly_count() -> None:
    cells = plan()
    evidence = find_evidence(cells, cells == OCCUPIED, 0.05)
    labels, free = np.ones(cells.shape, np.int32), cells == FREE
    rows, cols = (np.abs(np.subtract.outer(np.arange(len(s)), np.flatnonzero(np.diff(s)) + 0.5)).min(axis=1)
                  for s in (evidence.row_strip, evidence.col_strip))  # fmt: skip
    clear = (rows[:, None] > 2) & (cols > 2)
    all_cells, weighed = (count_rooms(labels, free, evidence, beside=beside).sum() for beside in (0, 2))
    assert all_cells == np.count_nonzero(free) > np.count_nonzero(free & clear) > 0
    assert weighed == pytest.approx(
        np.count_nonzero(free & clear) + BESIDE_LINE * np.count_nonzero(free & ~clear)
    )


def test_explored_maps_show_the_map_itself() -> None:
    cells = plan()
    for dense in (True, False):
        seen = explore(cells, 0.05, np.random.default_rng(0), dense=dense)
        known = seen != UNKNOWN
        assert (seen[known] == cells[known]).all()
        assert 0 < np.count_nonzero(seen == FREE) <= np.count_nonzero(cells == FREE)
    examples = explored_examples(
        cells, rooms_of(cells), 0.05, building="a", kind="x", rng=np.random.default_rng(1)
    )
    assert examples and {e.kind for e in examples} == {"x, explored"}


def test_folds_and_seeds() -> None:
    cases = [Case("f", f"m{k}", None, None, b) for k, b in enumerate("aabbc")]  # type: ignore[arg-type]
    assert set(deal_folds(cases, 2).values()) == {0, 1}
    zero: dict[str, Any] = dict.fromkeys(("precision", "recall", "iou_s", "iou_g", "a_fc", "a_bc", "ms"), 0.0)
    rows = [
        MapScore(
            folder="f",
            map="m",
            building="a",
            method="default",
            one_to_one=v,
            segments=1,
            rooms=1,
            seed=s,
            **zero,
        )
        for s, v in ((0, 0.4), (0, 0.6), (1, 0.7))
    ]
    (line,) = seed_spread(rows)
    assert line["seeds"] == 2 and line["one_to_one"] == pytest.approx(np.std([0.5, 0.7], ddof=1))
