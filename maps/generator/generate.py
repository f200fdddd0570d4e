"""The generator: space graphs are drawn until one has the wanted size, then built and furnished.

Every attempt has its own random stream, seeded by family, seed and attempt; so the result depends on nothing
else. The size of the next attempt is corrected by how far the last one was off.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import shapely
from shapely import Polygon

from layoutexplore.errors import ConfigError, checks_arguments, shortened, unknown_name
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.generator import corridor_buildings
from layoutexplore.maps.generator.apartment import apartment
from layoutexplore.maps.generator.config import DrawnConfig, PlanConfig
from layoutexplore.maps.generator.construction import build_rooms, net_polygons
from layoutexplore.maps.generator.furniture import place_furniture
from layoutexplore.maps.generator.hall import hall
from layoutexplore.maps.generator.non_orthogonal import angled, curved
from layoutexplore.maps.generator.space_graph import AttemptError, SpaceGraph

Draw = Callable[[DrawnConfig, float, np.random.Generator], SpaceGraph]
"""A family: configuration, gross area to aim at (m2), random stream -> space graph."""

_DRAW: Mapping[str, Draw] = {
    "office": corridor_buildings.office,
    "school": corridor_buildings.school,
    "apartment": apartment,
    "hospital": corridor_buildings.hospital,
    "hall": hall,
    "angled": angled,
    "curved": curved,
}

FAMILIES: tuple[str, ...] = tuple(_DRAW)
"""Names of the families."""

RIGHT_ANGLED = ("office", "school", "apartment", "hospital")
"""Families that stand on a corridor skeleton, so that a topology can be asked for."""

GROSS_FACTOR = 1.12
"""Gross over net area of a first guess."""

AREA_GOOD, AREA_LIMIT = 0.1, 0.24
"""An attempt within the first share of the wanted area is taken at once; one beyond the second never."""

ROOMS_GOOD = 0.15
"""An attempt within this share of the wanted number of rooms is taken at once."""

ATTEMPTS = 40


@dataclass
class _Attempt:
    """A space graph with its outline and net polygons, and how far it is from what was asked."""

    number: int
    graph: SpaceGraph
    outline: Polygon
    floors: dict[int, Polygon]
    error: float


@checks_arguments
def generate(family: str, seed: int, config: PlanConfig | None = None, **parameters: Any) -> FloorPlan:
    """A floor plan; the same arguments always give the same plan, bit by bit.

    Args:
        family: One of `FAMILIES`.
        seed: Any whole number from 0.
        config: The parameters; see `PlanConfig`.
        parameters: Single parameters that replace those of `config`, such as `area=500.0`.

    Returns:
        A plan named FAMILY-SEED whose rooms are disjoint, labelled, and all reachable for a robot of radius
        0.2 m at a resolution of 0.1 m when its doors are open. Doors to the outside are closed.

    Raises:
        ConfigError: Unknown family or parameter, a nonsensical value, or a building that cannot be drawn at
            that size.
    """
    if not isinstance(family, str) or family not in _DRAW:
        raise unknown_name("family", str(family), FAMILIES)
    if isinstance(seed, bool) or not isinstance(seed, (int, np.integer)) or seed < 0:
        raise ConfigError(f"the seed must be a whole number, 0 or more, got {shortened(seed)}")
    wanted = (config or PlanConfig()).with_parameters(parameters)
    if wanted.topology is not None and family not in RIGHT_ANGLED:
        raise ConfigError(
            f"the family {shortened(family)} has no topology: only {', '.join(RIGHT_ANGLED)} have"
        )
    drawn = wanted.drawn(family, _stream(family, seed, 0))
    for attempt in _attempts(family, int(seed), drawn):
        try:
            built = build_rooms(
                attempt.graph,
                attempt.outline,
                drawn,
                wanted.closed_doors,
                _stream(family, seed, 1, attempt.number),
                attempt.floors,
            )
        except AttemptError:
            continue
        furniture = place_furniture(built, wanted.clutter, _stream(family, seed, 2))
        return FloorPlan(
            name=f"{family}-{seed}",
            building=f"{family}-{seed}",
            rooms=tuple(built.rooms),
            doors=tuple(built.doors),
            walls=built.walls,
            furniture=furniture,
            metadata={"family": family, "seed": str(seed), "source": "layoutexplore generator"},
        )
    shape = f" of topology {drawn.topology}" if drawn.topology else ""
    raise ConfigError(
        f"no {family}{shape} of {drawn.area:.0f} m2 could be drawn from seed {seed}: "
        "ask for another size or seed"
    )


def _stream(family: str, seed: int, *key: int) -> np.random.Generator:
    """A random stream of its own for every family, seed and purpose."""
    return np.random.default_rng([zlib.crc32(family.encode()), int(seed), *key])


def _attempts(family: str, seed: int, config: DrawnConfig) -> Iterator[_Attempt]:
    """Attempts in the order in which to build them: good ones as they come, then the closest."""
    spare: list[_Attempt] = []
    gross, scale = config.area * GROSS_FACTOR, 1.0
    for number in range(ATTEMPTS):
        try:
            graph = _DRAW[family](replace(config, scale=scale), gross, _stream(family, seed, 3, number))
            outline = graph.check_disjoint()
            floors = net_polygons(graph, outline, config)
        except AttemptError:
            continue
        size = float(shapely.area(list(floors.values())).sum()) / config.area
        count = 1.0 if config.rooms is None else len(floors) / config.rooms
        attempt = _Attempt(number, graph, outline, floors, abs(size - 1.0) + 0.5 * abs(count - 1.0))
        if abs(size - 1.0) <= AREA_GOOD and abs(count - 1.0) <= ROOMS_GOOD:
            yield attempt
        elif abs(size - 1.0) <= AREA_LIMIT:
            spare.append(attempt)
        gross = float(np.clip(gross / size**0.7, 0.5 * config.area, 2.5 * config.area))
        scale = float(np.clip(scale * count**0.8, 0.4, 3.0))
    yield from sorted(spare, key=lambda attempt: attempt.error)
