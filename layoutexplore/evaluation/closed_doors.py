"""Rooms behind closed doors against the truth.

The maps are NAME_k_doors_IN.png, NAME_k_doors_OUT.png (a reference's answer), NAME_GT.png.

All three lie in one frame: 0 occupied, 205 unknown, 254 free. *Never seen* is what is free in the truth and
not in IN; a prediction is what it makes free beyond IN.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from layoutexplore.closed_doors.prediction import predict_closed_rooms
from layoutexplore.errors import ConfigError, MapError, checks_arguments, counted
from layoutexplore.files import write_atomically
from layoutexplore.grids.arrays import Mask, check_alike
from layoutexplore.grids.grid import FREE, OccupancyGrid
from layoutexplore.grids.ros_map import encode_png
from layoutexplore.maps.buildings import building_of
from layoutexplore.maps.closed_door_maps import FREE_GREY, OCCUPIED_GREY, UNKNOWN_GREY, Triple, read_cells
from layoutexplore.metrics.statistics import cluster_bootstrap, weighted_interquartile_mean, weighted_mean
from layoutexplore.options import JOBS
from layoutexplore.plugins.transport import worker_map

if TYPE_CHECKING:
    from layoutexplore.closed_doors.models import Models
    from layoutexplore.training.closed_doors import ClosedDoorSamples, Source


@dataclass(frozen=True)
class Score:
    """How one prediction agrees with the truth, all 0..1.

    Attributes:
        free_iou: Intersection over union of the free space.
        iou: The same on what was never seen.
        precision: Share of the predicted area that is right; NaN where nothing was predicted.
        recall: Share of the never seen area that is predicted.
    """

    free_iou: float
    iou: float
    precision: float
    recall: float


@dataclass(frozen=True)
class PairScore:
    """The scores of one map: the free space before, the reference's, ours."""

    building: str
    doors: int
    hidden_m2: float
    before: float
    ours: Score
    reference: Score | None
    seconds: float


@checks_arguments
def score_prediction(predicted: Mask, seen: Mask, truth: Mask, *, kept: bool = True) -> Score:
    """Score the free cells of a prediction.

    Args:
        predicted: Bool (rows, cols), free after the prediction.
        seen: Bool (rows, cols), free before it.
        truth: Bool (rows, cols), free in truth.
        kept: Whether the prediction keeps what was seen; only the free space's IoU depends on it.
    """
    check_alike("score_prediction", predicted=predicted, seen=seen, truth=truth)
    new, hidden = predicted & ~seen, truth & ~seen
    free = predicted | seen if kept else predicted
    hit = int((new & hidden).sum())
    return Score(
        _share(int((free & truth).sum()), int((free | truth).sum())),
        _share(hit, int((new | hidden).sum())),
        _share(hit, int(new.sum()), empty=math.nan),
        _share(hit, int(hidden.sum())),
    )


def _share(part: int, whole: int, *, empty: float = 1.0) -> float:
    return part / whole if whole else empty


@checks_arguments
def evaluate_triple(
    triple: Triple, resolution: float, out: Path | None = None, models: Models | None = None
) -> PairScore:
    """Predict one map, score it, and write NAME_k_doors_pred.png into a folder.

    By the shipped models when None are given.
    """
    cells = read_cells(triple.seen)
    shape = (cells.shape[0], cells.shape[1])
    seen, truth = cells == FREE, read_cells(triple.truth, shape) == FREE
    begin = time.perf_counter()
    # rows run downwards here as in the image: the prediction is the same mirrored
    predicted = predict_closed_rooms(OccupancyGrid(cells, resolution), models)
    seconds = time.perf_counter() - begin
    if out is not None:
        grey = np.where(
            predicted.grid.free, FREE_GREY, np.where(predicted.grid.occupied, OCCUPIED_GREY, UNKNOWN_GREY)
        )
        write_atomically(out / f"{triple.name}_pred.png", encode_png(grey.astype(np.uint8)))
    theirs = None
    if triple.reference is not None:
        theirs = score_prediction(read_cells(triple.reference, shape) == FREE, seen, truth, kept=False)
    ours = score_prediction(predicted.grid.free, seen, truth)
    before = score_prediction(seen, seen, truth).free_iou
    hidden = float((truth & ~seen).sum()) * resolution**2
    return PairScore(triple.building, triple.doors, hidden, before, ours, theirs, seconds)


