"""Layout methods on grid maps whose true rooms are painted: NAME.png beside NAME_gt.png.

The measures are those of `layoutexplore.metrics.segmentation`; the time is that of `reconstruct` alone, after
one run to warm up.
"""

from __future__ import annotations

import csv
import io
import re
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, fields
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from layoutexplore.errors import MapError
from layoutexplore.grids.grid import FREE, UNKNOWN, OccupancyGrid
from layoutexplore.grids.ros_map import load_grid, read_image, read_pixels
from layoutexplore.layout.pipeline import reconstruct
from layoutexplore.layout.types import Layout
from layoutexplore.metrics.segmentation import MEASURES, MIN_TRUTH_CELLS, score_segmentation, truth_labels
from layoutexplore.processes import end_with_parent

TRUTH_SUFFIX = "_gt"
FREE_FROM = 250
"""A pixel at least this bright is free (the protocol of the published tables)."""

COLUMNS = (*MEASURES, "segments", "rooms", "ms")

CLASSIC = frozenset({"morphological", "distance", "voronoi"})
"""Methods that are given what the protocol calls free and nothing else, as in the published tables."""

_FILLERS = {"scan", "map", "lab", "building", "plan", "floor", "furnitures", "furniture"}


@dataclass(frozen=True)
class Case:
    """A map with its truth.

    Attributes:
        folder: Name of the folder, which is the name of the set.
        name: Name of the map.
        image: The map.
        truth: The painted rooms.
        building: Maps of one building stay in one fold.
    """

    folder: str
    name: str
    image: Path
    truth: Path
    building: str


@dataclass(frozen=True, kw_only=True)
class MapScore:
    """The scores of one method on one map; measures in 0..1."""

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
    fold: int = -1
    seed: int = 0
    warnings: str = ""


def find_cases(folders: Iterable[str | Path], buildings: dict[str, str] | None = None) -> list[Case]:
    """The maps of folders that have a truth, by name.

    Args:
        folders: Folders with NAME.png and NAME_gt.png.
        buildings: Building of a map by "folder/name" or "name"; guessed from the name (`guess_building`)
            without.

    Raises:
        MapError: A folder is missing or holds no such pair.
    """
    cases = []
    for folder in map(Path, folders):
        if not folder.is_dir():
            raise MapError(f"{folder}: no such folder")
        pairs = []
        for truth in sorted(folder.glob(f"*{TRUTH_SUFFIX}.png")):
            image = truth.with_name(truth.name.replace(f"{TRUTH_SUFFIX}.png", ".png"))
            if image.is_file():
                pairs.append((image, truth))
        if not pairs:
            raise MapError(f"{folder}: no map NAME.png with its rooms NAME{TRUTH_SUFFIX}.png")
        known = buildings or {}
        for image, truth in pairs:
            name, here = image.stem, folder.resolve().name
            building = known.get(f"{here}/{name}") or known.get(name) or guess_building(name, here)
            cases.append(Case(here, name, image, truth, building))
    return cases


def guess_building(name: str, folder: str) -> str:
    """The building a map's name tells of, or the folder's name where it tells nothing.

    Example:
        >>> guess_building("Freiburg79_scan", "a"), guess_building("freiburg_building79", "b"), guess_building("map12", "tour")
        ('freiburg79', 'freiburg79', 'tour')
    """
    words = [w for w in re.findall(r"[a-z]+|\d+", name.lower()) if w not in _FILLERS]
    return "".join(words) if any(w.isalpha() for w in words) else folder


