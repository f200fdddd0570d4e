"""The training runs that the repository keeps can be gone on with, by this version."""

from __future__ import annotations

import dataclasses
import shutil
from pathlib import Path

import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("sb3_contrib")
pytest.importorskip("tensorboard")

from layoutexplore.agents import make_agent  # noqa: E402
from layoutexplore.agents.rl.card import WEIGHTS  # noqa: E402
from layoutexplore.agents.rl.evaluation import read_evaluations  # noqa: E402
from layoutexplore.agents.rl.hyperparameters import read_config  # noqa: E402
from layoutexplore.agents.rl.run import CONFIG, EVALUATIONS  # noqa: E402
from layoutexplore.agents.rl.training import Run  # noqa: E402
from tests.agents.rl.cases import Silent  # noqa: E402

RUNS = sorted(path.parent for path in (WEIGHTS.parent / "runs").glob(f"*/{CONFIG}"))


def test_they_are_found() -> None:
    assert RUNS


@pytest.mark.parametrize("kept", RUNS, ids=lambda folder: folder.name)
def test_a_kept_run_goes_on(kept: Path, tmp_path: Path) -> None:
    files = [path for path in kept.rglob("*") if path.is_file()]
    assert sum(path.stat().st_size for path in files) < 3_000_000
    assert {path.suffix for path in files} <= {".toml", ".csv", ".safetensors", ".md"}
    folder = Path(shutil.copytree(kept, tmp_path / "run"))
    config = read_config(folder / CONFIG)
    run = Run(
        dataclasses.replace(config, envs=1, workers=1), folder, device="cpu", resume=True, watcher=Silent()
    )
    run.envs.close()
    assert run.steps > 0
    assert run.evaluations == read_evaluations(kept / EVALUATIONS, run.steps)
    assert make_agent(f"policy:{folder}").predictor == config.predictor
