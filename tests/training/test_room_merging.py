"""Training the forest that merges regions into rooms."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from layoutexplore.errors import MapError
from layoutexplore.layout.merging.agglomeration import merge_within
from layoutexplore.layout.merging.merge_forest import PAIR_FOREST
from layoutexplore.layout.pipeline import reconstruct
from layoutexplore.training.boosting import mean_forest
from layoutexplore.training.merging_examples import make_example
from layoutexplore.training.room_merging import MergingTrainingConfig, train_forest
from tests.layout.merging.cases import office, plan, rooms_of


def test_a_judge_can_be_trained_stored_and_read(tmp_path: Path) -> None:
    grid = office(clutter=True)
    truth = reconstruct(office()).labels
    example = make_example(grid.cells, truth, 0.05, building="a", kind="x")
    forest = train_forest([example, example], MergingTrainingConfig(rounds=1, trees=5, leaves=4))
    PAIR_FOREST.save(forest, tmp_path / "model.json", note="test")
    again = PAIR_FOREST.load(tmp_path / "model.json")
    assert (again.feature == forest.feature).all()
    assert (again.threshold == forest.threshold).all()
    assert again.bias == forest.bias
    assert (merge_within(example.graph, again)[0] == merge_within(example.graph, forest)[0]).all()


def test_kinds_of_maps_weigh_what_they_are_given() -> None:
    rooms = rooms_of(plan())
    parted = make_example(plan(), rooms, 0.05, building="a", kind="parted")  # no two regions are one room
    whole = make_example(plan(), np.minimum(rooms, 1), 0.05, building="a", kind="whole")  # all are
    for weights in ({}, {"whole": 4.0}, {"whole": 0.5, "parted": 2.0}):
        forest = train_forest(
            [parted, whole], MergingTrainingConfig(rounds=1, forests=1, trees=2, kind_weights=weights)
        )
        assert forest.bias == pytest.approx(
            np.log(weights.get("whole", 1.0) / weights.get("parted", 1.0)), abs=1e-5
        )


def test_a_single_region_teaches_nothing() -> None:
    cells = np.full((40, 40), 100, np.int8)
    cells[5:35, 5:35] = 0
    with pytest.raises(MapError, match="nothing to train on"):
        train_forest([make_example(cells, (cells == 0).astype(np.int32), 0.05, building="a", kind="x")])


def test_the_mean_of_judges_is_a_judge() -> None:
    example = make_example(plan(), rooms_of(plan()), 0.05, building="a", kind="x")
    config = MergingTrainingConfig(rounds=1, forests=1, trees=4, leaves=4)
    one, other = (
        train_forest([example, example], MergingTrainingConfig(**{**config.__dict__, "seed": s}))
        for s in (0, 1)
    )
    both = mean_forest([one, other])
    assert len(both.roots) == 8 and both.bias == pytest.approx((one.bias + other.bias) / 2)
    assert (merge_within(example.graph, mean_forest([one]))[0] == merge_within(example.graph, one)[0]).all()
    again = train_forest([example, example], config)
    assert (again.threshold == one.threshold).all()
