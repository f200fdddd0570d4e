"""The method `default` scored on buildings that its classifier has never seen.

The buildings are dealt into folds; for each fold the classifier is trained on the maps of all the others, on
these maps while being explored, and on maps simulated from floor plans, and the method is scored on the fold.
Training takes chance: with several seeds, the spread of the means over the seeds is what a difference between
two trainings has to exceed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from layoutexplore.evaluation.segmentation import MapScore, score_case
from layoutexplore.grids.arrays import Ints32
from layoutexplore.grids.grid import OccupancyGrid
from layoutexplore.layout.merging.method import MergingConfig, reconstruct_with
from layoutexplore.layout.types import Layout
from layoutexplore.maps.painted_rooms import Case
from layoutexplore.models.forest import Forest
from layoutexplore.training.folds import Progress, check_folds, deal_folds, silent
from layoutexplore.training.room_merging import MergingTrainingConfig, train_forest, training_examples
from layoutexplore.training.simulated_maps import simulated_examples


@dataclass(frozen=True, kw_only=True)
class CrossValidationConfig:
    """How the default method is cross-validated.

    Attributes:
        folds: Number of folds.
        protocol: Of `layoutexplore.metrics.segmentation.PROTOCOLS`.
        resolution: Metres a pixel.
        simulated: Number of simulated maps to train on besides.
        plans: Floor plans to simulate maps of, besides generated ones.
        seeds: The classifiers are trained so many times, with seeds 0, 1, ...
        weights: Weight in training of a folder's maps where it is not 1.
    """

    folds: int
    protocol: str
    resolution: float
    simulated: int
    plans: tuple[str, ...] = ()
    seeds: int = 1
    weights: Mapping[str, float] = field(default_factory=dict)


def cross_validate_merging(
    cases: Sequence[Case], config: CrossValidationConfig, progress: Progress = silent
) -> Iterator[tuple[Case, MapScore, Ints32]]:
    """Score the method on every map with a classifier that has not seen its building, once for each seed.

    Args:
        cases: The maps.
        config: How.
        progress: Told of what takes long.
    """
    check_folds(config.folds, [case.building for case in cases])
    dealt = deal_folds([case.building for case in cases], config.folds)
    examples = training_examples(cases, config.resolution, progress)
    extra = simulated_examples(config.simulated, config.plans, progress=progress)
    for seed in range(config.seeds):
        for fold in range(config.folds):
            training = MergingTrainingConfig(seed=seed, kind_weights=config.weights)
            forest = train_forest([*(e for e in examples if dealt[e.building] != fold), *extra], training)
            progress("judges trained", seed * config.folds + fold + 1, config.seeds * config.folds)

            def run(grid: OccupancyGrid, forest: Forest = forest) -> Layout:
                return reconstruct_with(grid, MergingConfig(), forest)

            for case in cases:
                if dealt[case.building] == fold:
                    row, layout = score_case(
                        case, "default", protocol=config.protocol, resolution=config.resolution, run=run
                    )
                    yield case, replace(row, fold=fold, seed=seed), layout.labels
