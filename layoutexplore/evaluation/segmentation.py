"""Layout methods on grid maps whose true rooms are painted: NAME.png beside NAME_gt.png.

The measures are those of `layoutexplore.metrics.segmentation`; the time is that of `reconstruct` alone, after
one run to warm up.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np

from layoutexplore.errors import checks_arguments
from layoutexplore.evaluation.kept_rows import kept_file, kept_rows
from layoutexplore.files import ArrayRule, fingerprint
from layoutexplore.files.reading import is_there
from layoutexplore.grids.arrays import Ints32
from layoutexplore.grids.grid import FREE, UNKNOWN, OccupancyGrid
from layoutexplore.grids.ros_map import DEFAULT_RESOLUTION, usable_maps
from layoutexplore.layout.pipeline import LAYOUTS, reconstruct
from layoutexplore.layout.types import Layout
from layoutexplore.maps.painted_rooms import Case, check_bright, read_case
from layoutexplore.metrics.segmentation import MEASURES, score_segmentation
from layoutexplore.metrics.statistics import cluster_bootstrap, weighted_mean
from layoutexplore.options import JOBS
from layoutexplore.plugins.transport import worker_map

LABELS = ArrayRule(kinds="i", shape=("map rows", "map columns"), low=0)
"""Labels of a map that are kept."""

COLUMNS = (*MEASURES, "segments", "rooms", "ms")

CLASSIC = frozenset({"morphological", "distance", "voronoi"})
"""Methods that are given what the protocol calls free and nothing else, as in the published tables."""


@dataclass(frozen=True, kw_only=True)
class MapScore:
    """The scores of one method on one map; measures in 0..1, `m_per_px` the metres a pixel it was read at."""

    folder: str
    map: str
    building: str
    method: str
    precision: float
    recall: float
    iou_s: float
    iou_g: float
    one_to_one: float
    a_fc: float
    a_bc: float
    segments: int
    rooms: int
    ms: float
    source: str = ""
    fold: int = -1
    seed: int = 0
    m_per_px: float = DEFAULT_RESOLUTION
    warnings: str = ""


@checks_arguments
def usable_cases(cases: Sequence[Case], resolution: float) -> tuple[list[Case], list[str]]:
    """The maps that can be scored, and what is wrong with each of the others.

    Args:
        cases: The maps.
        resolution: Metres a pixel where a map's folder does not say it.
    """

    def read(case: Case) -> Case:
        grid, _, free = read_case(case, resolution)
        check_bright(case, grid, free)
        return case

    return usable_maps(read, cases)


@checks_arguments
def score_case(
    case: Case,
    method: str,
    *,
    protocol: str,
    resolution: float,
    run: Callable[[OccupancyGrid], Layout] | None = None,
) -> tuple[MapScore, Layout]:
    """Run a method on a map and score it.

    Args:
        case: The map.
        method: Name of the method.
        protocol: Of `layoutexplore.metrics.segmentation.PROTOCOLS`.
        resolution: Metres a pixel where the map's folder does not say it.
        run: What to run instead of the method of that name.
    """
    grid, truth, free = read_case(case, resolution)
    check_bright(case, grid, free)
    if method in CLASSIC:
        grid = OccupancyGrid(
            np.where(free, FREE, np.where(grid.free, UNKNOWN, grid.cells)).astype(np.int8), grid.resolution
        )
    begin = time.perf_counter()
    layout = reconstruct(grid, method) if run is None else run(grid)
    seconds = time.perf_counter() - begin
    scores = score_segmentation(layout.labels, truth, free, protocol=protocol)
    row = MapScore(
        folder=case.folder,
        map=case.name,
        building=case.building,
        m_per_px=grid.resolution,
        method=method,
        ms=1000 * seconds,
        warnings="; ".join(layout.warnings),
        **asdict(scores),
    )
    return row, layout


@checks_arguments
def evaluate_cases(
    cases: Sequence[Case],
    methods: Sequence[str],
    *,
    protocol: str,
    resolution: float,
    jobs: int = 1,
    store: Path | None = None,
) -> Iterator[tuple[Case, MapScore, Ints32]]:
    """Score every method on every map, in order, yielding the labels as well.

    Args:
        cases: The maps.
        methods: Names of the methods.
        protocol: Of `layoutexplore.metrics.segmentation.PROTOCOLS`.
        resolution: Metres a pixel where a map's folder does not say it.
        jobs: Processes; times are only comparable with 1.
        store: Folder where scores are kept; those that are there already are read, with the times that they
            took by as many processes.
    """
    work = [(case, method, protocol, resolution) for case in cases for method in methods]
    codes = {method: LAYOUTS.digest(method) for method in methods}
    paths = [_kept(store, item, codes[item[1]], jobs) for item in work]
    missing = [item for item, path in zip(work, paths, strict=True) if path is None or not is_there(path)]
    jobs = min(JOBS.convert("jobs", jobs), len(missing))
    made_for, begin = iter(missing), partial(_warm_up, tuple(dict.fromkeys(item[1] for item in missing)))
    due = next(made_for, None)
    with worker_map(jobs, begin) as spread:
        made = iter(spread(_work, missing))
        for item, path in zip(work, paths, strict=True):
            scored = None
            if item is due:
                scored, due = next(made), next(made_for, None)
            (row,), labels = kept_rows(path, MapScore, partial(_score_of, item, scored), LABELS)
            yield item[0], row, labels


_Work = tuple[Case, str, str, float]
"""What is scored: a map, a method, the protocol, and metres a pixel."""


def _kept(store: Path | None, item: _Work, code: str, jobs: int) -> Path | None:
    """Where a score is kept, by all that it is made from; with other processes beside it took other times."""
    if store is None:
        return None
    case, method, protocol, resolution = item
    files = fingerprint([case.image, case.truth])
    known = case.folder, case.building, case.resolution, files
    return kept_file(store, case.name, known, method, code, protocol, resolution, jobs > 1)


def _score_of(item: _Work, scored: tuple[Case, MapScore, Ints32] | None) -> tuple[list[MapScore], Ints32]:
    """What a worker has scored; one whose file is damaged is scored here."""
    _, row, labels = scored or _work(item)
    return [row], labels


def _work(item: _Work) -> tuple[Case, MapScore, Ints32]:
    case, method, protocol, resolution = item
    row, layout = score_case(case, method, protocol=protocol, resolution=resolution)
    return case, row, layout.labels


def _warm_up(methods: Sequence[str]) -> None:
    """Load or compile everything a method needs before its time is taken."""
    cells = np.full((120, 160), -1, np.int8)
    cells[20:100, 20:140] = 100
    cells[23:97, 23:80] = 0
    cells[23:97, 83:137] = 0
    cells[50:68, 80:83] = 0
    for method in methods:
        reconstruct(OccupancyGrid(cells, 0.05), method)


@checks_arguments
def summarise_segmentation(rows: Sequence[MapScore]) -> list[dict[str, Any]]:
    """Mean and standard deviation (ddof 0) over the maps of each folder and method, as they appear.

    With how many buildings stand behind it, and the 95 % interval of one-to-one from resampling them
    (NaN where there is one only).
    """
    groups: dict[tuple[str, str], list[MapScore]] = {}
    for row in rows:
        groups.setdefault((row.folder, row.method), []).append(row)
    out = []
    for (folder, method), part in groups.items():
        buildings = [row.building for row in part]
        interval = cluster_bootstrap([row.one_to_one for row in part], buildings, weighted_mean)
        line: dict[str, Any] = {
            "folder": folder,
            "method": method,
            "maps": len({row.map for row in part}),
            "buildings": len(set(buildings)),
            "low": interval.low,
            "high": interval.high,
        }
        for column in COLUMNS:
            values = np.array([getattr(row, column) for row in part], np.float64)
            line[column], line[f"{column}_std"] = float(values.mean()), float(values.std())
        out.append(line)
    return out


@checks_arguments
def score_groups(rows: Sequence[MapScore], by: Literal["source", "building"]) -> list[dict[str, Any]]:
    """Means over the maps of each source, or of each building in each source and folder, as they appear."""
    groups: dict[tuple[str, ...], list[MapScore]] = {}
    for row in rows:
        key = (row.source, *((row.folder, row.building) if by == "building" else ()))
        groups.setdefault(key, []).append(row)
    out = []
    for key, part in groups.items():
        names = dict(zip(("source", "folder", "building"), key, strict=False))
        line: dict[str, Any] = {**names, "maps": len({(row.folder, row.map) for row in part})}
        line["buildings"] = len({row.building for row in part})
        line |= {m: float(np.mean([getattr(row, m) for row in part])) for m in MEASURES}
        out.append(line)
    return out


@checks_arguments
def seed_spread(rows: Sequence[MapScore]) -> list[dict[str, Any]]:
    """Standard deviation (ddof 1) over the seeds of the means over each folder's maps, as they appear."""
    groups: dict[str, dict[int, list[MapScore]]] = {}
    for row in rows:
        groups.setdefault(row.folder, {}).setdefault(row.seed, []).append(row)
    out = []
    for folder, seeds in groups.items():
        line: dict[str, Any] = {"folder": folder, "seeds": len(seeds)}
        for column in MEASURES:
            means = [np.mean([getattr(row, column) for row in part]) for part in seeds.values()]
            line[column] = float(np.std(means, ddof=1)) if len(means) > 1 else float("nan")
        out.append(line)
    return out


@checks_arguments
def in_percent(row: MapScore) -> dict[str, Any]:
    """A row of the table of results: measures in percent."""
    record = asdict(row)
    return record | {m: round(100 * record[m], 3) for m in MEASURES} | {"ms": round(row.ms, 2)}
