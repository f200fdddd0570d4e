"""Slivers of regions join their widest neighbour, as one by one."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from layoutexplore.layout.merging.graph_tables import EDGE, NODE, RegionGraph
from layoutexplore.layout.merging.slivers import absorb_slivers
from tests.layout.merging.cases import graphs, slow_parts


@settings(max_examples=80, deadline=None)
@given(graphs(), st.floats(1, 80))
def test_slivers_join_their_widest_neighbour(graph: RegionGraph, area: float) -> None:
    coarse, part = absorb_slivers(graph, area)
    assert sorted(set(part[part > 0].tolist())) == list(range(1, len(coarse.nodes)))
    kept = part > 0
    assert coarse.nodes[:, NODE.space].sum() == graph.nodes[kept, NODE.space].sum()
    assert (coarse.rooms.sum(axis=0) == graph.rooms[kept].sum(axis=0)).all()
    a, b = part[graph.ends].T if len(graph.ends) else (part[:0], part[:0])
    between = (a != b) & (a > 0) & (b > 0)
    assert coarse.edges[:, EDGE.open].sum() == graph.edges[between, EDGE.open].sum()
    within = (a == b) & (a > 0)
    assert (
        coarse.nodes[1:, NODE.sides].sum()
        == graph.nodes[kept, NODE.sides].sum() - 2 * graph.edges[within, EDGE.open].sum()
    )
    groups = slow_parts(graph, area)
    for group in groups:
        assert len({int(part[k]) for k in group}) == 1
    if groups:
        assert len(coarse.nodes) - 1 <= len(groups)
