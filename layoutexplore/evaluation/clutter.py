"""ROSE's sensitivity study: clutter of known shape, size and amount is added to maps (ICRA 2021, section IV).

What was occupied in the original map counts as structure, what was added as clutter. Precision is the share
of structure among the cells that ROSE keeps, recall the share of the structure that it keeps.

The wall-line error (section IV-A) compares the wall lines of IAS-15 in the cluttered map, once as they are
and once after decluttering and with ROSE's directions in place of those of the mean shift, with the wall
lines of the original map. These are found without ROSE: the paper's were drawn by hand, and lines turned to
ROSE's directions would favour its side.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import cv2
import numpy as np

from layoutexplore.errors import ConfigError, MapError, checks_arguments, checks_making, shortened
from layoutexplore.evaluation.kept_rows import kept_file, kept_rows
from layoutexplore.files import ArrayRule
from layoutexplore.grids.arrays import Floats
from layoutexplore.grids.grid import FREE, OCCUPIED, OccupancyGrid
from layoutexplore.layout.frame import angles_to_local
from layoutexplore.layout.lines.ias15 import Ias15Config, mean_shift_directions
from layoutexplore.layout.lines.rose import RoseConfig, rose
from layoutexplore.layout.lines.segments import align, angle_between, find_segments, segment_angles
from layoutexplore.layout.lines.walls import find_walls
from layoutexplore.options import COUNT, FLAG, NATURAL, SEED, check, check_kind
from layoutexplore.training.folds import Progress, silent

SHAPES = ("square", "rectangle", "circle", "diamond", "star")
"""Shapes of clutter that can be added."""


@checks_making
@dataclass(frozen=True, kw_only=True)
class ClutterConfig:
    """Which clutter is added.

    Attributes:
        shapes: Some of `SHAPES`.
        counts: Obstacles a map (the paper: 20 to 180).
        sizes: Side or diameter of an obstacle in cells, of a rectangle the longer one (the paper: 2 to 39).
        seed: Of the places and proportions.
        lines: Whether the wall-line error is measured too.
        rose: Options of the decluttering.
    """

    shapes: tuple[str, ...] = SHAPES
    counts: tuple[int, ...] = (20, 60, 100, 140, 180)
    sizes: tuple[int, ...] = (2, 5, 9, 14, 20, 27, 39)
    seed: int = 0
    lines: bool = True
    rose: RoseConfig = field(default_factory=RoseConfig)

    def __post_init__(self) -> None:
        for name in ("shapes", "counts", "sizes"):
            check_kind(name, getattr(self, name), tuple, list)
        for number in (*self.counts, *self.sizes):
            COUNT.convert("counts and sizes", number)
        check(self, seed=SEED, lines=FLAG)
        for shape in self.shapes:
            if shape not in SHAPES:
                raise ConfigError(f"unknown shape {shortened(shape)}: known are {', '.join(SHAPES)}")
        if not self.counts or not self.sizes or not self.shapes:
            raise ConfigError("shapes, counts and sizes must not be empty")


@dataclass(frozen=True, kw_only=True)
class ClutterTrial:
    """One cluttered map.

    Attributes:
        map: Name of the map.
        shape: Of the obstacles.
        count: Number of obstacles.
        size: Side or diameter of an obstacle in cells.
        precision: Share of structure among the kept cells; 1 where none is kept.
        recall: Share of the structure that is kept.
        score: W of the cluttered map.
        error: Mean wall-line error after decluttering, in rad m; NaN if not measured.
        raw_error: The same without decluttering.
    """

    map: str
    shape: str
    count: int
    size: int
    precision: float
    recall: float
    score: float
    error: float
    raw_error: float


@dataclass(frozen=True, kw_only=True)
class ClutterSummary:
    """What the study shows.

    Attributes:
        trials: Number of cluttered maps.
        median_precision: Median over all trials.
        median_recall: Median over all trials.
        correlation: Pearson's correlation of W and precision over all trials.
        correlation_by_count: The same for each number of obstacles.
        clean_scores: W of each map without clutter.
        error: Median wall-line error with decluttering, in rad m.
        raw_error: Median wall-line error without.
    """

    trials: int
    median_precision: float
    median_recall: float
    correlation: float
    correlation_by_count: dict[int, float]
    clean_scores: dict[str, float]
    error: float
    raw_error: float


@checks_arguments
def run_study(
    maps: dict[str, OccupancyGrid],
    config: ClutterConfig | None = None,
    *,
    progress: Progress = silent,
    store: Path | None = None,
) -> tuple[ClutterSummary, list[ClutterTrial]]:
    """Add every combination of shape, count and size to every map and measure ROSE.

    Args:
        maps: The maps by name.
        config: Which clutter.
        progress: Told, after each map, what has been done, how often, and how often it will be.
        store: Folder where the trials of each map are kept; those that are there already are read.

    Raises:
        MapError: No map, or a map without walls or free space.
    """
    config = config or ClutterConfig()
    if not maps:
        raise MapError("the clutter study needs at least one map")
    for name, grid in maps.items():
        check_kind(f"map {name!r}", grid, OccupancyGrid)
        check_for_clutter(name, grid)
    maps = {name: grid.trinary for name, grid in maps.items()}
    trials: list[ClutterTrial] = []
    clean: dict[str, float] = {}
    for k, (name, grid) in enumerate(maps.items(), start=1):
        about = grid.shape, grid.cells.tobytes(), grid.resolution, grid.origin
        path = kept_file(store, Path(name).stem, name, about, config)
        rows, score = kept_rows(path, ClutterTrial, partial(_study_map, name, grid, config), ArrayRule())
        trials += rows
        clean[name] = float(score)
        progress("maps cluttered", k, len(maps))
    return summarise_clutter(trials, clean), trials


def _study_map(name: str, grid: OccupancyGrid, config: ClutterConfig) -> tuple[list[ClutterTrial], Floats]:
    """The trials of one map, and its W without clutter."""
    return [*trials_of_map(name, grid, config)], np.array(rose(grid, config.rose).structure_score)


@checks_arguments
def check_for_clutter(name: str, grid: OccupancyGrid) -> None:
    """Raise `MapError` where a map has no walls, or no free space for clutter to lie on."""
    if not grid.occupied.any() or not grid.free.any():
        raise MapError(f"{name}: the clutter study needs a map with walls and free space")


@checks_arguments
def trials_of_map(name: str, grid: OccupancyGrid, config: ClutterConfig) -> Iterator[ClutterTrial]:
    """The trials of one map, in the order of shapes, counts and sizes."""
    check_for_clutter(name, grid)
    truth = wall_lines(grid) if config.lines else None
    for shape, count, size in itertools.product(config.shapes, config.counts, config.sizes):
        rng = np.random.default_rng([config.seed, SHAPES.index(shape), count, size])
        cluttered = add_clutter(grid, shape, count, size, rng)
        layout = rose(cluttered, config.rose)
        kept, structure = layout.clean_grid.occupied, grid.occupied
        error = raw_error = float("nan")
        if truth is not None:
            error = line_error(
                wall_lines(layout.clean_grid, angles_to_local(layout.directions, grid.origin)), truth
            )
            raw_error = line_error(wall_lines(cluttered), truth)
        yield ClutterTrial(
            map=name,
            shape=shape,
            count=count,
            size=size,
            precision=float((kept & structure).sum() / max(kept.sum(), 1)) if kept.any() else 1.0,
            recall=float((kept & structure).sum() / structure.sum()),
            score=float(layout.structure_score),
            error=error,
            raw_error=raw_error,
        )


@checks_arguments
def summarise_clutter(trials: Sequence[ClutterTrial], clean_scores: dict[str, float]) -> ClutterSummary:
    """Medians and correlations over trials (at least one)."""
    precision, recall, score = (
        np.array([getattr(t, k) for t in trials]) for k in ("precision", "recall", "score")
    )
    counts = np.array([t.count for t in trials])
    errors = np.array([(t.error, t.raw_error) for t in trials])
    error, raw_error = np.nanmedian(errors, axis=0) if np.isfinite(errors).any() else (np.nan, np.nan)
    return ClutterSummary(
        trials=len(trials),
        median_precision=float(np.median(precision)),
        median_recall=float(np.median(recall)),
        correlation=_correlation(score, precision),
        correlation_by_count={
            int(c): _correlation(score[counts == c], precision[counts == c]) for c in np.unique(counts)
        },
        clean_scores=clean_scores,
        error=float(error),
        raw_error=float(raw_error),
    )


def _correlation(a: Floats, b: Floats) -> float:
    """Pearson's correlation; NaN where one of the two does not vary."""
    if len(a) < 2 or not a.std() or not b.std():
        return float("nan")
    return float(np.corrcoef(a, b)[0, 1])


