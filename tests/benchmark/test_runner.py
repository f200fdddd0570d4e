"""The benchmark: paired runs, a results folder that survives, statistics that are paired."""

from __future__ import annotations

import dataclasses
import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from layoutexplore.benchmark import runner
from layoutexplore.benchmark.analysis import compare
from layoutexplore.benchmark.config import BenchmarkConfig
from layoutexplore.benchmark.rows import prepare
from layoutexplore.benchmark.runner import BenchmarkProgress, BenchmarkWatcher, run_benchmark
from layoutexplore.benchmark.store import ResultsFolder
from layoutexplore.errors import ConfigError, MapError, ResultsError, StartError, UnknownNameError
from layoutexplore.maps.geojson import save_plan
from layoutexplore.maps.tracing import floorplan_from_ascii
from layoutexplore.simulation.config import SimulationConfig
from tests.benchmark.cases import timeless
from tests.plans import FLAT, HOUSE


def test_a_plan_whose_results_could_not_be_read_is_refused_at_once(
    config: BenchmarkConfig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LAYOUTEXPLORE_LIMITS", "image_pixels=1000")
    with pytest.raises(MapError, match=r"cottage\.geojson: \d+ x \d+ cells of .*, 1000: choose a coarser"):
        run_benchmark(config, tmp_path / "out")
    assert not (tmp_path / "out" / "run.toml").exists()


def test_a_run_of_everything(config: BenchmarkConfig, tmp_path: Path) -> None:
    told: list[BenchmarkProgress] = []
    outcome = run_benchmark(config, tmp_path / "out", watcher=BenchmarkWatcher(advance=told.append))
    assert len(outcome.rows) == outcome.ran == 2 * 2 * 2 * 2
    assert not outcome.failed
    assert [p.done for p in told] == list(range(1, 17))
    assert told[-1].work_done == pytest.approx(1.0)
    assert outcome.rows == ResultsFolder(tmp_path / "out").rows()
    for row in outcome.rows:
        assert row.stop_reason == "coverage" and row.reached99 and row.coverage >= 0.99
        assert 0 <= row.d90 <= row.d95 <= row.d99 <= row.distance + 1e-6
        assert 0 < row.auc < 1 and row.rooms == 5 and row.config_hash == config.config_hash
        curve, track = outcome.folder.episode(row)
        assert curve[-1, 0] == pytest.approx(row.distance, abs=1e-3)
        assert np.hypot(*np.diff(track[:, :2], axis=0).T).sum() == pytest.approx(row.distance, rel=1e-3)


def test_a_path_may_be_a_text(plans: Path, tmp_path: Path) -> None:
    config = BenchmarkConfig(plans=(plans / "cottage.geojson",), starts=1, agents=("nearest",))
    assert config.plans == (str(plans / "cottage.geojson"),)
    out = str(tmp_path / "out")
    done = run_benchmark(config, out)
    assert done.folder.path == Path(out) and ResultsFolder(out).rows() == done.rows and not done.failed
    assert run_benchmark(config, tmp_path / "out").ran == 0
    with pytest.raises(ConfigError, match="out must be str"):
        run_benchmark(config, 5)  # type: ignore[arg-type]


def test_every_agent_and_sensor_starts_at_the_same_place(config: BenchmarkConfig, tmp_path: Path) -> None:
    rows = run_benchmark(config, tmp_path / "out").rows
    starts: dict[tuple[str, int], set[tuple[float, float, float]]] = {}
    for row in rows:
        starts.setdefault((row.plan, row.start), set()).add((row.start_x, row.start_y, row.start_theta))
    assert all(len(poses) == 1 for poses in starts.values())
    assert len(set().union(*starts.values())) == 4


def test_own_starts_come_first_and_the_others_are_drawn(config: BenchmarkConfig, tmp_path: Path) -> None:
    drawn = run_benchmark(config, tmp_path / "drawn")
    there = {row.key[:2]: (row.start_x, row.start_y, row.start_theta) for row in drawn.rows}
    pose = there["house", 1]
    own = dataclasses.replace(config, poses={"house": [pose]})
    outcome = run_benchmark(own, tmp_path / "own")
    for row in outcome.rows:
        expected = pose if row.key[:2] == ("house", 0) else there[row.key[:2]]
        assert (row.start_x, row.start_y, row.start_theta) == pytest.approx(expected, abs=1e-5)
    assert run_benchmark(own, tmp_path / "own").ran == 0
    with pytest.raises(ResultsError, match=r"settings\.poses\.house"):
        run_benchmark(config, tmp_path / "own")
    with pytest.raises(StartError, match=r"start 0 of house: the start .* the nearest free place is"):
        run_benchmark(dataclasses.replace(config, poses={"house": [(-50, 0, 0)]}), tmp_path / "wall")
    with pytest.raises(UnknownNameError, match="did you mean 'house'"):
        run_benchmark(dataclasses.replace(config, poses={"hous": [(1, 1, 0)]}), tmp_path / "name")


def test_the_seed_decides_everything_but_time(config: BenchmarkConfig, tmp_path: Path) -> None:
    config = dataclasses.replace(config, sensors=("indoor",))
    here = run_benchmark(config, tmp_path / "a")
    workers = run_benchmark(config, tmp_path / "b", jobs=2)
    other = run_benchmark(dataclasses.replace(config, seed=1), tmp_path / "c")
    assert timeless(here.rows) == timeless(workers.rows)
    for row in here.rows:
        for mine, theirs in zip(here.folder.episode(row), workers.folder.episode(row), strict=True):
            assert np.array_equal(mine, theirs)
    assert {row.start_x for row in here.rows} != {row.start_x for row in other.rows}


def test_a_killed_run_continues(config: BenchmarkConfig, tmp_path: Path) -> None:
    out = tmp_path / "out"
    whole = run_benchmark(config, out)
    lines = whole.folder.table.read_text().splitlines(keepends=True)
    whole.folder.table.write_text("".join(lines[:-3]) + lines[-3][:25])  # killed while a row was written
    whole.folder.curve_path(whole.rows[0]).unlink()
    again = run_benchmark(config, out)
    assert again.ran == 4
    assert timeless(again.rows) == timeless(whole.rows)
    assert run_benchmark(config, out).ran == 0


def test_what_is_cut_off_is_made_again(config: BenchmarkConfig, tmp_path: Path) -> None:
    out = tmp_path / "out"
    whole = run_benchmark(config, out)
    path = whole.folder.curve_path(whole.rows[0])
    path.write_bytes(path.read_bytes()[:200])
    half = path.with_name(f".{path.name}.abcdefgh.part")
    half.write_bytes(b"half")
    with pytest.raises(ResultsError, match="is damaged"):
        whole.folder.episode(whole.rows[0])
    again = run_benchmark(config, out)
    assert again.ran == 1 and timeless(again.rows) == timeless(whole.rows)
    assert not half.exists() and len(again.folder.episode(again.rows[0])[0]) > 1


def test_an_interrupted_run_keeps_what_is_finished(config: BenchmarkConfig, tmp_path: Path) -> None:
    def interrupt(progress: BenchmarkProgress) -> None:
        if progress.done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_benchmark(config, tmp_path / "out", watcher=BenchmarkWatcher(advance=interrupt))
    assert len(ResultsFolder(tmp_path / "out").rows()) == 3
    assert run_benchmark(config, tmp_path / "out").ran == 13


def test_a_failed_run_is_recorded_and_tried_again(
    config: BenchmarkConfig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def breaks(plan: Any, settings: SimulationConfig, agent: str) -> Any:
        if agent == "random":
            raise ZeroDivisionError("division\nby zero")
        return prepare(plan, settings, agent)

    monkeypatch.setattr(runner, "prepare", breaks)
    outcome = run_benchmark(config, tmp_path / "out")
    assert len(outcome.rows) == 16 and len(outcome.failed) == 8
    assert outcome.failed[0].error.startswith("ZeroDivisionError: division by zero (test_runner.py, line")
    assert outcome.failed[0].stop_reason == "error" and math.isnan(outcome.failed[0].d95)
    assert {c.agent for c in compare(outcome.rows, "nearest")} == {"nearest"}
    monkeypatch.undo()
    again = run_benchmark(config, tmp_path / "out")
    assert again.ran == 8 and not again.failed


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"seed": 5}, "settings.seed: 0 there, 5 now"),
        ({"starts": 3}, "starts: 2 there, 3 now"),
        ({"agents": ("nearest",)}, "agents: nearest, random there, nearest now"),
        (
            {"simulation": SimulationConfig(scan_spacing=0.4)},
            "settings.simulation.scan_spacing: 0.5 there, 0.4 now",
        ),
    ],
)
def test_another_configuration_is_refused(
    config: BenchmarkConfig, tmp_path: Path, change: dict[str, Any], said: str
) -> None:
    run_benchmark(config, tmp_path / "out")
    before = (tmp_path / "out" / "results.csv").read_bytes()
    with pytest.raises(ResultsError) as caught:
        run_benchmark(dataclasses.replace(config, **change), tmp_path / "out")
    assert said in str(caught.value) and "--force" in str(caught.value)
    assert ("--extend" in str(caught.value)) == ("settings" not in said)
    assert (tmp_path / "out" / "results.csv").read_bytes() == before


