"""What runs with a plan known beforehand note of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from layoutexplore.benchmark.config import BenchmarkConfig
from layoutexplore.benchmark.runner import run_benchmark
from layoutexplore.benchmark.store import ResultsFolder
from layoutexplore.drawing.beliefs import SHARES, SUFFIX, BelievedPlan, believed_plan
from layoutexplore.errors import ResultsError
from layoutexplore.maps.geojson import save_plan
from layoutexplore.priors.completion import Compared
from tests.priors.cases import office

AGENT = "plan-tour:predictor=prior:true"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> ResultsFolder:
    place = tmp_path_factory.mktemp("believed")
    save_plan(office(), place / "office.geojson")
    config = BenchmarkConfig(
        plans=(str(place / "office.geojson"),),
        starts=1,
        sensors=("indoor",),
        agents=("nearest", AGENT),
        baseline="nearest",
        explain=False,
    )
    run_benchmark(config, place / "out", jobs=1)
    return ResultsFolder(place / "out")


def believed(folder: ResultsFolder, agent: str) -> BelievedPlan | None:
    (row,) = (row for row in folder.rows() if row.agent == agent)
    return believed_plan(folder.curve_path(row).with_suffix(SUFFIX))


def test_a_run_notes_its_confidence_and_where_the_plan_lay(folder: ResultsFolder) -> None:
    found = believed(folder, AGENT)
    assert found is not None and found.resolution == 0.1
    assert len(found.way) == next(row.decisions for row in folder.rows() if row.agent == AGENT)
    metres, coverage, confidence = found.way.T
    assert (np.diff(metres) >= 0).all() and (np.diff(coverage) >= 0).all()
    assert confidence.min() >= 0 and 0.5 < confidence.max() <= 1
    assert 0 < len(found.at) <= len(SHARES) == 3
    assert (coverage[found.at] >= SHARES[: len(found.at)]).all()
    last = found.maps[-1]
    assert {Compared.FLOOR, Compared.WALL, Compared.FORESEEN_FLOOR} <= set(np.unique(last).tolist())
    # A true plan that lies right contradicts next to nothing that was seen.
    assert (last == Compared.OTHER_FLOOR).sum() < 0.05 * (last == Compared.FLOOR).sum()


def test_others_note_nothing(folder: ResultsFolder) -> None:
    assert believed(folder, "nearest") is None


def test_a_damaged_file_is_named(tmp_path: Path) -> None:
    path = tmp_path / f"run{SUFFIX}"
    path.write_bytes(b"no archive")
    with pytest.raises(ResultsError, match=r"prior\.npz"):
        believed_plan(path)
