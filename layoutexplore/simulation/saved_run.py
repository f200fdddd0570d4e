"""Runs in a file: how one began and every move since, from which it goes on as if it had never stopped.

A run is decided by its floor plan, configuration, seed and moves. The file holds these (JSON in an .npz
archive, nothing pickled) with the grid and the pose that they led to. To go on, the moves are made again,
without an agent and without predictions, and grid, pose and metres are compared to the bit: a run never goes
on from anything but where it stopped.
"""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from layoutexplore.errors import (
    ConfigError,
    LayoutExploreError,
    ResultsError,
    UnknownNameError,
    cause,
    checks_arguments,
    shortened,
)
from layoutexplore.files import ArrayRule, naming, parse_json, read_arrays, write_arrays
from layoutexplore.files.reading import shown_path
from layoutexplore.frontiers.decision import Agent, Choice, Decision, Predictor, Privileged, Walk, remembers
from layoutexplore.grids.arrays import Ints32, shows_shapes
from layoutexplore.grids.grid import Pose
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.library import load_plan
from layoutexplore.options import KEPT_SEED, check_kind, from_table
from layoutexplore.sensing.lidar import LidarConfig
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.robot import OdometryNoise
from layoutexplore.simulation.simulation import Simulation

FORMAT = 1
"""Of the file; another one is refused."""

_CHOICE, _PATH, _DRIVE, _WALK = range(4)
"""Kinds of moves: the number of a frontier or STOP, a path of cells, a motion primitive, a `Walk`."""

MOST_MOVES = 500_000
"""More than any exploration takes: all of them are made again to go on."""

_ELSEWHERE = "the moves of this saved run lead elsewhere: another version of layoutexplore has saved it"

_FIELDS = {"format": int, "plan": str, "content_hash": str, "seed": int, "config": dict, "notes": dict}


@shows_shapes
@dataclass(frozen=True, eq=False)
class SavedRun:
    """A run that was saved.

    Attributes:
        plan: Name of the floor plan.
        content_hash: Of the floor plan.
        raster_hash: Of the floor plan, too; empty in files of earlier versions.
        config: How it was simulated.
        seed: Of the run.
        start: Where it was told to begin; None where the seed decided.
        moves: As in `SimulationState`.
        notes: What whoever saved it wanted to be kept: texts and numbers by name.
        arrays: What the moves led to: "cells" int8 (rows, cols), "pose" float64 (6,), the true and the
            believed pose, "metres" float64 (1,).
    """

    plan: str
    content_hash: str
    config: SimulationConfig
    seed: int
    start: Pose | None
    moves: list[Choice | tuple[float, float]]
    notes: dict[str, Any]
    arrays: dict[str, NDArray[Any]]
    raster_hash: str = ""

    def _of_another(self, simulation: Simulation) -> str:
        """Why the run cannot go on in a simulation; empty where it can."""
        plan = simulation.plan
        if plan.content_hash != self.content_hash:
            changed = ", which is another plan now: its geometry has changed"
            return changed if plan.name == self.plan else f", and {shortened(plan.name)} is another plan"
        if simulation.config != self.config:
            return " with another configuration"
        if self.raster_hash in ("", plan.raster_hash):
            return ""
        return " with another plan: one of the same geometry, whose ids of rooms or rooms of doors are others"

    def restore(self, simulation: Simulation, agent: Agent | None = None) -> Decision:
        """Bring a simulation to where the run stopped; the decision that is due there.

        Args:
            simulation: Of the same floor plan and configuration; it is reset.
            agent: Who goes on, if anybody: it is reset and shown the truth if it may know it. One that
                remembers (all but those that say `remembers = False`) is asked at every decision again, with
                predictions; the moves are those of the file whatever it answers. A predictor that says
                `remembers = True` is asked again, too.

        Raises:
            ConfigError: The simulation has another floor plan or configuration.
            ResultsError: The same moves lead elsewhere: the file comes from another version.
        """
        if reason := self._of_another(simulation):
            raise ConfigError(f"this run was saved on {shortened(self.plan)}{reason}")
        predictor = simulation.predictor
        asks = agent is not None and remembers(agent, otherwise=True)
        predicts = asks or remembers(predictor, otherwise=False)
        simulation.predictor = predictor if predicts else None
        try:
            simulation.reset(self.seed, self.start)
            if agent is not None:
                agent.reset(self.seed)
                if isinstance(agent, Privileged):
                    agent.reveal(simulation.truth)
            for move in self.moves:
                decision = simulation.decision if predicts else None
                if agent is not None and asks and decision is not None:
                    agent.act(decision)
                _make(simulation, move)
        except ConfigError as error:
            raise ResultsError(f"{_ELSEWHERE}: {cause(error)}") from error
        finally:
            simulation.predictor = predictor
        told: object = None if predicts else predictor
        if isinstance(told, Privileged):
            told.reveal(simulation.truth)
        if not predicts:  # what remembers is asked once a decision
            simulation.state.decision = None
        self._check(simulation)
        return simulation.decision

    def _check(self, simulation: Simulation) -> None:
        reached = _reached(simulation)
        if not all(np.array_equal(self.arrays[name], reached[name]) for name in reached):
            raise ResultsError(_ELSEWHERE)


