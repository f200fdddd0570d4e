"""The floor plans of a benchmark, loaded once to see if they can be explored, and the runs on them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from layoutexplore.benchmark.config import BenchmarkConfig
from layoutexplore.benchmark.rows import RunKey
from layoutexplore.errors import ConfigError, MapError, StartError, unknown_name
from layoutexplore.files import naming
from layoutexplore.files.limits import limits, raise_it
from layoutexplore.grids.grid import Pose
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.library import cached_plan
from layoutexplore.maps.tracing import floorplan_from_ascii
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.episode import start_pose
from layoutexplore.simulation.region import region_mask
from layoutexplore.simulation.robot import check_start

_WARM_UP_PLAN = """
####################
#aaaaa#bbbbb#ccccc##
#aaaaa#bbbbb#ccccc##
#aaaaa#bbbbb#ccccc##
###.#####.#####.####
#dddddddddddddddddd#
#dddddddddddddddddd#
####.######.########
#eeeeeee##ffffffff##
#eeeeeee##ffffffff##
####################
"""


@dataclass(frozen=True, kw_only=True)
class PlanEntry:
    """A floor plan of the benchmark.

    Attributes:
        name: Its name in the results.
        source: What `load_plan` reads it from: a name or an absolute path.
        content_hash: SHA-256 of its geometry.
        raster_hash: SHA-256 of all that its rasters depend on: doors may lead elsewhere in the same geometry.
        building: Floors of one building share it.
        reachable_area: Square metres that the robot's centre can reach.
    """

    name: str
    source: str
    content_hash: str
    raster_hash: str
    building: str
    reachable_area: float


def entry(source: str, simulation: SimulationConfig) -> PlanEntry:
    """Load a plan and see that the robot fits into it.

    Raises:
        MapError: The plan cannot be read, has no place for the robot, or more cells than results are read
            with.
    """
    plan = cached_plan(source)
    with naming(Path(source), MapError):
        raster = plan.rasterize(simulation.resolution)
        rows, cols = raster.shape
        if rows * cols > (most := limits().image_pixels):
            raise MapError(
                f"{rows} x {cols} cells of {raster.resolution:g} m, and results have no more than the limit "
                f"image_pixels, {most:g}: choose a coarser resolution ([simulation] of --config), unless a "
                f"part lies astray, or {raise_it('image_pixels', rows * cols)}"
            )
        reachable = raster.reachable(simulation.robot_radius)
    return PlanEntry(
        name=plan.name,
        source=source,
        content_hash=plan.content_hash,
        raster_hash=plan.raster_hash,
        building=plan.building,
        reachable_area=round(float(np.count_nonzero(reachable)) * simulation.resolution**2, 2),
    )


def warm_up_plan() -> FloorPlan:
    """A tiny floor, on which everything is done once before it is done in earnest."""
    return floorplan_from_ascii(_WARM_UP_PLAN, resolution=0.5, name="warm-up")


def check_names(entries: Iterable[PlanEntry]) -> None:
    """Raise `ConfigError` where two plans have the same name: their results could not be told apart."""
    seen: dict[str, str] = {}
    for plan in entries:
        if plan.name in seen:
            raise ConfigError(
                f"two floor plans are called {plan.name!r}: {seen[plan.name]} and {plan.source}; name one of "
                'them alone, or change its name (the member "name" of our GeoJSON, else the file\'s)'
            )
        seen[plan.name] = plan.source


def check_poses(config: BenchmarkConfig, plans: Iterable[PlanEntry]) -> None:
    """See that all own starts are on floor plans of the benchmark, where the robot fits.

    Raises:
        UnknownNameError: There is no floor plan of that name.
        StartError: The robot fits not there; the message names the nearest place.
    """
    sources, simulation = {plan.name: plan.source for plan in plans}, config.simulation
    for name, poses in config.poses.items():
        if name not in sources:
            raise unknown_name("floor plan of poses", name, sources)
        raster = cached_plan(sources[name]).rasterize(simulation.resolution)
        inside = None if simulation.region is None else region_mask(raster, simulation.region)
        for k, pose in enumerate(poses):
            try:
                check_start(raster, simulation.robot_radius, Pose(*pose), inside)
            except StartError as error:
                raise StartError(f"start {k} of {name}: {error}") from error


def start_of(config: BenchmarkConfig, plan: PlanEntry, start: int) -> Pose:
    """Start number `start` on a plan: the configuration's own, or drawn from its seed."""
    own = config.poses.get(plan.name, ())
    if start < len(own):
        return Pose(*own[start])
    return start_pose(cached_plan(plan.source), config.simulation, config.seed, start)


@dataclass(frozen=True)
class Task:
    """One run that is to be made."""

    plan: PlanEntry
    start: int
    sensor: str
    agent: str

    @property
    def key(self) -> RunKey:
        """As `Row.key`."""
        return self.plan.name, self.start, self.sensor, self.agent


def all_tasks(config: BenchmarkConfig, plans: list[PlanEntry]) -> list[Task]:
    """Every run of the benchmark, in the order in which they are made.

    Large plans come first, so that the last runs to end are short; plan by plan, so that workers find it in
    memory.
    """
    ordered = sorted(plans, key=lambda plan: (-plan.reachable_area, plan.name))
    return [
        Task(plan, start, sensor, agent)
        for plan in ordered
        for start in range(config.starts)
        for sensor in config.sensors
        for agent in config.agents
    ]
