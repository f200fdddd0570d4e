"""The default method judged on buildings that its judge of merges has never seen.

The buildings are dealt into folds; for each fold the judge is trained on the maps of all the others, on these
maps while being explored, and on maps simulated from floor plans, and the method is scored on the fold.
Training takes chance: with several seeds, the spread of the means over the seeds is what a difference between
two trainings has to exceed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from layoutexplore.errors import ConfigError
from layoutexplore.evaluation.segmentation import Case, MapScore, read_case, score_case
from layoutexplore.grids.grid import OccupancyGrid
from layoutexplore.layout.merging.method import DefaultConfig, reconstruct_with
from layoutexplore.layout.types import Layout
from layoutexplore.models.forest import Forest
from layoutexplore.training.explored_maps import explored_examples
from layoutexplore.training.room_merging import Example, TrainingConfig, make_example, train_forest
from layoutexplore.training.simulated_maps import simulated_examples

EXPLORED = 2
"""So many maps of a building and folder are explored to train on."""


def deal_folds(cases: Sequence[Case], folds: int) -> dict[str, int]:
    """A fold for each building: the buildings with most maps first, each into the fold with the fewest maps.

    Raises:
        ConfigError: Fewer than two folds or fewer buildings than folds.
    """
    counts: dict[str, int] = {}
    for case in cases:
        counts[case.building] = counts.get(case.building, 0) + 1
    if not 2 <= folds <= len(counts):
        raise ConfigError(
            f"folds must be at least 2 and at most one a building: got {folds} for {len(counts)} building(s)"
        )
    sizes, dealt = [0] * folds, {}
    for building in sorted(counts, key=lambda b: (-counts[b], b)):
        dealt[building] = sizes.index(min(sizes))
        sizes[dealt[building]] += counts[building]
    return dealt


Progress = Callable[[str, int, int], None]
"""Told what is being done, how often it has been done, and how often it will be."""


def _silent(what: str, done: int, total: int) -> None:
    """Progress that nobody looks at."""


def training_examples(
    cases: Sequence[Case], resolution: float, progress: Progress = _silent
) -> list[Example]:
    """What the judge learns from the maps, and from some of them while being explored.

    Of each building and folder, the largest `EXPLORED` maps are explored.
    """
    examples, largest = [], _largest(cases, resolution)
    for k, case in enumerate(cases):
        grid, truth, _ = read_case(case, resolution)
        examples.append(make_example(grid.cells, truth, resolution, building=case.building, kind=case.folder))
        if case in largest:
            rng = np.random.default_rng([1, k])
            examples += explored_examples(
                grid.cells, truth, resolution, building=case.building, kind=case.folder, rng=rng
            )
        progress("maps cut into pieces", k + 1, len(cases))
    return examples


def _largest(cases: Sequence[Case], resolution: float) -> set[Case]:
    groups: dict[tuple[str, str], list[tuple[int, int]]] = {}
    for k, case in enumerate(cases):
        known = int(np.count_nonzero(read_case(case, resolution)[0].free))
        groups.setdefault((case.building, case.folder), []).append((-known, k))
    return {cases[k] for group in groups.values() for _, k in sorted(group)[:EXPLORED]}


def cross_validate(
    cases: Sequence[Case],
    folds: int,
    *,
    protocol: str,
    resolution: float,
    simulated: int,
    plans: Sequence[str] = (),
    seeds: int = 1,
    weights: Mapping[str, float] | None = None,
    progress: Progress = _silent,
) -> Iterator[tuple[Case, MapScore, NDArray[np.int32]]]:
    """Score the default method on every map with a judge that has not seen its building, once for each seed.

    Args:
        cases: The maps.
        folds: Number of folds.
        protocol: Of `layoutexplore.metrics.segmentation.PROTOCOLS`.
        resolution: Metres a pixel.
        simulated: Number of simulated maps to train on besides.
        plans: Floor plans to simulate maps of, besides generated ones.
        seeds: The judges are trained so many times, with seeds 0, 1, ...
        weights: Weight in training of a folder's maps where it is not 1.
        progress: Told of what takes long.
    """
    dealt = deal_folds(cases, folds)
    examples = training_examples(cases, resolution, progress)
    extra = simulated_examples(simulated, tuple(plans), progress=progress)
    for seed in range(seeds):
        for fold in range(folds):
            config = TrainingConfig(seed=seed, kind_weights=weights or {})
            forest = train_forest([*(e for e in examples if dealt[e.building] != fold), *extra], config)
            progress("judges trained", seed * folds + fold + 1, seeds * folds)

            def run(grid: OccupancyGrid, forest: Forest = forest) -> Layout:
                return reconstruct_with(grid, DefaultConfig(), forest)

            for case in cases:
                if dealt[case.building] == fold:
                    row, layout = score_case(
                        case, "default", protocol=protocol, resolution=resolution, run=run
                    )
                    yield case, replace(row, fold=fold, seed=seed), layout.labels


def train_judge(
    cases: Sequence[Case],
    *,
    resolution: float,
    simulated: int,
    plans: Sequence[str] = (),
    seed: int = 0,
    weights: Mapping[str, float] | None = None,
    progress: Progress = _silent,
) -> Forest:
    """The judge that ships: trained on all given maps and on simulated ones; `weights` as in `cross_validate`."""
    examples = training_examples(cases, resolution, progress)
    examples += simulated_examples(simulated, tuple(plans), progress=progress)
    return train_forest(examples, TrainingConfig(seed=seed, kind_weights=weights or {}))
