"""Simulated maps to learn the merging of regions from: clean ones, and ones with the noise of recorded maps.

A third of the maps is seen by a lidar that may be noisy (`layoutexplore.training.simulated_maps`); a third
has the noise of recorded maps: walls in pieces and doubled, beams through glass and doors, rows of desks,
leaves half open, recesses; a third has noise from ranges that are wider still, for nobody knows the maps to
come. Buildings whose walls run in many directions are rare among these plans: besides there are maps of
polygonal ones (`layoutexplore.training.polygonal_buildings`), most of them drawn as a plan is, with furniture
and without noise.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from layoutexplore.errors import LayoutExploreError
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.training.folds import Progress, silent
from layoutexplore.training.map_noise.fit import LARGEST
from layoutexplore.training.map_noise.simulate import WIDE, MapNoise, MapNoiseConfig, simulate_map
from layoutexplore.training.map_noise.weather import weather
from layoutexplore.training.merging_examples import SIMULATED, Example, make_example
from layoutexplore.training.polygonal_buildings.polygonal_floors import polygonal_floor
from layoutexplore.training.simulated_maps import drawn_example, simulated_example

NOISES: tuple[MapNoiseConfig | None, ...] = (None, MapNoiseConfig(), WIDE)
"""Noise of a map, each as often; None for a lidar alone."""


WEATHERED = 0.5
"""Share of the maps with the noise of recorded ones that are weathered besides, where any are."""


def noisy_example(
    plan: FloorPlan, config: MapNoiseConfig, rng: np.random.Generator, weathered: bool = False
) -> Example | None:
    """A map with the noise of recorded ones; None for a plan that is too large or where no robot fits in.

    It may be weathered besides, where it is said so (`layoutexplore.training.map_noise.weather`).
    """
    made = simulate_map(plan, MapNoise.draw(config, rng), rng, largest=LARGEST)
    if made is None:
        return None
    cells, rooms = made.cells, made.rooms
    if weathered and rng.random() < WEATHERED:
        cells, rooms = weather(cells, rooms, made.resolution, rng)
    example = make_example(cells, rooms, made.resolution, building=SIMULATED, kind=plan.name)
    return replace(example, noisy=True)


POLYGONAL = 3
"""To so many maps of other plans comes one of a polygonal building; of so many of those one has noise."""


def polygonal_examples(count: int, seed: int = 1, progress: Progress = silent) -> tuple[Example, ...]:
    """Maps of polygonal buildings, most as they are drawn; the same seed gives the same maps."""
    out = []
    for k in range(count):
        progress("polygonal buildings simulated", k + 1, count)
        rng = np.random.default_rng([seed, k, 0])
        noise = (MapNoiseConfig(), WIDE)[k // POLYGONAL % 2]
        try:
            plan = polygonal_floor(1000 * seed + k)
            example = drawn_example(plan, rng) if k % POLYGONAL else noisy_example(plan, noise, rng)
        except LayoutExploreError:
            continue
        if example is not None:
            out.append(example)
    return tuple(out)


def simulated_examples(
    count: int,
    plans: tuple[str, ...] = (),
    seed: int = 1,
    progress: Progress = silent,
    weathered: bool = False,
) -> tuple[Example, ...]:
    """Maps of floor plans: every third of a given one in turn, the others generated, of all families in turn.

    Args:
        count: Maps; a few are left out where the plan is too large.
        plans: Files of floor plans, or names that `layoutexplore.maps.load_plan` knows.
        seed: Of noise, furniture, scans and plans; the same seed gives the same maps.
        progress: Receives what is being done, how often it has been done, and how often it will be.
        weathered: Whether some of those with the noise of recorded maps are weathered besides.
    """
    out = []
    for k in range(count):
        progress("maps simulated", k + 1, count)
        rng = np.random.default_rng([seed, k])
        noise = NOISES[int(rng.integers(len(NOISES)))]
        try:
            plan = _plan(k, plans, seed)
            example = (
                simulated_example(plan, rng) if noise is None else noisy_example(plan, noise, rng, weathered)
            )
        except LayoutExploreError:
            continue
        if example is not None:
            out.append(example)
    return tuple(out)


def _plan(k: int, plans: tuple[str, ...], seed: int) -> FloorPlan:
    from layoutexplore.maps import load_plan
    from layoutexplore.maps.generator import FAMILIES, generate

    if plans and k % 3 == 0:
        return load_plan(plans[k // 3 % len(plans)])
    families = sorted(FAMILIES)
    return generate(families[k % len(families)], 1000 * seed + k)
