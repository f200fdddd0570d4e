"""The evaluation of half-seen rooms.

The oracle is perfect, seeing alone is nothing, stored snapshots are the same.
"""

from __future__ import annotations

import dataclasses
import json
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from layoutexplore import cli
from layoutexplore.agents import make_agent
from layoutexplore.errors import ConfigError, UnknownNameError, WriteError
from layoutexplore.evaluation.partial_rooms import find_items, score_predictors
from layoutexplore.evaluation.partial_rooms_summary import (
    calibration_error,
    f1,
    matthews,
    summarise_partial_rooms,
    summarise_parts,
)
from layoutexplore.frontiers.decision import Decision
from layoutexplore.grids.arrays import Ints32
from layoutexplore.layout.doorways import doorway_regions
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.geojson import save_plan
from layoutexplore.maps.tracing import floorplan_from_ascii
from layoutexplore.predictors import make_predictor, make_room_predictor
from layoutexplore.predictors.protocol import RoomLabels
from layoutexplore.predictors.snapshot import Snapshot
from layoutexplore.training.snapshots import explore_plan
from tests.plans import TWO_OFFICES


@pytest.fixture(scope="module")
def plan() -> FloorPlan:
    return floorplan_from_ascii(TWO_OFFICES, resolution=0.9, name="flat")


@pytest.fixture(scope="module")
def snapshots(plan: FloorPlan) -> list[Snapshot]:
    return explore_plan(plan, make_agent("nearest"), sensor="short", seed=1, coverages=(0.3, 0.5, 0.7))


