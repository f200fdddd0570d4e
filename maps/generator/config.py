"""What can be asked of the generator: one frozen dataclass, checked where it is made.

What is left at None is drawn from the seed, so that a bare `generate("office", 7)` already varies
in size, wall thickness and door width from seed to seed. Ranges follow common building practice: interior
walls 0.10-0.20 m, exterior walls 0.30-0.40 m, door leaves 0.8-1.0 m.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from layoutexplore.errors import ConfigError, unknown_name
from layoutexplore.options import Rule, check

TOPOLOGIES = ("I", "L", "T", "Z", "U", "H", "comb", "fishbone", "ring", "eight")
"""Corridor skeletons of the right-angled families; see `layoutexplore.maps.generator.skeletons`."""

AREA_RANGES: Mapping[str, tuple[float, float]] = {
    "office": (250.0, 2500.0),
    "school": (500.0, 3500.0),
    "apartment": (120.0, 900.0),
    "hospital": (400.0, 3000.0),
    "hall": (300.0, 2500.0),
    "angled": (400.0, 2500.0),
    "curved": (350.0, 2200.0),
}
"""Net floor area in m2 from which a plan's size is drawn (log-uniformly) when none is asked for."""

LIMITS: Mapping[str, tuple[float, float]] = {
    "area": (100.0, 8000.0),
    "door_width": (0.7, 1.4),
    "interior_wall": (0.08, 0.3),
    "exterior_wall": (0.15, 0.6),
    "clutter": (0.0, 0.4),
    "closed_doors": (0.0, 1.0),
}
"""Smallest and largest value of every numeric parameter."""

MIN_ROOM_AREA, MAX_ROOM_AREA = 6.0, 150.0
"""Mean floor area a room may have, corridors included, in m2: `rooms` outside of it is refused."""


@dataclass(frozen=True, kw_only=True)
class PlanConfig:
    """Parameters of the floor plan generator; None means: drawn from the seed.

    Attributes:
        area: Net floor area of all rooms together, m2 (100-8000); met within 25 %.
        rooms: Number of rooms, corridors included; steers the room widths, so it is met roughly.
        door_width: Clear width of an ordinary door, m (0.7-1.4); double doors and toilet doors follow it.
        interior_wall: Thickness of the walls between rooms, m (0.08-0.3).
        exterior_wall: Thickness of the outer walls, m (0.15-0.6).
        clutter: Share of a room's floor to cover with furniture (0-0.4); less where doors and ways must stay
            clear.
        closed_doors: Share of the doors to shut (0-1); never cuts off more than the room behind the door.
        topology: Corridor skeleton, one of `TOPOLOGIES`, for office, school, apartment and hospital.

    Raises:
        ConfigError: A value is no number, out of range, or two values contradict each other.
    """

    area: float | None = None
    rooms: int | None = None
    door_width: float | None = None
    interior_wall: float | None = None
    exterior_wall: float | None = None
    clutter: float = 0.0
    closed_doors: float = 0.0
    topology: str | None = None

    def __post_init__(self) -> None:
        left_open = {f.name for f in dataclasses.fields(self) if f.default is None}
        limits = {
            name: Rule(low=low, high=high, optional=name in left_open) for name, (low, high) in LIMITS.items()
        }
        rooms = Rule(kind=int, low=3, optional=True)
        check(self, **limits, rooms=rooms, topology=Rule(kind=str, choices=TOPOLOGIES, optional=True))
        if self.area is None or self.rooms is None:
            return
        if not MIN_ROOM_AREA <= self.area / self.rooms <= MAX_ROOM_AREA:
            raise ConfigError(
                f"{self.rooms} rooms on {self.area:g} m2 is {self.area / self.rooms:.1f} m2 a room: "
                f"ask for {MIN_ROOM_AREA:g} to {MAX_ROOM_AREA:g} m2"
            )

    def with_parameters(self, parameters: Mapping[str, Any]) -> PlanConfig:
        """A copy with some parameters replaced.

        Raises:
            UnknownNameError: There is no parameter of that name; the message names the closest ones.
        """
        known = [f.name for f in dataclasses.fields(self)]
        for name in parameters:
            if name not in known:
                raise unknown_name("parameter of a floor plan", name, known)
        return dataclasses.replace(self, **parameters)

    def drawn(self, family: str, rng: np.random.Generator) -> DrawnConfig:
        """The configuration with everything that was left open drawn from `rng`."""
        low, high = AREA_RANGES[family]
        area = float(np.exp(rng.uniform(np.log(low), np.log(high))))
        if self.rooms is not None:
            area = min(
                max(area, self.rooms * MIN_ROOM_AREA * 2), self.rooms * MAX_ROOM_AREA / 2, LIMITS["area"][1]
            )
            area = max(area, LIMITS["area"][0])
        door, inner = rng.choice([0.8, 0.85, 0.9, 0.9, 0.95, 1.0]), rng.choice([0.1, 0.12, 0.15, 0.2])
        outer = rng.choice([0.3, 0.35, 0.4])
        return DrawnConfig(
            area=area if self.area is None else float(self.area),
            rooms=self.rooms,
            door_width=float(door if self.door_width is None else self.door_width),
            interior_wall=float(inner if self.interior_wall is None else self.interior_wall),
            exterior_wall=float(outer if self.exterior_wall is None else self.exterior_wall),
            topology=self.topology,
        )


@dataclass(frozen=True, kw_only=True)
class DrawnConfig:
    """What a plan is built with: `PlanConfig` without anything left open (lengths in m, area in m2)."""

    area: float
    rooms: int | None
    door_width: float
    interior_wall: float
    exterior_wall: float
    topology: str | None
    scale: float = 1.0
    """Factor on the room widths, by which a wanted number of rooms is met."""
