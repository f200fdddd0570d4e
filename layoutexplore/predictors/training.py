"""Training the trees that judge frontiers and cells, on simulated explorations of floor plans whose rooms are known.

Explorations by several strategies are stopped here and there; every frontier is a sample with its true class and the true
area left, and unknown cells near a seen region are samples of whether they are floor of its room. Plans of one building must
be trained on together or not at all. To train on one's own plans and to see how the trees do on plans that they never saw:

    python -m layoutexplore.predictors.training office:0-99 school:0-99 plans/ --folds 4 --out models/
"""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from layoutexplore.frontier_classes import classify_frontiers
from layoutexplore.predictors import cell_features
from layoutexplore.predictors.cell_features import find_candidates
from layoutexplore.predictors.forest import FOLDER, Forest, save_forests
from layoutexplore.predictors.frontier_features import FEATURES, frontier_features
from layoutexplore.predictors.layout import CELL_MODEL, FRONTIER_MODEL, LEFTOVER
from layoutexplore.predictors.regions import seen_regions

if TYPE_CHECKING:
    from layoutexplore.evaluation.snapshots import Snapshot

AGENTS = ("nearest", "layout-tour:predictor=oracle", "layout-tour:area=4,predictor=oracle", "wait-8")
"""Strategies whose explorations are learnt from: what is left unseen depends on who explores."""


@dataclass(frozen=True, kw_only=True)
class TrainingConfig:
    """How the trees are grown.

    Attributes:
        trees: Trees of a forest.
        leaves: Leaves of a tree.
        rate: Learning rate.
        feature_share: Share of the features that a split may choose from.
        snapshots: Decisions kept of an exploration.
        cell_trees: Trees of the forest that judges cells.
        cell_leaves: Leaves of one of these.
        cells: Cells kept of a decision.
    """

    trees: int = 200
    leaves: int = 24
    rate: float = 0.07
    feature_share: float = 0.3
    snapshots: int = 8
    cell_trees: int = 150
    cell_leaves: int = 31
    cells: int = 700


@dataclass(frozen=True, eq=False)
class Samples:
    """Frontiers and cells with what is true of them.

    Attributes:
        features: float32 (n, features).
        closed: bool (n,).
        area: float64 (n,), square metres left in the room behind.
        building: str (n,).
        cell_features: float32 (m, cell features).
        inside: bool (m,), the cell is floor of the room that the region is the seen part of.
    """

    features: NDArray[np.float32]
    closed: NDArray[np.bool_]
    area: NDArray[np.float64]
    building: NDArray[np.str_]
    cell_features: NDArray[np.float32]
    inside: NDArray[np.bool_]


def fit_forests(samples: Samples, config: TrainingConfig | None = None) -> dict[str, Forest]:
    """Train "closed" and "leftover" (log-odds) and "area" (log of 1 + square metres)."""
    from sklearn.ensemble import HistGradientBoostingClassifier, HistGradientBoostingRegressor

    config = config or TrainingConfig()
    options = {
        "max_iter": config.trees,
        "learning_rate": config.rate,
        "max_leaf_nodes": config.leaves,
        "max_features": config.feature_share,
        "min_samples_leaf": 20,
        "l2_regularization": 3.0,
        "early_stopping": False,
        "random_state": 0,
    }
    _, which, counts = np.unique(samples.building, return_inverse=True, return_counts=True)
    weights = 1.0 / np.sqrt(counts[which])
    weights /= weights.mean()
    leftover = samples.closed & (samples.area < LEFTOVER)
    forests = {}
    for name, target in (("closed", samples.closed), ("leftover", leftover)):
        model = HistGradientBoostingClassifier(**options).fit(samples.features, target, sample_weight=weights)
        forests[name] = as_forest(model)
    model = HistGradientBoostingRegressor(**options).fit(samples.features, np.log1p(samples.area), sample_weight=weights)
    return forests | {"area": as_forest(model)}


def fit_cell_forest(samples: Samples, config: TrainingConfig | None = None) -> Forest:
    """Train the forest (log-odds) that says whether an unknown cell belongs to a room."""
    from sklearn.ensemble import HistGradientBoostingClassifier

    config = config or TrainingConfig()
    model = HistGradientBoostingClassifier(
        max_iter=config.cell_trees,
        learning_rate=0.12,
        max_leaf_nodes=config.cell_leaves,
        min_samples_leaf=50,
        l2_regularization=3.0,
        early_stopping=False,
        random_state=0,
    )
    return as_forest(model.fit(samples.cell_features, samples.inside))


def as_forest(model: object) -> Forest:
    """The trees of scikit-learn's histogram boosting as plain arrays."""
    parts, roots, begin = [], [], 0
    for (predictor,) in model._predictors:  # type: ignore[attr-defined]
        nodes = predictor.nodes
        leaf = nodes["is_leaf"].astype(bool)
        feature = np.where(leaf, -1, nodes["feature_idx"].astype(np.int64))
        value = np.where(leaf, nodes["value"], nodes["num_threshold"])
        left, right = (np.where(leaf, 0, nodes[side].astype(np.int64) + begin) for side in ("left", "right"))
        parts.append((feature, value, left, right))
        roots.append(begin)
        begin += len(nodes)
    feature, value, left, right = (np.concatenate(column) for column in zip(*parts, strict=True))
    bias = float(np.ravel(model._baseline_prediction)[0])  # type: ignore[attr-defined]
    ints = (a.astype(np.int32) for a in (feature, left, right))
    first, second, third = ints
    return Forest(first, value.astype(np.float32), second, third, np.array(roots, np.int32), bias)