@checks_arguments
def add_clutter(
    grid: OccupancyGrid, shape: str, count: int, size: int, rng: np.random.Generator
) -> OccupancyGrid:
    """The grid with `count` obstacles around random free cells; only free cells become occupied.

    Args:
        grid: The map.
        shape: One of `SHAPES`; rectangles get random proportions and all shapes but circles a random turn.
        count: Number of obstacles.
        size: Side or diameter in cells; of a rectangle the longer side, of diamonds and stars tip to tip.
        rng: Where they lie.
    """
    NATURAL.convert("count", count)
    COUNT.convert("size", size)
    image = np.zeros(grid.shape, np.uint8)
    places = np.argwhere(grid.free)
    if not len(places):
        raise MapError("there is no free cell for clutter to lie on")
    for row, col in places[rng.integers(0, len(places), count)]:
        corners = _corners(shape, size, rng) + np.array((col, row))
        cv2.fillPoly(image, [np.rint(corners * 16).astype(np.int32)], 1, cv2.LINE_8, 4)
        image[row, col] = 1
    cells = grid.cells.copy()
    cells[(image > 0) & (cells == FREE)] = OCCUPIED
    return OccupancyGrid(cells, grid.resolution, grid.origin)


def _corners(shape: str, size: int, rng: np.random.Generator) -> Floats:
    """Corners float64 (n, 2) of an obstacle around the origin, in cells."""
    half = size / 2
    turn = rng.uniform(0, np.pi / 2)
    if shape == "circle":
        angle = np.linspace(0, 2 * np.pi, 24, endpoint=False)
        return np.asarray(half * np.stack((np.cos(angle), np.sin(angle)), axis=1))
    if shape == "star":
        angle = np.arange(10) * np.pi / 5 + turn
        radius = np.where(np.arange(10) % 2 == 0, half, 0.45 * half)[:, None]
        return np.asarray(radius * np.stack((np.cos(angle), np.sin(angle)), axis=1))
    if shape == "diamond":
        points = np.array([(half, 0), (0, 0.6 * half), (-half, 0), (0, -0.6 * half)])
    else:
        width = half * (rng.uniform(0.3, 0.8) if shape == "rectangle" else 1.0)
        points = np.array([(half, width), (-half, width), (-half, -width), (half, -width)])
    c, s = np.cos(turn), np.sin(turn)
    return np.asarray(points @ np.array([[c, s], [-s, c]]))