def _make(simulation: Simulation, move: Choice | tuple[float, float]) -> None:
    """Make a move again."""
    if isinstance(move, tuple) and not isinstance(move, Walk):
        simulation.drive(*move)
    else:
        simulation.step(move)


def _reached(simulation: Simulation) -> dict[str, NDArray[Any]]:
    robot = simulation.robot
    return {
        "cells": simulation.mapper.grid.cells,
        "pose": np.array([*robot.pose, *robot.believed]),
        "metres": np.array([simulation.distance]),
    }


@checks_arguments
def save_simulation(
    simulation: Simulation, path: str | os.PathLike[str], notes: dict[str, Any] | None = None
) -> None:
    """Write a run to a file from which `load_simulation` goes on.

    A move that an error or Ctrl-C has cut short is left out: the run is saved as it was before that move. The
    moves till then are made again for that, without predictions.

    Args:
        simulation: It has been reset.
        path: The file; .npz is its usual ending.
        notes: Texts and numbers to be kept with it.

    Raises:
        ConfigError: The simulation has not been reset, its robot has returned to the start, it went on after
            a move that was cut short, or its seed has more than 64 bits.
        WriteError: The file cannot be written.
    """
    check_kind("simulation", simulation, Simulation)
    check_kind("path", path, str, os.PathLike)
    state = simulation.state
    if state.explored is not None:
        raise ConfigError("a run whose robot has returned to its start is not saved: save before the return")
    simulation = _uncut(simulation)
    state = simulation.state
    table = {
        "format": FORMAT,
        "plan": simulation.plan.name,
        "content_hash": simulation.plan.content_hash,
        "raster_hash": simulation.plan.raster_hash,
        "seed": KEPT_SEED.convert("the seed of a run that is saved", state.seed),
        "start": state.start,
        "config": simulation.config.as_table(),
        "notes": notes or {},
    }
    written = [_written(move) for move in state.moves]
    moves: dict[str, NDArray[Any]] = {
        "kinds": np.array([kind for kind, _, _ in written], np.int8),
        "values": np.array([values for _, values, _ in written], np.float64).reshape(-1, 2),
        "paths": np.concatenate(
            [np.empty((0, 2), np.int32), *(cells for *_, part in written for cells in part)]
        ),
    }
    arrays: dict[str, NDArray[Any]] = {"run": np.array(json.dumps(table)), **moves, **_reached(simulation)}
    write_arrays(Path(path), arrays)


def _uncut(simulation: Simulation) -> Simulation:
    """A run as it was before a move that was cut short, as one is from within `on_scan`."""
    state = simulation.state
    if state.cut_at is None:
        return simulation
    if state.cut_at < len(state.moves) - 1:
        raise ConfigError(
            "this run went on after a move that was cut short, which cannot be repeated: save before going on"
        )
    again = Simulation(simulation.plan, simulation.config)
    again.reset(state.seed, state.start)
    for move in state.moves[:-1]:
        _make(again, move)
    return again


def _written(move: Choice | tuple[float, float]) -> tuple[int, tuple[float, float], tuple[Ints32, ...]]:
    """The kind of a move, its two numbers, and its cells: as many as the numbers say where it has some."""
    if isinstance(move, Walk):
        return _WALK, (len(move.path), len(move.sights)), (move.path, move.sights)
    if isinstance(move, np.ndarray):
        return _PATH, (len(move), 0.0), (move,)
    return (_DRIVE, move, ()) if isinstance(move, tuple) else (_CHOICE, (move, 0.0), ())


