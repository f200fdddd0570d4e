"""The method `default` scored on buildings, or whole sources, that its classifier has never seen.

The maps are held out by building, dealt into folds, or by source: where a map comes from (who drew or
recorded it, with what). Folds inside one source flatter, for a new user's maps are of no source that was
trained on. Either way the classifier is trained on the maps of all the others, on these maps while being
explored, and on maps simulated from floor plans of other buildings, and the method is scored on what was held
out. Training takes chance: with several seeds, the spread of the means over the seeds is what a difference
between two trainings has to exceed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property, partial
from pathlib import Path
from typing import Any

from layoutexplore.errors import ConfigError, LayoutExploreError, checks_arguments
from layoutexplore.evaluation.kept_rows import kept_file, kept_rows
from layoutexplore.evaluation.segmentation import LABELS, MapScore, score_case
from layoutexplore.files import fingerprint
from layoutexplore.files.reading import is_file
from layoutexplore.grids.arrays import Ints32
from layoutexplore.grids.grid import OccupancyGrid
from layoutexplore.layout.merging.merge_tree.cut import MergingModels
from layoutexplore.layout.merging.method import MergingConfig, reconstruct_with
from layoutexplore.layout.types import Layout
from layoutexplore.maps import load_plan
from layoutexplore.maps.buildings import building_of
from layoutexplore.maps.library import source_files
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
    """What is held out at once, and which recorded maps are trained on for it."""

    held: Sequence[Case]
    learns_from: Callable[[Example], bool]


@checks_arguments
def cross_validate_merging(
    cases: Sequence[Case],
    config: CrossValidationConfig,
    progress: Progress = silent,
    *,
    store: Path | None = None,
) -> Iterator[Scored]:
    """Score the method on every map with a classifier that has not seen its building, once for each seed.

    Args:
        cases: The maps.
        config: How.
        progress: Told of what takes long.
        store: Folder where scores are kept; those that are there already are read.
    """
    check_folds(config.folds, [case.building for case in cases])
    dealt = deal_folds([case.building for case in cases], config.folds)

    def part(fold: int) -> _Part:
        held = [case for case in cases if dealt[case.building] == fold]
        return _Part(held, lambda example: dealt[example.building] != fold)

    yield from _Study([*map(part, range(config.folds))], [cases], config, progress, store).scores()


@checks_arguments
def leave_sources_out(
    cases: Sequence[Case],
    config: CrossValidationConfig,
    progress: Progress = silent,
    *,
    store: Path | None = None,
) -> Iterator[Scored]:
    """Score the method on every map with a classifier that has seen neither its source nor its building.

    A building that two sources have mapped is left out of the training with either of them. The scores'
    `fold` counts the sources, in the order in which they come.

    Args:
        cases: The maps, of at least two sources.
        config: How.
        progress: Told of what takes long.
        store: Folder where scores are kept; those that are there already are read.

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

    def part(held: Sequence[Case]) -> _Part:
        folders, buildings = {case.folder for case in held}, {case.building for case in held}
        return _Part(held, lambda e: e.kind not in folders and e.building not in buildings)

    yield from _Study([*map(part, groups.values())], [*groups.values()], config, progress, store).scores()


@dataclass(frozen=True, eq=False)
class _Study:
    """Models are trained for each part, and it is scored, seed by seed.

    Examples are made, and models trained, once a score is wanted that is not kept.

    Attributes:
        parts: What is held out at once; scores have its number as their `fold`.
        groups: The maps, those together of which examples are made together.
        config: How.
        progress: Told of what takes long.
        store: Folder where scores are kept.
    """

    parts: Sequence[_Part]
    groups: Sequence[Sequence[Case]]
    config: CrossValidationConfig
    progress: Progress
    store: Path | None

    def scores(self) -> Iterator[Scored]:
        """Each map with its scores and labels."""
        made_from = self._made_from() if self.store else None
        for seed in range(self.config.seeds):
            for fold, part in enumerate(self.parts):
                models = cache(partial(self._models, seed, fold))
                held = [(case.folder, case.name) for case in part.held]
                for case in part.held:
                    path = kept_file(self.store, case.name, case.folder, seed, held, made_from)
                    (row,), labels = kept_rows(path, MapScore, partial(self._score, case, models), LABELS)
                    source = self.config.source_of(case)
                    yield case, replace(row, source=source, fold=fold, seed=seed), labels

    def _made_from(self) -> tuple[Any, ...]:
        """What all scores are made from."""
        cases = [case for group in self.groups for case in group]
        images = [path for case in cases for path in (case.image, case.truth)]
        plans = [path for plan in self.config.plans for path in source_files(plan) if is_file(path)]
        known = [(case.folder, case.name, case.building, case.resolution) for case in cases]
        return known, fingerprint(images), fingerprint(plans), replace(self.config, seeds=1)

    @cached_property
    def _recorded(self) -> list[Example]:
        resolution, progress = self.config.resolution, self.progress
        return [e for group in self.groups for e in training_examples(group, resolution, progress)]

    @cached_property
    def _simulated(self) -> tuple[tuple[Example, Example], ...]:
        return weathered_pairs(self.config.simulated, self.config.plans, progress=self.progress)

    @cached_property
    def _polygonal(self) -> tuple[Example, ...]:
        return polygonal_examples(self.config.simulated // POLYGONAL, progress=self.progress)

    def _models(self, seed: int, fold: int) -> MergingModels:
        """Models that have seen nothing of a part.

        What is held out may itself be simulated from a plan that is simulated from here: no example of a plan
        of a building that is held out is trained on.
        """
        part, simulated, polygonal = self.parts[fold], self._simulated, self._polygonal
        recorded = [*filter(part.learns_from, self._recorded)]
        of_plan = _buildings_of(self.config.plans if simulated else ())
        held = {_plainly(case.building) for case in part.held}
        kinds = {e.kind for e in [*(e for e, _ in simulated), *polygonal]}
        strange = {kind for kind in kinds if not held & of_plan.get(kind, {_plainly(kind)})}
        models = train_all_models(
            recorded,
            [pair for pair in simulated if pair[0].kind in strange],
            [example for example in polygonal if example.kind in strange],
            MergingTrainingConfig(seed=seed, kind_weights=self.config.weights),
        )
        done, total = seed * len(self.parts) + fold + 1, self.config.seeds * len(self.parts)
        self.progress("classifiers trained", done, total)
        return models

    def _score(self, case: Case, models: Callable[[], MergingModels]) -> tuple[list[MapScore], Ints32]:
        """The scores of one map, and its labels."""
        trained = models()

        def run(grid: OccupancyGrid) -> Layout:
            return reconstruct_with(grid, MergingConfig(), trained)

        protocol, resolution = self.config.protocol, self.config.resolution
        row, layout = score_case(case, "default", protocol=protocol, resolution=resolution, run=run)
        return [row], layout.labels


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
