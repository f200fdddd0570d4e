"""What the classifier of regions sees, and the order in which it is asked."""

from __future__ import annotations

import numpy as np
import pytest

from layoutexplore.layout.merging.agglomeration import Rest, merge_within
from layoutexplore.layout.merging.graph_tables import EDGE, NODE
from layoutexplore.layout.merging.pair_features import FEATURES
from layoutexplore.training.merging_examples import make_example
from layoutexplore.training.room_merging import first_forest
from tests.layout.merging.cases import office, plan, rooms_of


@pytest.mark.parametrize(("room_area", "rooms"), [(0.0, 3), (12.0, 3), (18.0, 2), (1e6, 1)])
def test_what_is_too_small_for_a_room_joins_a_neighbour(room_area: float, rooms: int) -> None:
    """Of a corridor of 16 m2 between two rooms of 20 m2 each."""
    graph = make_example(plan(), rooms_of(plan()), 0.05, building="a", kind="x").graph
    into = merge_within(graph, first_forest(), 1e9, Rest(room_area))[0]
    area = (
        np.bincount(into, weights=graph.nodes[:, NODE.area], minlength=len(into))[into] * graph.resolution**2
    )
    a, b = graph.ends[graph.edges[:, EDGE.open] > 0].T
    parted = into[a] != into[b]
    assert (np.minimum(area[a], area[b])[parted] >= room_area).all()
    assert len(set(into[1:].tolist())) == rooms and parted.any() == (rooms > 1)


def test_nooks_join_a_neighbour_unless_they_are_surely_rooms() -> None:
    graph = make_example(plan(), rooms_of(plan()), 0.05, building="a", kind="x").graph
    alone = np.arange(len(graph.nodes))
    assert (merge_within(graph, first_forest(), 1e9, Rest(nook=1e6, level=1e9))[0] == alone).all()
    for area in (18.0, 1e6):
        always, unless = (
            merge_within(graph, first_forest(), 1e9, rest)[0] for rest in (Rest(area), Rest(0, area, -1e9))
        )
        assert (always == unless).all() and (always != alone).any()


def test_the_classifier_is_asked_in_order_of_certainty() -> None:
    example = make_example(office().cells, office().cells.astype(np.int32) * 0, 0.05, building="a", kind="x")
    nothing, everything = (merge_within(example.graph, first_forest(), v)[0] for v in (1e9, -1e9))
    assert (nothing == np.arange(len(nothing))).all()
    assert len(set(everything[1:].tolist())) == 1
    assert len(FEATURES) == len(set(FEATURES))
