"""The policy class for sb3-contrib's MaskablePPO: an actor over frontiers and a critic of its own."""

from __future__ import annotations

from typing import Any

import torch
from gymnasium import spaces
from sb3_contrib.common.maskable.distributions import MaskableDistribution
from sb3_contrib.common.maskable.policies import MaskableActorCriticPolicy
from stable_baselines3.common.type_aliases import PyTorchObs, Schedule
from torch import Tensor

from layoutexplore.agents.rl.card import PolicySpec
from layoutexplore.agents.rl.networks.actor_critic import Actor, Critic


class FrontierPolicy(MaskableActorCriticPolicy):
    """`Actor` and `Critic` as stable-baselines3 wants them.

    Args:
        observation_space: The space of `LayoutExplore/Frontier-v0`.
        action_space: Its actions.
        lr_schedule: Learning rate.
        spec: What the networks read and their shape.
        **kwargs: For the parent class.

    Attributes:
        averaged: A running average of the actor: what is kept and evaluated. Single updates are noisy.
        actor_waits: Only the critic learns: a critic that knows nothing yet would lead the actor astray.
    """

    def __init__(
        self,
        observation_space: spaces.Dict,
        action_space: spaces.Discrete,
        lr_schedule: Schedule,
        *,
        spec: PolicySpec,
        **kwargs: Any,
    ) -> None:
        self._spec = spec
        self.actor_waits = False
        super().__init__(observation_space, action_space, lr_schedule, net_arch=[], **kwargs)

    def _build(self, lr_schedule: Schedule) -> None:
        assert isinstance(self.observation_space, spaces.Dict)
        privileged = self.observation_space.spaces.get("privileged")
        self.actor = Actor(self._spec)
        self.critic = Critic(self._spec, privileged.shape[0] if privileged and privileged.shape else 0)
        learning = [*self.actor.parameters(), *self.critic.parameters()]
        self.optimizer_kwargs.setdefault("fused", True)
        self.averaged = Actor(self._spec)
        self.averaged.load_state_dict(self.actor.state_dict())
        self.averaged.requires_grad_(False)
        make: Any = self.optimizer_class
        self.optimizer = make(learning, lr=lr_schedule(1), **self.optimizer_kwargs)

    def average(self, kept: float) -> None:
        """Move the average towards the actor as it is now; `kept` is the share of the old average."""
        with torch.no_grad():
            for old, new in zip(self.averaged.parameters(), self.actor.parameters(), strict=True):
                old.lerp_(new, 1.0 - kept)

    def forward(
        self, obs: Any, deterministic: bool = False, action_masks: Any = None
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Actions (batch,), values (batch, 1) and log-probabilities (batch,)."""
        distribution = self.get_distribution(obs, action_masks)
        actions = distribution.get_actions(deterministic=deterministic)
        return actions, self.critic(obs), distribution.log_prob(actions)

    def evaluate_actions(
        self, obs: Any, actions: Tensor, action_masks: Any = None
    ) -> tuple[Tensor, Tensor, Tensor | None]:
        """Values (batch, 1), log-probabilities (batch,) and entropies (batch,)."""
        distribution = self.get_distribution(obs, action_masks)
        log_prob, entropy = distribution.log_prob(actions), distribution.entropy()
        if self.actor_waits:
            log_prob, entropy = log_prob.detach(), torch.zeros_like(log_prob)
        return self.critic(obs), log_prob, entropy

    def get_distribution(self, obs: PyTorchObs, action_masks: Any = None) -> MaskableDistribution:
        """The distribution over the actions that are allowed."""
        distribution = self.action_dist.proba_distribution(action_logits=self.actor(obs))
        if action_masks is not None:
            distribution.apply_masking(action_masks)
        return distribution

    def predict_values(self, obs: PyTorchObs) -> Tensor:
        """Values (batch, 1)."""
        return torch.as_tensor(self.critic(obs))
