"""Predictors: seen regions, shapes that never take from what is seen, trees as numbers, and the layout strategies."""

from __future__ import annotations

import dataclasses
import json
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray
from typer.testing import CliRunner

from layoutexplore import cli
from layoutexplore.agents import make_agent
from layoutexplore.errors import ConfigError, UnknownNameError
from layoutexplore.frontiers.decision import STOP, Decision
from layoutexplore.frontiers.detection import FrontierClusters, find_frontiers
from layoutexplore.maps.geojson import save_plan
from layoutexplore.maps.library import load_plan
from layoutexplore.maps.tracing import floorplan_from_ascii
from layoutexplore.models.forest import Forest
from layoutexplore.models.forest_files import load_forests, save_forests
from layoutexplore.predictors import make_predictor, make_room_predictor, predictor_names
from layoutexplore.predictors.frontier_model.features import FEATURES, frontier_features, look_around
from layoutexplore.predictors.frontier_model.network import FrontierNetwork
from layoutexplore.predictors.learned import FOLDER, FRONTIER_MODEL, FRONTIER_NETWORK, ROOM_NETWORK
from layoutexplore.predictors.oracle import OraclePredictor
from layoutexplore.predictors.room_completion import Shape, complete_regions
from layoutexplore.predictors.seen_rooms import Regions, home_regions, seen_regions
from layoutexplore.predictors.shape_baselines import main_angle
from layoutexplore.simulation.simulation import Simulation, SimulationConfig
from layoutexplore.training.explorations import stopped_explorations
from layoutexplore.training.folds import deal_groups, group_buildings
from layoutexplore.training.predictor_forests import TrainingConfig, fit_frontier_forests, train_models
from layoutexplore.training.predictor_samples import Samples, gather, join

PLAN = """
#########################
#aaaaaaaa#bbbbbbb#cccccc#
#aaaaaaaa#bbbbbbb#cccccc#
#aaaaaaaa#bbbbbbb#cccccc#
####.########.#######.###
#dddddddddddddddddddddddd#
#dddddddddddddddddddddddd#
#########################
""".replace("#dddddddddddddddddddddddd#", "#ddddddddddddddddddddddd#")


@pytest.fixture(scope="module")
def decision() -> Decision:
    plan = floorplan_from_ascii(PLAN, resolution=0.9)
    return Simulation(plan, SimulationConfig(sensor="short")).reset(seed=2)


def test_every_predictor_by_name() -> None:
    assert predictor_names()[0] == "none" and {
        "rectangle",
        "hull",
        "parallel-wall",
        "face-subset",
        "oracle",
        "layout",
    } < set(predictor_names())
    assert make_predictor("none") is None and make_room_predictor("none").name == "none"
    with pytest.raises(UnknownNameError, match="layout"):
        make_predictor("layuot")
    with pytest.raises(ConfigError, match="flip"):
        make_predictor("layout:flip=1")
    with pytest.raises(ConfigError, match="known: off, on"):
        make_predictor("layout:network=maybe")


@pytest.mark.parametrize("name", [*predictor_names(), "layout:network=off"])
def test_rooms_hold_what_is_seen_and_nothing_in_walls(name: str, decision: Decision) -> None:
    predictor = make_room_predictor(name)
    if isinstance(predictor, OraclePredictor):
        return
    cells = decision.grid.cells
    rooms = predictor.rooms(decision)
    regions = seen_regions(cells, decision.grid.resolution)
    assert rooms.room_ids.dtype == np.int32 and rooms.passable.dtype == np.bool_
    assert (rooms.room_ids[cells == 0] == regions.labels[cells == 0]).all()
    assert not rooms.room_ids[cells == 100].any() and not rooms.passable[cells == 100].any()
    assert rooms.passable[cells == 0].all()
    judged = predictor.predict(decision)
    for frontier in judged.frontiers:
        assert isinstance(frontier.is_closed, bool) and (frontier.expected_area or 0.0) >= 0.0
        assert 0.0 <= (frontier.confidence or 0.0) <= 1.0 and frontier.room is not None


