"""The learned predictor: forests, and networks where forests are in doubt."""

from __future__ import annotations

import copy
import pickle
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from layoutexplore.errors import ConfigError
from layoutexplore.frontiers.decision import Decision
from layoutexplore.layout.doorways import doorway_regions
from layoutexplore.maps.library import load_plan
from layoutexplore.predictors import make_predictor, make_room_predictor
from layoutexplore.predictors.frontier_model.network import FrontierNetwork
from layoutexplore.predictors.learned import CELL_NETWORK, FOLDER, FRONTIER_NETWORK, agreed, classify
from layoutexplore.simulation.simulation import Simulation, SimulationConfig


def test_the_layout_is_completed_when_somebody_looks(decision: Decision) -> None:
    predictor = make_predictor("layout")
    assert predictor is not None
    judged = predictor.predict(decision)
    labels = judged.rooms.labels
    assert labels.shape == decision.grid.shape and labels.dtype == np.int32
    seen = doorway_regions(decision.grid.cells, decision.grid.resolution)
    assert labels.max() <= seen.count and (labels > 0).sum() >= (seen.labels > 0).sum()
    again = make_predictor("layout")
    assert again is not None
    assert [f.expected_area for f in again.predict(decision).frontiers] == [
        f.expected_area for f in judged.frontiers
    ]


def test_the_models_that_ship_are_small() -> None:
    models = [path for pattern in ("*.json", "*.safetensors") for path in FOLDER.glob(pattern)]
    assert {CELL_NETWORK, FRONTIER_NETWORK} <= set(models) and sum(
        path.stat().st_size for path in models
    ) < 3_000_000


def test_own_models_without_what_completes_maps(tmp_path: Path) -> None:
    for path in FOLDER.glob("*model.json"):
        shutil.copy(path, tmp_path)
    assert make_predictor(f"layout:model={tmp_path}") is not None
    with pytest.raises(ConfigError, match=r"floor\.safetensors: there is no .*train-floor PLANS --out"):
        make_predictor(f"layout:model={tmp_path},ahead=2")


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

    monkeypatch.setattr(FrontierNetwork, "score", sure)
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


def test_numbers_of_models_that_learnt_nothing_become_finite_ones() -> None:
    scores = np.array([[1e4, -1e4, 0.0], [-1e4, 1e4, 0.0], [1e4, 1e4, 1e4]])
    with np.errstate(all="raise", under="ignore"):
        classes, confidence = classify(scores, np.ones(3, np.int32))
        sure = agreed(np.array([0.5, 0.5]), np.array([-1e5, 1e5], np.float32))
    assert np.isfinite(classes.remaining_area).all() and np.isfinite(confidence).all()
    np.testing.assert_allclose(sure, [0.0, 1.0], atol=1e-300)


def test_explorations_in_threads_share_a_predictor() -> None:
    """In a process of its own: kernels that write into each other's arrays end it."""
    code = """
import threading
from layoutexplore import Simulation, SimulationConfig, make_agent
from layoutexplore.predictors import make_predictor
from layoutexplore.simulation.episode import play

def explore(seed, predictor, metres):
    simulation = Simulation("apartment:5", SimulationConfig(sensor="stage", max_distance=30.0), predictor)
    play(simulation, make_agent("layout-tour"), seed=seed)
    metres[seed] = simulation.track.tolist()

shared, alone, together = make_predictor("layout"), {}, {}
for seed in range(4):
    explore(seed, make_predictor("layout"), alone)
threads = [threading.Thread(target=explore, args=(seed, shared, together)) for seed in range(4)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
assert together == alone, (together.keys(), alone.keys())
"""
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert run.returncode == 0, run.stderr[-2000:]


def test_a_copied_predictor_goes_on_as_the_first(decision: Decision) -> None:
    predictor = make_predictor("layout")
    assert predictor is not None
    judged = predictor.predict(decision)
    for again in (copy.deepcopy(predictor), pickle.loads(pickle.dumps(predictor))):
        found = again.predict(decision)
        assert [f.confidence for f in found.frontiers] == [f.confidence for f in judged.frontiers]
