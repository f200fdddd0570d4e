"""Training the trees that judge frontiers and cells (`layoutexplore evaluate train-predictor`).

Plans of one building are trained on together or not at all. The cells are judged twice: the second forest
also learns from what the first one, trained on other buildings, thinks of the neighbourhood.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from layoutexplore.frontiers.classes import LITTLE_LEFT
from layoutexplore.grids.arrays import Floats, Floats32, Mask
from layoutexplore.models.forest import Forest
from layoutexplore.models.forest_files import save_forests
from layoutexplore.predictors.cell_model import features as cell_features
from layoutexplore.predictors.cell_model.features import add_first_estimate
from layoutexplore.predictors.frontier_model.features import FEATURES
from layoutexplore.predictors.learned import CELL_MODEL, FRONTIER_MODEL
from layoutexplore.training.boosting import BoostingConfig, fit_forest, mean_forest
from layoutexplore.training.folds import building_weights, deal_folds
from layoutexplore.training.predictor_samples import CellSamples, PredictorSamples


@dataclass(frozen=True, kw_only=True)
class PredictorForestConfig:
    """How the trees are grown.

    Attributes:
        trees: Trees of a forest that judges frontiers.
        leaves: Leaves of a tree.
        rate: Learning rate.
        feature_share: Share of the features that a split may choose from.
        generated_share: Share of the weight that frontiers of generated plans have, if there are others.
        doubtful: Buildings whose rooms are less certain: as many trees learn frontiers without them, too, and
            the mean of both judges. It is right where either is, which no weight of these buildings is.
        cell_trees: Trees of either forest that judges cells.
        cell_leaves: Leaves of one of these.
        cell_rate: Their learning rate.
        region_cells: Cells that are learnt from in one region of one decision.
        inner_folds: Folds of buildings in which the first judgement of cells is made for the second one to
            learn from.
    """

    trees: int = 200
    leaves: int = 24
    rate: float = 0.07
    feature_share: float = 0.3
    generated_share: float = 0.05
    doubtful: frozenset[str] = frozenset()
    cell_trees: int = 100
    cell_leaves: int = 31
    cell_rate: float = 0.12
    region_cells: int = 120
    inner_folds: int = 2


DEFAULT_TRAINING = PredictorForestConfig()


def fit_frontier_forests(
    samples: PredictorSamples, config: PredictorForestConfig = DEFAULT_TRAINING
) -> dict[str, Forest]:
    """Train "closed" and "leftover" (log-odds) and "area" (log of 1 + square metres)."""
    certain = samples.of_buildings(lambda name: name not in config.doubtful)
    parts = [part for part in (certain, samples) if len(part.closed)]
    if len(certain.closed) == len(samples.closed):
        parts = [samples]
    found = [_fit_frontiers(part, config) for part in parts]
    return {name: mean_forest([forests[name] for forests in found]) for name in found[0]}


def _fit_frontiers(samples: PredictorSamples, config: PredictorForestConfig) -> dict[str, Forest]:
    boosting = BoostingConfig(
        trees=config.trees,
        leaves=config.leaves,
        rate=config.rate,
        leaf_samples=20,
        feature_share=config.feature_share,
    )
    weights = _frontier_weights(samples, config.generated_share)
    targets = {
        "closed": samples.closed,
        "leftover": samples.closed & (samples.area < LITTLE_LEFT),
        "area": np.log1p(samples.area),
    }
    return {name: fit_forest(samples.features, target, boosting, weights) for name, target in targets.items()}


def fit_cell_forests(
    samples: PredictorSamples, config: PredictorForestConfig = DEFAULT_TRAINING
) -> dict[str, Forest]:
    """Train "first" and "inside" (log-odds), which say whether an unknown cell belongs to a room."""
    cells = [part for part in samples.cells if len(part.inside)]
    rng = np.random.default_rng(0)
    chosen = [_some_of_each_region(part, config.region_cells, rng) for part in cells]
    fold = deal_folds([part.building for part in cells], config.inner_folds, "name")
    judged: list[Floats32] = [part.candidates.features for part in cells]
    for k in range(config.inner_folds):
        others = [n for n, part in enumerate(cells) if fold[part.building] != k]
        if not others or len(others) == len(cells):
            continue
        forest = _fit_cells(
            [judged[n][chosen[n]] for n in others], [cells[n].inside[chosen[n]] for n in others], config
        )
        for n in set(range(len(cells))) - set(others):
            part = cells[n]
            judged[n] = add_first_estimate(
                part.candidates, forest.probability(part.candidates.features), part.resolution
            )
    truth = [part.inside[some] for part, some in zip(cells, chosen, strict=True)]
    first = _fit_cells(
        [part.candidates.features[some] for part, some in zip(cells, chosen, strict=True)], truth, config
    )
    return {
        "first": first,
        "inside": _fit_cells([f[some] for f, some in zip(judged, chosen, strict=True)], truth, config),
    }


def _some_of_each_region(part: CellSamples, most: int, rng: np.random.Generator) -> Mask:
    """Which cells bool (n,) to learn from: all of a small region, some of a large one."""
    count = np.bincount(part.candidates.region)[part.candidates.region]
    return rng.random(len(count)) * count < most


def _fit_cells(features: Sequence[Floats32], inside: Sequence[Mask], config: PredictorForestConfig) -> Forest:
    boosting = BoostingConfig(
        trees=config.cell_trees, leaves=config.cell_leaves, rate=config.cell_rate, leaf_samples=50
    )
    return fit_forest(np.concatenate(features), np.concatenate(inside), boosting)


def _frontier_weights(samples: PredictorSamples, generated_share: float) -> Floats:
    """Weights float64 (n,) of frontiers."""
    weights, generated = building_weights(samples.building), ~samples.real
    if generated.any() and samples.real.any():
        for some, share in ((generated, generated_share), (samples.real, 1.0 - generated_share)):
            weights[some] *= share * len(weights) / weights[some].sum()
    return weights


def train_models(
    samples: PredictorSamples,
    folder: Path,
    held_out: Mapping[str, str],
    config: PredictorForestConfig = DEFAULT_TRAINING,
) -> None:
    """Train the models and write them, with a list of what they have never seen, into a folder.

    Args:
        samples: What to learn from; where they hold no cells, only frontiers are learnt.
        folder: Made if need be.
        held_out: Building by plan, of the plans that the samples do not hold.
        config: How the trees are grown.
    """
    from layoutexplore.files import write_json

    note = f"{len(samples.closed)} frontiers of {len(np.unique(samples.building))} buildings"
    save_forests(folder / FRONTIER_MODEL.name, fit_frontier_forests(samples, config), FEATURES, note)
    count = sum(len(part.inside) for part in samples.cells)
    if samples.cells:
        forests = fit_cell_forests(samples, config)
        save_forests(folder / CELL_MODEL.name, forests, cell_features.FEATURES, f"{count} cells, {note}")
    listed = {"plans": sorted(held_out), "buildings": sorted(set(held_out.values()))}
    write_json(folder / "held_out.json", listed)
