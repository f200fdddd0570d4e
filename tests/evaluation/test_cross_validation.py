"""Judges that are cross-validated never learn from what they are scored on."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest

from layoutexplore.evaluation.cross_validation import CrossValidationConfig, cross_validate_merging
from layoutexplore.layout.merging.merge_tree.cut import MergingModels
from layoutexplore.maps.painted_rooms import find_cases
from layoutexplore.training.merging_examples import Example
from layoutexplore.training.room_merging import MergingTrainingConfig, first_forest
from tests.maps.test_painted_rooms import paint


def test_simulated_maps_of_a_building_that_is_held_out_are_not_learnt_from(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    learnt: list[tuple[set[str], set[str]]] = []

    def spy(
        recorded: Sequence[Example],
        simulated: Sequence[tuple[Example, Example]],
        polygonal: Sequence[Example],
        config: MergingTrainingConfig,
    ) -> MergingModels:
        learnt.append(({e.building for e in recorded}, {e.kind for pair in simulated for e in pair}))
        return MergingModels(first_forest())

    monkeypatch.setattr("layoutexplore.evaluation.cross_validation.train_all_models", spy)
    for k, name in enumerate(("flat", "barn")):
        paint(tmp_path, name, 40 + 4 * k)
    cases = find_cases([tmp_path], {"flat": "apartment-01"})
    config = CrossValidationConfig(
        folds=2, protocol="rose2", resolution=0.05, simulated=3, plans=("apartment-01",)
    )
    scored = {case.building: row.fold for case, row, _ in cross_validate_merging(cases, config)}
    assert set(scored) == {"apartment-01", "barn"}
    recorded, simulated = learnt[scored["apartment-01"]]
    assert recorded == {"barn"} and simulated and "apartment-01" not in simulated
    recorded, simulated = learnt[scored["barn"]]
    assert recorded == {"apartment-01"} and "apartment-01" in simulated