def test_extend_adds_and_force_starts_again(config: BenchmarkConfig, tmp_path: Path) -> None:
    out = tmp_path / "out"
    first = run_benchmark(config, out)
    grown = dataclasses.replace(config, agents=("nearest", "tour"), sensors=("short",), starts=1)
    second = run_benchmark(grown, out, extend=True)
    assert second.ran == 4 and len(second.rows) == 20
    assert set(timeless(first.rows)) <= set(timeless(second.rows))
    manifest = second.folder.manifest()
    assert manifest["agents"] == ["nearest", "random", "tour"] and manifest["starts"] == 2
    assert set(manifest["settings"]["lidars"]) == {"stage", "indoor", "short"}
    with pytest.raises(ResultsError, match=r"settings\.seed"):
        run_benchmark(dataclasses.replace(grown, seed=2), out, extend=True)
    third = run_benchmark(dataclasses.replace(grown, seed=2), out, force=True)
    assert third.ran == len(third.rows) == 4


def test_a_changed_plan_is_noticed(tmp_path: Path) -> None:
    path = tmp_path / "plan.geojson"
    save_plan(floorplan_from_ascii(HOUSE, resolution=0.6, name="plan"), path)
    config = BenchmarkConfig(plans=(str(path),), starts=1, agents=("nearest",))
    run_benchmark(config, tmp_path / "out")
    save_plan(floorplan_from_ascii(FLAT, resolution=0.6, name="plan"), path)
    with pytest.raises(ResultsError, match=r"plans\.plan"):
        run_benchmark(config, tmp_path / "out")


