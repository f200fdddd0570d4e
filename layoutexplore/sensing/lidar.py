"""A two-dimensional lidar on a grid: exact ray casting with skips over open space.

Rays follow the cells they cross exactly (as Amanatides and Woo, "A fast voxel traversal algorithm for ray
tracing", 1987), from continuous poses. They advance in columns: along the axis that a ray moves more along it
crosses one border after the other, and in between at most one border across (`ray_frame`). Where the
Chebyshev distance to the nearest occupied cell is d, a ray jumps d - 1 columns; the jump lands on the very
cell of the plain traversal.

Rules that everything with walls shares (the lidar, the map update and the robot's own motion):

- A ray moves over one cell border at a time; where it meets a corner exactly, it first crosses the border of
  the axis that it moves less along (x leads on an exact diagonal). The cells of a ray are therefore joined by
  their sides, and no ray slips between two occupied cells that touch at a corner, just as no path of
  `layoutexplore.planning.shortest_paths` does.
- A range is the distance at which the ray enters the occupied cell.
- What lies outside of the array is occupied.
"""

from __future__ import annotations

import dataclasses
import math
import weakref
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numba import njit

from layoutexplore.errors import (
    ConfigError,
    MapError,
    StartError,
    checks_arguments,
    checks_calls,
    unknown_name,
)
from layoutexplore.grids.arrays import Bytes, Floats, Floats32, Mask
from layoutexplore.grids.grid import Pose, check_resolution
from layoutexplore.grids.morphology import measure_clearance
from layoutexplore.grids.rays import ray_frame, steps
from layoutexplore.options import Rule, check, check_kind, make_floats

MOST_BEAMS = 100_000
"""Beams of a scan, also of one all around with the density of a lidar that sees less."""

_SKIP_FROM = 3
"""A jump is cheaper than single steps from this clearance on."""


@dataclass(frozen=True, kw_only=True)
class LidarConfig:
    """What a lidar sees.

    A lidar of less than a full turn has its first and last beam on the borders of the field of view; one of a
    full turn has equally spaced beams, the first straight back.

    Attributes:
        name: Name of the preset, or "custom".
        range_max: Farthest distance that is measured, in metres.
        fov: Field of view in radians, centred on the heading; 2 pi is a full turn.
        beams: Number of beams in a scan.
        angle_offset: Angle in radians by which the sensor is turned on the robot, counter-clockwise.
        range_noise_std: Standard deviation in metres of Gaussian noise on each range.
        dropout: Probability that a beam fails and tells nothing.

    Raises:
        ConfigError: A value makes no sense.
    """

    name: str = "custom"
    range_max: float
    fov: float
    beams: int
    angle_offset: float = 0.0
    range_noise_std: float = 0.0
    dropout: float = 0.0

    def __post_init__(self) -> None:
        check_kind("name", self.name, str)
        numbers = Rule()
        check(
            self,
            f"lidar {self.name!r}: ",
            **dict.fromkeys(("range_max", "fov", "angle_offset", "range_noise_std", "dropout"), numbers),
            beams=Rule(kind=int, low=1, high=MOST_BEAMS),
        )
        make_floats(self)
        checks = {
            "range_max must be metres above 0 and at most 10000": 0 < self.range_max <= 1e4,
            "fov must be radians above 0 and at most 2 pi (6.283185)": 0 < self.fov <= 2 * math.pi + 1e-9,
            "angle_offset must be radians from -100 to 100": abs(self.angle_offset) <= 100,
            "range_noise_std must be metres from 0 to 1000": 0 <= self.range_noise_std <= 1e3,
            "dropout must be a probability below 1": 0 <= self.dropout < 1,
        }
        for message, good in checks.items():
            if not good:
                raise ConfigError(f"lidar {self.name!r}: {message}, got {self}")
        if (beams := _beams_around(self)) > MOST_BEAMS:
            raise ConfigError(
                f"lidar {self.name!r}: turned once around it has {beams} beams, at most {MOST_BEAMS} can be: "
                f"give fewer than {self.beams}, or a wider fov than {self.fov:g}"
            )

    @property
    def full_turn(self) -> bool:
        """Whether the lidar sees all around."""
        return self.fov >= 2 * math.pi - 1e-9

    @property
    def angle_increment(self) -> float:
        """Angle between neighbouring beams in radians."""
        if self.full_turn:
            return 2 * math.pi / self.beams
        return self.fov / (self.beams - 1) if self.beams > 1 else self.fov

    def angles(self) -> Floats:
        """Angles float64 (beams,) of the beams relative to the robot's heading, in radians, increasing."""
        if self.beams == 1 and not self.full_turn:
            return np.array([self.angle_offset])
        return (
            self.angle_offset - self.fov / 2 + np.arange(self.beams, dtype=np.float64) * self.angle_increment
        )

    @property
    def noisy(self) -> bool:
        """Whether ranges differ from the exact ones."""
        return self.range_noise_std > 0 or self.dropout > 0


@checks_arguments
def around(config: LidarConfig) -> LidarConfig:
    """The same lidar seeing all around with the same density of beams (what turning on the spot gives)."""
    if config.full_turn:
        return config
    return dataclasses.replace(config, fov=2 * math.pi, beams=_beams_around(config))


