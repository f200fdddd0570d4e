"""Masked PPO at the speed of the environments.

It learns what sb3-contrib's `MaskablePPO` learns. What differs is the work: groups of environments do not
wait for each other, not even at the end of a rollout, the critic looks at a rollout once it is complete, the
networks learn from the frontiers that exist, read once for all passes, and they do so while the next rollout
is collected, by the actor of before (as in APPO; see `update` for what that takes).
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from copy import deepcopy
from typing import Any

import torch
from sb3_contrib import MaskablePPO
from stable_baselines3.common.buffers import RolloutBuffer
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.utils import explained_variance, obs_as_tensor
from stable_baselines3.common.vec_env import VecEnv

from layoutexplore.agents.rl.maskable_policy import FrontierPolicy
from layoutexplore.agents.rl.networks.actor_critic import Actor
from layoutexplore.agents.rl.ppo.collector import Collector, Ends
from layoutexplore.agents.rl.ppo.rollout import Rollout, parts_of
from layoutexplore.agents.rl.ppo.update import Learnt, Update
from layoutexplore.agents.rl.vector import VectorAdapter
from layoutexplore.processes import usable_cores


class FrontierPPO(MaskablePPO):
    """`MaskablePPO` for `FrontierPolicy` on a `VectorAdapter`.

    Args:
        averaging: Share of the actor's running average that an update leaves.
        **arguments: Of `MaskablePPO`; the value function's clip range is not used.

    Attributes:
        learning_seconds: How long all updates took, most of it beside the environments.
    """

    policy: FrontierPolicy
    rollout_buffer: Rollout  # type: ignore[assignment]

    def __init__(self, *, averaging: float = 0.0, **arguments: Any) -> None:
        super().__init__(rollout_buffer_class=Rollout, **arguments)
        self.learning_seconds = 0.0
        self._averaging = averaging
        self._collector: Collector | None = None
        self._learner = ThreadPoolExecutor(1, thread_name_prefix="update")
        self._update: Future[Learnt] | None = None

    def learn(self, *arguments: Any, **named: Any) -> FrontierPPO:
        """See `MaskablePPO`; the last update is finished when it returns."""
        assert isinstance(self.env, VectorAdapter)
        self._collector = None
        with _threads(usable_cores() - len(self.env.groups)):
            try:
                super().learn(*arguments, **named)
            finally:
                self._finish_update()
        return self

    def collect_rollouts(
        self,
        env: VecEnv,
        callback: BaseCallback,
        rollout_buffer: RolloutBuffer,
        n_rollout_steps: int,
        use_masking: bool = True,
    ) -> bool:
        """Act in all environments for some steps; False when the callback wants to stop."""
        assert (
            isinstance(env, VectorAdapter)
            and isinstance(self._last_obs, dict)
            and self._last_episode_starts is not None
        )

        def on_decisions(decisions: int) -> bool:
            self.num_timesteps += decisions
            return callback.on_step()

        callback.on_rollout_start()
        if self._collector is None:
            generator = torch.Generator().manual_seed(int(torch.randint(2**62, ())))
            self._collector = Collector(
                env,
                self.rollout_buffer,
                self._next_actor,
                self._last_obs,
                self._last_episode_starts,
                generator,
            )
        size = env.num_envs * n_rollout_steps
        filling = self._collector.collect(
            on_decisions, more=self.num_timesteps + size < self._total_timesteps
        )
        self._finish_update()
        if filling is None:
            return False
        self.rollout_buffer = filling.rollout
        self._last_obs, self._last_episode_starts = filling.seen, filling.starts
        ends = filling.ends
        self._update_info_buffer(list(ends.values()))
        self._judge(ends)
        callback.on_rollout_end()
        return True

    def _next_actor(self, wait: bool) -> Actor | None:
        """The actor as the last update left it; None while that goes on, unless to `wait`."""
        if self._update is not None and not (wait or self._update.done()):
            return None
        self._finish_update()
        return deepcopy(self.policy.actor).requires_grad_(False)

    def _judge(self, ends: Ends) -> None:
        """Values, returns and advantages of the rollout; where one is cut off, what was expected counts."""
        buffer, critic = self.rollout_buffer, self.policy.critic
        with torch.no_grad():
            self._batch = buffer.read(critic.read)
            everybody = torch.arange(len(self._batch.counts), device=self.device)
            values = torch.cat([critic.values(self._batch.take(part)) for part in parts_of(everybody)])
            buffer.values[:] = values.cpu().numpy().reshape(buffer.values.shape)
            for place, info in ends.items():
                if info["TimeLimit.truncated"]:
                    final, _ = self.policy.obs_to_tensor(info["terminal_observation"])
                    buffer.rewards[place] += self.gamma * critic(final).item()
            after = critic(obs_as_tensor(self._last_obs, self.device))  # type: ignore[arg-type]
        assert self._last_episode_starts is not None
        buffer.compute_returns_and_advantage(last_values=after, dones=self._last_episode_starts)
        self.logger.record(
            "train/explained_variance", explained_variance(buffer.values.ravel(), buffer.returns.ravel())
        )

    def train(self) -> None:
        """Begin to learn from the rollout; the next one is collected by the actor as it is now."""
        self._update_learning_rate(self.policy.optimizer)
        update = Update(
            batch_size=self.batch_size or len(self._batch.counts),
            clip_range=self.clip_range(self._current_progress_remaining),  # type: ignore[operator]
            normalize_advantage=self.normalize_advantage,
            ent_coef=self.ent_coef,
            vf_coef=self.vf_coef,
            max_grad_norm=self.max_grad_norm,
            target_kl=self.target_kl,
        )
        training_batch = self.rollout_buffer.training_batch(self._batch)
        orders = [torch.randperm(len(training_batch.actions)).to(self.device) for _ in range(self.n_epochs)]
        self._update = self._learner.submit(update.learn, self.policy, training_batch, orders)

    def _finish_update(self) -> None:
        """Wait for the update that is going on, if any."""
        if self._update is None:
            return
        update, self._update = self._update, None
        learnt = update.result()
        self._n_updates += learnt.passes
        self.learning_seconds += learnt.seconds
        self.policy.average(self._averaging)
        for name, value in learnt.curves.items():
            self.logger.record(f"train/{name}", value)
        self.logger.record("train/n_updates", self._n_updates, exclude="tensorboard")


@contextmanager
def _threads(count: int) -> Iterator[None]:
    """Torch's threads, meanwhile: as many as environments leave cores; waiting ones take what these need."""
    before = torch.get_num_threads()
    torch.set_num_threads(max(1, count))
    try:
        yield
    finally:
        torch.set_num_threads(before)
