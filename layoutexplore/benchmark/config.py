"""What a benchmark runs: plans, starts, sensors, agents, and how they are simulated."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import layoutexplore
from layoutexplore.agents import AGENTS
from layoutexplore.errors import ConfigError, checks_arguments, checks_calls, shortened, unknown_name
from layoutexplore.files import naming, read_toml
from layoutexplore.options import (
    COUNT,
    FLAG,
    KEPT_SEED,
    POSE,
    Rule,
    check,
    check_keys,
    check_kind,
    from_table,
)
from layoutexplore.sensing.lidar import SENSORS, LidarConfig
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.robot import OdometryNoise

QUICK_AGENTS = (
    "random",
    "nearest",
    "nearest-straight",
    "cost-utility",
    "gain-over-distance",
    "wait-3",
    "tour",
    "latency-tour",
    "layout-tour",
    "clairvoyant",
)
"""What runs when no agent is named: one of each kind of strategy."""

BASELINE = "nearest"
"""Who the others are compared with when nobody is named."""

_INSTEAD = {
    "plans": ": save_plan(plan, 'plan.geojson') writes a floor plan into a file, whose path is given",
    "sensors": ": lidars={'mine': LidarConfig(...)} gives a sensor a name",
}
"""What is done with an object where a name is asked for."""

STARTS, LIMIT = Rule(kind=int, low=1, high=10_000), Rule(low=0.0, high=1e9)


@checks_calls
@dataclass(frozen=True, kw_only=True)
class BenchmarkConfig:
    """Everything that decides the results of a benchmark.

    Attributes:
        plans: Floor plans: names, `FAMILY:SEED`, files, folders, or the splits quick, train, validation,
            test.
        starts: Number of starts on each plan; start k is the same for every sensor and agent.
        sensors: Presets, or names of `lidars`.
        agents: Strategies: names, with parameters, `FILE.py:CLASS`, or agents of your own as classes or
            objects, of which their names are kept: `name`, or what the class is called.
        baseline: The agent that the others are compared with; "" for `BASELINE`, or the one that results have
            which are added to.
        seed: Decides starts, sensor noise and the agents' own randomness.
        lidars: Own sensors by name.
        poses: Own starts by the floor plan's name in the results, each (x, y, theta) in metres and radians: a
            plan's starts from number 0 on. As many as `starts` at most; the others are drawn.
        simulation: How to simulate; its `sensor` is replaced by each of `sensors`.
        explain: Ask copies of agents with a predictor beside every decision what they would choose without
            it, and with the true rooms. It changes no run of those that keep what they remember in
            themselves, and more than doubles the time of theirs.
        cell_seconds: A run that takes longer fails; 0 for as long as it takes.
        cell_mb: So does one that takes more memory than this beside what its process has; 0 for any.
        tries: A run whose worker is killed is made so often before it fails.
        again: Some of the agents: their runs of this benchmark that are in the folder are deleted and made
            anew.

    Raises:
        ConfigError: A list is empty, has duplicates, or a value makes no sense.
    """

    plans: Sequence[str | os.PathLike[str]] = ("quick",)
    starts: int = 2
    sensors: Sequence[str] = ("stage",)
    agents: Sequence[Any] = QUICK_AGENTS
    baseline: str = ""
    seed: int = 0
    lidars: Mapping[str, LidarConfig] = field(default_factory=dict)
    poses: Mapping[str, Sequence[Sequence[float]]] = field(default_factory=dict)
    simulation: SimulationConfig = field(default_factory=SimulationConfig)
    explain: bool = True
    cell_seconds: float = 0.0
    cell_mb: float = 0.0
    tries: int = 3
    again: Sequence[str] = ()

    def __post_init__(self) -> None:
        for name in ("plans", "sensors", "agents"):
            given = getattr(self, name)
            if not isinstance(given, (tuple, list)):
                raise ConfigError(f"{name} must be a list, got {shortened(given)}")
            values = tuple(value if isinstance(value, str) else _name_of(name, value) for value in given)
            if unnamed := [value for value in values if not isinstance(value, str)]:
                raise ConfigError(
                    f"{name} are given by name, got {shortened(unnamed[0])}{_INSTEAD.get(name, '')}"
                )
            object.__setattr__(self, name, values)
            if not values:
                raise ConfigError(f"a benchmark needs at least one of {name}")
            if twice := sorted(value for value, count in Counter(values).items() if count > 1):
                raise ConfigError(f"{name} names {shortened(twice[0])} twice")
        check_kind("simulation", self.simulation, SimulationConfig)
        check_kind("lidars", self.lidars, Mapping)
        for name, lidar in self.lidars.items():
            check_kind("the name of a lidar", name, str)
            check_kind(f"lidar {name!r}", lidar, LidarConfig)
        if not isinstance(self.baseline, str):
            raise ConfigError(f"baseline must be the name of an agent, got {shortened(self.baseline)}")
        if not isinstance(self.again, (tuple, list)):
            raise ConfigError(f"again must be a list, got {shortened(self.again)}")
        for name in self.again:
            if name not in self.agents:
                raise unknown_name("agent of this benchmark", str(name), self.agents)
        check(self, starts=STARTS, seed=KEPT_SEED, explain=FLAG, tries=COUNT)
        check(self, cell_seconds=LIMIT, cell_mb=LIMIT)
        object.__setattr__(self, "poses", _poses_of(self.poses, self.starts))
        for name in self.sensors:
            if name not in self.lidars and name not in SENSORS:
                raise unknown_name("sensor", name, [*SENSORS, *self.lidars])

    def simulation_with(self, sensor: str) -> SimulationConfig:
        """The simulation's configuration with one of the benchmark's sensors."""
        return dataclasses.replace(self.simulation, sensor=self.lidars.get(sensor, sensor))

    @property
    def config_hash(self) -> str:
        """12 hexadecimal digits that tell apart the seeds, simulations, sensors and versions behind results.

        What was run (plans, starts, agents) does not enter: it is in the columns of the results.
        """
        text = json.dumps(settings(self), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:12]


def _poses_of(given: Any, starts: int) -> dict[str, tuple[tuple[float, float, float], ...]]:
    """Own starts by floor plan, as plain numbers."""
    check_kind("poses", given, Mapping)
    for name, poses in given.items():
        check_kind("the floor plan of poses", name, str)
        if not isinstance(poses, (tuple, list)) or len(poses) > starts:
            raise ConfigError(
                f"poses of {shortened(name)} must be a list of [x, y, theta], no more than starts "
                f"({starts}), got {shortened(poses)}"
            )
    poses = {
        name: [POSE.convert(f"a pose of {shortened(name)}", p) for p in own] for name, own in given.items()
    }
    return {name: tuple((float(x), float(y), float(t)) for x, y, t in own) for name, own in poses.items()}


def _name_of(what: str, value: Any) -> Any:
    """The name of a floor plan or agent that is given as a path or an object; anything else as it is."""
    if what == "agents":
        return AGENTS.register_object(value)
    return os.fspath(value) if what == "plans" and isinstance(value, os.PathLike) else value


def settings(config: BenchmarkConfig) -> dict[str, Any]:
    """What decides the outcome of every single run, as plain nested values."""
    simulation = config.simulation.as_table()
    del simulation["sensor"]
    if simulation["region"] is None:
        del simulation["region"]  # Results of versions without it belong to the same configuration.
    lidars = {name: dataclasses.asdict(config.simulation_with(name).lidar) for name in sorted(config.sensors)}
    own = {"poses": config.poses} if config.poses else {}  # So do those of versions without poses.
    return {
        "version": layoutexplore.__version__,
        "seed": config.seed,
        "simulation": simulation,
        "lidars": lidars,
        **own,
    }


@checks_arguments
def read_benchmark_config(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Keyword arguments for `BenchmarkConfig` from a TOML file.

    The keys are the fields of `BenchmarkConfig`; `[simulation]` holds those of `SimulationConfig` (without
    `sensor`), `[lidars.NAME]` those of `LidarConfig`, `[poses]` own starts.

    Raises:
        ConfigError: The file cannot be read, a key is unknown, or a value has the wrong type.
    """
    path = Path(path)
    table = read_toml(path)
    known = [f.name for f in dataclasses.fields(BenchmarkConfig) if f.name != "again"]
    inner = {f.name for f in dataclasses.fields(SimulationConfig)}
    if misplaced := sorted(inner.difference(known, ["sensor"]).intersection(table)):
        raise ConfigError(f"{path}: {shortened(misplaced[0])} stands under [simulation]")
    check_keys(table, known, str(path))
    table |= _tables(table, str(path))
    for name in ("plans", "sensors", "agents"):
        if name in table:
            table[name] = _strings(table[name], f"{name} in {path}")
    return table


