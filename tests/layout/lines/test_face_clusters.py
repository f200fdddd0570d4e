"""Faces that become rooms: clusters, their numbers, their graph."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.cluster import DBSCAN

from layoutexplore.layout.lines.face_clusters import (
    FaceGraph,
    cluster_faces,
    dissolve,
    face_graph,
    merge_small,
    renumber,
)
from tests.layout.lines.cases import arrangement_of, lines, seeds


@settings(max_examples=40, deadline=None)
@given(st.lists(st.integers(-1, 6), max_size=20))
def test_groups_are_renumbered_by_first_appearance(group: list[int]) -> None:
    names: list[int] = []
    for g in group:
        if g >= 0 and g not in names:
            names.append(g)
    assert renumber(np.array(group, np.int64)).tolist() == [names.index(g) if g >= 0 else -1 for g in group]


@given(lines, seeds)
@settings(max_examples=30, deadline=None)
def test_face_graph_measures_common_boundaries(drawn, seed):
    arrangement = arrangement_of(drawn)
    rng = np.random.default_rng(seed)
    group, count = dissolve(arrangement, rng.random(len(arrangement.line)) < 0.3)
    covered = rng.random(len(arrangement.line)) * arrangement.edge_length
    graph = face_graph(arrangement, covered, group, count)
    expected = {}
    for (a, b), length, cover in zip(arrangement.sides, arrangement.edge_length, covered, strict=True):
        if a >= 0 and b >= 0 and group[a] != group[b]:
            pair = tuple(sorted((int(group[a]), int(group[b]))))
            total = expected.setdefault(pair, [0.0, 0.0])
            total[0] += length
            total[1] += cover
    found = zip(graph.first.tolist(), graph.second.tolist(), strict=True)
    assert {p: (pytest.approx(v[0]), pytest.approx(v[1])) for p, v in expected.items()} == {
        p: (a, b) for p, a, b in zip(found, graph.length, graph.covered, strict=True)
    }


@given(seeds)
@settings(max_examples=40, deadline=None)
def test_face_clusters_are_those_of_dbscan(seed):
    rng = np.random.default_rng(seed)
    n = 12
    pairs = np.array([p for p in itertools.combinations(range(n), 2) if rng.random() < 0.3]).reshape(-1, 2)
    length = rng.uniform(0.5, 2, len(pairs))
    graph = FaceGraph(
        first=pairs[:, 0], second=pairs[:, 1], length=length, covered=length * rng.random(len(pairs)) * 0.4
    )
    inside = rng.random(n) < 0.8
    affinity = np.eye(n)
    for (a, b), weight in zip(pairs, graph.weight, strict=True):
        affinity[a, b] = affinity[b, a] = np.exp(-weight / 0.125)
    kept = affinity[np.ix_(inside, inside)]
    kept = kept / kept.sum(axis=1, keepdims=True)
    room = cluster_faces(graph, inside, 0.125, 0.15)
    assert (room[~inside] == -1).all()
    if inside.any():
        distance = np.maximum(1 - (kept + kept.T) / 2, 0)
        expected = DBSCAN(eps=0.85, min_samples=1, metric="precomputed").fit_predict(distance)
        assert np.array_equal(room[inside], renumber(expected))


def test_small_rooms_join_the_most_open_neighbour():
    graph = FaceGraph(
        first=np.array([0, 1, 1]),
        second=np.array([1, 2, 3]),
        length=np.array([2.0, 2.0, 2.0]),
        covered=np.array([1.5, 0.5, 2.0]),
    )
    room = merge_small(np.array([0, 1, 2, 3]), graph, np.array([9.0, 1.0, 9.0, 1.0]), 2.0)
    assert room.tolist() == [0, 1, 1, -1]