_ARRAYS = {
    "run": ArrayRule(kinds="U"),
    "kinds": ArrayRule(kinds="iu", shape=("moves",)),
    "values": ArrayRule(shape=("moves", 2), low=-1e9, high=1e9),
    "paths": ArrayRule(kinds="i", shape=("path cells", 2), low=-1e6, high=1e6),
    "cells": ArrayRule(kinds="i", shape=("rows", "cols"), low=-1, high=100),
    "pose": ArrayRule(shape=(6,), low=-1e9, high=1e9),
    "metres": ArrayRule(shape=(1,), low=0, high=1e9),
}
"""What the file of a run must hold."""


def read_saved_run(path: str | os.PathLike[str]) -> SavedRun:
    """A run from a file of `save_simulation`.

    Raises:
        ResultsError: The file is missing, damaged, or no saved run of this version.
    """
    check_kind("path", path, str, os.PathLike)
    arrays = read_arrays(Path(path), rules=_ARRAYS)
    if (count := len(arrays["kinds"])) > MOST_MOVES:
        raise ResultsError(f"{path} is damaged: it has {count} moves, and {MOST_MOVES} is the most")
    try:
        table = parse_json(str(arrays["run"]), str(path), error=ResultsError)
        good = isinstance(table, dict) and all(isinstance(table.get(k), kind) for k, kind in _FIELDS.items())
        if not good or table["format"] != FORMAT:
            raise ResultsError(f"{path} is no saved run that this version can read")
        start = table.get("start")
        return SavedRun(
            plan=table["plan"],
            content_hash=table["content_hash"],
            config=_config(table["config"], str(path)),
            seed=table["seed"],
            start=None if start is None else Pose(*map(float, start)),
            moves=_moves(arrays["kinds"], arrays["values"], arrays["paths"]),
            notes=table["notes"],
            arrays={name: arrays[name] for name in ("cells", "pose", "metres")},
            raster_hash=str(table.get("raster_hash", "")),
        )
    except (ValueError, TypeError, IndexError, OverflowError) as error:
        raise ResultsError(f"{path} is damaged: {cause(error).removeprefix(f'{path}: ')}") from error


def _config(table: dict[str, Any], where: str) -> SimulationConfig:
    """The configuration that `SimulationConfig.as_table` made a table of."""
    nested: dict[str, Any] = {
        "odometry_noise": from_table(OdometryNoise, table.pop("odometry_noise", {}), where)
    }
    if isinstance(table.get("sensor"), dict):
        nested["sensor"] = from_table(LidarConfig, table.pop("sensor"), where)
    return from_table(SimulationConfig, table | nested, where)


def _moves(
    kinds: NDArray[Any], values: NDArray[Any], paths: NDArray[Any]
) -> list[Choice | tuple[float, float]]:
    """Moves as they were made."""
    found: list[Choice | tuple[float, float]] = []
    begin = 0
    for kind, (first, second) in zip(kinds.tolist(), values.tolist(), strict=True):
        if kind == _DRIVE:
            found.append((first, second))
        elif kind in (_PATH, _WALK):
            middle, end = begin + int(first), begin + int(first) + int(second)
            path, sights = (
                np.ascontiguousarray(paths[a:b], np.int32) for a, b in ((begin, middle), (middle, end))
            )
            found.append(Walk(path, sights) if kind == _WALK else path)
            begin = end
        else:
            found.append(int(first))
    return found


def load_simulation(
    path: str | os.PathLike[str],
    plan: FloorPlan | str | os.PathLike[str] | None = None,
    predictor: Predictor | None = None,
) -> Simulation:
    """A simulation at the decision at which it was saved; it goes on bit for bit as it would have then.

    Args:
        path: The file.
        plan: The floor plan; the one of the saved name when None.
        predictor: As the simulation had one.

    Raises:
        ResultsError: The file is missing, damaged, or of another version.
        ConfigError: The floor plan is another one.
        UnknownNameError: No plan is given, and none that ships has the saved name.
    """
    saved = read_saved_run(path)
    try:
        floor = load_plan(saved.plan) if plan is None else plan
    except UnknownNameError:
        raise UnknownNameError(
            f"{shown_path(Path(path))}: the run was saved on the floor plan {shortened(saved.plan)}, which "
            "does not ship: give it as load_simulation(path, plan=...)"
        ) from None
    simulation = Simulation(floor, saved.config, predictor)
    with naming(Path(path), LayoutExploreError):
        saved.restore(simulation)
    return simulation
