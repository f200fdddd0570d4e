"""What happens while stable-baselines3 learns: progress, curves, and stopping when asked."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from stable_baselines3.common.callbacks import BaseCallback

from layoutexplore.agents.rl.maskable_policy import FrontierPolicy

CURVES = ("coverage", "distance", "d95_share")
"""Entries of `info["episode"]` that become curves."""


class TrainingCallback(BaseCallback):
    """Called by stable-baselines3 at every step.

    Args:
        advance: Told the steps done.
        stop: Asked whether to stop.
        critic_steps: Steps at the start from which only the critic learns.

    Attributes:
        learnt: Steps that have been learnt from; those of an unfinished rollout are not among them.
        interrupted: Whether learning was stopped within a rollout.
    """

    def __init__(self, advance: Callable[[int], None], stop: Callable[[], bool], critic_steps: int) -> None:
        super().__init__()
        self._advance, self._stop = advance, stop
        self._critic_steps = critic_steps
        self.learnt = 0
        self.interrupted = False

    def _on_training_start(self) -> None:
        self.learnt = self.model.num_timesteps

    def _on_rollout_start(self) -> None:
        self.learnt = self.model.num_timesteps

    def _on_step(self) -> bool:
        self._advance(self.num_timesteps)
        self.interrupted = self._stop()
        return not self.interrupted

    def _on_rollout_end(self) -> None:
        if isinstance(self.model.policy, FrontierPolicy):
            self.model.policy.actor_waits = self.num_timesteps <= self._critic_steps
        episodes = self.model.ep_info_buffer or ()
        for name in CURVES:
            values = [e[name] for e in episodes if np.isfinite(e[name])]
            if values:
                self.logger.record(f"exploration/{name}", float(np.mean(values)))