@checks_arguments
def evaluate(
    triples: Sequence[Triple], *, resolution: float, out: Path | None = None, jobs: int = 1
) -> Iterator[PairScore]:
    """Evaluate maps in order, in several processes where asked to."""
    jobs = min(JOBS.convert("jobs", jobs), len(triples))
    with worker_map(jobs) as spread:
        yield from spread(partial(evaluate_triple, resolution=resolution, out=out), triples)


@checks_arguments
def whole_building(floor: str) -> str:
    """The building of a floor; a name of digits alone is that of a building."""
    return building_of(floor, "closed doors") or floor


@checks_arguments
def held_out_groups(triples: Sequence[Triple], folds: int) -> int:
    """How many groups the buildings of maps can be dealt into: at most one a building.

    Args:
        triples: The maps, as from `find_triples`.
        folds: Groups that are wanted.

    Raises:
        ConfigError: Fewer than two are wanted, or the maps are of one building.
    """
    count = len({whole_building(t.building) for t in triples})
    if folds < 2 or count < 2:
        raise ConfigError(
            "to hold buildings out takes two folds and two buildings at least: got "
            f"{counted(folds, 'fold')} and {counted(count, 'building')}"
        )
    return min(folds, count)


@checks_arguments
def cross_validate_closed_doors(
    triples: Sequence[Triple],
    folds: int,
    learnt: Sequence[tuple[Source, ClosedDoorSamples]],
    *,
    resolution: float,
    out: Path | None = None,
) -> Iterator[PairScore]:
    """Evaluate maps in order, each by models trained without its building (all floors of it, and all plans).

    Args:
        triples: The maps, as from `find_triples`.
        folds: Groups of buildings; at most one a building.
        learnt: What the models learn from, as of `layoutexplore.training.closed_doors.collect_all`.
        resolution: Metres a cell.
        out: Folder for the predictions.

    Raises:
        ConfigError: As `held_out_groups` does.
        MapError: Nothing is learnt from without the buildings of a fold.
    """
    from layoutexplore.training.closed_doors import fit
    from layoutexplore.training.folds import deal_folds

    buildings = [whole_building(t.building) for t in triples]
    fold = deal_folds(buildings, held_out_groups(triples, folds), "given")
    models: dict[int, Models] = {}
    for triple, building in zip(triples, buildings, strict=True):
        k = fold[building]
        if k not in models:
            others = [samples for source, samples in learnt if fold.get(source.building) != k]
            if not others:
                raise MapError(
                    f"without {building} and its fold nothing is left to learn from: --plans adds some"
                )
            models[k] = fit(others)
        yield evaluate_triple(triple, resolution, out, models[k])


@checks_arguments
def summarise_closed_doors(scores: Sequence[PairScore]) -> list[dict[str, Any]]:
    """Means and interquartile means per building and overall, with intervals clustered by building.

    The reference and ours are compared on the maps that have the reference's answer; the last two lines are
    those maps of all buildings, and all maps.
    """
    lines = []
    answered = [s for s in scores if s.reference]
    for building in dict.fromkeys(s.building for s in scores):
        lines += _lines(building, [s for s in answered if s.building == building])
    lines += _lines("with a reference", answered)
    return [*lines, _line("all maps", "ours", scores, [s.ours for s in scores])]


def _lines(group: str, scores: Sequence[PairScore]) -> list[dict[str, Any]]:
    if not scores:
        return []
    reference = [s.reference for s in scores if s.reference]
    return [
        _line(group, "reference", scores, reference),
        _line(group, "ours", scores, [s.ours for s in scores]),
    ]


def _line(group: str, method: str, pairs: Sequence[PairScore], scores: Sequence[Score]) -> dict[str, Any]:
    clusters = [whole_building(p.building) for p in pairs]
    iou = [s.iou for s in scores]
    line: dict[str, Any] = {"group": group, "method": method, "maps": len(pairs)}
    line["before"] = float(np.mean([p.before for p in pairs]))
    for name in ("free_iou", "iou", "precision", "recall"):
        known = [value for s in scores if not math.isnan(value := getattr(s, name))]
        line[name] = float(np.mean(known)) if known else math.nan
    for name, statistic, values in (
        ("iqm", weighted_interquartile_mean, iou),
        ("free", weighted_mean, [s.free_iou for s in scores]),
    ):
        line |= cluster_bootstrap(values, clusters, statistic).as_columns(name)
    return line
