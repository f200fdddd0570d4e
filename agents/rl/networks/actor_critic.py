"""Which frontier next: a score for each, from what it is, what the others are, and the map as a whole.

The scores are equivariant under a permutation of the frontiers and the weights do not depend on how many
there are. The logits start at the place in a short tour less the detour, so that an untrained network prefers
what the tour does and tries first what costs little, and learn what to do otherwise; without a tour, the way
takes the detour's place. The critic is a network of its own, which may also see what only training knows
(Pinto et al. 2018).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from layoutexplore.agents.rl.card import PolicySpec
from layoutexplore.agents.rl.networks.encoders import make_encoder
from layoutexplore.agents.rl.networks.frontier_batch import FrontierBatch, Reader
from layoutexplore.grids.arrays import Floats32, Ints, Mask

_NEVER = -1e8
"""The logit of an action that is not allowed."""


class Actor(nn.Module):
    """Logits of the frontiers and of stopping.

    Args:
        spec: What is read and the network's shape.
    """

    def __init__(self, spec: PolicySpec) -> None:
        super().__init__()
        config, features = spec.network, spec.frontier_features
        self.read = Reader(spec)
        encodes = config.encoder != "none"
        self.encode = make_encoder(spec, scores=True) if encodes else None
        self.score = _zero(nn.Linear(config.width, 1)) if encodes else None
        self.direct = _zero(nn.Linear(len(features), 1, bias=False))
        self.tour_weight = nn.Parameter(torch.tensor(float(config.tour_weight)))
        self.stop = _zero(nn.Linear(config.width if encodes else 1, 1))
        self._rank = spec.rank_column
        with torch.no_grad():
            self.direct.weight[0, features.index(spec.cost_feature)] = -config.detour_weight

    def forward(self, observation: Mapping[str, Tensor]) -> Tensor:
        """float32 (batch, slots + 1): logits; those of empty slots mean nothing."""
        return self.logits(self.read(observation))

    def logits(self, batch: FrontierBatch) -> Tensor:
        """The same of decisions that have been read."""
        frontiers = batch.frontiers
        scores = self.direct(frontiers)[:, 0]
        context = frontiers.new_zeros(len(batch.counts), 1)
        if self.encode is not None and self.score is not None:
            context, tokens = self.encode(batch)
            scores = scores + self.score(tokens)[:, 0]
        if self._rank is not None:
            scores = scores + self.tour_weight * frontiers[:, self._rank]
        return torch.cat([batch.in_slots(scores), self.stop(context)], dim=1)

    def soften(self, temperature: float) -> None:
        """Divide all logits from now on: what is chosen first stays so, and is less certain."""
        with torch.no_grad():
            last = [layer for layer in (self.score, self.direct, self.stop) if layer is not None]
            for weight in (*(w for layer in last for w in layer.parameters()), self.tour_weight):
                weight.div_(temperature)

    def log_probs(self, batch: FrontierBatch, masks: Tensor) -> Tensor:
        """float32 (batch, slots + 1): logarithms of probabilities, given what is allowed, bool alike."""
        return functional.log_softmax(self.logits(batch).masked_fill(~masks, _NEVER), dim=1)

    def draw(
        self, observation: Mapping[str, NDArray[Any]], masks: Mask, gumbel: Tensor
    ) -> tuple[Ints, Floats32]:
        """Actions (batch,) drawn with given random numbers, and the logarithms of their probabilities.

        Args:
            observation: By name, (batch, ...).
            masks: bool (batch, slots + 1), which actions are allowed.
            gumbel: float32 (batch, slots + 1) on the CPU, from the standard Gumbel distribution.
        """
        with torch.inference_mode():
            device = self.tour_weight.device
            seen = {name: torch.as_tensor(array, device=device) for name, array in observation.items()}
            log_probs = self.log_probs(self.read(seen), torch.as_tensor(masks, device=device)).cpu()
            actions = (log_probs + gumbel).argmax(dim=1)
            return actions.numpy(), log_probs.gather(1, actions[:, None])[:, 0].numpy()


class Critic(nn.Module):
    """The expected return; it may see the key `privileged`.

    Args:
        spec: What is read and the network's shape.
        privileged: Size of `privileged`, 0 for none.
    """

    def __init__(self, spec: PolicySpec, privileged: int) -> None:
        super().__init__()
        width = spec.network.width
        self.read = Reader(spec)
        self.encode = make_encoder(spec, scores=False)
        self.privileged = privileged
        self.value = nn.Sequential(
            nn.Linear(width + privileged, width),
            nn.GELU(),
            nn.Linear(width, width),
            nn.GELU(),
            nn.Linear(width, 1),
        )

    def forward(self, observation: Mapping[str, Tensor]) -> Tensor:
        """float32 (batch, 1): values."""
        return self.values(self.read(observation))

    def values(self, batch: FrontierBatch) -> Tensor:
        """The same of decisions that have been read."""
        context, _ = self.encode(batch)
        if self.privileged and batch.privileged is not None:
            context = torch.cat([context, batch.privileged], dim=1)
        return torch.as_tensor(self.value(context))


def _zero(layer: nn.Linear) -> nn.Linear:
    """A layer that starts by saying nothing."""
    nn.init.zeros_(layer.weight)
    if layer.bias is not None:
        nn.init.zeros_(layer.bias)
    return layer
