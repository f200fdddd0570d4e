"""The losses of masked PPO (Schulman et al. 2017; Huang and Ontañón 2022): what actor and critic learn by.

The rollout may come from an older actor than the one that learns. The ratio is then clipped around the actor
that the update starts from, and each decision is weighed by how much more or less likely that one would have
taken it (decoupled objective, Hilton, Cobbe and Schulman 2022).
"""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from layoutexplore.agents.rl.maskable_policy import FrontierPolicy
from layoutexplore.agents.rl.ppo.rollout import TrainingBatch, parts_of

_HEAVIEST = 2.0
"""The most that a decision counts."""


class Learnt(NamedTuple):
    """What came of an update.

    Attributes:
        curves: Means over the minibatches, by name.
        passes: How often the rollout was learnt from.
        seconds: How long it took.
    """

    curves: dict[str, float]
    passes: int
    seconds: float


@dataclass(frozen=True, kw_only=True)
class Update:
    """One update; the names are those of stable-baselines3.

    Attributes:
        batch_size: Decisions a step of the optimizer.
        clip_range: How far the ratio of probabilities counts.
        normalize_advantage: Whether the advantages of a minibatch get mean 0 and variance 1.
        ent_coef: Weight of the entropy.
        vf_coef: Weight of the critic's loss.
        max_grad_norm: Greatest norm of a gradient.
        target_kl: The update ends at 1.5 times this divergence from where it started; None for never.
    """

    batch_size: int
    clip_range: float
    normalize_advantage: bool
    ent_coef: float
    vf_coef: float
    max_grad_norm: float
    target_kl: float | None

    def learn(
        self, policy: FrontierPolicy, training_batch: TrainingBatch, orders: Sequence[Tensor]
    ) -> Learnt:
        """Learn from a rollout.

        Args:
            policy: It learns in place.
            training_batch: What the rollout teaches.
            orders: int64 (batch,) for each pass over the rollout, the order in which it is learnt from.
        """
        start = time.perf_counter()
        curves, parameters = defaultdict[str, list[float]](list), list(policy.parameters())
        passes = 0
        if not policy.actor_waits:
            training_batch = _seen_from_now(policy, training_batch)
        for order in orders:
            passes += 1
            if not all(
                self._step(policy, parameters, training_batch.take(chosen), curves)
                for chosen in parts_of(order, self.batch_size)
            ):
                break
        means = {name: float(np.mean(values)) for name, values in curves.items()}
        return Learnt(means, passes, time.perf_counter() - start)

    def _step(
        self,
        policy: FrontierPolicy,
        parameters: list[torch.nn.Parameter],
        part: TrainingBatch,
        curves: dict[str, list[float]],
    ) -> bool:
        """One minibatch; False, and nothing learnt, once the policy has moved too far."""
        value_loss = functional.mse_loss(policy.critic.values(part.batch)[:, 0], part.returns)
        curves["value_loss"].append(value_loss.item())
        loss = self.vf_coef * value_loss
        if not policy.actor_waits:
            actor_loss, divergence = self._actor_loss(policy, part, curves)
            if self.target_kl is not None and divergence > 1.5 * self.target_kl:
                return False
            loss = loss + actor_loss
        policy.optimizer.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        torch.nn.utils.clip_grad_norm_(parameters, self.max_grad_norm)
        policy.optimizer.step()
        return True

    def _actor_loss(
        self, policy: FrontierPolicy, part: TrainingBatch, curves: dict[str, list[float]]
    ) -> tuple[Tensor, float]:
        """The clipped surrogate loss less the entropy's share, and about how far the policy has moved."""
        log_probs = policy.actor.log_probs(part.batch, part.masks)
        change = log_probs.gather(1, part.actions[:, None])[:, 0] - part.log_probs
        ratio, advantages = change.exp(), part.advantages
        if self.normalize_advantage and len(advantages) > 1:
            advantages = (advantages - advantages.mean()) / (advantages.std() + 1e-8)
        clipped = ratio.clamp(1 - self.clip_range, 1 + self.clip_range)
        gain = (part.weights * torch.min(advantages * ratio, advantages * clipped)).mean()
        entropy = -(log_probs.exp() * log_probs).sum(dim=1).mean()
        with torch.no_grad():
            divergence = (ratio - 1 - change).mean().item()
            curves["clip_fraction"].append((clipped != ratio).float().mean().item())
        curves["approx_kl"].append(divergence)
        curves["entropy_loss"].append(-entropy.item())
        curves["policy_gradient_loss"].append(-gain.item())
        return -gain - self.ent_coef * entropy, divergence


def _seen_from_now(policy: FrontierPolicy, training_batch: TrainingBatch) -> TrainingBatch:
    """The training_batch with the probabilities of the actor as it is now, and weights for the difference."""
    with torch.no_grad():
        everybody = torch.arange(len(training_batch.actions), device=training_batch.actions.device)
        parts = [training_batch.take(chosen) for chosen in parts_of(everybody)]
        log_probs = torch.cat(
            [policy.actor.log_probs(p.batch, p.masks).gather(1, p.actions[:, None])[:, 0] for p in parts]
        )
        return training_batch._replace(
            log_probs=log_probs, weights=(log_probs - training_batch.log_probs).exp().clamp(max=_HEAVIEST)
        )
