"""Acting in many environments at once, whose groups need not wait for each other, to fill a rollout."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from layoutexplore.agents.rl.networks.actor_critic import Actor
from layoutexplore.agents.rl.ppo.rollout import Rollout
from layoutexplore.agents.rl.vector import VectorAdapter
from layoutexplore.grids.arrays import Floats32, Mask

Ends = dict[tuple[int, int], dict[str, Any]]
"""The infos of the episodes that ended, by step and environment."""


class Collector:
    """Fills one rollout.

    The random numbers of all steps are drawn before the first one, so that it does not matter which group is
    quicker.

    Args:
        actor: Who acts.
        env: Where.
        rollout: What is filled.
        seen: The observations of all environments now; they are kept up to date.
        starts: bool (envs,), which of these begin an episode; kept up to date as well.
        on_decisions: Called with how many decisions came in; says whether to go on.
    """

    def __init__(
        self,
        actor: Actor,
        env: VectorAdapter,
        rollout: Rollout,
        seen: dict[str, NDArray[Any]],
        starts: Mask,
        on_decisions: Callable[[int], bool],
    ) -> None:
        self._actor, self._env, self._rollout, self._on_decisions = actor, env, rollout, on_decisions
        self._seen, self._starts, self._masks = seen, starts, env.action_masks()
        self._steps: int = rollout.buffer_size
        self._gumbel = -torch.empty((self._steps, *self._masks.shape)).exponential_().log_()
        self._ends: Ends = {}

    def run(self) -> Ends | None:
        """Act until the rollout is full; None when stopped before."""
        env, going = self._env, True
        taken, busy = [0] * len(env.groups), len(env.groups)
        for group in range(busy):
            self._act(0, group)
        while busy:
            group, outcome = env.receive()
            going = self._on_decisions(self._note(taken[group], group, *outcome)) and going
            taken[group] += 1
            if going and taken[group] < self._steps:
                self._act(taken[group], group)
            else:
                busy -= 1
        return dict(sorted(self._ends.items())) if going else None

    def _act(self, step: int, group: int) -> None:
        """Send the environments of a group where the actor wants them."""
        rows = slice(*self._env.groups[group])
        observation, masks = {name: array[rows] for name, array in self._seen.items()}, self._masks[rows]
        actions, log_probs = self._actor.draw(observation, masks, self._gumbel[step, rows])
        self._env.send(actions, group)
        self._rollout.put(step, rows, observation, masks, self._starts[rows])
        self._rollout.put_actions(step, rows, actions, log_probs)

    def _note(
        self,
        step: int,
        group: int,
        observation: dict[str, NDArray[Any]],
        rewards: Floats32,
        dones: Mask,
        infos: list[dict[str, Any]],
    ) -> int:
        """Keep what came of it; the number of decisions."""
        rows = slice(*self._env.groups[group])
        self._rollout.rewards[step, rows] = rewards
        self._ends |= {(step, rows.start + k): infos[k] for k in np.flatnonzero(dones).tolist()}
        self._starts[rows] = dones
        for name, array in observation.items():
            self._seen[name][rows] = array
        return len(dones)
