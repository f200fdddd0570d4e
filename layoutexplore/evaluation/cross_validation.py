"""The default method judged on buildings that its judge of merges has never seen.

The buildings are dealt into folds; for each fold the judge is trained on the maps of all the others, and on maps
simulated from generated floor plans, and the method is scored on the fold.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from layoutexplore.errors import ConfigError
from layoutexplore.evaluation.segmentation import Case, MapScore, read_case, score_case
from layoutexplore.evaluation.simulated_maps import simulated_examples
from layoutexplore.grid import OccupancyGrid
from layoutexplore.layout.default import DefaultConfig, reconstruct_with
from layoutexplore.layout.merging import Forest
from layoutexplore.layout.merging_training import Example, make_example, train_forest
from layoutexplore.layout.types import Layout


def deal_folds(cases: Sequence[Case], folds: int) -> dict[str, int]:
    """A fold for each building: the buildings with most maps first, each into the fold with the fewest maps.

    Raises:
        ConfigError: Fewer than two folds or fewer buildings than folds.
    """
    counts: dict[str, int] = {}
    for case in cases:
        counts[case.building] = counts.get(case.building, 0) + 1
    if not 2 <= folds <= len(counts):
        raise ConfigError(f"{folds} folds need at least 2 and at most one a building, got {len(counts)} buildings")
    sizes, dealt = [0] * folds, {}
    for building in sorted(counts, key=lambda b: (-counts[b], b)):
        dealt[building] = sizes.index(min(sizes))
        sizes[dealt[building]] += counts[building]
    return dealt


def training_examples(cases: Sequence[Case], resolution: float) -> list[Example]:
    """What the judge learns from the maps."""
    examples = []
    for case in cases:
        grid, truth, _ = read_case(case, resolution)
        examples.append(make_example(grid.cells, truth, resolution, building=case.building, kind=case.folder))
    return examples


def cross_validate(
    cases: Sequence[Case], folds: int, *, protocol: str, resolution: float, simulated: int, plans: Sequence[str] = ()
) -> Iterator[tuple[Case, MapScore, NDArray[np.int32]]]:
    """Score the default method on every map with a judge that has not seen its building.

    Args:
        cases: The maps.
        folds: Number of folds.
        protocol: Of `layoutexplore.segmentation_metrics.PROTOCOLS`.
        resolution: Metres a pixel.
        simulated: Number of simulated maps to train on besides.
        plans: Floor plans to simulate maps of, besides generated ones.
    """
    dealt = deal_folds(cases, folds)
    extra = simulated_examples(simulated, tuple(plans))
    examples = training_examples(cases, resolution)
    for fold in range(folds):
        forest = train_forest([*(e for e in examples if dealt[e.building] != fold), *extra])

        def run(grid: OccupancyGrid, forest: Forest = forest) -> Layout:
            return reconstruct_with(grid, DefaultConfig(), forest)

        for case in cases:
            if dealt[case.building] == fold:
                row, layout = score_case(case, "default", protocol=protocol, resolution=resolution, run=run)
                yield case, MapScore(**{**row.__dict__, "fold": fold}), layout.labels


def train_judge(cases: Sequence[Case], *, resolution: float, simulated: int, plans: Sequence[str] = ()) -> Forest:
    """The judge that ships: trained on all given maps and on simulated ones."""
    return train_forest([*training_examples(cases, resolution), *simulated_examples(simulated, tuple(plans))])
