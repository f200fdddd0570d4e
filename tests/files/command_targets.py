"""What commands read besides floor plans and results: leaderboards, options in names, pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np

from layoutexplore.agents import make_agent
from layoutexplore.benchmark.leaderboard import make_leaderboard
from layoutexplore.benchmark.runner import run_benchmark
from layoutexplore.benchmark.suite import load_suite
from layoutexplore.errors import LayoutExploreError
from layoutexplore.files import to_toml, write_atomically
from layoutexplore.importing.building import import_building
from layoutexplore.importing.pictures import PictureConfig
from layoutexplore.layout.pipeline import reconstruct
from layoutexplore.maps.geojson import save_plan
from layoutexplore.predictors import make_predictor
from layoutexplore.priors.evacuation_picture import draw_evacuation_plan
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.episode import play
from layoutexplore.simulation.saved_run import read_saved_run, save_simulation
from layoutexplore.simulation.simulation import Simulation
from tests.files.targets import QUIET_LIDAR, RESULTS, TARGETS, Target, decision, house, read_school, write_ros
from tests.importing.cases import office
from tests.maps.cases import SCHOOL
from tests.plugins.cases import AGENT


def write_office(folder: Path) -> None:
    """As the office floors are: real spaces first, then empty ones."""
    empty = '<space id="e"><labels><type>R</type><label>OFFICE</label></labels></space>' * 3
    (folder / "school.xml").write_text(SCHOOL.replace("</spaces>", f"{empty}</spaces>"))


def write_board(folder: Path) -> None:
    """Results of three agents on a suite of one's own."""
    save_plan(house(), folder / "house.geojson")
    suite = {"plans": [str(folder / "house.geojson")], "starts": 1, "sensors": ["indoor"]}
    write_atomically(folder / "suite.toml", to_toml(suite))
    run_benchmark(load_suite(str(folder / "suite.toml")).config(("tour", "random")), folder / "out")


def read_board(folder: Path) -> None:
    board = make_leaderboard([folder / "out"], load_suite(str(folder / "suite.toml")), repeat=0)
    assert all(standing.rank >= 0 for standing in board.standings)


SPECS = """agent latency-tour:min_size=0.6
agent cost-utility:alpha=0.25,min_size=0.8
agent layout-tour:predictor=rectangle
agent MINE:Mine:skip=2,gain=1.5
predictor oracle:flip=0.1,horizon=2
predictor reconstruct:morphological
method default:door_min=0.5,door_max=2.0
method morphological
"""


def write_specs(folder: Path) -> None:
    (folder / "specs.txt").write_text(SPECS)
    (folder / "mine.py").write_text(AGENT)


def read_specs(folder: Path) -> None:
    """Make what each line names; the last error is the file's."""
    problems = []
    for line in (folder / "specs.txt").read_bytes().decode(errors="replace").splitlines()[:30]:
        kind, _, spec = line.partition(" ")
        spec = spec.replace("MINE", str(folder / "mine.py"))
        try:
            if kind == "agent":
                make_agent(spec)
            elif kind == "predictor":
                make_predictor(spec)
            else:
                reconstruct(decision().grid, spec)
        except LayoutExploreError as error:
            problems.append(error)
    if problems:
        raise problems[-1]


def write_picture(folder: Path) -> None:
    cv2.imwrite(str(folder / "floor.png"), office()[20:165:2, 20:290:2])


def read_picture(folder: Path) -> None:
    building = import_building(folder / "floor.png", PictureConfig(resolution=0.1))
    assert building.room_ids.shape == building.grid.shape


def write_evacuation_plan(folder: Path) -> None:
    raster = house().rasterize(0.1)
    drawn = draw_evacuation_plan(raster.free, raster.room_ids, 0.1, np.random.default_rng(0))
    cv2.imwrite(str(folder / "wall.png"), drawn[..., ::-1])


def write_hinted(folder: Path) -> None:
    save_plan(house(), folder / "plan.geojson")
    (folder / "hints.txt").write_text(";scale=1.0;rotation=0.5;mirror=no;here=3.0/2.5;sure=0.4")


def read_as_prior(path: Path, hints: str = "") -> None:
    """Look for a plan in what a robot sees first, as `plan-tour` does."""
    seen = decision()
    predicted = make_predictor(f"prior:{path}{hints}").predict(seen)
    assert len(predicted.frontiers) == len(seen.frontiers)


def planning(folder: Path) -> Any:
    """Who plans on a plan in the folder, which it knows beforehand."""
    return make_agent(f"plan-tour:predictor=prior:{folder / 'plan.geojson'}")


def write_planned_run(folder: Path) -> None:
    save_plan(house(), folder / "plan.geojson")
    agent = planning(folder)
    simulation = Simulation(
        house(), SimulationConfig(sensor=QUIET_LIDAR, max_distance=60.0), make_predictor(agent.predictor)
    )
    play(simulation, agent, seed=1, until=lambda state: state.state.decisions == 2)
    save_simulation(simulation, folder / "run.npz", {"agent": agent.name})


def read_planned_run(folder: Path) -> None:
    """Go on with a run of `plan-tour`: it and its predictor are asked at every decision again."""
    agent, saved = planning(folder), read_saved_run(folder / "run.npz")
    simulation = Simulation(house(), saved.config, make_predictor(agent.predictor))
    play(simulation, agent, until=lambda state: state.state.decisions >= 3, saved=saved)


READERS: dict[str, Target] = TARGETS | {
    "offices XML": Target(write=write_office, files={"school.xml": "xml"}, read=read_school),
    "leaderboard": Target(
        write=write_board, files=RESULTS | {"suite.toml": "toml"}, read=read_board, share=0.2
    ),
    "specs": Target(
        write=write_specs, files={"specs.txt": "csv", "mine.py": "csv"}, read=read_specs, share=0.5
    ),
    "prior plan": Target(
        write=lambda folder: save_plan(house(), folder / "plan.geojson"),
        files={"plan.geojson": "json"},
        read=lambda folder: read_as_prior(folder / "plan.geojson"),
        share=0.2,
    ),
    "prior picture": Target(
        write=write_evacuation_plan,
        files={"wall.png": "png"},
        read=lambda folder: read_as_prior(folder / "wall.png"),
        share=0.2,
    ),
    "prior blueprint": Target(
        write=write_picture,
        files={"floor.png": "png"},
        read=lambda folder: read_as_prior(folder / "floor.png"),
        share=0.2,
    ),
    "prior map": Target(
        write=write_ros,
        files={"map.yaml": "yaml", "map.pgm": "pgm"},
        read=lambda folder: read_as_prior(folder / "map.yaml"),
        share=0.2,
    ),
    "hinted prior": Target(
        write=write_hinted,
        files={"hints.txt": "csv", "plan.geojson": "json"},
        read=lambda folder: read_as_prior(
            folder / "plan.geojson", (folder / "hints.txt").read_bytes().decode(errors="replace")
        ),
        share=0.5,
    ),
    "planned run": Target(
        write=write_planned_run,
        files={"run.npz": "npz", "plan.geojson": "json"},
        read=read_planned_run,
        share=0.3,
    ),
    "picture": Target(write=write_picture, files={"floor.png": "png"}, read=read_picture, share=0.2),
}
"""All readers, by name."""
