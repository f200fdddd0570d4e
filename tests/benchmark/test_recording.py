"""Recordings of runs: the map at any scan, frontiers and choices, and runs that do not notice."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from layoutexplore.agents.base import make_agent
from layoutexplore.benchmark.config import BenchmarkConfig
from layoutexplore.benchmark.recording import (
    Recorder,
    note_changes,
    recording_from_arrays,
    recording_to_arrays,
)
from layoutexplore.benchmark.rows import Row, prepare
from layoutexplore.benchmark.runner import run_benchmark
from layoutexplore.benchmark.store import ResultsFolder
from layoutexplore.errors import ResultsError
from layoutexplore.grids.grid import Pose
from layoutexplore.maps.raster import PlanRaster
from layoutexplore.maps.tracing import floorplan_from_ascii, plan_from_raster
from layoutexplore.predictors import RoomLabels
from layoutexplore.predictors.own_predictor import OwnPredictor
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.episode import play, run_seed, start_pose
from layoutexplore.simulation.robot import OdometryNoise
from layoutexplore.simulation.simulation import Simulation
from tests.plans import HOUSE

NOISY = SimulationConfig(sensor="indoor", odometry_noise=OdometryNoise(translation=0.1, rotation=0.05))


@pytest.mark.parametrize(
    ("config", "agent"),
    [
        (SimulationConfig(), "nearest"),
        (SimulationConfig(sensor="indoor"), "layout-tour"),
        (NOISY, "random"),
        (SimulationConfig(), "clairvoyant"),
    ],
)
def test_a_recording_gives_the_map_after_every_scan(config: SimulationConfig, agent: str) -> None:
    plan = floorplan_from_ascii(HOUSE, resolution=0.6, name="house")
    simulation, chosen = prepare(plan, config, agent)
    recorder = Recorder()
    grids, poses, decisions = [], [], []

    def scan(state: Simulation) -> None:
        grids.append(state.mapper.grid.cells.copy())
        poses.append(state.robot.believed)
        recorder.note_scan(state)

    def step(state: Simulation) -> None:
        if not state.done:
            decisions.append([{tuple(c) for c in f.cells.tolist()} for f in state.decision.frontiers])
        recorder.note_decision(state)

    simulation.on_scan = scan
    episode = play(simulation, chosen, on_step=step)
    assert repr(recorder.end()).startswith(f"Recording(first=int32 {simulation.raster.shape}, occupied=bool")
    assert len(repr(recorder.end())) < 500
    arrays = recording_to_arrays(recorder.end())
    noted = recording_from_arrays(arrays)
    assert len(grids) == len(episode.curve) > 5
    for k, grid in enumerate(grids):
        assert np.array_equal(noted.cells(k + 1), grid)
    assert (len(noted.flips) > 0) == (config is NOISY)
    assert np.allclose(noted.poses, poses, atol=1e-3)
    cols = noted.first.shape[1]
    for k, frontiers in enumerate(decisions):
        numbers = noted.frontiers[noted.shown[k] : noted.shown[k + 1], 0]
        found = [noted.members[noted.clusters[n] : noted.clusters[n + 1]] for n in numbers]
        assert [{divmod(int(c), cols) for c in cells} for cells in found] == frontiers
    assert all((closed != 0) == (agent == "layout-tour") for closed in noted.frontiers[:, 1].tolist())
    assert len(noted.rooms) == len(noted.rooms_at) and (len(noted.rooms) > 0) == (agent == "layout-tour")
    assert np.all(noted.decided[:, 1] >= 0) == (agent != "clairvoyant")


def test_a_map_over_the_limit_says_which(monkeypatch: pytest.MonkeyPatch) -> None:
    plan = floorplan_from_ascii(HOUSE, resolution=0.6, name="house")
    simulation, chosen = prepare(plan, SimulationConfig(), "nearest")
    recorder = Recorder()
    simulation.on_scan = recorder.note_scan
    play(simulation, chosen, on_step=recorder.note_decision)
    arrays = recording_to_arrays(recorder.end())
    monkeypatch.setenv("LAYOUTEXPLORE_LIMITS", "image_pixels=100")
    with pytest.raises(ResultsError, match="the limit image_pixels is 100"):
        recording_from_arrays(arrays)


def test_the_choice_is_the_frontier_that_was_gone_to() -> None:
    class Second:
        name = "second"

        def reset(self, seed: int) -> None: ...

        def act(self, decision: Any) -> int:
            return min(1, len(decision.frontiers) - 1)

    simulation = Simulation(floorplan_from_ascii(HOUSE, resolution=0.6, name="house"))
    recorder = Recorder()
    simulation.on_scan = recorder.note_scan
    play(simulation, Second(), on_step=recorder.note_decision)
    noted = recorder.end()
    counts = np.diff(noted.shown)
    assert noted.decided[:, 1].tolist() == np.minimum(1, counts - 1).tolist() and counts.max() > 1


@pytest.mark.parametrize("number", [7, 40_000])
def test_rooms_are_recorded_with_the_ids_of_the_predictor(number: int) -> None:
    class Numbered:
        def rooms(self, decision: Any) -> Any:
            free = decision.grid.cells == 0
            return RoomLabels(np.where(free, number, 0), free)

    plan = floorplan_from_ascii(HOUSE, resolution=0.6, name="house")
    simulation, recorder = Simulation(plan, predictor=OwnPredictor("numbered", Numbered())), Recorder()
    simulation.on_scan = recorder.note_scan
    play(simulation, make_agent("layout-tour"), on_step=recorder.note_decision)
    noted = recording_from_arrays(recording_to_arrays(recorder.end()))
    assert len(noted.rooms) > 0 and set(np.unique(noted.rooms)) == {0, number}


def test_places_in_the_coordinates_of_a_country_are_kept_to_a_millimetre(tmp_path: Path) -> None:
    near = floorplan_from_ascii(HOUSE, resolution=0.6).rasterize(0.1)
    far = PlanRaster(near.occupied, near.room_ids, 0.1, Pose(4.56e5, 5.654e6))
    simulation, agent = prepare(plan_from_raster(far, name="far"), SimulationConfig(), "nearest")
    recorder, believed = Recorder(), []

    def scan(state: Simulation) -> None:
        recorder.note_scan(state)
        believed.append(state.robot.believed)

    simulation.on_scan = scan
    episode = play(simulation, agent, on_step=recorder.note_decision)
    folder, row = ResultsFolder(tmp_path), Row(plan="far", start=0, sensor="stage", agent="nearest", seed=0)
    folder.save_episode(row, episode, recorder.end())
    kept = folder.recording(row)
    assert kept is not None and np.abs(kept.poses - np.array(believed)).max() < 1e-3
    assert np.abs(folder.episode(row)[1] - episode.track).max() < 1e-3


def test_runs_do_not_notice(config: BenchmarkConfig, tmp_path: Path) -> None:
    config = dataclasses.replace(config, agents=("layout-tour", "nearest"), sensors=("stage",), starts=1)
    outcome = run_benchmark(config, tmp_path / "out")
    for row in outcome.rows:
        plan = next(p["source"] for n, p in outcome.folder.manifest()["plans"].items() if n == row.plan)
        simulation, agent = prepare(plan, config.simulation_with(row.sensor), row.agent)
        track = outcome.folder.episode(row)[1]
        episode = play(
            simulation,
            agent,
            seed=run_seed(config.seed, row.plan, row.start),
            start=start_pose(simulation.plan, simulation.config, config.seed, row.start),
        )
        assert np.array_equal(episode.curve.astype(np.float32), outcome.folder.episode(row)[0])
        assert np.array_equal(episode.track.astype(np.float32), track)
        recording = outcome.folder.recording(row)
        assert recording is not None and np.array_equal(
            recording.cells(row.scans), simulation.mapper.grid.cells
        )


def test_folders_of_earlier_versions_have_no_recordings(config: BenchmarkConfig, tmp_path: Path) -> None:
    outcome = run_benchmark(dataclasses.replace(config, starts=1, sensors=("stage",)), tmp_path / "out")
    path = outcome.folder.curve_path(outcome.rows[0])
    with np.load(path) as data:
        kept = {name: data[name] for name in ("curve", "track")}
    np.savez_compressed(path, **kept)
    assert outcome.folder.recording(outcome.rows[0]) is None
    assert outcome.folder.recording(outcome.rows[1]) is not None


grids = st.lists(st.sampled_from([-1, 0, 100]), min_size=12, max_size=12)


@given(st.lists(grids, min_size=1, max_size=5), st.data())
@settings(max_examples=60, deadline=None)
def test_changes_are_those_of_the_cells_in_the_box(steps: list[list[int]], data: st.DataObject) -> None:
    first, begun = np.zeros((3, 4), np.int32), np.full((3, 4), -1, np.int8)
    before, flipped = np.full((3, 4), -1, np.int8), np.zeros(12, np.int32)
    shadow = before.copy()
    for scan, values in enumerate(steps, 1):
        cells = np.array(values, np.int8).reshape(3, 4)
        cells = np.where((cells < 0) & (before >= 0), before, cells)  # what is known stays known
        r0, c0 = data.draw(st.integers(0, 2)), data.draw(st.integers(0, 3))
        r1, c1 = data.draw(st.integers(r0, 3)), data.draw(st.integers(c0, 4))
        count = note_changes(cells, before, (first, begun), (r0, r1, c0, c1), scan, flipped)
        expected = []
        for row in range(r0, r1):
            for col in range(c0, c1):
                if cells[row, col] != shadow[row, col]:
                    if shadow[row, col] < 0:
                        assert first[row, col] == scan and begun[row, col] == cells[row, col]
                    else:
                        expected.append(4 * row + col)
                    shadow[row, col] = cells[row, col]
        assert flipped[:count].tolist() == expected
        assert np.array_equal(before, shadow)
