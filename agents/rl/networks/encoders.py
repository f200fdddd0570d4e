"""Frontiers and their surroundings as vectors that know of each other.

Every encoder is equivariant under a permutation of the frontiers, and its weights do not depend on how many
there are (deep sets, Zaheer et al. 2017; attention without positions, Vaswani et al. 2017, Lee et al. 2019).
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from layoutexplore.agents.rl.card import PolicySpec
from layoutexplore.agents.rl.networks.frontier_batch import FrontierBatch
from layoutexplore.agents.rl.networks.pooling import pool, spread


class Encoder(nn.Module):
    """What the encoders share: how the frontiers, the robot and the map are read.

    Args:
        spec: What is read and the network's shape.
    """

    def __init__(self, spec: PolicySpec) -> None:
        super().__init__()
        width = spec.network.width
        self.frontier = nn.Linear(len(spec.frontier_features), width)
        self.robot = nn.Linear(len(spec.robot_features) + 1, width)
        self.map = _map_encoder(len(spec.map_channels), width) if spec.map_channels else None

    def forward(self, batch: FrontierBatch) -> tuple[Tensor, Tensor]:
        """The context (batch, width) and the frontiers (n, width)."""
        raise NotImplementedError

    def surroundings(self, batch: FrontierBatch) -> Tensor:
        """What no frontier says: robot and map, (batch, width)."""
        context = self.robot(batch.robot)
        if self.map is not None and batch.maps is not None:
            context = context + self.map(batch.maps.float() / 255.0)
        return torch.as_tensor(context)


class PooledEncoder(Encoder):
    """Each frontier beside the mean and the greatest values over all: the encoder that costs least.

    The sums over a set (Zaheer et al. 2017, eq. 4) are weighed once for all of its frontiers.

    Args:
        spec: What is read and the network's shape.
        layers: How often the frontiers see each other before they are summed up.
    """

    def __init__(self, spec: PolicySpec, layers: int) -> None:
        super().__init__(spec)
        width = spec.network.width
        self.layers = nn.ModuleList(_Pooled(width) for _ in range(layers))
        self.join = nn.Linear(2 * width, width)

    def forward(self, batch: FrontierBatch) -> tuple[Tensor, Tensor]:
        """The context (batch, width) and the frontiers (n, width)."""
        context, owners, counts = self.surroundings(batch), batch.owners, batch.counts
        tokens = functional.relu(self.frontier(batch.frontiers) + spread(context, owners, counts))
        for layer in self.layers:
            tokens = layer(tokens, owners, counts)
        return functional.relu(self.join(pool(tokens, counts)) + context), tokens


class _Pooled(nn.Module):
    """A frontier and what all have in common."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.own = nn.Linear(width, width)
        self.shared = nn.Linear(2 * width, width, bias=False)

    def forward(self, tokens: Tensor, owners: Tensor, counts: Tensor) -> Tensor:
        shared = self.shared(pool(tokens, counts))
        return functional.relu(self.own(tokens) + spread(shared, owners, counts))


class TokenEncoder(Encoder):
    """A token a frontier and one for everything else, in layers that see all tokens of a decision.

    Args:
        spec: What is read and the network's shape.
    """

    def __init__(self, spec: PolicySpec) -> None:
        super().__init__(spec)
        config = spec.network
        attends = config.encoder == "attention"
        self.layers = nn.ModuleList(
            _Attention(config.width, config.heads) if attends else _DeepSet(config.width)
            for _ in range(config.layers)
        )
        self.norm = nn.LayerNorm(config.width)

    def forward(self, batch: FrontierBatch) -> tuple[Tensor, Tensor]:
        """The context (batch, width) and the frontiers (n, width)."""
        counts, owners = batch.counts, batch.owners
        most = int(counts.max()) if len(counts) else 0
        present = torch.arange(1 + most, device=counts.device) <= counts[:, None]
        places = (
            1 + torch.arange(len(owners), device=counts.device) - (torch.cumsum(counts, 0) - counts)[owners]
        )
        context, frontiers = self.surroundings(batch), self.frontier(batch.frontiers)
        tokens = functional.pad(context[:, None], (0, 0, 0, most)).index_put((owners, places), frontiers)
        for layer in self.layers:
            tokens = layer(tokens, present)
        tokens = self.norm(tokens)
        return tokens[:, 0], tokens[owners, places]


class _Attention(nn.Module):
    """A transformer layer, normalised first; tokens that are not present are not looked at."""

    def __init__(self, width: int, heads: int) -> None:
        super().__init__()
        self.heads = heads
        self.norm = nn.LayerNorm(width)
        self.look = nn.Linear(width, 3 * width)
        self.join = nn.Linear(width, width)
        self.think = _thinking(width, width)

    def forward(self, tokens: Tensor, present: Tensor) -> Tensor:
        batch, count, width = tokens.shape
        parts = self.look(self.norm(tokens)).reshape(batch, count, 3, self.heads, -1).permute(2, 0, 3, 1, 4)
        seen = functional.scaled_dot_product_attention(
            parts[0], parts[1], parts[2], attn_mask=present[:, None, None, :]
        )
        tokens = tokens + self.join(seen.transpose(1, 2).reshape(batch, count, width))
        return tokens + torch.as_tensor(self.think(tokens))


class _DeepSet(nn.Module):
    """Every token sees itself, the mean and the greatest values over all."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.think = _thinking(3 * width, width)

    def forward(self, tokens: Tensor, present: Tensor) -> Tensor:
        there = present[..., None]
        mean = (tokens * there).sum(dim=1) / there.sum(dim=1)
        greatest = tokens.masked_fill(~there, -torch.inf).amax(dim=1)
        pooled = torch.cat([mean, greatest], dim=1)[:, None].expand(-1, tokens.shape[1], -1)
        return tokens + torch.as_tensor(self.think(torch.cat([tokens, pooled], dim=2)))


def make_encoder(spec: PolicySpec, *, scores: bool) -> Encoder:
    """The encoder of a spec; one that scores frontiers lets them see each other, a sum need not."""
    if spec.network.encoder == "pooled":
        return PooledEncoder(spec, spec.network.layers if scores else spec.network.layers - 1)
    return TokenEncoder(spec)


def _thinking(inside: int, width: int) -> nn.Sequential:
    return nn.Sequential(
        nn.LayerNorm(inside), nn.Linear(inside, 2 * width), nn.GELU(), nn.Linear(2 * width, width)
    )


def _map_encoder(channels: int, width: int) -> nn.Sequential:
    """A small convolutional network; it ends in a mean over the map, so that its size is free."""
    return nn.Sequential(
        nn.Conv2d(channels, 16, 5, stride=2, padding=2),
        nn.ReLU(),
        nn.Conv2d(16, 32, 3, stride=2, padding=1),
        nn.ReLU(),
        nn.Conv2d(32, width, 3, stride=2, padding=1),
        nn.ReLU(),
        nn.AdaptiveAvgPool2d(1),
        nn.Flatten(),
    )
