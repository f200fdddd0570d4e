"""Training the classifier that merges regions into rooms, on maps whose rooms are known.

A map's regions are labelled by the room most of their cells lie in. The regions are merged in the order in
which the classifier trained so far would merge them, but only where that is right, and every pair looked at
on the way is a sample: so the classifier learns from the very unions it meets. Every building weighs the same
for each kind of map of it, unless a kind is given another weight, and the simulated maps together weigh three
quarters of what all real ones would without such weights.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from layoutexplore.errors import MapError
from layoutexplore.grids.arrays import Floats
from layoutexplore.layout.merging.agglomeration import training_samples
from layoutexplore.layout.merging.pair_features import FEATURES, OF_NETWORK
from layoutexplore.maps.painted_rooms import Case, read_case
from layoutexplore.models.forest import Forest
from layoutexplore.training.boosting import BoostingConfig, fit_forest, mean_forest, rounded_forest
from layoutexplore.training.explored_maps import explored_examples
from layoutexplore.training.folds import Progress, silent
from layoutexplore.training.merging_examples import SIMULATED, Example, make_example

RISING = (
    *("openness", "contact_share_small", "contact_share_large", "pass", "pass_ratio_small"),
    *("pass_ratio_large", "facing_small", "facing_large", "same_room", "room_overlap", "room_fit"),
    *("alike_near", "alike_far"),
)
FALLING = (
    *("line_near", "line_near_min", "line_far", "through", "door_share"),
    *("misalignment", "parted", "covered", "apart", "border"),
)
"""Features of which more can only speak for one room, or only against it: sane on unseen buildings too."""

LABEL, WEIGHT = -2, -1
"""Columns of a sample behind its features: 1 where the pair is one room, and the sample's weight."""

LEVELS = 200
"""A feature is known to so many quantiles: splits between them are not looked for."""


@dataclass(frozen=True, kw_only=True)
class MergingTrainingConfig:
    """How the classifier is trained.

    Attributes:
        rounds: Times the samples are collected, each with the classifier of the round before.
        forests: Forests of the last round; the classifier is their mean, which depends less on the seed
            than each of them.
        trees: Trees of a forest.
        leaves: Leaves of a tree.
        rate: Learning rate.
        features: Share of the features a split may choose from.
        simulated_weight: Weight of all simulated maps together over that of all real ones.
        kind_weights: Weight of a kind of map where it is not 1: the hardest kinds are the rarest.
        blind: Whether nothing is learnt of what the separator network says.
        seed: Of the features that splits may choose from.
    """

    rounds: int = 2
    forests: int = 3
    trees: int = 40
    leaves: int = 12
    rate: float = 0.18
    features: float = 0.5
    simulated_weight: float = 0.75
    kind_weights: Mapping[str, float] = field(default_factory=dict)
    blind: bool = False
    seed: int = 0


def first_forest() -> Forest:
    """The classifier of the first round: merge wide passes between regions that are open to each other."""
    return Forest(
        feature=np.array(
            [FEATURES.index("pass_ratio_small"), -1, -1, FEATURES.index("openness"), -1, -1], np.int32
        ),
        threshold=np.array([0.8, -1.0, 1.0, 0.8, -1.0, 1.0]),
        left=np.array([1, 0, 0, 4, 0, 0], np.int32),
        right=np.array([2, 0, 0, 5, 0, 0], np.int32),
        roots=np.array([0, 3], np.int32),
        bias=0.0,
    )


def train_forest(examples: Sequence[Example], config: MergingTrainingConfig | None = None) -> Forest:
    """Train a classifier.

    Args:
        examples: Maps of at least one building.
        config: The options.

    Raises:
        MapError: Every map is a single region: there is nothing to merge.
    """
    config = config or MergingTrainingConfig()
    forest, samples, keys = first_forest(), [], []
    for k in range(config.rounds):
        for example in examples:
            samples.append(training_samples(example.graph, forest, example.rooms))
            keys.append(kind_of(example))
        if not any(map(len, samples)):
            raise MapError("nothing to train on: no map falls into two regions beside each other")
        table, weights = _quantised(np.vstack(samples)), _weights(samples, keys, config)
        if config.blind:
            table[:, [FEATURES.index(name) for name in OF_NETWORK]] = 0.0
        count = config.forests if k == config.rounds - 1 else 1
        forest = mean_forest([_fit(table, weights, config, 1000 * config.seed + n) for n in range(count)])
    return forest


