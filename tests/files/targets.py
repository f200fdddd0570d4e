"""Readers to be fuzzed: small whole files of every kind, and what a program does with them."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from shapely import LineString

from layoutexplore.agents import make_agent
from layoutexplore.agents.rl.card import find_policy
from layoutexplore.agents.rl.hyperparameters import read_config
from layoutexplore.benchmark.config import BenchmarkConfig, read_benchmark_config
from layoutexplore.benchmark.failures import finished_rows
from layoutexplore.benchmark.runner import run_benchmark
from layoutexplore.benchmark.store import ResultsFolder
from layoutexplore.errors import LayoutExploreError
from layoutexplore.evaluation.layouts import read_outlines
from layoutexplore.files import to_toml, write_atomically
from layoutexplore.frontiers.decision import Decision
from layoutexplore.grids.ros_map import load_grid
from layoutexplore.layout.merging.merge_forest import PAIR_FOREST
from layoutexplore.maps.closed_door_maps import read_cells
from layoutexplore.maps.formats.building_files import floors_of
from layoutexplore.maps.geojson import save_plan
from layoutexplore.maps.library import load_plan
from layoutexplore.maps.tracing import floorplan_from_ascii
from layoutexplore.models.forest import Forest
from layoutexplore.models.network_files import load_weights, save_weights, shapes_of
from layoutexplore.report.benchmark import write_benchmark_report
from layoutexplore.sensing.lidar import LidarConfig
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.saved_run import load_simulation, save_simulation
from layoutexplore.simulation.simulation import Simulation
from layoutexplore.training.snapshots import explore_plan
from tests.maps.cases import SCHOOL, two_rooms, write_houseexpo, write_kth
from tests.maps.formats.cases import (
    LEFT,
    RIGHT,
    feature,
    write_collection,
    write_imdf,
    write_osm,
    write_osmag,
    write_rmf,
    write_walls,
)
from tests.plans import HOUSE

QUIET_LIDAR = LidarConfig(fov=6.28, range_max=8.0, beams=90)


@dataclass(frozen=True, kw_only=True)
class Target:
    """A reader.

    Attributes:
        write: Writes whole files into a folder.
        files: Which of them are damaged, by pattern, and their kinds.
        read: Reads them.
        share: Inputs a turn: costly readers get fewer.
    """

    write: Callable[[Path], object]
    files: dict[str, str]
    read: Callable[[Path], object]
    share: float = 1.0


@cache
def house() -> Any:
    return floorplan_from_ascii(HOUSE, resolution=0.6, name="house")


@cache
def decision() -> Decision:
    simulation = Simulation(house(), SimulationConfig(sensor="indoor"))
    simulation.reset(seed=1)
    return simulation.decision


def use_plan(path: Path) -> None:
    """Read a floor plan, draw it and write it again."""
    plan = load_plan(path)
    x0, y0, x1, y1 = plan.bounds
    assert np.isfinite([x0, y0, x1, y1]).all() and all(room.id > 0 for room in plan.rooms)
    raster = plan.rasterize(max(0.2, (x1 - x0) / 300, (y1 - y0) / 300))
    assert raster.room_ids.min() >= 0
    save_plan(plan, path.parent / "again.geojson")
    assert plan.content_hash


def write_ros(folder: Path) -> None:
    cells = np.full((40, 50), 205, np.uint8)
    cells[5:35, 5:45] = 0
    cells[7:33, 7:43] = 254
    cv2.imwrite(str(folder / "map.pgm"), cells)
    (folder / "map.yaml").write_text(
        "image: map.pgm\nmode: trinary\nresolution: 0.05\norigin: [0.0, -1.5, 0.1]\nnegate: 0\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )


def write_image(folder: Path) -> None:
    write_ros(folder)
    cv2.imwrite(str(folder / "plain.png"), cv2.imread(str(folder / "map.pgm"), cv2.IMREAD_UNCHANGED))
    for name in ("map.yaml", "map.pgm"):
        (folder / name).unlink()


def read_images(folder: Path) -> None:
    with contextlib.suppress(LayoutExploreError):
        read_cells(folder / "plain.png")
    use_plan(folder / "plain.png")


BENCHMARK = {
    "plans": ["quick"], "starts": 2, "sensors": ["stage", "mine"], "agents": ["nearest", "tour"],
    "baseline": "nearest", "seed": 3, "explain": True,
    "simulation": {"resolution": 0.1, "odometry_noise": {"translation": 0.01, "rotation": 0.01}},
    "lidars": {"mine": {"fov": 6.28, "beams": 90, "range_max": 8.0}},
}  # fmt: skip


def read_benchmark(folder: Path) -> None:
    config = BenchmarkConfig(**read_benchmark_config(folder / "benchmark.toml"))
    for sensor in config.sensors:
        assert config.simulation_with(sensor).lidar.range_max > 0
    assert len(config.config_hash) == 12 and to_toml(dataclasses.asdict(config.simulation))


def write_training(folder: Path) -> None:
    table = read_config(None, {"algorithm": "maskable-ppo", "predictor": "none"}).as_table()
    write_atomically(folder / "training.toml", to_toml(table))


def read_training(folder: Path) -> None:
    config = read_config(folder / "training.toml")
    assert config.steps >= 1 and to_toml(config.as_table())


def write_policy(folder: Path) -> None:
    shutil.copy(find_policy("layout"), folder / "policy.safetensors")


def read_policy(folder: Path) -> None:
    agent = make_agent(f"policy:{folder / 'policy.safetensors'}")
    agent.reset(1)
    choice = agent.act(decision())
    if isinstance(choice, np.ndarray):  # the first steps of a way, after which it decides anew
        assert len(choice) > 1 and decision().traversable[choice[:, 0], choice[:, 1]].all()
    else:
        assert 0 <= choice < len(decision().frontiers)


def write_network_policy(folder: Path) -> None:
    from layoutexplore.agents.rl.torch_policy_files import save_policy
    from tests.agents.rl.cases import random_actor, spec

    save_policy(folder / "policy.safetensors", random_actor().state_dict(), {"policy": spec().as_table()})


def write_forest_file(folder: Path) -> None:
    feature, value = np.array([3, -1, 5, -1, -1], np.int32), np.array([0.5, 1.0, 2.5, -1.0, 0.25])
    left, right = np.array([1, 0, 3, 0, 0], np.int32), np.array([2, 0, 4, 0, 0], np.int32)
    PAIR_FOREST.save(Forest(feature, value, left, right, np.array([0], np.int32), 0.1), folder / "trees.json")


LAYERS = {"show": (2, 3, 3, 1), "judge": (3, 1, 1, 1)}


def write_network(folder: Path) -> None:
    rng = np.random.default_rng(1)
    weights = {name: rng.normal(size=shape).astype(np.float16) for name, shape in shapes_of(LAYERS).items()}
    save_weights(folder / "network.safetensors", weights, "a note")


def read_network(folder: Path) -> None:
    for values in load_weights(folder / "network.safetensors", shapes_of(LAYERS)).values():
        assert values.dtype == np.float32 and np.isfinite(values).all()


def read_trees(folder: Path) -> None:
    forest = PAIR_FOREST.load(folder / "trees.json")
    samples = np.zeros((9, 200))
    assert np.isfinite(forest.score(samples)).all() and len(forest.numbers) == 6


def write_store(folder: Path) -> None:
    explore_plan(house(), make_agent("nearest"), sensor="indoor", coverages=(0.3, 0.6), store=folder)


def read_store(folder: Path) -> None:
    found = explore_plan(house(), make_agent("nearest"), sensor="indoor", coverages=(0.3, 0.6), store=folder)
    for snapshot in found:
        assert snapshot.decision.grid.shape == snapshot.truth.raster.shape
        for frontier in snapshot.decision.frontiers:
            assert snapshot.decision.grid.cells[frontier.cells[:, 0], frontier.cells[:, 1]].size
            assert np.isfinite([frontier.path_length, frontier.size, *frontier.centroid]).all()


def write_results(folder: Path) -> None:
    save_plan(house(), folder / "house.geojson")
    config = BenchmarkConfig(
        plans=(str(folder / "house.geojson"),),
        starts=1,
        sensors=("indoor",),
        agents=("nearest", "layout-tour"),
    )
    run_benchmark(config, folder / "out")


RESULTS = {
    "out/run.toml": "toml",
    "out/results.csv": "csv",
    "out/runs/*/*.npz": "npz",
    "out/plans/*.npz": "npz",
}


def read_results(folder: Path) -> None:
    results = ResultsFolder(folder / "out")
    results.manifest()
    for row in finished_rows(results, lambda text: None):
        results.episode(row)
        results.counterfactual(row)
        if recording := results.recording(row):
            recording.cells(3)
        results.raster(row.plan)


def read_report(folder: Path) -> None:
    write_benchmark_report(ResultsFolder(folder / "out"))


def write_resume(folder: Path) -> None:
    from layoutexplore.agents.rl.checkpoint import Progress, save_checkpoint

    evaluations = [{"steps": 1.0, "score": 1.25, "d95": 80.5}]
    save_checkpoint(folder, model(), Progress(algorithm="PPO", steps=5, evaluations=evaluations))
    rows = "".join(f"{k // 4},{k % 4},{30 + k}.5,{40 + k}.25\n" for k in range(8))
    (folder / "explorations.csv").write_text(f"group,member,d95,d99\n{rows}")


def read_resume(folder: Path) -> None:
    from layoutexplore.agents.rl.checkpoint import load_checkpoint
    from layoutexplore.agents.rl.tour_search.search import read_explorations

    progress = load_checkpoint(folder, model())
    assert isinstance(progress.steps, int) and json.dumps(dataclasses.asdict(progress))
    read_explorations(folder / "explorations.csv", 4)


@cache
def model() -> Any:
    import gymnasium
    import torch
    from stable_baselines3 import PPO

    torch.set_num_threads(1)
    made = PPO("MlpPolicy", gymnasium.make("CartPole-v1"), policy_kwargs={"net_arch": [4]}, device="cpu")
    loss = sum(parameter.sum() for parameter in made.policy.parameters())
    loss.backward()
    made.policy.optimizer.step()
    return made


def write_school(folder: Path) -> None:
    (folder / "school.xml").write_text(SCHOOL)


def read_school(folder: Path) -> None:
    read_outlines(folder / "school.xml")
    use_plan(folder / "school.xml")


def read_ros(folder: Path) -> None:
    load_grid(folder / "map.yaml")
    use_plan(folder / "map.yaml")


def write_saved_run(folder: Path) -> None:
    simulation = Simulation(house(), SimulationConfig(sensor=QUIET_LIDAR, max_distance=60.0))
    decision = simulation.reset(seed=1)
    for _ in range(3):
        decision = simulation.step(0)
    save_simulation(simulation, folder / "run.npz", {"agent": "nearest", "steps": len(decision.frontiers)})


def read_saved(folder: Path) -> None:
    simulation = load_simulation(folder / "run.npz", house())
    assert simulation.distance >= 0.0 and np.isfinite([*simulation.decision.pose]).all()


def use_building(path: Path) -> None:
    """Read every floor of a building, and one that does not exist."""
    with contextlib.suppress(LayoutExploreError):
        use_plan(Path(f"{path}#nowhere"))
    for source in floors_of(path)[:3]:
        use_plan(Path(source))


def write_lines(folder: Path) -> None:
    """Rooms and doors in metres, as QGIS exports them."""
    rooms = [feature(LEFT, name="a"), feature(RIGHT, name="b", width=0.8)]
    door = feature(LineString([(5, 1), (5, 1.9)]), width="0.9")
    write_collection(folder / "lines.geojson", *rooms, door)


TARGETS: dict[str, Target] = {
    "GeoJSON": Target(
        write=lambda folder: save_plan(two_rooms(), folder / "plan.geojson"),
        files={"plan.geojson": "json"},
        read=lambda folder: use_plan(folder / "plan.geojson"),
    ),
    "HouseExpo": Target(
        write=lambda folder: write_houseexpo(folder),
        files={"house.json": "json", "house.label_data.json": "json"},
        read=lambda folder: use_plan(folder / "house.json"),
    ),
    "school XML": Target(write=write_school, files={"school.xml": "xml"}, read=read_school),
    "IMDF": Target(
        write=lambda folder: write_imdf(folder / "home"),
        files={f"home/{part}.geojson": "json" for part in ("level", "unit", "opening")},
        read=lambda folder: use_building(folder / "home"),
    ),
    "OSM": Target(
        write=lambda folder: write_osm(folder / "home.osm"),
        files={"home.osm": "xml"},
        read=lambda folder: use_building(folder / "home.osm"),
    ),
    "osmAG": Target(
        write=lambda folder: write_osmag(folder / "home.osm"),
        files={"home.osm": "xml"},
        read=lambda folder: use_building(folder / "home.osm"),
    ),
    "Open-RMF": Target(
        write=lambda folder: write_rmf(folder / "two.building.yaml"),
        files={"two.building.yaml": "yaml"},
        read=lambda folder: use_building(folder / "two.building.yaml"),
    ),
    "other GeoJSON": Target(
        write=write_lines,
        files={"lines.geojson": "json"},
        read=lambda folder: use_plan(folder / "lines.geojson"),
    ),
    "walls GeoJSON": Target(
        write=lambda folder: write_walls(folder / "walls.geojson"),
        files={"walls.geojson": "json"},
        read=lambda folder: use_plan(folder / "walls.geojson"),
    ),
    "saved run": Target(write=write_saved_run, files={"run.npz": "npz"}, read=read_saved),
    "ROS map": Target(write=write_ros, files={"map.yaml": "yaml", "map.pgm": "pgm"}, read=read_ros),
    "image": Target(write=write_image, files={"plain.png": "png"}, read=read_images, share=0.5),
    "KTH": Target(
        write=write_kth,
        files={"50_PLAN1_occ.png": "png", "50_PLAN1_rooms.png": "png"},
        read=lambda folder: use_plan(folder / "50_PLAN1_occ.png"),
        share=0.5,
    ),
    "benchmark TOML": Target(
        write=lambda folder: write_atomically(folder / "benchmark.toml", to_toml(BENCHMARK)),
        files={"benchmark.toml": "toml"},
        read=read_benchmark,
    ),
    "training TOML": Target(write=write_training, files={"training.toml": "toml"}, read=read_training),
    "policy": Target(write=write_policy, files={"policy.safetensors": "safetensors"}, read=read_policy),
    "network policy": Target(
        write=write_network_policy, files={"policy.safetensors": "safetensors"}, read=read_policy, share=0.5
    ),
    "trees": Target(write=write_forest_file, files={"trees.json": "json"}, read=read_trees),
    "network": Target(write=write_network, files={"network.safetensors": "safetensors"}, read=read_network),
    "snapshots": Target(write=write_store, files={"*.npz": "npz"}, read=read_store, share=0.5),
    "results": Target(write=write_results, files=RESULTS, read=read_results),
    "report": Target(write=write_results, files=RESULTS, read=read_report, share=0.03),
    "resume": Target(
        write=write_resume,
        files={"checkpoint.safetensors": "safetensors", "explorations.csv": "csv"},
        read=read_resume,
    ),
}
