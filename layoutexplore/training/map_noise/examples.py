"""Simulated maps to learn the merging of regions from: clean ones, and ones with the noise of recorded maps.

A third of the maps is seen by a lidar that may be noisy (`layoutexplore.training.simulated_maps`); a third
has the noise of recorded maps: walls in pieces and doubled, beams through glass and doors, rows of desks,
leaves half open, recesses; a third has noise from ranges that are wider still, for nobody knows the maps to
come. Buildings whose walls run in many directions are rare among these plans: besides there are maps of
polygonal ones (`layoutexplore.training.polygonal_buildings`), most of them drawn as a plan is, with furniture
and without noise.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from layoutexplore.errors import LayoutExploreError
from layoutexplore.grids.arrays import Cells, Ints32
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.library import load_plan
from layoutexplore.training.folds import Progress, silent
from layoutexplore.training.map_noise.fit import LARGEST
from layoutexplore.training.map_noise.simulate import WIDE, MapNoise, MapNoiseConfig, simulate_map
from layoutexplore.training.map_noise.weather import weather
from layoutexplore.training.merging_examples import SIMULATED, Example, make_example
from layoutexplore.training.polygonal_buildings.polygonal_floors import polygonal_floor
from layoutexplore.training.simulated_maps import drawn_example, generated_plan, simulated_example

NOISES: tuple[MapNoiseConfig | None, ...] = (None, MapNoiseConfig(), WIDE)
"""Noise of a map, each as often; None for a lidar alone."""

SEED = 1
"""Of what is drawn for the simulated maps."""

WEATHERED = 0.5
"""Share of the maps with the noise of recorded ones that are weathered besides, where any are."""


def noisy_example(plan: FloorPlan, config: MapNoiseConfig, rng: np.random.Generator) -> Example | None:
    """A map with the noise of recorded ones; None for a plan that is too large or where no robot fits in."""
    made = simulate_map(plan, MapNoise.draw(config, rng), rng, largest=LARGEST)
    return None if made is None else _noisy(plan, made.cells, made.rooms, made.resolution)


def _noisy(plan: FloorPlan, cells: Cells, rooms: Ints32, resolution: float) -> Example:
    return replace(make_example(cells, rooms, resolution, building=SIMULATED, kind=plan.name), noisy=True)


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
    count: int, plans: tuple[str, ...] = (), progress: Progress = silent
) -> tuple[Example, ...]:
    """Maps of floor plans: every third of a given one in turn, the others generated, of all families in turn.

    The same plans, furniture, scans and noise each time.

    Args:
        count: Maps; a few are left out where the plan is too large.
        plans: Files of floor plans, or names that `layoutexplore.maps.load_plan` knows.
        progress: Receives what is being done, how often it has been done, and how often it will be.
    """
    return tuple(example for example, _ in _simulated(count, plans, progress, weathered=False))


def weathered_pairs(
    count: int, plans: tuple[str, ...] = (), progress: Progress = silent
) -> tuple[tuple[Example, Example], ...]:
    """Each map of `simulated_examples`, and what is learnt beside the separator network in its place.

    That is the same map, or, for a share `WEATHERED` of those with the noise of recorded ones, the map after
    what befalls recorded ones besides (`layoutexplore.training.map_noise.weather`): on maps with whole walls
    the network is so right that it would be trusted too much.
    """
    return tuple(_simulated(count, plans, progress, weathered=True))


def _simulated(
    count: int, plans: tuple[str, ...], progress: Progress, *, weathered: bool
) -> Iterator[tuple[Example, Example]]:
    for k in range(count):
        progress("maps simulated", k + 1, count)
        rng = np.random.default_rng([SEED, k])
        noise = NOISES[int(rng.integers(len(NOISES)))]
        try:
            plan = load_plan(plans[k // 3 % len(plans)]) if plans and k % 3 == 0 else generated_plan(k, SEED)
            pair = _pair(plan, noise, rng, weathered=weathered)
        except LayoutExploreError:
            continue
        if pair is not None:
            yield pair


def _pair(
    plan: FloorPlan, noise: MapNoiseConfig | None, rng: np.random.Generator, *, weathered: bool
) -> tuple[Example, Example] | None:
    """A map, and the same one or a weathered one; None where none can be made of the plan."""
    if noise is None:
        example = simulated_example(plan, rng)
        return None if example is None else (example, example)
    made = simulate_map(plan, MapNoise.draw(noise, rng), rng, largest=LARGEST)
    if made is None:
        return None
    example = _noisy(plan, made.cells, made.rooms, made.resolution)
    if not (weathered and rng.random() < WEATHERED):
        return example, example
    return example, _noisy(plan, *weather(made.cells, made.rooms, made.resolution, rng), made.resolution)
