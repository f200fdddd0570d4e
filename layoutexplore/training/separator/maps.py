"""Simulated maps for the separator network: six in eight with the noise of recorded maps, two clean.

Each is learnt from as it is and weathered (`layoutexplore.training.map_noise.weather`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from layoutexplore.errors import LayoutExploreError
from layoutexplore.grids.arrays import Cells, Ints32
from layoutexplore.maps import load_plan
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.generator import FAMILIES, generate
from layoutexplore.training.folds import Progress, silent
from layoutexplore.training.map_noise.fit import LARGEST
from layoutexplore.training.map_noise.simulate import WIDE, MapNoise, MapNoiseConfig, simulate_map
from layoutexplore.training.map_noise.weather import weather
from layoutexplore.training.simulated_maps import RESOLUTION, drawn_cells, scanned_cells

KnownMap = tuple[Cells, Ints32, float]
"""A map int8 (rows, cols), the true room of each cell int32 (rows, cols), 0 for none, and metres a cell."""

KINDS, NOISY, SCANNED = 8, 6, 6
"""Of so many kinds of maps the first have noise (half of them fitted, half wide); the next is one of a lidar
alone, the last one as a plan is drawn."""

GIVEN = 3
"""One plan in so many is a given one, the others are generated."""


def separator_maps(
    count: int, plans: Sequence[str] = (), *, seed: int = 7, progress: Progress = silent
) -> Iterator[KnownMap]:
    """Maps of floor plans, and each of them weathered besides.

    Those of plans that are too large or that no robot fits in are left out.

    Args:
        count: Maps to try.
        plans: What `load_plan` knows; the same seed gives the same maps of them and of generated ones.
        seed: Of plans and maps.
        progress: Told of the maps tried.
    """
    n = 0
    for k in range(count):
        progress("maps simulated", k + 1, count)
        rng = np.random.default_rng([seed, k, 7])
        kind = int(rng.integers(KINDS))
        try:
            made = _map_of(_plan(k, plans, seed, rng), kind, rng)
        except LayoutExploreError:
            continue
        if made is not None:
            yield made
            yield (*weather(*made, np.random.default_rng([seed, n, 8])), made[2])
            n += 1


def _plan(k: int, plans: Sequence[str], seed: int, rng: np.random.Generator) -> FloorPlan:
    if plans and k % GIVEN == 0:
        return load_plan(plans[int(rng.integers(len(plans)))])
    families = sorted(FAMILIES)
    return generate(families[k % len(families)], 1000 * seed + k)


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