def test_the_layout_is_completed_when_somebody_looks(decision: Decision) -> None:
    predictor = make_predictor("layout")
    assert predictor is not None
    judged = predictor.predict(decision)
    labels = judged.layout.labels
    assert labels.shape == decision.grid.shape and labels.dtype == np.int32
    seen = seen_regions(decision.grid.cells, decision.grid.resolution)
    assert labels.max() <= seen.count and (labels > 0).sum() >= (seen.labels > 0).sum()
    again = make_predictor("layout")
    assert again is not None
    assert [f.expected_area for f in again.predict(decision).frontiers] == [
        f.expected_area for f in judged.frontiers
    ]


def test_regions_part_at_doors() -> None:
    raster = floorplan_from_ascii(PLAN, resolution=0.9).rasterize(0.1)
    cells = np.where(raster.occupied, 100, 0).astype(np.int8)
    regions = seen_regions(cells, 0.1)
    assert regions.count == 4
    for room in range(1, 5):
        owners = regions.labels[(raster.room_ids == room) & raster.free]
        assert (owners == np.bincount(owners).argmax()).mean() > 0.98
    boxes = regions.boxes
    for region in range(1, 5):
        rows, cols = np.nonzero(regions.labels == region)
        assert boxes[region].tolist() == [len(rows), rows.min(), cols.min(), rows.max() + 1, cols.max() + 1]


@settings(max_examples=50, deadline=None)
@given(
    cells=hnp.arrays(
        np.int8, st.tuples(st.integers(3, 24), st.integers(3, 24)), elements=st.sampled_from([-1, 0, 0, 100])
    )
)
def test_every_free_cell_has_a_region_and_features_are_finite(cells: NDArray[np.int8]) -> None:
    regions = seen_regions(cells, 0.2)
    assert ((regions.labels > 0) == (cells == 0)).all()
    clusters = find_frontiers(cells)
    if len(clusters):
        features = frontier_features(look_around(cells, clusters, regions, 0.2), np.zeros(len(clusters)))
        assert features.shape == (len(clusters), len(FEATURES)) and np.isfinite(features).all()


def test_mirrored_and_turned_frontiers_look_the_same() -> None:
    cells = np.full((60, 60), -1, np.int8)
    cells[10:40, 10:40] = 100
    cells[12:38, 12:38] = 0
    cells[20:29, 38:40] = 0
    cells[15:20, 40] = -1
    expected = None
    for turns in range(4):
        for mirrored in (False, True):
            seen = np.ascontiguousarray(np.rot90(cells[:, ::-1] if mirrored else cells, turns))
            first, regions = FrontierClusters.of([find_frontiers(seen).cluster(0)]), seen_regions(seen, 0.1)
            features = frontier_features(look_around(seen, first, regions, 0.1), np.zeros(1))
            names = [
                k
                for k, name in enumerate(FEATURES)
                if name.startswith(("open_", "doors_", "size", "width", "region"))
            ]
            expected = features[:, names] if expected is None else expected
            np.testing.assert_allclose(features[:, names], expected, rtol=1e-5)


def test_the_home_of_a_frontier() -> None:
    labels = np.array([[1, 1, 2, 2, 3]], np.int32)
    regions = Regions(labels, 3, np.zeros(labels.shape, np.float32))
    clusters = FrontierClusters.of(
        [np.array([[0, k] for k in part], np.int32) for part in ((0, 2, 3), (1, 2), (4,))]
    )
    assert home_regions(regions, clusters).tolist() == [2, 1, 3]


def test_a_shape_is_filled_up_to_walls_and_other_rooms() -> None:
    cells = np.full((6, 12), -1, np.int8)
    cells[:, :3] = 0
    cells[:, 9] = 100
    regions = seen_regions(cells, 0.5)
    rooms = complete_regions(cells, regions, {1: Shape(0, 2, np.ones((6, 10), np.bool_))})
    assert (rooms.room_ids[:, :9] == 1).all() and (rooms.room_ids[:, 10:] != 1).all()


def test_main_angle() -> None:
    rows, cols = np.mgrid[:120, :120]
    along, across = cols * np.cos(0.3) + rows * np.sin(0.3), rows * np.cos(0.3) - cols * np.sin(0.3)
    walls = ((along % 40) < 2) | ((across % 40) < 2)
    assert main_angle(np.where(walls, 100, 0).astype(np.int8)) == pytest.approx(0.3, abs=0.03)