def collect(
    sources: Iterable[str], *, sensors: Sequence[str] = ("stage", "indoor"), config: TrainingConfig | None = None
) -> Samples:
    """Explore floor plans and keep their frontiers.

    Args:
        sources: Names or paths of floor plans.
        sensors: Of the explorations.
        config: For the number of snapshots.
    """
    from layoutexplore.evaluation.snapshots import explore
    from layoutexplore.floorplan import FloorPlan

    config = config or TrainingConfig()
    parts: list[tuple[NDArray[np.generic], ...]] = []
    for number, source in enumerate(sources):
        plan = FloorPlan.load(source)
        for k, sensor in enumerate(sensors):
            rng = np.random.default_rng([number, k])
            shares = np.sort(rng.uniform(0.04, 0.985, config.snapshots)).tolist()
            agent = AGENTS[(number + k) % len(AGENTS)]
            snapshots = explore(plan, sensor=sensor, seed=number, agent=agent, coverages=shares)
            parts.extend((*_frontier_samples(s), *_cell_samples(s, config.cells, rng)) for s in snapshots)
    return Samples(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def _frontier_samples(snapshot: Snapshot) -> tuple[NDArray[np.generic], ...]:
    """Features, classes, areas and the building of a snapshot's frontiers."""
    grid, truth = snapshot.decision.grid, snapshot.truth.raster
    clusters = [f.cells for f in snapshot.decision.frontiers]
    visible = np.array([f.visible_area for f in snapshot.decision.frontiers])
    regions = seen_regions(grid.cells, grid.resolution)
    features = frontier_features(grid.cells, clusters, visible, regions, grid.resolution)
    true = classify_frontiers(grid.cells, clusters, truth.room_ids, truth.free, grid.resolution)
    return features, true.is_closed, true.remaining_area, np.full(len(features), snapshot.building)


def _cell_samples(snapshot: Snapshot, most: int, rng: np.random.Generator) -> tuple[NDArray[np.generic], ...]:
    """Features of some unknown cells, and whether each is floor of the true room that its region is mostly part of."""
    grid, truth = snapshot.decision.grid, snapshot.truth.raster
    regions = seen_regions(grid.cells, grid.resolution)
    candidates = find_candidates(grid.cells, regions, grid.resolution)
    kept = rng.permutation(len(candidates.cells))[:most]
    rooms = int(truth.room_ids.max()) + 1
    seen = regions.labels > 0
    pairs = regions.labels[seen].astype(np.int64) * rooms + truth.room_ids[seen]
    shared = np.bincount(pairs, minlength=(regions.count + 1) * rooms).reshape(-1, rooms)
    shared[:, 0] = 0
    room = shared.argmax(1)[candidates.region[kept]]
    rows, cols = candidates.cells[kept].T
    return candidates.features[kept], truth.free[rows, cols] & (truth.room_ids[rows, cols] == room) & (room > 0)


def cross_validate(samples: Samples, folds: int, config: TrainingConfig | None = None) -> tuple[NDArray[np.float64], ...]:
    """Probabilities float64 (n,) of "closed" and of "leftover", each by trees that never saw the sample's building."""
    names, which = np.unique(samples.building, return_inverse=True)
    fold = np.random.default_rng(0).permutation(len(names))[which] % folds
    closed, leftover = np.zeros(len(fold)), np.zeros(len(fold))
    for k in range(folds):
        out = fold == k
        kept = dataclasses.replace(
            samples,
            features=samples.features[~out],
            closed=samples.closed[~out],
            area=samples.area[~out],
            building=samples.building[~out],
        )
        forests = fit_forests(kept, config)
        closed[out] = forests["closed"].probability(samples.features[out])
        leftover[out] = forests["leftover"].probability(samples.features[out])
    return closed, leftover


def main(arguments: Sequence[str] | None = None) -> None:
    """Train from the command line."""
    from layoutexplore.maps import expand_plans

    parser = argparse.ArgumentParser(description="Train the trees that judge frontiers.")
    parser.add_argument("plans", nargs="+", help="names, FAMILY:FIRST-LAST, files or folders")
    parser.add_argument("--folds", type=int, default=0, help="also cross-validate over so many folds of buildings")
    parser.add_argument("--out", type=Path, default=FOLDER, help="folder for the two models")
    options = parser.parse_args(arguments)
    sources = [source for spec in options.plans for source in expand_plans(spec)]
    samples = collect(sources)
    note = f"{len(samples.closed)} frontiers of {len(np.unique(samples.building))} buildings"
    print(note)
    if options.folds:
        closed, leftover = cross_validate(samples, options.folds)
        right = ((leftover > 0.5) == (samples.closed & (samples.area < LEFTOVER))).mean()
        print(f"held out: closed or open right {((closed > 0.5) == samples.closed).mean():.3f}, leftover right {right:.3f}")
    options.out.mkdir(parents=True, exist_ok=True)
    save_forests(options.out / FRONTIER_MODEL.name, fit_forests(samples), FEATURES, note)
    inside = {"inside": fit_cell_forest(samples)}
    save_forests(options.out / CELL_MODEL.name, inside, cell_features.FEATURES, f"{len(samples.inside)} cells, {note}")
    print(f"written: {options.out}")


if __name__ == "__main__":
    main()
