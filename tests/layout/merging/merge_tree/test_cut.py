"""The tree of merges, and its best cut."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from layoutexplore.layout.merging.agglomeration import grow_tree, merge_within
from layoutexplore.layout.merging.graph_tables import NODE, RegionGraph
from layoutexplore.layout.merging.merge_tree.contest import Rest
from layoutexplore.layout.merging.merge_tree.cut import best_cut, standing_odds
from layoutexplore.layout.merging.merge_tree.features import TREE_FEATURES, MergeTree
from layoutexplore.layout.merging.merge_tree.record import W
from layoutexplore.training.merging_examples import make_example
from layoutexplore.training.room_merging import first_forest
from tests.layout.merging.cases import boxed, graphs, plan, rooms_of

NEVER, ALWAYS = float("inf"), float("-inf")


def members(tree: MergeTree) -> list[set[int]]:
    """The regions in each node."""
    out = [{k} for k in range(tree.regions)]
    for one, other in tree.children[tree.regions :].tolist():
        out.append(out[one] | out[other])
    return out


def best_sum(tree: MergeTree, odds: np.ndarray) -> float:
    """The largest sum over all sets of merges that hold, with a merge, those in it."""
    inside = members(tree)[tree.regions :]
    best = 0.0
    for chosen in itertools.product((False, True), repeat=len(odds)):
        stand = [k for k, c in enumerate(chosen) if c]
        closed = all(chosen[j] for k in stand for j in range(k) if inside[j] < inside[k])
        if closed:
            best = max(best, float(odds[stand].sum()))
    return best


@settings(max_examples=40, deadline=None)
@given(graphs().map(boxed), st.integers(0, 10**6))
def test_the_best_set_of_merges_stands(graph: RegionGraph, seed: int) -> None:
    tree, features, done = grow_tree(graph, first_forest(), 0.0, Rest(), ALWAYS)
    assert done and features.shape == (len(tree.parent) - tree.regions, len(TREE_FEATURES))
    assert np.isfinite(features[:, [TREE_FEATURES.index(n) for n in ("odds", "next_odds")]]).all()
    odds = np.random.default_rng(seed).normal(size=len(features))
    into = best_cut(tree, odds)
    rooms = [set(np.flatnonzero(into == k).tolist()) for k in np.unique(into)]
    nodes = members(tree)
    assert all(room in nodes for room in rooms) and all(into[k] == min(room) for room in rooms for k in room)
    stand = [k for k, inside in enumerate(nodes[tree.regions :]) if any(inside <= room for room in rooms)]
    assert odds[stand].sum() == pytest.approx(best_sum(tree, odds))


@settings(max_examples=40, deadline=None)
@given(graphs().map(boxed), st.floats(-2, 2))
def test_the_fixed_merging_is_where_the_tree_begins(graph: RegionGraph, level: float) -> None:
    rest = Rest(20.0, 40.0, -1.0)
    into, _ = merge_within(graph, first_forest(), level, rest)
    tree, features, _ = grow_tree(graph, first_forest(), level, rest, NEVER)
    whole = best_cut(tree, np.ones(len(features)))
    assert len(np.unique(whole)) == len(np.unique(into)) == tree.regions - len(features)
    assert all(len(np.unique(whole[into == k])) == 1 for k in np.unique(into))
    further, more, _ = grow_tree(graph, first_forest(), level, rest, ALWAYS)
    assert len(more) >= len(features) and (further.children[: len(tree.parent)] == tree.children).all()
    assert (best_cut(further, np.full(len(more), -1.0)) == np.arange(tree.regions)).all()


@settings(max_examples=20, deadline=None)
@given(graphs().map(boxed))
def test_a_whole_region_is_described_by_all_of_it(graph: RegionGraph) -> None:
    tree, _, _ = grow_tree(graph, first_forest(), 0.0, Rest(), ALWAYS)
    for node, inside in enumerate(members(tree)):
        if node:
            part = graph.nodes[sorted(inside)]
            whole = tree.wholes[node]
            assert np.exp(whole[W.log_area]) == pytest.approx(part[:, NODE.area].sum())
            assert whole[W.radius] == part[:, NODE.peak].max()
            height = part[:, NODE.row1].max() - part[:, NODE.row0].min()
            width = part[:, NODE.col1].max() - part[:, NODE.col0].min()
            box = max(height, 1.0) * max(width, 1.0)
            assert whole[W.fill] == pytest.approx(part[:, NODE.space].sum() / box)


def test_a_merge_stands_by_what_it_makes_and_by_its_pair() -> None:
    graph = make_example(plan(), rooms_of(plan()), 0.05, building="a", kind="x").graph
    tree, features, _ = grow_tree(graph, first_forest(), 0.0, Rest(), ALWAYS)
    wholes, pairs = np.linspace(-1, 1, len(features)), tree.odds[tree.regions :]
    assert (standing_odds(tree, wholes, 0.25, 0.0) == wholes).all()
    both = standing_odds(tree, wholes, 0.25, 2.0) - wholes
    assert both == pytest.approx(2 * (np.clip(pairs, -3, 3) - 0.25))
    # where the pairs outweigh all else, what they are surely against does not stand
    assert len(np.unique(best_cut(tree, standing_odds(tree, wholes, 5.0, 1e9)))) == tree.regions