@checks_arguments
def wall_lines(grid: OccupancyGrid, directions: Floats | None = None) -> Floats:
    """Wall lines float64 (n, 4) of a grid in metres of its own frame.

    Collinear Hough segments joined (IAS-15, section III).

    Args:
        grid: The grid.
        directions: float64 (k,), of the walls, in the grid's frame; without them, or where there are none,
            the modes of the segments' own directions by mean shift.
    """
    if directions is not None and (directions.ndim != 1 or not np.isfinite(directions).all()):
        raise ConfigError(f"wall_lines: directions are finite numbers (k,), got {directions.shape}")
    config = Ias15Config()
    segments = find_segments(grid.occupied, grid.resolution, config)
    if not len(segments):
        return segments
    if directions is None or not len(directions):
        directions, _ = mean_shift_directions(segment_angles(segments), config.bandwidth, config.merge_angle)
    aligned, _ = align(segments, directions, np.pi)
    return np.concatenate(find_walls(aligned, config.wall_gap).ends(directions), axis=1)


@checks_arguments
def line_error(found: Floats, truth: Floats) -> float:
    """Mean over the found lines of the cost theta |T| / 2 of moving them onto the best true line, in rad m.

    theta is the angle between the two, T the shortest way from the midpoint of the one to the other. Infinite
    where nothing was found.

    Args:
        found: float64 (n, 4), ends (x0, y0, x1, y1) in metres; likewise truth.
        truth: See found.

    Raises:
        ConfigError: Lines of another shape.

    Example:
        >>> truth = np.array([[0.0, 0.0, 4.0, 0.0]])
        >>> round(line_error(np.array([[1.0, 1.0, 1.0, 3.0]]), truth) / np.pi, 6)  # a right angle, 2 m away
        0.5
    """
    if not len(found) or not len(truth):
        return float("inf")
    if any(lines.ndim != 2 or lines.shape[1] != 4 for lines in (found, truth)):
        raise ConfigError(f"lines are rows of four numbers, got shapes {found.shape} and {truth.shape}")
    return float(
        np.concatenate([_costs(part, truth) for part in np.array_split(found, -(-len(found) // 256))]).mean()
    )


def _costs(found: Floats, truth: Floats) -> Floats:
    """Cost float64 (n,) of moving each found segment (n, 4) onto the best of the true ones (m, 4)."""
    theta = angle_between(segment_angles(found)[:, None], segment_angles(truth)[None, :])
    middle, along = (found[:, :2] + found[:, 2:]) / 2, truth[:, 2:] - truth[:, :2]
    from_start = middle[:, None] - truth[None, :, :2]
    reach = (from_start * along).sum(axis=2) / np.maximum((along**2).sum(axis=1), 1e-12)
    way = np.hypot(*np.moveaxis(from_start - np.clip(reach, 0, 1)[..., None] * along, 2, 0))
    return np.asarray((theta * way / 2).min(axis=1))


@checks_arguments
def table(trials: Iterable[ClutterTrial], key: str) -> dict[str, tuple[int, float, float, float]]:
    """Number of trials, median precision, recall and W by the values of "map", "shape", "count" or "size"."""
    groups: dict[str, list[ClutterTrial]] = {}
    for trial in trials:
        groups.setdefault(str(getattr(trial, key)), []).append(trial)
    return {
        name: (
            len(group),
            float(np.median([t.precision for t in group])),
            float(np.median([t.recall for t in group])),
            float(np.median([t.score for t in group])),
        )
        for name, group in groups.items()
    }
