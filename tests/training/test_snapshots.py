"""Snapshots of explorations, stored and read again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from layoutexplore.agents import make_agent
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.tracing import floorplan_from_ascii
from layoutexplore.predictors.snapshot import Snapshot
from layoutexplore.training.snapshots import explore_plan
from tests.plans import TWO_OFFICES


@pytest.fixture(scope="module")
def plan() -> FloorPlan:
    return floorplan_from_ascii(TWO_OFFICES, resolution=0.9, name="flat")


@pytest.fixture(scope="module")
def snapshots(plan: FloorPlan) -> list[Snapshot]:
    return explore_plan(plan, make_agent("nearest"), sensor="short", seed=1, coverages=(0.3, 0.5, 0.7))


def test_stored_snapshots_are_the_same(plan: FloorPlan, snapshots: list[Snapshot], tmp_path: Path) -> None:
    for _ in range(2):  # The first writes, the second reads.
        kept = explore_plan(
            plan, make_agent("nearest"), sensor="short", seed=1, coverages=(0.3, 0.5, 0.7), store=tmp_path
        )
        assert [s.coverage for s in kept] == [s.coverage for s in snapshots]
        for a, b in zip(kept, snapshots, strict=True):
            assert np.array_equal(a.decision.grid.cells, b.decision.grid.cells)
            assert a.decision.pose == b.decision.pose
            assert [f.viewpoint for f in a.decision.frontiers] == [f.viewpoint for f in b.decision.frontiers]
            assert [f.visible_area for f in a.decision.frontiers] == [
                f.visible_area for f in b.decision.frontiers
            ]
    assert len(list(tmp_path.iterdir())) == 1


def test_what_another_version_has_stored_is_not_read(
    plan: FloorPlan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for count, version in enumerate(("0.1.9", "0.2.0"), start=1):
        monkeypatch.setattr("layoutexplore.__version__", version)
        explore_plan(plan, make_agent("nearest"), sensor="short", coverages=(0.3,), store=tmp_path)
        assert len(list(tmp_path.iterdir())) == count
