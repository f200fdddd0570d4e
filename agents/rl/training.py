"""Runs of stable-baselines3 in their folders: learning between checkpoints.

A run is cut into stretches that end with a checkpoint. Each begins with new episodes, seeded by the
run's seed and the steps done, so that a run that is resumed at a checkpoint goes on as the one that was never
stopped.
"""

from __future__ import annotations

import dataclasses
import os
import time
from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np
import torch
from stable_baselines3 import DQN, PPO
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.logger import configure

from layoutexplore.agents.rl.callback import TrainingCallback
from layoutexplore.agents.rl.card import PolicySpec, find_policy, read_spec, spec_of
from layoutexplore.agents.rl.checkpoint import FILE, Progress, load_checkpoint, save_checkpoint
from layoutexplore.agents.rl.environments import make_envs
from layoutexplore.agents.rl.evaluation import evaluate_motion
from layoutexplore.agents.rl.hyperparameters import TrainingConfig, read_config
from layoutexplore.agents.rl.imitation import imitate
from layoutexplore.agents.rl.maskable_policy import FrontierPolicy
from layoutexplore.agents.rl.networks.actor_critic import Actor
from layoutexplore.agents.rl.networks.training_state import chosen_device
from layoutexplore.agents.rl.ppo.algorithm import FrontierPPO
from layoutexplore.agents.rl.run import TrainingRun, Watcher
from layoutexplore.agents.rl.torch_policy_files import load_actor
from layoutexplore.envs.curriculum import PlanSampler
from layoutexplore.errors import ConfigError, cause, shortened
from layoutexplore.files.reading import shown_path
from layoutexplore.options import from_table

ALGORITHMS: dict[str, type[BaseAlgorithm]] = {"maskable-ppo": FrontierPPO, "ppo": PPO, "dqn": DQN}


