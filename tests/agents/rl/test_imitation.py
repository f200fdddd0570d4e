"""Imitation: the policy comes to agree with its teacher."""

from __future__ import annotations

from pathlib import Path

import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("sb3_contrib")
pytest.importorskip("tensorboard")


from layoutexplore.agents.rl.hyperparameters import TrainingConfig  # noqa: E402
from layoutexplore.agents.rl.imitation import imitate  # noqa: E402
from layoutexplore.agents.rl.networks.actor_critic import Actor  # noqa: E402
from layoutexplore.agents.rl.training import Run  # noqa: E402
from layoutexplore.errors import ConfigError  # noqa: E402
from tests.agents.rl.cases import Silent, small_config  # noqa: E402


def train(
    config: TrainingConfig, folder: Path, *, resume: bool = False, watcher: Silent | None = None
) -> Run:
    run = Run(config, folder, device="cpu", resume=resume, watcher=watcher or Silent())
    run.train()
    return run


def test_imitation_comes_to_agree(tmp_path: Path) -> None:
    config = small_config(
        tmp_path,
        imitation={"teacher": "nearest-0.4", "episodes": 4, "rounds": 2, "epochs": 30, "batch_size": 32},
        network={"tour_weight": 0.0, "detour_weight": 0.0},
    )
    assert config.network is not None
    watcher = Silent()
    torch.manual_seed(0)
    run = Run(config, tmp_path / "run", device="cpu", resume=False, watcher=watcher)
    assert run.spec is not None
    imitate(Actor(run.spec), config, watcher.say)
    shares = [float(line.split(", ")[-1].split("%")[0]) for line in watcher.lines]
    assert len(shares) == 2 and shares[-1] > 80


def test_a_teacher_that_knows_the_plan(tmp_path: Path) -> None:
    config = small_config(
        tmp_path, imitation={"teacher": "clairvoyant", "episodes": 1, "rounds": 1, "epochs": 1}
    )
    watcher = Silent()
    run = Run(config, tmp_path / "run", device="cpu", resume=False, watcher=watcher)
    assert run.spec is not None
    imitate(Actor(run.spec), config, watcher.say)
    assert watcher.lines


def test_a_teacher_with_another_predictor(tmp_path: Path) -> None:
    config = small_config(tmp_path, imitation={"teacher": "layout-tour"})
    with pytest.raises(ConfigError, match="needs predictor = 'layout'"):
        train(config, tmp_path / "run")
