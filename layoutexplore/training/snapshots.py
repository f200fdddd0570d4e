"""Snapshots of explorations: what a predictor is asked, with the true rooms beside it.

An exploration from a seeded start is stopped at given shares of coverage; its grid and frontiers are kept.
Snapshots can be stored, so that every predictor answers the same questions.
"""

from __future__ import annotations

import hashlib
import json
import math
import warnings
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import layoutexplore
from layoutexplore.errors import LayoutExploreError, ResultsError, shortened
from layoutexplore.files import ArrayRule, read_arrays, safe_name, write_arrays
from layoutexplore.files.archives import check_arrays
from layoutexplore.frontiers.decision import Agent, Decision, KnownDistances, predictor_of
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
    noise: str = "",
) -> list[Snapshot]:
    """Explore a floor plan and keep the first decision at or above each coverage that has a frontier.

    Args:
        plan: The floor plan.
        agent: Who explores.
        sensor: A preset's name.
        seed: Decides the start.
        coverages: Rising shares 0..1.
        noise: Level of `layoutexplore.simulation.config.NOISE`, or none.
        store: Folder in which explorations are kept; one that is there, whole and made by this version, is
            read instead of run again.
    """
    simulation = Simulation(plan, SimulationConfig(sensor=sensor, noise=noise))
    path = store and store / f"{_key(plan, simulation, seed, agent.name, coverages)}.npz"
    found = None
    if path and path.exists():
        try:
            found = _load(path, simulation, seed)
        except LayoutExploreError as error:
            warnings.warn(f"{error}; it is made anew", stacklevel=2)
    if found is None:
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
    simulation.predictor = make_predictor(predictor_of(agent))
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
    made_by = layoutexplore.__version__
    text = json.dumps([made_by, plan.raster_hash, repr(simulation.config), seed, agent, list(coverages)])
    return f"{safe_name(plan.name)}-{hashlib.sha256(text.encode()).hexdigest()[:16]}"


def _save(path: Path, found: Sequence[tuple[float, Decision]]) -> None:
    arrays: dict[str, NDArray[np.generic]] = {"coverages": np.array([share for share, _ in found])}
    for k, (_, decision) in enumerate(found):
        frontiers, clusters = decision.frontiers, decision.clusters
        arrays[f"cells{k}"] = decision.grid.cells
        arrays[f"pose{k}"] = np.array(decision.pose)
        arrays[f"members{k}"] = clusters.cells
        arrays[f"lengths{k}"] = np.diff(clusters.offsets)
        arrays[f"numbers{k}"] = np.array([(*f.viewpoint, f.path_length, f.visible_area) for f in frontiers])
    write_arrays(path, arrays)


_LARGE = 1e9
_RULES = {
    "cells": ArrayRule(kinds="i", shape=("rows", "cols"), low=-1, high=100),
    "pose": ArrayRule(shape=(3,), low=-_LARGE, high=_LARGE),
    "members": ArrayRule(kinds="i", shape=("members", 2), low=0),
    "lengths": ArrayRule(kinds="i", shape=("frontiers",), low=1),
    "numbers": ArrayRule(shape=("frontiers", 4), low=0, high=_LARGE),
}
"""What is stored of a decision; the grid is as large as the floor plan's raster."""


def _load(path: Path, simulation: Simulation, seed: int) -> list[tuple[float, Decision]]:
    """What `_save` stored.

    Raises:
        ResultsError: The file is damaged, or of another floor plan.
    """
    simulation.reset(seed=seed)
    data = read_arrays(path, rules={"coverages": ArrayRule(shape=("n",), low=0, high=1)})
    shares = data["coverages"].tolist()
    return [(share, _stored(data, k, simulation, path)) for k, share in enumerate(shares)]


def _stored(data: Mapping[str, NDArray[Any]], k: int, simulation: Simulation, path: Path) -> Decision:
    """The decision with the number k."""
    raster, config = simulation.raster, simulation.config
    parts = {name: data.get(f"{name}{k}", np.zeros(0)) for name in _RULES}
    check_arrays(parts, _RULES, f"{path}: decision {k}", ResultsError)
    members, lengths, numbers = parts["members"], parts["lengths"], parts["numbers"]
    fits = parts["cells"].shape == raster.shape and lengths.sum() == len(members) > 0
    if not (fits and (members < raster.shape).all() and (numbers[:, :2] < raster.shape).all()):
        plan = shortened(simulation.plan.name)
        raise ResultsError(f"{path}: decision {k} does not fit the floor plan {plan}")
    grid = OccupancyGrid(parts["cells"], raster.resolution, raster.origin)
    pose = Pose(*parts["pose"].tolist())
    clusters = np.split(members, np.cumsum(lengths)[:-1])
    frontiers = [_frontier(grid, pose, *pair) for pair in zip(clusters, numbers.tolist(), strict=True)]
    return _decision(grid, pose, frontiers, config.lidar.name, config.robot_radius)


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
