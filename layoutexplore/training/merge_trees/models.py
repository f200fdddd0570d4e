"""Training both classifiers of the merging method, on maps whose rooms are known.

So that the trees of merges err as they do on maps of other buildings, the pairs of a half of the buildings
are judged by a classifier trained on the other half.
"""

from __future__ import annotations

import zlib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from layoutexplore.layout.merging.merge_tree.cut import MergingModels
from layoutexplore.layout.merging.merge_tree.features import TREE_FEATURES, TREE_OF_NETWORK
from layoutexplore.maps.painted_rooms import Case
from layoutexplore.models.forest import Forest
from layoutexplore.training.boosting import BoostingConfig, fit_mean_forest, mean_forest
from layoutexplore.training.folds import Progress, silent
from layoutexplore.training.map_noise.examples import POLYGONAL, polygonal_examples, weathered_pairs
from layoutexplore.training.merge_trees.samples import TreeSamples, tree_samples
from layoutexplore.training.merging_examples import SIMULATED, Example
from layoutexplore.training.room_merging import (
    MergingTrainingConfig,
    kind_of,
    kind_scales,
    train_forest,
    training_examples,
)

GROWTH = BoostingConfig(trees=80, leaves=12, rate=0.12, leaf_samples=30, penalty=5.0, feature_share=0.4)
"""How the trees of each forest are grown."""


def train_merging_models(
    examples: Sequence[Example], config: MergingTrainingConfig | None = None
) -> MergingModels:
    """Both classifiers of the method: of pairs, and of merges.

    Args:
        examples: Maps of at least one building.
        config: How that of the pairs is trained; that of the merges takes its weights and its seed.
    """
    config = config or MergingTrainingConfig()
    pairs = train_forest(examples, config)
    halves = [_half(example) for example in examples]
    samples, keys = [], []
    for half in range(2):
        mine = [e for e, h in zip(examples, halves, strict=True) if h == half]
        others = [e for e, h in zip(examples, halves, strict=True) if h != half]
        # of one building there is no other half: better a flattering tree than none
        other = replace(config, seed=config.seed + 1 + half, forests=2)
        forest = train_forest(others, other) if others else pairs
        samples += [tree_samples(example, forest) for example in mine]
        keys += [kind_of(example) for example in mine]
    return MergingModels(pairs, _train_cut(samples, keys, config))


def train_all_models(
    recorded: Sequence[Example],
    simulated: Sequence[tuple[Example, Example]],
    polygonal: Sequence[Example],
    config: MergingTrainingConfig,
) -> MergingModels:
    """The models that ship: for most maps, for maps with a wing askew, and for other maps with ragged walls.

    Those for ragged walls are means of two, of which one has learnt what the separator network says and one
    has not: the network is surer of simulated maps than of recorded ones. The others have not learnt it.

    Args:
        recorded: Maps whose rooms are known.
        simulated: Simulated maps, and what takes their place beside the network: see `weathered_pairs`.
        polygonal: Maps that those for wings askew learn from, too; without such maps there are none.
        config: How; whether a model is blind is decided here.
    """
    blind = replace(config, blind=True)
    examples = [*recorded, *(example for example, _ in simulated)]
    models = train_merging_models(examples, blind)
    seeing = train_merging_models([*recorded, *(weathered for _, weathered in simulated)], config)
    askew = train_merging_models([*examples, *polygonal], blind) if polygonal else None
    return replace(models, askew=askew, ragged=mean_models([models, seeing]))


def mean_models(several: Sequence[MergingModels]) -> MergingModels:
    """The classifiers whose log-odds are the means of those of others."""
    cuts = [models.cut for models in several if models.cut is not None]
    return MergingModels(
        mean_forest([models.pairs for models in several]), mean_forest(cuts) if cuts else None
    )


def _half(example: Example) -> int:
    """Which half of the buildings a map is of; simulated maps by their plans."""
    name = example.kind if example.building == SIMULATED else example.building
    return zlib.crc32(name.encode()) % 2


def _train_cut(
    samples: Sequence[TreeSamples], keys: Sequence[tuple[str, str]], config: MergingTrainingConfig
) -> Forest | None:
    """The classifier of merges; None where all of them stand, or none does."""
    scales, maps = kind_scales(keys, config), Counter(keys)
    features, worth = (
        np.concatenate([getattr(part, name) for part in samples]) for name in ("features", "worth")
    )
    weights = np.concatenate(
        [part.weights * scales[key] / maps[key] for part, key in zip(samples, keys, strict=True)]
    )
    stands = worth > 0
    if not len(stands) or stands.all() or not stands.any():
        return None
    if config.blind:
        features[:, [TREE_FEATURES.index(name) for name in TREE_OF_NETWORK]] = 0.0
    growth = replace(GROWTH, seed=config.seed)
    return fit_mean_forest(features, stands, growth, weights / weights.mean(), config.forests)


def train_classifiers(
    cases: Sequence[Case],
    *,
    resolution: float,
    simulated: int,
    plans: Sequence[str] = (),
    seed: int = 0,
    weights: Mapping[str, float] | None = None,
    progress: Progress = silent,
) -> MergingModels:
    """The classifiers that ship, of all given and simulated maps; `weights` as in `CrossValidationConfig`."""
    examples = training_examples(cases, resolution, progress)
    pairs = weathered_pairs(simulated, tuple(plans), progress=progress)
    polygonal = polygonal_examples(simulated // POLYGONAL, progress=progress)
    training = MergingTrainingConfig(seed=seed, kind_weights=weights or {})
    return train_all_models(examples, pairs, polygonal, training)
