"""What training runs share: a folder with configuration, policies and evaluations; stopping when asked."""

from __future__ import annotations

import csv
import os
import platform
import signal
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any, Protocol

import numpy as np
import torch
from stable_baselines3.common.logger import configure

from layoutexplore.agents.rl.agent import NetworkPolicy
from layoutexplore.agents.rl.card import PolicySpec
from layoutexplore.agents.rl.environments import check_plans
from layoutexplore.agents.rl.evaluation import Evaluation, check_what_is_named, score
from layoutexplore.agents.rl.hyperparameters import TrainingConfig
from layoutexplore.agents.rl.networks.actor_critic import Actor
from layoutexplore.agents.rl.networks.training_state import chosen_device
from layoutexplore.agents.rl.torch_policy_files import save_policy
from layoutexplore.errors import ResultsError, WorkerError, checks_making
from layoutexplore.files import atomic, to_toml, write_atomically
from layoutexplore.processes import command_line, more_time

CONFIG = "config.toml"
EVALUATIONS = "evaluations.csv"
POLICY = "policy.safetensors"
"""The policy as it is now: every algorithm writes it, with its checkpoint."""

CHECKPOINT_TIME = 4.5
"""Seconds that the last checkpoint may take once the training was asked to stop.

Where an update takes longer, the checkpoint before stays: `checkpoint_every` says how much that can cost.
"""


class Watcher(Protocol):
    """Who is told how a run goes."""

    def say(self, text: str) -> None:
        """A line."""

    def advance(self, steps: int, total: int) -> None:
        """Steps done of all."""


@checks_making
class TrainingRun:
    """One training run in its folder; a subclass trains.

    Args:
        config: What to train.
        folder: Where; it must not hold a run yet unless this one goes on with it.
        checkpoint: Name of the file from which a run can go on.
        device: "auto", "cpu" or "cuda".
        resume: Go on with the run of the folder.
        watcher: Told how it goes.

    Attributes:
        evaluations: What each evaluation found, oldest first.
        stopping: Somebody asked to stop.
        device: Where the policy learns.

    Raises:
        ResultsError: The folder holds a run already.
        ConfigError: There is no such device.
    """

    def __init__(
        self,
        config: TrainingConfig,
        folder: str | os.PathLike[str],
        checkpoint: str,
        *,
        device: str,
        resume: bool,
        watcher: Watcher,
    ) -> None:
        folder = Path(folder)
        # The policy, too: another algorithm's run has another checkpoint, and would be written over.
        if not resume and any((folder / name).exists() for name in (checkpoint, POLICY)):
            raise ResultsError(
                f"{folder} holds a training run: add --resume to go on with it, or give another --out"
            )
        chosen_device(device)
        check_what_is_named(config)
        check_plans(config)
        self.config, self.folder, self.watcher = config, folder, watcher
        self.device = torch.device("cpu")
        self.evaluations: list[dict[str, float]] = []
        self.stopping = False
        self._evaluation = Evaluation(config) if config.chooses_frontiers else None

    def train(self) -> None:
        """Train until all steps are done or somebody asks to stop."""
        raise NotImplementedError

    @property
    def steps(self) -> int:
        """Steps that the policy has learnt from."""
        raise NotImplementedError

    @property
    def seconds(self) -> float:
        """How long it has learnt."""
        raise NotImplementedError

    @property
    def spec(self) -> PolicySpec | None:
        """What the policy reads as it is now; None where it does not choose frontiers."""
        raise NotImplementedError

    def actor(self) -> Actor:
        """The network that scores frontiers as it is now, on the CPU."""
        raise NotImplementedError

    def weights(self) -> Mapping[str, torch.Tensor]:
        """What is kept of the policy as it is now."""
        return dict(self.actor().state_dict())

    def scores(self) -> dict[str, float]:
        """How good the policy is, by name; empty when somebody asked to stop."""
        assert self.spec is not None and self._evaluation is not None
        agent = NetworkPolicy("policy", self.actor(), self.spec)
        return self._evaluation.compare(agent, lambda: self.stopping)

    def save(self) -> None:
        """Write the policy as it is now."""
        save_policy(self.folder / POLICY, self.weights(), self.card())

    def begin_folder(self) -> None:
        """Make the folder and write the configuration: a run that goes on may have been given more steps."""
        self.folder.mkdir(parents=True, exist_ok=True)
        write_atomically(self.folder / CONFIG, to_toml(self.config.as_table()))

    @property
    def evaluation_is_due(self) -> bool:
        """Whether a mark has been passed since the last evaluation: one that was cut off is made up for."""
        every, steps, last = self.config.evaluation.every, self.steps, self.evaluations[-1:]
        if not last:
            return True
        return steps // every > last[0]["steps"] // every or last[0]["steps"] < steps >= self.config.steps

    def evaluate(self) -> None:
        """Explore the cells of the evaluation; keep the policy if it is the best so far."""
        if not self.evaluations and self._evaluation is not None:
            self.watcher.say(self._evaluation.sentence)
        scores = self.scores()
        if not scores:
            return
        now = score(scores, self.config.evaluation.references if self.spec else ())
        best = min((e["score"] for e in self.evaluations), default=np.inf)
        self.evaluations.append({"steps": self.steps, "score": now, **scores})
        if now < best:
            save_policy(self.folder / "best.safetensors", self.weights(), self.card())
        self._write_evaluations()
        told = ", ".join(f"{name} {value:.3f}" for name, value in scores.items())
        self.watcher.say(f"{self.steps} steps: {told}")
        self.save()

    def card(self) -> dict[str, Any]:
        """What there is to say of the policy as it is now."""
        hardware = f"{platform.machine()}, {self.device.type}, {torch.get_num_threads()} threads"
        return {
            "policy": self.spec.as_table() if self.spec else None,
            "results": self.evaluations[-1] if self.evaluations else None,
            "training": {
                "steps_done": self.steps,
                "minutes": round(self.seconds / 60, 1),
                "command": command_line(),
                "hardware": hardware,
                "torch": torch.__version__,
                "config": self.config.as_table(),
            },
        }

    def _write_evaluations(self) -> None:
        """All evaluations as a table, and the last one for TensorBoard."""
        rows = self.evaluations
        with atomic(self.folder / EVALUATIONS) as path, path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, list(rows[-1]))
            writer.writeheader()
            writer.writerows({key: row.get(key, "") for key in rows[-1]} for row in rows)
        logger = configure(str(self.folder / "tensorboard"), ["tensorboard"])
        for name, value in rows[-1].items():
            if name != "steps":
                logger.record(f"exploration/{name}", value)
        logger.dump(self.steps)
        logger.close()

    @contextmanager
    def stop_on_signal(self) -> Iterator[None]:
        """The first Ctrl-C asks to stop after this step; a second one, or the workers' end, stops at once."""

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
            with more_time(CHECKPOINT_TIME):
                yield
        except WorkerError:
            if not self.stopping:  # a cluster asks all processes of a job to end, the workers, too
                raise
        finally:
            for number, handler in previous.items():
                signal.signal(number, handler)