def test_forests_are_what_was_trained(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    names = tuple("abcdefgh")
    features = rng.normal(size=(600, len(names))).astype(np.float32)
    closed = features[:, 3] > 0
    area = np.abs(features[:, 5]).astype(float) * 3
    samples = Samples(
        features, closed, area, np.where(rng.random(600) < 0.5, "a", "b"), np.ones(600, np.bool_), []
    )
    forests = fit_frontier_forests(samples, TrainingConfig(trees=15, rate=0.3, feature_share=1.0))
    assert ((forests["closed"].probability(features) > 0.5) == closed).mean() > 0.95
    path = tmp_path / "model.json"
    save_forests(path, forests, names, "a test")
    again = load_forests(path, names)
    np.testing.assert_allclose(
        again["area"].score(features), forests["area"].score(features), rtol=1e-3, atol=1e-3
    )
    with pytest.raises(ConfigError, match="train it again"):
        load_forests(path, ("size",))
    with pytest.raises(ConfigError, match="'inside' is missing"):
        load_forests(path, names, ("inside",))


def test_generated_plans_do_not_outvote_real_ones() -> None:
    """Where most frontiers are of generated plans, which are otherwise, trees still believe the real ones."""
    rng = np.random.default_rng(0)
    features = rng.normal(size=(900, 2)).astype(np.float32)
    real = np.arange(900) < 200
    closed = (features[:, 0] > 0) == real
    building = np.where(real, "house", np.array([f"generated {k % 50}" for k in range(900)]))
    forests = fit_frontier_forests(
        Samples(features, closed, np.ones(900), building, real, []), TrainingConfig(trees=15, rate=0.3)
    )
    assert ((forests["closed"].probability(features) > 0.5) == closed)[real].mean() > 0.95


def test_floors_of_one_building() -> None:
    long = PLAN.replace("#", "####")
    plans = [
        dataclasses.replace(floorplan_from_ascii(text, resolution=2.0, name=name), building=building)
        for text, name, building in ((PLAN, "a1", "a"), (long, "a2", "a"), (long, "b", "b"))
    ]
    assert group_buildings(plans[:2]) == {"a1": "a1", "a2": "a1"}
    assert group_buildings(plans) == {"a1": "a1", "a2": "a1", "b": "a1"}  # The same outline.


def test_a_model_of_ones_own(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="frontier_model"):
        make_predictor(f"layout:model={tmp_path}")
    plans = [floorplan_from_ascii(PLAN, resolution=0.9, name=name) for name in ("one", "other")]
    explorations = [
        e for plan in plans for e in stopped_explorations(plan, make_agent, 1, 4, tmp_path / "store")
    ]
    samples = join([gather(explorations[:2]), gather(explorations[2:])], {"other": "house"})
    assert set(samples.building.tolist()) == {cell.building for cell in samples.cells} == {"one", "house"}
    others = samples.of_buildings(lambda name: name != "one")
    assert set(others.building.tolist()) == {"house"} and len(others.features) == len(
        gather(explorations[2:]).features
    )
    assert deal_groups(["a", "b", "b"], 2) == deal_groups(["b", "a"], 2)
    train_models(samples, tmp_path, {"flat": "house"}, TrainingConfig(trees=3, cell_trees=3))
    predictor = make_room_predictor(f"layout:model={tmp_path}")
    assert (
        predictor.name == f"layout:model={tmp_path}" and "house" in (tmp_path / "held_out.json").read_text()
    )
    decision = Simulation(plans[0], SimulationConfig(sensor="short"), predictor).reset(seed=2)
    assert all(f.is_closed is not None for f in decision.frontiers)
    assert predictor.rooms(decision).room_ids.shape == decision.grid.shape


def test_training_from_the_command_line(tmp_path: Path) -> None:
    wide = "\n".join(row[:20] + row[19:20] * 4 + row[20:] for row in PLAN.strip().splitlines())
    for name, plan in (("north", PLAN), ("south", wide)):
        save_plan(floorplan_from_ascii(plan, resolution=0.9, name=name), tmp_path / f"{name}.geojson")
    paths = [str(tmp_path / f"{name}.geojson") for name in ("north", "south")]
    out = tmp_path / "models"
    arguments = [
        "evaluate",
        "train-predictor",
        *paths,
        "--folds",
        "2",
        "--stops",
        "2",
        "--trees",
        "4",
        "--out",
        str(out),
    ]
    network = ["office:7", "--stretched", "1", "--first-steps", "2", "--steps", "2", "--frontier-steps", "2"]
    result = CliRunner().invoke(cli.app, [*arguments, *network, "--store", str(tmp_path / "store")])
    assert result.exit_code == 0, result.output
    assert "held out" in result.output and "hidden_iou" in result.output
    notes = [
        json.loads((out / folder / FRONTIER_MODEL.name).read_text())["note"]
        for folder in ("fold1", "fold2", ".")
    ]
    frontiers, buildings = zip(*(map(int, re.findall(r"\d+", note)) for note in notes), strict=True)
    assert buildings == (2, 2, 3), "a copy is of its plan's building, so that it is held out with it"
    assert (out / "fold1" / "held_out.json").read_text() != (out / "fold2" / "held_out.json").read_text()
    assert make_room_predictor(f"layout:model={out}").name.startswith("layout:")
    networks = [path.name for path in (ROOM_NETWORK, FRONTIER_NETWORK)]
    assert all((out / folder / name).exists() for folder in ("fold1", "fold2", ".") for name in networks)
    alone = [*arguments, "office:7", "--no-network", "--store", str(tmp_path / "store")]
    assert CliRunner().invoke(cli.app, alone).exit_code == 0
    for folder, more in zip(("fold1", "fold2", "."), frontiers, strict=True):
        fewer = json.loads((out / folder / FRONTIER_MODEL.name).read_text())["note"]
        assert int(fewer.split()[0]) < more, "copies are learnt from"
    assert not any(list(out.rglob(name)) for name in networks), "a network of an earlier training has no say"
    for wrong in (["--folds", "3"], ["--folds", "2", "--no-forests"]):
        result = CliRunner().invoke(
            cli.app, [*arguments[:4], *wrong, "--stops", "2", "--no-network", "--out", str(tmp_path / "no")]
        )
        assert result.exit_code != 0 and not (tmp_path / "no").exists()


def test_a_plan_that_is_seen_at_once_teaches_nothing(tmp_path: Path) -> None:
    save_plan(
        floorplan_from_ascii("####\n#aa#\n####", resolution=0.9, name="closet"), tmp_path / "closet.geojson"
    )
    save_plan(floorplan_from_ascii(PLAN, resolution=0.9, name="house"), tmp_path / "house.geojson")
    closet, house = (str(tmp_path / f"{name}.geojson") for name in ("closet", "house"))
    options = ["--no-network", "--stops", "2", "--trees", "4", "--out", str(tmp_path / "models")]
    result = CliRunner().invoke(cli.app, ["evaluate", "train-predictor", closet, *options])
    assert (
        result.exit_code != 0
        and "nothing to learn from" in str(result.exception)
        and not (tmp_path / "models").exists()
    )
    result = CliRunner().invoke(cli.app, ["evaluate", "train-predictor", closet, house, *options])
    assert result.exit_code == 0 and (tmp_path / "models" / FRONTIER_MODEL.name).exists(), result.output


def test_a_forest_by_hand() -> None:
    numbers = [np.array(v, np.int32) for v in ([1, -1, -1], [1, 0, 0], [2, 0, 0], [0])]
    forest = Forest(
        numbers[0], np.array([0.5, -1.0, 2.0], np.float32), numbers[1], numbers[2], numbers[3], 0.25
    )
    assert forest.score(np.array([[9.0, 0.5], [0.0, 0.6]], np.float32)).tolist() == [-0.75, 2.25]


def test_the_models_that_ship_are_small() -> None:
    models = [path for pattern in ("*.json", "*.safetensors") for path in FOLDER.glob(pattern)]
    assert {ROOM_NETWORK, FRONTIER_NETWORK} <= set(models) and sum(
        path.stat().st_size for path in models
    ) < 3_000_000


def test_the_networks_have_a_say() -> None:
    plan = load_plan("office-04")
    decision = Simulation(plan, SimulationConfig(sensor="indoor")).reset(seed=1)
    with_it, without = (make_room_predictor(name) for name in ("layout", "layout:network=off"))
    assert (with_it.rooms(decision).room_ids != without.rooms(decision).room_ids).any()


def test_networks_are_asked_where_trees_are_in_doubt(monkeypatch: pytest.MonkeyPatch) -> None:
    """Networks that are sure that all is closed change those frontiers and no others."""
    asked: list[int] = []

    def sure(_network: FrontierNetwork, windows: NDArray[np.uint8]) -> NDArray[np.float32]:
        asked.append(len(windows))
        return np.full((len(windows), 3), 30.0, np.float32)

    monkeypatch.setattr(FrontierNetwork, "judge", sure)
    total = 0
    for seed in range(6):
        decision = Simulation(load_plan("office-04"), SimulationConfig(sensor="indoor")).reset(seed=seed)
        judged, trees = (
            make_predictor(name).predict(decision).table for name in ("layout", "layout:network=off")
        )
        differ = (np.array(judged) != np.array(trees)).any(axis=0)
        total += len(differ)
        assert np.count_nonzero(differ) == asked[-1] and (judged.closed[differ] == 1).all()
    assert len(asked) == 6 and 0 < sum(asked) < total / 2


@pytest.mark.parametrize(
    "name", ["layout-nearest", "layout-tour", "layout-gain", "closed-first", "open-first"]
)
def test_layout_strategies_finish_with_predicted_rooms(name: str) -> None:
    plan = floorplan_from_ascii(PLAN, resolution=0.9)
    agent = make_agent(name)
    agent.reset(0)
    simulation = Simulation(plan, SimulationConfig(sensor="indoor"), make_predictor("layout"))
    decision = simulation.reset(seed=1)
    while not simulation.done:
        decision = simulation.step(agent.act(decision))
    assert simulation.stop_reason == "coverage"


def test_an_early_stop_saves_metres() -> None:
    plan = floorplan_from_ascii(PLAN, resolution=0.9)
    runs = []
    for spec in ("layout-tour", "layout-tour:stop_area=4"):
        agent = make_agent(f"{spec}{',' if ':' in spec else ':'}predictor=oracle")
        simulation = Simulation(
            plan, SimulationConfig(sensor="indoor", coverage_goal=1.0), make_predictor("oracle")
        )
        decision = simulation.reset(seed=1)
        while not simulation.done:
            decision = simulation.step(agent.act(decision))
        runs.append((simulation.distance, simulation.coverage, simulation.stop_reason))
    assert runs[1][0] < runs[0][0] and runs[1][1] > 0.8 and runs[1][2] == "agent"
    assert make_agent("layout-tour").act(decision) == STOP or decision.frontiers


@pytest.mark.parametrize(
    ("confidence", "asked", "stops"),
    [(0.95, ",stop_sure=0.9", True), (0.8, ",stop_sure=0.9", False), (0.75, "", True), (0.65, "", False)],
)
def test_who_doubts_that_all_is_closed_does_not_stop(confidence: float, asked: str, stops: bool) -> None:
    simulation = Simulation(
        floorplan_from_ascii(PLAN, resolution=0.9), SimulationConfig(sensor="indoor"), make_predictor("none")
    )
    decision = simulation.reset(seed=1)
    judged = tuple(
        dataclasses.replace(f, is_closed=True, expected_area=0.5, confidence=confidence)
        for f in decision.frontiers
    )
    judged_so, known = dataclasses.replace(decision, frontiers=judged), decision.grid.free_area
    agent = make_agent(f"layout-nearest:stop_area=1,stop_known={known}{asked}")
    assert (agent.act(judged_so) == STOP) == stops
    for doubt in ("stop_sure=0.99", f"stop_known={known + 0.01}"):
        assert judged and make_agent(f"layout-nearest:stop_area=1,{doubt}").act(judged_so) != STOP


def test_nobody_stops_in_the_first_room_unless_nothing_is_left() -> None:
    simulation = Simulation(
        floorplan_from_ascii(PLAN, resolution=0.5), SimulationConfig(sensor="indoor"), make_predictor("none")
    )
    decision = simulation.reset(seed=1)
    done = tuple(
        dataclasses.replace(f, is_closed=True, expected_area=0.0, confidence=1.0) for f in decision.frontiers
    )
    agent = make_agent("layout-tour:stop_area=4")
    assert 0 < decision.grid.free_area < 60
    assert done and agent.act(dataclasses.replace(decision, frontiers=done)) != STOP
    assert agent.act(dataclasses.replace(decision, frontiers=())) == STOP
