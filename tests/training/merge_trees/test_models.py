"""Training what cuts the tree of merges."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from layoutexplore.grids.grid import OccupancyGrid
from layoutexplore.layout.merging.agglomeration import grow_tree
from layoutexplore.layout.merging.graph_tables import RegionGraph
from layoutexplore.layout.merging.merge_tree.contest import Rest
from layoutexplore.layout.merging.merge_tree.features import TREE_FEATURES, TREE_OF_NETWORK, MergeTree
from layoutexplore.layout.merging.method import MergingConfig, reconstruct_with
from layoutexplore.layout.merging.pair_features import FEATURES, OF_NETWORK
from layoutexplore.training.merge_trees.models import train_all_models, train_merging_models
from layoutexplore.training.merge_trees.samples import tree_samples, worth_of_merges
from layoutexplore.training.merging_examples import make_example
from layoutexplore.training.room_merging import MergingTrainingConfig, first_forest
from tests.layout.merging.cases import boxed, graphs, plan, rooms_of


def best_value(tree: MergeTree, node: int, rooms: np.ndarray, *, whole: bool = True) -> float:
    """The most that rooms made of a node's parts are worth, or of the parts of its two children."""

    def inside(k: int) -> list[int]:
        return [k] if k < tree.regions else [r for child in tree.children[k] for r in inside(int(child))]

    counts = rooms[inside(node)].sum(axis=0)
    fits = [counts[g] / (counts.sum() + rooms[:, g].sum() - counts[g]) for g in range(1, rooms.shape[1])]
    own = max([0.0, *(f for f in fits if np.isfinite(f))]) * counts.sum() if counts.sum() >= 3 else 0.0
    parts = (best_value(tree, int(k), rooms) for k in tree.children[node]) if node >= tree.regions else ()
    split = float(sum(parts))
    return (max(own, split) if node >= tree.regions else own) if whole else own - split


@settings(max_examples=20, deadline=None)
@given(graphs().map(boxed), st.integers(0, 10**6))
def test_a_merge_is_worth_what_it_adds_to_the_best_rooms_of_its_parts(graph: RegionGraph, seed: int) -> None:
    tree, _, _ = grow_tree(graph, first_forest(), 0.0, Rest(), float("-inf"))
    rooms = np.random.default_rng(seed).integers(1, 6, (len(graph.nodes), 4)).astype(np.float64)
    rooms[0] = 0.0
    worth = worth_of_merges(tree, rooms, 1.0, 3.0)
    for k, found in enumerate(worth, start=tree.regions):
        assert found == pytest.approx(best_value(tree, k, rooms, whole=False))


def test_what_is_one_room_stays_one_and_what_is_not_is_cut() -> None:
    rooms = rooms_of(plan())
    parted = make_example(plan(), rooms, 0.05, building="a", kind="x")
    samples = tree_samples(parted, replace(first_forest(), bias=9.0))
    assert len(samples.worth) and (samples.worth < 0).any() and samples.weights.sum() == pytest.approx(1)
    config = MergingTrainingConfig(rounds=1, forests=1, trees=4, leaves=4)
    whole = make_example(plan(), np.minimum(rooms, 1), 0.05, building="b", kind="x")
    models = train_merging_models([parted, whole] * 8, config)
    assert models.pairs.roots.size and models.cut is not None
    again = train_merging_models([parted, whole] * 8, config)
    assert again.cut is not None and (again.cut.threshold == models.cut.threshold).all()
    layout = reconstruct_with(OccupancyGrid(plan(), 0.05), MergingConfig(), models)
    assert 1 <= len(layout.rooms) <= 3
    # all of the plan is one room, whatever merges: there is no cut to learn
    assert train_merging_models([whole], config).cut is None


def test_models_for_ragged_walls_are_the_mean_of_those_that_see_the_network_and_those_that_do_not() -> None:
    rooms = rooms_of(plan())
    parted = make_example(plan(), rooms, 0.05, building="a", kind="x")
    whole = make_example(plan(), np.minimum(rooms, 1), 0.05, building="b", kind="x")
    config = MergingTrainingConfig(rounds=1, forests=1, trees=4, leaves=4)
    models = train_all_models([parted, whole] * 7, [(parted, whole), (whole, whole)], [], config)
    assert models.askew is None and models.ragged is not None
    assert models.cut is not None and models.ragged.cut is not None
    assert len(models.ragged.pairs.roots) == 2 * len(models.pairs.roots)
    of_pairs = {FEATURES.index(name) for name in OF_NETWORK}
    of_merges = {TREE_FEATURES.index(name) for name in TREE_OF_NETWORK}
    assert not of_pairs & {*models.pairs.feature.tolist()}
    assert not of_merges & {*models.cut.feature.tolist()}
    # the first half of the trees are those that do not
    half = len(models.pairs.feature)
    assert (models.ragged.pairs.feature[:half] == models.pairs.feature).all()
    assert models.ragged.pairs.threshold[:half] == pytest.approx(
        np.where(models.pairs.feature < 0, models.pairs.threshold / 2, models.pairs.threshold)
    )