def kind_of(example: Example) -> tuple[str, str]:
    """Building and kind of a map, which share one weight; all simulated maps are of one kind."""
    return example.building, "" if example.building == SIMULATED else example.kind


def kind_scales(
    keys: Iterable[tuple[str, str]], config: MergingTrainingConfig
) -> dict[tuple[str, str], float]:
    """The weight that all maps of a building and kind have together."""
    known = dict.fromkeys(keys)
    real = max(sum(building != SIMULATED for building, _ in known), 1)
    return {
        (building, kind): config.simulated_weight * real
        if building == SIMULATED
        else config.kind_weights.get(kind, 1.0)
        for building, kind in known
    }


def _weights(samples: list[Floats], keys: list[tuple[str, str]], config: MergingTrainingConfig) -> Floats:
    totals: dict[tuple[str, str], float] = {}
    for part, key in zip(samples, keys, strict=True):
        totals[key] = totals.get(key, 0.0) + float(part[:, WEIGHT].sum())
    scale = kind_scales(totals, config)
    weights = np.concatenate(
        [p[:, WEIGHT] * scale[k] / max(totals[k], 1e-9) for p, k in zip(samples, keys, strict=True)]
    )
    return np.asarray(weights * len(weights) / max(float(weights.sum()), 1e-9))


def _quantised(table: Floats) -> Floats:
    """Samples with few different values of a feature, each that of the middle between two quantiles.

    Scikit-learn finds its bins in no time then; weighted ones of many values take it ten times as long as the
    trees.
    """
    table = np.asfortranarray(table)
    for k in range(len(FEATURES)):
        values = table[:, k]
        levels = np.unique(np.quantile(values, np.linspace(0, 1, LEVELS + 1)))
        if len(levels) > 2:
            at = np.clip(np.searchsorted(levels, values, side="right") - 1, 0, len(levels) - 2)
            middle = 0.5 * (levels[at] + levels[at + 1])
            table[:, k] = np.where(
                values >= levels[-1], levels[-1], np.where(values <= levels[0], levels[0], middle)
            )
    return table


def _fit(table: Floats, weights: Floats, config: MergingTrainingConfig, seed: int) -> Forest:
    boosting = BoostingConfig(
        trees=config.trees,
        leaves=config.leaves,
        rate=config.rate,
        leaf_samples=30,
        penalty=5.0,
        feature_share=config.features,
        monotonic=tuple(int(f in RISING) - int(f in FALLING) for f in FEATURES),
        seed=seed,
    )
    features, is_one_room = table[:, : len(FEATURES)], table[:, LABEL] > 0.5
    return rounded_forest(fit_forest(features, is_one_room, boosting, weights, double=True))


EXPLORED = 2
"""So many maps of a building and folder are explored to train on."""


def training_examples(cases: Sequence[Case], resolution: float, progress: Progress = silent) -> list[Example]:
    """What the classifier learns from the maps, and from some of them while being explored.

    Of each building and folder, the largest `EXPLORED` maps are explored.

    Args:
        cases: The maps.
        resolution: Metres a pixel where a map's folder does not say it.
        progress: Told of the maps done.
    """
    examples, largest = [], _largest(cases, resolution)
    for k, case in enumerate(cases):
        grid, truth, _ = read_case(case, resolution)
        scale, building, kind = grid.resolution, case.building, case.folder
        examples.append(make_example(grid.cells, truth, scale, building=building, kind=kind))
        if case in largest:
            rng = np.random.default_rng([1, k])
            examples += explored_examples(grid.cells, truth, scale, building=building, kind=kind, rng=rng)
        progress("maps cut into regions", k + 1, len(cases))
    return examples


def _largest(cases: Sequence[Case], resolution: float) -> set[Case]:
    groups: dict[tuple[str, str], list[tuple[int, int]]] = {}
    for k, case in enumerate(cases):
        known = int(np.count_nonzero(read_case(case, resolution)[0].free))
        groups.setdefault((case.building, case.folder), []).append((-known, k))
    return {cases[k] for group in groups.values() for _, k in sorted(group)[:EXPLORED]}