def test_unknown_names_are_told_before_anything_runs(config: BenchmarkConfig, tmp_path: Path) -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'nearest'"):
        run_benchmark(dataclasses.replace(config, agents=("nearst",)), tmp_path / "out")
    with pytest.raises(UnknownNameError, match="did you mean 'indoor'"):
        dataclasses.replace(config, sensors=("indor",))
    with pytest.raises(UnknownNameError, match="did you mean 'layout'"):
        run_benchmark(dataclasses.replace(config, agents=("layout-tour:predictor=layot",)), tmp_path / "out")
    with pytest.raises(UnknownNameError, match="unknown agent 'neighbour'"):
        run_benchmark(dataclasses.replace(config, baseline="neighbour"), tmp_path / "out")
    with pytest.raises(MapError, match="no such"):
        run_benchmark(dataclasses.replace(config, plans=("nowhere/plan.xml",)), tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_two_plans_of_one_name(plans: Path, tmp_path: Path) -> None:
    (tmp_path / "house.geojson").write_bytes((plans / "house.geojson").read_bytes())
    config = BenchmarkConfig(plans=(str(plans), str(tmp_path / "house.geojson")), agents=("nearest",))
    with pytest.raises(ConfigError, match=r"two floor plans are called 'house': .*; name one of them alone"):
        run_benchmark(config, tmp_path / "out")


def test_a_baseline_that_does_not_run_is_told_first(config: BenchmarkConfig, tmp_path: Path) -> None:
    config = dataclasses.replace(config, agents=("random",), sensors=("stage",), starts=1)
    said: list[str] = []
    watcher = BenchmarkWatcher(said.append, lambda progress: said.append("ran"))
    run_benchmark(config, tmp_path / "out", watcher=watcher)
    assert "the baseline nearest is not among the agents" in " ".join(said[: said.index("ran")])
    said.clear()
    run_benchmark(dataclasses.replace(config, baseline="random"), tmp_path / "out", watcher=watcher)
    nearest = dataclasses.replace(config, agents=("nearest",))
    run_benchmark(nearest, tmp_path / "out", extend=True, watcher=watcher)
    run_benchmark(config, tmp_path / "out", extend=True, watcher=watcher)  # its rows are there
    assert "not among the agents" not in " ".join(said)


def test_a_full_disk_ends_the_benchmark_and_leaves_it_whole(config: BenchmarkConfig, tmp_path: Path) -> None:
    whole = run_benchmark(config, tmp_path / "whole")
    code = f"""
import resource, pathlib
from layoutexplore.benchmark.store import ResultsFolder
rows = ResultsFolder(pathlib.Path({str(tmp_path / "whole")!r})).rows()
folder = ResultsFolder(pathlib.Path({str(tmp_path)!r}))
folder.rewrite(rows[:2])
resource.setrlimit(resource.RLIMIT_FSIZE, (folder.table.stat().st_size + 30, -1))
try:
    with folder.appending() as append:
        append(rows[2])
except Exception as error:
    print(type(error).__name__)
"""
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert told.stdout.strip() == "ResultsError"
    assert ResultsFolder(tmp_path).rows() == whole.rows[:2]


def test_a_run_that_takes_too_long_fails_with_the_command_that_repeats_it(
    config: BenchmarkConfig, tmp_path: Path
) -> None:
    config = dataclasses.replace(config, starts=1, sensors=("stage",), agents=("nearest",), cell_seconds=1e-4)
    outcome = run_benchmark(config, tmp_path / "out")
    assert len(outcome.failed) == 2 and all("longer than" in row.error for row in outcome.failed)
    told = [path.read_text() for path in (tmp_path / "out").rglob("*") if path.suffix in (".txt", ".log")]
    assert sum("layoutexplore explore" in text for text in told) == 2
    again = run_benchmark(dataclasses.replace(config, cell_seconds=0.0), tmp_path / "out")
    assert again.ran == 2 and not again.failed
