"""Runs that stop, are saved and go on: bit for bit as if they had never stopped."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path

import numpy as np
import pytest

from layoutexplore.agents import make_agent
from layoutexplore.benchmark.rows import prepare
from layoutexplore.errors import ConfigError, ResultsError, UnknownNameError
from layoutexplore.files import read_arrays, write_arrays
from layoutexplore.grids.grid import Pose
from layoutexplore.maps.library import load_plan
from layoutexplore.predictors import make_predictor
from layoutexplore.sensing.lidar import LidarConfig
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.episode import play
from layoutexplore.simulation.robot import OdometryNoise
from layoutexplore.simulation.saved_run import load_simulation, read_saved_run, save_simulation
from layoutexplore.simulation.simulation import Simulation
from layoutexplore.simulation.way_back import return_to_start
from tests.plans import offices

NOISY = LidarConfig(range_max=8.0, fov=math.pi, beams=181, range_noise_std=0.03, dropout=0.02)
DRIFT = OdometryNoise(translation=0.03, rotation=0.02)
WEST = ((0.0, 0.0), (9.0, 0.0), (9.0, 8.0), (0.0, 8.0))
CONFIGS = {
    "exact": SimulationConfig(sensor="indoor"),
    "noisy": SimulationConfig(sensor=NOISY, max_distance=40.0),
    "drift": SimulationConfig(sensor=NOISY, odometry_noise=DRIFT, max_distance=40.0, turn_cost=0.2),
    "region": SimulationConfig(sensor="stage", region=WEST),
}


def test_what_stands_askew_goes_on_as_it_was_seen(tmp_path: Path) -> None:
    """The predictor holds the angle at which it looks at a map; a run that goes on has to find it again."""
    plan, config = load_plan("office-01").turned(math.radians(17.4)), SimulationConfig(sensor="short")
    simulation, agent = Simulation(plan, config, make_predictor("layout")), make_agent("layout-tour")
    decision, told = simulation.reset(seed=0), 0
    while not simulation.done and simulation.decisions < 30:
        decision = simulation.step(agent.act(decision))
        fresh = make_predictor("layout")
        assert fresh is not None
        other = fresh.predict(decision).table.expected_area
        if decision.frontiers and not np.array_equal(other, decision.table.expected_area):
            save_simulation(simulation, tmp_path / "run.npz")
            again = load_simulation(tmp_path / "run.npz", plan, make_predictor("layout")).decision
            assert np.array_equal(again.table.expected_area, decision.table.expected_area)
            told += 1
            if told == 2:
                break
    assert told, "the angle never mattered: the test tells nothing"


def digest(simulation: Simulation) -> list[bytes]:
    """All that a run leaves behind."""
    robot, grid = simulation.robot, simulation.mapper.grid
    arrays = simulation.track, robot.believed_track, simulation.curve, grid.cells, simulation.unseen_in
    numbers = np.array([simulation.distance, robot.turned, robot.collisions, simulation.decisions])
    return [array.tobytes() for array in (*arrays, numbers)] + [simulation.stop_reason.encode()]


@pytest.mark.parametrize(
    "agent",
    [
        "tour",
        "layout-tour",
        "random",
        "clairvoyant",
        "layout-tour:predictor=oracle",
        "layout-tour:predictor=reconstruct:rose2;growth=0.3",
        "plan-tour:predictor=oracle:horizon=1",
    ],
)
@pytest.mark.parametrize("config", CONFIGS)
def test_a_run_goes_on_bit_for_bit(tmp_path: Path, config: str, agent: str) -> None:
    file = tmp_path / "run.npz"
    whole, strategy = prepare(offices(), CONFIGS[config], agent)
    play(whole, strategy, seed=3)
    half, strategy = prepare(offices(), CONFIGS[config], agent)
    play(half, strategy, seed=3, until=lambda state: state.decisions >= whole.decisions // 2)
    assert 0 < half.decisions < whole.decisions
    save_simulation(half, file, {"agent": agent})
    saved = read_saved_run(file)
    assert saved.notes == {"agent": agent} and len(saved.moves) == half.decisions
    again, strategy = prepare(offices(), saved.config, agent)
    asked: list[int] = []
    episode = play(again, strategy, saved=saved, on_step=lambda state: asked.append(state.decisions))
    assert asked[0] == half.decisions and len(episode.decision_ms) == whole.decisions - half.decisions
    assert digest(again) == digest(whole)


def test_motion_primitives_are_made_again(tmp_path: Path) -> None:
    moves = np.random.default_rng(1).uniform((-0.1, -1), (0.4, 1), (40, 2)).tolist()
    simulations = [Simulation(offices(), CONFIGS["drift"]) for _ in range(2)]
    for simulation in simulations:
        simulation.reset(seed=5, start=Pose(3.0, 3.3, 0.1))
    for forward, turn in moves[:20]:
        simulations[1].drive(forward, turn)
    save_simulation(simulations[1], tmp_path / "run.npz")
    simulations[1] = load_simulation(tmp_path / "run.npz", offices())
    for k, simulation in enumerate(simulations):
        for forward, turn in moves[20 * k :]:
            simulation.drive(forward, turn)
    assert digest(simulations[0]) == digest(simulations[1])


def test_plans_that_ship_are_found_by_their_name(tmp_path: Path) -> None:
    simulation = Simulation("office-01", SimulationConfig(sensor="short"))
    simulation.reset(seed=0)
    simulation.step(0)
    save_simulation(simulation, tmp_path / "run.npz")
    loaded = load_simulation(tmp_path / "run.npz")
    assert digest(loaded) == digest(simulation)
    assert [f.path_length for f in loaded.decision.frontiers] == [
        f.path_length for f in simulation.decision.frontiers
    ]


def test_a_run_that_is_over_is_over_again(tmp_path: Path) -> None:
    simulation = Simulation(offices(), CONFIGS["exact"])
    agent = make_agent("nearest")
    play(simulation, agent, seed=0)
    save_simulation(simulation, tmp_path / "run.npz")
    loaded = load_simulation(tmp_path / "run.npz", offices())
    assert loaded.done and loaded.stop_reason == simulation.stop_reason
    return_to_start(simulation)
    with pytest.raises(ConfigError, match="before the return"):
        save_simulation(simulation, tmp_path / "run.npz")


@pytest.mark.parametrize("config", ["exact", "drift"])
def test_a_move_that_is_cut_short_is_left_out(tmp_path: Path, config: str) -> None:
    """Ctrl-C comes at any scan; a program that catches it saves a run that goes on."""
    simulation, whole = Simulation(offices(), CONFIGS[config]), Simulation(offices(), CONFIGS[config])
    file, saved, before = tmp_path / "run.npz", [], 0

    def interrupt(_: Simulation) -> None:
        if simulation.decisions > before:
            raise KeyboardInterrupt

    for first, drives in ((0, False), (1, False), (3, False), (2, True)):
        simulation.on_scan, before = None, first
        for one in (simulation, whole):
            one.reset(seed=1)
            for _ in range(first):
                one.step(0)
        simulation.on_scan = interrupt
        with pytest.raises(KeyboardInterrupt):
            simulation.drive(0.5, 1.0) if drives else simulation.step(0)
        simulation.on_scan = None
        save_simulation(simulation, file)
        assert digest(load_simulation(file, offices())) == digest(whole)
        simulation.step(0)
        with pytest.raises(ConfigError, match="went on after a move that was cut short"):
            save_simulation(simulation, file)
    simulation.reset(seed=1)
    simulation.on_scan = lambda one: saved.append(save_simulation(one, file)) if one.decisions == 1 else None
    simulation.step(0)
    assert saved and load_simulation(file, offices()).decisions == 0


def test_what_is_no_saved_run_is_refused(tmp_path: Path) -> None:
    file, other = tmp_path / "run.npz", tmp_path / "other.npz"
    simulation = Simulation(offices(), CONFIGS["exact"])
    with pytest.raises(ConfigError, match="reset"):
        save_simulation(simulation, file)
    simulation.reset(seed=2**64)
    with pytest.raises(ConfigError, match="the seed of a run that is saved must be a whole number"):
        save_simulation(simulation, file)
    simulation.reset(seed=0)
    simulation.step(0)
    save_simulation(simulation, file)
    with pytest.raises(ConfigError, match="another plan"):
        load_simulation(file, "office-01")
    with pytest.raises(ConfigError, match=r"was saved on '(.*)', which is another plan now: its geometry"):
        load_simulation(file, offices().stretched(2.0, 2.0))
    with pytest.raises(ConfigError, match=r"with another configuration$"):
        read_saved_run(file).restore(Simulation(offices(), SimulationConfig(sensor="short")))
    with pytest.raises(UnknownNameError, match=r"run\.npz: .* does not ship: give it as .*plan="):
        load_simulation(file)
    with pytest.raises(ResultsError, match="missing"):
        load_simulation(tmp_path / "none.npz", offices())
    shut = tuple(dataclasses.replace(door, rooms=(0, 0)) for door in offices().doors)
    with pytest.raises(ConfigError, match="rooms of doors are others"):
        load_simulation(file, dataclasses.replace(offices(), doors=shut))
    arrays = read_arrays(file)
    table = json.loads(str(arrays["run"]))
    earlier = {key: value for key, value in table.items() if key != "raster_hash"}
    write_arrays(other, arrays | {"run": np.array(json.dumps(earlier))})
    assert load_simulation(other, offices()).decisions == 1
    for change, said in (
        ({"run": np.array(json.dumps(table | {"format": 99}))}, "this version"),
        ({"run": np.array(json.dumps(table | {"config": {"resolution": -1}}))}, "damaged"),
        ({"run": np.array("[]")}, "this version"),
        ({"run": np.array("{")}, "damaged"),
        ({"pose": arrays["pose"] + 0.001}, "lead elsewhere"),
        ({"cells": arrays["cells"] * 0}, "lead elsewhere"),
        ({"values": arrays["values"][:, :1]}, "damaged"),
        ({"values": arrays["values"] + 1e6}, "lead elsewhere"),
        ({"kinds": np.zeros(10**6, np.int8), "values": np.zeros((10**6, 2))}, "500000 is the most"),
    ):
        write_arrays(other, arrays | change)
        with pytest.raises(ResultsError, match=said):
            load_simulation(other, offices())
    other.write_bytes(file.read_bytes()[:200])
    with pytest.raises(ResultsError, match="damaged"):
        load_simulation(other, offices())
