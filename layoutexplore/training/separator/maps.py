"""Simulated maps for the separator network: six in eight with the noise of recorded maps, two clean.

Each is learnt from as it is, and weathered in two ways (`layoutexplore.training.map_noise.weather`).
"""

from __future__ import annotations

import warnings
import zlib
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np

import layoutexplore
from layoutexplore.errors import LayoutExploreError, ResultsError
from layoutexplore.files import ArrayRule, read_arrays, write_arrays
from layoutexplore.files.archives import check_arrays
from layoutexplore.files.reading import is_file
from layoutexplore.grids.arrays import Cells, Ints32
from layoutexplore.layout.merging.separator.planes import KINDS as PLANES
from layoutexplore.maps import load_plan
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.library import source_files
from layoutexplore.plugins.transport import worker_map
from layoutexplore.training.folds import Progress, silent
from layoutexplore.training.map_noise.fit import LARGEST
from layoutexplore.training.map_noise.simulate import WIDE, MapNoise, MapNoiseConfig, simulate_map
from layoutexplore.training.map_noise.weather import weather
from layoutexplore.training.separator.examples import SeparatorExample, separator_example
from layoutexplore.training.simulated_maps import RESOLUTION, drawn_cells, generated_plan, scanned_cells

KnownMap = tuple[Cells, Ints32, float]
"""A map int8 (rows, cols), the true room of each cell int32 (rows, cols), 0 for none, and metres a cell."""

KINDS, NOISY, SCANNED = 8, 6, 6
"""Of so many kinds of maps the first have noise (half of them fitted, half wide); the next is one of a lidar
alone, the last one as a plan is drawn."""

WEATHERED = 2
"""So often each map is weathered."""

GIVEN = 3
"""One plan in so many is a given one, the others are generated."""


def separator_examples(
    count: int,
    plans: Sequence[str] = (),
    *,
    seed: int = 7,
    cache: Path | None = None,
    workers: int = 0,
    progress: Progress = silent,
) -> list[SeparatorExample]:
    """What maps of floor plans teach; plans that are too large or that no robot fits in are left out.

    Args:
        count: Floor plans to try.
        plans: What `load_plan` knows; the same seed gives the same maps of them and of generated ones.
        seed: Of plans and maps.
        cache: Folder in which the examples of each plan are kept: a run that was stopped goes on.
        workers: Processes that simulate; 0 for this one.
        progress: Told of the maps tried.
    """
    kept = cache / f"{mark_of(plans)}-{seed}" if cache else None
    work = partial(_examples_of, plans=tuple(plans), seed=seed, begin=kept)
    out: list[SeparatorExample] = []
    with worker_map(workers) as spread:
        for k, found in enumerate(spread(work, range(count))):
            out += found
            progress("maps simulated", k + 1, count)
    return out


def _examples_of(k: int, plans: tuple[str, ...], seed: int, begin: Path | None) -> list[SeparatorExample]:
    """What a plan teaches, from the cache, whose files' names begin so, where it is there."""
    kept = begin.with_name(f"{begin.name}-{k}.npz") if begin else None
    found = _read(kept) if kept is not None and kept.exists() else None
    if found is None:
        found = [separator_example(*one) for one in known_maps(k, plans, seed)]
        if kept is not None:
            write_arrays(
                kept, {f"{name}-{n}": getattr(e, name) for n, e in enumerate(found) for name in _KEPT}
            )
    return found


def mark_of(plans: Sequence[str]) -> str:
    """Tells what was made of other plans, or of other content of their files, or by another version."""
    mark = zlib.crc32(chr(10).join([layoutexplore.__version__, *plans]).encode())
    for path in filter(is_file, (file for plan in plans for file in source_files(plan))):
        mark = zlib.crc32(path.read_bytes(), mark)
    return f"{mark:08x}"


_KEPT = {
    "shares": ArrayRule(kinds="u", shape=("rows", "cols", PLANES), optional=True),
    "rooms": ArrayRule(kinds="i", shape=("half rows", "half cols"), optional=True),
    "thing": ArrayRule(kinds="u", shape=("half rows", "half cols"), optional=True),
    "thing_weight": ArrayRule(kinds="u", shape=("half rows", "half cols"), optional=True),
}
"""What is kept of a map."""


def _read(kept: Path) -> list[SeparatorExample] | None:
    """Examples that were kept; None, with a warning, where the file is damaged."""
    try:
        arrays = read_arrays(kept)
        count = sum(name.startswith("shares-") for name in arrays)
        out = []
        for n in range(count):
            one = {name: arrays[f"{name}-{n}"] for name in _KEPT if f"{name}-{n}" in arrays}
            check_arrays(one, _KEPT, str(kept), ResultsError)
            if len(one) < len(_KEPT):
                raise ResultsError(f"{kept} is damaged: a part of example {n} is missing")
            out.append(SeparatorExample(**one))
    except ResultsError as error:
        warnings.warn(f"{error}; it is made anew", stacklevel=2)
        return None
    return out


def known_maps(k: int, plans: Sequence[str], seed: int) -> list[KnownMap]:
    """The map of a floor plan as it is and weathered; none of a plan that is left out."""
    rng = np.random.default_rng([seed, k, 7])
    kind = int(rng.integers(KINDS))
    try:
        made = _map_of(_plan(k, plans, seed, rng), kind, rng)
    except LayoutExploreError:
        return []
    if made is None:
        return []
    ways = (np.random.default_rng([seed, k, 8, n]) for n in range(1, WEATHERED + 1))
    return [made, *((*weather(*made, way), made[2]) for way in ways)]


def _plan(k: int, plans: Sequence[str], seed: int, rng: np.random.Generator) -> FloorPlan:
    if plans and k % GIVEN == 0:
        return load_plan(plans[int(rng.integers(len(plans)))])
    return generated_plan(k, seed)


def _map_of(plan: FloorPlan, kind: int, rng: np.random.Generator) -> KnownMap | None:
    if kind < NOISY:
        noise = MapNoise.draw(MapNoiseConfig() if kind < NOISY // 2 else WIDE, rng)
        made = simulate_map(plan, noise, rng, largest=LARGEST)
        return None if made is None else (made.cells, made.rooms, made.resolution)
    raster = plan.rasterize(RESOLUTION)
    if raster.room_ids.size > round(LARGEST / RESOLUTION**2):
        return None
    cells = drawn_cells(plan, raster, rng) if kind > SCANNED else scanned_cells(raster, rng)
    return None if cells is None else (cells, raster.room_ids.astype(np.int32), RESOLUTION)
