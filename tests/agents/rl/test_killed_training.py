"""A training run that is killed and resumed goes on as the one that nobody killed."""

from __future__ import annotations

import contextlib
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("sb3_contrib")
pytest.importorskip("tensorboard")

import safetensors.torch  # noqa: E402

from layoutexplore.agents.rl import training  # noqa: E402
from layoutexplore.agents.rl.checkpoint import FILE  # noqa: E402
from layoutexplore.agents.rl.hyperparameters import TrainingConfig  # noqa: E402
from tests.agents.rl.cases import Silent, small_config, write_config  # noqa: E402

KILLS = 10


class Killed(BaseException):
    """Ends a run where it stands: nothing is written after it."""


class Deadly(Silent):
    """A watcher under whom the run dies at a step."""

    def __init__(self, step: int) -> None:
        super().__init__()
        self._step = step

    def advance(self, steps: int, total: int) -> None:
        super().advance(steps, total)
        if steps == self._step:
            raise Killed


def train(config: TrainingConfig, folder: Path, watcher: Silent | None = None) -> None:
    """Begin, or go on where there is a checkpoint."""
    resume = (folder / FILE).exists()
    training.Run(config, folder, device="cpu", resume=resume, watcher=watcher or Silent()).train()


def outcome(folder: Path) -> tuple[dict[str, Any], str, dict[str, Any]]:
    """Weights and optimizer, the curve, and the policy that is kept as the best."""
    best = safetensors.torch.load_file(folder / "best.safetensors")
    return safetensors.torch.load_file(folder / FILE), (folder / "evaluations.csv").read_text(), best


def assert_same(found: Path, expected: Path) -> None:
    (state, curve, best), (as_never_killed, whole_curve, its_best) = outcome(found), outcome(expected)
    assert curve == whole_curve and state.keys() == as_never_killed.keys()
    assert all(torch.equal(state[name], as_never_killed[name]) for name in state)
    assert all(torch.equal(best[name], its_best[name]) for name in its_best)


@pytest.fixture(scope="module")
def never_killed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("never-killed")
    train(small_config(folder), folder / "run")
    return folder / "run"


@pytest.mark.parametrize("step", [2, 20, 48])
def test_killed_while_it_learns(step: int, never_killed: Path, tmp_path: Path) -> None:
    config = small_config(tmp_path)
    with pytest.raises(Killed):
        train(config, tmp_path / "run", Deadly(step))
    train(config, tmp_path / "run")
    assert_same(tmp_path / "run", never_killed)


@pytest.mark.parametrize("method", ["evaluate", "_write_evaluations"])
@pytest.mark.parametrize("number", [1, 2, 3])
def test_killed_while_it_evaluates(
    method: str, number: int, never_killed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The evaluations at 0, 32 and 64 steps: the checkpoint has them behind it, the curve does not."""
    config, original, calls = small_config(tmp_path), getattr(training.Run, method), []

    def dies(run: training.Run) -> None:
        calls.append(run.steps)
        if len(calls) == number:
            raise Killed
        original(run)

    with monkeypatch.context() as patch, pytest.raises(Killed):
        patch.setattr(training.Run, method, dies)
        train(config, tmp_path / "run")
    train(config, tmp_path / "run")
    assert_same(tmp_path / "run", never_killed)


@pytest.mark.slow
def test_killed_at_random_moments(never_killed: Path, tmp_path: Path) -> None:
    """A process of its own and SIGKILL, again and again, until it has come to the end."""
    path, folder, rng = write_config(tmp_path / "small.toml"), tmp_path / "run", np.random.default_rng(0)
    command = [sys.executable, "-m", "layoutexplore", "train", "--out", str(folder)]
    began, kills, process = time.monotonic(), 0, None
    while process is None or process.returncode != 0:
        going_on = ["--resume"] if (folder / FILE).exists() else [str(path)]
        process = subprocess.Popen([*command, *going_on], stdout=subprocess.DEVNULL)
        patience = float(rng.uniform(0.0, 8.0)) if kills < KILLS else 300.0
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(patience)
        if process.poll() is None:
            process.kill()
            kills += 1
        process.wait()
        assert time.monotonic() - began < 900
    assert kills > 0
    assert_same(folder, never_killed)
