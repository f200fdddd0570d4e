"""The floor plans of a benchmark: found, loaded once to know that they can be explored, and told apart by content."""

from __future__ import annotations

import functools
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from layoutexplore.benchmark.episode import run_seed
from layoutexplore.errors import ConfigError, MapError
from layoutexplore.grids.grid import Pose
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.robot import draw_start


@dataclass(frozen=True, kw_only=True)
class PlanEntry:
    """A floor plan of the benchmark.

    Attributes:
        name: Its name in the results.
        source: What `load_plan` reads it from: a name or an absolute path.
        content_hash: SHA-256 of its geometry.
        building: Floors of one building share it.
        reachable_area: Square metres that the robot's centre can reach.
    """

    name: str
    source: str
    content_hash: str
    building: str
    reachable_area: float


def find_plans(specs: Iterable[str]) -> list[str]:
    """What `load_plan` can read, for names, files, folders and splits; without duplicates, in the order given.

    Raises:
        MapError: A path does not exist, or a folder holds no floor plan.
        UnknownNameError: No plan or split of that name.
    """
    from layoutexplore.maps import expand_plans

    found: dict[str, None] = {}
    for spec in specs:
        for source in expand_plans(spec):
            found[str(Path(source).resolve()) if Path(source).exists() else source] = None
    return list(found)


@functools.lru_cache(maxsize=4)
def load(source: str) -> FloorPlan:
    """The floor plan of a source; the last few stay in memory."""
    return FloorPlan.load(source)


def entry(source: str, simulation: SimulationConfig) -> PlanEntry:
    """Load a plan and see that the robot fits into it.

    Raises:
        MapError: The plan cannot be read, or has no place for the robot.
    """
    plan = load(source)
    try:
        reachable = plan.rasterize(simulation.resolution).reachable(simulation.robot_radius)
    except MapError as error:
        raise MapError(f"{source}: {error}") from error
    return PlanEntry(
        name=plan.name,
        source=source,
        content_hash=plan.content_hash,
        building=plan.building,
        reachable_area=round(float(np.count_nonzero(reachable)) * simulation.resolution**2, 2),
    )


def check_names(entries: Iterable[PlanEntry]) -> None:
    """Raise `ConfigError` where two plans have the same name: their results could not be told apart."""
    seen: dict[str, str] = {}
    for plan in entries:
        if plan.name in seen:
            raise ConfigError(
                f"two floor plans are called {plan.name!r}: {seen[plan.name]} and {plan.source}"
            )
        seen[plan.name] = plan.source


def start_pose(plan: FloorPlan, simulation: SimulationConfig, seed: int, start: int) -> Pose:
    """Start number `start` on a plan: the same for every sensor and agent."""
    rng = np.random.default_rng(run_seed(seed, plan.name, start))
    return draw_start(plan.rasterize(simulation.resolution), simulation.robot_radius, rng)