def test_oracle_and_none(snapshots: list[Snapshot]) -> None:
    scores = score_predictors(snapshots, [make_room_predictor("oracle"), make_room_predictor("none")])
    assert scores.rooms and scores.frontiers
    for room in scores.rooms:
        if room.predictor == "oracle":
            assert room.iou == room.hidden_iou == 1.0 and room.boundary == 0.0 and room.log_area == 0.0
        else:
            assert (
                room.hidden_iou == 0.0 and room.iou == pytest.approx(room.explored) and room.remaining == 0.0
            )
    summary = summarise_partial_rooms(scores)
    best = summary["oracle"].frontiers[0]
    assert best.leftover_accuracy == 1.0
    assert best.calibration_error == 0.0
    assert best.f1_closed in (0.0, 1.0)
    assert summary["oracle"].rooms[0].rooms == summary["none"].rooms[0].rooms == len(scores.rooms) // 2
    assert summary["oracle"].rooms[0].mae_m2 == 0.0 < summary["none"].rooms[0].mae_m2
    (part,) = summarise_parts(scores, "oracle", {"flat": "all"})
    assert part.hidden_iou == part.leftover_accuracy == 1.0
    assert (part.rooms, part.frontiers) == (len(scores.rooms) // 2, len(scores.frontiers) // 2)


def test_items_are_rooms_in_part_with_a_frontier(snapshots: list[Snapshot]) -> None:
    items = [find_items(snapshot) for snapshot in snapshots]
    assert sum(map(len, items)) >= 2
    for snapshot, found in zip(snapshots, items, strict=True):
        for item in found:
            share = item.seen.sum() / item.mask.sum()
            assert 0.05 <= share <= 0.95 and len(item.frontier) * 0.1 >= 0.5 - 1e-9
            assert (snapshot.truth.raster.room_ids[item.mask] == item.room).all()


def test_measures() -> None:
    a, b = np.array([True, True, False, False]), np.array([True, False, False, False])
    assert matthews(a, a) == pytest.approx(1.0)
    assert matthews(a, ~a) == pytest.approx(-1.0)
    assert matthews(a, a | True) == 0.0
    assert f1(a, b) == pytest.approx(2 / 3)
    assert calibration_error(np.array([0.75, 0.75, 0.75, 0.75]), np.array([True, True, True, False])) == 0.0
    assert calibration_error(np.array([0.95, 0.95]), np.array([True, False])) == pytest.approx(0.45)


def test_command(plan: FloorPlan, tmp_path: Path) -> None:
    path = tmp_path / "flat.geojson"
    save_plan(plan, path)
    found = tmp_path / "found.json"
    arguments = [str(path), "-p", "none", "-p", "layout", "-s", "short", "--json", str(found)]
    result = CliRunner().invoke(cli.app, ["evaluate", "partial-rooms", *arguments])
    assert result.exit_code == 0, result.output
    assert "hidden_iou" in result.output and "leftover_accuracy" in result.output and found.is_file()
    rooms = json.loads(found.read_text())["rooms"]
    result = CliRunner().invoke(cli.app, ["evaluate", "partial-rooms", *arguments, "-s", "short"])
    assert result.exit_code == 0 and json.loads(found.read_text())["rooms"] == rooms


def test_numbers_are_there_before_the_page(
    plan: FloorPlan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A disk that is full of pictures loses no number."""

    def full(*_: object, **__: object) -> None:
        raise WriteError("full")

    monkeypatch.setattr("layoutexplore.report.studies.partial_rooms.write_partial_rooms_report", full)
    path, found = tmp_path / "flat.geojson", tmp_path / "found.json"
    save_plan(plan, path)
    arguments = [str(path), "-p", "none", "-s", "short", "--json", str(found), "--out", str(tmp_path / "out")]
    result = CliRunner().invoke(cli.app, ["evaluate", "partial-rooms", *arguments])
    assert isinstance(result.exception, WriteError) and json.loads(found.read_text())["rooms"]


def test_two_of_ones_own_predictors_with_one_name_are_told_apart(plan: FloorPlan, tmp_path: Path) -> None:
    path, own, found = tmp_path / "flat.geojson", tmp_path / "own.py", tmp_path / "found.json"
    save_plan(plan, path)
    own.write_text(
        "class Mine:\n    name = 'mine'\n    def __init__(self, size: int = 1): ...\n"
        "    def rooms(self, decision):\n        return (decision.grid.cells == 0).astype(int)\n"
    )
    specs = [f"{own}:Mine", f"{own}:Mine:size=2", "layout:network=on", "layout"]
    arguments = [str(path), "-s", "short", "--json", str(found), *(f"--predictor={spec}" for spec in specs)]
    result = CliRunner().invoke(cli.app, ["evaluate", "partial-rooms", *arguments])
    assert result.exit_code == 0, result.output
    rooms = Counter(room["predictor"] for room in json.loads(found.read_text())["rooms"])
    assert list(rooms) == [*specs[:2], "layout"] and len({*rooms.values()}) == 1


def test_predictors_of_one_name_are_refused(snapshots: list[Snapshot]) -> None:
    made = [make_room_predictor("none"), make_room_predictor("none")]
    with pytest.raises(ConfigError, match="one name"):
        score_predictors(snapshots, made)
    twice = score_predictors(snapshots, dict(zip("ab", made, strict=True)))
    assert list(twice.milliseconds) == ["a", "b"]


class SeenRooms:
    """Knows the regions between doorways that are seen, and nothing else."""

    def rooms(self, decision: Decision) -> Ints32:
        return doorway_regions(decision.grid.cells, decision.grid.resolution).labels


def test_predictors_are_given_by_name_and_as_they_are(snapshots: list[Snapshot]) -> None:
    found = score_predictors(snapshots, [SeenRooms(), "oracle", None, make_room_predictor("hull")])
    assert list(found.milliseconds) == ["SeenRooms", "oracle", "none", "hull"]
    same = score_predictors(snapshots, {"a": SeenRooms, "b": make_predictor(SeenRooms())})
    rooms = [[dataclasses.replace(r, predictor="") for r in same.rooms if r.predictor == n] for n in "ab"]
    assert rooms[0] == rooms[1] and all(room.hidden_iou == 0 for room in rooms[0])
    with pytest.raises(UnknownNameError, match="orcale"):
        score_predictors(snapshots, ["orcale"])


class Failing:
    """A predictor that fails when it is asked one thing."""

    name = "mine"

    def __init__(self, at: str) -> None:
        self.at = at

    def predict(self, decision: Decision) -> Decision:
        return decision if self.at == "rooms" else self.fail()

    def rooms(self, decision: Decision) -> RoomLabels:
        return self.fail()

    def fail(self) -> Any:
        raise ZeroDivisionError


@pytest.mark.parametrize("at", ["predict", "rooms"])
def test_a_predictor_that_fails_is_named_with_what_it_was_asked(snapshots: list[Snapshot], at: str) -> None:
    with pytest.raises(ZeroDivisionError) as failed:
        score_predictors(snapshots, {"mine.py:Mine": Failing(at)})
    (note,) = failed.value.__notes__
    first = snapshots[0]
    assert note == (
        f"(predictor 'mine.py:Mine', {100 * first.coverage:.0f} % of {first.plan!r} seen by "
        f"{first.sensor!r}, start {first.seed})"
    )
