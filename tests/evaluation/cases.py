"""Trainings that are watched, not made."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import NamedTuple

import pytest

from layoutexplore.layout.merging.merge_tree.cut import MergingModels
from layoutexplore.training.folds import Progress
from layoutexplore.training.map_noise.examples import polygonal_examples, weathered_pairs
from layoutexplore.training.merging_examples import Example
from layoutexplore.training.room_merging import MergingTrainingConfig, first_forest


class LearntFrom(NamedTuple):
    """What one training of a cross-validation was given."""

    recorded: Sequence[Example]
    simulated: Sequence[tuple[Example, Example]]
    polygonal: Sequence[Example]


_pairs, _polygonal = functools.cache(weathered_pairs), functools.cache(polygonal_examples)


def watch_merging_trainings(monkeypatch: pytest.MonkeyPatch) -> list[LearntFrom]:
    """What each training is given, as it comes; none takes place, and what is simulated is made once."""
    learnt: list[LearntFrom] = []

    def watch(
        recorded: Sequence[Example],
        simulated: Sequence[tuple[Example, Example]],
        polygonal: Sequence[Example],
        config: MergingTrainingConfig,
    ) -> MergingModels:
        learnt.append(LearntFrom(recorded, simulated, polygonal))
        return MergingModels(first_forest())

    def pairs(count: int, plans: tuple[str, ...], progress: Progress) -> Sequence[tuple[Example, Example]]:
        return _pairs(count, plans)

    def polygonal_ones(count: int, progress: Progress) -> Sequence[Example]:
        return _polygonal(count)

    for name, make in (("weathered_pairs", pairs), ("polygonal_examples", polygonal_ones)):
        monkeypatch.setattr(f"layoutexplore.evaluation.cross_validation.{name}", make)
    monkeypatch.setattr("layoutexplore.evaluation.cross_validation.train_all_models", watch)
    return learnt