def read_case(case: Case, resolution: float) -> tuple[OccupancyGrid, NDArray[np.int32], NDArray[np.bool_]]:
    """The grid, the true rooms and the free cells of a map, rows from the lowest y.

    Raises:
        MapError: An image cannot be read, no room is painted, or the two differ in size.
    """
    grid = load_grid(case.image, resolution=resolution)
    pixels = read_pixels(case.truth)
    truth = truth_labels(pixels)[::-1]
    free = read_image(case.image)[0][::-1] >= FREE_FROM
    if not truth.any():
        raise MapError(
            f"{case.truth}: no room is painted; each is one colour of 8 bit on more than {MIN_TRUTH_CELLS} pixels"
        )
    if truth.shape != grid.shape:
        raise MapError(f"{case.truth}: {truth.shape} pixels, but the map has {grid.shape}")
    return grid, np.ascontiguousarray(truth), np.ascontiguousarray(free)


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
        resolution: Metres a pixel.
        run: What to run instead of the method of that name.
    """
    grid, truth, free = read_case(case, resolution)
    if method in CLASSIC:
        grid = OccupancyGrid(
            np.where(free, FREE, np.where(grid.free, UNKNOWN, grid.cells)).astype(np.int8), resolution
        )
    begin = time.perf_counter()
    layout = reconstruct(grid, method) if run is None else run(grid)
    seconds = time.perf_counter() - begin
    scores = score_segmentation(layout.labels, truth, free, protocol=protocol)
    row = MapScore(
        folder=case.folder,
        map=case.name,
        building=case.building,
        method=method,
        ms=1000 * seconds,
        warnings="; ".join(layout.warnings),
        **asdict(scores),
    )
    return row, layout


def evaluate_cases(
    cases: Sequence[Case], methods: Sequence[str], *, protocol: str, resolution: float, jobs: int = 1
) -> Iterator[tuple[Case, MapScore, NDArray[np.int32]]]:
    """Score every method on every map, in order, yielding the labels as well.

    Args:
        cases: The maps.
        methods: Names of the methods.
        protocol: Of `layoutexplore.metrics.segmentation.PROTOCOLS`.
        resolution: Metres a pixel.
        jobs: Processes; times are only comparable with 1.
    """
    work = [(case, method, protocol, resolution) for case in cases for method in methods]
    if jobs <= 1:
        _warm_up(methods)
        for item in work:
            yield _work(item)
        return
    with ProcessPoolExecutor(
        jobs, mp_context=get_context("spawn"), initializer=_begin_worker, initargs=(tuple(methods),)
    ) as pool:
        yield from pool.map(_work, work)


def _work(item: tuple[Case, str, str, float]) -> tuple[Case, MapScore, NDArray[np.int32]]:
    case, method, protocol, resolution = item
    row, layout = score_case(case, method, protocol=protocol, resolution=resolution)
    return case, row, layout.labels


def _begin_worker(methods: Sequence[str]) -> None:
    end_with_parent()
    _warm_up(methods)


def _warm_up(methods: Sequence[str]) -> None:
    """Load or compile everything a method needs before its time is taken."""
    cells = np.full((120, 160), -1, np.int8)
    cells[20:100, 20:140] = 100
    cells[23:97, 23:80] = 0
    cells[23:97, 83:137] = 0
    cells[50:68, 80:83] = 0
    for method in methods:
        reconstruct(OccupancyGrid(cells, 0.05), method)


def summarise(rows: Sequence[MapScore]) -> list[dict[str, Any]]:
    """Mean and standard deviation (ddof 0) over the maps of each folder and method, in the order of appearance."""
    groups: dict[tuple[str, str], list[MapScore]] = {}
    for row in rows:
        groups.setdefault((row.folder, row.method), []).append(row)
    out = []
    for (folder, method), part in groups.items():
        line: dict[str, Any] = {"folder": folder, "method": method, "maps": len(part)}
        for column in COLUMNS:
            values = np.array([getattr(row, column) for row in part], np.float64)
            line[column], line[f"{column}_std"] = float(values.mean()), float(values.std())
        out.append(line)
    return out


def seed_spread(rows: Sequence[MapScore]) -> list[dict[str, Any]]:
    """Standard deviation (ddof 1) over the seeds of the means over the maps of each folder, in the order of appearance."""
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


def to_csv(rows: Sequence[MapScore]) -> str:
    """The rows as CSV with a header; measures in percent, as in the tables."""
    text = io.StringIO()
    writer = csv.DictWriter(text, [f.name for f in fields(MapScore)], lineterminator="\n")
    writer.writeheader()
    for row in rows:
        record = asdict(row)
        record |= {m: round(100 * record[m], 3) for m in MEASURES} | {"ms": round(row.ms, 2)}
        writer.writerow(record)
    return text.getvalue()
