"""Trainings that are watched, not made."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import pytest

from layoutexplore.layout.merging.merge_tree.cut import MergingModels
from layoutexplore.training.merging_examples import Example
from layoutexplore.training.room_merging import MergingTrainingConfig, first_forest


class LearntFrom(NamedTuple):
    """What one training of a cross-validation was given."""

    recorded: Sequence[Example]
    simulated: Sequence[tuple[Example, Example]]
    polygonal: Sequence[Example]


def watch_merging_trainings(monkeypatch: pytest.MonkeyPatch) -> list[LearntFrom]:
    """What each training is given, as it comes; none takes place."""
    learnt: list[LearntFrom] = []

    def watch(
        recorded: Sequence[Example],
        simulated: Sequence[tuple[Example, Example]],
        polygonal: Sequence[Example],
        config: MergingTrainingConfig,
    ) -> MergingModels:
        learnt.append(LearntFrom(recorded, simulated, polygonal))
        return MergingModels(first_forest())

    monkeypatch.setattr("layoutexplore.evaluation.cross_validation.train_all_models", watch)
    return learnt
