"""A floor plan as a robot with a real lidar and a drifting pose would have mapped it, with its rooms."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import NamedTuple

import cv2
import numpy as np

from layoutexplore.errors import ConfigError
from layoutexplore.grids.arrays import Bytes, Cells, Ints32, Mask
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN, Cell, Pose, in_cells
from layoutexplore.grids.morphology import inflate
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.raster import PlanRaster
from layoutexplore.planning.shortest_paths import geodesic_distances
from layoutexplore.sensing.lidar import Lidar, LidarConfig
from layoutexplore.sensing.mapper import Mapper
from layoutexplore.training.map_noise.clutter import draw_desks, draw_leaves, glass_of
from layoutexplore.training.simulated_maps import furnish_cells

Range = tuple[float, float]

MARGIN = 3.0
"""Space around the building that beams reach through glass and doors [m]."""

CLEARANCE = 0.2
"""The robot keeps so far from what is solid [m]."""

LEAST = 4.0
"""A robot that has less space to stand in maps nothing [m2]."""

THICKEST = 0.35
"""What is solid farther from free space than this is no wall but the outside [m]."""


@dataclass(frozen=True, kw_only=True)
class MapNoiseConfig:
    """Ranges that the noise of a map is drawn from, each evenly.

    The defaults were fitted by `layoutexplore evaluate map-noise` to 111 recorded maps of homes and offices.

    Attributes:
        resolution: Metres a cell.
        range_max: Of the lidar [m].
        beams: Of a scan.
        explored: Share of the building that was explored; above 1 it was all of it.
        spacing: Distance between scans [m].
        range_noise: Standard deviation of a range [m].
        dropout: Share of the beams that tell nothing.
        drift: Standard deviation of a step of the pose's error from scan to scan [m].
        turn_drift: The same of its heading [rad].
        furniture: Pieces a square metre.
        desks: Share of the large rooms with rows of desks.
        leaves: Share of the doors with a leaf half open.
        recesses: Share of the doors in a recess.
        glass: Strips of glass for ten metres of outer wall.
        passed: Share of the scans whose beams pass a strip of glass.
        outdoors: Things that stand outside, a square metre.
        dust: Specks in free space, a square metre: legs, feet, wrong echoes.
        broken: Share of the occupied cells that are lost again, in holes.
        smeared: Share of the maps whose walls are a cell wider.
        cleaned: Share of the maps whose specks are taken out.
    """

    resolution: Range = (0.04, 0.053)
    range_max: Range = (7.0, 18.5)
    beams: Range = (590, 955)
    explored: Range = (0.9, 1.3)
    spacing: Range = (1.5, 2.7)
    range_noise: Range = (0.006, 0.023)
    dropout: Range = (0.018, 0.14)
    drift: Range = (0.012, 0.044)
    turn_drift: Range = (0.0015, 0.0104)
    furniture: Range = (0.006, 0.17)
    desks: Range = (0.068, 0.27)
    leaves: Range = (0.18, 0.54)
    recesses: Range = (0.032, 0.22)
    glass: Range = (0.16, 0.81)
    passed: Range = (0.35, 0.82)
    outdoors: Range = (0.025, 0.105)
    dust: Range = (0.26, 0.9)
    broken: Range = (0.007, 0.047)
    smeared: Range = (0.016, 0.14)
    cleaned: Range = (0.004, 0.028)

    def __post_init__(self) -> None:
        for each in fields(self):
            low, high = getattr(self, each.name)
            if not 0 <= low <= high < float("inf"):
                raise ConfigError(f"{each.name} must be a range from 0 up, got {low} to {high}")
        if self.resolution[0] <= 0 or self.range_max[0] <= 0 or self.beams[0] < 1:
            raise ConfigError("resolution, range_max and beams must be above 0")
        if self.dropout[1] >= 1:
            raise ConfigError(f"dropout must be below 1, got up to {self.dropout[1]}")


WIDE = MapNoiseConfig(
    resolution=(0.03, 0.1),
    range_max=(4.0, 25.0),
    beams=(180, 1080),
    explored=(0.2, 1.4),
    spacing=(1.0, 3.0),
    range_noise=(0.0, 0.05),
    dropout=(0.0, 0.2),
    drift=(0.0, 0.08),
    turn_drift=(0.0, 0.02),
    furniture=(0.0, 0.4),
    desks=(0.0, 0.6),
    leaves=(0.0, 0.7),
    recesses=(0.0, 0.3),
    glass=(0.0, 1.5),
    passed=(0.2, 1.0),
    outdoors=(0.0, 0.1),
    dust=(0.0, 3.0),
    broken=(0.0, 0.15),
    smeared=(0.0, 0.6),
    cleaned=(0.0, 0.6),
)
"""What a fit begins with."""


class MapNoise(NamedTuple):
    """The noise of one map: a number from each range of `MapNoiseConfig`, by the same names."""

    resolution: float
    range_max: float
    beams: float
    explored: float
    spacing: float
    range_noise: float
    dropout: float
    drift: float
    turn_drift: float
    furniture: float
    desks: float
    leaves: float
    recesses: float
    glass: float
    passed: float
    outdoors: float
    dust: float
    broken: float
    smeared: float
    cleaned: float

    @classmethod
    def draw(cls, config: MapNoiseConfig, rng: np.random.Generator) -> MapNoise:
        """A number from each range."""
        return cls(*(float(rng.uniform(*getattr(config, name))) for name in cls._fields))


@dataclass(frozen=True, eq=False)
class NoisyMap:
    """A simulated map.

    Attributes:
        cells: int8 (rows, cols), trinary.
        rooms: int32 (rows, cols), true room of each cell, 0 for none.
        resolution: Metres a cell.
        noise: What it was made with.
    """

    cells: Cells
    rooms: Ints32
    resolution: float
    noise: MapNoise


@dataclass(frozen=True, eq=False)
class _World:
    """What the beams meet: walls, things, and glass that some scans do not see."""

    solid: Mask
    glass: Mask
    rooms: Ints32
    origin: Pose
    scanners: dict[bool, Lidar] = field(default_factory=dict)

    def lidar(self, config: LidarConfig, resolution: float, passed: bool) -> Lidar:
        """A lidar that passes the glass, or does not."""
        if passed not in self.scanners:
            solid = self.solid & ~self.glass if passed else self.solid
            self.scanners[passed] = Lidar(config, solid, resolution, self.origin)
        return self.scanners[passed]


def simulate_map(
    plan: FloorPlan, noise: MapNoise, rng: np.random.Generator, *, largest: float = float("inf")
) -> NoisyMap | None:
    """A map of a floor plan with noise; None where no robot fits in, or the plan is too large.

    Args:
        plan: The building's floor.
        noise: How much of what.
        rng: Source of randomness.
        largest: Area of the plan's box above which it is left out [m2].
    """
    raster = plan.rasterize(noise.resolution, margin=MARGIN)
    if raster.room_ids.size * noise.resolution**2 > largest:
        return None
    world = _furnished(plan, raster, noise, rng)
    sensor = LidarConfig(
        range_max=noise.range_max,
        fov=2 * np.pi,
        beams=round(noise.beams),
        range_noise_std=noise.range_noise,
        dropout=noise.dropout,
    )
    mapper = Mapper(world.solid.shape, noise.resolution, world.origin)
    # doorways belong to no room, and the robot goes through them
    away = ~inflate(world.solid, CLEARANCE, noise.resolution) & ~raster.occupied
    error = np.zeros(3)
    for cell in _stops(away, noise, rng):
        x, y = mapper.grid.cell_to_world(*cell)
        pose = Pose(x, y, float(rng.uniform(-np.pi, np.pi)))
        # a pose that is corrected now and then: its error comes back instead of growing for ever
        error = 0.9 * error + rng.normal(size=3) * (noise.drift, noise.drift, noise.turn_drift)
        lidar = world.lidar(sensor, noise.resolution, bool(rng.random() < noise.passed))
        believed = Pose(x + error[0], y + error[1], pose.theta + error[2])
        mapper.integrate(believed, lidar.scan(pose, rng), sensor)
    if not (mapper.grid.cells == FREE).any():
        return None
    cells = _finished(mapper.grid.cells, noise, rng)
    return NoisyMap(cells, world.rooms, noise.resolution, noise)


def _stops(allowed: Mask, noise: MapNoise, rng: np.random.Generator) -> list[Cell]:
    """Places to scan from, about `spacing` apart, the nearest to a random start first."""
    places = np.argwhere(allowed)
    if len(places) * noise.resolution**2 < LEAST:
        return []
    start = places[rng.integers(len(places))]
    away = geodesic_distances(allowed, Cell(int(start[0]), int(start[1])), noise.resolution)
    area = np.count_nonzero(np.isfinite(away)) * noise.resolution**2
    count = max(int(area / noise.spacing**2), 3)
    some = places[rng.integers(len(places), size=count)]
    distances = away[some[:, 0], some[:, 1]]
    near = np.argsort(distances, kind="stable")[: max(round(count * min(noise.explored, 1.0)), 2)]
    return [Cell(int(r), int(c)) for r, c in some[near[np.isfinite(distances[near])]]]


def _furnished(plan: FloorPlan, raster: PlanRaster, noise: MapNoise, rng: np.random.Generator) -> _World:
    """The building with all that stands in it, in space that beams can leave it into."""
    resolution, indoors = raster.resolution, ~raster.occupied
    away = cv2.distanceTransform((~indoors).view(np.uint8), cv2.DIST_L2, 5) * resolution
    outside = raster.occupied & (away > THICKEST)
    things = np.zeros(raster.occupied.shape, np.uint8)
    draw_desks(things, raster.room_ids, noise.desks, resolution, rng)
    draw_leaves(things, plan, raster, leaves=noise.leaves, recesses=noise.recesses, rng=rng)
    count = rng.poisson(noise.outdoors * np.count_nonzero(outside) * resolution**2)
    places = np.argwhere(outside)
    for row, col in places[rng.integers(len(places), size=count)] if len(places) else ():
        cv2.circle(things, (int(col), int(row)), in_cells(float(rng.uniform(0.1, 1.2)), resolution), 1, -1)
    walls = raster.occupied & ~outside
    solid = furnish_cells(walls, raster.room_ids, noise.furniture, resolution, rng) | (things > 0)
    glass = glass_of(walls, outside, noise.glass, resolution, rng)
    return _World(solid, glass, raster.room_ids, raster.origin)


def _finished(cells: Cells, noise: MapNoise, rng: np.random.Generator) -> Cells:
    """What becomes of the mapper's grid: holes in walls, wider walls, specks taken out."""
    out, side = cells.copy(), np.ones((3, 3), np.uint8)
    if noise.broken:
        holes: Bytes = (rng.random(cells.shape) < noise.broken / 4).astype(np.uint8)
        holes = np.asarray(cv2.dilate(holes, np.ones((2, 2), np.uint8)), np.uint8)
        out[(holes > 0) & (cells == OCCUPIED)] = UNKNOWN if rng.random() < 0.5 else FREE
    out[(cells == FREE) & (rng.random(cells.shape) < noise.dust * noise.resolution**2)] = OCCUPIED
    if rng.random() < noise.smeared:
        out[cv2.dilate((out == OCCUPIED).astype(np.uint8), side) > 0] = OCCUPIED
    if rng.random() < noise.cleaned:
        occupied = (out == OCCUPIED).astype(np.uint8)
        _, labels, stats, _ = cv2.connectedComponentsWithStats(occupied, connectivity=8)
        small = stats[:, cv2.CC_STAT_AREA] * noise.resolution**2 < 0.05
        out[(occupied > 0) & small[labels]] = FREE
    return out
