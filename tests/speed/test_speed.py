"""The speed table: its rows, its verdicts and its command; nothing depends on the machine's speed."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import typer
from scipy.sparse.csgraph import dijkstra
from typer.testing import CliRunner

from layoutexplore import speed
from layoutexplore.agents.rl.hyperparameters import read_config
from layoutexplore.cli.speed import register
from layoutexplore.errors import UnknownNameError
from layoutexplore.grids.grid import Cell
from layoutexplore.planning.shortest_paths import geodesic_distances
from layoutexplore.processes import peak_memory
from layoutexplore.speed import (
    Measurement,
    SpeedRow,
    decisions,
    environment,
    floors,
    kernels,
    measure,
    measurements,
    suite,
)
from layoutexplore.speed.measurement import milliseconds
from layoutexplore.speed.training import throughput_config
from tests.envs.cases import rooms


def row(reached: float | None) -> SpeedRow:
    return SpeedRow(name="walking", ours=1234.5, unit="m/s", goal="> 1", reached=reached)


def use(monkeypatch: pytest.MonkeyPatch, *rows: SpeedRow) -> None:
    def given() -> Iterator[SpeedRow]:
        yield from rows

    monkeypatch.setattr(suite, "measurements", lambda only=(), more=(): [Measurement("walking", given)])


def invoke(*arguments: str) -> tuple[int, str]:
    app = typer.Typer()
    app.command("other")(lambda: None)
    register(app)
    result = CliRunner().invoke(app, ["speed", *arguments], env={"COLUMNS": "120"})
    return result.exit_code, result.output


def test_a_goal_is_missed_below_four_fifths() -> None:
    assert [row(r).missed for r in (None, 1.5, 1.0, 0.8, 0.79)] == [False, False, False, False, True]


@pytest.mark.parametrize(
    ("reached", "status", "word"),
    [(1.2, 0, "met"), (0.85, 0, "nearly"), (0.5, 1, "missed"), (None, 0, "walking")],
)
def test_exit_status_follows_the_goals(
    monkeypatch: pytest.MonkeyPatch, reached: float | None, status: int, word: str
) -> None:
    use(monkeypatch, row(reached))
    code, output = invoke()
    assert code == status and word in output and "1 234 m/s" in output


def test_what_was_measured_is_kept_when_the_rest_fails(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def failing() -> Iterator[SpeedRow]:
        yield row(1.0)
        raise UnknownNameError("no such thing")

    monkeypatch.setattr(suite, "measurements", lambda only=(), more=(): [Measurement("walking", failing)])
    file, picture = tmp_path / "speed.json", tmp_path / "growth.svg"
    code, output = invoke("--json", str(file), "--picture", str(picture))
    assert code == 1 and "1 234 m/s" in output and not picture.exists()
    assert [r["ours"] for r in json.loads(file.read_text())["rows"]] == [1234.5]


@pytest.mark.parametrize("detour", [False, True])
def test_training_is_measured_with_what_ships(detour: bool) -> None:
    shipped = read_config(None, {"algorithm": "maskable-ppo"})
    config = throughput_config("none", detour=detour)
    assert config.learning == shipped.learning and config.network == shipped.network
    assert config.predictor == "none" and config.observation["detour"] is detour
    assert config.generator == {
        **shipped.generator,
        "families": {"office": 1.0},
        "area": [1000.0, 2350.0],
        "seeds": 4,
        "shipped_share": 0.0,
    }


def test_figures_are_written_as_json(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    use(monkeypatch, row(0.5), row(2.0))
    assert invoke("--json", str(tmp_path / "new" / "speed.json"))[0] == 1
    written = json.loads((tmp_path / "new" / "speed.json").read_text())
    assert [r["missed"] for r in written["rows"]] == [True, False]
    assert written["rows"][0]["ours"] == 1234.5 and {"numpy", "numba", "opencv"} <= written["versions"].keys()


def test_measurements_by_name() -> None:
    assert [m.name for m in measurements(["mapping", "rays"])] == ["mapping", "rays"]
    assert len(measurements()) >= 10 and len({m.name for m in measurements()}) == len(measurements())
    with pytest.raises(UnknownNameError, match="did you mean 'frontiers'"):
        measurements(["frontier"])


def test_functions_take_turns() -> None:
    calls: list[str] = []
    times = milliseconds(lambda: calls.append("a"), lambda: calls.append("b"), repeats=2, inner=2)
    assert "".join(calls) == "ab" + "aabb" * 2 and len(times) == 2 and min(times) >= 0


def test_kernel_rows_have_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    # Once each instead of many times: what is tested is that they run and are told apart.
    monkeypatch.setattr(kernels, "milliseconds", lambda *f, **_: milliseconds(*f, repeats=1))
    begun: list[str] = []
    rows = list(measure(["rays", "mapping", "frontiers", "parts", "geodesics"], begin=begun.append))
    assert begun == ["rays", "mapping", "frontiers", "parts", "geodesics"]
    assert len({r.name for r in rows}) == len(rows) == 9
    assert all(r.ours > 0 for r in rows) and all((r.reference is None) == (r.ratio is None) for r in rows)
    assert all(
        r.reached is None or r.reached > 0 for r in rows
    )  # 0 would mean other values than the reference's.


def test_steps_with_maps_are_compared_with_completed_rooms(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[str, int]] = []

    def rate(environment: gymnasium.Env[Any, Any], steps: int) -> float:
        asked.append((environment.unwrapped.observation_config.rooms, steps))
        return 120.0 if asked[-1][0] == "sketched" else 6.0

    monkeypatch.setattr(environment, "_nearest_rate", rate)
    (found,) = environment.map_steps()
    assert [rooms for rooms, _ in asked] == ["sketched", "completed", "sketched"]
    assert found.ours == 120.0 and found.ratio == 20.0 and found.reached == 2.0


def test_the_reference_graph_is_that_of_the_planner() -> None:
    mask = np.random.default_rng(1).random((23, 31)) > 0.3
    graph, index = kernels._graph(mask)
    source = Cell(*(int(v) for v in np.argwhere(mask)[40]))
    assert np.allclose(
        geodesic_distances(mask, source, 1.0)[mask], dijkstra(graph, indices=index[source]), rtol=1e-6
    )


def test_floors_are_always_the_same() -> None:
    occupied = floors.floor(480, 640)
    assert occupied.shape == (480, 640) and 0.1 < (~occupied).mean() < 0.9
    assert floors.poses(occupied, 3) == floors.poses(occupied, 3)
    assert not any(
        occupied[int(p.y / floors.RESOLUTION), int(p.x / floors.RESOLUTION)]
        for p in floors.poses(occupied, 20)
    )
    cells = floors.half_explored(480, 640)
    known = np.count_nonzero(cells == 0) / np.count_nonzero(~occupied)
    assert 0.4 < known < 0.9


def test_the_package_says_what_it_offers() -> None:
    assert speed.measure is measure and speed.SpeedRow is SpeedRow


def test_decisions_are_told_by_quarter(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A row an agent and area, and a picture of them; what is not measured cannot be drawn."""
    times = np.repeat([1.0, 2.0, 3.0, 4.0], 5)
    monkeypatch.setattr(decisions, "decision_times", lambda plan, agent, resolution: times)
    monkeypatch.setattr(decisions, "plan_of", lambda area: area)
    monkeypatch.setattr(decisions, "cost_alone", lambda agent, area: decisions.RunCost(40.0, 800.0))
    everything = list(decisions.decisions())
    rows = [row for row in everything if isinstance(row, decisions.GrowthRow)]
    assert [(row.agent, row.area) for row in rows] == [
        (a, m) for a in decisions.AGENTS for m in decisions.AREAS
    ]
    assert rows[0].quarters == (1000.0, 2000.0, 3000.0, 4000.0) and rows[0].reached == 0.5 and rows[0].missed
    assert rows[0].note == "median 2500.0 ms"
    # The dearest run is followed by what it takes in a process of its own.
    assert everything[-3] is rows[-1] and (rows[-1].agent, rows[-1].area) == decisions.ALONE
    assert [(row.ours, row.unit, row.reached) for row in everything[-2:]] == [
        (40.0, "ms", 1.25),
        (800.0, "MB", 0.5),
    ]
    use(monkeypatch, *rows)
    status, _ = invoke("--picture", str(tmp_path / "growth.svg"), "--json", str(tmp_path / "speed.json"))
    assert status == 1 and "polyline" in (tmp_path / "growth.svg").read_text()
    assert json.loads((tmp_path / "speed.json").read_text())["rows"][0]["quarters"] == [1e3, 2e3, 3e3, 4e3]
    assert invoke("--only", "rays", "--picture", str(tmp_path / "none.svg"))[0] != 0


def test_times_of_decisions_are_those_of_a_whole_run() -> None:
    times = decisions.decision_times(rooms(), "nearest", 0.1)
    assert len(times) > 2 and (times >= 0.0).all() and times.sum() > 0.0


def test_what_a_run_takes_is_measured_in_a_process_of_its_own() -> None:
    """Its imports count; what this process holds does not, however much that is."""
    held = np.ones(1 << 29, np.uint8)
    cost = decisions.cost_alone("nearest", 120.0)
    assert 0.0 < cost.decision < 1e4
    assert 50.0 < cost.memory < held.nbytes / 1e6 < peak_memory() / 1e6
