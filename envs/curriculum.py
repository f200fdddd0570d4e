"""Floor plans without end, from small to large, and sensors that change from episode to episode.

Both are frozen dataclasses that read a table of a TOML file and draw from the environment's generator, so
that an episode depends on the seed alone.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import numpy as np

from layoutexplore.envs.plans import load
from layoutexplore.errors import ConfigError, checks_calls, shortened, unknown_name
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.options import NON_NEGATIVE, SHARE, Rule, check, check_kind
from layoutexplore.sensing.lidar import sensor
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.robot import OdometryNoise

Range = tuple[float, float]

FIRST_SEED = 1_000_000
"""Generated training plans have seeds from here on: no shipped plan and no "office:7" is among them."""


_ATTEMPTS = 20
"""Further seeds that are tried where one cannot be drawn at the wanted size."""


@checks_calls
@dataclass(frozen=True, kw_only=True)
class PlanSampler:
    """Draws floor plans, for `plan=` of an environment: generated of all families, shipped in between.

    An environment hands its `progress` (0 ... 1, how far the training is; 1 unless set) to the sampler: the
    largest plan grows with it from `first_area` to the end of `area`.

    Attributes:
        families: Weight of each family of the generator; all alike when empty.
        area: Least and greatest floor area of a generated plan in m², drawn log-uniformly.
        clutter: Least and greatest share of a room's floor under furniture.
        door_width: Least and greatest clear width of the doors in metres.
        closed_doors: Least and greatest share of the doors that are shut.
        seeds: Number of different generated plans per family; 0 for no limit. Plans drawn lately are kept, so
            that few seeds save time and many give variety.
        shipped: Splits, names or files of plans that are drawn as they are.
        shipped_share: Probability of drawing one of these.
        first_area: The greatest area at progress 0; the whole range from the start when it is 0.
        growth: Progress at which the whole range is reached.

    Raises:
        ConfigError: A value makes no sense.

    Example:
        >>> sampler = PlanSampler(families={"office": 1.0}, area=(200.0, 400.0))
        >>> plan = sampler(np.random.default_rng(0))
        >>> plan.metadata["family"], 150 < plan.area < 500
        ('office', True)
    """

    families: Mapping[str, float] = field(default_factory=dict)
    area: Range = (250.0, 2500.0)
    clutter: Range = (0.0, 0.15)
    door_width: Range = (0.8, 1.0)
    closed_doors: Range = (0.0, 0.0)
    seeds: int = 0
    shipped: tuple[str, ...] = ("train",)
    shipped_share: float = 0.1
    first_area: float = 0.0
    growth: float = 0.3

    def __post_init__(self) -> None:
        from layoutexplore.maps.generator import FAMILIES
        from layoutexplore.maps.generator.config import LIMITS

        check_kind("families", self.families, Mapping)
        for family, weight in self.families.items():
            if family not in FAMILIES:
                raise unknown_name("family", family, FAMILIES)
            NON_NEGATIVE.convert(f"weight of {family}", weight)
        if self.families and not sum(self.families.values()) > 0:
            raise ConfigError("families: at least one weight must be above 0")
        ranges = {name: LIMITS[name] for name in ("area", "clutter", "door_width", "closed_doors")}
        check(self, **{name: Rule(count=2, low=low, high=high) for name, (low, high) in ranges.items()})
        for name in ranges:
            least, greatest = getattr(self, name)
            if least > greatest:
                raise ConfigError(f"{name}: the least value comes first, got {shortened((least, greatest))}")
        seeds = Rule(kind=int, low=0, high=2**31)
        first_area, names = Rule(low=0.0, high=1e6), Rule(kind=str, count=-1)
        check(self, seeds=seeds, shipped_share=SHARE, first_area=first_area, growth=SHARE, shipped=names)
        if self.shipped_share > 0 and not self.shipped:
            raise ConfigError("shipped: name plans or splits to draw from, or set shipped_share to 0")
        object.__setattr__(self, "_names", _shipped_names(self.shipped) if self.shipped_share > 0 else ())

    def __call__(self, rng: np.random.Generator) -> FloorPlan:
        """A plan of the whole range."""
        return self.draw(rng, 1.0)

    def draw(self, rng: np.random.Generator, progress: float) -> FloorPlan:
        """A plan; what is drawn depends on the generator and the progress alone."""
        names: tuple[str, ...] = self._names  # type: ignore[attr-defined]
        if rng.random() < self.shipped_share:
            return load(names[int(rng.integers(len(names)))])
        from layoutexplore.maps.generator import FAMILIES

        weights = np.array([self.families.get(family, 0.0) if self.families else 1.0 for family in FAMILIES])
        family = FAMILIES[int(rng.choice(len(FAMILIES), p=weights / weights.sum()))]
        seed = FIRST_SEED + int(rng.integers(self.seeds or 2**31))
        low, high = self.area
        if self.first_area:
            grown = min(1.0, progress / self.growth) if self.growth else 1.0
            first = min(max(self.first_area, low), high)
            high = first * (high / first) ** grown
        return _generated(family, seed, (low, high), self.clutter, self.door_width, self.closed_doors)


@checks_calls
@dataclass(frozen=True, kw_only=True)
class Randomisation:
    """What changes from episode to episode besides plan and start; each is drawn from the values listed.

    What is drawn stands instead of what the environment's own configuration says, also where that is a level
    of noise or where 0 is drawn.

    Attributes:
        sensors: Presets; none leaves the environment's own.
        range_noise: Standard deviations of the ranges in metres; None leaves that of the sensor.
        dropout: Probabilities that a beam fails; None leaves that of the sensor.
        drift: Odometry noise: metres per metre, and a tenth of it in radians per metre; None leaves the
            environment's own.
        robot_radius: Radii in metres; none leaves the environment's own.

    Raises:
        ConfigError: A value makes no sense.
    """

    sensors: tuple[str, ...] = ()
    range_noise: tuple[float, ...] | None = None
    dropout: tuple[float, ...] | None = None
    drift: tuple[float, ...] | None = None
    robot_radius: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        check(self, sensors=Rule(kind=str, count=-1))
        for name in self.sensors:
            sensor(name)
        check(
            self,
            range_noise=Rule(count=-1, low=0.0, high=10.0, optional=True),
            dropout=Rule(count=-1, low=0.0, high=0.99, optional=True),
            drift=Rule(count=-1, low=0.0, high=1.0, optional=True),
            robot_radius=Rule(count=-1, low=0.01, high=2.0),
        )
        for name in ("range_noise", "dropout", "drift"):
            if getattr(self, name) == ():
                raise ConfigError(f"{name}: list at least one value, or leave it out")

    def draw(self, rng: np.random.Generator, config: SimulationConfig) -> SimulationConfig:
        """The configuration of an episode."""
        own = replace(config, sensor=_one(self.sensors, rng)) if self.sensors else config
        lidar, odometry = own.lidar, own.odometry
        if self.range_noise is not None:
            lidar = replace(lidar, range_noise_std=_one(self.range_noise, rng))
        if self.dropout is not None:
            lidar = replace(lidar, dropout=_one(self.dropout, rng))
        if self.drift is not None:
            drift = _one(self.drift, rng)
            odometry = OdometryNoise(translation=drift, rotation=0.1 * drift)
        radius = _one(self.robot_radius, rng) if self.robot_radius else own.robot_radius
        # A level of noise is spelt out: what was drawn stands instead of its part of it.
        return replace(own, noise="", sensor=lidar, odometry_noise=odometry, robot_radius=radius)


def _one(values: tuple[Any, ...], rng: np.random.Generator) -> Any:
    return values[int(rng.integers(len(values)))]


@lru_cache(maxsize=48)
def _generated(
    family: str, seed: int, area: Range, clutter: Range, door_width: Range, closed_doors: Range
) -> FloorPlan:
    """A generated plan, its parameters drawn from its seed; where one fails, others follow."""
    from layoutexplore.maps.generator import PlanConfig, generate

    rng = np.random.default_rng([0x9E3779B9, seed])
    for attempt in itertools.count():
        size = math.exp(rng.uniform(math.log(area[0]), math.log(area[1])))
        ranges = {"clutter": clutter, "door_width": door_width, "closed_doors": closed_doors}
        parameters: dict[str, Any] = {name: float(rng.uniform(*limits)) for name, limits in ranges.items()}
        try:
            return generate(family, seed + attempt * 2**32, PlanConfig(area=size, **parameters))
        except ConfigError:
            if attempt == _ATTEMPTS:
                raise
    raise AssertionError("unreachable")


def _shipped_names(specs: tuple[str, ...]) -> tuple[str, ...]:
    from layoutexplore.maps import expand_plans

    return tuple(name for spec in specs for name in expand_plans(spec))