def _beams_around(config: LidarConfig) -> int:
    """Beams of a full turn with this density."""
    return max(1, round(min(2 * math.pi / config.angle_increment, 1e15)))


SENSORS: dict[str, LidarConfig] = {
    config.name: config
    for config in (
        # The simulated laser of the layout papers (Stage's SICK LMS: 180 degrees, 30 m, quarter degrees).
        LidarConfig(name="stage", range_max=30.0, fov=math.pi, beams=721),
        LidarConfig(name="indoor", range_max=8.0, fov=2 * math.pi, beams=720),
        LidarConfig(name="short", range_max=5.0, fov=2 * math.pi, beams=360),
        # MapEx (Ho et al. 2024): 20 m, 2500 samples in a full turn.
        LidarConfig(name="mapex", range_max=20.0, fov=2 * math.pi, beams=2500),
    )
}
"""The lidars that are known by name."""


def sensor(name: str | LidarConfig) -> LidarConfig:
    """The lidar of that name; a configuration is returned as it is.

    Raises:
        UnknownNameError: No sensor has that name.

    Example:
        >>> sensor("indoor").range_max
        8.0
    """
    if isinstance(name, LidarConfig):
        return name
    check_kind("sensor", name, str, LidarConfig)
    if name not in SENSORS:
        raise unknown_name("sensor", name, SENSORS)
    return SENSORS[name]