class Run(TrainingRun):
    """A run of stable-baselines3 in its folder. Arguments and errors as for `TrainingRun`.

    Attributes:
        progress: How far it is.

    Raises:
        ConfigError: The policy to start from is not there, or reads other things or is made otherwise.
        ResultsError: To go on, there is no checkpoint that fits; or that policy is damaged.
    """

    def __init__(
        self,
        config: TrainingConfig,
        folder: str | os.PathLike[str],
        *,
        device: str,
        resume: bool,
        watcher: Watcher,
    ) -> None:
        config = config if resume else _taking_over(config)
        super().__init__(config, folder, FILE, device=device, resume=resume, watcher=watcher)
        self._spec = spec_of(config) if config.chooses_frontiers else None
        self.envs = make_envs(config)
        try:
            self.model = build(config, self.envs, self._spec, device)
            self.progress = Progress(type(self.model).__name__)
            if resume:
                self.progress = load_checkpoint(self.folder, self.model)
        except BaseException:
            self.envs.close()
            raise
        self.device = self.model.device
        self.evaluations = self.progress.evaluations
        self.begin_folder()

    @property
    def steps(self) -> int:
        """Steps that the policy has learnt from."""
        return self.progress.steps

    @property
    def seconds(self) -> float:
        """Seconds of training, without evaluations."""
        return self.progress.seconds

    @property
    def spec(self) -> PolicySpec | None:
        """What the policy reads; None where it does not choose frontiers."""
        return self._spec

    def train(self) -> None:
        """Train until all steps are done or somebody asks to stop; either way a checkpoint is left."""
        with self.stop_on_signal():
            progress = self.progress
            # What had begun before checkpoints noted the imitation shows it by its steps or evaluations.
            if not (progress.steps or progress.evaluations or progress.imitated):
                self._begin()
            self.model.set_logger(configure(str(self.folder / "tensorboard"), ["tensorboard"]))
            while not self.stopping:
                if self.evaluation_is_due:
                    self.evaluate()
                elif self.progress.steps < self.config.steps:
                    self._stretch()
                else:
                    break
        self.envs.close()

    def _begin(self) -> None:
        """The policy to start from and imitation, if any: what the policy is before it learns by reward."""
        if self.config.start_from:
            actor, _ = load_actor(find_policy(self.config.start_from))
            actor.soften(self.config.start_temperature)
            self._take(actor)
        if self.spec and self.config.imitation and self.config.imitation.teacher:
            actor = self.actor()
            imitate(actor, self.config, self.watcher.say, lambda: self.stopping)
            if not self.stopping:
                self._take(actor)
                self.progress.imitated = True
        self.save()

    def _take(self, actor: Actor) -> None:
        """Make the policy, and its running average, those of an actor."""
        for mine in (self._policy.actor, self._policy.averaged):
            mine.load_state_dict(actor.state_dict())

    @property
    def _every(self) -> int:
        """Steps from checkpoint to checkpoint, at which plans grow if they do."""
        every = self.config.checkpoint_every
        plans = from_table(PlanSampler, self.config.generator, "[generator]")
        if not (plans.first_area and plans.growth):
            return every
        return max(1, min(every, round(0.1 * plans.growth * self.config.steps)))

    def _stretch(self) -> None:
        """Learn until the next checkpoint."""
        config, progress = self.config, self.progress
        began = time.monotonic()
        target = min(config.steps, (progress.steps // self._every + 1) * self._every)
        self.model.set_random_seed(
            int(np.random.SeedSequence([config.seed, progress.steps]).generate_state(1)[0] >> 1)
        )
        self.model._last_obs = None
        self.envs.set_attr("progress", progress.steps / config.steps)  # The plans may grow with it.
        advance = partial(self.watcher.advance, total=config.steps)
        callback = TrainingCallback(advance, lambda: self.stopping, config.critic_steps)
        self.model.learn(target - progress.steps, callback, reset_num_timesteps=False)
        if callback.interrupted:
            self.model.num_timesteps = callback.learnt
        progress.steps = self.model.num_timesteps
        progress.updates = int(getattr(self.model, "_n_updates", 0))
        progress.calls = int(getattr(self.model, "_n_calls", 0))
        progress.seconds += time.monotonic() - began
        self.save()

    def scores(self) -> dict[str, float]:
        """How good the policy is, by name; empty when somebody asked to stop."""
        return (
            super().scores() if self.spec else evaluate_motion(self.model, self.config, lambda: self.stopping)
        )

    def save(self) -> None:
        """Write the checkpoint and the policy as it is now."""
        save_checkpoint(self.folder, self.model, self.progress)
        super().save()

    @property
    def _policy(self) -> FrontierPolicy:
        assert isinstance(self.model.policy, FrontierPolicy)
        return self.model.policy

    def actor(self) -> Actor:
        """A copy of the policy's averaged actor on the CPU."""
        assert self.spec is not None
        actor = Actor(self.spec)
        actor.load_state_dict({name: tensor.cpu() for name, tensor in self.weights().items()})
        return actor.eval()

    def weights(self) -> Mapping[str, torch.Tensor]:
        """Those of the averaged actor; of a policy that does not choose frontiers, all."""
        return dict((self._policy.averaged if self.spec else self.model.policy).state_dict())


def build(config: TrainingConfig, envs: Any, spec: PolicySpec | None, device: str) -> BaseAlgorithm:
    """The algorithm of a configuration.

    Schedules hang on the steps done, not on those of one call of `learn`. Networks that choose frontiers are
    small, and asked for a few dozen decisions at a time: where nobody says, they stay on the processor.

    Raises:
        ConfigError: What it keeps to learn from does not fit into memory.
    """
    if spec and device == "auto":
        device = "cpu"
    arguments: dict[str, Any] = {"policy": "MultiInputPolicy", "policy_kwargs": {}}
    if spec:
        arguments = {"policy": FrontierPolicy, "policy_kwargs": {"spec": spec}, "averaging": config.averaging}
    learning = dict(config.learning)
    share = learning.get("exploration_fraction", 1.0)
    try:
        model: BaseAlgorithm = ALGORITHMS[config.algorithm](
            env=envs, seed=config.seed, device=chosen_device(device), **arguments, **learning
        )
    except MemoryError as error:
        raise ConfigError(
            f"what is learnt from does not fit into memory: {cause(error)}; make learning.buffer_size, or "
            "envs and learning.n_steps, smaller"
        ) from error
    if isinstance(model, DQN):
        first, last, until = 1.0, learning["exploration_final_eps"], share * config.steps
        model.exploration_schedule = lambda _: max(last, first + (last - first) * model.num_timesteps / until)
    if config.final_learning_rate:
        rate, change = learning["learning_rate"], config.final_learning_rate - learning["learning_rate"]
        model.lr_schedule = lambda _: rate + change * min(1.0, model.num_timesteps / config.steps)
    return model


def _taking_over(config: TrainingConfig) -> TrainingConfig:
    """The configuration with the network and the tour of the policy that it starts from, if any.

    Raises:
        ConfigError: There is no such policy, it reads other things, or another network or tour is asked for.
        ResultsError: It is damaged.
    """
    if not config.start_from:
        return config
    path, usual = find_policy(config.start_from), read_config(flags={"algorithm": config.algorithm})
    theirs = read_spec(path)
    for name in ("network", "tour"):
        if getattr(config, name) not in (getattr(theirs, name), getattr(usual, name)):
            raise ConfigError(
                f"[{name}] is that of the policy to start from, {shown_path(path)}: leave it out"
            )
    taken = dataclasses.replace(config, network=theirs.network, tour=theirs.tour)
    mine = spec_of(taken)
    for name in ("frontier_features", "robot_features", "map_channels"):
        read, offered = getattr(theirs, name), getattr(mine, name)
        if read != offered:
            raise ConfigError(
                f"start_from: {shown_path(path)} reads the {name.replace('_', ' ')} {shortened(read)}, this "
                f"run offers {shortened(offered)}: observation.detour and observation.global_map decide that"
            )
    return taken