def simulation_of_file(path: str | os.PathLike[str], sensor: str) -> SimulationConfig:
    """How runs with a sensor are simulated, from a benchmark's TOML file or the run.toml of its results.

    Raises:
        ConfigError: The file cannot be read or is neither, or a value makes no sense.
    """
    path = Path(path)
    table = read_toml(path)
    if isinstance(settings_of_run := table.get("settings"), dict):
        options = _tables(settings_of_run, str(path), "settings.")
        if "simulation" not in options:
            raise ConfigError(f"{path}: [settings.simulation] is missing: it is no whole run.toml of results")
    else:
        given = read_benchmark_config(path)
        options = {name: given[name] for name in ("simulation", "lidars") if name in given}
    config = BenchmarkConfig(sensors=(sensor,), **options)
    with naming(path, ConfigError):
        return config.simulation_with(sensor)


def _tables(table: dict[str, Any], path: str, inside: str = "") -> dict[str, Any]:
    """The simulation and the sensors of a file or of a table inside it, as far as they are there.

    Raises:
        ConfigError: One is no table, a key of it is unknown, or a value makes no sense.
    """
    for name in ("simulation", "lidars"):
        if not isinstance(table.get(name, {}), dict):
            raise ConfigError(f"{inside}{name} in {path} must be a table, got {shortened(table[name])}")
    found: dict[str, Any] = {}
    if "simulation" in table:
        found["simulation"] = _simulation(table["simulation"], f"{path} [{inside}simulation]")
    if "lidars" in table:
        found["lidars"] = {
            name: _lidar(name, values, f"{path} [{inside}lidars.{name}]")
            for name, values in table["lidars"].items()
        }
    return found


def _simulation(table: dict[str, Any], where: str) -> SimulationConfig:
    if "sensor" in table:
        raise ConfigError(f"{where}: name the sensors in the list `sensors` of the file, not here")
    table = dict(table)
    if "odometry_noise" in table:
        table["odometry_noise"] = from_table(
            OdometryNoise, table["odometry_noise"], f"{where} odometry_noise"
        )
    return from_table(SimulationConfig, table, where)


def _lidar(name: str, table: Any, where: str) -> LidarConfig:
    return from_table(LidarConfig, {**table, "name": name} if isinstance(table, dict) else table, where)


def _strings(value: Any, where: str) -> tuple[str, ...]:
    items: Iterable[Any] = [value] if isinstance(value, str) else value
    if not isinstance(items, list) or not all(isinstance(item, str) for item in items):
        raise ConfigError(f"{where} must be a list of names, got {shortened(value)}")
    return tuple(items)
