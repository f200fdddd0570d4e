"""Which frontier next: a score for each, from what it is, what the others are, and the map as a whole.

The scores are equivariant under a permutation of the frontiers and the weights do not depend on how many there are (deep sets,
Zaheer et al. 2017; attention without positions, Lee et al. 2019). The logits start at the place in a short tour less the
detour, so that an untrained network prefers what the tour does and tries first what costs little, and learn what to do
otherwise. The critic is a network of its own, which
may also see what only training knows (Pinto et al. 2018).
"""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import Tensor, nn
from torch.nn import functional

from layoutexplore.agents.rl.card import PolicySpec
from layoutexplore.envs.map_images import CHANNELS, LAYOUT_CHANNELS
from layoutexplore.envs.observation import FRONTIER_FEATURES, ROBOT_FEATURES

FEW = 10.0
"""The number of frontiers that counts as 1."""


class Actor(nn.Module):
    """Logits of the frontiers and of stopping.

    Args:
        spec: What is read and the network's shape.
    """

    def __init__(self, spec: PolicySpec) -> None:
        super().__init__()
        config, count = spec.network, len(spec.frontier_features)
        self.read = Reader(spec)
        encodes = config.encoder != "none"
        self.encode = _encoder(spec) if encodes else None
        self.score = _zero(nn.Linear(config.width, 1)) if encodes else None
        self.direct = _zero(nn.Linear(count, 1, bias=False))
        self.tour_weight = nn.Parameter(torch.tensor(config.tour_weight))
        self.stop = _zero(nn.Linear(config.width if encodes else 1, 1))
        self._tour = spec.frontier_features.index("tour_rank")
        with torch.no_grad():
            self.direct.weight[0, spec.frontier_features.index("detour")] = -config.detour_weight

    def forward(self, observation: Mapping[str, Tensor]) -> Tensor:
        """float32 (batch, slots + 1): logits; those of empty slots mean nothing."""
        slots = observation["frontiers"].shape[1] // len(FRONTIER_FEATURES)
        frontiers, valid, robot, maps = self.read(observation)
        scores = self.direct(frontiers)[..., 0]
        context = frontiers.new_zeros(len(scores), 1)
        if self.encode is not None and self.score is not None:
            context, places = self.encode(frontiers, valid, robot, maps)
            scores = scores + self.score(places)[..., 0]
        scores = scores + self.tour_weight * frontiers[..., self._tour]
        return torch.cat([functional.pad(scores, (0, slots - scores.shape[1])), self.stop(context)], dim=1)


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
        self.encode = _encoder(spec)
        self.privileged = privileged
        self.value = nn.Sequential(
            nn.Linear(width + privileged, width), nn.GELU(), nn.Linear(width, width), nn.GELU(), nn.Linear(width, 1)
        )

    def forward(self, observation: Mapping[str, Tensor]) -> Tensor:
        """float32 (batch, 1): values."""
        context, _ = self.encode(*self.read(observation))
        if self.privileged:
            context = torch.cat([context, torch.asinh(observation["privileged"])], dim=1)
        return torch.as_tensor(self.value(context))


class Reader(nn.Module):
    """Takes what the policy reads out of an observation, by name.

    Lengths and areas are compressed by asinh, which keeps small ones as they are and needs no statistics.
    """

    def __init__(self, spec: PolicySpec) -> None:
        super().__init__()
        self._columns = [list(FRONTIER_FEATURES).index(name) for name in spec.frontier_features]
        self._robot = [list(ROBOT_FEATURES).index(name) for name in spec.robot_features]
        self._tour = spec.frontier_features.index("tour_rank")
        channels = CHANNELS + LAYOUT_CHANNELS
        self._channels = [channels.index(name) for name in spec.map_channels]

    def forward(self, observation: Mapping[str, Tensor]) -> tuple[Tensor, Tensor, Tensor, Tensor | None]:
        """Frontiers (batch, slots, columns), bool (batch, slots) which exist, robot (batch, entries), map or None.

        The slots end with the last one that any of the batch fills.
        """
        table = observation["frontiers"]
        table = table.reshape(len(table), -1, len(FRONTIER_FEATURES))
        valid = table[..., list(FRONTIER_FEATURES).index("valid")] > 0
        used = valid.any(dim=0).nonzero()
        slots = int(used[-1]) + 1 if len(used) else 0
        table, valid = table[:, :slots], valid[:, :slots]
        chosen = table[..., self._columns]
        frontiers = torch.asinh(chosen)
        frontiers[..., self._tour] = chosen[..., self._tour]
        count = valid.sum(dim=1, keepdim=True) / FEW
        robot = torch.cat([torch.asinh(observation["robot"][:, self._robot]), torch.log1p(count)], dim=1)
        maps = observation["global_map"][:, self._channels].float() / 255.0 if self._channels else None
        return frontiers, valid, robot, maps


class _Encoder(nn.Module):
    """Frontiers and their surroundings as vectors: a token a frontier and one for everything else."""

    def __init__(self, spec: PolicySpec, layers: list[nn.Module]) -> None:
        super().__init__()
        width = spec.network.width
        self.frontier = nn.Linear(len(spec.frontier_features), width)
        self.robot = nn.Linear(len(spec.robot_features) + 1, width)
        self.map = _map_encoder(len(spec.map_channels), width) if spec.map_channels else None
        self.layers = nn.ModuleList(layers)
        self.norm = nn.LayerNorm(width)

    def forward(self, frontiers: Tensor, valid: Tensor, robot: Tensor, maps: Tensor | None) -> tuple[Tensor, Tensor]:
        """The context (batch, width) and the frontiers (batch, slots, width)."""
        context = self.robot(robot)
        if self.map is not None:
            context = context + self.map(maps)
        tokens = torch.cat([context[:, None], self.frontier(frontiers)], dim=1)
        present = functional.pad(valid, (1, 0), value=True)
        for layer in self.layers:
            tokens = layer(tokens, present)
        tokens = self.norm(tokens)
        return tokens[:, 0], tokens[:, 1:]


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
        seen = functional.scaled_dot_product_attention(parts[0], parts[1], parts[2], attn_mask=present[:, None, None, :])
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


def _encoder(spec: PolicySpec) -> _Encoder:
    config = spec.network
    if config.encoder == "attention":
        return _Encoder(spec, [_Attention(config.width, config.heads) for _ in range(config.layers)])
    return _Encoder(spec, [_DeepSet(config.width) for _ in range(config.layers)])


def _thinking(inside: int, width: int) -> nn.Sequential:
    return nn.Sequential(nn.LayerNorm(inside), nn.Linear(inside, 2 * width), nn.GELU(), nn.Linear(2 * width, width))


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


def _zero(layer: nn.Linear) -> nn.Linear:
    """A layer that starts by saying nothing."""
    nn.init.zeros_(layer.weight)
    if layer.bias is not None:
        nn.init.zeros_(layer.bias)
    return layer
