"""Training runs: one folder each, with the configuration, a checkpoint, the policies, the evaluations and the curves.

A run is cut into stretches that end with a checkpoint. Every stretch begins with new episodes, seeded by the run's seed and the
steps done, so that a run that is resumed at a checkpoint goes on as the one that was never stopped.
"""

from __future__ import annotations

import csv
import platform
import shlex
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from types import FrameType
from typing import Any, Protocol

import numpy as np
import torch
from sb3_contrib import MaskablePPO
from stable_baselines3 import DQN, PPO
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.logger import configure
from stable_baselines3.common.utils import get_device

from layoutexplore.agents.rl.agent import PolicyAgent
from layoutexplore.agents.rl.callback import TrainingCallback
from layoutexplore.agents.rl.card import PolicySpec, spec_of
from layoutexplore.agents.rl.checkpoint import FILE, Progress, load_checkpoint, save_checkpoint
from layoutexplore.agents.rl.environments import make_envs
from layoutexplore.agents.rl.evaluation import Evaluation, evaluate_motion, score
from layoutexplore.agents.rl.hyperparameters import TrainingConfig
from layoutexplore.agents.rl.imitation import imitate
from layoutexplore.agents.rl.network import Actor
from layoutexplore.agents.rl.policy import FrontierPolicy
from layoutexplore.agents.rl.policy_file import save_policy
from layoutexplore.benchmark.store import atomic, to_toml
from layoutexplore.errors import ConfigError, ResultsError

ALGORITHMS: dict[str, type[BaseAlgorithm]] = {"maskable-ppo": MaskablePPO, "ppo": PPO, "dqn": DQN}

CONFIG = "config.toml"


class Watcher(Protocol):
    """Who is told how a run goes."""

    def say(self, text: str) -> None:
        """A line."""

    def advance(self, steps: int, total: int) -> None:
        """Steps done of all."""