@checks_calls
class Lidar:
    """A lidar in a known world.

    Args:
        config: What it sees.
        occupied: bool (rows, cols); it must not change while the lidar is in use.
        resolution: Side of a cell in metres.
        origin: Pose of the lower left corner of cell (0, 0); its yaw must be 0.

    Lidars over the same array share one clearance field (one byte a cell) as long as the array is marked
    read-only (`occupied.setflags(write=False)`); over a writeable array each lidar computes its own.

    Attributes:
        config: The configuration.
        resolution: Side of a cell in metres.
        origin: Pose of the lower left corner of cell (0, 0).
        padded_clearance: uint8 (rows + 2, cols + 2), `clearance` with a border of zeros.

    Raises:
        MapError: The array is not two-dimensional, the resolution is not usable or the origin is turned.

    Example:
        >>> world = np.zeros((5, 9), bool)
        >>> world[:, 7] = True
        >>> lidar = Lidar(LidarConfig(range_max=5.0, fov=1.0, beams=1), world, 0.5, Pose(0, 0))
        >>> lidar.scan(Pose(1.25, 1.25))
        array([2.25], dtype=float32)
    """

    def __init__(self, config: LidarConfig, occupied: Mask, resolution: float, origin: Pose) -> None:
        check_resolution(resolution)
        check_upright(origin)
        self.config = config
        self.resolution = float(resolution)
        self.origin = Pose(*origin)
        self.padded_clearance = clearance_field(occupied)

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self.padded_clearance.setflags(write=False)  # a copy's is not: kernels would be compiled for it, too

    @property
    def clearance(self) -> Bytes:
        """uint8 (rows, cols): Chebyshev distance in cells to what is occupied or outside, at most 255."""
        return self.padded_clearance[1:-1, 1:-1]

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, cols) of the world."""
        rows, cols = self.padded_clearance.shape
        return rows - 2, cols - 2

    def scan(self, pose: Pose, rng: np.random.Generator | None = None) -> Floats32:
        """The ranges seen from a pose.

        As in ROS (REP 117), a beam that meets nothing within the range is +inf ("no return") and one that
        failed (`LidarConfig.dropout`) is NaN ("no information"). Noise never makes a range negative; a range
        that noise lifts above `range_max` is +inf.

        Args:
            pose: Where the robot stands, in world coordinates.
            rng: Source of noise and dropouts; needed only where the configuration has them.

        Returns:
            float32 (beams,) in metres, in the order of `LidarConfig.angles`; all 0 inside a wall or outside.

        Raises:
            StartError: The pose is not finite.
            ConfigError: The configuration has noise or dropouts and there is no `rng`.
        """
        return self._ranges(self.config, pose, rng)

    def scan_full_turn(self, pose: Pose, rng: np.random.Generator | None = None) -> Floats32:
        """Like `scan`, over 360 degrees with the same density of beams: the beams of `around(config)`."""
        return self._ranges(around(self.config), pose, rng)

    def _ranges(self, config: LidarConfig, pose: Pose, rng: np.random.Generator | None) -> Floats32:
        x, y = position_in_cells(pose, self.resolution, self.origin)
        reach = config.range_max / self.resolution
        # The clearance has a border of a cell.
        place = x + 1.0, y + 1.0, float(pose.theta)
        ranges = _cast(self.padded_clearance, *place, *beam_table(config), reach, self.resolution)
        return _disturb(ranges, config, rng) if config.noisy else ranges


@checks_arguments
def clearance_field(occupied: Mask) -> Bytes:
    """Chebyshev distance to the nearest occupied cell, with a border of zeros around it.

    The field of an array that is marked read-only is kept for as long as the array lives and shared.

    Args:
        occupied: bool (rows, cols).

    Returns:
        uint8 (rows + 2, cols + 2), read-only; in cells, at most 255; the outside counts as occupied.
    """
    world = np.asarray(occupied)
    if world.ndim != 2 or world.size == 0:
        raise MapError(f"a world needs a non-empty two-dimensional array, got shape {world.shape}")
    if world.flags.writeable:
        return _clearance(world)
    key = id(world)
    held = _shared_fields.get(key)
    if held is None or held[0]() is not world:
        held = (weakref.ref(world, lambda _: _shared_fields.pop(key, None)), _clearance(world))
        _shared_fields[key] = held
    return held[1]


_shared_fields: dict[int, tuple[weakref.ref[Mask], Bytes]] = {}


def _clearance(occupied: Mask) -> Bytes:
    field = np.zeros((occupied.shape[0] + 2, occupied.shape[1] + 2), np.uint8)
    np.equal(occupied, 0, out=field[1:-1, 1:-1])
    measure_clearance(field)
    field.setflags(write=False)
    return field


def check_upright(origin: Pose) -> None:
    """Raise `MapError` where an origin has a yaw: simulation runs on grids whose rows are parallel to x."""
    if len(origin) != 3 or not all(math.isfinite(v) for v in origin):
        raise MapError(f"the origin must be three finite numbers (x, y, yaw), got {tuple(origin)}")
    if origin[2] != 0.0:
        raise MapError(
            f"simulation needs a grid that is not turned, got an origin with yaw {origin[2]}: "
            "rotate the grid first"
        )


def position_in_cells(pose: Pose, resolution: float, origin: Pose) -> tuple[float, float]:
    """Position (col, row) in cells from the lower left corner of an upright grid.

    Raises:
        StartError: The pose is not finite.
    """
    if not (math.isfinite(pose.x) and math.isfinite(pose.y) and math.isfinite(pose.theta)):
        raise StartError(f"a pose must be finite numbers, got {pose}")
    # Of a robot that tells it as float32, not with so few digits.
    return (float(pose.x) - origin.x) / resolution, (float(pose.y) - origin.y) / resolution


@lru_cache(maxsize=32)
def beam_table(config: LidarConfig) -> tuple[Floats, Floats]:
    """Cosine and sine float64 (beams,) of the beams relative to the heading, kept between calls."""
    angles = config.angles()
    return np.cos(angles), np.sin(angles)


def _disturb(ranges: Floats32, config: LidarConfig, rng: np.random.Generator | None) -> Floats32:
    """Add noise and dropouts; infinite ranges stay infinite."""
    if rng is None:
        raise ConfigError(f"lidar {config.name!r} has noise or dropouts: scan(pose, rng) needs a generator")
    if config.range_noise_std > 0:
        noise = rng.standard_normal(ranges.size, np.float32) * np.float32(config.range_noise_std)
        ranges = np.maximum(ranges + noise, np.float32(0.0))
        ranges[ranges > config.range_max] = np.inf
    if config.dropout > 0:
        ranges[rng.random(ranges.size) < config.dropout] = np.nan
    return ranges


@njit(cache=True, nogil=True)
def _cast(
    clearance: Bytes,
    x: float,
    y: float,
    heading: float,
    unit_x: Floats,
    unit_y: Floats,
    range_max: float,
    scale: float,
) -> Floats32:
    """`scale` times the cells to the first zero of `clearance`, whose border is zero, along each beam."""
    rows, cols = clearance.shape
    ranges = np.empty(unit_x.size, np.float32)
    if not (0.0 <= x < cols and 0.0 <= y < rows) or clearance[int(y), int(x)] == 0:
        ranges[:] = 0.0
        return ranges
    cos, sin = math.cos(heading), math.sin(heading)
    field = clearance.ravel()
    start = np.uint64(int(y) * cols + int(x))
    for i in range(unit_x.size):
        dx = unit_x[i] * cos - unit_y[i] * sin
        dy = unit_x[i] * sin + unit_y[i] * cos
        along, across, slope, per_along, per_across, x_leads = ray_frame(x, y, dx, dy)
        step_along, step_across = steps(dx, dy, x_leads, cols)
        last = int(range_max / per_along + along)
        # k borders are met along and j across. The border of zeros ends every ray inside the array, so no
        # index is checked.
        index, k, j = start, 0, 0
        here = np.inf
        while k <= last:
            d = int(np.int64(field[index]))
            if d == 0:
                here = (k - along) * per_along
                break
            if d >= _SKIP_FROM:
                # Cells less than d away are free, and a slope of at most 1 keeps the ray among them for d - 1
                # columns.
                k += d - 1
                n = int(across + slope * (k - along))
                index += np.uint64(d - 1) * step_along + np.uint64(n - j) * step_across
                j = n
                continue
            # Up to the next border along lies at most one across; it is crossed first.
            k += 1
            n = int(across + slope * (k - along))
            if n != j:
                index += step_across
                j = n
                if field[index] == 0:
                    here = (n - across) * per_across
                    break
            index += step_along
        ranges[i] = here * scale if here <= range_max else np.inf
    return ranges
