"""The method `default` scored on buildings, or whole sources, that its classifier has never seen.

The maps are held out by building, dealt into folds, or by source: where a map comes from (who drew or
recorded it, with what). Folds inside one source flatter, for a new user's maps are of no source that was
trained on. Either way the classifier is trained on the maps of all the others, on these maps while being
explored, and on maps simulated from floor plans of other buildings, and the method is scored on what was held
out. Training takes chance: with several seeds, the spread of the means over the seeds is what a difference
between two trainings has to exceed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from layoutexplore.errors import ConfigError, LayoutExploreError, checks_arguments
from layoutexplore.evaluation.segmentation import MapScore, score_case
from layoutexplore.grids.arrays import Ints32
from layoutexplore.grids.grid import OccupancyGrid
from layoutexplore.layout.merging.merge_tree.cut import MergingModels
from layoutexplore.layout.merging.method import MergingConfig, reconstruct_with
from layoutexplore.layout.types import Layout
from layoutexplore.maps import load_plan
from layoutexplore.maps.buildings import building_of
from layoutexplore.maps.painted_rooms import Case
from layoutexplore.training.folds import Progress, check_folds, deal_folds, silent
from layoutexplore.training.map_noise.examples import POLYGONAL, polygonal_examples, weathered_pairs
from layoutexplore.training.merge_trees.models import train_all_models
from layoutexplore.training.merging_examples import Example
from layoutexplore.training.room_merging import MergingTrainingConfig, training_examples

Scored = tuple[Case, MapScore, Ints32]
"""A map, its scores and its labels."""


@dataclass(frozen=True, kw_only=True)
class CrossValidationConfig:
    """How the default method is cross-validated.

    Attributes:
        folds: Number of folds of buildings; not used where sources are left out.
        protocol: Of `layoutexplore.metrics.segmentation.PROTOCOLS`.
        resolution: Metres a pixel where a map's folder does not say it.
        simulated: Number of simulated maps to train on besides.
        plans: Floor plans to simulate maps of, besides generated ones.
        seeds: The classifiers are trained so many times, with seeds 0, 1, ...
        weights: Weight in training of a folder's maps where it is not 1.
        sources: Source of a folder's maps where it is not the folder's own name.
    """

    folds: int = 0
    protocol: str
    resolution: float
    simulated: int
    plans: tuple[str, ...] = ()
    seeds: int = 1
    weights: Mapping[str, float] = field(default_factory=dict)
    sources: Mapping[str, str] = field(default_factory=dict)

    def source_of(self, case: Case) -> str:
        """The source of a map."""
        return self.sources.get(case.folder, case.folder)


@dataclass(frozen=True, eq=False)
class _Part:
    """What is held out at once, and the recorded maps that are trained on for it."""

    held: Sequence[Case]
    recorded: Sequence[Example]


@checks_arguments
def cross_validate_merging(
    cases: Sequence[Case], config: CrossValidationConfig, progress: Progress = silent
) -> Iterator[Scored]:
    """Score the method on every map with a classifier that has not seen its building, once for each seed.

    Args:
        cases: The maps.
        config: How.
        progress: Told of what takes long.
    """
    check_folds(config.folds, [case.building for case in cases])
    dealt = deal_folds([case.building for case in cases], config.folds)
    examples = training_examples(cases, config.resolution, progress)
    parts = [
        _Part(
            [case for case in cases if dealt[case.building] == fold],
            [e for e in examples if dealt[e.building] != fold],
        )
        for fold in range(config.folds)
    ]
    yield from _score_parts(parts, config, progress)


@checks_arguments
def leave_sources_out(
    cases: Sequence[Case], config: CrossValidationConfig, progress: Progress = silent
) -> Iterator[Scored]:
    """Score the method on every map with a classifier that has seen neither its source nor its building.

    A building that two sources have mapped is left out of the training with either of them. The scores'
    `fold` counts the sources, in the order in which they come.

    Args:
        cases: The maps, of at least two sources.
        config: How.
        progress: Told of what takes long.

    Raises:
        ConfigError: There is one source only, or nothing is left to train on.
    """
    groups: dict[str, list[Case]] = {}
    for case in cases:
        groups.setdefault(config.source_of(case), []).append(case)
    if len(groups) < 2:
        only = next(iter(groups), "none")
        raise ConfigError(f"leaving out a source takes at least two; all maps are of {only!r}")
    for source, held in groups.items():
        if {case.building for case in cases} == {case.building for case in held} and not config.simulated:
            raise ConfigError(f"without the buildings of source {source!r} nothing is left to train on")
    learnt = {name: training_examples(part, config.resolution, progress) for name, part in groups.items()}
    parts = []
    for source, held in groups.items():
        known = {case.building for case in held}
        others = [e for name, part in learnt.items() if name != source for e in part]
        parts.append(_Part(held, [e for e in others if e.building not in known]))
    yield from _score_parts(parts, config, progress)


def _score_parts(
    parts: Sequence[_Part], config: CrossValidationConfig, progress: Progress
) -> Iterator[Scored]:
    """Train for each part and score it, seed by seed; `fold` is the number of the part.

    What is held out may itself be simulated from a plan that is simulated from here: no example of a plan of
    a building that is held out is trained on.
    """
    simulated = weathered_pairs(config.simulated, config.plans, progress=progress)
    polygonal = polygonal_examples(config.simulated // POLYGONAL, progress=progress)
    of_plan = _buildings_of(config.plans if simulated else ())
    for seed in range(config.seeds):
        for fold, part in enumerate(parts):
            training = MergingTrainingConfig(seed=seed, kind_weights=config.weights)
            held = {_plainly(case.building) for case in part.held}
            kinds = {e.kind for e in [*(e for e, _ in simulated), *polygonal]}
            strange = {kind for kind in kinds if not held & of_plan.get(kind, {_plainly(kind)})}
            models = train_all_models(
                part.recorded,
                [pair for pair in simulated if pair[0].kind in strange],
                [example for example in polygonal if example.kind in strange],
                training,
            )
            progress("classifiers trained", seed * len(parts) + fold + 1, config.seeds * len(parts))

            def run(grid: OccupancyGrid, models: MergingModels = models) -> Layout:
                return reconstruct_with(grid, MergingConfig(), models)

            for case in part.held:
                row, layout = score_case(
                    case, "default", protocol=config.protocol, resolution=config.resolution, run=run
                )
                yield (case, replace(row, source=config.source_of(case), fold=fold, seed=seed), layout.labels)


def _plainly(building: str) -> str:
    """A building's name as maps with painted rooms have it."""
    return building_of(building, "painted rooms") or building.lower()


def _buildings_of(plans: Sequence[str]) -> dict[str, set[str]]:
    """By a plan's name what it may be a map of; those that cannot be read are not simulated from."""
    found: dict[str, set[str]] = {}
    for source in plans:
        try:
            plan = load_plan(source)
        except LayoutExploreError:
            continue
        found.setdefault(plan.name, {_plainly(plan.name)}).add(_plainly(plan.building))
    return found
