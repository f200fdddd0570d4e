"""Snapshots of explorations: what a predictor is asked, with the true rooms beside it.

An exploration from a seeded start is stopped at given shares of coverage; its grid and frontiers are kept.
Snapshots can be stored, so that every predictor answers the same questions.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from layoutexplore.files import is_whole, read_arrays, write_arrays
from layoutexplore.frontiers.decision import Agent, Decision, KnownDistances
from layoutexplore.frontiers.table import Frontier
from layoutexplore.grids.arrays import Ints32
from layoutexplore.grids.grid import Cell, OccupancyGrid, Pose
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.predictors import make_predictor
from layoutexplore.predictors.snapshot import Snapshot
from layoutexplore.sensing.lidar import sensor as sensor_of
from layoutexplore.simulation.episode import play
from layoutexplore.simulation.simulation import Simulation, SimulationConfig

COVERAGES = (0.2, 0.4, 0.6, 0.8)
"""Shares of coverage at which the protocol of Luperto et al. looks at an exploration."""


def explore_plan(
    plan: FloorPlan,
    agent: Agent,
    *,
    sensor: str = "stage",
    seed: int = 0,
    coverages: Sequence[float] = COVERAGES,
    store: Path | None = None,
) -> list[Snapshot]:
    """Explore a floor plan and keep the first decision at or above each coverage that has a frontier.

    Args:
        plan: The floor plan.
        agent: Who explores.
        sensor: A preset's name.
        seed: Decides the start.
        coverages: Rising shares 0..1.
        store: Folder in which explorations are kept; one that is there, whole, is read instead of run again.
    """
    simulation = Simulation(plan, SimulationConfig(sensor=sensor))
    path = store and store / f"{_key(plan, simulation, seed, agent.name, coverages)}.npz"
    if path and is_whole(path):
        return _load(path, plan, simulation, seed)
    found = _run(simulation, seed, agent, coverages)
    if path:
        _save(path, found)
    return [
        Snapshot(plan.name, plan.building, sensor, seed, share, decision, simulation.truth)
        for share, decision in found
    ]


def _run(
    simulation: Simulation, seed: int, agent: Agent, coverages: Iterable[float]
) -> list[tuple[float, Decision]]:
    """The first decisions at or above each coverage."""
    simulation.predictor = make_predictor(getattr(agent, "predictor", "none"))
    waiting, found = list(coverages), []

    def keep(simulation: Simulation) -> None:
        while waiting and not simulation.done and simulation.coverage >= waiting[0]:
            found.append((waiting.pop(0), _frozen(simulation.decision)))

    play(simulation, agent, seed=seed, on_step=keep, until=lambda _: not waiting)
    return found


def _frozen(decision: Decision) -> Decision:
    """A copy that the simulation does not go on changing, without a prediction."""
    grid = OccupancyGrid(decision.grid.cells.copy(), decision.grid.resolution, decision.grid.origin)
    return _decision(grid, decision.pose, decision.frontiers, decision.sensor.name, decision.robot_radius)


def _decision(
    grid: OccupancyGrid, pose: Pose, frontiers: Iterable[Frontier], sensor: str, radius: float
) -> Decision:
    plain = tuple(
        Frontier(f.cells, f.size, f.centroid, f.viewpoint, f.path_length, f.straight_distance, f.visible_area)
        for f in frontiers
    )
    distances = KnownDistances(np.where(grid.free, np.float32(0), np.float32(np.inf)))
    return Decision(0, grid, pose, plain, distances, 0.0, sensor_of(sensor), radius)


def _key(plan: FloorPlan, simulation: Simulation, seed: int, agent: str, coverages: Sequence[float]) -> str:
    text = json.dumps([plan.content_hash, repr(simulation.config), seed, agent, list(coverages)])
    return f"{plan.name}-{hashlib.sha256(text.encode()).hexdigest()[:16]}"


def _save(path: Path, found: Sequence[tuple[float, Decision]]) -> None:
    arrays: dict[str, NDArray[np.generic]] = {"coverages": np.array([share for share, _ in found])}
    for k, (_, decision) in enumerate(found):
        frontiers = decision.frontiers
        arrays[f"cells{k}"] = decision.grid.cells
        arrays[f"pose{k}"] = np.array(decision.pose)
        arrays[f"members{k}"] = np.concatenate([f.cells for f in frontiers])
        arrays[f"lengths{k}"] = np.array([len(f.cells) for f in frontiers])
        arrays[f"numbers{k}"] = np.array([(*f.viewpoint, f.path_length, f.visible_area) for f in frontiers])
    write_arrays(path, arrays)


def _load(path: Path, plan: FloorPlan, simulation: Simulation, seed: int) -> list[Snapshot]:
    simulation.reset(seed=seed)
    snapshots = []
    raster, config = simulation.raster, simulation.config
    data = read_arrays(path)
    for k, share in enumerate(data["coverages"].tolist()):
        grid = OccupancyGrid(data[f"cells{k}"], raster.resolution, raster.origin)
        pose = Pose(*data[f"pose{k}"].tolist())
        clusters = np.split(data[f"members{k}"], np.cumsum(data[f"lengths{k}"])[:-1])
        rows = data[f"numbers{k}"].tolist()
        frontiers = [_frontier(grid, pose, *pair) for pair in zip(clusters, rows, strict=True)]
        decision = _decision(grid, pose, frontiers, config.lidar.name, config.robot_radius)
        snapshots.append(
            Snapshot(plan.name, plan.building, config.lidar.name, seed, share, decision, simulation.truth)
        )
    return snapshots


def _frontier(grid: OccupancyGrid, pose: Pose, cells: Ints32, numbers: Sequence[float]) -> Frontier:
    x, y = grid.cells_to_world(cells.mean(axis=0))[0].tolist()
    row, col, path_length, visible = numbers
    return Frontier(
        cells=cells,
        size=len(cells) * grid.resolution,
        centroid=(x, y),
        viewpoint=Cell(int(row), int(col)),
        path_length=path_length,
        straight_distance=math.hypot(x - pose.x, y - pose.y),
        visible_area=visible,
    )
