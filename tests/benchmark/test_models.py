"""Results folders know what the agents had learnt when they ran."""

from __future__ import annotations

import dataclasses
import shutil
from pathlib import Path

import pytest

from layoutexplore.benchmark.config import BenchmarkConfig
from layoutexplore.benchmark.rows import fingerprints
from layoutexplore.benchmark.runner import run_benchmark
from layoutexplore.benchmark.store import ResultsFolder
from layoutexplore.errors import ResultsError
from layoutexplore.files import to_toml
from layoutexplore.predictors.learned import CELL_MODEL, FRONTIER_MODEL, FRONTIER_NETWORK

CONFIG = BenchmarkConfig(plans=("apartment-01",), starts=1, sensors=("indoor",))


def test_other_weights_are_noticed(tmp_path: Path) -> None:
    """Results of a predictor are not taken for those of one that has learnt something else since."""
    models, out = tmp_path / "models", tmp_path / "out"
    models.mkdir()
    for path in (FRONTIER_MODEL, CELL_MODEL, FRONTIER_NETWORK):
        shutil.copy(path, models)
    agent = f"layout-tour:predictor=layout:model={models}"
    config = dataclasses.replace(CONFIG, agents=("nearest", agent))
    assert run_benchmark(config, out).ran == 2
    assert run_benchmark(config, out).ran == 0
    assert list(fingerprints(config.agents)) == [agent]
    (models / FRONTIER_NETWORK.name).unlink()
    with pytest.raises(ResultsError, match=r"settings\.models\.layout-tour:.* there, .* now") as caught:
        run_benchmark(config, out)
    assert "--force" in str(caught.value) and "--extend" not in str(caught.value), (
        "nothing can be added to it"
    )
    with pytest.raises(ResultsError, match=r"settings\.models"):
        run_benchmark(config, out, extend=True)
    other = dataclasses.replace(config, agents=("nearest", "layout-tour"))
    assert run_benchmark(other, out, extend=True).ran == 1
    assert set(ResultsFolder(out).manifest()["settings"]["models"]) == {agent, "layout-tour"}


def test_files_that_an_own_agent_is_given_are_noticed(tmp_path: Path) -> None:
    """Weights of a user's own network, by the option that names their file."""
    weights, out = tmp_path / "weights.json", tmp_path / "out"
    (tmp_path / "mine.py").write_text(
        "import json\n"
        "class Mine:\n"
        "    def __init__(self, path: str = '', also: str = 'no file'):\n"
        "        self.turn = json.load(open(path))\n"
        "    def reset(self, seed):\n"
        "        pass\n"
        "    def act(self, decision):\n"
        "        return self.turn % len(decision.frontiers)\n"
    )
    weights.write_text("0")
    config = dataclasses.replace(CONFIG, agents=(f"{tmp_path}/mine.py:Mine:path={weights}",))
    assert run_benchmark(config, out).ran == 1
    assert run_benchmark(config, out).ran == 0
    weights.write_text("1")
    with pytest.raises(ResultsError, match=r"settings\.models\..*mine\.py"):
        run_benchmark(config, out)


def test_models_that_were_not_noted_may_be_others(tmp_path: Path) -> None:
    out = tmp_path / "out"
    config = dataclasses.replace(CONFIG, agents=("nearest", "layout-tour"))
    run_benchmark(config, out)
    manifest = ResultsFolder(out).manifest()
    del manifest["settings"]["models"]
    (out / "run.toml").write_text(to_toml(manifest))
    for extend in (False, True):
        with pytest.raises(ResultsError, match=r"settings\.models\.layout-tour: not noted there"):
            run_benchmark(config, out, extend=extend)
    assert run_benchmark(dataclasses.replace(config, agents=("nearest",)), out, extend=True).ran == 0
