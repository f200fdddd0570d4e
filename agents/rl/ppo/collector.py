"""Acting in many environments at once, whose groups do not wait for each other, to fill rollouts."""

from __future__ import annotations

import copy
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

Seen = dict[str, NDArray[Any]]
"""The observations of all environments, by name (envs, ...)."""


class Filling:
    """A rollout that is being filled.

    Args:
        actor: Who acts in it.
        rollout: What is filled.
        gumbel: float32 (steps, envs, actions), the random numbers of all its steps, so that it does not
            matter which group is quicker.
        groups: Half-open ranges of environments.
        seen: What the environments show before its first step; a group's rows are read when it begins.
        starts: bool (envs,), which of these begin an episode; read in the same way.

    Attributes:
        seen: What they show now; once it is full, after its last step.
        starts: Which of these begin an episode.
        missing: Groups that have not filled their rows.
        decisions: How many have been made.
        ends: The episodes that ended.
    """

    def __init__(
        self,
        actor: Actor,
        rollout: Rollout,
        gumbel: torch.Tensor,
        groups: list[slice],
        seen: Seen,
        starts: Mask,
    ) -> None:
        self._actor, self.rollout, self._gumbel, self._groups = actor, rollout, gumbel, groups
        self._before: tuple[Seen, Mask] | None = (seen, starts)
        self.seen = {name: np.empty_like(array) for name, array in seen.items()}
        self.starts = np.empty_like(starts)
        self._taken = [0] * len(groups)
        self.missing = len(groups)
        self.decisions = 0
        self._ends: Ends = {}

    @property
    def ends(self) -> Ends:
        """The infos of the episodes that ended, in order."""
        return dict(sorted(self._ends.items()))

    def lacks(self, group: int) -> bool:
        """Whether a group has steps to make."""
        return self._taken[group] < len(self._gumbel)

    def act(self, group: int, env: VectorAdapter) -> None:
        """Send the environments of a group where the actor wants them."""
        step, rows = self._taken[group], self._groups[group]
        if step == 0:
            assert self._before is not None
            for name, array in self._before[0].items():
                self.seen[name][rows] = array[rows]
            self.starts[rows] = self._before[1][rows]
        observation, masks = (
            {name: array[rows] for name, array in self.seen.items()},
            env.action_masks()[rows],
        )
        actions, log_probs = self._actor.draw(observation, masks, self._gumbel[step, rows])
        env.send(actions, group)
        self.rollout.put(step, rows, observation, masks, self.starts[rows])
        self.rollout.put_actions(step, rows, actions, log_probs)

    def note(
        self, group: int, observation: Seen, rewards: Floats32, dones: Mask, infos: list[dict[str, Any]]
    ) -> int:
        """Keep what came of a group's last step; the number of decisions."""
        step, rows = self._taken[group], self._groups[group]
        self.rollout.rewards[step, rows] = rewards
        self._ends |= {(step, rows.start + k): infos[k] for k in np.flatnonzero(dones).tolist()}
        self.starts[rows] = dones
        for name, array in observation.items():
            self.seen[name][rows] = array
        self._taken[group] += 1
        self.decisions += len(dones)
        if not self.lacks(group):
            self.missing -= 1
            if not self.missing:
                self._before = None
        return len(dones)


class Collector:
    """Fills one rollout after the other.

    A group of environments that has filled its rows of a rollout goes on with the next one as soon as there
    is an actor for it, and does not wait for the others: in large buildings a decision takes several times as
    long as in small ones. All rollouts are what they would be if it waited.

    Args:
        env: Where.
        template: A rollout like those that are filled.
        next_actor: The actor of the next rollout; None where it is not ready and need not be waited for.
        seen: The observations of all environments now.
        starts: bool (envs,), which of these begin an episode.
        generator: Where the random numbers come from.
    """

    def __init__(
        self,
        env: VectorAdapter,
        template: Rollout,
        next_actor: Callable[[bool], Actor | None],
        seen: Seen,
        starts: Mask,
        generator: torch.Generator,
    ) -> None:
        self._env, self._template, self._next_actor, self._generator = env, template, next_actor, generator
        self._groups = [slice(*group) for group in env.groups]
        self._busy: dict[int, Filling] = {}
        self._ahead: Filling | None = None
        self._begin(seen, starts, wait=True)

    def collect(self, on_decisions: Callable[[int], bool], *, more: bool) -> Filling | None:
        """Act until the next rollout is full; None when stopped before.

        Args:
            on_decisions: Called with how many decisions came in; says whether to go on.
            more: Whether another rollout follows, which groups may begin meanwhile.
        """
        filling, self._ahead = self._ahead, None
        assert filling is not None
        going = on_decisions(filling.decisions) if filling.decisions else True
        while going and filling.missing:
            self._send(filling, more)
            group, outcome = self._env.receive()
            owner = self._busy.pop(group)
            decisions = owner.note(group, *outcome)
            if owner is filling:
                going = on_decisions(decisions)
        if not going:
            while self._busy:
                del self._busy[self._env.receive()[0]]
            return None
        if more and self._ahead is None:
            self._begin(filling.seen, filling.starts, wait=True)
        return filling

    def _send(self, filling: Filling, more: bool) -> None:
        """Let every group act that waits and has something to do."""
        for group in range(len(self._groups)):
            if group in self._busy:
                continue
            if not filling.lacks(group) and more and self._ahead is None:
                self._begin(filling.seen, filling.starts, wait=False)
            for rollout in (filling, self._ahead):
                if rollout is not None and rollout.lacks(group):
                    self._busy[group] = rollout
                    rollout.act(group, self._env)
                    break

    def _begin(self, seen: Seen, starts: Mask, *, wait: bool) -> None:
        """Begin the next rollout, if there is an actor for it."""
        if (actor := self._next_actor(wait)) is None:
            return
        rollout = copy.copy(self._template)
        rollout.reset()
        gumbel = torch.empty((rollout.buffer_size, *self._env.action_masks().shape))
        gumbel.exponential_(generator=self._generator).log_().neg_()
        self._ahead = Filling(actor, rollout, gumbel, self._groups, seen, starts)