class Run:
    """One training run in its folder.

    Args:
        config: What to train.
        folder: Where; it must not hold a run yet unless this one goes on with it.
        device: "auto", "cpu" or "cuda".
        resume: Go on from the checkpoint of the folder.
        watcher: Told how it goes.

    Attributes:
        progress: How far it is.

    Raises:
        ResultsError: The folder holds a run already, or, to go on, no checkpoint that fits.
        ConfigError: There is no such device.
    """

    def __init__(self, config: TrainingConfig, folder: Path, *, device: str, resume: bool, watcher: Watcher) -> None:
        if (folder / FILE).exists() and not resume:
            raise ResultsError(f"{folder} holds a training run: add --resume to go on with it, or give another --out")
        if device == "cuda" and not torch.cuda.is_available():
            raise ConfigError("there is no CUDA device here: use --device cpu or auto")
        self.config, self.folder, self.watcher = config, folder, watcher
        self.spec = spec_of(config) if config.chooses_frontiers else None
        self.envs = make_envs(config)
        self.model = build(config, self.envs, self.spec, device)
        self._evaluation = Evaluation(config) if self.spec else None
        self.progress = load_checkpoint(folder, self.model) if resume else Progress(type(self.model).__name__)
        self.stopping = False
        if not resume:
            folder.mkdir(parents=True, exist_ok=True)
            with atomic(folder / CONFIG) as path:
                path.write_text(to_toml(config.as_table()))

    def train(self) -> None:
        """Train until all steps are done or somebody asks to stop; either way a checkpoint is left."""
        with self._stop_on_signal():
            if self.progress.steps == 0 and not self.progress.evaluations:
                self._begin()
            self.model.set_logger(configure(str(self.folder / "tensorboard"), ["tensorboard"]))
            while self.progress.steps < self.config.steps and not self.stopping:
                self._stretch()
        self.envs.close()

    def _begin(self) -> None:
        """Imitation, if any, and how good the policy is before it learns by reward."""
        if self.spec and self.config.imitation and self.config.imitation.teacher:
            actor = self._actor()
            imitate(actor, self.config, self.watcher.say, lambda: self.stopping)
            if not self.stopping:
                self._policy.actor.load_state_dict(actor.state_dict())
                self._policy.averaged.load_state_dict(actor.state_dict())
        self._save()
        self._evaluate()

    def _stretch(self) -> None:
        """Learn until the next checkpoint."""
        config, progress = self.config, self.progress
        began = time.monotonic()
        target = min(config.steps, (progress.steps // config.checkpoint_every + 1) * config.checkpoint_every)
        self.model.set_random_seed(int(np.random.SeedSequence([config.seed, progress.steps]).generate_state(1)[0] >> 1))
        self.model._last_obs = None
        advance = partial(self.watcher.advance, total=config.steps)
        callback = TrainingCallback(advance, lambda: self.stopping, config.critic_steps, config.averaging)
        self.model.learn(target - progress.steps, callback, reset_num_timesteps=False)
        if callback.interrupted:
            self.model.num_timesteps = callback.learnt
        before, progress.steps = progress.steps, self.model.num_timesteps
        progress.updates = int(getattr(self.model, "_n_updates", 0))
        progress.calls = int(getattr(self.model, "_n_calls", 0))
        progress.seconds += time.monotonic() - began
        self._save()
        every = config.evaluation.every
        if progress.steps // every > before // every or progress.steps >= config.steps:
            self._evaluate()

    def _evaluate(self) -> None:
        """Explore the cells of the evaluation; keep the policy if it is the best so far."""
        names = self.config.evaluation.references if self.spec else ()
        if self._evaluation:
            assert self.spec is not None
            scores = self._evaluation.compare(PolicyAgent("policy", self._actor(), self.spec), lambda: self.stopping)
        else:
            scores = evaluate_motion(self.model, self.config, lambda: self.stopping)
        if not scores:
            return
        now = score(scores, names)
        best = min((e["score"] for e in self.progress.evaluations), default=np.inf)
        self.progress.evaluations.append({"steps": self.progress.steps, "score": now, **scores})
        if now < best:
            save_policy(self.folder / "best.safetensors", self._weights(), self._card())
        self._write_evaluations()
        self._save()
        self.watcher.say(f"{self.progress.steps} steps: " + ", ".join(f"{name} {value:.3f}" for name, value in scores.items()))

    def _save(self) -> None:
        save_checkpoint(self.folder, self.model, self.progress)
        save_policy(self.folder / "policy.safetensors", self._weights(), self._card())

    @property
    def _policy(self) -> FrontierPolicy:
        assert isinstance(self.model.policy, FrontierPolicy)
        return self.model.policy

    def _actor(self) -> Actor:
        """A copy of the policy's averaged actor on the CPU."""
        assert self.spec is not None
        actor = Actor(self.spec)
        actor.load_state_dict({name: tensor.cpu() for name, tensor in self._policy.averaged.state_dict().items()})
        return actor.eval()

    def _weights(self) -> dict[str, torch.Tensor]:
        return dict((self._policy.averaged if self.spec else self.model.policy).state_dict())

    def _card(self) -> dict[str, Any]:
        """What there is to say of the policy as it is now."""
        return {
            "policy": self.spec.as_table() if self.spec else None,
            "results": self.progress.evaluations[-1] if self.progress.evaluations else None,
            "training": {
                "steps_done": self.progress.steps,
                "minutes": round(self.progress.seconds / 60, 1),
                "command": shlex.join([Path(sys.argv[0]).name, *sys.argv[1:]]),
                "hardware": f"{platform.machine()}, {self.model.device.type}, {torch.get_num_threads()} threads",
                "torch": torch.__version__,
                "config": self.config.as_table(),
            },
        }

    def _write_evaluations(self) -> None:
        """All evaluations as a table, and the last one for TensorBoard."""
        rows = self.progress.evaluations
        with atomic(self.folder / "evaluations.csv") as path, path.open("w", newline="") as file:
            writer = csv.DictWriter(file, list(rows[-1]))
            writer.writeheader()
            writer.writerows({key: row.get(key, "") for key in rows[-1]} for row in rows)
        logger = configure(str(self.folder / "tensorboard"), ["tensorboard"])
        for name, value in rows[-1].items():
            if name != "steps":
                logger.record(f"exploration/{name}", value)
        logger.dump(self.progress.steps)
        logger.close()

    @contextmanager
    def _stop_on_signal(self) -> Iterator[None]:
        """The first Ctrl-C asks to stop after this step; a second one stops at once."""

        def ask(number: int, frame: FrameType | None) -> None:
            if self.stopping:
                raise KeyboardInterrupt
            self.stopping = True
            self.watcher.say("stopping: the checkpoint is being written (once more: stop at once)")

        try:
            previous = {number: signal.signal(number, ask) for number in (signal.SIGINT, signal.SIGTERM)}
        except ValueError:  # not the main thread: nobody presses keys here
            previous = {}
        try:
            yield
        finally:
            for number, handler in previous.items():
                signal.signal(number, handler)


def build(config: TrainingConfig, envs: Any, spec: PolicySpec | None, device: str) -> BaseAlgorithm:
    """The algorithm of a configuration.

    Schedules hang on the steps done, not on those of one call of `learn`.
    """
    arguments: dict[str, Any] = {"policy": "MultiInputPolicy", "policy_kwargs": {}}
    if spec:
        arguments = {"policy": FrontierPolicy, "policy_kwargs": {"spec": spec}}
    learning = dict(config.learning)
    share = learning.get("exploration_fraction", 1.0)
    model: BaseAlgorithm = ALGORITHMS[config.algorithm](
        env=envs, seed=config.seed, device=get_device(device), **arguments, **learning
    )
    if isinstance(model, DQN):
        first, last, until = 1.0, learning["exploration_final_eps"], share * config.steps
        model.exploration_schedule = lambda _: max(last, first + (last - first) * model.num_timesteps / until)
    return model
