"""Rooms from lines alone, split at narrow passages."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from layoutexplore.layout.merging.graph_tables import EDGE, NODE, RegionGraph
from layoutexplore.layout.merging.line_rooms import split_line_rooms
from tests.layout.merging.cases import graphs


@settings(max_examples=80, deadline=None)
@given(graphs(), st.floats(0.01, 1))
def test_rooms_of_the_lines_fall_apart_at_narrow_passes(graph: RegionGraph, share: float) -> None:
    rooms = graph.rooms.copy()
    rooms[0] = 0
    graph = replace(graph, rooms=rooms)
    own, peak = rooms.argmax(axis=1), graph.nodes[:, NODE.peak]
    group = list(range(len(rooms)))
    for _ in rooms:
        for (a, b), edge in zip(graph.ends, graph.edges, strict=True):
            if (
                own[a] == own[b]
                and edge[EDGE.open] > 0
                and edge[EDGE.clearance] >= share * min(peak[a], peak[b])
            ):
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
